"""What routes may ask for; they see nothing else of the service."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Depends, Request

from service.errors import NotFound
from service.jobs import Job, Jobs
from service.keys import Scope
from service.runner import Runner
from service.schemas import ContentId
from service.settings import Settings
from studies import Store


def get_jobs(request: Request) -> Jobs:
    """Return the queue."""
    jobs: Jobs = request.app.state.jobs
    return jobs


def get_store(request: Request) -> Store:
    """Return the store of runs and studies."""
    store: Store = request.app.state.store
    return store


def get_runner(request: Request) -> Runner:
    """Return the consumer of the queue."""
    runner: Runner = request.app.state.runner
    return runner


def get_job(study_id: ContentId, jobs: Annotated[Jobs, Depends(get_jobs)]) -> Job:
    """Return the study named in the path."""
    return jobs.get(study_id)


def get_run(run_id: ContentId, store: Annotated[Store, Depends(get_store)]) -> dict[str, Any]:
    """Return the catalogue's row of the run named in the path."""
    row = store.catalogue.run(run_id)
    if row is None or not store.run_path(run_id).is_file():
        raise NotFound(f"no run has the id {run_id}")
    return row


def get_settings(request: Request) -> Settings:
    """Return the settings of this service."""
    settings: Settings = request.app.state.settings
    return settings


def get_caller(request: Request) -> Scope | None:
    """Return what the caller may do; None for a stranger, who may ask for little."""
    scope: Scope | None = request.state.caller
    return scope


TheCaller = Annotated[Scope | None, Depends(get_caller)]
TheJobs = Annotated[Jobs, Depends(get_jobs)]
TheJob = Annotated[Job, Depends(get_job)]
TheRun = Annotated[dict[str, Any], Depends(get_run)]
TheStore = Annotated[Store, Depends(get_store)]
TheRunner = Annotated[Runner, Depends(get_runner)]
TheSettings = Annotated[Settings, Depends(get_settings)]
