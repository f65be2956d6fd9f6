"""Files as answers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from fastapi.responses import FileResponse
from starlette.types import Receive, Scope, Send

MEDIA_TYPE = "application/netcdf"
NETCDF: dict[int | str, dict[str, Any]] = {200: {"content": {MEDIA_TYPE: {}}}}

RANGE = re.compile(rb"bytes=(?:(?P<first>\d{1,18})-(?P<last>\d{0,18})|-\d{1,18})")


class PartlyFile(FileResponse):
    """A file of which one part may be asked for.

    A range that is malformed, or of several parts, is ignored as HTTP permits (RFC 9110, 14.2):
    the framework's own answer to it would be no problem document.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file, or the part."""
        headers = [(k, v) for k, v in scope["headers"] if k != b"range" or sensible(v)]
        await super().__call__({**scope, "headers": headers}, receive, send)


def sensible(header: bytes) -> bool:
    """Tell whether a ``Range`` header asks for one part that does not end before it begins."""
    found = RANGE.fullmatch(header)
    return found is not None and (not found["last"] or int(found["first"]) <= int(found["last"]))


def netcdf(path: Path, name: str) -> FileResponse:
    """Return a netCDF file for download under ``name``."""
    return PartlyFile(path, media_type=MEDIA_TYPE, filename=name)
