"""The static files of the pages: packed once, and kept by browsers for good.

Their address has the digest of all of them, so that a new version has other addresses.
"""

from __future__ import annotations

import gzip
import hashlib
import importlib.metadata
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from solver.files import read_file

MEDIA_TYPES = {"js": "text/javascript", "css": "text/css", "svg": "image/svg+xml"}

CHARTS = "plotly.js"
"""The library of charts, which comes in the wheel `plotly`."""


@dataclass(frozen=True, slots=True)
class Asset:
    """A static file."""

    media_type: str
    packed: bytes


@cache
def own() -> dict[str, bytes]:
    """Return the files of this package by name."""
    folder = _folder("service.pages") / "static"
    return {each.name: read_file(each) for each in folder.iterdir() if each.is_file()}


@cache
def version() -> str:
    """Return the digest of all static files."""
    known = hashlib.sha256(importlib.metadata.version("plotly").encode())
    for name, content in sorted(own().items()):
        known.update(name.encode() + content)
    return known.hexdigest()[:16]


def asset(of: str, name: str) -> Asset | None:
    """Return a static file of a version; None if this is another one, or has no such file."""
    return _packed(name) if of == version() and name in {CHARTS, *own()} else None


def _folder(package: str) -> Path:
    return Path(str(files(package)))


@cache
def _packed(name: str) -> Asset:
    if name == CHARTS:
        content = read_file(_folder("plotly") / "package_data" / "plotly.min.js")
    else:
        content = own()[name]
    kind = MEDIA_TYPES[name.rpartition(".")[2]]
    return Asset(kind, gzip.compress(content, 6, mtime=0))
