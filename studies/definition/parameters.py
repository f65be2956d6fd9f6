"""The parameters of a scene: checked, normalised, described."""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args, get_type_hints

from annotated_types import Unit
from pydantic import TypeAdapter, ValidationError

from solver.scenes import SCENES, Scene
from studies.errors import StudyError

_RELATIONS = {
    "exclusiveMinimum": ">",
    "minimum": ">=",
    "exclusiveMaximum": "<",
    "maximum": "<=",
}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a scene: its name, unit, default, what it means and what it accepts."""

    name: str
    unit: str
    default: Any
    description: str
    schema: Mapping[str, Any]
    adapter: TypeAdapter[Any] = dataclasses.field(repr=False)

    @property
    def allowed(self) -> str:
        """What the parameter accepts, in words."""
        choices = [_describe(option) for option in self.schema.get("anyOf", [self.schema])]
        unit = "" if self.unit in {"", "1"} else f" [{self.unit}]"
        return " or ".join(choices) + unit

    def normalise(self, value: Any, field: str) -> Any:
        """Return `value` as JSON would hold it in this parameter's type.

        Raises
        ------
        StudyError
            naming `field`, when the value has the wrong type, is out of range or not finite
        """
        refusal = StudyError(field, value, f"must be {self.allowed}")
        try:
            checked = self.adapter.validate_json(json.dumps(value, allow_nan=False), strict=True)
        except (ValidationError, ValueError, TypeError, RecursionError):
            raise refusal from None
        if isinstance(checked, float) and not math.isfinite(checked):
            raise refusal
        return self.adapter.dump_python(checked, mode="json")


def scene_named(name: Any) -> Scene:
    """Return the scene called `name`, or raise a `StudyError` that says which exist."""
    if isinstance(name, str) and name in SCENES:
        return SCENES[name]
    raise StudyError("scene", name, one_of(name, SCENES))


def one_of(name: Any, names: Iterable[str]) -> str:
    """Return what is allowed in place of `name`: one of `names`, the nearest of them last."""
    known = list(names)
    return f"must be one of {', '.join(known)}{nearest(name, known)}"


def nearest(name: Any, names: Iterable[str]) -> str:
    """Return ``"; did you mean …?"`` when one of `names` resembles `name`, else nothing."""
    matches = difflib.get_close_matches(str(name), list(names), n=1)
    return f"; did you mean {matches[0]}?" if matches else ""


@cache
def parameters_of(scene: Scene) -> dict[str, Parameter]:
    """Return the parameters of a scene, by name, in the order in which it declares them."""
    hints = get_type_hints(scene.parameters, include_extras=True)
    found = {}
    for field in dataclasses.fields(scene.parameters):
        adapter: TypeAdapter[Any] = TypeAdapter(hints[field.name])
        marks = get_args(hints[field.name])[1:]
        found[field.name] = Parameter(
            name=field.name,
            unit=next((mark.unit for mark in marks if isinstance(mark, Unit)), ""),
            default=adapter.dump_python(field.default, mode="json"),
            description=field.metadata.get("description", ""),
            schema=adapter.json_schema(),
            adapter=adapter,
        )
    return found


def build(scene: Scene, values: Mapping[str, Any]) -> Any:
    """Return the scene's parameter object for normalised `values`; the scene checks the rest."""
    known = parameters_of(scene)
    typed = {
        name: known[name].adapter.validate_json(json.dumps(value)) for name, value in values.items()
    }
    return scene.parameters(**typed)


def scene_schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a scene's parameters, each with its ``unit``."""
    scene = scene_named(name)
    schema = TypeAdapter(scene.parameters).json_schema()
    for parameter in parameters_of(scene).values():
        if parameter.unit:
            schema["properties"][parameter.name]["unit"] = parameter.unit
    return {**schema, "additionalProperties": False}


def _describe(schema: Mapping[str, Any]) -> str:
    if "enum" in schema:
        return "one of " + ", ".join(str(option) for option in schema["enum"])
    if "const" in schema:
        return str(schema["const"])
    kind = schema.get("type", "value")
    words = {
        "number": "a finite number",
        "integer": "an integer",
        "string": "a text",
        "boolean": "true or false",
        "null": "left out",
    }
    limits = [
        f"{relation} {schema[key]:g}" for key, relation in _RELATIONS.items() if key in schema
    ]
    return " ".join(
        [words.get(kind, f"of type {kind}"), *([" and ".join(limits)] if limits else [])]
    )


def plain(value: Any, usual: Any) -> Any:
    """Return a value that may have become text, such as one of an axis, as the usual value is.

    Text that stands for no number and no truth value stays as it is.
    """
    if isinstance(usual, str) or not isinstance(value, str):
        return value
    try:
        return json.loads(value)
    except (ValueError, RecursionError):
        return value
