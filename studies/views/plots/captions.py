"""Texts of figures for values, quantities and runs."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from typing import Any

import xarray as xr

from solver.errors import ModelError
from solver.materials.library import library
from solver.materials.library import named as named_material
from solver.parameters import unmet
from solver.tensors import AXES
from studies.definition.parameters import build, defaults, parameters_of, plain
from studies.materials import MATERIAL
from studies.numbers import number_text
from studies.scenes.registry import scene_of
from studies.storage.frame import FRACTION, SETS
from studies.views.columns import (
    COMPUTED,
    computed_text,
    counted,
    unit_of,
    unit_text,
    with_unit,
    words,
)
from studies.views.picking import flags

_STAY = "\N{NO-BREAK SPACE}"
_STRENGTH = "yield_stress"
"""The parameter that says which steel it is."""


def value_text(coordinate: xr.DataArray) -> str:
    """Return a coordinate's single value with its unit."""
    return _text(coordinate.item(), unit_of(coordinate))


def named(name: str, value: Any, unit: str = "") -> str:
    """Return a quantity and its value in words; true is the name, false the name after "not"."""
    if isinstance(value, bool):
        return words(name) if value else f"not {words(name)}"
    return f"{words(name)} {_text(value, unit)}"


def label(variable: xr.DataArray) -> str:
    """Return the meaning of a variable with its symbol and unit, for an axis."""
    name = variable.attrs.get("long_name", str(variable.name))
    return with_unit(f"{name} {symbol(variable)}".rstrip(), unit_of(variable))


_SYMBOLS = {
    "principal_1": "{0}_{{1}}", "principal_2": "{0}_{{2}}", "principal_3": "{0}_{{3}}",
    "tresca": "{0}_{{1}} - {0}_{{3}}", "hydrostatic": r"{0}_{{\mathrm{{m}}}}",
}  # fmt: skip
"""Invariants of a tensor as mathtext, with its letter."""


def symbol(values: xr.DataArray) -> str:
    """Return the symbol of a component of stress, strain or displacement; else an empty text."""
    if "component" not in values.coords or values["component"].ndim:
        return ""
    name = str(values["component"].item())
    words_of = f"{values.name} {values.attrs.get('long_name', '')}"
    letters = {
        "plastic strain": r"\varepsilon^{\mathrm{p}}", "strain": r"\varepsilon",
        "displacement": "u",
    }  # fmt: skip
    letter = next((each for word, each in letters.items() if word in words_of), r"\sigma")
    return f"${_SYMBOLS.get(name, f'{{0}}_{{{{{name}}}}}').format(letter)}$"


DISTANCE = "distance"
"""The coordinate of lines and contacts that `placed` adds."""
_LENGTHS = {
    "s": "distance from the middle $s$",
    "depth": "depth below the surface",
    "fraction": "fraction of the length",
}
"""Labels of axes, by the name of the variable; those of coordinates are their names."""


def axis_label(coordinate: xr.DataArray) -> str:
    """Return the label of a horizontal axis with its unit: short, with the symbol."""
    name = str(coordinate.name)
    usual = f"${name}$" if name in AXES else coordinate.attrs.get("long_name", words(name))
    if name == DISTANCE and "distance" in usual:
        usual = f"{usual.replace('distance s ', 'distance ')} $s$"
    return with_unit(_LENGTHS.get(name, usual), unit_of(coordinate))


def short_label(variable: xr.DataArray) -> str:
    """Return the name of a parameter or a figure in words, with its unit."""
    return with_unit(words(str(variable.name)), unit_of(variable))


def capitalised(text: str) -> str:
    """Return text with its first letter as a capital and the others unchanged."""
    return text[:1].upper() + text[1:]


