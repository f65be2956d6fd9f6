"""A study: one scene, some fixed parameters, some swept ones; checked before anything runs."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from solver.scenes import SCENES
from studies import design
from studies.errors import StudyError
from studies.identity import canonical, content_id
from studies.parameters import Parameter, nearest, parameters_of, scene_named

MAXIMUM_RUNS = 100_000
"""Largest number of points a sweep may have."""

_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,79}")


class Study(BaseModel):
    """One scene swept over some of its parameters.

    Build it with `from_toml` or `from_dict`, which raise `StudyError` for bad input.

    Attributes
    ----------
    name : 1 to 80 of ``A-Z a-z 0-9 . _ -``, not beginning with a dot
    scene : name of the scene
    parameters : fixed parameters; the rest are the scene's defaults
    sweep : axes, in the order in which the scene declares its parameters; the values of an
        axis stay in the order given
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    scene: str
    parameters: dict[str, Any] = Field(default_factory=dict)
    sweep: dict[str, list[Any]] = Field(default_factory=dict)

    @classmethod
    def from_toml(cls, path: FilePath | str) -> Self:
        """Read a study file."""
        try:
            text = FilePath(path).read_text(encoding="utf-8")
            content = tomllib.loads(text)
        except OSError as error:
            raise StudyError("file", str(path), f"cannot be read: {error.strerror}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise StudyError("file", str(path), f"must be valid TOML: {error}") from None
        return cls.from_dict(content)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Check and normalise the content of a study file (or of its JSON equivalent)."""
        if not isinstance(content, Mapping):
            raise StudyError("study", content, "must be a table with name, scene and sweep")
        try:
            return cls.model_validate(dict(content))
        except ValidationError as error:
            first = error.errors()[0]
            cause = first.get("ctx", {}).get("error")
            if isinstance(cause, StudyError):
                raise cause from None
            field = ".".join(str(part) for part in first["loc"])
            raise StudyError(field, first["input"], first["msg"]) from None

    @model_validator(mode="before")
    @classmethod
    def _check(cls, content: dict[str, Any]) -> dict[str, Any]:
        for key in content:
            if key not in cls.model_fields:
                fields = ", ".join(cls.model_fields)
                raise StudyError(
                    str(key),
                    content[key],
                    f"must be one of {fields}{nearest(key, cls.model_fields)}",
                )
        scene = scene_named(content.get("scene"))
        known = parameters_of(scene)
        fixed = _table("parameters", content.get("parameters", {}), known)
        swept = _table("sweep", content.get("sweep", {}), known)
        _check_size(swept)
        for name in fixed:
            if name in swept:
                raise StudyError(f"parameters.{name}", fixed[name], "is swept too: keep one")
        name = _checked_name(content.get("name"))
        parameters = {
            key: known[key].normalise(value, f"parameters.{key}") for key, value in fixed.items()
        }
        sweep = {key: _axis(known[key], swept[key]) for key in known if key in swept}
        for _ in design.cases(scene, parameters, sweep):
            pass  # building a case is how the scene checks combinations of parameters
        return {"name": name, "scene": scene.name, "parameters": parameters, "sweep": sweep}

    @cached_property
    def id(self) -> str:
        """Content id of the study.

        The name counts, because it is the title of what the study writes: a copy under
        another name is another data set. That costs nothing, since the two share every run.
        """
        return content_id("study", self.name, self.scene, self.fixed, self.sweep)

    @property
    def fixed(self) -> dict[str, Any]:
        """All parameters that are not swept, the scene's defaults included."""
        known = parameters_of(SCENES[self.scene])
        defaults = {name: p.default for name, p in known.items() if name not in self.sweep}
        return defaults | self.parameters

    @property
    def axes(self) -> dict[str, list[Any]]:
        """Swept parameters and their values, in the order of `Case.index`."""
        return self.sweep

    @property
    def size(self) -> int:
        """Number of runs."""
        return math.prod(len(values) for values in self.sweep.values())

    def cases(self) -> Iterator[design.Case]:
        """Yield the runs of the study."""
        return design.cases(SCENES[self.scene], self.parameters, self.sweep)

    def paths(self) -> list[design.Path]:
        """Return the loading paths of the study: the cases that one task computes together."""
        return design.paths(SCENES[self.scene], self.cases())

    def to_dict(self) -> dict[str, Any]:
        """Return what `from_dict` reads."""
        return self.model_dump()


def _checked_name(name: Any) -> str:
    if isinstance(name, str) and _NAME.fullmatch(name):
        return name
    raise StudyError("name", name, "must be 1 to 80 of A-Z a-z 0-9 . _ -, not beginning with a dot")


def _table(field: str, content: Any, known: Mapping[str, Parameter]) -> dict[str, Any]:
    if not isinstance(content, Mapping):
        raise StudyError(field, content, "must be a table of parameters")
    for name, value in content.items():
        if name not in known:
            allowed = f"the scene has no such parameter; it has {', '.join(known)}"
            raise StudyError(f"{field}.{name}", value, allowed + nearest(name, known))
    return dict(content)


def _check_size(swept: Mapping[str, Any]) -> None:
    for name, values in swept.items():
        if not isinstance(values, list | tuple) or not values:
            raise StudyError(f"sweep.{name}", values, "must be a list of one value or more")
    runs = math.prod(len(values) for values in swept.values())
    if runs > MAXIMUM_RUNS:
        sizes = " x ".join(f"{len(values)} {name}" for name, values in swept.items())
        raise StudyError("sweep", f"{runs} runs", f"at most {MAXIMUM_RUNS} runs ({sizes})")


def _axis(parameter: Parameter, values: list[Any]) -> list[Any]:
    seen: dict[str, int] = {}
    axis = []
    for position, value in enumerate(values):
        field = f"sweep.{parameter.name}[{position}]"
        normal = parameter.normalise(value, field)
        first = seen.setdefault(canonical(normal), position)
        if first != position:
            raise StudyError(field, value, f"occurs already at position {first}: keep one")
        axis.append(normal)
    return axis
