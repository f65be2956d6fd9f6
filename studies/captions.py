"""What figures call values, quantities and runs."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from typing import Any

import xarray as xr


def words(identifier: str) -> str:
    """Return an identifier in words."""
    return identifier.replace("_", " ")


def value_text(coordinate: xr.DataArray) -> str:
    """Return a coordinate's single value with its unit."""
    value = coordinate.item()
    if isinstance(value, str):
        return words(value)
    unit = coordinate.attrs.get("units", "1")
    return f"{value:g}" if unit == "1" else f"{value:g} {unit}"


def label(variable: xr.DataArray) -> str:
    """Return what an axis shows, with its unit."""
    unit = variable.attrs.get("units", "1")
    name = variable.attrs.get("long_name", str(variable.name))
    return name if unit == "1" else f"{name} [{unit}]"


def capitalised(text: str) -> str:
    """Return text with its first letter as a capital, the others as they are."""
    return text[:1].upper() + text[1:]


def setting(run: xr.Dataset) -> str:
    """Return the scene and the parameters that tell this run from others, in words."""
    parameters: Mapping[str, Any] = json.loads(run.attrs["parameters"])
    state = parameters.get("state")
    values = [
        f"{words(str(name))} {value_text(each)}"
        for name, each in run.coords.items()
        if each.ndim == 0
    ]
    parts = [run.attrs["scene"], *([words(state)] if state else []), *values]
    return "  ·  ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in parts)


def wrapped(text: str, width: float, points: int) -> str:
    """Return text in lines that fit `width` inches at a font size."""
    return textwrap.fill(text, int(width * 72.0 / (0.52 * points)), break_long_words=False)
