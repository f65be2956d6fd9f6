"""What opens files of results; called in processes apart, see `service.sandbox`.

The service itself reads them as bytes, or parts of data sets by h5py. The netCDF library ends a
process in which two threads use it, and no answer waits for the file of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import xarray as xr

from service.files import octets
from solver.results.mesh_fields import vtu_of
from studies.definition.study import Study
from studies.errors import StudyError
from studies.kinds import found_of
from studies.kinds.fit.shown import told as told_fit
from studies.storage.combine import combine
from studies.storage.runfile import verify
from studies.storage.store import Store
from studies.views.picking import sweep_axes
from studies.views.reading import open_netcdf
from studies.views.shown import outline, shown
from studies.views.solution import read

# xarray looks for array libraries and readers of files at its first use: else each fork would.
xr.Dataset({"first": ("first", ["use"])})
xr.backends.list_engines()


def outlined(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Return the variables of a run's file that are drawn."""
    with opened(path) as dataset:
        return outline(dataset)


def values(
    files: list[Path], field: str, component: str | None, stage: str | None, table: bool
) -> bytes:
    """Return a map or lines of the first run, less the map of the second if there is one.

    They are octets, or a ``table`` as CSV.
    """
    with ExitStack() as stack:
        runs = [stack.enter_context(opened(path)) for path in files]
        found = shown(runs[0], field, component, stage, *runs[1:])
        return b"".join(found.as_csv()) if table else octets(found.head, found.arrays, kind="<f4")


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Give the data set of a run, without the dimensions of a sweep."""
    verify(path)
    with open_netcdf(path) as dataset:
        yield dataset.isel(dict.fromkeys(sweep_axes(dataset), 0))


def nodal_fields(path: Path, stage: str | None) -> bytes:
    """Return the fields at the nodes of a run at a stage, as a VTU file."""
    with open_netcdf(path) as dataset:
        fields = read(dataset)
    if stage is not None and stage not in fields.stages:
        raise StudyError("stage", stage, f"must be one of {', '.join(fields.stages)}")
    return vtu_of(fields, stage or list(fields.stages)[-1])


def fitted(path: Path) -> dict[str, Any]:
    """Return what a fit has found, of the data set in ``path``."""
    with open_netcdf(path) as found:
        return told_fit(found)


def found(path: Path) -> dict[str, Any]:
    """Return the entries of `Found` of a data set of a study that chooses its runs; {} if none."""
    with open_netcdf(path) as dataset:
        answers = found_of(dataset)
        return asdict(answers) if answers else {}


def combined(content: dict[str, Any], directory: Path, aside: Path | None, target: Path) -> None:
    """Write the data set of the runs of a study that are there; called in another process.

    Nothing is moved in a directory whose lists are ``aside``.
    """
    store = Store(directory, aside=aside)
    study = Study.known(content, store.scene)
    combine(study, store, study.cases(), target=target)
