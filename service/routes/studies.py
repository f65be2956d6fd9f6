"""Studies: submit, list, watch, stop, retry, fetch."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from dataclasses import replace
from http import HTTPStatus
from typing import Annotated, Any

from annotated_types import Interval
from fastapi import APIRouter, Body, Query, Request, Response
from fastapi.responses import FileResponse, PlainTextResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic import GetJsonSchemaHandler

from service import overview
from service.dependencies import (
    TheCombining,
    TheComputing,
    TheDatasets,
    TheDetails,
    TheDrawing,
    TheJob,
    TheJobs,
    TheKeeper,
    TheReading,
    TheRunner,
    TheSettings,
    TheStore,
    in_turn,
)
from service.errors import REFUSED, Busy, Conflict, NotFound, QueueLost
from service.examiner import examine
from service.files import NETCDF, OCTETS, UNCHANGED, netcdf, tagged, unchanged
from service.maps import PICTURE
from service.middleware import StrictRoute
from service.schemas import (
    ContentId,
    PlotQuery,
    Prediction,
    PredictQuery,
    StudyDetail,
    StudyFilter,
    StudyPage,
    StudySummary,
    Window,
)
from solver.late import Late
from studies.definition.schema import StudyTable, Whole, parsed
from studies.definition.study import Study
from studies.errors import StoreFull, StudyError
from studies.execution.estimate import Estimate
from studies.storage.seal import digest
from studies.storage.tiles import METADATA

log = logging.getLogger(__name__)

router = APIRouter(prefix="/studies", tags=["studies"], route_class=StrictRoute)
costs = APIRouter(tags=["studies"], route_class=StrictRoute)

EXAMPLE: dict[str, Any] = {
    "name": "two-frictions",
    "scene": "punch",
    "parameters": {"smallest_element": 0.02, "growth": 2.0, "hardening": "isotropic"},
    "sweep": {"load_ratio": [0.5714, 0.8571], "friction": [0.0, 0.3]},
}

PREDICTED, INDICES = Late("service.analysing:predicted"), Late("service.analysing:indices")
FITTED, DRAWN = Late("service.reading:fitted"), Late("service.drawing:draw_study")


class Priority(StudyTable):
    """What of a submission is no part of what the study is.

    Attributes
    ----------
    priority : of two studies that wait, that of the greater number comes first
    """

    priority: Annotated[Whole, Interval(ge=-100, le=100)] = 0


class Submission(Priority, Study):
    """A study, and its priority."""

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> Any:
        """Add an example."""
        found = super().__get_pydantic_json_schema__(core, handler)
        handler.resolve_ref_schema(found)["examples"] = [EXAMPLE]
        return found


class _Described:
    """Describes a body that is checked in another process as a `Submission`."""

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> Any:
        written = Submission.__pydantic_core_schema__
        return Submission.__get_pydantic_json_schema__(written, handler)


Content = Annotated[dict[str, Any], Body(), _Described()]
"""The body of a submission."""


def taken_priority(content: dict[str, Any]) -> int:
    """Take the priority out of a submission and return it."""
    return parsed(Priority, {"priority": content.pop("priority", 0)}).priority


@router.post(
    "", status_code=HTTPStatus.CREATED, responses={200: {"model": StudySummary}, **REFUSED}
)
async def submit(
    content: Content,
    keeper: TheKeeper,
    settings: TheSettings,
    computing: TheComputing,
    request: Request,
    response: Response,
) -> StudySummary:
    """Accept a study; 200 when it is known already, whatever became of it."""
    priority = taken_priority(content)
    found = await examine(content, settings, computing)
    job, new = await asyncio.to_thread(keeper.accept, found, priority)
    if not new:
        response.status_code = HTTPStatus.OK
    response.headers["location"] = request.url_for("get_study", study_id=job.id).path
    return overview.summary(job)


@router.get("")
@in_turn
def list_studies(which: Annotated[StudyFilter, Query()], jobs: TheJobs) -> StudyPage:
    """List studies, the latest first."""
    page, total = jobs.page(
        limit=which.limit, offset=which.offset, state=which.status, tag=which.tag,
        scene=which.scene, text=which.text, name=which.name,
    )  # fmt: skip
    return StudyPage(total=total, items=[overview.summary(job) for job in page])


@router.get("/{study_id}", response_model=StudyDetail)
async def get_study(
    study_id: ContentId,
    window: Annotated[Window, Query()],
    details: TheDetails,
    reading: TheReading,
) -> Response:
    """Return where a study stands, and a page of its runs in the order of the sweep."""
    return Response(await details.get(study_id, window, reading), media_type="application/json")


@router.delete(
    "/{study_id}", response_model=StudySummary, responses={204: {"description": "Purged"}}
)
def dismiss(
    study_id: ContentId, jobs: TheJobs, keeper: TheKeeper, purge: bool = False
) -> StudySummary | Response:
    """Stop the work on a study: it stays, as `dismissed`, and so do the runs it has finished.

    With `purge`, delete a study that has ended, its data set, and its runs that no other needs.
    """
    if not purge:
        return overview.summary(jobs.dismiss(study_id))
    keeper.purge(study_id)
    return Response(status_code=HTTPStatus.NO_CONTENT)


@router.post("/{study_id}/retry", status_code=HTTPStatus.ACCEPTED)
def retry(study_id: ContentId, jobs: TheJobs) -> StudySummary:
    """Compute the failed and the missing runs of a study again."""
    return overview.summary(jobs.retry(study_id))


@router.get("/{study_id}/events", response_class=EventSourceResponse)
async def events(
    job: TheJob, jobs: TheJobs, runner: TheRunner, settings: TheSettings, request: Request
) -> AsyncIterator[ServerSentEvent]:
    """Send where a study stands at every change, until its end or that of the caller's key."""
    shown: StudySummary | None = None
    state = request.app.state

    def open_still() -> bool:
        return not state.closing if state.only_shows else runner.alive

    while open_still() and await request.state.admitted():
        now = shown
        try:
            now = overview.summary(await asyncio.to_thread(jobs.get, job.id))
        except NotFound:  # deleted
            return
        except (QueueLost, StoreFull, OSError):  # it is found again later
            log.warning("events are held up: the queue cannot be read", extra={"study": job.id})
        if now and now != shown:
            yield ServerSentEvent(event="study", data=now.model_dump(mode="json"))
            shown = now
        if now and now.status.final:
            return
        await asyncio.sleep(settings.poll_seconds)


