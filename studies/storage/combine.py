"""The runs of a study laid side by side in one data set, written run by run."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import h5netcdf
import h5py
import numpy as np

from solver.scenes import Scene
from studies.definition.cases import Case
from studies.definition.parameters import parameters_of
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK, STATUSES, SYMMETRIC
from studies.errors import RunUnreadable
from studies.storage import dataset as layout
from studies.storage.appearing import appearing
from studies.storage.held import Combined
from studies.storage.provenance import provenance, together, what_ran
from studies.storage.room import Reservoir, needs_room
from studies.storage.runfile import global_attributes, opened, variables
from studies.storage.store import Store

SAME = 1e-9
"""Relative difference below which two runs are taken to have the same grid."""
_PIECE = 32
"""Values along a dimension that are compressed together at least, where lengths differ."""
_NO_COORDINATE = "_nc4_non_coord_"
"""Before the name HDF5 has for a variable called like a dimension whose coordinate it is not."""


def combine(study: Study, store: Store, cases: Iterable[Case]) -> Combined:
    """Write the combined data set of `study`, and return what it holds.

    Sweep dimensions come first: the usual ones, then the other axes. What a linked axis sets is a
    coordinate over its labels. Runs are matched by *label* along labelled dimensions
    (``component``, ``stage``, ``body``), which get the union of the labels; along numeric ones
    (``x``, ``depth``) too where all runs have the same grid, or the beginning of the longest. Where
    grids differ, as when a length is swept, runs are matched by position, and ``x`` becomes a
    variable over the sweep. Shorter grids are filled up with NaN. Runs without a record are NaN.
    """
    places = {case.id: case.index for case in cases}
    while True:
        found = {key: at for key, at in places.items() if store.run_path(key).exists()}
        try:
            return _combined(study, store, found, [key for key in places if key not in found])
        except RunUnreadable as error:  # what it left in the data set must go: from the beginning
            store.set_aside(error)


def _combined(
    study: Study, store: Store, found: Mapping[str, tuple[int, ...]], missing: Sequence[str]
) -> Combined:
    scene = study.problem
    target = store.dataset_path(study.id)
    usual = layout.usual_dimensions(scene)
    frame = _Frame(scene=scene, axes=_axes(study, scene), usual=usual, linked=study.linked)
    ran: set[tuple[str, str]] = set()
    halves: set[int] = set()
    outcomes: dict[str, tuple[str, str]] = {}
    places: dict[str, tuple[int, ...]] = {}
    for run_id, index in found.items():
        own = dict(zip(study.axes, index, strict=True))
        at = places[run_id] = tuple(own.get(name, 0) for name in frame.axes)
        with opened(store.run_path(run_id)) as run:
            frame.learn(run, at)
            code, message = (frame.small[name][0][at] for name in ("status", "message"))
            outcomes[run_id] = STATUSES[code], str(message)
            ran.add(what_ran(global_attributes(run)))
            if SYMMETRIC in run.attrs:  # a run without a record does not know
                halves.add(int(run.attrs[SYMMETRIC].item()))
    told = provenance(study.name, scene, study.fixed) | together(ran)
    store.clear_directory(target)
    with needs_room(store.directory), appearing(target) as part, Reservoir(part) as disk:
        with h5netcdf.File(disk, "w") as file:
            file.attrs.update(told | {"id": study.id, SYMMETRIC: int(halves == {1})})
            frame.create_axes(file, scene)
            frame.create_fields(file)
            frame.write_small(file)
        disk.check()
        with h5py.File(disk, "r+") as file:
            for run_id, at in places.items():
                with opened(store.run_path(run_id)) as run:
                    frame.fill(file, run, at)
                disk.check()
        disk.check()
    counts = Counter([status for status, _ in outcomes.values()] + [MISSING] * len(missing))
    return Combined(
        path=target,
        counts=dict(counts),
        failed=[(run_id, *each) for run_id, each in outcomes.items() if each[0] != OK],
        missing=missing,
        anew=True,
    )


def _axes(study: Study, scene: Scene) -> dict[str, list[Any]]:
    """Return all sweep dimensions; a usual one that is not swept has its single value."""
    values = next(study.cases()).values
    usual = [name for name in layout.usual_dimensions(scene) if name not in study.linked]
    return {name: [values[name]] for name in usual} | study.axes


@dataclass(slots=True, kw_only=True)
class _Frame:
    """Shape of the combined data set, learnt from the runs, and what is small enough to hold.

    Attributes
    ----------
    scene, axes, usual : all sweep dimensions with their values; those that a run's file has
    linked : parameter set by a linked axis -> the axis, the values over it
    labels : labelled dimension -> union of the labels
    grids, sizes, shortest : numeric dimension -> the grid found, of several alike the longest;
        the greatest length; the smallest
    ragged : numeric dimensions whose grid differs from run to run
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
    fields: dict[str, tuple[list[str], dict[str, Any]]] = field(default_factory=dict)
    small: dict[str, tuple[np.ndarray, dict[str, Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, kind in (("status", np.dtype(np.int8)), ("message", np.dtype(object))):
            self._hold(name, kind)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each sweep dimension."""
        return tuple(len(values) for values in self.axes.values())

    @property
    def auxiliary(self) -> dict[str, str]:
        """CF attribute of a variable over the sweep: its coordinates that are no dimensions."""
        return {"coordinates": " ".join(self.linked)} if self.linked else {}

    def learn(self, run: h5py.File, at: tuple[int, ...]) -> None:
        """Take in the grids and variables of one run, and its values that are small."""
        for name in variables(run):
            if name in self.usual or name in self.fields:
                continue
            variable = run[name]
            if variable.is_scale:
                self._learn_coordinate(name, _values(variable))
            elif variable.ndim > len(self.usual):
                inner = [axis[0].name.strip("/") for axis in variable.dims][len(self.usual) :]
                self.fields[name] = (inner, layout.attributes_of(name, self.scene))
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
        grid = self.grids.setdefault(name, values)
        self.sizes[name] = max(self.sizes.get(name, 0), len(values))
        self.shortest[name] = min(self.shortest.get(name, len(values)), len(values))
        both = min(len(grid), len(values))
        tolerance = SAME * np.abs(grid).max(initial=0.0)
        if not np.allclose(grid[:both], values[:both], rtol=0.0, atol=tolerance):
            self.ragged.add(name)
        elif len(values) > len(grid):
            self.grids[name] = values

    def create_axes(self, file: h5netcdf.File, scene: Scene) -> None:
        """Make the dimensions and their coordinates."""
        lengths = dict(zip(self.axes, self.shape, strict=True)) | self.sizes
        file.dimensions = lengths | {name: len(labels) for name, labels in self.labels.items()}
        own = {name: (name, values) for name, values in self.axes.items()}
        for name, (axis, values) in (own | self.linked).items():
            attributes = _axis_attributes(scene, name)
            _write(file, name, (axis,), _axis_array(values), attributes, complete=True)
        for name, labels in self.labels.items():
            texts = np.array(labels, dtype=object)
            _write(file, name, (name,), texts, layout.attributes_of(name), complete=True)
        for name, grid in self.grids.items():
            if name in self.ragged:
                self.fields[name] = ([name], layout.attributes_of(name))
            else:
                _write(file, name, (name,), grid, layout.attributes_of(name), complete=True)

    def create_fields(self, file: h5netcdf.File) -> None:
        """Make the variables that are written run by run.

        A run has one compressed chunk, or several along a dimension that is longer in other runs:
        the length that it lacks is not written.
        """
        for name, (inner, attributes) in self.fields.items():
            sizes = [self.sizes.get(each) or len(self.labels[each]) for each in inner]
            pieces = [max(self.shortest.get(each, _PIECE), _PIECE) for each in inner]
            variable = file.create_variable(
                name,
                (*self.axes, *inner),
                dtype="f8",
                fillvalue=np.nan,
                chunks=(*(1,) * len(self.axes), *map(min, sizes, pieces)),
                compression="gzip",
                compression_opts=1,
                shuffle=True,
                fletcher32=True,
            )
            variable.attrs.update(attributes | self.auxiliary)

    def fill(self, file: h5py.File, run: h5py.File, at: tuple[int, ...]) -> None:
        """Write the fields of one run in their place."""
        places = cache(partial(self._places, run))
        for name, (inner, _) in self.fields.items():
            if name in run:
                values = _values(run[name])
                values = values.reshape(values.shape[values.ndim - len(inner) :])
                whole = np.full(tuple(map(self._extent, inner, values.shape)), np.nan)
                whole[np.ix_(*map(places, inner))] = values
                target = file[_NO_COORDINATE + name if name in self.ragged else name]
                target[(*at, *map(slice, whole.shape))] = whole

    def write_small(self, file: h5netcdf.File) -> None:
        """Write what was held in memory."""
        for name, (values, attributes) in self.small.items():
            held = attributes | self.auxiliary
            _write(file, name, tuple(self.axes), values, held, complete=name == "status")

    def _extent(self, dimension: str, length: int) -> int:
        """Return up to where a run that has this length writes along a dimension."""
        return len(self.labels[dimension]) if dimension in self.labels else length

    def _places(self, run: h5py.File, dimension: str) -> list[int]:
        """Return where a run's points along a dimension lie in the combined one."""
        if dimension in self.labels:
            return [self.labels[dimension].index(label) for label in _values(run[dimension])]
        return list(range(len(run[dimension])))


def _axis_attributes(scene: Scene, name: str) -> dict[str, str]:
    """Return the attributes of a parameter of the scene, or of a linked axis."""
    known = name in parameters_of(scene)
    return layout.axis_attributes(scene, name) if known else layout.attributes_of(name)


def _values(variable: h5py.Dataset) -> np.ndarray:
    """Return all values; texts as str."""
    return variable.asstr()[...] if variable.dtype.kind == "O" else variable[...]


def _write(
    file: h5netcdf.File,
    name: str,
    dimensions: Sequence[str],
    values: np.ndarray,
    attributes: Mapping[str, Any],
    *,
    complete: bool = False,
) -> None:
    """Write a variable; one that is not complete gets a fill value."""
    text = values.dtype.kind == "O"
    variable = file.create_variable(
        name,
        tuple(dimensions),
        dtype=h5py.string_dtype() if text else values.dtype,
        fillvalue=None if text or complete else _absent(name, values.dtype),
        fletcher32=bool(dimensions) and not text,
    )
    variable[...] = values
    variable.attrs.update(attributes)


def _absent(name: str, kind: np.dtype[Any]) -> Any:
    """Return what stands for a run that has not given this variable."""
    if name == "status":
        return STATUSES.index(MISSING)
    return {"f": np.nan, "i": layout.INTEGER_FILL, "O": ""}[kind.kind]


def _axis_array(values: Sequence[Any]) -> np.ndarray:
    """Return numbers as numbers, left-out ones as NaN, and anything else as text."""
    values = [np.nan if value is None else value for value in values]
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.asarray(values)
    return np.array([v if isinstance(v, str) else json.dumps(v) for v in values], dtype=object)
