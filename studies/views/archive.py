"""A study as one HTML file, for a mail or an archive: no server, no script, no other file."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.parameters import parameters_of
from studies.errors import StudyError
from studies.numbers import number_text
from studies.scenes.registry import known_names, scene_named
from studies.storage.dataset import attributes_of
from studies.views.columns import meaning_of, placed, unit_of, unit_text, value_text, with_unit
from studies.views.figures import FIGURES, group_of, meter, varies, worst
from studies.views.html import templates
from studies.views.picking import one_run, over_runs, sweep_axes, varied
from studies.views.plots.fields import line_fields, map_fields, sweep_fields, usual_field
from studies.views.plots.lines import line_figure
from studies.views.plots.maps import map_figure
from studies.views.plots.sheets import png
from studies.views.plots.sweep import sweep_figure
from studies.views.summary import values_text
from studies.views.tables import (
    BY_ACCURACY,
    FOOTNOTE,
    messages,
    place_of,
    run_cells,
    set_by_accuracy,
)

LISTED = 500
"""Largest number of runs in the table."""

DRAWN = 4
"""Largest number of numbers that are drawn over the sweep."""

SPELT = 12
"""Largest number of values of an axis that are all named."""

COLUMNS = 9
"""Largest number of columns of a part of the table that fit a page, beside those of the place."""

LINES = ("residual_profile", "line_stress", "contact_pressure")
"""Lines of the chosen run that are drawn, where it has them."""

ESTIMATED = "audit_error_residual"
"""The estimated error of residual stress."""

_DPI = 130


def archive(dataset: xr.Dataset, path: Path | str = "dataset.nc") -> str:
    """Return a study as an HTML document: what was computed, pictures, runs, audit, versions.

    Parameters
    ----------
    dataset : its data set, as `open_study` gives it
    path : where the reader finds the data set, as it is written: a path that was given relative to
        a folder says nothing of the machine
    """
    axes = [name for name in sweep_axes(dataset) if dataset.sizes[name] > 1]
    table = run_cells(dataset)
    keys = range(table.words)
    rest = range(table.words, len(table.headings))
    words, count = np.unique(dataset["status"].to_numpy().astype(str), return_counts=True)
    attrs = dataset.attrs
    return (
        templates("studies.views")
        .get_template("archive.html")
        .render(
            name=attrs["title"],
            scene=attrs["scene"],
            created=str(attrs.get("created", "")).replace("T", " ").removesuffix("+00:00") + " UTC",
            tags=str(attrs.get("tags", "")).split(),
            note=attrs.get("note", ""),
            counts=dict(zip(words.tolist(), count.tolist(), strict=True)),
            summary=_summary(str(attrs["scene"]), dataset["status"].size),
            axes=[_axis(dataset, name) for name in _varied(dataset)],
            parameters=_fixed(dataset),
            figures=[*_figures(dataset, axes)],
            table=table._replace(rows=table.rows[:LISTED]),
            left=max(len(table.rows) - LISTED, 0),
            blocks=[
                [*keys, *rest[first : first + COLUMNS]]
                for first in range(0, max(len(rest), 1), COLUMNS)
            ],
            footnote=FOOTNOTE.strip(),
            messages=messages(dataset).strip(),
            audit=[*_audit(dataset)],
            error=_error(dataset),
            made=_made(attrs),
            id=attrs.get("id", ""),
            path=path.as_posix() if isinstance(path, Path) else path,
        )
    )


def _summary(scene: str, size: int) -> str:
    runs = "1 run" if size == 1 else f"{size} runs"
    if scene not in known_names():
        return f"{runs} of the scene {scene}."
    about = scene_named(scene).summary.rstrip(".")
    return f"{runs}. {about[:1].upper()}{about[1:]}."


def _varied(dataset: xr.Dataset) -> list[str]:
    """Return the coordinates that differ between runs, without the numbers of points."""
    names = varied(dataset)
    numbered = {axis for name, axis in names.items() if name != axis}
    return [n for n in names if n not in numbered or dataset[n].dtype.kind not in "iuf"]


def _axis(dataset: xr.Dataset, name: str) -> dict[str, str]:
    """Return name, meaning, unit and values of an axis."""
    values = dataset[name]
    return {
        "name": name,
        "words": str(values.attrs.get("long_name", "")),
        "unit": unit_of(values),
        "text": values_text(values.to_numpy().tolist(), most=SPELT),
    }


def _fixed(dataset: xr.Dataset) -> list[dict[str, str]]:
    """Return name, meaning, unit and value of what all runs share: given, or axes of one value.

    Of what is left out it is the number that `accuracy` set, or its range.
    """
    given = json.loads(dataset.attrs.get("parameters", "{}"))
    given |= {n: dataset[n].item() for n in sweep_axes(dataset) if dataset.sizes[n] == 1}
    scene = str(dataset.attrs["scene"])
    known = parameters_of(scene_named(scene)) if scene in known_names() else {}
    left_out = set_by_accuracy(dataset)
    return [
        {
            "name": name,
            "words": known[name].description.replace("`", "") if name in known else "",
            "unit": unit_text(known[name].unit) if name in known else "",
            "value": left_out[name] if name in left_out else _exact(value),
            "set": BY_ACCURACY if name in left_out else "",
        }
        for name, value in given.items()
    ]


def _exact(value: Any) -> str:
    """Return a value as it was given; of a table what it is."""
    if value in (None, [], ""):
        return "none"
    return number_text(value, 10) if isinstance(value, float) else value_text(value)


def _figures(dataset: xr.Dataset, axes: list[str]) -> Iterator[dict[str, Any]]:
    """Yield pictures: the main numbers over the sweep, a map and lines of one run."""
    singles = [name for name in sweep_fields(dataset) if name != "status" and _is_main(name)]
    singles.sort(key=lambda name: name not in FIGURES)
    numbers = [name for name in singles if varies(dataset[name].to_numpy())] if axes else []
    for name in numbers[:DRAWN]:
        try:
            yield _figure(sweep_figure(dataset, name), _said(dataset[name]))
        except StudyError:  # such as a number that no run has
            continue
    try:
        run = one_run(dataset)
    except StudyError:  # no run succeeded
        return
    place = placed({name: run[name].item() for name in axes})
    where = f" of the run at {place}" if place else ""
    field = usual_field(run)
    if field in map_fields(run):
        component = "xx" if "component" in run[field].dims else None
        text = f"{_said(run[field])}{f', {component},' if component else ''}{where}"
        yield _figure(map_figure(run, field, component), text, whole=True)
    for name in LINES:
        if name in line_fields(run) and run[name].notnull().any():
            yield _figure(line_figure(run, name), f"{_said(run[name])}{where}")


def _figure(drawn: Any, words: str, whole: bool = False) -> dict[str, Any]:
    picture = b64encode(png(drawn, _DPI)).decode()
    return {"png": picture, "words": words[:1].upper() + words[1:], "whole": whole}


def _is_main(name: str) -> bool:
    """Whether a number tells of the result: not of the effort, the audit, or a position."""
    return group_of(name) == "result" and not re.search(r"^depth_of_|_[xyzs]$", name)


def _audit(dataset: xr.Dataset) -> Iterator[dict[str, Any]]:
    """Yield the largest value of each figure of the audit, its limit, and its run."""
    for each in worst({name: each.to_numpy() for name, each in over_runs(dataset).items()}):
        yield {
            "name": each.name,
            "words": str(attributes_of(each.name).get("long_name", each.name)),
            "value": value_text(each.value),
            "limit": value_text(each.limit),
            "percent": round(100.0 * meter(each.value, each.limit), 1),
            "place": place_of(dataset, np.unravel_index(each.at, dataset["status"].shape)),
        }


def _error(dataset: xr.Dataset) -> dict[str, str]:
    """Return the largest estimated error of residual stress, and its run; empty if none is known.

    It has no limit, so that it is no figure of `worst`. Zero is that of bodies without residual
    stress.
    """
    if ESTIMATED not in dataset or not (dataset[ESTIMATED] > 0.0).any():
        return {}
    values = dataset[ESTIMATED].transpose(*sweep_axes(dataset)).to_numpy()
    at = np.unravel_index(np.nanargmax(values), values.shape)
    return {
        "name": ESTIMATED,
        "percent": number_text(100.0 * values[at], 3),
        "place": place_of(dataset, at),
    }


def _made(attrs: Mapping[Any, Any]) -> dict[str, str]:
    """Return versions and other marks of what computed the runs."""
    found = {"study": attrs.get("id"), "computed": attrs.get("created"), "by": attrs.get("source")}
    found |= {"linear solver": attrs.get("linear_solver"), "commit": attrs.get("commit")}
    found["sources of the solver"] = attrs.get("solver_source")
    found |= json.loads(attrs.get("versions", "{}"))
    return {name: str(value) for name, value in found.items() if value}


def _said(values: xr.DataArray) -> str:
    return with_unit(meaning_of(values), unit_of(values))
