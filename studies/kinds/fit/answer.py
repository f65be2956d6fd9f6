"""What a fit finds: the data set of its answer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from studies.definition.identity import canonical
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK, STOPPED
from studies.kinds.fit.certainty import Certainty, certainty
from studies.kinds.fit.fitting import Fitting
from studies.kinds.kind import Answers
from studies.kinds.replayed import FAILED
from studies.storage import dataset as layout
from studies.storage.dataset import Variable
from studies.storage.runfile import described

NOT_FOUND = "not_converged"
"""Status of a fit that ended before it found the smallest sum."""


def answers(study: Study, programs: list[Fitting]) -> Answers:
    """Return the answer of a fit."""
    (program,) = programs
    answer = program.answer
    known = certainty(program.asked, answer) if answer and answer.jacobian is not None else None
    status, message = _outcome(program, known)
    rows = [row for row in program.rows.values() if row]
    return Answers(
        content=lambda: _content(study, program, known, (status, message)),
        outcomes=[("", status, message)],
        of=canonical([status, message, rows, sorted(program.refusals.values())]),
    )


def _outcome(program: Fitting, known: Certainty | None) -> tuple[str, str]:
    """Return the status of a fit, and the reason, or what there is to say of the answer."""
    if not program.reason:
        return MISSING, STOPPED
    bounds = [
        f"{name} is at its {'lowest' if share <= 0.0 else 'highest'} value"
        for name, share in zip(program.asked.ranges, program.answer.shares, strict=True)
        if not 1e-4 < share < 1.0 - 1e-4
    ] if program.answer else []  # fmt: skip
    told = [program.message, known.warning if known else "", *bounds]
    status = OK if not program.message else MISSING if program.reason == FAILED else NOT_FOUND
    return status, "; ".join(filter(None, told))


def _content(
    study: Study, program: Fitting, known: Certainty | None, outcome: tuple[str, str]
) -> dict[str, Variable]:
    scene, fit, answer = study.problem, program.asked, program.answer
    names, count = list(fit.ranges), len(fit.ranges)
    variables: dict[str, Variable] = {}

    def add(name: str, dims: tuple[str, ...], values: Any, words: str, unit: str = "") -> None:
        variables[name] = described(dims, values, words, unit)

    for name, text in zip(("status", "message"), outcome, strict=True):
        variables[name] = Variable((), np.array(text, dtype=object), layout.attributes_of(name))
    add("parameter", ("parameter",), np.array(names), "parameter that was searched")
    add("parameter_2", ("parameter_2",), np.array(names), "parameter that was searched")
    unknown = np.full((count, count), math.nan)
    covariance = known.covariance if known else unknown
    for k, (name, free) in enumerate(fit.ranges.items()):
        unit = layout.axis_attributes(scene, name).get("units", "")
        value = float(answer.values[k]) if answer else math.nan
        sigma = float(np.sqrt(covariance[k, k]))
        add(name, (), value, f"{name.replace('_', ' ')} that was found", unit)
        add(f"{name}_sigma", (), sigma, f"standard deviation of {name.replace('_', ' ')}", unit)
        for end, bound in (("low", free.start), ("high", free.stop)):
            add(f"{name}_{end}", (), bound, f"{end} bound of {name}", unit)
    both = ("parameter", "parameter_2")
    add("covariance", both, covariance, "covariance of the values that were found")
    add("correlation", both, known.correlation if known else unknown, "their correlation")
    add("condition", (), known.condition if known else math.nan, "condition of the Jacobian matrix")
    seen = answer.seen if answer else np.full(len(fit.values), math.nan)
    misfit = float(np.mean(((seen - fit.values) / fit.sigma) ** 2))
    add("misfit", (), misfit, "mean of the squared differences over sigma")
    add("runs", (), np.int32(len(program.rows)), "runs of the fit")
    lines = [k for k, line in enumerate(fit.measured) for _ in line.values]
    places = [
        each.places if each.over else np.full(len(each.values), math.nan) for each in fit.measured
    ]
    add("line", ("row",), np.array(lines, dtype=np.int32), "number of the measured line")
    add("place", ("row",), np.concatenate(places), "where it was measured")
    add("measured", ("row",), fit.values, "what was measured")
    add("measured_sigma", ("row",), fit.sigma, "standard deviation of what was measured")
    add("fitted", ("row",), seen, "what the run with the values found says")
    for key, words in (("of", "variable that was measured"), ("over", "variable of the places")):
        add(f"line_{key}", ("lines",), [getattr(each, key) for each in fit.measured], words)
    at = [
        ", ".join(f"{name} = {value}" for name, value in each.at.items()) for each in fit.measured
    ]
    add("line_at", ("lines",), at, "place on the other dimensions")
    units = [scene.known_quantities[each.of].units for each in fit.measured]
    add("line_unit", ("lines",), units, "unit of what was measured")
    _add_tried(add, program)
    return variables


def _add_tried(add: Any, program: Fitting) -> None:
    """Add the runs of the fit, in the order in which they were asked for."""
    keys = [key for key, row in program.rows.items() if row or key in program.refusals]
    for k, name in enumerate(program.asked.ranges):
        values = np.array([key.values[k] for key in keys], dtype=float)
        add(f"tried_{name}", ("tried",), values, f"{name.replace('_', ' ')} of the runs")
    misfits = np.array([program.misfit(key.values) for key in keys], dtype=float)
    add("tried_misfit", ("tried",), misfits, "mean of the squared differences over sigma")
    for entry, words in (("status", "outcome of the runs"), ("id", "id of the runs")):
        texts = [str((program.rows[key] or {}).get(entry, "")) for key in keys]
        name = "run" if entry == "id" else entry
        add(f"tried_{name}", ("tried",), np.array(texts, dtype=object), words)
