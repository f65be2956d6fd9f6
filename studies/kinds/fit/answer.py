"""What a fit finds: the data set of its answer, and how well its parameters are known.

References
----------
Belsley, D. A., Kuh, E. and Welsch, R. E. (1980), Regression Diagnostics, section 3.2: condition
indices, and the shares of variances by which parameters are found that cannot be told apart.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from solver.typing import Array
from studies.definition.identity import canonical
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK, STOPPED
from studies.kinds.fit.fitting import Fit, Fitted, Fitting
from studies.kinds.kind import Answers
from studies.kinds.ranged import FAILED
from studies.storage import dataset as layout
from studies.storage.dataset import Variable
from studies.storage.runfile import described

_CONDITION = 30.0
"""Condition index from which parameters cannot be told apart (reference, section 3.2)."""
_SHARE = 0.5
"""Share of the variance of a parameter that a direction makes if the parameter is in it."""
_WEAK = 1e-6
"""Least length of a column of the Jacobian matrix over that of the longest."""


class Certainty(NamedTuple):
    """How well parameters are known.

    Attributes
    ----------
    covariance : (n, n) of the values; NaN where the lines say nothing
    correlation : (n, n)
    condition : of the Jacobian matrix with columns of length 1
    warning : which parameters cannot be told apart, or change nothing; empty if there are none
    """

    covariance: Array
    correlation: Array
    condition: float
    warning: str


def certainty(fit: Fit, answer: Fitted) -> Certainty:
    """Return how well the parameters of an answer with a Jacobian matrix are known.

    Where not all standard deviations were given, they are scaled so that the differences have them.
    """
    assert answer.jacobian is not None
    names, slopes = list(fit.ranges), [
        each.slope(value) for each, value in zip(fit.ranges.values(), answer.values, strict=True)
    ]  # fmt: skip
    lengths = np.linalg.norm(answer.jacobian, axis=0)
    idle = lengths <= _WEAK * max(lengths.max(initial=0.0), 1e-300)
    count = len(names)
    inverse = np.full((count, count), np.nan)
    warnings = [f"{names[k]} changes nothing in what was measured" for k in np.flatnonzero(idle)]
    condition = math.inf
    if (used := np.flatnonzero(~idle)).size:
        unit = answer.jacobian[:, used] / lengths[used]
        _, sizes, rows = np.linalg.svd(unit, full_matrices=False)
        sizes = np.maximum(sizes, 1e-15 * sizes[0])
        own = (rows.T / sizes**2) @ rows / np.outer(lengths[used], lengths[used])
        inverse[np.ix_(used, used)] = own
        condition = math.inf if idle.any() else float(sizes[0] / sizes[-1])
        shares = rows**2 / sizes[:, None] ** 2
        shares /= shares.sum(axis=0)
        for size, share in zip(sizes, shares, strict=True):
            if sizes[0] / size >= _CONDITION:
                apart = [names[used[k]] for k in np.flatnonzero(share > _SHARE)]
                if len(apart) > 1:
                    listed = f"{', '.join(apart[:-1])} and {apart[-1]}"
                    warnings.append(f"{listed} cannot be told apart by what was measured")
    covariance = fit.spread(answer.seen) * inverse * np.outer(slopes, slopes)
    sigma = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sigma, sigma)
    text = "; ".join(dict.fromkeys(warnings))
    if text and math.isfinite(condition):
        text += f": the condition of the Jacobian matrix is {condition:.3g}"
    return Certainty(covariance, correlation, condition, text)


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
