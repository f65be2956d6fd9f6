"""Files as answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fastapi.responses import FileResponse

MEDIA_TYPE = "application/netcdf"
NETCDF: dict[int | str, dict[str, Any]] = {200: {"content": {MEDIA_TYPE: {}}}}


def netcdf(path: Path, name: str) -> FileResponse:
    """Return a netCDF file for download under ``name``."""
    return FileResponse(path, media_type=MEDIA_TYPE, filename=name)