def setting(run: xr.Dataset) -> str:
    """Return the scene and what distinguishes this run from others, in words.

    These are its values on the axes of the sweep, and the parameters that differ from the scene's
    defaults. The two-dimensional state and the yield stress are always named. A material of the
    library, or of an axis, stands for its parameters.
    """
    scene = run.attrs["scene"]
    known = parameters_of(scene_of(run.attrs))
    given: Mapping[str, Any] = json.loads(run.attrs["parameters"])
    usual = _usual(run, given)
    own = {name: computed_text(value, _computed(run, name)) for name, value in given.items()}
    values = _values(run, given)
    idle, material = _idle(run, values), _material(values)
    if MATERIAL in run.coords:
        idle |= {*run[MATERIAL].attrs.get(SETS, "").split()}
    made = {*named_material(material)} if material else set()
    plane = given.get("state")
    state = [words(plane)] if isinstance(plane, str) and "state" not in run.coords else []
    place = [
        named(
            str(name),
            computed_text(plain(each.item(), known[name].default), _computed(run, str(name)))
            if name in known
            else each.item(),
            unit_of(each),
        )
        for name, each in run.coords.items()
        if each.ndim == 0 and not str(name).endswith(FRACTION) and name not in idle
    ]
    if material and MATERIAL not in run.coords:
        place.append(named(MATERIAL, material))
    others = [
        named(name, own[name], known[name].unit)
        for name, value in given.items()
        if name in known
        and name not in {*run.coords, *idle, *made}
        and value is not None
        and (value != usual[name] or name == _STRENGTH)
        and not (state and name == "state")
    ]
    parts = [scene, *state, *place, *others]
    return f"{_STAY}· ".join(part.replace(" ", _STAY) for part in parts)


def _computed(run: xr.Dataset, name: str) -> str:
    """Return the word of what a run was computed with, if it holds one for this parameter."""
    variable = run.get(f"{COMPUTED}{name}")
    return "" if variable is None or variable.ndim else flags(variable).get(variable.item(), "")


def _values(run: xr.Dataset, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of parameters of a run."""
    known = parameters_of(scene_of(run.attrs))
    own = {str(name): each.item() for name, each in run.coords.items() if each.ndim == 0}
    values = {name: value for name, value in {**given, **own}.items() if name in known}
    return {name: plain(value, known[name].default) for name, value in values.items()}


def _material(values: Mapping[str, Any]) -> str:
    """Return the material of the library that has these parameters; else an empty text."""
    each = ((name, named_material(name).items()) for name in library())
    return next((name for name, own in each if all(values.get(k) == v for k, v in own)), "")


def _idle(run: xr.Dataset, values: Mapping[str, Any]) -> set[str]:
    """Return the parameters that change nothing in a run, such as a load ratio beside a force.

    Those that every pass of a sequence has for itself do not either.
    """
    scene = scene_of(run.attrs)
    try:
        parameters = build(scene, values)
    except ModelError:  # consistent only with values that differ between the runs
        return set()
    passes = [set(own) for own in getattr(parameters, "sequence", ())]
    each = set.intersection(*passes) if passes else set()
    return each | {name for name in parameters_of(scene) if unmet(parameters, name)}


def _usual(run: xr.Dataset, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the default parameters of a run; for several runs, the defaults that they declare."""
    scene = scene_of(run.attrs)
    known = parameters_of(scene)
    swept = {
        str(name): plain(each.item(), known[name].default)
        for name, each in run.coords.items()
        if name in known and each.ndim == 0
    }
    try:
        return defaults(scene, {**given, **swept})
    except ModelError:  # the parameters are consistent only with the swept values
        return {name: parameter.default for name, parameter in known.items()}


def wrapped(text: str, width: float, points: int) -> str:
    """Return text in lines that fit `width` [in] at a font size [points]."""
    return textwrap.fill(text, int(width * 72.0 / (0.52 * points)), break_long_words=False)


def _text(value: Any, unit: str) -> str:
    text = number_text(value, 6) if isinstance(value, int | float) else words(counted(value))
    return text if not unit_text(unit) or isinstance(value, str) else f"{text} {unit}"
