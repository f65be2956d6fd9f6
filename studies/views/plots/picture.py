"""Choose the figure of a field: over the sweep, or a map or lines of one run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import xarray as xr
from matplotlib.figure import Figure

from studies.errors import StudyError, one_of
from studies.kinds.kind import Kind
from studies.views.picking import (
    file_of,
    one_run,
    point_axes,
    positions,
    runs_over,
    select,
    study_of,
    sweep_axes,
    sweep_coordinates,
)
from studies.views.plots.fields import (
    DRAWN,
    Window,
    check_field,
    component_of,
    labelled_fields,
    line_axis,
    line_fields,
    map_fields,
    sweep_fields,
    usual_field,
)
from studies.views.plots.lines import line_figure
from studies.views.plots.mapped import MESH_MAPS, STAGE, mesh_maps
from studies.views.plots.maps import map_figure
from studies.views.plots.runs import number_over
from studies.views.plots.sheets import png, resolved
from studies.views.plots.sweep import sweep_figure
from studies.views.reading import find_study, open_netcdf
from studies.views.solution import keeps

Chosen = TypeVar("Chosen", bound=str | float)


def picture(
    dataset: xr.Dataset,
    field: str | None = None,
    component: str | None = None,
    zoom: float | None = None,
    selection: Mapping[str, str | float] | None = None,
    *,
    window: Window | None = None,
    over: str | None = None,
    against: str | None = None,
    deformed: float | None = None,
    resolution: float | None = None,
) -> Figure:
    """Return a figure of `field`, by default of residual stress (of stress, if none is kept).

    Parameters
    ----------
    dataset : data set of a study or of a run
    field : a variable with one value per run (for each body, component or point), or over the
        bodies, their surface or depth
    component : component of a stress tensor; by default the first
    zoom : show only the part within this distance of the contact's centre or edge, or of the
        surface [mm]
    selection : value for each selected axis of the sweep, parameter set by a linked axis, or
        dimension of the field, such as ``pass``
    window : show only this part
    over : for lines: axis of the sweep, or dimension of the field; each of its values has a line
    against : for lines over increments: the variable over which they are drawn
    deformed : for a map of a run that keeps its fields: factor of the displacements
    resolution : dots per inch; by default that of the figure

    Raises
    ------
    StudyError
        if there is no such field, component, axis or value, or nothing to show
    """
    maps, lines, singles = map_fields(dataset), line_fields(dataset), sweep_fields(dataset)
    labelled = labelled_fields(dataset)
    field = field or usual_field(dataset)
    given = {
        "component": component, "zoom": zoom, "window": window, "over": over, "against": against,
        "deformed": deformed,
    }  # fmt: skip
    alone = {"over": over, "against": against}
    if field in singles:
        _refuse(given, f"{field} has one value a run: leave it out")
        figure = sweep_figure(select(dataset, selection or {}), field)
    elif field in labelled and not (field in lines and (over or _single(dataset, selection or {}))):
        _refuse(given | {"component": None}, f"{field} has one value a run: leave it out")
        figure = sweep_figure(_labelled(dataset, field, component, selection or {}), field)
    elif field in mesh_maps(dataset):
        _refuse(alone, f"{field} is a map of one run: leave it out")
        swept, chosen = sweep_coordinates(dataset), dict(selection or {})
        _known(chosen, [*swept, STAGE])
        stage = chosen.pop(STAGE, None)
        run = one_run(dataset, chosen)
        staged = None if stage is None else str(stage)
        figure = map_figure(run, field, component, zoom, window, staged, deformed or 0.0)
    else:
        one_run(dataset)  # without a successful run there are no fields: report the reason
        check_field(field, [*maps, *lines, *singles, *labelled])
        if field in maps:
            _refuse(alone, f"{field} is a map of one run: leave it out")
            part = _part(dataset, field, selection or {})
            figure = map_figure(part, field, component, zoom, window, deformed=deformed or 0.0)
        else:
            _refuse({"deformed": deformed}, f"{field} is no map: leave it out")
            own = _own(dataset, field)
            swept = sweep_coordinates(dataset)
            axis = None if over in own or over is None else swept.get(over)
            if axis is None and over not in (None, *own):
                raise StudyError("over", over, one_of(over, [*swept, *own]))
            part = _part(dataset, field, selection or {}, axis, against)
            if axis is not None:  # colours are those of a parameter, not of numbers of points
                if over in point_axes(dataset):
                    over = str(number_over(part, axis).name)
                part = part if over == axis else part.swap_dims({axis: over})
            figure = line_figure(part, field, component, zoom, over, window, against)
    return resolved(figure, resolution)


def _refuse(given: Mapping[str, object], allowed: str) -> None:
    """Raise a `StudyError` for the first option that is given: it does not apply to the field."""
    for name, value in given.items():
        if value is not None:
            raise StudyError(name, value, allowed)


def _single(dataset: xr.Dataset, selection: Mapping[str, str | float]) -> bool:
    """Whether the selection leaves one run."""
    return bool(select(dataset, _swept(dataset, selection))["status"].size == 1)


def _swept(dataset: xr.Dataset, selection: Mapping[str, Chosen]) -> dict[str, Chosen]:
    """Return the part of a selection that is one of runs, not of dimensions of a field."""
    known = sweep_coordinates(dataset)
    return {name: value for name, value in selection.items() if name in known}


def _labelled(
    dataset: xr.Dataset, field: str, component: str | None, selection: Mapping[str, str | float]
) -> xr.Dataset:
    """Return the selected part of a study, with `field` at one value of each of its dimensions.

    By default it is the first label or the last number, of each run the last that it has.
    """
    values = component_of(dataset[field], component)
    swept = sweep_coordinates(dataset)
    own = [str(name) for name in values.dims if name not in swept.values()]
    _known(selection, [*swept, *own])
    for name in own:
        if name in selection:
            values = values.isel({name: positions(values[name], selection[name])[0]})
        elif values[name].dtype.kind in "fiu":
            values = _last(values, name)
        else:
            values = values.isel({name: 0})
    runs = dataset[["status", "message"]].assign({field: values})
    return select(runs, _swept(dataset, selection))


def _last(values: xr.DataArray, name: str) -> xr.DataArray:
    """Return of each run the last value along a dimension: not all have as many cycles."""
    ends = (
        values.sizes[name] - 1 - values.notnull().isel({name: slice(None, None, -1)}).argmax(name)
    )
    last = ends.where(values.notnull().any(name), values.sizes[name] - 1).astype(int)
    if (last == values.sizes[name] - 1).all():
        return values.isel({name: -1})
    meaning = f"{values.attrs.get('long_name', values.name)}, in the last {name} of each run"
    return values.isel({name: last}).drop_vars(name).assign_attrs(long_name=meaning)


def _known(selection: Mapping[str, object], names: list[str]) -> None:
    """Raise a `StudyError` if the selection has an unknown name."""
    for name, value in selection.items():
        if name not in names:
            raise StudyError(name, value, one_of(name, names))


def _own(dataset: xr.Dataset, *fields: str | None) -> list[str]:
    """Return the dimensions of fields of which values can be selected, beside the sweep."""
    swept = sweep_coordinates(dataset).values()
    along = {line_axis(dataset[field], [*swept]) for field in fields if field in dataset}
    drawn = {*swept, *DRAWN, *along, "component"}
    known = [name for field in fields if field in dataset for name in dataset[field].dims]
    return [str(name) for name in dict.fromkeys(known) if name not in drawn]


def _part(
    dataset: xr.Dataset,
    field: str,
    selection: Mapping[str, str | float],
    over: str | None = None,
    against: str | None = None,
) -> xr.Dataset:
    """Return one of the selected runs, or one for each value of the axis `over`.

    The selection is also applied to the own dimensions of the field, and of what it is drawn over.
    """
    swept, own = sweep_coordinates(dataset), _own(dataset, field, against)
    _known(selection, [*swept, *own])
    chosen = _swept(dataset, selection)
    if over is None:
        run = one_run(dataset, chosen)
    else:
        along = line_axis(dataset[field], sweep_axes(dataset))
        run = runs_over(dataset, over, chosen, field, along)
    return run.isel(
        {name: positions(run[name], selection[name]) for name in own if name in selection}
    )


@contextmanager
def drawn_from(
    path: Path | str, dataset: xr.Dataset, field: str | None, selection: Mapping[str, str]
) -> Iterator[tuple[xr.Dataset, Mapping[str, str]]]:
    """Give the data set from which a field is drawn, and what is still to be selected of it.

    It is that of the study, or the file of the selected run if the study keeps fields and the field
    is a map: data sets of studies do not have the meshes of their runs.
    """
    found = _run_of(path, dataset, field or usual_field(dataset), selection)
    if found is None:
        yield dataset, selection
        return
    swept, chosen = sweep_coordinates(dataset), _swept(dataset, selection)
    with open_netcdf(found) as own:
        left = {name: value for name, value in selection.items() if name not in swept}
        of = one_run(dataset, chosen)  # what distinguishes the run stands in the caption
        run = one_run(own)
        run = run.assign_coords({name: of[name] for name in swept if name not in run.variables})
        yield (run, left) if keeps(run) else (dataset, selection)


def _run_of(
    path: Path | str, dataset: xr.Dataset, field: str, selection: Mapping[str, str]
) -> Path | None:
    if isinstance(path, str) or keeps(dataset) or field not in MESH_MAPS:
        return None
    found = find_study(path)
    if found.name != "dataset.nc" or not found.with_name("study.json").is_file():
        return None
    try:
        study, store = study_of(found)
    except StudyError:  # of another version of the solver: its runs are not found by their ids
        return None
    if not study.keep:
        return None
    return file_of(dataset, study, store, _swept(dataset, selection))


def report_pictures(dataset: xr.Dataset, kind: Kind, path: Path | None) -> dict[str, bytes]:
    """Return the picture of a report as PNG by the name of its file; none if none can be drawn.

    Of a study that chose its runs it shows what was found; else the residual stress of the run of
    `one_run`, or the stress if bodies are not unloaded. With the path of the data set it is drawn
    on the mesh of the run, which its own file has.
    """
    try:
        if kind.chooses:
            name = kind.name if kind.figure else kind.value
            figure = kind.figure(dataset) if kind.figure else sweep_figure(dataset, kind.value)
        else:
            name = f"{(field := usual_field(dataset))}_xx"
            with drawn_from(path or "", dataset, field, {}) as (run, _):
                figure = map_figure(run, field, "xx")
    except StudyError:
        return {}
    return {f"{name}.png": png(figure)} if figure else {}
