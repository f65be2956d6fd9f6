"""Own values of the numbers that a user requests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from solver.mesh.rounding import in_box
from solver.results.requested import RequestedNumber
from solver.tensors import AXES, components
from tests.recomputed.contact import COVERED
from tests.recomputed.rules import (
    LEAST_LENGTH,
    LIMIT,
    MEASURED,
    SAME_TIME,
    Own,
    Rules,
    closest,
    lengths,
)

Array = NDArray[np.float64]

PARTS = {name: k for names in (components(6), AXES) for k, name in enumerate(names)}


def of_number(rules: Rules, number: RequestedNumber) -> Mapping[str, Own]:
    """A requested number and, of an extreme value, its position."""
    if number.course:
        return {number.name: _at_end(rules, number)}
    kind, _, part = number.of.partition(".")
    recorded, partly, limit, least = rules.record.scalars[number.name], [], LIMIT, 0.0
    if number.contact is not None:
        assert rules.places is not None
        found = rules.tractions(rules.places.contacts.index(number.contact), number.stage)
        limit = rules.share(found, kind)
        if number.is_resultant:
            return {
                number.name: Own(found.force(kind), LIMIT * rules.state(number.stage).force_scale)
            }
        values, X = found.on_slave(kind), found.X
        if kind in ("gap", "slip"):
            least = found.way
            if not found.whole.all():  # means at hats that face the master in part
                partly = [found.of_gaps(kind, share) for share in (0.0, 2 * COVERED)]
        elif np.isnan(values[found.closed]).any():
            return {}
        elif (kind, number.take) == ("pressure", "extent"):
            limit = MEASURED if found.measured else LIMIT
            return {number.name: Own(found.length, limit * found.s[-1])}
        else:
            values = np.where(np.isnan(values) & ~found.closed, 0.0, values)
    else:
        values, X = _values(rules, number, number.stage, kind, part)
        if number.minus:
            values = values - _values(rules, number, number.minus, kind, part)[0]
    if not np.isfinite(values).any():
        return {}
    name = "plastic_tensor" if part and kind == "plastic_strain" else kind
    scale = max(least, rules.scale(name, values))
    if number.take in ("integral", "extent"):
        return {number.name: _whole(rules, number, values, X, partly, limit, scale, least)}
    sign = 1.0 if number.take == "maximum" else -1.0
    own = float(np.nanmax(sign * values))
    where = np.array([rules.record.scalars[f"{number.name}_{a}"] for a in AXES[: len(X)]])
    off = np.hypot.reduce(X - where[:, None])
    at = off <= off.min() * (1 + 1e-9) + 1e-12 * np.abs(X).max()
    if partly and np.isnan(values[at]).all():  # it may lie beyond those that are known
        own, limit = max(own, sign * recorded), MEASURED
        values = np.where(at, partly[0], values)
    there = np.abs(sign * values - own) <= limit * scale
    place, least = closest(X[:, there], where), LIMIT * rules.size
    axes = {f"{number.name}_{a}": Own(x, least) for a, x in zip(AXES, place, strict=False)}
    return {number.name: Own(sign * own, limit * scale), **axes}


def _whole(
    rules: Rules, number: RequestedNumber, values: Array, X: Array, partly: Sequence[Array],
    limit: float, scale: float, least: float,
) -> Own:  # fmt: skip
    """An integral or an extent; within what hats leave open that face the master in part."""
    s, kind = lengths(X), number.of.partition(".")[0]
    limit, each = MEASURED if partly else limit, [np.nan_to_num(v) for v in partly or [values]]
    if number.take == "integral":
        found = [float((one[1:] + one[:-1]) @ np.diff(s) / 2) for one in each]
        size = np.abs(each[0])
        level = float((size[1:] + size[:-1]) @ np.diff(s) / 2)
        level = max(level, max(least, rules.scale(kind, np.zeros(0))) * s[-1])
    else:  # where a value touches zero, rounding decides how far it is above
        found = [_above_zero(one + way * scale * limit, s) for one in each for way in (-1, 1)]
        level, limit = s[-1], LIMIT
    own = np.clip(rules.record.scalars[number.name], min(found), max(found))
    return Own(own, limit * level)


def _at_end(rules: Rules, number: RequestedNumber) -> Own:
    """A value at the end of a stage, of the course, which is compared itself."""
    course, times = rules.stored(number.course), rules.stored("increment_time")
    names = list(rules.system.all_names)
    if number.contact is not None:
        assert rules.places is not None
        names = list(rules.places.contacts)
    row, own = course[names.index(str(number.contact or number.part))], 0.0
    for stage, sign in ((number.stage, 1.0), (number.minus, -1.0)):
        if stage:
            near = np.flatnonzero(np.abs(times - rules.state(stage).time) < SAME_TIME)
            own += sign * (row[near[-1]] if len(near) else np.nan)
    return Own(
        own, LIMIT * max(float(np.nanmax(np.abs(row), initial=0.0)), LEAST_LENGTH * rules.size)
    )


def _values(
    rules: Rules, number: RequestedNumber, stage: str, kind: str, part: str
) -> tuple[Array, Array]:
    """The values (n,) of a field of a body or line, and their positions (n_axes, n)."""
    assert rules.places is not None
    line = rules.places.lines[number.line] if number.line is not None else None
    body = str(number.body) if line is None else line.body
    fields = rules.fields(body, stage)
    if part and kind == "plastic_strain":
        kind = "plastic_tensor"
    if line is None and kind in ("mises", "plastic_strain"):
        X, mises, flow = fields.at_points
        values = mises if kind == "mises" else flow
    else:
        X = fields.plain.part.X if line is None else line.X
        nodal = fields.at(kind)
        values = nodal if line is None else rules.sampled((body,), line.X, kind, stage)
        values = np.where(np.isinf(values), np.nan, values)
        values = _part(values, part) if part else np.maximum(values, 0.0)
    spans = (number.x, number.y, number.z) if line is None else ()
    inside = in_box(X, spans, float(np.ptp(X, axis=1).max()))
    return np.where(inside, values, np.nan), X


def _part(values: Array, part: str) -> Array:
    """A component (n,) of a vector or tensor (n_components, n), or an invariant."""
    if part in PARTS:
        return values[PARTS[part]]
    xx, yy, zz, xy, *out = values
    yz, zx = out or (np.zeros_like(xy), np.zeros_like(xy))
    known = np.isfinite(xx)
    each = np.moveaxis(np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]), -1, 0)
    low, middle, high = np.linalg.eigvalsh(np.where(known[:, None, None], each, 0.0)).T
    found = {"principal_1": high, "principal_2": middle, "principal_3": low, "tresca": high - low,
             "hydrostatic": (xx + yy + zz) / 3}[part]  # fmt: skip
    return np.where(known, found, np.nan)


def _above_zero(values: Array, s: Array) -> float:
    """The length on which values, linear between positions s, are above zero [mm]."""
    total = 0.0
    for a, b, length in zip(values[:-1], values[1:], np.diff(s), strict=True):
        if a > 0 and b > 0:
            total += length
        elif a > 0 or b > 0:
            total += length * max(a, b) / abs(a - b)
    return float(total)
