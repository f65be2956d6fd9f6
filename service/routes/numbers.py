"""Numbers of the runs of a study, at any time; values of the maps and lines of a run."""

from __future__ import annotations

from http import HTTPStatus
from importlib.util import find_spec
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import StreamingResponse

import solver
from service.dependencies import TheReading, TheRun, TheStore, TheTables
from service.errors import CONTENT, REFUSED
from service.files import OCTETS, UNCHANGED, octets, tagged, unchanged
from service.overview import OUTCOMES
from service.schemas import ID, AuditFigure, ContentId, NumbersFilter, TableFilter
from solver.late import Late
from studies.errors import StudyError
from studies.storage.seal import digest
from studies.views.figures import Worst, worst
from studies.views.table import RUN, STATUS, RunTable, varied
from studies.views.written import FORMS

router = APIRouter()

MISSING = "table.parquet needs pyarrow on the service: pip install residua-contact[parquet]"

OUTLINED, VALUES = Late("service.reading:outlined"), Late("service.reading:values")

ARRAYS: dict[int | str, dict[str, Any]] = {
    200: {"content": {OCTETS: {}}, "description": "A line of JSON, then the numbers"},
}


@router.get(
    "/studies/{study_id}/table.csv",
    tags=["studies"],
    responses={200: {"content": {FORMS["csv"].media_type: {}}}, **REFUSED},
)
@router.get(
    "/studies/{study_id}/table.json", name="table_of_objects", tags=["studies"], responses=REFUSED
)
@router.get(
    "/studies/{study_id}/table.parquet",
    name="table_of_columns",
    tags=["studies"],
    responses={
        200: {"content": {FORMS["parquet"].media_type: {}}},
        406: {"description": MISSING, "content": CONTENT},
        **REFUSED,
    },
)
async def table(
    study_id: ContentId,
    which: Annotated[TableFilter, Query()],
    tables: TheTables,
    reading: TheReading,
    request: Request,
) -> Response:
    """Return a line for each run: its place in the sweep, its status, its numbers.

    Beside the queries named below, every column is one: `?friction=0.1..0.4&hardening=none`. In CSV
    a text that a spreadsheet would take for a formula has an apostrophe before it. JSON has an
    object for each run in `rows`; `columns` states meaning and unit. Parquet needs pyarrow.
    """
    ending = request.scope["path"].rpartition(".")[2]
    if ending == "parquet" and find_spec("pyarrow") is None:
        raise HTTPException(HTTPStatus.NOT_ACCEPTABLE, MISSING)
    found = await tables.get(study_id, reading)
    at = await reading.here(found.chosen, which.sort, which.selection)
    names = dict.fromkeys(which.columns.split(",") if which.columns else found.columns)
    form, columns = FORMS[ending], [found.column(name) for name in names]
    named = {"content-disposition": f'attachment; filename="table.{ending}"'}
    pieces = reading.each(form.write(columns, at))
    return StreamingResponse(pieces, media_type=form.media_type, headers=named)


@router.get("/studies/{study_id}/numbers", tags=["studies"], responses={**ARRAYS, **REFUSED})
async def numbers(
    study_id: ContentId,
    which: Annotated[NumbersFilter, Query()],
    tables: TheTables,
    reading: TheReading,
) -> Response:
    """Return columns of the table as octets, in the order of the sweep; NaN is no value.

    The first line is JSON: `arrays` lists name, type and shape of the arrays that follow, in which
    numbers are little endian. A text is a number, whose word is in `words`. Beside `name`, every
    column is a query, as of the table; `at` has the positions of the runs that meet them.
    """
    found = await tables.get(study_id, reading)
    content = await reading.here(_numbers, found, which)
    return Response(content, media_type=OCTETS)


def _numbers(found: RunTable, which: NumbersFilter) -> bytes:
    """Return the answer of `numbers`."""
    at = found.chosen("", which.selection)
    arrays, words = {"at": at}, {}
    for each in dict.fromkeys(which.name):
        column = found.column(each, "name")
        if column.number:
            arrays[each] = column.values[at]
        elif column.group == "sweep" or each == STATUS:
            known = OUTCOMES if each == STATUS else dict.fromkeys(column.values.tolist())
            words[each] = [*known]
            number = {word: code for code, word in enumerate(words[each])}
            arrays[each] = np.array([number[word] for word in column.values[at]])
        else:
            raise StudyError("name", each, "must be a column of numbers, of the sweep, or status")
    return octets({"words": words}, arrays)


@router.get("/studies/{study_id}/audit", tags=["studies"])
async def get_audit(
    study_id: ContentId, tables: TheTables, reading: TheReading
) -> list[AuditFigure]:
    """Return the largest value of each figure of the audit, the nearest to its limit first.

    Figures whose limit depends on the run are left out.
    """
    return await reading.here(_audit, await tables.get(study_id, reading))


def _audit(table: RunTable) -> list[AuditFigure]:
    """Return the answer of `get_audit`."""
    found = worst({each.name: each.values for each in table.numbers})
    runs = table.columns[RUN].values
    places = {each.name: each.values for each in varied(table)}

    def figure(each: Worst) -> AuditFigure:
        words, run = table.columns[each.name].words, runs[each.at]
        at = {name: values[each.at] for name, values in places.items()}
        return AuditFigure(
            name=each.name, words=words, value=each.value, limit=each.limit, run=run, at=at
        )

    return [*map(figure, found)]


@router.get("/runs/{run_id}/fields", tags=["runs"])
async def fields(
    run: TheRun, store: TheStore, reading: TheReading
) -> dict[str, list[dict[str, Any]]]:
    """Return the variables of a run that are drawn: `maps` and `lines`, with their labels."""
    return await reading.read(OUTLINED, store.run_path(run["id"]))


@router.get(
    "/runs/{run_id}/values.csv",
    name="values_of_points",
    tags=["runs"],
    responses={200: {"content": {FORMS["csv"].media_type: {}}}, **UNCHANGED, **REFUSED},
)
@router.get("/runs/{run_id}/values", tags=["runs"], responses={**ARRAYS, **UNCHANGED, **REFUSED})
async def values(
    run: TheRun,
    store: TheStore,
    reading: TheReading,
    request: Request,
    field: str,
    component: str | None = None,
    stage: str | None = None,
    minus: Annotated[str | None, Query(pattern=ID)] = None,
) -> Response:
    """Return a map, or lines, of a run as octets: the coordinates, then the values over them.

    In CSV there is a line for each value: its coordinates, then the value. With `minus`, the map of
    another run is subtracted at the points of this one.
    """
    if minus and await reading.here(store.run, minus) is None:
        raise StudyError("minus", minus, "must be the id of a run")
    files = [store.run_path(each) for each in (run["id"], minus) if each]
    digests = await reading.here(lambda: [*map(digest, files)])
    table = request.scope["path"].endswith(".csv")
    headers = tagged((solver.__version__, digests, field, component, stage, table))
    if known := unchanged(request, headers):
        return known
    found = await reading.read(VALUES, files, field, component, stage, table)
    if not table:
        return Response(found, media_type=OCTETS, headers=dict(headers))
    named = {"content-disposition": f'attachment; filename="{field}.csv"'}
    return Response(found, media_type=FORMS["csv"].media_type, headers={**headers, **named})
