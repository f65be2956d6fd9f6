"""The dependencies of routes, which are all that they use of the service."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from functools import partial, wraps
from inspect import Parameter, signature
from typing import Annotated, Any, TypeVar

from fastapi import Depends, Request

from service.datasets import Datasets
from service.errors import NotFound
from service.examiner import Inspector
from service.job import Job
from service.jobs import Jobs
from service.keys import Keys, Scope
from service.maps import Drawing, Pictures
from service.metrics import Metrics, Probe
from service.overview import Details, Tables
from service.retention import Keeper
from service.runner import Runner
from service.schemas import ContentId
from service.settings import Settings
from service.turns import Share
from studies.storage.store import Store

Found = TypeVar("Found")


def held(name: str) -> Any:
    """Return a dependency on an object that the application stores under a name.

    It is a coroutine, because the framework runs plain functions in its thread pool, where they
    would wait behind slow ones.
    """

    async def get(request: Request) -> Any:
        return getattr(request.app.state, name)

    return Depends(get)


TheDatasets = Annotated[Datasets, held("datasets")]
TheDetails = Annotated[Details, held("details")]
TheInspector = Annotated[Inspector, held("inspector")]
TheJobs = Annotated[Jobs, held("jobs")]
TheKeeper = Annotated[Keeper, held("keeper")]
TheKeys = Annotated[Keys, held("keys")]
TheMetrics = Annotated[Metrics, held("metrics")]
TheProbe = Annotated[Probe, held("probe")]
TheRunner = Annotated[Runner, held("runner")]
TheSettings = Annotated[Settings, held("settings")]
TheStore = Annotated[Store, held("store")]
TheTables = Annotated[Tables, held("tables")]


def get_job(study_id: ContentId, jobs: TheJobs) -> Job:
    """Return the study named in the path: a row of the queue, so that it needs no turn."""
    return jobs.get(study_id)


async def get_caller(request: Request) -> Scope | None:
    """Return the caller's scope; None without a key."""
    scope: Scope | None = request.state.caller
    return scope


def share(name: str) -> Any:
    """Return a dependency on what the caller has of the turns of this name."""

    async def get(request: Request) -> Share:
        return Share(getattr(request.app.state, name), request.state.name)

    return Depends(get)


TheReading = Annotated[Share, share("reading")]
TheComputing = Annotated[Share, share("computing")]
TheCombining = Annotated[Share, share("combining")]


async def get_drawing(
    pictures: Annotated[Pictures, held("pictures")],
    request: Request,
    reading: TheReading,
    computing: TheComputing,
) -> Drawing:
    """Return what draws the pictures of a request."""
    return Drawing(pictures, request, reading, computing)


TheDrawing = Annotated[Drawing, Depends(get_drawing)]


def in_turn(function: Callable[..., Found]) -> Callable[..., Coroutine[Any, Any, Found]]:
    """Return a route that calls a plain function in the caller's turn to read."""

    @wraps(function)
    async def route(*, its_turn: Share, **given: Any) -> Found:
        return await its_turn.here(partial(function, **given))

    known = signature(function, eval_str=True)
    own = Parameter("its_turn", Parameter.KEYWORD_ONLY, annotation=TheReading)
    route.__signature__ = known.replace(  # type: ignore[attr-defined]
        parameters=[*known.parameters.values(), own]
    )
    return route


async def get_run(run_id: ContentId, store: TheStore, reading: TheReading) -> dict[str, Any]:
    """Return the catalogue's row of the run in the path, whose file has been verified."""
    row = await reading.here(store.run, run_id)
    if row is None:
        raise NotFound(f"no run has the id {run_id}")
    return row


TheCaller = Annotated[Scope | None, Depends(get_caller)]
TheJob = Annotated[Job, Depends(get_job)]
TheRun = Annotated[dict[str, Any], Depends(get_run)]
