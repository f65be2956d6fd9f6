"""Fit parameters of runs to what was measured, and print what was found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.study import Study
from studies.errors import StudyError
from studies.execution.run import run_study
from studies.kinds.fit.fitting import NO_FIT, Fit
from studies.kinds.kind import Found
from studies.storage.store import Store
from studies.views.columns import aligned, or_none, unit_text, value_text
from studies.views.reading import open_study

_ENDS = {"value": "", "sigma": "_sigma", "lowest": "_low", "highest": "_high"}
"""What is known of a parameter, and how the names of its variables end."""


def fit(study: Study | Mapping[str, Any], store: Store, **options: Any) -> xr.Dataset:
    """Return the parameters with which runs come closest to measured lines, and how sure they are.

    Parameters
    ----------
    study : a study with an entry ``fit``, or the content of a study file
    store : the store of runs: those that are there are not computed again
    options : of `run_study`

    Raises
    ------
    StudyError
        if the study has no fit, or as `run_study` does
    """
    own = study if isinstance(study, Study) else Study.from_dict(study, options.pop("scene", None))
    if own.kind.name != Fit.name:
        raise StudyError("fit", None, NO_FIT)
    return open_study(run_study(own, store, **options).dataset)


def told(dataset: xr.Dataset) -> dict[str, Any]:
    """Return what was found as JSON has it, without the lines over which it was fitted."""
    names = [str(name) for name in dataset["parameter"].to_numpy()]
    parameters: dict[str, dict[str, Any]] = {
        name: {key: or_none(dataset[f"{name}{end}"].item()) for key, end in _ENDS.items()}
        for name in names
    }
    for name, row in zip(names, dataset["correlation"].to_numpy().tolist(), strict=True):
        parameters[name]["unit"] = dataset[name].attrs.get("units", "")
        parameters[name]["correlation"] = dict(zip(names, map(or_none, row), strict=True))
    about = ("status", "message", "condition", "misfit", "runs")
    return {key: or_none(dataset[key].item()) for key in about} | {"parameters": parameters}


def fit_rows(dataset: xr.Dataset) -> list[list[str]]:
    """Return the headings, and a line for each parameter that was fitted."""
    rows = [["parameter", "value", "sigma", "lowest", "highest", "unit"]]
    for name in map(str, dataset["parameter"].to_numpy()):
        numbers = [value_text(dataset[f"{name}{end}"].item()) for end in _ENDS.values()]
        rows.append([name, *numbers, dataset[name].attrs.get("units", "")])
    return rows


def measures(dataset: xr.Dataset) -> str:
    """Return how well the fit tells its parameters, and what it took."""
    names = ("condition", "misfit", "runs")
    return ", ".join(f"{name} {value_text(dataset[name].item())}" for name in names)


def found(dataset: xr.Dataset, _: Mapping[str, Any]) -> Found:
    """Return the parameters of a fit with what is known of them."""
    headings, *rows = fit_rows(dataset)
    place = {}
    for name in map(str, dataset["parameter"].to_numpy()):
        value, sigma = dataset[name].item(), dataset[f"{name}_sigma"].item()
        ends = (None, None) if np.isnan(sigma) else (value - sigma, value + sigma)
        place[name] = (value, *ends)
    return Found(
        about=[f"{measures(dataset)}; marks are drawn with one sigma."],
        warning=str(dataset["message"].item()),
        headings=headings,
        units=[""] * len(headings),
        rows=[[*row[:-1], unit_text(row[-1])] for row in rows],
        words=1,
        marks=[] if any(np.isnan(value) for value, *_ in place.values()) else [place],
    )


def fit_table(dataset: xr.Dataset) -> str:
    """Return what was found: a line for each parameter, and how they go together."""
    names = [str(name) for name in dataset["parameter"].to_numpy()]
    text = aligned(fit_rows(dataset), 1)
    if len(names) > 1:
        table = dataset["correlation"].to_numpy()
        rows = [["correlation", *names]]
        rows += [[name, *(f"{x:.3f}" for x in row)] for name, row in zip(names, table, strict=True)]
        text += f"\n\n{aligned(rows, 1)}"
    return f"{text}\n\n{measures(dataset)}"
