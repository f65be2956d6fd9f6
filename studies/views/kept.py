"""The run of a study from which a map is drawn: its own file, if that keeps the mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from studies.errors import StudyError
from studies.storage.ugrid import keeps
from studies.views.picking import file_of, one_run, study_of, sweep_coordinates
from studies.views.plots.fields import usual_field
from studies.views.plots.meshed import MESH_MAPS
from studies.views.reading import find_study, open_netcdf


@contextmanager
def drawn_from(
    path: Path | str, dataset: xr.Dataset, field: str | None, selection: Mapping[str, str]
) -> Iterator[tuple[xr.Dataset, Mapping[str, str]]]:
    """Give the data set from which a field is drawn, and what is still to be selected of it.

    It is that of the study, or the file of the selected run if the study keeps fields and the field
    is a map: data sets of studies do not have the meshes of their runs.
    """
    found = _run_of(path, dataset, field or usual_field(dataset), selection)
    if found is None:
        yield dataset, selection
        return
    swept = sweep_coordinates(dataset)
    chosen = {name: value for name, value in selection.items() if name in swept}
    with open_netcdf(found) as own:
        left = {name: value for name, value in selection.items() if name not in swept}
        of = one_run(dataset, chosen)  # what distinguishes the run stands in the caption
        run = one_run(own)
        run = run.assign_coords({name: of[name] for name in swept if name not in run.variables})
        yield (run, left) if keeps(run) else (dataset, selection)


def _run_of(
    path: Path | str, dataset: xr.Dataset, field: str, selection: Mapping[str, str]
) -> Path | None:
    if isinstance(path, str) or keeps(dataset) or field not in MESH_MAPS:
        return None
    found = find_study(path)
    if found.name != "dataset.nc" or not found.with_name("study.json").is_file():
        return None
    try:
        study, store = study_of(found)
    except StudyError:  # of another version of the solver: its runs are not found by their ids
        return None
    if not study.keep:
        return None
    swept = sweep_coordinates(dataset)
    chosen = {name: each for name, each in selection.items() if name in swept}
    return file_of(dataset, study, store, chosen)
