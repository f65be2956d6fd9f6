"""The report that `residua run` writes beside a data set: the table of runs and a picture of one.

Both are kept until the data set changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from solver.files import read_file
from studies.definition.study import Study
from studies.definition.vocabulary import OK
from studies.errors import StudyError
from studies.execution.run import StudyOutcome
from studies.kinds.kind import Kind
from studies.storage.made import Made
from studies.storage.store import Store

if TYPE_CHECKING:
    import xarray as xr

SHOWN = 100
"""Largest number of runs that a report lists; `residua show` prints all."""

_NAME = "report"
_TEXT = "report.txt"


@dataclass(frozen=True, slots=True)
class Report:
    """The result of a study as text and files.

    Attributes
    ----------
    text : the runs and their messages; the last line counts them
    files : the file of the text, and of the picture if a run succeeded
    anew : whether they were written now; false if they were kept
    """

    text: str
    files: list[Path]
    anew: bool


def prepare() -> None:
    """Import the modules that a report needs; it takes a second while workers compute."""
    import xarray as xr

    import studies.storage.combine
    import studies.views.plots.maps
    import studies.views.tables  # noqa: F401

    xr.DataArray(0.0)  # the first array makes xarray import more


def report(study: Study, store: Store, outcome: StudyOutcome) -> Report:
    """Return the report of a finished study, written again if its data set has changed."""
    made = Made(study, store)
    of = made.digest(outcome.dataset.name)
    if files := made.kept(_NAME, of):
        return Report(read_file(files[0]).decode(), files, anew=False)
    from studies.views.reading import open_study  # with tables and pictures it takes a second

    with open_study(outcome.dataset) as dataset:
        text = _text(study, outcome, dataset)
        kept = outcome.dataset if study.keep else None
        drawn = _found(study.kind, dataset) if study.kind.chooses else _drawn(dataset, kept)
        files = made.write(_NAME, of, {_TEXT: text.encode(), **drawn})
    return Report(text, files, anew=True)


def _text(study: Study, outcome: StudyOutcome, dataset: xr.Dataset) -> str:
    from studies.views.tables import messages, runs_table

    size, kind = dataset["status"].size, study.kind
    if kind.table:
        table = kind.table(dataset) + "\n"
    else:
        table = runs_table(dataset) + "\n" if size <= SHOWN else ""
    counts = ", ".join(f"{number} {status}" for status, number in outcome.counts.items())
    ended = f"{study.name}: {size} {kind.rows} ({counts}{_warned(dataset)})"
    note = f"\nnote: {study.note}\n" if study.note else ""
    return f"{table}{messages(dataset)}{note}\n{ended}\n"


def _warned(dataset: xr.Dataset) -> str:
    """Return a text with the number of runs that succeeded with a warning; empty if none did."""
    warned = (dataset["status"] == OK) & (dataset["message"] != "")
    return f"; {int(warned.sum())} with a warning" if warned.any() else ""


def _drawn(dataset: xr.Dataset, path: Path | None) -> dict[str, bytes]:
    """Draw the residual stress of the run of `one_run`, or the stress if bodies are not unloaded.

    Nothing is drawn if no run succeeded. With the path of the data set it is drawn on the mesh of
    the run, which its own file has.
    """
    from studies.views.picking import one_run
    from studies.views.plots.fields import usual_field
    from studies.views.plots.maps import map_figure
    from studies.views.plots.picture import drawn_from
    from studies.views.plots.sheets import png

    field = usual_field(dataset)
    try:
        if path is None:
            drawn = map_figure(one_run(dataset), field, "xx")
        else:
            with drawn_from(path, dataset, field, {}) as (run, _):
                drawn = map_figure(one_run(run), field, "xx")
    except StudyError:
        return {}
    return {f"{field}_xx.png": png(drawn)}


def _found(kind: Kind, dataset: xr.Dataset) -> dict[str, bytes]:
    """Draw what was found; nothing if it cannot be drawn."""
    from studies.views.plots.sheets import png
    from studies.views.plots.sweep import sweep_figure

    if kind.figure:
        figure = kind.figure(dataset)
        return {f"{kind.name}.png": png(figure)} if figure else {}
    try:
        return {f"{kind.value}.png": png(sweep_figure(dataset, kind.value))}
    except StudyError:
        return {}
