"""A scene and its parameters, as a user names them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from solver.scenes import Scene
from studies.definition.parameters import read_values
from studies.definition.study import Study
from studies.scenes.registry import beside, scene_named
from studies.toml import read_toml

_OF_STUDIES = {"scene", "extends"}
"""Entries of study files that scene files do not have."""


def described_scene(what: str, texts: Mapping[str, str]) -> tuple[Scene, dict[str, Any]]:
    """Return a scene, and the values of its parameters that differ from the defaults.

    Parameters
    ----------
    what : name of a scene, path of a scene file, or path of a study file, whose first run counts
    texts : values of parameters as texts, which come before those of the study

    Raises
    ------
    StudyError
        if there is no such scene or parameter, or a file has a mistake
    """
    scene, values = _named(what)
    return scene, values | read_values(scene, texts)


def _named(what: str) -> tuple[Scene, dict[str, Any]]:
    path = Path(what)
    if not what.endswith(".toml") or _OF_STUDIES.isdisjoint(read_toml(path, "file")):
        return scene_named(what, beside(Path())), {}
    study = Study.from_toml(path)
    return study.problem, {**next(study.cases()).values, **study.kind.begins}
