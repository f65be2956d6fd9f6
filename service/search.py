"""What a query of runs asks for, checked against the scenes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from service.schemas import RunFilter, Window
from solver.scenes import SCENES
from studies import StudyError
from studies.dataset import MISSING, STATUSES
from studies.parameters import Parameter, nearest, parameters_of, scene_named

OUTCOMES = tuple(status for status in STATUSES if status != MISSING)
"""Statuses that a run in the catalogue may have."""

PLAIN = ("scene", "status", *Window.model_fields)
"""What may be asked for beside the parameters of the scenes."""


def conditions(which: RunFilter) -> dict[str, Any]:
    """Return the arguments of `Catalogue.runs` for a query.

    Raises
    ------
    StudyError
        for a scene, a status, a parameter or a value that no run can have
    """
    if which.status not in (None, *OUTCOMES):
        allowed = f"must be one of {', '.join(OUTCOMES)}{nearest(which.status, OUTCOMES)}"
        raise StudyError("status", which.status, allowed)
    scenes = list(SCENES.values()) if which.scene is None else [scene_named(which.scene)]
    known: dict[str, list[Parameter]] = {}
    for scene in scenes:
        for name, parameter in parameters_of(scene).items():
            known.setdefault(name, []).append(parameter)
    asked = which.model_dump(exclude_none=True)
    for name in asked.keys() - {*PLAIN}:
        if name not in known:
            names = (*PLAIN, *known)
            allowed = f"must be one of {', '.join(names)}{nearest(name, names)}"
            raise StudyError(name, asked[name], allowed)
        asked[name] = _value(name, asked[name], known[name])
    return asked


def _value(name: str, given: Any, parameters: Sequence[Parameter]) -> Any:
    """Return a value as the first of the parameters of this name that accepts it has it."""
    for parameter in parameters:
        value = given if isinstance(parameter.default, str) else _parsed(given)
        try:
            return parameter.normalise(value, name)
        except StudyError as error:
            refusal = error
    raise refusal


def _parsed(given: Any) -> Any:
    """Return the number or truth value that a text stands for; anything else as it is."""
    try:
        return json.loads(given) if isinstance(given, str) else given
    except (ValueError, RecursionError):
        return given
