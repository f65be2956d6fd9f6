"""Draw what a fit has found over what was measured."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from solver.results.quantities import QUANTITIES
from studies.numbers import number_text
from studies.views.columns import unit_of, words
from studies.views.plots.captions import axis_label, label, wrapped
from studies.views.plots.sheets import add_head, plain_axes

_PANEL = (4.6, 4.4)
"""Width and height of a line with its differences [in]."""
_ABREAST = 4
"""Largest number of lines beside one another."""
_LINE, _MARKS = "#D55E00", "0.35"


def fit_figure(dataset: xr.Dataset) -> Figure | None:
    """Return two panels for each measured line: it and the run found, and their differences.

    None if there is no answer.
    """
    if not dataset["fitted"].notnull().all():
        return None
    count = dataset.sizes["lines"]
    abreast = min(count, _ABREAST)
    rows = math.ceil(count / abreast)
    size = _PANEL[0] * abreast, _PANEL[1] * rows + 0.7
    sheet = Figure(figsize=size, dpi=130, layout="constrained")
    grid = sheet.subplots(2 * rows, abreast, squeeze=False, height_ratios=(3, 1) * rows)
    pairs = np.reshape(grid, (rows, 2, abreast)).swapaxes(1, 2).reshape(-1, 2)
    for k, panels in enumerate(pairs):
        if k < count:
            own = dataset.isel(row=np.flatnonzero(dataset["line"] == k))
            _draw(panels, own, dataset.isel(lines=k))
        else:
            for axes in panels:
                axes.set_axis_off()
    found = [f"{words(n)} {_sure(dataset, n)}" for n in map(str, dataset["parameter"].to_numpy())]
    below = wrapped(" · ".join(found), size[0] - 0.4, 8)
    add_head(sheet, f"Fit {dataset.attrs['title']}", below)
    return sheet


def _draw(panels: np.ndarray, rows: xr.Dataset, line: xr.Dataset) -> None:
    """Draw a measured line and its differences."""
    above, below = panels
    above.sharex(below)
    above.tick_params(labelbottom=False)
    over, of = line["line_over"].item(), line["line_of"].item()
    x = rows["place"].to_numpy() if over else np.arange(rows.sizes["row"])
    measured, sigma, fitted = (
        rows[name].to_numpy() for name in ("measured", "measured_sigma", "fitted")
    )
    above.errorbar(
        x, measured, sigma, fmt="o", color=_MARKS, markersize=3.0, linewidth=0.8, label="measured"
    )
    above.plot(x, fitted, "-" if over else "_", color=_LINE, linewidth=1.5, label="fitted")
    above.set_ylabel(wrapped(label(_declared(of)), _PANEL[1] * 0.7, 10))
    below.axhspan(-1.0, 1.0, color="0.93")
    below.axhline(0.0, color="0.2", linewidth=0.8)
    below.plot(x, (measured - fitted) / sigma, "o", color=_MARKS, markersize=3.0)
    below.set_ylabel(r"difference / $\sigma$")
    across = axis_label(_declared(over)) if over else "number of the value"
    below.set_xlabel(wrapped(across, _PANEL[0] - 0.8, 10))
    if not over:
        below.set_xticks(x)
    if at := line["line_at"].item():
        above.set_title(words(at.replace(" = ", " ")), fontsize=8, loc="left", color="0.3")
    above.legend(frameon=False, fontsize=8)
    for axes in (above, below):
        plain_axes(axes)


def _declared(name: str) -> xr.DataArray:
    """Return a variable without values, with its meaning and unit."""
    known = QUANTITIES[name].attributes if name in QUANTITIES else {"long_name": words(name)}
    return xr.DataArray(name=name, attrs=known)


def _sure(dataset: xr.Dataset, name: str) -> str:
    """Return the value of a parameter and its standard deviation."""
    value, sigma = dataset[name].item(), dataset[f"{name}_sigma"].item()
    return f"{number_text(value)} ± {number_text(sigma, 2)} {unit_of(dataset[name])}".rstrip()
