"""What the scenes came to, in a page."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

from tests.stability.trial import Figure, Trial, Verdict

COUNTED: dict[str, tuple[Verdict, ...]] = {
    "ok": (Verdict.ANSWER,),
    "limit": (Verdict.LIMIT,),
    "declared": (Verdict.HONEST,),
    "refused": (Verdict.REFUSED,),
    "unexplained": (Verdict.NOT_CONVERGED, Verdict.FALSE_REFUSAL, Verdict.UNCLEAR),
    "wrong": (Verdict.WRONG, Verdict.FALSE_LIMIT, Verdict.CRASHED),
    "hung": (Verdict.HUNG,),
}
"""Columns of counts: ``declared`` did not converge for a reason that its family tells before,
``unexplained`` did not converge, or was refused, without one."""


def counts(family: str, trials: Sequence[Trial]) -> str:
    """Return a line: how many scenes came to what, and their CPU time."""
    numbers = "".join(f"{sum(t.verdict in v for t in trials):>13}" for v in COUNTED.values())
    return f"{family:<12}{numbers}{sum(t.seconds for t in trials):>9.1f}"


def summary(trials: Sequence[Trial]) -> list[str]:
    """Return lines: verdicts by family, effort, the worst figures of the oracles."""
    count = Counter(t.verdict for t in trials)
    always = (Verdict.WRONG, Verdict.FALSE_LIMIT, Verdict.HUNG, Verdict.NOT_CONVERGED)
    told = ", ".join(f"{count[v]} {v.value}" for v in Verdict if count[v] or v in always)
    seconds = [t.seconds for t in trials]
    slowest = max(trials, key=lambda t: t.seconds)
    lines = [
        f"{len(trials)} scenes: {told}",
        f"slowest {slowest.seconds:.1f} s ({slowest.name}), all {sum(seconds):.0f} s of CPU",
        f"{'family':<16}{'scenes':>7}{'right':>7}{'CPU [s]':>9}  worst figure",
    ]
    for family, members in _families(trials).items():
        right = sum(t.right for t in members)
        spent = sum(t.seconds for t in members)
        lines.append(
            f"{family:<16}{len(members):>7}{right:>7}{spent:>9.1f}  {_worst_of_all(members)}"
        )
    lines.append(f"{'oracles of right answers':<32}{'worst':>10}{'limit':>10}  scene")
    for name, (figure, scene) in sorted(_worst(trials).items()):
        lines.append(f"{name:<32}{figure.value:>10.1e}{figure.limit:>10.0e}  {scene}")
    return lines


def describe(trial: Trial) -> str:
    """Return how a scene ended and what it is."""
    return f"{trial.name}: {trial.verdict.value}: {trial.message}\n    {trial.what}"


def _families(trials: Sequence[Trial]) -> dict[str, list[Trial]]:
    out: dict[str, list[Trial]] = defaultdict(list)
    for trial in trials:
        out[trial.name.rpartition("-")[0]].append(trial)
    return out


def _share(figure: Figure) -> float:
    return figure.value / figure.limit if figure.limit else figure.value


def _worst(trials: Sequence[Trial]) -> dict[str, tuple[Figure, str]]:
    out: dict[str, tuple[Figure, str]] = {}
    for trial in trials:
        for name, figure in trial.figures.items() if trial.right else ():
            if name not in out or _share(figure) > _share(out[name][0]):
                out[name] = (figure, trial.name)
    return out


def _worst_of_all(trials: Sequence[Trial]) -> str:
    worst = _worst(trials)
    if not worst:
        return ""
    name, (figure, _) = max(worst.items(), key=lambda item: _share(item[1][0]))
    return f"{name} {figure.value:.1e} of {figure.limit:.0e}"
