"""Scenes: list, parameters, and posting of the caller's own scene files."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, File, Request, Response, UploadFile

from service.dependencies import TheInspector, TheStore
from service.errors import REFUSED, NotFound
from service.schemas import KeptScene, SceneSummary
from solver.scenes import Scene
from studies import StudyError, scene_schema
from studies.scenes.registry import known_names, known_scenes, name_of, scene_named

router = APIRouter(prefix="/scenes", tags=["scenes"])

LISTED = 100
"""Number of posted scenes that are listed, the newest first."""


@router.get("")
def list_scenes(store: TheStore) -> list[SceneSummary]:
    """List the scenes: those of the product, of installed packages, then the latest posted ones."""
    listed: list[tuple[str | None, Scene]] = [(None, scene) for scene in known_scenes()]
    listed += [(name_of(scene), scene) for scene in store.newest_scenes(LISTED)]
    return [
        SceneSummary(name=scene.name, summary=scene.summary, branch=scene.branch, id=scene_id)
        for scene_id, scene in listed
    ]


@router.post("", status_code=HTTPStatus.CREATED, responses={200: {"model": KeptScene}, **REFUSED})
async def post_scene(
    scene: Annotated[UploadFile, File(description="a scene file, in TOML")],
    inspector: TheInspector,
    store: TheStore,
    request: Request,
    response: Response,
    meshes: Annotated[
        list[UploadFile], File(default_factory=list, description="the meshes it names")
    ],
) -> KeptScene:
    """Accept a scene file and its meshes; 200 when it is known already.

    A study names it by its `id`.
    """
    files: dict[str, bytes] = {}
    for each in meshes:
        if not each.filename or each.filename in files:
            raise StudyError("meshes", each.filename, "must have file names of their own")
        files[each.filename] = await each.read()
    found = await inspector.inspect(await scene.read(), files)
    known = await asyncio.to_thread(store.scene, found.id)
    await asyncio.to_thread(store.save_scene, found)
    if known:
        response.status_code = HTTPStatus.OK
    response.headers["location"] = request.url_for("get_scene", name=found.id).path
    return KeptScene(id=found.id, name=found.name, summary=found.summary)


@router.get("/{name}")
def get_scene(name: str, store: TheStore) -> dict[str, Any]:
    """Return the JSON Schema of a scene's parameters, with units, ranges and defaults.

    `name` is that of a scene, or the id of a posted one.
    """
    if kept := store.scene(name):
        entry = {"id": name, "name": kept.name, "summary": kept.summary}
        return scene_schema(kept) | entry
    if name not in known_names():
        raise NotFound(f"no scene has this name; there are {', '.join(known_names())}")
    return scene_schema(scene_named(name))
