"""The parameters of a scene: read from JSON or TOML, described in words, built.

The scene's parameter object alone decides whether a value is allowed: it checks itself when it is
built. This module only converts a value to the parameter's type, and describes the declared range.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Unit
from pydantic import TypeAdapter, ValidationError

from solver.parameters import is_number
from solver.parts import SETTING, own_files
from solver.scenes import Scene
from studies.errors import Mistakes, StudyError, one_of
from studies.materials import MATERIAL, parameters_in
from studies.scenes.registry import scene_named
from studies.units import UnitError, converted, is_quantity, number_in

_RELATIONS = {
    "exclusiveMinimum": ">",
    "minimum": ">=",
    "exclusiveMaximum": "<",
    "maximum": "<=",
}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a scene, as its parameter class declares it.

    Attributes
    ----------
    name, unit, default, description : as declared; the default is a JSON value, or None if the
        scene's parameter object derives it from other parameters
    schema : JSON Schema of what is allowed
    """

    name: str
    unit: str
    default: Any
    description: str
    schema: Mapping[str, Any]
    _type: TypeAdapter[Any] = dataclasses.field(repr=False)
    _range: TypeAdapter[Any] = dataclasses.field(repr=False)
    _of_parts: bool = dataclasses.field(default=False, repr=False)

    @property
    def allowed(self) -> str:
        """The allowed values, as text."""
        choices = [_describe(option) for option in self.schema.get("anyOf", [self.schema])]
        unit = "" if self.unit in {"", "1"} else f" [{self.unit}]"
        return " or ".join(choices) + unit

    def normalise(self, value: Any, field: str) -> Any:
        """Return `value` as a JSON value of this parameter's type.

        A text such as ``195 GPa`` is the number in the unit of the parameter.

        Raises
        ------
        StudyError
            naming `field`, when the value has the wrong type, another dimension, or is not in the
            declared range
        """
        value = self.in_own_unit(value, field)
        if value is None and self.default is None:  # left out, as a stored study has it
            return None
        try:
            typed = self._type.validate_json(json.dumps(value, allow_nan=False), strict=True)
        except (ValidationError, ValueError, TypeError, RecursionError):
            raise self.refusal(field, value) from None
        if (isinstance(typed, float) and not math.isfinite(typed)) or not self.in_range(typed):
            raise self.refusal(field, value)
        return self._type.dump_python(typed, mode="json")

    def in_own_unit(self, value: Any, field: str) -> Any:
        """Return the number of a text such as ``195 GPa`` in the unit of this parameter.

        Other values stay, and so do words of a parameter that takes no numbers.

        Raises
        ------
        StudyError
            naming `field`, when the unit has another dimension
        """
        options = self.schema.get("anyOf", [self.schema])
        if not is_quantity(value) or {"number", "integer"}.isdisjoint(
            each.get("type") for each in options
        ):
            return value
        return in_unit(self.unit, value, field, self.allowed)

    def read(self, text: str, field: str) -> Any:
        """Return the normalised value that a text stands for: a word, or else JSON.

        Raises
        ------
        StudyError
            naming `field`, when it stands for none
        """
        value = self.in_own_unit(text, field)
        with suppress(StudyError):
            return self.normalise(value, field)
        try:
            return self.normalise(json.loads(text), field)
        except (ValueError, RecursionError):
            raise self.refusal(field, text) from None

    def typed(self, value: Any) -> Any:
        """Return a normalised value in the type of the parameter object; None if left out."""
        return None if value is None else self._type.validate_python(value)

    def in_range(self, value: Any) -> bool:
        """Whether `value` is in the declared range, without regard to other parameters."""
        try:
            self._range.validate_python(value)
        except ValidationError:
            return False
        return True

    @property
    def whole(self) -> bool:
        """Whether its numbers are integers."""
        options = self.schema.get("anyOf", [self.schema])
        return "number" not in {each.get("type") for each in options}

    def number(self, value: Any, field: str) -> float:
        """Return `value` as a number that is in the declared range.

        Raises
        ------
        StudyError
            naming `field`, when it is none
        """
        number = self.normalise(value, field)
        if not is_number(number) or not self.in_range(self.typed(number)):
            raise self.refusal(field, value)
        return number

    def refusal(self, field: str, value: Any) -> StudyError:
        """Return the error for a value that is not allowed: it says what is."""
        hint = ""
        if self._of_parts and isinstance(value, str) and not own_files():
            hint = f"; a word of your own needs its file in the environment variable {SETTING}"
        return StudyError(field, value, f"must be {self.allowed}{hint}")


@lru_cache(maxsize=128)
def parameters_of(scene: Scene) -> dict[str, Parameter]:
    """Return the parameters of a scene by name, in the order of declaration."""
    hints = get_type_hints(scene.parameters, include_extras=True)
    found, parts = {}, {each.kind for each in getattr(scene.parameters, "PARTS", ())}
    for field in dataclasses.fields(scene.parameters):
        hint = hints[field.name]
        in_range: TypeAdapter[Any] = TypeAdapter(hint)
        marks = get_args(hint)[1:]
        found[field.name] = Parameter(
            name=field.name,
            unit=next((mark.unit for mark in marks if isinstance(mark, Unit)), ""),
            default=_plain(in_range, field.default),
            description=field.metadata.get("description", ""),
            schema=in_range.json_schema(),
            _of_parts=field.name in parts,
            _type=TypeAdapter(_bare(hint)),
            _range=in_range,
        )
    return found


