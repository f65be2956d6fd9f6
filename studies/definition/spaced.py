"""Ranges in a sweep: an axis given by its first value, its last value and their number."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, TypeGuard

from solver.parameters import is_number
from studies.errors import StudyError

_KEYS = ("start", "stop", "num")
SPACINGS = ("linear", "log")
_MOST = 100_000
_DIGITS = 12
"""Number of digits to which values are rounded."""


def spaced(name: str, content: Mapping[str, Any]) -> list[float]:
    """Return the values of a range ``{start, stop, num}``, of equal steps or of equal ratios.

    Whole numbers are int, so that they suit integer parameters.

    Raises
    ------
    StudyError
        naming the key, its value and what is allowed
    """
    field = f"sweep.{name}"
    missing = [key for key in _KEYS if key not in content]
    unknown = [key for key in content if key not in (*_KEYS, "spacing")]
    if missing or unknown:
        allowed = (
            "must be a list of values or a range {start, stop, num}, with spacing = linear or log; "
            "a table of labels needs a name that is no parameter"
        )
        raise StudyError(field, dict(content), allowed)
    spacing, num = content.get("spacing", "linear"), content["num"]
    if spacing not in SPACINGS:
        raise StudyError(f"{field}.spacing", spacing, "must be one of " + ", ".join(SPACINGS))
    if isinstance(num, bool) or not isinstance(num, int) or not 2 <= num <= _MOST:
        raise StudyError(f"{field}.num", num, f"must be an integer >= 2 and <= {_MOST}")
    start, stop = (_number(f"{field}.{key}", content[key], spacing) for key in ("start", "stop"))
    shares = [k / (num - 1) for k in range(num)]
    found = [between(start, stop, spacing, share) for share in shares]
    values = map(rounded, (start, *found[1:-1], stop))
    return [int(value) if value.is_integer() else value for value in values]


def between(start: float, stop: float, spacing: str, share: float) -> float:
    """Return the value at a share of the way, of the difference or (``log``) of the ratio."""
    if spacing == "log":
        return float(start * (stop / start) ** share)
    return start + (stop - start) * share


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number; an integer of hundreds of digits is none."""
    with suppress(OverflowError):
        return is_number(value) and math.isfinite(value)
    return False


def rounded(value: float) -> float:
    """Return a value with as many digits as a study needs: 0.3, not 0.30000000000000004."""
    return float(f"{value:.{_DIGITS}g}")


def _number(field: str, value: Any, spacing: str) -> float:
    least = "> 0" if spacing == "log" else ""
    if not is_finite(value):
        raise StudyError(field, value, f"must be a finite number {least}".strip())
    if spacing == "log" and not value > 0:
        raise StudyError(field, value, "must be > 0 for spacing = log")
    return float(value)