@router.get("/{study_id}/log", response_class=PlainTextResponse)
@in_turn
def tell_log(job: TheJob, jobs: TheJobs, store: TheStore) -> str:
    """Return a line for each thing that happened: states, what was waited for, ends of runs."""
    return overview.log_of(job, jobs, store)


@router.get("/{study_id}/predict", responses=REFUSED)
async def predict(
    job: TheJob,
    query: Annotated[PredictQuery, Query()],
    jobs: TheJobs,
    store: TheStore,
    datasets: TheDatasets,
    reading: TheReading,
    computing: TheComputing,
) -> Prediction:
    """Predict a number between the runs of a study, with its error.

    Beside the queries named below, every parameter that the study varies is one:
    `?of=peak_residual_tension&load_ratio=0.62&friction=0.21`. A place outside of the runs, or
    across failed ones, is refused.
    """
    path = await reading.here(datasets.ended, job)
    content = await reading.here(jobs.study, job.id)
    given = path, content, store.directory, store.aside, query
    return await computing.apart(PREDICTED, *given, field="of", name=query.of)


@router.get("/{study_id}/sensitivity", responses=REFUSED)
async def tell_sensitivity(
    job: TheJob, datasets: TheDatasets, reading: TheReading, computing: TheComputing, of: str
) -> dict[str, Any]:
    """Rank parameters by their effect on a number of the runs: indices of sensitivity.

    Of `parameters` each has `first` and `total`, the share of the variance of `of` that it makes
    alone, and with others, and how well they are known. A sample that does not bear it is refused
    with the reason.
    """
    path = await reading.here(datasets.ended, job)
    return await computing.apart(INDICES, path, of, field="of", name=of)


