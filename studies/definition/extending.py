"""A study that extends another one: it keeps the runs of that one, and adds values or points.

An axis gets the values or labels that it did not have. A parameter that did not vary becomes an
axis, which has the value that it had. Points are added behind those that are there; if there are
none, the runs of the other study become the first points. What results is an ordinary study: it has
the id that it has if it is written in full.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from studies.definition.identity import canonical
from studies.definition.points import field_of, is_points
from studies.definition.schema import MAXIMUM_RUNS
from studies.definition.sweep import Axes, owners, positions
from studies.errors import StudyError
from studies.toml import CASE

EXTENDS = "extends"
"""Entry of a study that names the one that it extends."""


class Extended(NamedTuple):
    """The study that is extended: entries of `Study`, and all parameters that are not swept."""

    name: str
    sweep: Axes
    fixed: Mapping[str, Any]

    def with_axes(self, added: Axes) -> Axes:
        """Return the axes of the runs of this study and of those that others add.

        Raises
        ------
        StudyError
            if nothing is added, or what does not fit
        """
        if not added:
            raise StudyError(EXTENDS, self.name, "nothing is added: give axes, points or a sample")
        points = any(map(is_points, added.values()))
        axes: Axes = _with_points(self, added) if points else dict(self.sweep)
        longer = {n: _longer(n, axis, self) for n, axis in added.items() if not is_points(axis)}
        return axes | longer


def _longer(name: str, axis: list[Any] | dict[str, Any], base: Extended) -> Any:
    """Return an axis of `base` with the values or labels that it did not have."""
    field, before = f"sweep.{name}", base.sweep.get(name)
    if isinstance(axis, dict):
        if not isinstance(before, dict):
            allowed = f"must be an axis of labels of {base.name}, which is extended; or points"
            raise StudyError(field, axis, allowed)
        for label in axis.keys() & before.keys():
            if any(before[label].get(key, value) != value for key, value in axis[label].items()):
                allowed = f"is a label of {base.name}, which is extended: use another one"
                raise StudyError(f"{field}.{label}", axis[label], allowed)
        return before | {label: axis[label] for label in axis if label not in before}
    if before is None:
        if (other := owners(base.sweep).get(name)) is not None:
            allowed = f"is set by {other} of {base.name}, which is extended: add to {other}"
            raise StudyError(field, axis, allowed)
        before = [base.fixed[name]] if name in base.fixed else []  # what is searched is not fixed
    assert isinstance(before, list)
    seen = {canonical(value) for value in before}
    values = [*before, *(value for value in axis if canonical(value) not in seen)]
    rising = all(isinstance(each, int | float) for each in values) and before == sorted(before)
    return sorted(values) if rising else values


def _with_points(base: Extended, added: Axes) -> dict[str, Any]:
    """Return the axes of `base` with more points; its runs become points if it has none."""
    (name, more), *others = [(name, axis) for name, axis in added.items() if is_points(axis)]
    if others:
        allowed = "is a second set of points: add one of them, then extend the study again"
        raise _refused(others[0][0], others[0][1], allowed)
    axes, theirs = dict(base.sweep), f"{base.name}, which is extended,"
    own = next((key for key, axis in axes.items() if is_points(axis)), None)
    if own is not None and own != name:
        raise _refused(name, more, f"{theirs} has its points in {own}: add to these")
    kept = {name: axes.pop(name)} if own else axes
    if math.prod(map(len, kept.values())) > MAXIMUM_RUNS:
        raise _refused(name, more, f"{theirs} has more than {MAXIMUM_RUNS} runs")
    every = [list(positions(axis, values)) for axis, values in kept.items()]
    points = [
        {key: v for at in run for key, v in at.sets.items()} for run in itertools.product(*every)
    ]
    axes = axes if own else {}
    for key in more[0].keys() & owners(axes).keys():
        raise _refused(name, more, f"{key} is swept by {owners(axes)[key]} of {theirs} too")
    if missing := points[0].keys() - more[0].keys():
        listed = ", ".join(sorted(missing))
        raise _refused(name, more, f"must set {listed}, which {base.name} sweeps")
    usual = {key: base.fixed[key] for key in more[0] if key in base.fixed}
    there = [{**usual, **each} for each in points]
    if own and (cases := [at.case for at in every[0] if at.case]):
        there = [{CASE: case, **each} for case, each in zip(cases, there, strict=True)]
    elif CASE in more[0]:
        there = [{CASE: f"{base.name}-{k}", **each} for k, each in enumerate(there)]
    seen = {canonical(_set(each)) for each in there}
    return {name: [*there, *(each for each in more if canonical(_set(each)) not in seen)], **axes}


def _set(point: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that a point sets, in order of their names."""
    return {key: point[key] for key in sorted(point) if key != CASE}


def _refused(name: str, points: Any, allowed: str) -> StudyError:
    return StudyError(field_of(name), f"{len(points)} points", allowed)
