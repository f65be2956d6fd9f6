"""Figures as files."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from studies.views.plots.sheets import png, save


@pytest.mark.parametrize(
    ("size", "resolution", "dots"),
    [
        ((2.0, 1.0), None, (260, 130)),
        ((2.0, 1.0), 300, (600, 300)),
        ((0.5, 640.0), 300, (25, 32768)),
    ],
)
def test_a_picture_has_its_resolution_or_what_its_size_allows(
    size: tuple[float, float], resolution: float | None, dots: tuple[int, int], tmp_path: Path
) -> None:
    content = png(Figure(figsize=size, dpi=130), resolution)
    assert struct.unpack(">2I", content[16:24]) == dots
    figure = Figure(figsize=size, dpi=resolution or 130)
    save(figure, tmp_path / "figure")
    assert (tmp_path / "figure").read_bytes() == content
