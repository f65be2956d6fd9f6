"""Text tables of scenes and their parameters; they do not import libraries to read data sets."""

from __future__ import annotations

from pathlib import Path

from studies.definition.parameters import Parameter, parameters_of
from studies.scenes.registry import beside, scene_named, summaries
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
