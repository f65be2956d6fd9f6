"""What differs between two studies: their runs aligned by parameters, and all that they hold."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from studies.definition.identity import canonical
from studies.definition.vocabulary import MISSING, SOLVED
from studies.errors import StudyError, one_of
from studies.kinds import kind_of
from studies.numbers import number_text
from studies.toml import CASE
from studies.views.columns import aligned, placed, unit_text
from studies.views.picking import flags, own_grid, sweep_axes, sweep_coordinates

_NOT_COMPARED = ("cpu_seconds", "round")
"""Variables that differ from one computation, or refinement, to the next; so do its cells."""
_OF_THE_COMPUTATION = re.compile("audit_.*|.*(iterations|fallbacks|increments|of_freedom)")
"""Variables that tell of the computation, not of what is computed: they come last."""
_SAME_GRID = 1e-9
"""Largest ratio of the distance of places to the size of a grid for which they are the same."""
_LISTED = 10
"""Number of runs that the text lists of each kind."""


class Change(NamedTuple):
    """The largest change of a variable.

    Attributes
    ----------
    variable, unit : its name and its unit
    absolute : largest change of a value
    relative : its ratio to the largest value in the common runs; infinite where that is 0
    before, after : the values at the largest change
    run : parameters of the run in which it is, those that vary
    place : labels and coordinates of the place in the run
    runs : number of runs in which the variable changed
    """

    variable: str
    unit: str
    absolute: float
    relative: float
    before: float
    after: float
    run: Mapping[str, Any]
    place: Mapping[str, Any]
    runs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """What differs between two studies.

    Attributes
    ----------
    names : names of the studies
    common : number of runs that both have
    only : runs that only the first one has, and only the second: the parameters that vary
    statuses : runs with another status: their parameters, and both statuses
    changes : the variables that changed, the largest relative change first, and last those that
        tell of the computation
    unlike : variables that could not be compared, and why
    unknown : parameters that only one of the two has, with their values: they do not count
    pairs : for each number of the runs its values in both, over the common runs
    """

    names: tuple[str, str]
    common: int
    only: tuple[list[dict[str, Any]], list[dict[str, Any]]]
    statuses: list[tuple[dict[str, Any], str, str]]
    changes: list[Change]
    unlike: dict[str, str]
    unknown: dict[str, Any]
    pairs: dict[str, tuple[np.ndarray, np.ndarray]]

    @property
    def same(self) -> bool:
        """Whether nothing differs."""
        return not (any(self.only) or self.statuses or self.changes or self.unlike)


def diff(first: xr.Dataset, second: xr.Dataset, ignore: Sequence[str] = ()) -> Difference:
    """Return what differs between two data sets of studies, of one or of two versions.

    Runs are aligned by their parameters, whatever axes they are on; labels and numbers of points do
    not count, and neither do parameters that only one of the two versions knows. Values are
    compared where both runs have results: at the same labels and places, between which those of the
    second run are interpolated if it has another grid.

    Parameters
    ----------
    first, second : data sets of studies
    ignore : parameters that do not count, such as those of the mesh

    Raises
    ------
    StudyError
        if the studies are of two scenes, one has answers and one runs, one has no runs, or two of
        the same parameters, or neither has a parameter that is to be ignored
    """
    sides = [each.drop_dims("cell", errors="ignore") for each in (first, second)]
    scenes = [each.attrs.get("scene") for each in sides]
    if scenes[0] != scenes[1]:
        raise StudyError("scene", scenes[1], f"must be that of the other study, {scenes[0]}")
    kinds = [kind_of(each.attrs) for each in sides]
    if kinds[0].of_runs != kinds[1].of_runs:
        allowed = f"has {kinds[1].rows}, the other study {kinds[0].rows}: both must have one kind"
        raise StudyError("runs", _name(sides[1]), allowed)
    every = [list(_runs(each)) for each in sides]
    for side, there in zip(sides, every, strict=True):
        if not there:
            raise StudyError("runs", _name(side), "has none yet: compute it first")
    keys = [set(runs[0][1]) for runs in every]
    for name in ignore:
        if name not in keys[0] | keys[1]:
            raise StudyError("ignore", name, one_of(name, sorted(keys[0] | keys[1])))
    shared, one = (keys[0] & keys[1]) - {*ignore}, keys[0] ^ keys[1]
    unknown = {name: value for runs in every for name, value in runs[0][1].items() if name in one}
    a, b = (_by_parameters(runs, shared) for runs in every)
    varied = _varied([*a.values(), *b.values()])

    def told(key: str) -> dict[str, Any]:
        values = (a.get(key) or b[key])[1]
        return {name: value for name, value in values.items() if name in varied}

    both = [key for key in a if key in b]
    only = [told(key) for key in a if key not in b], [told(key) for key in b if key not in a]
    statuses, changes, unlike = [], dict[str, Change](), dict[str, str]()
    largest: dict[str, float] = {}
    pairs: dict[str, list[tuple[float, float]]] = {}
    for key in both:
        at = a[key][0], b[key][0]
        runs = [own_grid(each.isel(k).load()) for each, k in zip(sides, at, strict=True)]
        before, after = (str(run["status"].item()) for run in runs)
        if before != after:
            statuses.append((told(key), before, after))
        if before not in SOLVED or after not in SOLVED:
            continue
        for name in _compared(runs, unlike):
            values = [run[name] for run in runs]
            if not values[0].ndim:
                pairs.setdefault(name, []).append((values[0].item(), values[1].item()))
            try:
                found = _change(values[0], values[1], told(key))
            except ValueError as error:
                unlike[name] = str(error)
                continue
            largest[name] = max(largest.get(name, 0.0), _largest(values[0]))
            if found is not None:
                known = changes.get(name)
                number = known.runs + 1 if known else 1
                larger = known if known and known.absolute >= found.absolute else found
                changes[name] = larger._replace(runs=number)
    for name, each in changes.items():
        relative = each.absolute / largest[name] if largest[name] else np.inf
        changes[name] = each._replace(relative=relative)
    return Difference(
        names=_names(first, second),
        common=len(both),
        only=only,
        statuses=statuses,
        changes=sorted(
            changes.values(),
            key=lambda each: (bool(_OF_THE_COMPUTATION.fullmatch(each.variable)), -each.relative),
        ),
        unlike=unlike,
        unknown=unknown,
        pairs={name: (np.array(each)[:, 0], np.array(each)[:, 1]) for name, each in pairs.items()},
    )


def difference_table(found: Difference) -> str:
    """Return what differs as text: runs, statuses, and a line for each variable."""
    lines = [f"{found.common} runs in common"]
    for name, runs in zip(found.names, found.only, strict=True):
        lines += _listed(f"only in {name}", [_at(each) for each in runs])
    told = [f"{_at(at)}: {before} -> {after}" for at, before, after in found.statuses]
    lines += _listed("with another status", told)
    if found.unknown:
        lines.append(f"parameters that only one has: {placed(found.unknown)}")
    lines += [f"{name} is not compared: {why}" for name, why in found.unlike.items()]
    if not found.changes:
        return "\n".join([*lines, "no value differs"])
    head = ["variable", "relative", "absolute", "", "from", "to", "runs", "where"]
    rows = [
        [
            each.variable, number_text(each.relative, 2), number_text(each.absolute),
            unit_text(each.unit), number_text(each.before, 6),
            number_text(each.after, 6), str(each.runs), _at({**each.run, **each.place}),
        ]
        for each in found.changes
    ]  # fmt: skip
    return "\n".join([*lines, "", _table([head, *rows])])


def _table(rows: list[list[str]]) -> str:
    """Return columns, the first and the last flush left."""
    width = max(len(row[0]) for row in rows)
    middle = aligned([row[1:-1] for row in rows], 0).splitlines()
    pairs = zip(rows, middle, strict=True)
    return "\n".join(f"{row[0].ljust(width)}  {text}  {row[-1]}".rstrip() for row, text in pairs)


def _listed(what: str, runs: Sequence[str]) -> list[str]:
    more = [f"  and {len(runs) - _LISTED} more"] if len(runs) > _LISTED else []
    head = [f"{len(runs)} runs {what}:"] if runs else []
    return [*head, *(f"  {each}" for each in runs[:_LISTED]), *more]


def _at(values: Mapping[str, Any]) -> str:
    return placed(values) or "the run"


def _name(dataset: xr.Dataset) -> str:
    return str(dataset.attrs.get("title", "the study"))


def _names(first: xr.Dataset, second: xr.Dataset) -> tuple[str, str]:
    """Return the names of two studies; which is which too, if they have one name."""
    one, other = _name(first), _name(second)
    return (f"{one} (first)", f"{other} (second)") if one == other else (one, other)


def _runs(dataset: xr.Dataset) -> Iterator[tuple[dict[str, int], dict[str, Any]]]:
    """Yield the place of each run that is there, and all its parameters."""
    fixed = json.loads(dataset.attrs["parameters"])
    axes = sweep_axes(dataset)
    values = {
        name: (axis, dataset[name].to_numpy().tolist())
        for name, axis in sweep_coordinates(dataset).items()
        if name != CASE and not (name == axis and _is_label(dataset, axis, fixed))
    }
    statuses = dataset["status"].to_numpy()
    for index in np.ndindex(statuses.shape):
        if statuses[index] != MISSING or statuses.size == 1:
            place = dict(zip(axes, index, strict=True))
            yield place, fixed | {name: each[place[axis]] for name, (axis, each) in values.items()}


def _is_label(dataset: xr.Dataset, axis: str, fixed: Mapping[str, Any]) -> bool:
    """Whether an axis is no parameter: it has labels or points, which set parameters."""
    others = [name for name, own in sweep_coordinates(dataset).items() if own == axis]
    return len(others) > 1 and axis not in fixed


def _by_parameters(
    runs: list[tuple[dict[str, int], dict[str, Any]]], shared: set[str]
) -> dict[str, tuple[dict[str, int], dict[str, Any]]]:
    """Return the runs by their parameters, without those that only one study knows."""
    found: dict[str, tuple[dict[str, int], dict[str, Any]]] = {}
    for place, values in runs:
        own = {name: _plain(value) for name, value in values.items() if name in shared}
        if (key := canonical(own)) in found:
            names = ", ".join(sorted(values.keys() - shared))
            allowed = f"are two runs that differ only in what does not count: {names}"
            raise StudyError("runs", _at(place), allowed)
        found[key] = place, own
    return found


def _plain(value: Any) -> Any:
    """Return a value whichever type it has in the data set: 1.0 is 1, NaN none; JSON is read."""
    if isinstance(value, str) and value[:1] in {"[", "{"}:
        try:
            return json.loads(value)
        except ValueError:
            return value
    if isinstance(value, bool):
        return json.dumps(value)  # as a coordinate has it
    if isinstance(value, int):
        return float(value)
    return None if isinstance(value, float) and math.isnan(value) else value


def _varied(runs: Sequence[tuple[Any, Mapping[str, Any]]]) -> set[str]:
    """Return the parameters that are not the same in all runs."""
    values: dict[str, set[str]] = {}
    for _, each in runs:
        for name, value in each.items():
            values.setdefault(name, set()).add(canonical(value))
    return {name for name, each in values.items() if len(each) > 1}


def _compared(runs: Sequence[xr.Dataset], unlike: dict[str, str]) -> Iterator[str]:
    """Yield the names of variables to compare; note those that one run lacks."""
    numeric = [
        {str(name) for name, each in run.data_vars.items() if each.dtype.kind in "fiub"}
        for run in runs
    ]
    for name in sorted(numeric[0] ^ numeric[1]):
        unlike.setdefault(
            name, f"only {'the first' if name in numeric[0] else 'the second'} has it"
        )
    yield from sorted((numeric[0] & numeric[1]) - {*_NOT_COMPARED})


def _change(first: xr.DataArray, second: xr.DataArray, run: Mapping[str, Any]) -> Change | None:
    """Return the largest change of a variable in a run; None if there is none.

    Raises
    ------
    ValueError
        if the two have no place in common
    """
    second = second.transpose(*first.dims)
    for dim in map(str, first.dims):
        if dim not in first.coords or dim not in second.coords:
            if first.sizes[dim] != second.sizes[dim]:
                raise ValueError(f"{dim} has {first.sizes[dim]} and {second.sizes[dim]} places")
            continue
        places = first[dim].to_numpy(), second[dim].to_numpy()
        if places[0].dtype.kind != "f":
            common = [each for each in places[0].tolist() if each in set(places[1].tolist())]
            first, second = first.sel({dim: common}), second.sel({dim: common})
        elif not _same(*places):
            second = second.interp({dim: places[0]})
        else:
            second = second.assign_coords({dim: places[0]})
    before, after = (np.atleast_1d(each.to_numpy().astype(float)) for each in (first, second))
    there = np.isfinite(before) & np.isfinite(after)
    if not there.any():
        if np.isfinite(before).any() != np.isfinite(after).any() or not before.size:
            raise ValueError("the runs have no place in common")
        return None
    by = np.where(there, np.abs(after - before), 0.0)
    at = np.unravel_index(int(np.argmax(by)), by.shape)
    if not (absolute := float(by[at])):
        return None
    place = {
        str(dim): first[dim].to_numpy()[k].item()
        for dim, k in zip(first.dims, at, strict=False)
        if dim in first.coords
    }
    return Change(
        variable=str(first.name),
        unit="" if flags(first) else str(first.attrs.get("units", "")),
        absolute=absolute,
        relative=np.nan,
        before=float(before[at]),
        after=float(after[at]),
        run=run,
        place=place,
        runs=1,
    )


def _largest(values: xr.DataArray) -> float:
    """Return the largest size of a value; 0 if there is none."""
    sizes = np.abs(values.to_numpy().astype(float))
    return float(np.max(sizes, initial=0.0, where=np.isfinite(sizes)))


def _same(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two grids have the same places."""
    if first.shape != second.shape:
        return False
    return bool(np.allclose(first, second, rtol=0.0, atol=_SAME_GRID * np.max(np.abs(first))))
