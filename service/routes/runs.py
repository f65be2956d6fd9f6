"""Runs: search, show, fetch, draw."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Query, Response
from fastapi.responses import FileResponse
from starlette.convertors import StringConvertor, register_url_convertor

from service.dependencies import (
    TheComputing,
    TheDrawing,
    TheKeeper,
    TheRun,
    TheStore,
    in_turn,
)
from service.errors import REFUSED
from service.files import NETCDF, netcdf
from service.maps import PICTURE
from service.schemas import LineQuery, MapQuery, Run, RunFilter, RunPage
from service.search import conditions
from solver.late import Late

VTU = "application/xml"

NODAL = Late("service.reading:nodal_fields")
MAP, LINES = Late("service.drawing:draw_map"), Late("service.drawing:draw_lines")

router = APIRouter(prefix="/runs", tags=["runs"])


class Stem(StringConvertor):
    """A name without a suffix, so that ``/runs/{id}`` does not match ``/runs/{id}.nc``."""

    regex = "[^/.]+"


register_url_convertor("stem", Stem())


@router.get("", responses=REFUSED)
@in_turn
def list_runs(which: Annotated[RunFilter, Query()], store: TheStore) -> RunPage:
    """List the runs that match, in order of creation, whichever study they belong to.

    Beside the queries named below, every parameter of the scenes is one: `?traction=0.75`.
    """
    rows, total = store.catalogue.runs(**conditions(which, store))
    return RunPage(total=total, items=[Run(**row) for row in rows])


@router.get("/{run_id}.nc", responses=NETCDF)
async def fetch_run(run: TheRun, store: TheStore) -> FileResponse:
    """Return the data set of a run."""
    return netcdf(store.run_path(run["id"]), f"{run['id']}.nc")


@router.get("/{run_id}.vtu", responses={200: {"content": {VTU: {}}}, **REFUSED})
async def fetch_mesh(
    run: TheRun, store: TheStore, computing: TheComputing, stage: str | None = None
) -> Response:
    """Return the fields at the nodes at a stage, the last one by default, as ParaView reads them.

    The study must say `"keep": "fields"`.
    """
    given = store.run_path(run["id"]), stage
    content = await computing.apart(NODAL, *given, field="stage", name=stage)
    named = {"content-disposition": f'attachment; filename="{run["id"]}.vtu"'}
    return Response(content, media_type=VTU, headers=named)


@router.get("/{run_id:stem}")
async def get_run(run: TheRun) -> Run:
    """Return the outcome and the figures of a run."""
    return Run(**run)


@router.delete("/{run_id:stem}", status_code=HTTPStatus.NO_CONTENT)
def delete_run(run: TheRun, keeper: TheKeeper) -> None:
    """Delete a run that no study waits for or computes; data sets that hold it stay."""
    keeper.delete_run(run["id"])


@router.get("/{run_id}/map.png", responses={**PICTURE, **REFUSED})
async def draw_map(
    run: TheRun, query: Annotated[MapQuery, Query()], store: TheStore, drawing: TheDrawing
) -> Response:
    """Draw a field of a run around the contact."""
    return await drawing.of_file(store.run_path(run["id"]), query, MAP)


@router.get("/{run_id}/line.png", responses={**PICTURE, **REFUSED})
async def draw_lines(
    run: TheRun, query: Annotated[LineQuery, Query()], store: TheStore, drawing: TheDrawing
) -> Response:
    """Draw a field of a run along lines, contacts, depths or increments.

    Beside the queries named below, every dimension of the field is one: `?stage=loaded&pass=2`.
    """
    return await drawing.of_file(store.run_path(run["id"]), query, LINES)
