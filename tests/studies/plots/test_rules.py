"""Pages draw by the rules of figures."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib import colormaps
from matplotlib.colors import to_rgb

from studies.views.rules import NUMBERS, SEQUENTIAL, SIGNED, scale
from studies.views.shown import outline


@pytest.mark.parametrize("name", [SIGNED, SEQUENTIAL, NUMBERS])
def test_pages_have_the_colours_of_figures(name: str) -> None:
    """To what 256 steps of a colour map, and eight bits of a colour, round."""
    found = np.array([to_rgb(each) for each in scale(name)])
    wanted = colormaps[name](np.linspace(0.0, 1.0, len(found)))[:, :3]
    np.testing.assert_allclose(found, wanted, atol=2.5 / 255)


def test_each_line_has_its_picture_and_residual_stress_comes_first() -> None:
    one = {"status": ((), "ok"), "x": ("x", [0.0, 1.0]), "depth": ("depth", [0.0, 1.0])}
    lines = {
        "residual_profile": "depth", "plastic_profile": "depth",
        "surface_residual": "x", "contact_pressure": "s", "force": "increment",
    }  # fmt: skip
    run = xr.Dataset(one | {name: (dim, [1.0, 2.0]) for name, dim in lines.items()})
    found = {each["name"]: each for each in outline(run)["lines"]}
    pictures = {name: each["pictures"][0] for name, each in found.items()}
    assert pictures == {
        "residual_profile": "depth", "plastic_profile": "depth", "surface_residual": "contact",
        "contact_pressure": "contact", "force": "history",
    }  # fmt: skip
    assert all("line" in each["pictures"] for each in found.values())
    usual = {name: each["usual"] for name, each in found.items() if each["usual"]}
    assert usual == {
        "residual_profile": ["depth"], "surface_residual": ["line"], "contact_pressure": ["contact"]
    }  # fmt: skip
