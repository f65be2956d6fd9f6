"""The file of a run: a sealed netCDF file, made in memory and checked at every reading."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from studies.storage import dataset as layout
from studies.storage import seal, ugrid

_FIRST_BYTES = 1 << 16
"""Initial size of a file in memory, which grows."""
_ORDER = "variables"
"""Attribute with the names of the variables in order, except those of the mesh; netCDF loses the
order in memory."""
_LOCK = Lock()


def described(
    dims: str | Sequence[str], values: Any, words: str, unit: str = ""
) -> layout.Variable:
    """Return values over dimensions with their meaning and unit; those left out are of size one."""
    over = (dims,) if isinstance(dims, str) else tuple(dims)
    array = np.asarray(values)
    array = array.astype(object) if array.dtype.kind == "U" else array
    attrs = {"long_name": words} | ({"units": unit} if unit else {})
    return layout.Variable(
        over, array.reshape((1,) * (len(over) - array.ndim) + array.shape), attrs
    )


def sealed(run: layout.RunContent) -> bytes:
    """Return the content of a run's file: its netCDF, and the seal."""
    return seal.sealed(f"run {run.attrs['id']}", packed(run))


def packed(run: layout.RunContent) -> bytes:
    """Return a run as netCDF, made in memory: HDF5 does not survive a full disk.

    All variables come before the first value, with which the library writes what it knows of all.
    """
    import netCDF4  # a complete study does not need it

    order = [str(name) for name, each in run.variables.items() if not ugrid.owns(name, each.dims)]
    with _one_writer():
        file = netCDF4.Dataset(run.attrs["id"], "w", memory=_FIRST_BYTES)
        try:
            file.setncatts({**run.attrs, **seal.SEALED, _ORDER: " ".join(order)})
            stored = [_declared(file, str(name), each) for name, each in run.variables.items()]
            for into, each in zip(stored, run.variables.values(), strict=True):
                values = np.asarray(each.values)
                into[...] = values.astype(object) if values.dtype.kind in "OU" else values
        finally:
            content = file.close()
        return bytes(content)


def _declared(file: Any, name: str, variable: layout.Variable) -> Any:
    """Return a variable of a file without its values; dimensions that it lacks are added."""
    for dimension, length in zip(variable.dims, np.shape(variable.values), strict=True):
        if dimension not in file.dimensions:
            file.createDimension(dimension, length)
    storage = layout.storage_of(variable)
    if variable.dims == (name,):  # a coordinate has all of its values (CF, section 2.5.1)
        storage.pop("fill_value", None)
    stored = file.createVariable(name, dimensions=variable.dims, **storage)
    stored.setncatts(variable.attrs)
    stored.set_auto_maskandscale(False)
    return stored


@contextmanager
def _one_writer() -> Iterator[None]:
    """Wait for other threads that use the netCDF library, here or through xarray."""
    with ExitStack() as locks:
        locks.enter_context(_LOCK)
        if reader := sys.modules.get("xarray.backends.netCDF4_"):
            locks.enter_context(reader.NETCDF4_PYTHON_LOCK)
        yield


def verify(path: Path) -> None:
    """Raise `FileDamaged` if a file is missing, damaged, or not the run of its name."""
    seal.check(path, f"run {path.stem}")


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Give the file of a run, verified and open."""
    import h5py

    verify(path)
    with h5py.File(path, "r") as run:
        yield run


def global_attributes(run: Any) -> dict[str, Any]:
    """Return the global attributes; h5py returns ASCII texts as bytes."""
    return {name: _text(value) for name, value in run.attrs.items()}


def variables(run: Any) -> list[str]:
    """Return the names of the variables in their original order, without those of the mesh."""
    return _text(run.attrs[_ORDER]).split() if _ORDER in run.attrs else list(run)


def lines(
    run: Any, names: Iterable[str]
) -> dict[str, tuple[tuple[str, ...], np.ndarray[Any, Any]]]:
    """Return variables without the sweep: dimensions and values; and the values of dimensions.

    Variables that the run does not have are left out.
    """
    rank, found = run["status"].ndim, {}
    for name in (each for each in names if each in run and not run[each].is_scale):
        each = run[name]
        scales = [next(iter(each.dims[k].values())) for k in range(rank, each.ndim)]
        dims = tuple(scale.name.removeprefix("/") for scale in scales)
        found[name] = dims, each[...].reshape(each.shape[rank:])
        for dim, scale in zip(dims, scales, strict=True):
            if not scale.attrs.get("NAME", b"").startswith(b"This is a netCDF dimension"):
                values = scale.asstr()[...] if scale.dtype.kind == "O" else scale[...]
                found[dim] = (dim,), values
    return found


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
