"""The form of a new study: what its fields say as a study, and the mistakes beside them."""

from __future__ import annotations

import json
import pprint
import re
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from solver.scenes import Scene
from studies.definition.cases import USUAL_AXES
from studies.definition.parameters import Parameter, parameters_of
from studies.definition.points import ENTRIES
from studies.definition.study import Study
from studies.errors import StudyError
from studies.kinds import KINDS
from studies.toml import toml_of, toml_text

PREFIX = "p."
"""What precedes the name of a parameter in the name of its field."""

RANGE = re.compile(
    r"(?P<start>\S+)\s*\.\.\s*(?P<stop>\S+)\s+in\s+(?P<num>[0-9]{1,9})(?P<log>\s+log)?"
)
"""Values of equal steps: ``0 .. 0.4 in 5``."""

LONGEST_RANGE = 200
"""Largest length of such a text: the time to look for it grows with the square of its length."""

LONGEST = 100_000
"""Largest number of characters in the fields of a parameter."""

OF = re.compile(r"(?:(?:parameters|sweep)\.)?(?P<name>(?P<table>\w+)(?:\.\w+)?)")

SCHEMA = Study.model_json_schema()
CHOOSING = (*KINDS, *ENTRIES)
"""Entries of a study that the form has tables for."""


class TableField(NamedTuple):
    """A field of an entry of a study, such as of ``goal``: its name, meaning, default and text."""

    name: str
    meaning: str
    usual: str
    text: str
    wrong: str


def tables(
    given: Mapping[str, Sequence[str]], wrong: Mapping[str, str]
) -> dict[str, tuple[str, list[TableField]]]:
    """Return what each entry of `CHOOSING` means, and its fields, as the JSON Schema has them."""
    found = {}
    for table in CHOOSING:
        own = _resolved(SCHEMA["properties"][table])
        entries = {f"{table}.{entry}": each for entry, each in own.get("properties", {}).items()}
        fields = [
            _table_field(name, each, given, wrong)
            for name, each in (entries or {table: own}).items()
        ]
        found[table] = own["description"], fields
    return found


def _table_field(
    name: str, schema: Any, given: Mapping[str, Sequence[str]], wrong: Mapping[str, str]
) -> TableField:
    words = [word for each in (schema, *schema.get("anyOf", ())) for word in each.get("enum", ())]
    meaning = schema.get("description", "") + (f": {', '.join(words)}" if words else "")
    default = schema.get("default")
    usual = toml_text(default) if default or default == 0 else ""
    return TableField(name, meaning, usual, _one(given, name), wrong.get(name, ""))


def _resolved(schema: Mapping[str, Any]) -> Any:
    ref = schema.get("$ref", "").rpartition("/")[2]
    return {**SCHEMA["$defs"][ref], **schema} if ref else schema


def table_of(table: str, given: Mapping[str, Sequence[str]]) -> Any:
    """Return what the fields of an entry say: values of TOML, or else texts."""
    if table in given:
        return _toml(_one(given, table))
    texts = {name: _one(given, name) for name in given if name.startswith(f"{table}.")}
    return {name.partition(".")[2]: _toml(text) for name, text in texts.items() if text}


def _toml(text: str) -> Any:
    for written in (text, f"{{{text}}}"):  # a table needs no braces
        with suppress(StudyError):
            return toml_of(f"x = {written}".encode(), "x", text)["x"]
    return text


@dataclass(frozen=True, slots=True, kw_only=True)
class FormField:
    """One field of the form.

    Attributes
    ----------
    parameter : what it sets
    texts : what is in it; several where boxes are ticked
    choices : the words or truth values that may be ticked; empty for a text
    wrong : what is allowed, if what is in it is not
    """

    parameter: Parameter
    texts: Sequence[str]
    choices: Sequence[str]
    wrong: str = ""

    @property
    def usual(self) -> str:
        """The default, as one would write it."""
        default = self.parameter.default
        return (
            "" if default is None else default if isinstance(default, str) else json.dumps(default)
        )

    @property
    def first(self) -> bool:
        """Whether it is one of those that are swept most."""
        return self.parameter.name in USUAL_AXES


def entries(
    scene: Scene, given: Mapping[str, Sequence[str]], wrong: Mapping[str, str]
) -> list[FormField]:
    """Return the fields of the parameters of a scene with what is in them."""
    found = []
    for name, parameter in parameters_of(scene).items():
        choices = choices_of(parameter)
        texts = [each for each in given.get(PREFIX + name, ()) if each.strip()]
        usual = FormField(parameter=parameter, texts=(), choices=choices).usual
        texts = texts or ([usual] if choices else [])
        found.append(
            FormField(parameter=parameter, texts=texts, choices=choices, wrong=wrong.get(name, ""))
        )
    return found


