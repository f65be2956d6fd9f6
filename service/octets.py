"""Arrays as octets: a line of JSON, then the numbers, little endian.

The line is padded by spaces, so that the arrays begin at a multiple of eight. Its entry ``arrays``
has the name, the type (``<f8`` or ``<f4``) and the shape of each array, in their order.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

MEDIA_TYPE = "application/octet-stream"


def octets(head: Mapping[str, Any], arrays: Mapping[str, np.ndarray], kind: str = "<f8") -> bytes:
    """Return named arrays of numbers, all of one type, with what is said of them."""
    listed = [
        {"name": name, "type": kind, "shape": list(values.shape)} for name, values in arrays.items()
    ]
    line = json.dumps(dict(head) | {"arrays": listed}, allow_nan=False).encode("ascii")
    padded = line + b" " * (-(len(line) + 1) % 8) + b"\n"
    return padded + b"".join(np.ascontiguousarray(each, kind).tobytes() for each in arrays.values())
