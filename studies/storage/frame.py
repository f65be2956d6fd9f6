"""The layout of a combined data set: axes, grids, variables, and the place of each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import h5netcdf
import h5py
import numpy as np
from h5py import h5d, h5p, h5s

from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.definition.vocabulary import MISSING
from studies.storage import dataset as layout
from studies.storage.estimated import (
    ANCILLARY,
    WITHOUT,
    described,
    errors_of,
    numbers_in,
    of_requested,
    without,
)
from studies.storage.runfile import variables

SAME = 1e-9
"""Relative difference below which two grids are the same."""
FRACTION = "_fraction"
"""Suffix of the index of grids that differ from run to run only in scale."""
SETS = "sets"
"""Attribute of an axis of labels or points: the coordinates that it sets."""
_PIECE = 32
"""Least number of values along a dimension in a compressed chunk, if lengths differ."""
NO_COORDINATE = "_nc4_non_coord_"
"""Prefix of the HDF5 name of a variable that has the name of a dimension, but is no coordinate."""


@dataclass(slots=True, kw_only=True)
class Frame:
    """Layout of the combined data set, found from the runs, with all small variables in memory.

    Attributes
    ----------
    scene, axes, usual : the scene; all sweep dimensions with their values; those of a run's file
    linked : parameter set by a linked axis or by points -> the axis, the values over it
    labels : labelled dimension -> union of the labels
    grids, sizes, shortest : numeric dimension -> the grid, the longest of several that agree; the
        greatest length; the smallest
    ragged : numeric dimensions whose grid differs from run to run
    shares : numeric dimension -> its grid / the largest position on it, None if these differ
    fields : variable -> (dimensions after the sweep's, attributes)
    small : variable -> its values over the sweep: scalars, flags, texts
    """

    scene: Scene
    axes: Mapping[str, Sequence[Any]]
    usual: Sequence[str]
    linked: dict[str, tuple[str, list[Any]]]
    labels: dict[str, list[str]] = field(default_factory=dict)
    grids: dict[str, np.ndarray] = field(default_factory=dict)
    sizes: dict[str, int] = field(default_factory=dict)
    shortest: dict[str, int] = field(default_factory=dict)
    ragged: set[str] = field(default_factory=set)
    shares: dict[str, np.ndarray | None] = field(default_factory=dict)
    fields: dict[str, tuple[list[str], dict[str, Any]]] = field(default_factory=dict)
    small: dict[str, tuple[np.ndarray, dict[str, Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("status", "message"):
            self._hold(name, np.dtype(object))

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each sweep dimension."""
        return tuple(len(values) for values in self.axes.values())

    def _with_auxiliary(self, attributes: Mapping[str, Any]) -> dict[str, Any]:
        """Return the attributes of a variable over the sweep with its auxiliary coordinates.

        These are coordinates that are not dimensions, those of the sweep and its own, as far as the
        runs have them: those of a plane have no z.
        """
        own = attributes.get("coordinates", "").split()
        every = [*self.linked, *(each for each in own if each in self.fields or each in self.small)]
        rest = {name: value for name, value in attributes.items() if name != "coordinates"}
        return rest | ({"coordinates": " ".join(every)} if every else {})

    def learn(self, run: h5py.File, at: tuple[int, ...]) -> None:
        """Add the grids and variables of one run, and its small values."""
        for name in variables(run):
            if name in self.usual or name in self.fields:
                continue
            if name in self.small and self.small[name][0].dtype.kind != "O":
                self.small[name][0][at] = _number(run, name)
                continue
            variable = run[name]
            if variable.is_scale:
                self._learn_coordinate(name, _values(variable))
            elif variable.ndim > len(self.usual):
                inner = [axis[0].name.strip("/") for axis in variable.dims][len(self.usual) :]
                self.fields[name] = (inner, _attributes(name, self.scene))
            else:
                if name not in self.small:
                    self._hold(name, variable.dtype)
                self.small[name][0][at] = _values(variable).item()

    def _hold(self, name: str, kind: np.dtype[Any]) -> None:
        empty = np.full(self.shape, _absent(name, kind), dtype=kind)
        self.small[name] = (empty, layout.attributes_of(name, self.scene))

    def _learn_coordinate(self, name: str, values: np.ndarray) -> None:
        if values.dtype.kind not in "fi":
            known = self.labels.setdefault(name, [])
            known.extend(label for label in values if label not in known)
            return
        self._learn_share(name, values)
        grid = self.grids.setdefault(name, values)
        self.sizes[name] = max(self.sizes.get(name, 0), len(values))
        self.shortest[name] = min(self.shortest.get(name, len(values)), len(values))
        both = min(len(grid), len(values))
        tolerance = SAME * np.abs(grid).max(initial=0.0)
        if not np.allclose(grid[:both], values[:both], rtol=0.0, atol=tolerance):
            self.ragged.add(name)
        elif len(values) > len(grid):
            self.grids[name] = values

    def _learn_share(self, name: str, values: np.ndarray) -> None:
        most = np.abs(values).max(initial=0.0)
        share = values / most if most > 0 else None
        known = self.shares.setdefault(name, share)
        if (
            known is None
            or share is None
            or len(known) != len(share)
            or not np.allclose(known, share, rtol=0.0, atol=SAME)
        ):
            self.shares[name] = None

    @property
    def fractions(self) -> dict[str, np.ndarray]:
        """Grids that differ from run to run only in scale, as fractions of their largest value."""
        found = {name: self.shares[name] for name in sorted(self.ragged)}
        return {name: share for name, share in found.items() if share is not None}

    def create_axes(self, file: h5netcdf.File) -> None:
        """Create the dimensions and their coordinates."""
        lengths = dict(zip(self.axes, self.shape, strict=True)) | self.sizes
        file.dimensions = lengths | {name: len(labels) for name, labels in self.labels.items()}
        for name, (dims, values, attributes) in axis_variables(
            self.scene, self.axes, self.linked
        ).items():
            _write(file, name, dims, values, attributes)
        for name, labels in self.labels.items():
            texts = np.array(labels, dtype=object)
            _write(file, name, (name,), texts, layout.attributes_of(name))
        for name, grid in self.grids.items():
            if name in self.ragged:
                self.fields[name] = ([name], _attributes(name))
            else:
                _write(file, name, (name,), grid, _attributes(name))
        for name, share in self.fractions.items():
            words = f"{name} / the largest {name} of the run"
            attrs = {"long_name": words, "units": "1"}
            _write(file, f"{name}{FRACTION}", (name,), share, attrs)

    def create_fields(self, file: h5py.File) -> None:
        """Create the variables that are written run by run.

        A run has one compressed chunk, or several along a dimension that is longer in other runs,
        so that the missing length is not written.
        """
        for name, (inner, attributes) in self.fields.items():
            sizes = [self.sizes.get(each) or len(self.labels[each]) for each in inner]
            pieces = [max(self.shortest.get(each, _PIECE), _PIECE) for each in inner]
            _created(
                file,
                NO_COORDINATE + name if name in self.ragged else name,
                (*self.axes, *inner),
                np.dtype(float),
                self._with_auxiliary(attributes),
                chunks=(*(1,) * len(self.axes), *map(min, sizes, pieces)),
                compression="gzip",
                compression_opts=1,
                shuffle=True,
            )

    def name_errors(self, beside: Mapping[str, layout.Variable]) -> dict[str, str]:
        """Name the estimated error of each number in its attributes, and return those without.

        Numbers that are written ``beside`` count, too.
        """
        small = {name: ((), attributes) for name, (_, attributes) in self.small.items()}
        every, requested = described(beside) | small | self.fields, of_requested(self.scene)
        for name, (_, attributes) in (small | self.fields).items():
            if found := errors_of(name, every, requested):
                attributes[ANCILLARY] = " ".join(found)
        numbers = [name for name, (values, _) in self.small.items() if values.dtype.kind == "f"]
        results = [*numbers, *self.fields, *numbers_in(beside)]
        return {WITHOUT: without(every, results, requested)}

    def fill(self, file: h5py.File, run: h5py.File, at: tuple[int, ...]) -> None:
        """Write the fields of one run in their place, compressed as in its file where that fits."""
        places = cache(partial(self._places, run))
        for name, (inner, _) in self.fields.items():
            if name.encode() in run.id:
                source = _id(run, name)
                target = _id(file, NO_COORDINATE + name if name in self.ragged else name)
                labelled = [places(each) for each in inner if each in self.labels]
                in_order = all(each == list(range(len(each))) for each in labelled)
                if in_order and _chunk_copied(source, target, at):
                    continue
                values = _values(h5py.Dataset(source))
                values = values.reshape(values.shape[values.ndim - len(inner) :])
                if not in_order:  # other labels in between
                    whole = np.full(tuple(map(self._extent, inner, values.shape)), np.nan)
                    whole[np.ix_(*map(places, inner))] = values
                    values = whole
                h5py.Dataset(target)[(*at, *map(slice, values.shape))] = values

    def write_small(self, file: h5py.File) -> None:
        """Write the variables that are in memory."""
        for name, (values, attributes) in self.small.items():
            words = self._with_auxiliary(attributes)
            _created(file, name, tuple(self.axes), values.dtype, words)[...] = values

    def _extent(self, dimension: str, length: int) -> int:
        """Return the end up to which a run with this length writes along a dimension."""
        return len(self.labels[dimension]) if dimension in self.labels else length

    def _places(self, run: h5py.File, dimension: str) -> list[int]:
        """Return the positions of a run's points along a dimension in the combined one."""
        if dimension in self.labels:
            return [self.labels[dimension].index(label) for label in _values(run[dimension])]
        return list(range(len(run[dimension])))


def write_beside(file: h5netcdf.File, variables: Mapping[str, layout.Variable]) -> None:
    """Write variables with dimensions of their own, or of the sweep."""
    for name, (dims, values, attributes) in variables.items():
        for dim, size in zip(dims, values.shape, strict=True):
            if dim not in file.dimensions:
                file.dimensions[dim] = size
        _write(file, name, dims, values, attributes)


def axis_variables(
    scene: Scene, axes: Mapping[str, Sequence[Any]], linked: Mapping[str, tuple[str, list[Any]]]
) -> dict[str, layout.Variable]:
    """Return the coordinates of a sweep: its axes, and what axes of labels or points set."""
    own = {name: (name, values) for name, values in axes.items()}
    found = {}
    for name, (axis, values) in (own | dict(linked)).items():
        attributes = _axis_attributes(scene, name)
        if sets := [parameter for parameter, (by, _) in linked.items() if by == name]:
            attributes |= {SETS: " ".join(sets)}
        found[name] = layout.Variable((axis,), layout.axis_array(values), attributes)
    return found


def _axis_attributes(scene: Scene, name: str) -> dict[str, str]:
    """Return the attributes of a parameter of the scene, or of an axis of labels or points."""
    known = name in parameters_of(scene)
    return layout.axis_attributes(scene, name) if known else layout.attributes_of(name)


def _attributes(name: str, scene: Scene | None = None) -> dict[str, Any]:
    """Return the attributes of a variable of numbers or of a grid, by rules of CF.

    Values of flags have the type of the variable (section 3.5), and an axis Z is vertical (4.3),
    which the position across a track is not.
    """
    found: dict[str, Any] = dict(layout.attributes_of(name, scene))
    if found.get("axis") == "Z":
        del found["axis"]
    if "flag_values" in found:
        found["flag_values"] = np.asarray(found["flag_values"], dtype=float)
    return found


def _values(variable: h5py.Dataset) -> np.ndarray:
    """Return all values; texts as str."""
    return variable.asstr()[...] if variable.dtype.kind == "O" else variable[...]


def _write(
    file: h5netcdf.File,
    name: str,
    dimensions: Sequence[str],
    values: np.ndarray,
    attributes: Mapping[str, Any],
) -> None:
    """Write a variable that is complete, a coordinate for instance: it has no fill value."""
    text = values.dtype.kind == "O"
    variable = file.create_variable(
        name,
        tuple(dimensions),
        dtype=h5py.string_dtype() if text else values.dtype,
        fletcher32=bool(dimensions) and not text,
    )
    variable[...] = values
    variable.attrs.update(attributes)


def _created(
    file: h5py.File,
    name: str,
    dimensions: Sequence[str],
    kind: np.dtype[Any],
    attributes: Mapping[str, Any],
    **storage: Any,
) -> h5py.Dataset:
    """Create a variable that has a value for absent runs, over dimensions of the file.

    To netCDF it is an HDF5 data set with a scale for each dimension. h5netcdf takes five times as
    long to make it.
    """
    scales = [file[dimension] for dimension in dimensions]
    text, absent = kind.kind == "O", _absent(name, kind)
    made = h5p.create(h5p.DATASET_CREATE)
    if dimensions and not text:  # before compression, as netCDF does in the files of runs
        made.set_fletcher32()
        storage = {"chunks": True} | storage
    variable = file.create_dataset(
        name,
        tuple(map(len, scales)),
        dtype=h5py.string_dtype() if text else kind,
        fillvalue=None if text else absent,
        track_order=True,
        dcpl=made,
        **storage,
    )
    for axis, scale in zip(variable.dims, scales, strict=True):
        axis.attach_scale(scale)
    if not text:
        variable.attrs["_FillValue"] = np.array([absent], dtype=kind)
    variable.attrs.update(attributes)
    return variable


def _id(file: h5py.File, name: str) -> h5d.DatasetID:
    """Return a variable without h5py's objects: all of a run are read in half the time."""
    return h5d.open(file.id, name.encode())


def _number(run: h5py.File, name: str) -> Any:
    """Return the only value of a variable."""
    variable = _id(run, name)
    found = np.empty(variable.shape, variable.dtype)
    variable.read(h5s.ALL, h5s.ALL, found)
    return found.item()


def _chunk_copied(source: h5d.DatasetID, target: h5d.DatasetID, at: tuple[int, ...]) -> bool:
    """Copy the chunk of a run as it is stored, if both store it alike; return whether they do."""
    shape, made = source.shape, source.get_create_plist()
    if made.get_layout() != h5d.CHUNKED or made.get_chunk() != shape:
        return False
    inner = source.rank + len(at) - target.rank  # its number of usual dimensions
    chunk, theirs = (*(1,) * len(at), *shape[inner:]), target.get_create_plist()
    alike = theirs.get_chunk() == chunk and _stored(source, made) == _stored(target, theirs)
    if not alike or source.get_num_chunks() != 1:
        return False
    mask, content = source.read_direct_chunk((0,) * source.rank)
    target.write_direct_chunk((*at, *(0,) * (target.rank - len(at))), content, mask)
    return True


def _stored(variable: h5d.DatasetID, made: h5p.PropDCID) -> list[Any]:
    """Return the kind of a variable's numbers and the filters of its chunks."""
    return [variable.dtype, *(made.get_filter(k)[:3] for k in range(made.get_nfilters()))]


def _absent(name: str, kind: np.dtype[Any]) -> Any:
    """Return the value for a run that does not have this variable."""
    if name == "status":
        return MISSING
    return {"f": np.nan, "i": layout.INTEGER_FILL, "O": ""}[kind.kind]
