"""The report that `residua run` writes beside a data set: the table of runs and a picture of one.

Both are kept until the data set changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from solver.files import read_file
from studies.definition.study import Study
from studies.execution.run import StudyOutcome
from studies.storage.made import Made
from studies.storage.store import Store

_NAME = "report"
_TEXT = "report.txt"


@dataclass(frozen=True, slots=True)
class Report:
    """The result of a study as text and files, and whether these were written now."""

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
    # with tables and pictures it takes a second
    from studies.views.plots.picture import report_pictures
    from studies.views.reading import open_study
    from studies.views.tables import report_text

    with open_study(outcome.dataset) as dataset:
        text = report_text(dataset, study.kind, outcome, study.note)
        drawn = report_pictures(dataset, study.kind, outcome.dataset if study.keep else None)
        files = made.write(_NAME, of, {_TEXT: text.encode(), **drawn})
    return Report(text, files, anew=True)
