"""Scene files of blocks, plates, punches and bodies between plates: Coulomb and statics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tests.stability.kinds.told import (
    COARSE,
    EXACT,
    LARGE,
    LATE,
    LEAN,
    PLANE,
    Draw,
    Rng,
    Tables,
    Told,
    between,
    box,
    elastic,
    near,
    no_slip,
    pick,
    stages,
    tabled,
)
from tests.stability.trial import Figure, Figures
from tests.verification.closed_forms import HertzLine, plane_strain_modulus, prandtl_pressure


def dragged(number: int, rng: Rng) -> Draw:
    """A block, or a rigid plate on one, pressed and dragged to and fro: T is mu N."""
    plate, mu = bool(number % 2), float(pick(rng, 0.1, 0.3, 0.6))
    state, law = str(pick(rng, *PLANE)), elastic(rng)
    w, h = float(rng.uniform(2, 8)), float(rng.uniform(0.5, 1.0))
    thickness = float(pick(rng, 1.0, 4.0))
    p = 1e-4 * law["youngs_modulus"] * float(pick(rng, 1.0, 5.0))
    F = p * w * thickness
    # more than the block shears and bends by
    way = float(pick(rng, 15.0, 60.0)) * mu * p / law["youngs_modulus"] * (h + w)
    factors = {"on": 0.0, "to": 1.0, "fro": -1.0}
    size, wrong = w / int(pick(rng, 3, 8)), bool(rng.random() < 0.3)
    ends = (0.0, w) if plate else (-w, 2 * w)
    bed = {"material": "m", "supports": {"bottom": "xy"}, "shape": box(ends, (-h, 0.0), size)}
    bodies, rigid, loads = {"bed": bed}, {}, []
    if plate:
        line = {"kind": "line", "points": [[-w, 0.0], [2 * w, 0.0]]}
        rigid = {"tool": {"surfaces": {"bottom": line}, "y": {"pushed": -F},
                          "x": {"moved": way, "amplitude": factors}}}  # fmt: skip
    else:
        bodies["tool"] = {"material": "m", "shape": box((0.0, w), (0.0, h), size)}
        loads = [{"body": "tool", "kind": "pressure", "boundary": "top", "value": p},
                 {"body": "tool", "kind": "displacement", "boundary": "top", "x": way,
                  "amplitude": factors}]  # fmt: skip
    sides = ["bed.top", "tool.bottom"] if wrong or plate else ["tool.bottom", "bed.top"]
    tables = tabled(
        state, thickness, materials={"m": law}, bodies=bodies, rigid=rigid, loads=loads,
        contacts=[{"name": "c", "slave": sides[0], "master": sides[1], "friction": mu,
                   "sliding": str(pick(rng, "auto", "finite"))}],
        stages=stages(*factors, increments=int(pick(rng, 2, 6))),
        results={"samples": 41},
    )  # fmt: skip

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N, T, R = 0.0, 0.0, 0.0
        for stage, f in factors.items():
            normal, tangential = run.contact("c", stage)
            N = max(N, near(normal, F))
            if f:
                T = max(T, near(abs(tangential), mu * F))
                x, y = run.both("reaction", "bed", stage)
                R = max(R, near(x, -f * mu * F), near(y, F))
        return {"force": Figure(N, tilt), "dragged": Figure(T, tilt), "reaction": Figure(R, tilt)}

    # surfaces that follow tilt by strain
    tilt = EXACT + (1 + 1 / mu) * p / law["youngs_modulus"]
    shape = f"{'plate' if plate else 'block'} {w:.3g} x {h:.3g} {state}"
    what = f"{shape}, mu {mu}, way {way:.2g}, p {p:g}"
    return Draw(what, (tables,), check, (LATE,) if not plate else ())


def oblique(number: int, rng: Rng) -> Draw:
    """A block pushed askew: it sticks with the ratio of its load, or slides off."""
    mu, share = float(pick(rng, 0.2, 0.5, 0.9)), float(pick(rng, 0.3, 0.8, 0.95, 1.1, 2.0))
    ratio, state, law = share * mu, str(pick(rng, *PLANE)), elastic(rng)
    w, E = float(rng.uniform(2, 8)), law["youngs_modulus"]
    h = 0.1 * w  # it does not tip
    p = 1e-4 * E
    bed = {
        "material": "m",
        "supports": {"bottom": "xy"},
        "shape": box((-w, 2 * w), (-w, 0.0), w / 4),
    }
    tool = {"material": "m", "shape": box((0.0, w), (0.0, h), w / int(pick(rng, 4, 9)))}
    on = {"on": 1.0, "less": 0.5, "again": 1.0}
    # it is pressed and pushed at once, or pushed when it is pressed
    along = on if rng.random() < 0.5 else {"on": 0.0, "less": 0.0, "again": 1.0}
    tables = tabled(
        state, 1.0, materials={"m": law}, bodies={"bed": bed, "tool": tool},
        contacts=[{"name": "c", "slave": "tool.bottom", "master": "bed.top", "friction": mu}],
        loads=[{"body": "tool", "kind": "traction", "boundary": "top", axis: value,
                "amplitude": factors}
               for axis, value, factors in (("x", ratio * p, along), ("y", -p, on))],
        stages=stages(*on, increments=int(pick(rng, 1, 4))),
        results={"samples": 41},
    )  # fmt: skip

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N = max(near(run.contact("c", s)[0], f * p * w) for s, f in on.items())
        Q = ratio * p * w
        T = max(near(abs(run.contact("c", s)[1]), f * Q, Q) for s, f in along.items())
        R = max(near(run.of("reaction_x", "bed", s), -f * Q, Q) for s, f in along.items())
        tilt = EXACT + (1 + 1 / ratio) * p / E
        return {"force": Figure(N, tilt), "stuck": Figure(T, tilt), "reaction": Figure(R, EXACT)}

    # where it slides from the first there is no load that it bears
    excused = ("NOT_CONVERGED.*than friction carries",) if share > 1 and along is on else ()
    what = f"oblique {share} of mu {mu}, {state}, {law}, {'at once' if along is on else 'after'}"
    return Draw(what, (tables,), check, excused, limit=share > 1)


def caged(number: int, rng: Rng) -> Draw:
    """A free disc or ring between plates: both bear the force, which splits it as Hertz tells."""
    solid, state = bool(number % 3), str(pick(rng, *PLANE))
    R, law = float(10 ** rng.uniform(-1, 2)), elastic(rng) | {"poisson_ratio": 0.3}
    deep = float(pick(rng, 0.01, 0.05, 0.1)) if solid else 1e-3  # a ring bends
    fine = float(pick(rng, 1 / 6, 1 / 12, 1 / 20))
    E = law["youngs_modulus"]
    modulus = plane_strain_modulus(E, 0.3) if state == "plane_strain" else E
    kappa = 3 - 4 * 0.3 if state == "plane_strain" else (3 - 0.3) / (1 + 0.3)
    a = deep * R
    F = math.pi * a * deep * modulus / 4
    exact = HertzLine(force=F, radius=R, modulus=modulus)
    rim = "rim" if solid else "outer"
    shape: Tables = (
        {"kind": "disc", "radius": R, "size": fine * R} if solid
        else {"kind": "ring", "radii": [0.6 * R, R], "size": fine * R, "angles": [0, 360]}
    )  # fmt: skip
    plates = {
        "low": {"surfaces": {"face": {"kind": "line", "points": [[R, -R], [-R, -R]]}}},
        "high": {"surfaces": {"face": {"kind": "line", "points": [[-R, R], [R, R]]}},
                 "y": {"pushed": -F}},
    }  # fmt: skip
    body = {"material": "m", "shape": shape, "boundaries": {
        "n": {"of": [rim], "y": [0.3 * R, 2 * R]},
        "s": {"of": [rim], "y": [-2 * R, -0.3 * R]},
    }}  # fmt: skip
    tables = tabled(
        state, 1.0, materials={"m": law}, bodies={"disc": body}, rigid=plates,
        contacts=[{"name": "top", "slave": "disc.n", "master": "high.face", "friction": 0.3},
                  {"name": "bottom", "slave": "disc.s", "master": "low.face", "friction": 0.3}],
        stages=stages("on", increments=int(pick(rng, 1, 4))),
        results={"samples": 801,
              "points": {"p": {"body": "disc", "at": [0.0, 0.0] if solid else [0.8 * R, 0.0]}}},
        outputs={"most": {"of": "pressure", "contact": "top", "stage": "on"},
                 "least": {"of": "pressure", "contact": "bottom", "stage": "on"}},
    )  # fmt: skip

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N = max(near(run.contact(c, "on")[0], F) for c in ("top", "bottom"))
        out = {"force on arc": Figure(N, EXACT + LEAN * deep**2),
               "reaction": Figure(near(run.of("reaction_y", "low", "on"), F), EXACT)}  # fmt: skip
        if solid:
            sx = 2 * F / (math.pi * 2 * R)
            sz = 0.3 * (-2 * sx) if state == "plane_strain" else 0.0
            miss = np.abs(run.of("point_stress", "p", "on") - [sx, -3 * sx, sz, 0.0])
            out["disc split"] = Figure(float(miss.max()) / (3 * sx), 0.01 + 3 * deep**2)
            tops = [run.record.scalars[each] / exact.peak_pressure for each in ("most", "least")]
            out["peak"] = max((between(top, 1.0, no_slip(kappa)) for top in tops),
                              key=lambda f: f.value)  # fmt: skip
        return out

    excused = (COARSE,) if fine > 0.5 * deep else ()
    return Draw(
        f"{'disc' if solid else 'ring'} {state} a/R {deep} h/R {fine:.2g}",
        (tables,),
        check,
        excused,
    )


def punched(number: int, rng: Rng) -> Draw:
    """A rigid flat punch on what does not harden: it bears 2 k, and never more than Prandtl's."""
    share = float(pick(rng, 0.5, 1.0, 1.6, 2.5))  # mean pressure / 2 k or, above 1, Prandtl's
    Y, w = 300.0, 1.0
    k = Y / math.sqrt(3)
    p = share * (2 * k if share <= 1 else prandtl_pressure(Y))
    law = {"youngs_modulus": 2e5, "poisson_ratio": 0.3, "yield_stress": Y, "hardening": "none"}
    L, size = 6 * w, w / int(pick(rng, 3, 5))
    block = {"material": "m", "supports": {"bottom": "xy", "left": "x", "right": "x"},
             "shape": box((-L, L), (-L, 0.0), L / 4, near=[{"at": [0.0, 0.0], "size": size,
                                                           "radius": 1.5 * w}])}  # fmt: skip
    tool = {"surfaces": {"face": {"kind": "line", "points": [[-w, 0.0], [w, 0.0]]}},
            "y": {"pushed": -2 * w * p}}  # fmt: skip
    tables = tabled(
        "plane_strain", 1.0, materials={"m": law}, bodies={"block": block}, rigid={"tool": tool},
        contacts=[{"name": "c", "slave": "block.top", "master": "tool.face",
                   "friction": float(pick(rng, 0.0, 0.3))}],
        singular=[{"at": [side * w, 0.0], "radius": 2 * size} for side in (-1, 1)],
        stages=stages("on", increments=int(pick(rng, 2, 10))),
        results={"samples": 41},
    )  # fmt: skip

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N, up = run.contact("c", "on")[0], run.of("reaction_y", "block", "on")
        return {"force": Figure(near(N, 2 * w * p), 1e-3),
                "reaction": Figure(near(up, 2 * w * p), EXACT)}  # fmt: skip

    return Draw(f"punched {share}, elements {size:.2g}", (tables,), check, (LARGE,), share > 1)
