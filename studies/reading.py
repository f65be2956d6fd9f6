"""Stored results opened as labelled data sets."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from studies.errors import StudyError
from studies.store import ENGINE


def open_study(path: Path | str) -> xr.Dataset:
    """Open the combined data set of a study; arrays are read when they are used.

    Parameters
    ----------
    path : a ``dataset.nc``, the directory of a study, or an output directory with one study

    Raises
    ------
    StudyError
        when there is no data set, or more than one
    """
    return open_netcdf(find_dataset(Path(path)))


def open_netcdf(path: Path | str) -> xr.Dataset:
    """Open the file of a run or of a study; arrays are read when they are used."""
    return xr.open_dataset(path, engine=ENGINE)


def find_dataset(path: Path) -> Path:
    """Return the combined data set that `path` stands for."""
    if path.is_file():
        return path
    if (path / "dataset.nc").is_file():
        return path / "dataset.nc"
    found = sorted(path.glob("studies/*/dataset.nc"))
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(str(each.parent) for each in found)
        raise StudyError("path", str(path), f"holds several studies, name one of {names}")
    raise StudyError("path", str(path), "must be a data set, a study or an output directory")
