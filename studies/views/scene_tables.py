"""Scenes as a user names them, and tables of them; no library that reads data sets is imported."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from solver.materials.doubts import doubts
from solver.scenes import Scene
from studies.definition.parameters import Parameter, build, parameters_of, read_values
from studies.definition.study import Study
from studies.scenes.registry import beside, scene_named, summaries
from studies.toml import read_toml
from studies.views.columns import aligned, value_text


def scenes_table() -> str:
    """Return a line for each scene."""
    return aligned([list(each) for each in summaries().items()])


def scene_table(name: str) -> str:
    """Return a line for each parameter of a scene: default, allowed values, meaning.

    ``name`` is the name of a scene or the path of a scene file.
    """
    scene = scene_named(name, beside(Path()))
    known = parameters_of(scene).values()
    lines = [["parameter", "default", "allowed", "meaning"]]
    lines += [[each.name, _usual(each), each.allowed, each.description] for each in known]
    return f"{scene.name}: {scene.summary}\n\n{aligned(lines)}"


def _usual(parameter: Parameter) -> str:
    return "by accuracy" if parameter.default is None else value_text(parameter.default)


_OF_STUDIES = {"scene", "extends"}
"""Entries of study files that scene files do not have."""


def described_scene(what: str, texts: Mapping[str, str]) -> tuple[Scene, dict[str, Any]]:
    """Return a scene, and the values of its parameters that differ from the defaults.

    Parameters
    ----------
    what : name of a scene, path of a scene file, or path of a study file, whose first run counts
    texts : values of parameters as texts, which come before those of the study
    """
    scene, values = _named(what)
    return scene, values | read_values(scene, texts)


def _named(what: str) -> tuple[Scene, dict[str, Any]]:
    path = Path(what)
    if not what.endswith(".toml") or _OF_STUDIES.isdisjoint(read_toml(path, "file")):
        return scene_named(what, beside(Path())), {}
    study = Study.from_toml(path)
    return study.problem, {**next(study.cases()).values, **study.kind.begins}


def doubts_of(scene: Scene, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return messages on materials whose numbers are probably in a wrong unit.

    Raises
    ------
    ModelError
        if a parameter is refused
    """
    parameters = build(scene, values)
    drawn = scene.sketch(parameters) if scene.sketch else None
    try:
        bodies = (drawn or scene.model(parameters)).bodies
    except NotImplementedError:  # no bodies are known before it is computed
        return ()
    return doubts({body.name: body.material for body in bodies})
