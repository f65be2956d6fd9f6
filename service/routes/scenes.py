"""What can be computed, and what it takes."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from service.errors import NotFound
from service.schemas import SceneSummary
from solver.scenes import SCENES
from studies import scene_schema

router = APIRouter(prefix="/scenes", tags=["scenes"])


@router.get("")
def list_scenes() -> list[SceneSummary]:
    """List the scenes."""
    return [
        SceneSummary(name=scene.name, summary=scene.summary, branch=scene.branch)
        for scene in SCENES.values()
    ]


@router.get("/{name}")
def get_scene(name: str) -> dict[str, Any]:
    """Return the JSON Schema of a scene's parameters, with units, ranges and defaults."""
    if name not in SCENES:
        raise NotFound(f"no scene has this name; there are {', '.join(SCENES)}")
    return scene_schema(name)
