"""What is drawn over maps of a body on which a wheel rolls: shear and slip, and the wheel."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from solver.model.friction import PatchStatus
from studies.views.plots.fields import Window, map_axes
from studies.views.plots.mapped import STATUS

_SHEAR, _SLIP = "patch_shear", "patch_slip"
_ARROWS = 16
"""Number of arrows over the side of a square as large as what is shown."""
BELOW = -40.0
"""Place of words below a map, under the name of its axis [pt]."""
_WHEEL, _UP, _ABOVE = "wheel_surface", "y", 3.0
"""The profile of the wheel, its height, and how far above the body it is shown [mm]."""


def draw_patch(axes: Axes, run: xr.Dataset, field: str, window: Window) -> None:
    """Draw the border of the contact, that of stick, and arrows of shear, or of slip over slip."""
    status = run[STATUS]
    across, up = map_axes(status)
    lines = [
        (status != PatchStatus.OPEN, "k", "edge of contact"),
        (status == PatchStatus.STICK, "b", "edge of stick"),
    ]
    handles = []
    for inside, colour, name in lines:
        if inside.any() and not inside.all():
            axes.contour(
                status[across], status[up], inside.astype(float), levels=[0.5], colors=colour,
                linewidths=1.2,
            )  # fmt: skip
            handles.append(Line2D([], [], color=colour, linewidth=1.2, label=name))
    kind = _SLIP if field.startswith(_SLIP) else _SHEAR
    arrows = [run[f"{kind}_{axis}"].where(status != PatchStatus.OPEN) for axis in (across, up)]
    longest = float(np.sqrt(sum(each**2 for each in arrows)).max())
    if longest > 0.0:
        step = np.sqrt((window[1] - window[0]) * (window[3] - window[2])) / _ARROWS
        some = {
            name: slice(None, None, max(1, round(step / float(np.diff(status[name])[0]))))
            for name in (across, up)
        }
        u, v = (each.isel(some) for each in arrows)
        axes.quiver(
            u[across], u[up], u, v, units="xy", angles="xy", scale_units="xy",
            scale=longest / (1.2 * step), width=step / 12, color="0.1",
        )  # fmt: skip
        unit = arrows[0].attrs.get("units", "1")
        name = f"{kind.removeprefix('patch_')} on the surface, at most {longest:.3g}"
        label = name if unit == "1" else f"{name} {unit}"
        handles.append(Line2D([], [], color="0.1", marker=r"$\rightarrow$", ls="none", label=label))
    down = ScaledTranslation(0.0, BELOW / 72.0, axes.figure.dpi_scale_trans)
    axes.legend(  # not on the map: a contact that is long one way leaves no corner free
        handles=handles, loc="upper left", bbox_to_anchor=(0.0, 0.0, 1.0, 0.0), frameon=False,
        bbox_transform=axes.transAxes + down, borderpad=0.0, borderaxespad=0.0, fontsize=8,
    )  # fmt: skip


def draw_wheel(axes: Axes, values: xr.DataArray, run: xr.Dataset) -> None:
    """Draw the profile of the wheel above a section, if the run has one and the top is shown."""
    across, up = map_axes(values)
    if up != _UP or _WHEEL not in run or float(values[up][-1]) < 0.0:
        return
    bottom, _ = axes.get_ylim()
    axes.plot(run[across], run[_WHEEL], color="k", linewidth=1.2, label="wheel before contact")
    axes.set_ylim(bottom, _ABOVE)
    axes.legend(loc="lower right", framealpha=0.9, edgecolor="none", fontsize=8)
