"""The file of a run: its last line is a checksum of the whole, which every reading looks at first.

The line follows the end that HDF5 knows, so that every netCDF reader opens the file as any other.
It covers each byte and the id. HDF5's own checksums, which the arrays have too, leave names,
attributes and texts uncovered, and HDF5 may end the process when it reads damaged ones.
"""

from __future__ import annotations

import errno
import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.errors import RunUnreadable, StoreFull
from studies.storage import dataset as layout
from studies.storage import ugrid

if TYPE_CHECKING:
    import h5py
    import xarray as xr

SEALED = {"checksum": "SHA-256 in the last line, after the end of HDF5"}
"""Attribute of a file that has the line; a file without either is older, and has no checksum."""

_LINE = re.compile(rb"\nrun ([0-9a-f]{32}) sha256 ([0-9a-f]{64})\n")
_LENGTH = 110
_DIGEST = 65
"""Bytes of the whole line, and of what it does not cover itself."""
_FIRST_BYTES = 1 << 16
"""Size with which a file in memory begins; it grows."""
_ORDER = "variables"
"""Attribute with the names of the variables in their order, which netCDF loses in memory; without
those of the mesh."""
_NO_FILE = frozenset({errno.ENOENT, errno.EISDIR, errno.EIO})


def sealed(run: xr.Dataset) -> bytes:
    """Return what to write of a run: its netCDF, and the last line."""
    begun = _packed(run) + f"\nrun {run.attrs['id']} sha256 ".encode()
    return begun + hashlib.sha256(begun).hexdigest().encode() + b"\n"


def _packed(run: xr.Dataset) -> bytes:
    """Return a run as netCDF, made in memory: HDF5 does not survive a full disk."""
    import netCDF4  # with xarray half a second: a complete study waits for neither
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
            run.assign_attrs(SEALED | order).dump_to_store(store, encoding=stored)
        finally:
            content = file.close()
        return bytes(content)


def verify(path: Path) -> bool:
    """Tell whether a checksum vouches for the file, which an older file lacks.

    Raises
    ------
    RunUnreadable
        when it is not what was written under this name
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

    What goes wrong while a file without checksum is read is taken for damage of that file. What
    goes wrong with a sound one is not.
    """
    import h5py

    vouched = verify(path)
    try:
        with h5py.File(path, "r") as run:
            _compare(_text(run.attrs["id"]), path)
            yield run
    except (MemoryError, RunUnreadable, StoreFull):
        raise
    except Exception as error:  # h5py knows no error of its own: OSError, KeyError, RuntimeError …
        if vouched:
            raise
        raise RunUnreadable(path.stem, f"{type(error).__name__}: {error}") from None


def global_attributes(run: h5py.File) -> dict[str, Any]:
    """Return the global attributes; h5py gives a text of ASCII letters as bytes."""
    return {name: _text(value) for name, value in run.attrs.items()}


def variables(run: h5py.File) -> list[str]:
    """Return the names of the variables in the order in which they were given, the mesh's not."""
    return _text(run.attrs[_ORDER]).split() if _ORDER in run.attrs else list(run)


def _text(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value


def stamp(path: Path) -> dict[str, int]:
    """Return length and time of change [ns] of a file, by which the catalogue knows it again."""
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
        if not isinstance(values["status"], str):  # its number, as earlier versions wrote it
            values["status"] = _text(run["status"].attrs["flag_meanings"]).split()[values["status"]]
        return layout.summary(global_attributes(run), values) | stamp(path)


def _compare(run_id: str, path: Path) -> None:
    if run_id != path.stem:
        raise RunUnreadable(path.stem, f"it is the run {run_id}")
