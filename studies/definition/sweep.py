"""The sweep of a study: axes of one parameter, and linked axes, which move several together.

An axis that is a list, or a range, has the name of a parameter and holds its values. A linked axis
is a table with another name: it holds labels, and the parameters that each label sets. For each
combination of labels, the parameters of the labels are fixed, and the lists are swept.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

from solver.results.quantities import QUANTITIES
from studies.definition.identity import canonical
from studies.definition.parameters import Parameter
from studies.definition.spaced import spaced
from studies.errors import StudyError, nearest

MAXIMUM_RUNS = 100_000
"""Largest number of points a sweep may have."""

LinkedAxis = dict[str, dict[str, Any]]
"""Label -> values of the parameters that the axis sets: the same ones for every label."""

Axes = dict[str, list[Any] | LinkedAxis]

_TEXT = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,79}")
_AXIS = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,79}")


def checked_axes(content: Any, known: Mapping[str, Parameter]) -> Axes:
    """Return the axes of a sweep, normalised.

    Linked axes come first, by name; then the others, in the order in which the scene declares its
    parameters. The values and labels of an axis stay in the given order. A parameter that one label
    sets and another leaves out has the scene's default there.

    Raises
    ------
    StudyError
        for any mistake except in combinations of parameters, which are checked case by case
    """
    if not isinstance(content, Mapping):
        raise StudyError("sweep", content, "must be a table of axes")
    content = {
        name: spaced(name, axis) if name in known and isinstance(axis, Mapping) else axis
        for name, axis in content.items()
    }
    tables = {name: axis for name, axis in content.items() if isinstance(axis, Mapping)}
    lists = checked_table(
        "sweep", {name: axis for name, axis in content.items() if name not in tables}, known
    )
    _check_size(content)
    linked = {name: _linked_axis(name, tables[name], known) for name in sorted(tables, key=str)}
    axes: Axes = linked | {key: _axis(known[key], lists[key]) for key in known if key in lists}
    first: dict[str, str] = {}
    for parameter, axis in _settings(axes):
        if first.setdefault(parameter, axis) != axis:
            allowed = f"sets {parameter}, which sweep.{first[parameter]} sets too: keep one"
            raise StudyError(f"sweep.{axis}", content[axis], allowed)
    return axes


def checked_table(field: str, content: Any, known: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return a table whose keys are parameters of the scene, its values unchecked."""
    if not isinstance(content, Mapping):
        raise StudyError(field, content, "must be a table of parameters")
    for name, value in content.items():
        if name not in known:
            allowed = f"the scene has no such parameter; it has {', '.join(known)}"
            raise StudyError(f"{field}.{name}", value, allowed + nearest(name, known))
    return dict(content)


def checked_text(field: str, text: Any) -> str:
    """Return the name of a study or a label, if files and command lines can have it."""
    if isinstance(text, str) and _TEXT.fullmatch(text):
        return text
    raise StudyError(field, text, "must be 1 to 80 of A-Z a-z 0-9 . _ -, not beginning with a dot")


def owners(axes: Axes) -> dict[str, str]:
    """Return the axis of each swept parameter."""
    return dict(_settings(axes))


def linked_values(axes: Axes) -> dict[str, tuple[str, list[Any]]]:
    """Return, for each parameter set by a linked axis, that axis and the values over its labels."""
    return {
        parameter: (axis, [settings[parameter] for settings in labels.values()])
        for axis, labels in axes.items()
        if isinstance(labels, dict)
        for parameter in _set_by(axis, labels)
    }


def _settings(axes: Axes) -> Iterator[tuple[str, str]]:
    """Yield each parameter of each axis, and the axis."""
    for name, axis in axes.items():
        for parameter in _set_by(name, axis):
            yield parameter, name


def _set_by(name: str, axis: list[Any] | LinkedAxis) -> list[str]:
    return list(next(iter(axis.values()))) if isinstance(axis, dict) else [name]


def _check_size(axes: Mapping[str, Any]) -> None:
    for name, axis in axes.items():
        if not isinstance(axis, list | tuple | Mapping) or not axis:
            allowed = "must be a list of one value or more, or a table of one label or more"
            raise StudyError(f"sweep.{name}", axis, allowed)
    runs = math.prod(len(axis) for axis in axes.values())
    if runs > MAXIMUM_RUNS:
        sizes = " x ".join(f"{len(axis)} {name}" for name, axis in axes.items())
        raise StudyError("sweep", f"{runs} runs", f"at most {MAXIMUM_RUNS} runs ({sizes})")


def _axis(parameter: Parameter, values: list[Any]) -> list[Any]:
    seen: dict[str, int] = {}
    axis = []
    for position, value in enumerate(values):
        field = f"sweep.{parameter.name}[{position}]"
        normal = parameter.normalise(value, field)
        if normal is None:
            raise parameter.refusal(field, value)
        first = seen.setdefault(canonical(normal), position)
        if first != position:
            raise StudyError(field, value, f"occurs already at position {first}: keep one")
        axis.append(normal)
    return axis


def _linked_axis(
    name: str, content: Mapping[str, Any], known: Mapping[str, Parameter]
) -> LinkedAxis:
    _check_name(name, content)
    given: LinkedAxis = {}
    for label, settings in content.items():
        field = f"sweep.{name}.{checked_text(f'sweep.{name}', label)}"
        given[label] = {
            key: known[key].normalise(value, f"{field}.{key}")
            for key, value in checked_table(field, settings, known).items()
        }
    together = [key for key in known if any(key in settings for settings in given.values())]
    axis: LinkedAxis = {}
    seen: dict[str, str] = {}
    for label, settings in given.items():
        axis[label] = {key: settings.get(key, known[key].default) for key in together}
        first = seen.setdefault(canonical(axis[label]), label)
        if first != label:
            allowed = f"sets the same parameters as {first}: keep one"
            raise StudyError(f"sweep.{name}.{label}", content[label], allowed)
    return axis


def _check_name(name: Any, content: Any) -> None:
    """Refuse the name of a linked axis that cannot be a dimension of the data set."""
    from studies.definition.vocabulary import LABEL_ATTRIBUTES

    if name in QUANTITIES or name in LABEL_ATTRIBUTES:
        allowed = "the data set has a variable of this name: give the axis another one"
    elif not isinstance(name, str) or not _AXIS.fullmatch(name):
        allowed = "the name must be 1 to 80 of A-Z a-z 0-9 _, beginning with a letter"
    else:
        return
    raise StudyError(f"sweep.{name}", content, allowed)
