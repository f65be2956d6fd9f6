"""Files and arrays as answers."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import HTTPException
from fastapi.responses import FileResponse
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles
from starlette.types import Message, Receive, Scope, Send

MEDIA_TYPE, OCTETS = "application/netcdf", "application/octet-stream"
UNCHANGED: dict[int | str, dict[str, Any]] = {
    304: {"description": "Not modified: what the client has is up to date"}
}
NETCDF: dict[int | str, dict[str, Any]] = {
    200: {"content": {MEDIA_TYPE: {}}},
    206: {"description": "The requested part", "content": {MEDIA_TYPE: {}}},
    **UNCHANGED,
}

TAGS = StaticFiles()
"""Decides whether a client's copy is up to date: by entity tags, or else by dates."""

RANGE = re.compile(rb"bytes=(?:(?P<first>\d{1,18})-(?P<last>\d{0,18})|-\d{1,18})")


def tagged(content: object) -> Headers:
    """Return the headers of an answer whose entity tag tells all that it depends on."""
    tag = hashlib.sha256(repr(content).encode("utf-8", "surrogatepass")).hexdigest()[:32]
    return Headers({"etag": f'"{tag}"', "cache-control": "no-cache"})


def unchanged(request: Request, headers: Headers) -> Response | None:
    """Return the answer that what the client has is up to date; None if it is not."""
    known = TAGS.is_not_modified(headers, request.headers)
    return NotModifiedResponse(headers) if known else None


class PartlyFile(FileResponse):
    """A file of which a client may request one part, or only whether it has changed.

    A range that is malformed, or has several parts, is ignored as HTTP permits (RFC 9110, 14.2):
    the framework's answer to it would not be a problem document.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file, the part, or that it is unchanged."""
        if TAGS.is_not_modified(self.headers, Headers(scope=scope)):
            return await NotModifiedResponse(self.headers)(scope, receive, send)

        async def checked(message: Message) -> None:
            if message.get("status") == 416:  # sent by the framework as plain text
                head = Headers(raw=message["headers"])
                beyond = {"content-range": head["content-range"]}
                raise HTTPException(416, "the part begins beyond the end of the file", beyond)
            await send(message)

        headers = [(k, v) for k, v in scope["headers"] if k != b"range" or sensible(v)]
        return await super().__call__({**scope, "headers": headers}, receive, checked)


def sensible(header: bytes) -> bool:
    """Whether a ``Range`` header requests one part that does not end before it begins."""
    found = RANGE.fullmatch(header)
    return found is not None and (not found["last"] or int(found["first"]) <= int(found["last"]))


def netcdf(path: Path, name: str) -> FileResponse:
    """Return a netCDF file for download under ``name``.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    return PartlyFile(path, media_type=MEDIA_TYPE, filename=name, stat_result=path.stat())


def octets(head: Mapping[str, Any], arrays: Mapping[str, np.ndarray], kind: str = "<f8") -> bytes:
    """Return named arrays as octets: a line of JSON with what is said of them, then the numbers.

    These are little endian, all of one type. The line is padded by spaces, so that the arrays begin
    at a multiple of eight. Its entry ``arrays`` has the name, the type (``<f8`` or ``<f4``) and the
    shape of each, in their order.
    """
    listed = [
        {"name": name, "type": kind, "shape": list(values.shape)} for name, values in arrays.items()
    ]
    line = json.dumps(dict(head) | {"arrays": listed}, allow_nan=False).encode("ascii")
    padded = line + b" " * (-(len(line) + 1) % 8) + b"\n"
    return padded + b"".join(np.ascontiguousarray(each, kind).tobytes() for each in arrays.values())
