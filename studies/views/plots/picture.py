"""The figure that suits a field: over the sweep, or a map or lines of one run."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr
from matplotlib.figure import Figure

from studies.errors import StudyError
from studies.scenes.registry import one_of
from studies.views.plots.fields import (
    ALONG,
    MAP,
    check_field,
    line_fields,
    map_fields,
    sweep_fields,
)
from studies.views.plots.lines import line_figure
from studies.views.plots.maps import map_figure
from studies.views.plots.sweep import sweep_figure
from studies.views.reading import one_run, positions, select, sweep_coordinates


def picture(
    dataset: xr.Dataset,
    field: str,
    component: str | None = None,
    zoom: float | None = None,
    selection: Mapping[str, str | float] | None = None,
) -> Figure:
    """Return a figure of `field`.

    Parameters
    ----------
    dataset : of a study or of a run
    field : a variable with one value a run, or one over the bodies, their surface or depth
    component : of a stress tensor; the first one by default
    zoom : show only what lies within this distance of the contact's centre or edge, or of the
        surface [mm]
    selection : axis of the sweep, parameter set by a linked axis, or dimension of the field, such
        as ``pass`` -> wanted value

    Raises
    ------
    StudyError
        when there is no such field, component, axis or value, or nothing to show
    """
    maps, lines, singles = map_fields(dataset), line_fields(dataset), sweep_fields(dataset)
    if field in singles:
        for name, given in {"component": component, "zoom": zoom}.items():
            if given is not None:
                raise StudyError(name, given, f"{field} has one value a run: leave it out")
        return sweep_figure(select(dataset, selection or {}), field)
    one_run(dataset)  # where no run succeeded there are no fields: say why
    check_field(field, [*maps, *lines, *singles])
    make = map_figure if field in maps else line_figure
    return make(_part(dataset, field, selection or {}), field, component, zoom)


def _part(dataset: xr.Dataset, field: str, selection: Mapping[str, str | float]) -> xr.Dataset:
    """Return one run of those selected, cut along the field's own dimensions."""
    swept = sweep_coordinates(dataset)
    drawn = {*swept.values(), *MAP, *ALONG, "component"}
    own = [str(name) for name in dataset[field].dims if name not in drawn]
    known = [*swept, *own]
    for name, value in selection.items():
        if name not in known:
            raise StudyError(name, value, one_of(name, known))
    run = one_run(dataset, {name: selection[name] for name in swept if name in selection})
    return run.isel(
        {name: positions(run[name], selection[name]) for name in own if name in selection}
    )