def build(scene: Scene, values: Mapping[str, Any]) -> Any:
    """Return the scene's parameter object for normalised `values`.

    Raises
    ------
    ModelError
        from the parameter object, which checks each value and how they go together
    """
    known = parameters_of(scene)
    return scene.parameters(**{name: known[name].typed(value) for name, value in values.items()})


def read_values(scene: Scene, texts: Mapping[str, str]) -> dict[str, Any]:
    """Return normalised values of parameters that are given as texts.

    Raises
    ------
    StudyError
        if there is no such parameter, or it cannot have such a value
    """
    known = parameters_of(scene)
    wrong = Mistakes()
    found, texts = of_material(texts, known, wrong)
    wrong.report()
    for name, text in texts.items():
        if name not in known:
            raise StudyError(name, text, one_of(name, known, "residua scenes SCENE lists all"))
    return found | {name: known[name].read(text, name) for name, text in texts.items()}


def of_material(
    content: Mapping[str, Any], known: Mapping[str, Parameter], wrong: Mistakes
) -> tuple[dict[str, Any], Mapping[str, Any]]:
    """Return the normalised parameters of the `MATERIAL` of settings, and the other settings.

    A scene whose bodies do not yield takes the elastic constants alone. It is wrong if there is
    none of this name, or the scene lacks one of its parameters.
    """
    if MATERIAL not in content or MATERIAL in known:
        return {}, content
    found, given = dict[str, Any](), content[MATERIAL]
    with wrong.at(MATERIAL):
        values = parameters_in(given)
        if "yield_stress" not in known:
            values = {name: value for name, value in values.items() if name in _ELASTIC}
        for name, value in values.items():
            if name not in known:
                raise StudyError("", given, f"has {name}, and the scene has no such parameter")
            found[name] = known[name].normalise(value, name)
    return found, {name: value for name, value in content.items() if name != MATERIAL}


_ELASTIC = ("youngs_modulus", "poisson_ratio")


def completed(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return normalised values, with values of the parameter object for those left out (None)."""
    left_out = [name for name, value in values.items() if value is None]
    chosen = build(scene, values) if left_out else None
    return dict(values) | {name: getattr(chosen, name) for name in left_out}


def defaults(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return all defaults; derived ones are those of the parameter object with `values`."""
    declared = {name: parameter.default for name, parameter in parameters_of(scene).items()}
    left_out = {name: None for name, default in declared.items() if default is None}
    known = {name: value for name, value in values.items() if name in declared}
    chosen = completed(scene, {**declared, **known, **left_out})
    return declared | {name: chosen[name] for name in left_out}


def scene_schema(scene: Scene | str) -> dict[str, Any]:
    """Return the JSON Schema of a scene's parameters, each with its ``unit``."""
    scene = scene_named(scene) if isinstance(scene, str) else scene
    schema = TypeAdapter(scene.parameters).json_schema()
    for parameter in parameters_of(scene).values():
        own = schema["properties"][parameter.name]
        if parameter.unit:
            own["unit"] = parameter.unit
        if parameter.default is None:  # no value of its own, so that none may be written
            del own["default"]
    return {**schema, "additionalProperties": False}


def _plain(kind: TypeAdapter[Any], default: Any) -> Any:
    """Return a default as a JSON value; None if the parameter object derives it."""
    return None if default is None else kind.dump_python(default, mode="json")


def _bare(hint: Any) -> Any:
    """Return a type without its range or choices."""
    if get_origin(hint) is Annotated:
        return _bare(get_args(hint)[0])
    if get_origin(hint) is Literal:
        return Union[*{type(option) for option in get_args(hint)}]
    if get_origin(hint) in (Union, UnionType):
        return Union[*map(_bare, get_args(hint))]
    return hint


def _describe(schema: Mapping[str, Any]) -> str:
    if "enum" in schema:
        return "one of " + ", ".join(str(option) for option in schema["enum"])
    if "$ref" in schema:  # a class with fields of its own
        return f"a {schema['$ref'].rpartition('/')[2]}"
    if "const" in schema:
        return str(schema["const"])
    kind = schema.get("type", "value")
    if "prefixItems" in schema:
        return "[" + ", ".join(map(_describe, schema["prefixItems"])) + "]"
    if kind == "array":
        return f"a list of {_describe(schema['items'])}" if "items" in schema else "a list"
    entry = schema.get("additionalProperties")
    if kind == "object" and isinstance(entry, Mapping):
        values = " or ".join(map(_describe, entry.get("anyOf", [entry])))
        return f"tables, each value {values}"
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


def in_unit(unit: str, value: Any, field: str, allowed: str = "") -> Any:
    """Return the number of a text such as ``195 GPa`` in a unit; other values stay.

    Raises
    ------
    StudyError
        naming ``field``, when the unit has another dimension
    """
    if not is_quantity(value):
        return value
    try:
        return converted(value, unit)
    except UnitError as error:
        raise StudyError(field, value, f"must be {allowed or number_in(unit)}; {error}") from None


def plain(value: Any, usual: Any) -> Any:
    """Return a value that was stored as text, converted to the type of the usual value.

    For instance, an axis of truth values is stored as text. Text that is neither a number nor a
    truth value stays text.
    """
    if isinstance(usual, str) or not isinstance(value, str):
        return value
    try:
        return json.loads(value)
    except (ValueError, RecursionError):
        return value
