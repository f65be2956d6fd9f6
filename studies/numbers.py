"""Numbers, times and sizes as people read them; files and answers have all digits."""

from __future__ import annotations

import math

_ROUNDED, _STRESS = 1e-9, 1e-6
"""Ratio of a number to the largest of its unit below which it is shown as 0; that of stress is the
accuracy of a balance of forces."""
_TIMES = ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (1.0, "seconds"))


def rounding(unit: str, level: float) -> float:
    """Return the size below which numbers are shown as 0, given the largest of their unit."""
    return level * (_STRESS if unit == "MPa" else _ROUNDED)


def number_text(value: float, digits: int = 4) -> str:
    """Return a number with a few digits, NaN as "-".

    From 1e-4 to 1e6 it has no power of ten, and all digits before the point.
    """
    if math.isnan(value):
        return "-"
    text = f"{value:z.{digits}g}"
    return f"{value:.0f}" if "e" in text and 1e-4 <= abs(value) < 1e6 else text


def typeset(text: str) -> str:
    """Return a number as text as pages and figures show it: with a minus, "–" for none."""
    return "–" if text == "-" else text.replace("-", "\N{MINUS SIGN}")


def typeset_number(value: float, digits: int = 4) -> str:
    """Return `number_text` of a number, `typeset`."""
    return typeset(number_text(value, digits))


def time_text(likely: float, low: float, high: float, worst: float | None = None) -> str:
    """Return a time [s] and its range, also the worst, in a unit in which it is at least 2."""
    size, unit = next((each for each in _TIMES if likely >= 2 * each[0]), _TIMES[-1])
    about, least, most = (number_text(each / size, 2) for each in (likely, low, high))
    beyond = f"; at most {number_text(worst / size, 2)}" if worst else ""
    return f"about {about} {unit} ({least} to {most}{beyond})"


def size_text(count: float, digits: int = 3) -> str:
    """Return a size [bytes] in MB or GB."""
    size, unit = (1e9, "GB") if count >= 1e9 else (1e6, "MB")
    return f"{number_text(count / size, digits)} {unit}"
