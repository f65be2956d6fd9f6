"""Scenes: list, parameters, and posting of the caller's own scene files."""

from __future__ import annotations

import asyncio
from http import HTTPStatus
from typing import Annotated, Any

from fastapi import APIRouter, File, Query, Request, Response, UploadFile

from service.dependencies import (
    TheComputing,
    TheDrawing,
    TheInspector,
    TheKeeper,
    TheStore,
    in_turn,
)
from service.errors import REFUSED
from service.maps import PICTURE
from service.scenes import known_scene
from service.schemas import ContentId, KeptScene, SceneSummary, SketchQuery, Window
from solver.late import Late
from studies.definition.parameters import scene_schema
from studies.errors import StudyError
from studies.scenes.file_scene import FileScene
from studies.scenes.registry import known_scenes

DRAWN = Late("service.drawing:drawn")

router = APIRouter(prefix="/scenes", tags=["scenes"])

FIRST_WORDS = (
    "this scene is kept already, with another summary, description or advice: these stay as they "
    "were first posted"
)


@router.get("")
@in_turn
def list_scenes(which: Annotated[Window, Query()], store: TheStore) -> list[SceneSummary]:
    """List the scenes: those of the product, of installed packages, then the latest posted ones."""
    known = [*known_scenes()]
    shown = [
        SceneSummary(name=scene.name, summary=scene.summary, branch=scene.branch)
        for scene in known[which.offset : which.offset + which.limit]
    ]
    posted = store.scenes(which.limit - len(shown), max(which.offset - len(known), 0))
    return shown + [
        SceneSummary(name=each.name, summary=each.summary, branch=each.branch, id=each.id)
        for each in posted
    ]


@router.post("", status_code=HTTPStatus.CREATED, responses={200: {"model": KeptScene}, **REFUSED})
async def post_scene(
    scene: Annotated[UploadFile, File(description="a scene file, in TOML")],
    inspector: TheInspector,
    keeper: TheKeeper,
    store: TheStore,
    computing: TheComputing,
    request: Request,
    response: Response,
    meshes: Annotated[
        list[UploadFile], File(default_factory=list, description="the meshes and tables it names")
    ],
) -> KeptScene:
    """Accept a scene file and the files it names; 200 when it is known already.

    A study names it by its `id`.
    """
    count = len((await request.form()).getlist("scene"))
    if count > 1:
        raise StudyError("scene", f"{count} files", "must be one file: post each by itself")
    files: dict[str, bytes] = {}
    for each in meshes:
        if not each.filename or each.filename in files:
            raise StudyError("meshes", each.filename, "must have file names of their own")
        files[each.filename] = await each.read()
    found, content = await inspector.inspect(await scene.read(), files, computing)
    known = await asyncio.to_thread(store.scene, found.id, whole=False)
    if not await asyncio.to_thread(keeper.keep_scene, found.id, content, computing.caller):
        response.status_code = HTTPStatus.OK
    response.headers["location"] = request.url_for("get_scene", name=found.id).path
    if not isinstance(known, FileScene) or known.description.content == content.content:
        return found
    return KeptScene(id=found.id, name=known.name, summary=known.summary, note=FIRST_WORDS)


@router.get("/{name}")
@in_turn
def get_scene(name: str, store: TheStore) -> dict[str, Any]:
    """Return the JSON Schema of a scene's parameters, with units, ranges and defaults.

    `name` is that of a scene, or the id of a posted one.
    """
    known = store.scene_id(name)
    found = known_scene(store, known)
    posted = known != found.name
    entry = {"id": known, "name": found.name, "summary": found.summary} if posted else {}
    return scene_schema(found) | entry


@router.get("/{name}/draw.png", responses={**PICTURE, **REFUSED})
async def draw_scene(
    name: str, query: Annotated[SketchQuery, Query()], store: TheStore, drawing: TheDrawing
) -> Response:
    """Draw a scene before anything is computed: meshes, boundaries, supports, loads, contacts.

    Beside the queries named below, every parameter of the scene is one: `?friction=0.3`. `name` is
    that of a scene, or the id of a posted one.
    """
    known = await drawing.reading.here(store.scene_id, name)
    await drawing.reading.here(known_scene, store, known)
    return await drawing.answer((known, query), DRAWN, store.directory, known, query, name=known)


@router.delete("/{name}", status_code=HTTPStatus.NO_CONTENT)
def delete_scene(name: ContentId, keeper: TheKeeper) -> None:
    """Delete a posted scene that no study names; `name` is its id."""
    keeper.delete_scene(name)
