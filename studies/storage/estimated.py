"""Which variables of a data set have the estimated error of a number (``ancillary_variables``).

An estimate of stress is one number a run, the relative error in the energy norm. It is a mean over
the bodies, and says little of a value at one point (docs/explanation/accuracy.md).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from solver.scenes import Scene
from studies.definition.parameters import build
from studies.storage.dataset import Variable

Described = Mapping[str, tuple[Sequence[str], Mapping[str, Any]]]
"""Dimensions and attributes of the variables of a data set, by name."""

ANCILLARY = "ancillary_variables"
"""Attribute of a number with the names of the variables that have its estimated error."""
WITHOUT = "without_estimated_error"
"""Attribute of a data set with the names of its numbers that have none."""

_OWN_ENDS = (("_error",), ("_sigma",), ("_low", "_high"))
"""Ends of the names of variables with the error of one number, of which the first that is there
counts: a bound, a standard deviation, or the ends of an interval. Of a parameter that is fitted,
these are the bounds in which it was searched."""
_PRESSURES = re.compile(r"(peak_)?contact_pressure(_deformed)?")
_NO_RESULT = re.compile(
    "cpu_seconds|median_iterations|(audit|run|tried|cell)_.*|.*_(error|sigma|low|high)"
)
_NOT_AUDITED = re.compile("(fatigue|hertz)_.*|d_.*_d_.*")
"""Stresses of which the audit estimates no error."""


def errors_of(name: str, variables: Described, requested: Mapping[str, str] = {}) -> list[str]:
    """Return the names of the variables with the estimated error of a number; empty for none.

    ``requested`` is what `of_requested` returns.
    """
    own = ([name + end for end in ends] for ends in _OWN_ENDS)
    first = next((each for each in own if variables.keys() >= {*each}), [])
    stress = _of_stress(name, variables, requested)
    return [*first, *(each for each in stress if each in variables)]


def of_requested(scene: Scene) -> dict[str, str]:
    """Return the estimate of each number that a scene file requests, by the stage; else empty."""
    if scene.places is None:
        return {}
    parameters = build(scene, {})
    view = scene.view(parameters)
    stages = {view.loaded: "loaded", view.unloaded: "residual"}
    found = {}
    for each in scene.places(parameters).numbers:
        kind = "" if each.minus else stages.get(each.stage, "")
        if each.contact is not None:
            kind = "contact" if kind == "loaded" and each.of == "pressure" else ""
        found[each.name] = f"audit_error_{kind}" if kind else ""
    return found


def _of_stress(name: str, variables: Described, requested: Mapping[str, str]) -> Iterator[str]:
    """Yield the estimates of the audit that a stress or a contact pressure has, if it is one."""
    dims, attrs = variables[name]
    words = str(attrs.get("long_name", ""))
    if attrs.get("units") != "MPa" or any(
        each.fullmatch(name) for each in (_NO_RESULT, _NOT_AUDITED)
    ):
        return
    if name in requested:
        yield requested[name]
    elif _PRESSURES.fullmatch(name):
        yield "audit_error_contact"
    elif "residual stress" in words:
        yield "audit_error_residual"
        if "mid-track" in words:
            yield "advance_error"
    elif "stress" in words and "stage" in dims:  # of which one is released
        yield from ("audit_error_loaded", "audit_error_residual")
    elif "stress" in words and "load" in words:
        yield "audit_error_loaded"


def without(variables: Described, numbers: Iterable[str], requested: Mapping[str, str] = {}) -> str:
    """Return the names of the results among ``numbers`` that have no estimated error."""
    results = (name for name in numbers if not _NO_RESULT.fullmatch(name))
    return " ".join(name for name in results if not errors_of(name, variables, requested))


def described(variables: Mapping[str, Variable]) -> dict[str, tuple[Sequence[str], Any]]:
    """Return dimensions and attributes of variables, for `errors_of`."""
    return {name: (each.dims, each.attrs) for name, each in variables.items()}


def numbers_in(variables: Mapping[str, Variable]) -> list[str]:
    """Return the names of the variables with numbers that are no coordinates."""
    floats = (name for name, each in variables.items() if each.values.dtype.kind == "f")
    return [name for name in floats if variables[name].dims != (name,)]


def with_errors(variables: Mapping[str, Variable], among: Described) -> dict[str, Variable]:
    """Return variables in which each number names its estimated errors ``among`` others."""
    found = dict(variables)
    for name, each in variables.items():
        if errors := errors_of(name, among):
            found[name] = each._replace(attrs={**each.attrs, ANCILLARY: " ".join(errors)})
    return found
