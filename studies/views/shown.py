"""What of a run can be shown, and the values that are shown, without drawing them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from solver.results.quantities import QUANTITIES
from solver.tensors import AXES
from studies.errors import StudyError
from studies.views.best import column_over
from studies.views.columns import meaning_of, unit_of
from studies.views.plots.captions import DISTANCE
from studies.views.plots.fields import (
    REPEATED,
    check_field,
    component_names,
    component_of,
    depth_shown,
    floor_of,
    line_axis,
    line_fields,
    map_axes,
    map_fields,
    placed,
    usual_field,
    without_rounding,
)
from studies.views.plots.mapped import mapped
from studies.views.written import as_csv

_LENGTH = 1e-9
"""Largest value of lines, such as displacements [mm], that are only rounding."""
_COURSES = ("increment", *REPEATED)
"""Dimensions of lines over time."""
_FIRST = {"depth": "residual_profile", "contact": "pressure", "line": "surface_residual"}
"""What a picture of lines shows first: a part of the name of a variable."""


class Shown(NamedTuple):
    """The values of a picture.

    Attributes
    ----------
    head : what they are: meaning, unit, labels of the dimensions that are no coordinates
    values : NaN where there is no value
    places : names of their coordinates, which are those of the last dimensions
    """

    head: dict[str, Any]
    values: xr.DataArray
    places: tuple[Hashable, ...]

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The coordinates, and the values over them, by name."""
        field, values = self.head["name"], self.values
        return {str(n): values[n].to_numpy() for n in self.places} | {field: values.to_numpy()}

    def as_csv(self) -> Iterator[bytes]:
        """Yield a line for each value: where it is, then the value."""
        values = self.values
        names = [*values.dims[: -len(self.places)], *self.places]
        there = values.notnull().to_numpy()
        at = [values[name].broadcast_like(values).transpose(*values.dims) for name in names]
        every = (*at, values.rename(self.head["name"]))
        columns = [column_over(each, each.to_numpy()[there], "point") for each in every]
        yield from as_csv(columns, np.arange(there.sum()))


def outline(run: xr.Dataset) -> dict[str, list[dict[str, Any]]]:
    """Return the variables of a run that are drawn as maps and as lines, with their labels.

    The usual field of a map comes first, and stress of lines; what is only rounding comes last. Of
    lines `along` is the dimension along which they go; `pictures` are those of a run that can show
    them, `usual` those that show them first.
    """
    first, sweep = usual_field(run), run["status"].dims
    lines = [name for name in line_fields(run) if run[name].notnull().any()]
    maps = sorted(map_fields(run), key=lambda name: name != first)
    return {
        "maps": [_described(run, name) for name in maps if run[name].notnull().any()],
        "lines": [
            _described(run, name) | _pictures(name, line_axis(run[name], sweep))
            for name in sorted(lines, key=lambda name: _rank(run[name], run))
        ],
    }


def _pictures(name: str, along: str | None) -> dict[str, Any]:
    """Return the pictures of a run that show a line: of the contact, below it, over time, any."""
    kind = "depth" if along == "depth" else "history" if along in _COURSES else "contact"
    usual = [part for part, word in _FIRST.items() if word in name and part in (kind, "line")]
    return {"along": along, "pictures": [kind, "line"], "usual": usual}


def _rank(values: xr.DataArray, run: xr.Dataset) -> int:
    """Return the place of a line among others."""
    if float(abs(values).max()) <= max(floor_of(values, run), _LENGTH):
        return 2
    name = str(values.name)
    return 0 if name.startswith("residual_") or name.endswith("stress") else 1


