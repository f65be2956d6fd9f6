"""A data set as a Zarr store, read from its netCDF file: no second copy is made.

A chunk of Zarr is a chunk of the file, of fields one run. A chunk that was never written has none:
readers fill it. Chunks are packed anew: Zarr's specification has no counterpart of HDF5's filters.

References
----------
Zarr core specification, version 3; consolidated metadata as zarr-python 3 writes them.
"""

from __future__ import annotations

import gzip
import json
import struct
from collections.abc import Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from studies.storage.readback import internal, plain
from studies.storage.seal import State, state_of

METADATA = "zarr.json"
"""Key of the metadata of a group or an array."""

KEYS = (("default", "/"), ("default", "."), ("v2", "."), ("v2", "/"))
"""Encodings of the keys of chunks: ``c/0/1``, ``c.0.1``, ``0.1``, ``0/1``."""

_PACKED = 1
"""Level of gzip."""
_OWN = ("_NCProperties", "_FillValue", "checksum", "variables")
"""Attributes of netCDF, and those that say how a file is checked."""

Document = dict[str, Any]


class Tiles:
    """The keys of a Zarr store and their contents.

    Parameters
    ----------
    path : a data set, whose seal has been checked
    turn : which of `KEYS` the chunks have. A reader who opened the data set when it had another
        layout asks by another encoding, and gets an error in place of values of other places
    """

    def __init__(self, path: Path, turn: int = 0) -> None:
        self.path = path
        self.encoding = KEYS[turn % len(KEYS)]
        state = state_of(path)
        if state is None:
            raise FileNotFoundError(path)
        self.attributes, self.arrays, self.layout = _described(path, state)

    def content(self, key: str) -> bytes | None:
        """Return what is stored under a key; None if there is nothing.

        Raises
        ------
        LookupError
            if the key is that of a chunk in another encoding
        """
        name, _, rest = key.rpartition("/") if key.endswith(METADATA) else key.partition("/")
        if key == METADATA:
            return json.dumps(self._group()).encode()
        if name not in self.arrays:
            return None
        if rest == METADATA:
            return json.dumps(self._array(name)).encode()
        if (at := self._place(rest, self.encoding, name)) is not None:
            return _chunk(self.path, name, self.arrays[name], at)
        if any(self._place(rest, each, name) is not None for each in KEYS):
            raise LookupError("the layout of the data set has changed: open it again")
        return None

    def _group(self) -> Document:
        every = {name: self._array(name) for name in self.arrays}
        known = {"kind": "inline", "must_understand": False, "metadata": every}
        return {
            "zarr_format": 3, "node_type": "group", "attributes": self.attributes,
            "consolidated_metadata": known,
        }  # fmt: skip

    def _array(self, name: str) -> Document:
        encoding, separator = self.encoding
        keys = {"name": encoding, "configuration": {"separator": separator}}
        return self.arrays[name] | {"chunk_key_encoding": keys}

    def _place(self, key: str, encoding: tuple[str, str], name: str) -> tuple[int, ...] | None:
        """Return the numbers of a chunk by its key; None if the key is none of this encoding."""
        rank, (kind, separator) = len(self.arrays[name]["shape"]), encoding
        parts = key.split(separator)
        if kind == "default":
            first, *parts = parts
            if first != "c":
                return None
        elif not rank:  # the only chunk of a number has the key 0
            parts = [] if parts == ["0"] else ["none"]
        if len(parts) != rank or not all(p.isdecimal() and len(p) < 10 for p in parts):
            return None
        return tuple(map(int, parts))


@lru_cache(maxsize=16)
def _described(path: Path, state: State) -> tuple[Document, dict[str, Document], str]:
    """Return the attributes of a data set, its arrays, and a digest of their layout."""
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        arrays = {name: _array(each) for name, each in file.variables.items()}
        known = sha256(json.dumps(arrays).encode())
        for name, each in file.variables.items():
            if each.dimensions == (name,):
                known.update(repr(each[...].tolist()).encode())
        return _attributes(file.attrs), arrays, known.hexdigest()


def _array(variable: Any) -> Document:
    """Return the metadata of an array, without the encoding of its keys."""
    text = variable.dtype == str or variable.dtype.kind == "O"
    attributes, fill = _attributes(variable.attrs), variable.attrs.get("_FillValue")
    shape = variable.shape
    if not text and variable.dtype.kind in "iu" and fill is not None:
        attributes["_FillValue"] = plain(fill)
    first = {"name": "vlen-utf8"} if text else _bytes(variable.dtype)
    return {
        "zarr_format": 3,
        "node_type": "array",
        "shape": list(shape),
        "data_type": "string" if text else variable.dtype.name,
        "chunk_grid": {
            "name": "regular",
            "configuration": {"chunk_shape": list(variable.chunks or (max(n, 1) for n in shape))},
        },
        "fill_value": "" if text else "NaN" if variable.dtype.kind == "f" else plain(fill or 0),
        "codecs": [first, {"name": "gzip", "configuration": {"level": _PACKED}}],
        "attributes": attributes,
        "dimension_names": list(variable.dimensions),
    }


def _bytes(kind: np.dtype[Any]) -> Document:
    single = {} if kind.itemsize == 1 else {"configuration": {"endian": "little"}}
    return {"name": "bytes", **single}


def _attributes(attributes: Mapping[str, Any]) -> Document:
    """Return the attributes that tell of the content, as JSON has them."""
    own = {name: plain(each) for name, each in attributes.items() if not internal(name)}
    return {name: each for name, each in own.items() if name not in _OWN}


def _chunk(path: Path, name: str, array: Document, at: tuple[int, ...]) -> bytes | None:
    """Return a packed chunk; None if there is none, or nothing was written in it."""
    import h5py

    from studies.storage.frame import NO_COORDINATE

    shape, sizes = array["shape"], array["chunk_grid"]["configuration"]["chunk_shape"]
    begin = [number * size for number, size in zip(at, sizes, strict=True)]
    if any(first >= length for first, length in zip(begin, shape, strict=True)):
        return None
    with h5py.File(path, "r") as file:
        stored = file[NO_COORDINATE + name if NO_COORDINATE + name in file else name]
        if stored.chunks:
            found = stored.id.get_chunk_info_by_coord(tuple(begin))
            if found.byte_offset is None:
                return None
        part = tuple(slice(first, first + size) for first, size in zip(begin, sizes, strict=True))
        text = array["data_type"] == "string"
        values = np.asarray((stored.asstr() if text else stored)[part])
    if list(values.shape) != sizes:  # at the end of an axis a chunk is filled up
        rest = [(0, size - length) for size, length in zip(sizes, values.shape, strict=True)]
        values = np.pad(values, rest, constant_values="" if text else 0)
    packed = _texts(values) if text else values.astype(values.dtype.newbyteorder("<")).tobytes()
    return gzip.compress(packed, _PACKED, mtime=0)


def _texts(values: np.ndarray) -> bytes:
    """Return texts, each after its length, after their number."""
    texts = [str(each).encode() for each in values.ravel().tolist()]
    parts = [struct.pack("<I", len(texts))]
    for each in texts:
        parts += struct.pack("<I", len(each)), each
    return b"".join(parts)
