"""The file of a run: a sealed netCDF file, made in memory and checked at every reading."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.storage import dataset as layout
from studies.storage import seal, ugrid

if TYPE_CHECKING:
    import h5py
    import xarray as xr

_FIRST_BYTES = 1 << 16
"""Initial size of a file in memory, which grows."""
_ORDER = "variables"
"""Attribute with the names of the variables in order, except those of the mesh; netCDF loses the
order in memory."""


def sealed(run: xr.Dataset) -> bytes:
    """Return the content of a run's file: its netCDF, and the seal."""
    return seal.sealed(f"run {run.attrs['id']}", _packed(run))


def _packed(run: xr.Dataset) -> bytes:
    """Return a run as netCDF, made in memory: HDF5 does not survive a full disk."""
    import netCDF4  # takes half a second, and a complete study does not need it
    from xarray.backends import NetCDF4DataStore
    from xarray.backends.netCDF4_ import NETCDF4_PYTHON_LOCK

    stored = layout.encoding(run)
    for name, variable in run.variables.items():
        if variable.ndim and variable.dtype.kind in "fi":
            stored.setdefault(str(name), {})["fletcher32"] = True
    combined = (n for n, each in run.variables.items() if not ugrid.owns(str(n), each.dims))
    order = {_ORDER: " ".join(map(str, combined))}
    with NETCDF4_PYTHON_LOCK:
        file = netCDF4.Dataset(run.attrs["id"], "w", memory=_FIRST_BYTES)
        try:
            store = NetCDF4DataStore(file, lock=False)
            run.assign_attrs(seal.SEALED | order).dump_to_store(store, encoding=stored)
        finally:
            content = file.close()
        return bytes(content)


def verify(path: Path) -> None:
    """Raise `FileDamaged` if a file is missing, damaged, or not the run of its name."""
    seal.check(path, f"run {path.stem}")


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Give the file of a run, verified and open."""
    import h5py

    verify(path)
    with h5py.File(path, "r") as run:
        yield run


def global_attributes(run: h5py.File) -> dict[str, Any]:
    """Return the global attributes; h5py returns ASCII texts as bytes."""
    return {name: _text(value) for name, value in run.attrs.items()}


def variables(run: h5py.File) -> list[str]:
    """Return the names of the variables in their original order, without those of the mesh."""
    return _text(run.attrs[_ORDER]).split() if _ORDER in run.attrs else list(run)


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def stamp(path: Path) -> dict[str, int]:
    """Return length and time of change [ns] of a file, by which the catalogue recognises it."""
    state = path.stat()
    return {"size": state.st_size, "modified": state.st_mtime_ns}


def row(path: Path) -> dict[str, Any]:
    """Return the catalogue's row of a run, read from its file.

    h5py reads the few values needed; xarray would take fifty times as long.
    """
    with opened(path) as run:
        rank = run["status"].ndim
        every = {name: run[name] for name in variables(run)}
        values = {
            name: (each.asstr() if each.dtype.kind == "O" else each)[...].item()
            for name, each in every.items()
            if each.ndim == rank and not each.is_scale
        }
        if not isinstance(values["status"], str):  # a number in files of earlier versions
            values["status"] = _text(run["status"].attrs["flag_meanings"]).split()[values["status"]]
        return layout.summary(global_attributes(run), values) | stamp(path)
