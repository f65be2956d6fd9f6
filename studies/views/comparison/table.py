"""Comparisons with published numbers as text and as a file."""

from __future__ import annotations

import csv
import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from studies.scenes.registry import scene_named
from studies.views.columns import in_blocks, stacked
from studies.views.comparison.compare import Comparison
from studies.views.comparison.problem import Parameters, other_problem, told
from studies.views.comparison.profiles import Computed, Level
from studies.views.comparison.reference import STRAIN, Published

NEAR: Mapping[str, float] = {"MPa": 50.0, "mm": 1.0, "1": 0.01, "%": 10.0}
"""Difference from a published number up to which the two are counted as near, by unit."""

PROFILES: Mapping[str, str] = {
    "xx": "sigma_x",
    "yy": "sigma_y",
    "zz": "sigma_z",
    "xy": "tau_xy",
    STRAIN: "strain",
}
"""What the components of a profile are called."""

_ROUNDING = 1e-9
"""Depths lie on a grid: one step off may be a rounding error more than that."""

_FEATURES = {
    "surface": "at the surface",
    "minimum": "lowest",
    "maximum": "highest",
    "local_maximum": "local maximum",
}


def comparison_table(
    computed: Computed,
    compared: Sequence[Comparison],
    absent: Sequence[Published],
    cases: Mapping[str, Parameters],
) -> str:
    """Return a line for each published number, what was not computed, and a summary.

    The difference is that of the finest computed number from the published one. Beside it stand
    the changes of the computed number between the two finest sizes of mesh and increment, which
    tell how much of the difference is the computation's own error. A line says in which parameters
    what was computed departs from the published `cases`, as far as those are known.
    """
    parts = []
    if compared:
        parts.append(_lines(computed, compared))
    if absent:
        missing = Counter(f"{case}/{number}" for case, number in (each.key for each in absent))
        told = ", ".join(f"{count} of {key}" for key, count in missing.items())
        parts.append(f"published, but not computed here: {told}")
    if departures := _departures(computed, cases):
        parts.append(f"not the published case: {departures}")
    return "\n\n".join([*parts, _summary(compared, absent)])


def write_comparisons(path: Path, computed: Computed, compared: Sequence[Comparison]) -> None:
    """Write a row for each published number, with the computed ones at full precision."""
    levels = computed.levels
    names = ["case", "pass", "number", "unit", "low", "high"]
    names += [" ".join(map("{}={:g}".format, computed.axes, level)) for level in levels]
    names += ["difference", *(f"change_{name}" for name in computed.axes)]
    names += [f"order_{name}" for name in computed.axes]
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow([*names, "source", "note"])
        for each in compared:
            of = each.published
            ours = [each.ours.get(level, math.nan) for level in levels]
            numbers = [*each.bounds, *ours, each.difference, *each.changes, *each.orders]
            written = [f"{number:.8g}" if math.isfinite(number) else "" for number in numbers]
            table.writerow([*of.key, _name(each), each.unit, *written, of.source, of.note])


def _lines(computed: Computed, compared: Sequence[Comparison]) -> str:
    levels = computed.levels
    changes = [f"change with {name.replace('_', ' ')}" for name in computed.axes]
    headings = ["case", "pass", "number", "unit", "published"]
    headings += [*map(_level, levels), "difference", *changes]
    rows = [_row(each, levels) for each in compared]
    table = in_blocks([*stacked(headings), *rows], keys=3, right=4)
    if not computed.axes:
        return table
    refined = f"computed at {' / '.join(computed.axes)}, from coarse to fine"
    finest = ", of several there with the smallest ".join(computed.axes)
    meaning = f"the difference is that of the run with the smallest {finest};"
    beside = "a change is that between the two finest, all else equal; in brackets the order"
    return f"{refined};\n{meaning}\n{beside} at which the three finest settle\n\n{table}"


def _row(each: Comparison, levels: Sequence[Level]) -> list[str]:
    of = each.published
    return [
        of.case,
        str(of.pass_number),
        _name(each),
        "" if each.unit == "1" else each.unit,
        _published(each),
        *(_ours(each, level) for level in levels),
        _number(each.difference, each.unit, "+"),
        *(
            _number(change, each.unit, "+") + ("" if math.isnan(order) else f" ({order:.1f})")
            for change, order in zip(each.changes, each.orders, strict=True)
        ),
    ]


def _name(each: Comparison) -> str:
    """Return what the number is, in words."""
    of = each.published
    feature = f"{PROFILES[of.component]} {_FEATURES[of.quantity]}"
    against = f", against {of.against}" if of.against and not each.is_depth else ""
    return f"{feature}, depth" if each.is_depth else f"{feature}{against}"


def _published(each: Comparison) -> str:
    low, high = (f"{bound:g}" for bound in each.bounds)
    about = each.published.about in {"both", "depth" if each.is_depth else "value"}
    if low == high:
        return f"about {low}" if about else low
    if math.isinf(each.bounds[1]):
        return f"> {low}"
    return f"< {high}" if math.isinf(each.bounds[0]) else f"{low} to {high}"


def _ours(each: Comparison, level: Level) -> str:
    """Return our number; nothing where it was not computed, none where there is no such feature."""
    if level not in each.ours:
        return ""
    value = each.ours[level]
    return "none" if math.isnan(value) else _number(value, each.unit)


def _number(value: float, unit: str, sign: str = "") -> str:
    """Return a number to the digits worth showing; a dash for one that is not known."""
    digits = {"MPa": 0, "mm": 1, "1": 4, "%": 0}[unit]
    return "-" if math.isnan(value) else f"{value:{sign}z.{digits}f}"


def _level(level: Level) -> str:
    return " / ".join(f"{value:g}" for value in level) or "computed"


def _departures(computed: Computed, cases: Mapping[str, Parameters]) -> str:
    """Return in which parameters which computed cases are not the published ones."""
    scene = scene_named(computed.scene)
    found: dict[str, dict[str, None]] = defaultdict(dict)
    for (case, number), levels in computed.profiles.items():
        ours = next(iter(levels.values())).parameters  # all levels solve one problem
        differing = other_problem(scene, ours, cases[case], number) if case in cases else {}
        for name, (value, published) in differing.items():
            found[f"{name} {told(value)} (published {told(published)})"][case] = None
    return "; ".join(f"{', '.join(where)} {what}" for what, where in found.items())


def _summary(compared: Sequence[Comparison], absent: Sequence[Published]) -> str:
    """Return how many numbers were compared and how many are near, by unit."""
    published = len(compared) + sum(each.has_value + each.has_depth for each in absent)
    parts = []
    for unit, near in NEAR.items():
        differences = [abs(each.difference) for each in compared if each.unit == unit]
        if differences:
            close = sum(difference <= near + _ROUNDING for difference in differences)
            name = "in strain" if unit == "1" else unit
            parts.append(f"{close} of {len(differences)} within {near:g} {name}")
    return (
        f"compared {len(compared)} of {published} published numbers: {', '.join(parts) or 'none'}"
    )
