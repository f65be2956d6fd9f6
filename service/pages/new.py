"""The page of a new study: its form, the picture and the cost of what is in it, a scene file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, File, Request, Response, UploadFile
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import JSONResponse, RedirectResponse

from service.dependencies import (
    TheComputing,
    TheInspector,
    TheKeeper,
    TheReading,
    TheSettings,
    TheStore,
    in_turn,
)
from service.errors import NoRoom
from service.examined import Examined
from service.examiner import examine
from service.maps import PNG
from service.pages import form
from service.pages.rendering import ROOT, PageRoute, page, to_study
from service.routes.scenes import post_scene
from service.scenes import known_scene
from solver.late import Late
from solver.scenes import Scene
from studies.errors import StudyError
from studies.scenes.registry import known_scenes
from studies.storage.store import Store

router = APIRouter(prefix=ROOT, include_in_schema=False, route_class=PageRoute)

USUAL = "punch"
"""The scene of the form."""
LISTED = 25
"""Number of posted scenes that it offers."""
_FEW = 8
"""Number of parameters up to which all are shown at once."""


@router.get("/new")
@in_turn
def new_page(request: Request, store: TheStore, scene: str = USUAL) -> Response:
    """Show the form of a new study; parameters in the address fill it."""
    given = _given(request.query_params.multi_items())
    return _form(request, store, store.scene_id(scene), given, {}, None)


def _given(fields: Iterable[tuple[str, object]]) -> dict[str, list[str]]:
    """Return the texts of the fields of a form by their names."""
    given: dict[str, list[str]] = {}
    for name, value in fields:
        given.setdefault(name, []).append(str(value))
    return given


@router.get("/scene.png")
async def draw_scene(
    request: Request, store: TheStore, reading: TheReading, computing: TheComputing
) -> Response:
    """Draw the scene of the first run that the fields describe; of a scene without a model nothing.

    A page asks for what may not be there, which no browser takes for an error.
    """
    given = _given(request.query_params.multi_items())
    name = given.get("scene", [""])[0]
    scene = await reading.here(known_scene, store, name)
    content, wrong = await reading.here(form.study_of, name, scene, given)
    for field, allowed in wrong.items():
        raise StudyError(field, given.get(f"p.{field}"), allowed)
    try:
        what = store.directory, content
        picture = await computing.apart(
            Late("service.drawing:pictured"), *what, field="study", name=content["name"]
        )
    except StudyError as error:
        if error.field != "scene":
            raise
        return Response(status_code=HTTPStatus.NO_CONTENT)
    return Response(picture, media_type=PNG, headers={"cache-control": "no-cache"})


@router.post("/scenes")
async def take_scene(
    request: Request,
    scene: Annotated[UploadFile, File()],
    inspector: TheInspector,
    keeper: TheKeeper,
    store: TheStore,
    reading: TheReading,
    computing: TheComputing,
    meshes: Annotated[list[UploadFile], File(default_factory=list)],
) -> Response:
    """Keep a scene file with its meshes, and show the form of its studies."""
    there = [each for each in meshes if each.filename]  # a browser sends one of no name for none
    try:
        found = await post_scene(
            scene, inspector, keeper, store, computing, request, Response(), there
        )
    except StudyError as error:
        refused = {"file": scene.filename or "", "mistakes": error.listed}
        return await reading.here(_form, request, store, USUAL, {}, {}, None, refused)
    where = request.url_for("new_page").include_query_params(scene=found.id)
    return RedirectResponse(f"{where.path}?{where.query}", HTTPStatus.SEE_OTHER)


@router.post("/new")
async def make(
    request: Request,
    store: TheStore,
    settings: TheSettings,
    keeper: TheKeeper,
    reading: TheReading,
    computing: TheComputing,
) -> Response:
    """Show what a study costs and what is wrong in the form, or accept the study and show it."""
    given = _given((await request.form()).multi_items())
    scene_name = given.get("scene", [""])[0]
    scene = await reading.here(known_scene, store, scene_name)
    content, wrong = await reading.here(form.study_of, scene_name, scene, given)
    found: Examined | None = None
    if not wrong:
        try:
            examined = await examine(content, settings, computing)
            await run_in_threadpool(keeper.check_room, examined)
            found = examined
        except StudyError as error:
            wrong = form.beside(error, scene)
        except NoRoom as error:
            wrong[""] = str(error)
    if "submit" in given and found is not None:
        job, _ = await run_in_threadpool(keeper.accept, found, 0)
        return to_study(request, job.id)
    if "application/json" in request.headers.get("accept", ""):
        costs = found.costs if found else None
        return JSONResponse({"wrong": wrong, "estimate": costs, **_copies(request, content, scene)})
    return await reading.here(_form, request, store, scene_name, given, wrong, found)


def _copies(request: Request, content: dict[str, Any], scene: Scene) -> dict[str, str]:
    """Return a study as texts to copy."""
    address = str(request.url_for("submit"))
    return {
        "toml": form.as_toml(content, scene.name),
        "curl": form.as_curl(content, address),
        "python": form.as_python(content, address.removesuffix("/studies")),
    }


def _form(
    request: Request,
    store: Store,
    name: str,
    given: dict[str, list[str]],
    wrong: dict[str, str],
    found: Examined | None,
    refused: Mapping[str, Any] | None = None,
) -> Response:
    """Return the page of the form; ``refused`` is a scene file that was posted, with mistakes."""
    scene = known_scene(store, name)
    content, early = form.study_of(name, scene, given)
    mistakes = {**early, **wrong}
    fields = form.entries(scene, given, mistakes)
    posted = [(each.id, f"{each.name} (posted)") for each in store.scenes(LISTED)]
    choose = given.get("choose", [""])[0]
    few = len(fields) <= _FEW
    own = {each.parameter.name for each in fields} | {"name"}
    tables = form.tables(given, mistakes)
    own |= {each.name for each in tables[choose][1]} if choose in tables else set()
    return page(
        request,
        "new",
        HTTPStatus.UNPROCESSABLE_ENTITY if wrong or refused else HTTPStatus.OK,
        scene=scene,
        scene_name=name,
        name=content["name"],
        scenes=[*((each.name, each.name) for each in known_scenes()), *posted],
        given={key: values[0] for key, values in given.items()},
        query_of=urlencode({**given, "scene": [name]}, doseq=True),
        first=[each for each in fields if few or each.first],
        rest=[each for each in fields if not (few or each.first)],
        tables=tables,
        wrong=mistakes,
        general=[text for key, text in mistakes.items() if key not in own],
        estimate=found.costs if found else {},
        refused=refused,
        **_copies(request, content, scene),
    )
