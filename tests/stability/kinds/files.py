"""Seeded scene files: what their records tell, against closed forms and statics.

Each draw is the tables of a scene file, run by the driver of scenes as a study runs it. What is
declared gives what must come out: Hooke and thermal strain, Lame, Hertz, Coulomb, limit loads, the
balance of declared forces. A record that is ``ok`` must agree; one that is not must be drawn so: a
contact too coarse to tell its pressure, a load beyond a limit, strain that is not small.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from solver import LimitLoad, NotConverged, Status
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.stability.kinds.files_flat import caged, dragged, oblique, punched
from tests.stability.kinds.files_round import dented, fretting, hertz, moved, refined, rolled
from tests.stability.kinds.files_uniform import columns, rings, yielding
from tests.stability.kinds.told import (
    EXACT,
    Draw,
    Rng,
    Told,
)
from tests.stability.trial import Figure, Figures, Scene, tells

COUNT = 13
SEED = 1904


def solved(draw: Draw) -> list[Told]:
    """Return what the runs that are ok tell, where every other one is excused.

    Raises
    ------
    NotConverged, LimitLoad
        with the status and message of a run that is not ok and not excused, or where none is ok
    """
    kept, last = [], NotConverged("nothing was run")
    for tables in draw.files:
        scene = file_scene(Description("drawn.toml", tables, {}))
        (record,) = scene.path(scene.parameters(), [], lambda share: None)
        if record.status is Status.OK:
            kept.append(Told(tables, record))
            continue
        kind = LimitLoad if record.status is Status.LIMIT_LOAD else NotConverged
        last = kind(f"{record.status.name}: {record.message}", 0.0, 1.0)
        if kind is LimitLoad or not any(tells(each)(str(last)) for each in draw.excused):
            raise last
    if not kept:
        raise last
    return kept


def judge(draw: Draw, runs: Sequence[Told]) -> Figures:
    """Return the figures of the draw, and those that every record keeps."""
    every = [_sound(run) for run in runs]
    worst = {name: max((f[name] for f in every), key=lambda f: f.value) for name in every[0]}
    return worst | dict(draw.check(runs))


def _sound(run: Told) -> Figures:
    """Return the figures of laws that hold in every stage: no pull, no more than friction."""
    pairs = run.tables.get("contacts", [])
    pull, beyond, left = 0.0, 0.0, 0.0
    released = [each["name"] for each in run.tables["stages"] if each.get("release")]
    for pair in pairs:
        name, mu = pair["name"], pair.get("friction", 0.0)
        level = max(abs(run.contact(name, stage)[0]) for stage in run.stages) or 1.0
        size = max(float(np.nanmax(run.of("contact_pressure", name, s))) for s in run.stages) or 1.0
        for stage in run.stages:
            N, T = run.contact(name, stage)
            p, q = (run.of(f"contact_{each}", name, stage) for each in ("pressure", "shear"))
            pull = max(pull, -N / level, -float(np.nanmin(p)) / size)
            beyond = max(beyond, (abs(T) - mu * N) / level,
                         float(np.nanmax(np.abs(q) - mu * p)) / size)  # fmt: skip
            left = max(left, abs(N) / level if stage in released else 0.0)
    return {"pull": Figure(pull, EXACT), "friction": Figure(beyond, EXACT),
            "contact when apart": Figure(left, EXACT)}  # fmt: skip


KINDS: Mapping[str, Callable[[int, Rng], Draw]] = {
    each.__name__: each
    for each in (columns, hertz, dragged, rings, fretting, oblique, rolled, yielding, caged,
                 refined, dented, punched, moved)
}  # fmt: skip


def draw(number: int, rng: Rng) -> Draw:
    """Return a draw; kinds take turns."""
    kinds = list(KINDS.values())
    return kinds[number % len(kinds)](number // len(kinds), rng)


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the scene files."""
    rng = np.random.default_rng(SEED)
    drawn = [draw(number, rng) for number in range(count)]
    return [
        Scene(
            what=d.what,
            run=partial(solved, d),
            judge=None if d.limit else partial(judge, d),
            honest=(lambda text, d=d: any(tells(e)(text) for e in d.excused)),  # type: ignore[misc]
            safe=0.0 if d.limit else math.inf,
            in_loads=False,
        )
        for d in drawn
    ]
