"""The file of a run: its last line is a checksum of the whole file, verified at every reading.

The line is after the end of the HDF5 data, so that every netCDF reader can open the file. It covers
each byte and the id. HDF5's own checksums, which the arrays also have, do not cover names,
attributes and texts, and HDF5 may end the process when it reads damaged ones.
"""

from __future__ import annotations

import errno
import hashlib
import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.errors import RunUnreadable, StoreFull
from studies.storage import dataset as layout
from studies.storage import ugrid

if TYPE_CHECKING:
    import h5py
    import netCDF4

SEALED = {"checksum": "SHA-256 in the last line, after the end of HDF5"}
"""Attribute of a file that has the line; an older file has neither."""

_LINE = re.compile(rb"\nrun ([0-9a-f]{32}) sha256 ([0-9a-f]{64})\n")
_LENGTH = 110
_DIGEST = 65
"""Length of the line in bytes; the checksum covers everything before it."""
_FIRST_BYTES = 1 << 16
"""Initial size of a file in memory, which grows."""
_ORDER = "variables"
"""Attribute with the names of the variables in order, except those of the mesh; netCDF loses the
order in memory."""
_NO_FILE = frozenset({errno.ENOENT, errno.EISDIR, errno.EIO})
_LOCK = Lock()


def sealed(run: layout.RunContent) -> bytes:
    """Return the content of a run's file: its netCDF, and the last line."""
    begun = _packed(run) + f"\nrun {run.attrs['id']} sha256 ".encode()
    return begun + hashlib.sha256(begun).hexdigest().encode() + b"\n"


def _packed(run: layout.RunContent) -> bytes:
    """Return a run as netCDF, made in memory: HDF5 does not survive a full disk."""
    import netCDF4  # a complete study does not need it

    order = [str(name) for name, each in run.variables.items() if not ugrid.owns(name, each.dims)]
    with _one_writer():
        file = netCDF4.Dataset(run.attrs["id"], "w", memory=_FIRST_BYTES)
        try:
            file.setncatts({**run.attrs, **SEALED, _ORDER: " ".join(order)})
            for name, variable in run.variables.items():
                _write(file, str(name), variable)
        finally:
            content = file.close()
        return bytes(content)


def _write(file: netCDF4.Dataset, name: str, variable: layout.Variable) -> None:
    """Write a variable, and the dimensions that the file does not have yet."""
    values = np.asarray(variable.values)
    for dimension, length in zip(variable.dims, values.shape, strict=True):
        if dimension not in file.dimensions:
            file.createDimension(dimension, length)
    stored = file.createVariable(name, dimensions=variable.dims, **layout.storage_of(variable))
    stored.setncatts(variable.attrs)
    stored.set_auto_maskandscale(False)
    stored[...] = values.astype(object) if values.dtype.kind in "OU" else values


@contextmanager
def _one_writer() -> Iterator[None]:
    """Wait for other threads that use the netCDF library, here or through xarray."""
    with ExitStack() as locks:
        locks.enter_context(_LOCK)
        if reader := sys.modules.get("xarray.backends.netCDF4_"):
            locks.enter_context(reader.NETCDF4_PYTHON_LOCK)
        yield


def verify(path: Path) -> bool:
    """Verify the checksum of a file; return False for an older file without one.

    Raises
    ------
    RunUnreadable
        if the file is missing, damaged, or that of another run
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        if error.errno not in _NO_FILE:
            raise
        raise RunUnreadable(path.stem, str(error.strerror)) from None
    line = _LINE.fullmatch(content, max(len(content) - _LENGTH, 0))
    if line is None:
        if SEALED["checksum"].encode() in content:
            raise RunUnreadable(path.stem, "its end is damaged")
        return False
    whole = hashlib.sha256(memoryview(content)[:-_DIGEST]).hexdigest()
    if whole.encode() != line[2]:
        raise RunUnreadable(path.stem, "its checksum is wrong")
    _compare(line[1].decode(), path)
    return True


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Give the file of a run, verified and open.

    An error while a file without checksum is read counts as damage of that file. An error with a
    verified file does not.
    """
    import h5py

    vouched = verify(path)
    try:
        with h5py.File(path, "r") as run:
            _compare(_text(run.attrs["id"]), path)
            yield run
    except (MemoryError, RunUnreadable, StoreFull):
        raise
    except Exception as error:  # h5py raises OSError, KeyError, RuntimeError …
        if vouched:
            raise
        raise RunUnreadable(path.stem, f"{type(error).__name__}: {error}") from None


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


def _compare(run_id: str, path: Path) -> None:
    if run_id != path.stem:
        raise RunUnreadable(path.stem, f"it is the run {run_id}")
