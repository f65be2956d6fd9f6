"""The rules by which pages and pictures show numbers: colours, marks, counts.

What needs the values of a run, such as the end of the colours of a map, goes with these values
(`studies.views.shown`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from studies.definition.vocabulary import OK, OUTSIDE_THEORY

MOST_LINES = 12
"""Largest number of lines that can be distinguished in a legend."""

SIGNED, SEQUENTIAL, NUMBERS = "RdBu_r", "YlOrRd", "viridis"
"""Colours of matplotlib: with zero in the middle, from zero on, and of values of the runs."""

_COLOURS: Mapping[str, str] = {
    SIGNED: "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f",
    SEQUENTIAL: "ffffcc ffeda0 fed976 feb24c fd8d3c fc4e2a e31a1c bd0026 800026",
    NUMBERS: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
}
"""The same at equal distances: a page does not load matplotlib."""

REASONS: Mapping[str, str] = {
    OK: "no value",
    "limit_load": "no equilibrium",
    OUTSIDE_THEORY: "outside small-strain theory",
    "pending": "not computed yet",
}
"""Why a run has no value, by its status; of other statuses their names."""


def scale(colours: str) -> Sequence[str]:
    """Return colours at equal distances."""
    return [f"#{each}" for each in _COLOURS[colours].split()]


PAGES = {
    "most_lines": MOST_LINES,
    "signed": scale(SIGNED),
    "sequential": scale(SEQUENTIAL),
    "numbers": scale(NUMBERS),
    "reasons": REASONS,
}
"""What pages know of this."""
