"""Runs: search, look at, fetch, see."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import FileResponse

from service import maps
from service.dependencies import TheKeeper, TheRun, TheStore
from service.files import NETCDF, netcdf
from service.schemas import MapQuery, Run, RunFilter, RunPage
from service.search import conditions

router = APIRouter(prefix="/runs", tags=["runs"])


@router.get("")
def list_runs(which: Annotated[RunFilter, Query()], store: TheStore) -> RunPage:
    """List the runs that match, in order of creation, whichever study asked for them.

    Beside the queries named below, every parameter of the scenes is one: `?traction=0.75`.
    """
    rows, total = store.catalogue.runs(**conditions(which))
    return RunPage(total=total, items=[Run(**row) for row in rows])


@router.head("/{run_id}.nc", include_in_schema=False)
@router.get("/{run_id}.nc", responses=NETCDF)
def fetch_run(run: TheRun, store: TheStore) -> FileResponse:
    """Return the data set of a run."""
    return netcdf(store.run_path(run["id"]), f"{run['id']}.nc")


@router.get("/{run_id}")
def get_run(run: TheRun) -> Run:
    """Return the outcome and the figures of a run."""
    return Run(**run)


@router.delete("/{run_id}", status_code=HTTPStatus.NO_CONTENT)
def delete_run(run: TheRun, keeper: TheKeeper) -> None:
    """Delete a run that no study waits for or computes; data sets that hold it stay."""
    keeper.delete_run(run["id"])


@router.get("/{run_id}/map.png", responses={200: {"content": {"image/png": {}}}})
def draw_map(
    run: TheRun, query: Annotated[MapQuery, Query()], store: TheStore, request: Request
) -> Response:
    """Draw a field of a run around the contact."""
    tag = maps.tag(store.run_path(run["id"]), query)
    headers = {"etag": tag, "cache-control": "no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    picture = maps.draw(store.run_path(run["id"]), query)
    return Response(picture, media_type="image/png", headers=headers)
