"""The sweep of a study: axes of one parameter, and axes that move several together.

An axis that is a list, or a range, has the name of a parameter and holds its values. Axes with
other names set several parameters: a linked axis is a table of labels, an axis of points a list, a
file or a sample (`studies.definition.points`). Each axis is a list of positions, which all set the
same parameters. The runs are all combinations of positions.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import PlainValidator

from solver.results.quantities import QUANTITIES
from studies.definition.identity import canonical
from studies.definition.parameters import Parameter
from studies.definition.points import (
    ENTRIES,
    POINT,
    checked_points,
    describes_points,
    field_of,
    is_points,
)
from studies.definition.sampling import Sample
from studies.definition.schema import (
    MAXIMUM_RUNS,
    Context,
    Steps,
    checked_settings,
    checked_text,
    filled,
    known_name,
    listed,
    parsed,
)
from studies.errors import Mistakes, StudyError
from studies.materials import MATERIAL, NAME, name_in
from studies.scenes.names import in_use
from studies.toml import CASE

LinkedAxis = dict[str, dict[str, Any]]
"""Label -> values of the parameters that the axis sets: the same ones for every label."""

Axes = dict[str, list[Any] | LinkedAxis]
"""Values of a parameter, labels, or points, by the name of the axis."""


class Position(NamedTuple):
    """One position of an axis.

    Attributes
    ----------
    at : its value, its label, or its number
    sets : the parameters that it sets
    field : the entry of the study that has it
    case : the name of a point, if it has one
    """

    at: Any
    sets: Mapping[str, Any]
    field: str
    case: str | None = None


def positions(name: str, axis: list[Any] | LinkedAxis) -> Iterator[Position]:
    """Yield the positions of a normalised axis."""
    if isinstance(axis, dict):
        for label, settings in axis.items():
            yield Position(label, settings, f"sweep.{name}.{label}")
    elif is_points(axis):
        for k, point in enumerate(axis):
            sets = {parameter: value for parameter, value in point.items() if parameter != CASE}
            yield Position(k, sets, f"{field_of(name)}[{k}]", point.get(CASE))
    else:
        for k, value in enumerate(axis):
            yield Position(value, {name: value}, f"sweep.{name}[{k}]")


class Standing(NamedTuple):
    """A combination of positions on the axes of a study.

    Attributes
    ----------
    sets : the parameters that it sets
    at : the positions by axis, what they set, and the name of a point
    """

    sets: Mapping[str, Any]
    at: Mapping[str, Any]

    def has(self, at: Mapping[str, Any]) -> bool:
        """Whether it is at these positions; those of other dimensions do not count."""
        return all(self.at[name] == value for name, value in at.items() if name in self.at)


def standings(axes: Axes) -> list[Standing]:
    """Return all combinations of positions, the last axis fastest."""
    found = []
    for every in itertools.product(*(positions(name, axis) for name, axis in axes.items())):
        sets = {name: value for each in every for name, value in each.sets.items()}
        at = {name: each.at for name, each in zip(axes, every, strict=True)}
        named = [{CASE: each.case} for each in every if each.case is not None]
        found.append(Standing(sets, {**sets, **at, **(named[0] if named else {})}))
    return found


_OF_LABELS = (CASE, "mesh")
"""Names that axes of labels may have: only points and files of runs have something else."""
_AXIS = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,79}")


def checked_axes(content: Any, context: Context) -> Axes:
    """Return the axes of a sweep, normalised.

    Linked axes come first, by name; then the others, in the order in which the scene declares its
    parameters. The values and labels of an axis stay in the given order. A parameter that one label
    sets and another leaves out has the scene's default there.

    Raises
    ------
    StudyError
        for any mistake except in combinations of parameters, which are checked case by case
    """
    known = context.known
    if not isinstance(content, Mapping):
        raise StudyError("", content, "must be a table of axes")
    given, wrong = dict[str, Any](), Mistakes()
    for name, axis in content.items():
        with wrong.at(str(name)):
            given[name] = _axis(name, axis, context)
    wrong.report()
    order = [*sorted(given.keys() - known.keys()), *(name for name in known if name in given)]
    axes: Axes = {name: given[name] for name in order}
    first: dict[str, str] = {}
    for name, axis in axes.items():
        at = next(positions(name, axis))
        for parameter in [*at.sets, *([CASE] if at.case else [])]:
            other = first.setdefault(parameter, name)
            if other != name or (parameter == CASE and CASE in axes):
                own = other if other != name else CASE
                field = field_of(own) if is_points(axes[own]) else f"sweep.{own}"
                where = f"which {field} sets too"
                allowed = f"sets {parameter}, {where}: keep one"
                wrong.add("", StudyError(name, content[name], allowed))
    wrong.report()
    context.swept = axes
    return axes


Sweep = Annotated[
    dict[str, Any],
    PlainValidator(
        lambda given, info: checked_axes(given, Context.of(info)),
        json_schema_input_type=dict[str, list[Any] | Steps | Sample | dict[str, dict[str, Any]]],
    ),
]
"""The axes of a study, see `checked_axes`."""


def owners(axes: Axes) -> dict[str, str]:
    """Return the axis of each swept parameter."""
    return {
        parameter: name
        for name, axis in axes.items()
        for parameter in next(positions(name, axis)).sets
    }


def linked_values(axes: Axes) -> dict[str, tuple[str, list[Any]]]:
    """Return what axes of several parameters set: parameter -> the axis, the values over it.

    So are the names of points.
    """
    found: dict[str, tuple[str, list[Any]]] = {}
    for name, axis in axes.items():
        if isinstance(axis, dict) or is_points(axis):
            every = list(positions(name, axis))
            if every[0].case is not None:
                found[CASE] = name, [each.case for each in every]
            for parameter in every[0].sets:
                found[parameter] = name, [each.sets[parameter] for each in every]
    return found


def labels(name: str, axis: list[Any] | LinkedAxis) -> list[Any]:
    """Return the value, label or number at each position of an axis."""
    return [each.at for each in positions(name, axis)]


def run_count(content: Mapping[str, Any]) -> int:
    """Return the number of runs that the axes of a study describe, before one is made.

    It is the product of the lengths of lists and tables, and of the ``num`` of ranges and samples.

    Raises
    ------
    StudyError
        if it is larger than `MAXIMUM_RUNS`
    """
    sweep = content.get("sweep", {})
    axes = {entry: content[entry] for entry in ENTRIES if entry in content}
    axes |= sweep if isinstance(sweep, Mapping) else {}
    sizes = {str(name): _length(axis) for name, axis in axes.items()}
    for name, size in sizes.items():
        if size > MAXIMUM_RUNS:
            field = name if name in ENTRIES else f"sweep.{name}"
            raise StudyError(field, f"{size} values", f"at most {MAXIMUM_RUNS} are allowed")
    runs = math.prod(sizes.values())
    if runs > MAXIMUM_RUNS:
        listed = " x ".join(f"{size} {name}" for name, size in sizes.items())
        raise StudyError("sweep", f"{runs} runs", f"at most {MAXIMUM_RUNS} runs ({listed})")
    return runs


def _length(axis: Any) -> int:
    """Return the number of positions of an axis as it is given; 1 of what is no axis."""
    num = axis.get("num") if isinstance(axis, Mapping) else None
    if isinstance(num, int):  # of a range or a sample: a label of this name has a table
        return num if 0 < num <= MAXIMUM_RUNS else 1  # what makes it refuses others
    return max(len(axis), 1) if isinstance(axis, list | tuple | Mapping) else 1


def _axis(name: Any, content: Any, context: Context) -> list[Any] | LinkedAxis:
    """Return an axis, normalised."""
    known = context.known
    if name in known and isinstance(content, Mapping):
        if not {"start", "stop"} <= content.keys():
            allowed = (
                "must be a list of values or a range {start, stop, num}, with spacing = linear or "
                "log; a table of labels needs a name that is no parameter"
            )
            raise StudyError("", dict(content), allowed)
        content = parsed(Steps, content, known[name]).values
    if name == MATERIAL and name not in known and not isinstance(content, Mapping):
        content = _materials(listed(content))
    points = name not in known and describes_points(name, content)
    if name not in known:
        if not points and not isinstance(content, Mapping):
            known_name(name, known, content)
        _check_name(name, content, known)
    if points:
        return checked_points(content, context)
    if not isinstance(content, list | tuple | Mapping) or not content:
        allowed = "must be a list of one value or more, or a table of one label or more"
        raise StudyError("", content, allowed)
    return (
        _labels(content, known) if isinstance(content, Mapping) else _values(known[name], content)
    )


def _values(parameter: Parameter, given: Sequence[Any]) -> list[Any]:
    seen: dict[str, int] = {}
    axis, wrong = list[Any](), Mistakes()
    for position, value in enumerate(given):
        with wrong.at():
            field = f"[{position}]"
            normal = parameter.normalise(value, field)
            if normal is None:
                raise parameter.refusal(field, value)
            first = seen.setdefault(canonical(normal), position)
            if first != position:
                raise StudyError(field, value, f"occurs already at position {first}: keep one")
            axis.append(normal)
    wrong.report()
    return axis


def _labels(content: Mapping[str, Any], known: Mapping[str, Parameter]) -> LinkedAxis:
    given, wrong = LinkedAxis(), Mistakes()
    for label, settings in content.items():
        with wrong.at():
            checked_text(label)
        with wrong.at(str(label)):
            given[label] = checked_settings(settings, known)
    wrong.report()
    return filled(given, known)


def _materials(given: Sequence[Any]) -> dict[Any, Any]:
    """Return the table of labels that a list of materials stands for."""
    found, wrong = dict[Any, Any](), Mistakes()
    for position, material in enumerate(given):
        with wrong.at(f"[{position}]"):
            label = name_in(material)
            if label is None:
                raise StudyError(NAME, None, "must be given: the label of this material")
            label = checked_text(label)
            if label in found:
                raise StudyError("", label, "occurs already: keep one")
            found[label] = {MATERIAL: material}
    wrong.report()
    return found


def _check_name(name: Any, content: Any, known: Mapping[str, Parameter]) -> None:
    """Refuse the name of a linked axis that cannot be a dimension of the data set."""
    if name == POINT and describes_points(name, content):
        return
    if name in QUANTITIES or (name not in _OF_LABELS and in_use(str(name), known)):
        allowed = "the data set has a variable of this name: give the axis another one"
    elif not isinstance(name, str) or not _AXIS.fullmatch(name):
        allowed = "the name must be 1 to 80 of A-Z a-z 0-9 _, beginning with a letter"
    else:
        return
    raise StudyError("", content, allowed)
