"""Figures as files: their resolution and their format."""

from __future__ import annotations

import io
from pathlib import Path
from typing import IO

from matplotlib.figure import Figure

from studies.errors import StudyError

_COARSEST, _FINEST = 50, 600
"""Range of the resolution in dots per inch."""
_SIDE = 2**15
"""Largest number of dots of a side: matplotlib draws twice as many, in gigabytes of memory."""


def resolved(figure: Figure, resolution: float | None) -> Figure:
    """Return a figure with its resolution [dpi], by default its own, or raise `StudyError`."""
    if resolution is not None:
        if not _COARSEST <= resolution <= _FINEST:
            allowed = f"must be {_COARSEST} to {_FINEST} dots per inch"
            raise StudyError("resolution", resolution, allowed)
        figure.set_dpi(resolution)
    return figure


def save(figure: Figure, to: Path | IO[bytes], kind: str = "png") -> None:
    """Write a figure in its resolution, or the finest that its size allows.

    Parameters
    ----------
    to : name of a file, or a file
    kind : one of the formats of matplotlib, such as ``"svg"``
    """
    figure.set_dpi(min(figure.dpi, _SIDE / max(figure.get_size_inches())))
    figure.savefig(to, format=kind, dpi=figure.dpi)  # matplotlib's default may be another dpi


def png(figure: Figure, resolution: float | None = None) -> bytes:
    """Return a figure as PNG, with a resolution [dpi], by default its own."""
    content = io.BytesIO()
    save(resolved(figure, resolution), content)
    return content.getvalue()