@router.get("/{study_id}/plot.png", responses={**PICTURE, **REFUSED})
async def draw_study(
    job: TheJob,
    query: Annotated[PlotQuery, Query()],
    datasets: TheDatasets,
    drawing: TheDrawing,
) -> Response:
    """Draw a number of the runs over what is swept, or a map or lines of one run.

    Beside the queries named below, every axis of the sweep and dimension of the field is one:
    `?field=contact_pressure&over=friction&load_ratio=0.5&stage=loaded`.
    """
    found = await drawing.reading.here(datasets.ended, job)
    return await drawing.of_file(found, query, DRAWN)


@router.get("/{study_id}/fit", responses=REFUSED)
async def tell_fit(
    job: TheJob, jobs: TheJobs, datasets: TheDatasets, reading: TheReading
) -> dict[str, Any]:
    """Tell what a fit has found: of `parameters` each has its `value`, `sigma` and bounds.

    `message` warns, such as of parameters that cannot be told apart. The lines over which it was
    fitted are in the data set.
    """
    if not (await reading.here(jobs.study, job.id)).get("fit"):
        raise StudyError("fit", job.name, "is a study without a fit: submit one with an entry fit")
    return await reading.read(FITTED, await reading.here(datasets.ended, job))


@router.get("/{study_id}/dataset.nc", responses=NETCDF)
async def dataset(
    job: TheJob, datasets: TheDatasets, reading: TheReading, combining: TheCombining
) -> FileResponse:
    """Return the combined data set of a study, as its last end left it.

    Before the first end it has the runs that are there; those to come are NaN, and `missing`.
    """
    return netcdf(await datasets.current(job, reading, combining), f"{job.name}.nc")


@router.get("/{study_id}/zarr/{key:path}", responses={200: {"content": {OCTETS: {}}}, **UNCHANGED})
async def tile(
    job: TheJob,
    datasets: TheDatasets,
    reading: TheReading,
    combining: TheCombining,
    request: Request,
    key: str,
) -> Response:
    """Return a part of the data set as a Zarr store has it (version 3, consolidated metadata).

    `xarray.open_zarr("http://…/studies/{study_id}/zarr")` opens it and reads the parts it needs. A
    run that is missing has no chunks: readers take its values as NaN. The service has checked the
    seal of the data set; the parts themselves have none. A key whose time is used waits for them.
    """
    reading, combining = (replace(each, patient=True) for each in (reading, combining))
    try:
        tiles = await datasets.tiles(job, reading, combining)
        headers = tagged((await reading.here(digest, tiles.path), key))
        if known := unchanged(request, headers):
            return known
        try:
            content = await reading.here(tiles.content, key)
        except LookupError as error:
            raise Conflict(str(error)) from None
    except FileNotFoundError:
        gone = "the data set was made again, or deleted, while this request waited: ask again"
        raise Busy(gone) from None
    if content is None:
        raise NotFound("nothing is stored under this key")
    kind = "application/json" if key.endswith(METADATA) else OCTETS
    return Response(content, media_type=kind, headers=dict(headers))


@costs.post("/estimate", responses=REFUSED)
async def estimate(
    content: Content,
    settings: TheSettings,
    computing: TheComputing,
    keeper: TheKeeper,
) -> Estimate:
    """Tell what a study asks for beyond the runs that are there; nothing is stored.

    `cpu_seconds` are low, likely and high. A study that asks for more than the service allows is
    refused as it is when it is submitted.
    """
    taken_priority(content)
    found = await examine(content, settings, computing)
    await asyncio.to_thread(keeper.check_room, found)
    return found.estimate
