"""How far the numbers of one computation are from those of another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

LIMIT = 1e-9
"""Change over the level of a variable, its largest value in the run; sums may be ordered anew."""

EXCLUDED = ("cpu_seconds", "wall_seconds", "seconds", "message")
"""Variables that differ on purpose: times, and texts, which may be written better."""

ROUNDING = {"mm": 1e-9, "MPa": 1e-8, "N": 1e-6, "1": 1e-9}
"""Changes that rounding causes, by unit, where lengths of 1 m, stress of 1000 MPa and forces of
100 kN cancel; of ratios only those of the audit. Smaller changes do not count."""

HUNG = "hung"
"""Status of a run that took too long: one that did so before the change is left out."""

Run = Mapping[str, Any]
"""Arrays by name of variable; ``status`` is one of them."""


class Row(NamedTuple):
    """The comparison of a study or of a family of scenes.

    Attributes
    ----------
    runs, values : how many were compared
    left_out : runs that took too long before the change
    moved : (change over the level, run and variable) of what is above the limit, largest first
    worst : the same of the largest change, whether above the limit or not
    statuses : (run, status before, status after) where they differ
    alone : what only one side has
    """

    runs: int
    values: int
    left_out: int
    moved: list[tuple[float, str]]
    worst: tuple[float, str]
    statuses: list[tuple[str, str, str]]
    alone: list[str]

    @property
    def same(self) -> bool:
        """Whether nothing moved."""
        return not (self.moved or self.statuses or self.alone)


def compared(before: Mapping[str, Run], after: Mapping[str, Run]) -> Row:
    """Compare runs by their names."""
    found: list[tuple[float, str]] = []
    statuses, values, left_out = [], 0, 0
    alone = [f"{name} ({_side(name in before)})" for name in sorted(before.keys() ^ after.keys())]
    for name in before.keys() & after.keys():
        old, new = before[name], after[name]
        was, is_ = (" ".join(np.ravel(run.get("status", ""))) for run in (old, new))
        if was == HUNG:
            left_out += 1
        elif was != is_:
            statuses.append((name, was, is_))
        else:
            alone += [f"{name}: {v} ({_side(v in old)})" for v in sorted(old.keys() ^ new.keys())]
            shared = [v for v in sorted(old.keys() & new.keys()) if _last(v) not in EXCLUDED]
            found += [(change(v, old[v], new[v]), f"{name}: {v}") for v in shared]
            values += sum(np.size(old[v]) for v in shared)
    found.sort(key=lambda each: (-each[0], each[1]))
    return Row(
        runs=len(before.keys() & after.keys()) - left_out,
        values=values,
        left_out=left_out,
        moved=[each for each in found if each[0] > LIMIT],
        worst=found[0] if found and found[0][0] > 0 else (0.0, ""),
        statuses=sorted(statuses),
        alone=alone,
    )


def change(name: str, before: Any, after: Any) -> float:
    """Return the largest change of a variable over its level.

    It is infinite if texts, shapes or the places of NaN differ, and where zeros have changed.
    """
    old, new = np.asarray(before), np.asarray(after)
    if old.dtype.kind not in "biuf" or new.dtype.kind not in "biuf":
        return 0.0 if np.array_equal(old, new) else np.inf
    old, new = old.astype(float), new.astype(float)
    if old.shape != new.shape:
        return np.inf
    alike = (old == new) | (np.isnan(old) & np.isnan(new))
    if alike.all():
        return 0.0
    apart = float(np.abs(new - old)[~alike].max())  # NaN where only one is
    if not np.isfinite(apart):
        return np.inf
    if apart <= _rounding(_last(name)):
        return 0.0
    level = float(np.abs(old[np.isfinite(old)]).max())
    return apart / level if level else np.inf


def _rounding(name: str) -> float:
    """Return the change of a variable that rounding causes, in its unit."""
    import solver.shipped  # noqa: F401  (declares all quantities)
    from solver.results.quantities import QUANTITIES

    units = QUANTITIES[name].units if name in QUANTITIES else ""
    return 0.0 if units == "1" and not name.startswith("audit_") else ROUNDING.get(units, 0.0)


def _last(name: str) -> str:
    """Return the name of a variable of a record that is part of an answer."""
    return name.rpartition(".")[2]


def _side(old: bool) -> str:
    return "only old" if old else "only new"


def geometric_mean(ratios: Iterator[float]) -> float:
    """Return the geometric mean."""
    return float(np.exp(np.mean(np.log(list(ratios)))))
