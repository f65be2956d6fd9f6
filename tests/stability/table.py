"""What the extreme scenes came to, in a page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, fields

import numpy as np

from solver import Status
from solver.scenes.punch import PunchParameters
from tests.stability.oracle import LIMITS
from tests.stability.trial import Trial


def summary(trials: Sequence[Trial]) -> list[str]:
    """Return lines: statuses, effort, worst figures of the oracle and of the audit."""
    done = [t for t in trials if t.figures]
    count = Counter(t.status for t in trials)
    seconds = [t.seconds for t in trials]
    lines = [
        f"{len(trials)} scenes: " + ", ".join(f"{count[s]} {s.name}" for s in Status if count[s]),
        f"slowest {max(seconds):.1f} s, all {sum(seconds):.0f} s",
    ]
    scalars = [t.record.scalars for t in done]
    if not done:
        return lines
    increments = sum(s["increments"] for s in scalars)
    lines.append(
        f"{increments:.0f} increments of the {len(done)} carried: {_total(done, 'iterations'):.0f}"
        f" iterations (at most {max(s['iterations'] / s['increments'] for s in scalars):.1f} an "
        f"increment of a scene), {_total(done, 'cut_increments'):.0f} cuts, "
        f"{_total(done, 'blended_tangents'):.0f} blended tangents"
    )
    lines.append(f"{'oracle':<32}{'worst':>10}{'limit':>10}  scene")
    for name, limit in LIMITS.items():
        worst = max(done, key=lambda t: t.figures[name])
        lines.append(f"{name:<32}{worst.figures[name]:>10.1e}{limit:>10.0e}  {worst.number}")
    lines.append(f"{'audit, stored with the run':<32}{'worst':>10}{'median':>10}  scene")
    for name in sorted(n for n in scalars[0] if n.startswith("audit_")):
        # the least dissipation is negative where it is wrong
        sign = -1.0 if name == "audit_dissipation" else 1.0
        worst = max(done, key=lambda t: sign * t.record.scalars[name])
        middle = np.median([s[name] for s in scalars])
        value = worst.record.scalars[name]
        lines.append(f"{name:<32}{value:>10.1e}{middle:>10.1e}  {worst.number}")
    return lines


def describe(trial: Trial) -> str:
    """Return what is needed to run a scene again, and how it ended."""
    default = PunchParameters()
    given = {f.name: getattr(trial.parameters, f.name) for f in fields(PunchParameters)}
    changed = {k: v for k, v in given.items() if v != asdict(default)[k]}
    text = ", ".join(f"{k}={v!r}" for k, v in changed.items())
    return f"scene {trial.number}: {trial.status.name}: {trial.record.message}\n    {text}"


def _total(trials: Sequence[Trial], name: str) -> float:
    return float(sum(t.record.scalars[name] for t in trials))