def shown(
    run: xr.Dataset,
    field: str,
    component: str | None = None,
    stage: str | None = None,
    minus: xr.Dataset | None = None,
) -> Shown:
    """Return the values of a map or of lines of one run.

    Parameters
    ----------
    run : data set of one run, as `one_run` returns it
    field : a variable of `outline`
    component : component of a tensor; by default the first
    stage : of a map with several stages; by default the last
    minus : another run, whose map is subtracted at the points of this one

    Raises
    ------
    StudyError
        if the run has no such field, component or stage, or the map of the other is over other axes
    """
    if field in map_fields(run):
        return _map(run, field, component, stage, minus)
    check_field(field, [*map_fields(run), *line_fields(run)])
    if stage is not None or minus is not None:
        name = "stage" if stage is not None else "minus"
        raise StudyError(name, stage or field, f"is for maps, and {field} is lines: leave it out")
    return _lines(run, field, component)


def _map(
    run: xr.Dataset, field: str, component: str | None, stage: str | None, minus: xr.Dataset | None
) -> Shown:
    drawn = mapped(run, field, component, stage=stage)
    values, signed, high = drawn.values, drawn.signed, drawn.high
    across, up = map_axes(values)
    if minus is not None:
        other = mapped(minus, field, component, stage=stage).values
        if map_axes(other) != (across, up):
            own, its = (", ".join(each) for each in ((across, up), map_axes(other)))
            raise StudyError("minus", field, f"is over {its} in the other run, and over {own} here")
        places = {name: values[name] for name in (across, up)}
        same = all(np.array_equal(other[name], each) for name, each in places.items())
        values = values - (other if same else other.interp(places))
        there = values.notnull().any()  # or the two have no place in common
        signed, high = True, float(abs(values).quantile(0.998)) if there else 1.0
    edge = float(run["contact_half_width"]) if "contact_half_width" in run else 0.0
    head = _described(run, field) | {
        "kind": "map",
        "across": _axis(run, across),
        "up": _axis(run, up),
        "signed": signed,
        "high": high or 1.0,
        "note": "" if minus is not None else drawn.note,
        "smooth": drawn.smooth,
        "edge": edge if edge > 0.0 and across == "x" else None,
    }
    return Shown(head, values.transpose(up, across), (across, up))


def _lines(run: xr.Dataset, field: str, component: str | None) -> Shown:
    values = without_rounding(placed(component_of(run[field], component), run), run)
    along = line_axis(values)
    assert along is not None
    for name in values.dims:
        values = values.dropna(name, how="all")
    others = [name for name in values.dims if name != along]
    if along == "depth" and values.size:
        values = values.isel(depth=slice(depth_shown(values, others)))
    at = DISTANCE if DISTANCE in values.coords else along
    values = values.transpose(*others, along)
    head = _described(run, field) | {
        "kind": "lines",
        "along": _axis(values, at),
        "over": [_labels(values, name) for name in others],
    }
    return Shown(head, values, (at,))


def _described(run: xr.Dataset, name: str) -> dict[str, Any]:
    """Return name, meaning and unit of a variable, and its components and stages."""
    values = run[name]
    own = {"stage": _labels(run, "stage")["labels"]}
    flags = str(values.attrs.get("flag_meanings", "")).split()
    if "component" in values.dims:
        own["component"] = component_names(values)
    return {
        "name": name,
        "words": meaning_of(values),
        "unit": unit_of(values),
        **{f"{each}s": labels for each, labels in own.items() if each in values.dims},
        **({"flags": flags} if flags else {}),
    }


def _axis(run: xr.Dataset | xr.DataArray, name: Hashable) -> dict[str, Any]:
    words = str(name) if name in AXES else str(run[name].attrs.get("long_name", name))
    quantity = QUANTITIES.get(str(name))
    whole = quantity is not None and quantity.count
    return {"name": str(name), "words": words, "unit": unit_of(run[name]), "whole": whole}


def _labels(values: xr.Dataset | xr.DataArray, name: Hashable) -> dict[str, Any]:
    known = values[name].to_numpy().tolist() if name in values.coords else []
    return {"name": str(name), "labels": known, "unit": unit_of(values[name]) if known else ""}