def choices_of(parameter: Parameter) -> list[str]:
    """Return the values of a parameter that has words or truth values; empty for others."""
    schema = parameter.schema
    if schema.get("type") == "boolean":
        return ["false", "true"]
    return [str(each) for each in schema.get("enum", [])]


def study_of(
    scene_name: str, scene: Scene, given: Mapping[str, Sequence[str]]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the study that the fields describe, and each mistake by its parameter.

    A field with its default, or with nothing, is left out; one with several values is swept.
    """
    study: dict[str, Any] = {
        "name": _one(given, "name") or f"{scene.name}-study",
        "scene": scene_name,
    }
    if note := _one(given, "note"):
        study["note"] = note
    if tags := [each.strip() for each in _one(given, "tags").split(",") if each.strip()]:
        study["tags"] = tags
    if _one(given, "keep"):
        study["keep"] = "fields"
    if (table := _one(given, "choose")) in CHOOSING:
        study[table] = table_of(table, given)
    fixed: dict[str, Any] = {}
    swept: dict[str, Any] = {}
    wrong: dict[str, str] = {}
    for name, parameter in parameters_of(scene).items():
        texts = [each.strip() for each in given.get(PREFIX + name, ()) if each.strip()]
        if not texts:
            continue
        try:
            value, several = _value(parameter, texts)
        except StudyError as error:
            wrong[name] = error.allowed
            continue
        if several:
            swept[name] = value
        elif value != parameter.default:
            fixed[name] = value
    return study | {"parameters": fixed, "sweep": swept}, wrong


def _value(parameter: Parameter, texts: Sequence[str]) -> tuple[Any, bool]:
    """Return what texts say, and whether it is swept."""
    if (size := sum(map(len, texts))) > LONGEST:
        allowed = f"must have at most {LONGEST} characters: write it as a study file"
        raise StudyError(parameter.name, f"{size} characters", allowed)
    match = RANGE.fullmatch(texts[0]) if len(texts[0]) <= LONGEST_RANGE else None
    if match:
        ends = {key: parameter.read(match[key], parameter.name) for key in ("start", "stop")}
        spacing = {"spacing": "log"} if match["log"] else {}
        return {**ends, "num": int(match["num"]), **spacing}, True
    whole = texts[0].startswith(("[", "{"))
    parts = texts if whole or len(texts) > 1 else texts[0].split(",")
    values = [parameter.read(each.strip(), parameter.name) for each in parts if each.strip()]
    return (values, True) if len(values) > 1 else (values[0] if values else None, False)


def _one(given: Mapping[str, Sequence[str]], name: str) -> str:
    return given.get(name, [""])[0].strip()


def beside(error: StudyError, scene: Scene) -> dict[str, str]:
    """Return what is allowed by the parameter that a mistake is about, or by its field."""
    wrong: dict[str, str] = {}
    for each in error.each:
        match = OF.match(each.field)
        names = (match["table"], match["name"]) if match else ("", "")
        name = names[names[0] in CHOOSING]
        beside = name in parameters_of(scene) or names[0] in CHOOSING
        wrong.setdefault(name if beside else each.field, each.allowed)
    return wrong


def as_toml(study: Mapping[str, Any], scene_name: str) -> str:
    """Return the file of a study, with the name of its scene where it calls it by an id."""
    tables = ("parameters", "sweep")
    lines = [f"{key} = {toml_text(value)}" for key, value in study.items() if key not in tables]
    if study["scene"] != scene_name:
        at = list(study).index("scene")
        lines[at] += f"  # {scene_name}"
    for table in tables:
        if study[table]:
            lines += ["", f"[{table}]"]
            lines += [f"{key} = {toml_text(value)}" for key, value in study[table].items()]
    return "\n".join(lines) + "\n"


def as_curl(study: Mapping[str, Any], address: str) -> str:
    """Return a line for a shell that posts a study."""
    said = shlex.quote(json.dumps(study))
    return f"curl -i {address} -H 'content-type: application/json' -d {said}\n"


def as_python(study: Mapping[str, Any], service: str) -> str:
    """Return a program that has a service at an address compute a study, and opens its data set."""
    content = pprint.pformat(dict(study), width=88, sort_dicts=False)
    return (
        f"from studies import Client\n\nstudy = {content}\nwith Client({service!r}) as service:\n"
        "    dataset = service.submit(study).wait().open()\nprint(dataset)\n"
    )
