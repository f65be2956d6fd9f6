"""The pages: studies, a study, a run, runs compared, health; signing in and out.

That of a new study is in `service.pages.new`.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Form, Query, Request, Response
from fastapi.responses import RedirectResponse

from service import overview
from service.dependencies import (
    TheDatasets,
    TheDetails,
    TheJobs,
    TheKeys,
    TheReading,
    TheRun,
    TheStore,
    TheTables,
    in_turn,
)
from service.errors import Busy, NotFound
from service.job import Job, StudyState
from service.jobs import Jobs
from service.pages import shown
from service.pages.assets import asset
from service.pages.rendering import COOKIE, ROOT, PageRoute, page, to_study
from service.routes.itself import health
from service.routes.numbers import OUTLINED
from service.scenes import scene_name, scene_of
from service.schemas import ContentId, Health, StudyFilter, Window
from solver.scenes import Scene
from studies.definition.identity import is_id
from studies.errors import StudyError
from studies.kinds import kind_of
from studies.scenes.registry import known_names
from studies.storage.store import Store
from studies.views.elasticities import elasticities
from studies.views.table import MESSAGE, RUN, STATUS, RunTable, varied

router = APIRouter(prefix=ROOT, include_in_schema=False, route_class=PageRoute)
home = APIRouter(include_in_schema=False)

FOR_GOOD = {"cache-control": "public, max-age=31536000, immutable", "vary": "accept-encoding"}
LISTED = 25
"""Number of studies on a page."""
POLLED = ("accepted", "running")


@home.get("/")
async def lead(request: Request) -> Response:
    """Lead to the pages."""
    return RedirectResponse(request.url_for("studies_page").path, HTTPStatus.SEE_OTHER)


@router.get("/static/{version}/{name}")
async def get_asset(version: str, name: str, request: Request) -> Response:
    """Return a static file."""
    found = asset(version, name)
    if found is None:
        raise NotFound("no such file")
    if "gzip" in request.headers.get("accept-encoding", ""):
        packed = FOR_GOOD | {"content-encoding": "gzip"}
        return Response(found.packed, media_type=found.media_type, headers=packed)
    return Response(gzip.decompress(found.packed), media_type=found.media_type, headers=FOR_GOOD)


@router.get("")
@in_turn
def studies_page(
    request: Request,
    jobs: TheJobs,
    store: TheStore,
    status: str = "",
    tag: str = "",
    scene: str = "",
    text: str = "",
    page_number: Annotated[int, Query(alias="page", ge=1, le=2**40)] = 1,
) -> Response:
    """Show the studies, the latest first."""
    given = {"status": status, "tag": tag, "scene": scene, "text": text.strip()}
    which = {name: value for name, value in given.items() if value}
    if status:
        known = [*StudyState]
        if status not in known:
            raise StudyError("status", status, f"must be one of {', '.join(known)}")
    window = StudyFilter(limit=LISTED, offset=(page_number - 1) * LISTED)
    wanted = {"state" if name == "status" else name: value for name, value in which.items()}
    found, total = jobs.page(limit=window.limit, offset=window.offset, **wanted)
    items = [(overview.summary(job), _said(jobs, job)) for job in found]
    scenes = {each.scene: scene_name(store, each.scene) for each, _ in items}
    return page(
        request,
        "studies",
        scenes=scenes,
        items=items,
        sizes={job.id: _size(jobs, job) for job in found},
        total=total,
        which=which,
        states=[*StudyState],
        number=page_number,
        pages=max(1, -(-total // LISTED)),
        live=any(each.status in POLLED for each, _ in items),
        turn=lambda **other: "?" + urlencode({**which, **other}),
    )


def _size(jobs: Jobs, job: Job) -> str:
    """Return the number of runs of a job as text: those asked for, if it has chosen them."""
    if not job.stage:
        return str(job.size)
    return str(len(jobs.runs(job.id))) if job.state.final else f"at most {job.size}"


def _said(jobs: Jobs, job: Job) -> Mapping[str, Any]:
    """Return the study of a job; nothing if it has just been deleted."""
    with suppress(NotFound):
        return jobs.study(job.id)
    return {}


@router.get("/studies/{study_id}")
async def study_page(
    study_id: ContentId,
    request: Request,
    details: TheDetails,
    tables: TheTables,
    datasets: TheDatasets,
    reading: TheReading,
) -> Response:
    """Show a study: what it found, numbers over its sweep, one of its runs, a part of its table."""
    study = json.loads(await details.get(study_id, Window(limit=1), reading))
    found = None
    if kind_of(study).chooses:
        with suppress(Busy, NotFound):  # it is there at the end
            job = await reading.here(tables.jobs.get, study_id)
            found = await datasets.found(job, reading)
    table = await tables.get(study_id, reading)
    return await reading.here(_study, request, study, tables.store, table, found)


def _study(
    request: Request,
    study: Mapping[str, Any],
    store: Store,
    table: RunTable,
    found: Any,
) -> Response:
    scene = scene_of(store, study["scene"])
    query = dict(request.query_params)
    kind = kind_of(study)
    entry = study.get(kind.name, {})
    numbers = [each.name for each in shown.usual(table)]
    number = query.get("number", "")
    if number not in numbers:
        asked = entry.get("of", "")
        number = asked if asked in numbers else next(iter(numbers), "")
    marks = found.marks if found else ()
    at = shown.chosen_run(table, query.get("run", ""), number, marks)

    def turn(**other: Any) -> str:
        kept = {k: v for k, v in {**query, **other}.items() if v not in ("", None)}
        return "?" + urlencode(kept)

    part, floors = shown.part(table, query), shown.floors_of(table)
    run = None
    if at is not None:
        run = {
            "id": table.columns[RUN].values[at],
            "status": table.columns[STATUS].values[at],
            "message": table.columns[MESSAGE].values[at],
            "at": [(each, shown.cell_text(each, at, floors)) for each in varied(table)],
        }
    csv = urlencode({**part.where, **({"sort": part.sort} if part.sort else {})})
    return page(
        request,
        "study",
        study=study,
        scene_name=scene.name if scene else study["scene"],
        table=table,
        part=part,
        cell=partial(shown.cell_text, floors=floors),
        number=number,
        chosen=run,
        turn=turn,
        csv=f"?{csv}" if csv else "",
        live=study["status"] in POLLED,
        found=found,
        chooses=kind.chooses,
        data={
            "id": study["id"],
            "sought": next(iter(kind.searched(entry)), ""),
            "found": found.marks if found else [],
            "live": study["status"] in POLLED,
            "number": number,
            "run": run["id"] if run else None,
            "at": at,
            **shown.described(table),
        },
    )


@router.get("/runs/{run_id}")
async def run_page(run: TheRun, request: Request, store: TheStore, reading: TheReading) -> Response:
    """Show a run: its maps and lines, its numbers, its audit."""
    drawn = await reading.read(OUTLINED, store.run_path(run["id"]))
    return await reading.here(_run, request, run, store, drawn)


def _run(
    request: Request, run: Mapping[str, Any], store: Store, drawn: Mapping[str, Any]
) -> Response:
    scene = _scene_of_run(store, run["scene"])
    numbers = shown.numbers_of([run], scene)
    return page(
        request,
        "run",
        run=run,
        parameters=shown.parameters_shown(run, scene),
        audit=shown.audited(numbers),
        numbers=shown.numbers_shown(numbers),
        elasticities=elasticities(run["scalars"], run["parameters"]),
        drawn=drawn,
        data={"run": run["id"], "fields": drawn},
    )


def _scene_of_run(store: Store, name: str) -> Scene | None:
    """Return the scene of a run, which has the name of its scene, not the id of a posted one."""
    if name in known_names():
        return scene_of(store, name)
    posted = store.scenes(limit=2, name=name)
    return scene_of(store, posted[0].id) if len(posted) == 1 else None


@router.get("/compare")
@in_turn
def compare_page(
    request: Request, store: TheStore, run: Annotated[list[str] | None, Query()] = None
) -> Response:
    """Show what differs between runs."""
    ids = list(dict.fromkeys(run or []))
    if len(ids) > shown.MOST:
        raise StudyError("run", f"{len(ids)} runs", f"at most {shown.MOST} runs are compared")
    rows = []
    for each in ids:
        row = store.run(each) if is_id(each) else None
        if row is None:
            raise NotFound(f"no run has the id {each[:40]}")
        rows.append(row)
    scene = _scene_of_run(store, rows[0]["scene"]) if rows else None
    found = shown.compared(rows, scene)
    return page(request, "compare", rows=rows, found=found, data={"runs": ids})


@router.get("/health")
async def health_page(
    request: Request,
    jobs: TheJobs,
    store: TheStore,
    reading: TheReading,
    state: Annotated[Health, Depends(health)],
) -> Response:
    """Show the queue and whether the service can do its work."""
    return await reading.here(_health, request, jobs, store, state)


def _health(request: Request, jobs: Jobs, store: Store, state: Health) -> Response:
    queue = []
    for wanted in (StudyState.RUNNING, StudyState.ACCEPTED):
        found, _ = jobs.page(limit=50, offset=0, state=wanted)
        queue += [overview.summary(job) for job in found]
    states, runs = jobs.states(), store.catalogue.counts()
    return page(request, "health", health=state, states=states, runs=runs, queue=queue)


@router.get("/sign-in")
async def sign_in(request: Request, then: str = "") -> Response:
    """Show the form for a key."""
    return page(request, "sign-in", then=inside(request, then), refused=False)


@router.post("/sign-in")
async def enter(
    request: Request,
    keys: TheKeys,
    key: Annotated[str, Form(max_length=200)] = "",
    then: Annotated[str, Form(max_length=4000)] = "",
) -> Response:
    """Keep a key in a cookie that scripts cannot read."""
    where = inside(request, then)
    if await keys.known(key.strip()) is None:
        status = HTTPStatus.UNAUTHORIZED
        return page(request, "sign-in", status, then=where, refused=True)
    answer = RedirectResponse(where, HTTPStatus.SEE_OTHER)
    root = request.scope.get("root_path", "") or "/"
    secure = request.url.scheme == "https"
    answer.set_cookie(
        COOKIE, key.strip(), httponly=True, samesite="strict", secure=secure, path=root
    )
    return answer


@router.post("/sign-out")
def leave(request: Request) -> Response:
    """Forget the key."""
    answer = RedirectResponse(request.url_for("sign_in").path, HTTPStatus.SEE_OTHER)
    answer.delete_cookie(COOKIE, path=request.scope.get("root_path", "") or "/")
    return answer


def inside(request: Request, then: str) -> str:
    """Return a path of the pages, and the first page for any other address."""
    first = request.url_for("studies_page").path
    plain = then.isascii() and then.isprintable() and "\\" not in then and "//" not in then
    return then if plain and then.startswith((f"{first}/", f"{first}?")) else first


@router.post("/studies/{study_id}/stop")
def stop(study_id: ContentId, request: Request, jobs: TheJobs) -> Response:
    """Stop a study, and show it."""
    jobs.dismiss(study_id)
    return to_study(request, study_id)


@router.post("/studies/{study_id}/retry")
def again(study_id: ContentId, request: Request, jobs: TheJobs) -> Response:
    """Compute the failed and missing runs of a study, and show it."""
    jobs.retry(study_id)
    return to_study(request, study_id)


@router.get("/{rest:path}")
async def nothing(rest: str, request: Request) -> Response:
    """Say that there is no such page."""
    if not rest:
        return await lead(request)
    raise NotFound(f"there is no page {ROOT}/{rest[:100]}")
