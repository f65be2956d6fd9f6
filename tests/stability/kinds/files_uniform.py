"""Scene files of columns and rings: Hooke, thermal strain, the law in one dimension, Lame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tests.stability.kinds.rings import Ring, fitted
from tests.stability.kinds.told import (
    EXACT,
    LARGE,
    PLANE,
    STATES,
    Draw,
    Rng,
    Tables,
    Told,
    box,
    elastic,
    near,
    pick,
    stages,
    tabled,
)
from tests.stability.trial import Figure, Figures
from tests.verification.closed_forms import plane_strain_modulus


def columns(number: int, rng: Rng) -> Draw:
    """Two or three blocks, heated and pressed, let go and pressed again: Hooke in series.

    They are pressed by a pressure or between walls, from a gap or none.
    """
    state = STATES[number % 3]
    wide, count = float(rng.uniform(1, 10)), int(rng.integers(2, 4))
    heights = rng.uniform(1, 6, count)
    laws = [elastic(rng) for _ in heights]
    thickness = 1.0 if state == "axisymmetric" else float(pick(rng, 1.0, 25.0))
    gap = float(pick(rng, 0.0, 0.0, 1e-3)) * wide
    walls, factor = bool(rng.random() < 0.5), float(pick(rng, 0.0, 0.5, -0.5))
    rise, expansion = float(pick(rng, 0.0, 50.0, -30.0)), 1.2e-5
    strain, softer = float(10 ** rng.uniform(-5, -3)), float(pick(rng, 0.0, 1e-3)) * (rise > 0)
    side = 1.0 if state != "plane_strain" else 0.0

    def modulus(law: Tables, heat: float) -> float:
        return float(law["youngs_modulus"] * (1 - softer * rise * heat))

    def stiff(law: Tables, heat: float) -> float:
        E = modulus(law, heat)
        return E if side else plane_strain_modulus(E, law["poisson_ratio"])

    def grown(law: Tables) -> float:
        return expansion * rise * (1.0 if side else 1 + law["poisson_ratio"])

    softest = min(law["youngs_modulus"] for law in laws)
    size = strain * (float(heights.sum()) if walls else softest)
    factors = {"on": 1.0, "off": factor if walls else max(factor, 0.0), "again": 1.0,
               "released": 0.0}  # fmt: skip
    heats = {"on": 0.0, "off": 1.0, "again": 1.0, "released": 0.0}

    def stress(stage: str) -> float:
        f, heat = factors[stage], heats[stage]
        if stage == "released":
            return 0.0
        if not walls:
            return -f * size
        soft = sum(h / stiff(law, heat) for h, law in zip(heights, laws, strict=True))
        free = sum(h * grown(law) * heat for h, law in zip(heights, laws, strict=True))
        return -max(f * size + free - gap, 0.0) / soft

    levels = [0.0, *(float(y) for y in np.cumsum(heights))]
    names = [f"b{k}" for k in range(count)]
    amplitude = {s: f for s, f in factors.items() if s != "released"}
    pressed = {"kind": "displacement", "y": -size} if walls else {"kind": "pressure", "value": size}
    loads: list[Tables] = [
        {"body": names[-1], "boundary": "top", "amplitude": amplitude, **pressed},
    ] + [
        {"body": n, "kind": "temperature", "rise": rise, "expansion": expansion,
         "modulus_drop": softer, "amplitude": {"on": 0, "off": 1}}
        for n in names if rise
    ]  # fmt: skip
    increments, sliding = int(pick(rng, 1, 2, 5)), str(pick(rng, "auto", "small"))
    tables = tabled(
        state, thickness,
        materials={f"m{k}": law for k, law in enumerate(laws)},
        bodies={
            n: {"material": f"m{k}",
                "element": str(pick(rng, "quad8", "quad9", "quad4", "tri6", "tri3")),
                "shape": box((0.0, wide), (levels[k], levels[k + 1]),
                             wide / int(rng.integers(1, 5))),
                "supports": {"left": "x"} | ({"bottom": "y"} if k == 0 else {})}
            for k, n in enumerate(names)
        },
        contacts=[{"name": f"c{k}", "slave": f"b{k + 1}.bottom", "master": f"b{k}.top",
                   "gap": gap if k == 0 else 0.0, "sliding": sliding} for k in range(count - 1)],
        loads=loads,
        stages=stages("on", "off", "again", increments=increments),
        results={"samples": 5, "points": {
            n: {"body": n, "at": [wide / 2, (levels[k] + levels[k + 1]) / 2]}
            for k, n in enumerate(names)}},
    )  # fmt: skip
    area = math.pi * wide**2 if state == "axisymmetric" else wide * thickness
    level = max(abs(stress(s)) for s in factors) or strain * softest

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        off, pushed = 0.0, 0.0
        for stage in factors:
            sigma, heat = stress(stage), heats[stage]
            for n, law in zip(names, laws, strict=True):
                held = law["poisson_ratio"] * sigma - modulus(law, heat) * expansion * rise * heat
                out = 0.0 if side else held
                miss = np.abs(run.of("point_stress", n, stage) - [0.0, sigma, out, 0.0])
                off = max(off, float(miss.max()) / max(level, abs(out)))
            force = -sigma * area
            got = [run.contact(f"c{k}", stage)[0] for k in range(count - 1)]
            got.append(run.of("reaction_y", "b0", stage))
            pushed = max(pushed, *(near(g, force, level * area) for g in got))
        return {"stress": Figure(off, EXACT + wider), "force": Figure(pushed, EXACT)}

    # surfaces that slide are as wide as they have become: a wider one bears on a part of itself
    across = [law["poisson_ratio"] * max(map(abs, map(stress, factors))) / law["youngs_modulus"]
              + abs(grown(law)) for law in laws]  # fmt: skip
    wider = 4 * max(across) * (sliding == "auto")
    what = f"{count} {state} blocks, {'walls' if walls else 'pressure'}, gap {gap:.2g}, {rise:g} K"
    return Draw(what, (tables,), check)


def yielding(number: int, rng: Rng) -> Draw:
    """A block that yields between two that do not: the law in one dimension, to and fro."""
    state = ("plane_stress", "axisymmetric")[number % 2]
    rule = str(pick(rng, "none", "isotropic", "kinematic", "mixed"))
    ratio, E, Y = float(10 ** rng.uniform(-3, -0.5)), 2e5, 300.0
    H = E * ratio / (1 - ratio)
    more = float(pick(rng, 0.3, 0.8, 1.0, 1.01, 1.2, 1.4))
    load, wide = more * Y, float(rng.uniform(1, 8))
    law: Tables = {"youngs_modulus": E, "poisson_ratio": 0.3, "yield_stress": Y, "hardening": rule}
    if rule != "none":
        law["hardening_ratio"] = ratio
    if rule == "mixed":
        law["isotropic_fraction"] = 0.5
    limit = rule == "none" and more > 1
    flown = max(load - Y, 0.0) / H if rule != "none" else 0.0
    n, element = int(rng.integers(1, 4)), str(pick(rng, "quad8", "quad9", "quad4"))
    again, sliding = float(pick(rng, 1.0, 0.5)), str(pick(rng, "auto", "small"))
    tables = tabled(
        state, 1.0,
        materials={"soft": law, "hard": {"youngs_modulus": E, "poisson_ratio": 0.3}},
        bodies={
            name: {"material": "soft" if name == "mid" else "hard", "element": element,
                   "shape": box((0.0, wide), (y, y + 2.0), wide / n),
                   "supports": {"left": "x"} | ({"bottom": "y"} if name == "low" else {})}
            for name, y in (("low", 0.0), ("mid", 2.0), ("high", 4.0))
        },
        contacts=[{"name": "below", "slave": "mid.bottom", "master": "low.top", "sliding": sliding},
                  {"name": "above", "slave": "mid.top", "master": "high.bottom",
                   "sliding": sliding}],
        loads=[{"body": "high", "kind": "pressure", "boundary": "top", "value": load,
                "amplitude": {"on": 1.0, "off": 0.0, "again": again}}],
        stages=stages("on", "off", "again", increments=int(pick(rng, 1, 3))),
        results={"samples": 5, "points": {"p": {"body": "mid", "at": [wide / 3, 3.0]},
                                       "t": {"body": "high", "at": [wide / 2, 6.0]},
                                       "b": {"body": "mid", "at": [wide / 2, 2.0]}}},
    )  # fmt: skip
    largest = max(flown, 1e-9)

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        off, strain, moved = 0.0, 0.0, 0.0
        for stage, f in (("on", 1.0), ("off", 0.0), ("again", again), ("released", 0.0)):
            miss = np.abs(run.of("point_stress", "p", stage) - [0.0, -f * load, 0.0, 0.0])
            off = max(off, float(miss.max()) / load)
            got = float(run.of("point_plastic_strain", "p", stage))
            strain = max(strain, abs(got - flown) / largest if flown else got)
            if stage in ("on", "again"):
                wanted = -(6.0 * f * load / E + 2.0 * flown)
                gone = float(run.of("point_displacement_y", "t", stage))
                moved = max(moved, near(gone, wanted))
        # a force known to 1e-6 strains by that over the slope of hardening
        slope = 1e-6 * load / H / largest if flown else 0.0
        # what has become wider bears on a part of itself
        wider = 2 * (0.3 * load / E + 0.5 * flown) * (sliding == "auto")
        slope += wider * (1 + 2 * load / H / largest if flown else 1)
        return {"stress": Figure(off, EXACT + 2 * wider),
                "plastic strain": Figure(strain, EXACT + slope),
                "displacement": Figure(moved, EXACT + slope)}  # fmt: skip

    excused = (LARGE,) if flown > 0.095 else ()
    return Draw(f"{rule} {ratio:.2g} at {more:g} Y, {state}", (tables,), check, excused, limit)


# -- rings -----------------------------------------------------------------------------------------


def rings(number: int, rng: Rng) -> Draw:
    """One to three rings, fitted or heated into each other, under pressure: Lame.

    Two sides of a quarter are held as symmetry holds them.
    """
    count, state = 1 + number % 3, str(pick(rng, *PLANE))
    radii = np.cumprod(np.append(float(10 ** rng.uniform(-1, 2)), rng.uniform(1.3, 2.5, count)))
    laws = [elastic(rng) for _ in range(count)]
    heat = float(pick(rng, 0.0, 80.0))
    made = [
        Ring(inner=radii[k], outer=radii[k + 1], E=law["youngs_modulus"], nu=law["poisson_ratio"],
             plane_strain=state == "plane_strain", free=1.2e-5 * heat * (k == 0))
        for k, law in enumerate(laws)
    ]  # fmt: skip
    fit = [float(pick(rng, -2e-4, 1e-4, 1e-3)) * r for r in radii[1:-1]]
    inside = 1e-4 * laws[0]["youngs_modulus"] * float(pick(rng, 0.0, 1.0, 5.0))
    inside = inside or (1e-4 * laws[0]["youngs_modulus"] if count == 1 else 0.0)
    n = int(pick(rng, 2, 4, 6))
    thickness, names = float(pick(rng, 1.0, 10.0)), [f"r{k}" for k in range(count)]
    mid = [float(np.sqrt(r.inner * r.outer)) for r in made]
    tables = tabled(
        state, thickness,
        materials={f"m{k}": law for k, law in enumerate(laws)},
        bodies={
            name: {"material": f"m{k}", "element": str(pick(rng, "quad8", "quad9")),
                   "supports": {"start": "y", "end": "x"},
                   "shape": {"kind": "sector", "radii": [ring.inner, ring.outer],
                             "angles": [0, 90], "size": (ring.outer - ring.inner) / n}}
            for k, (name, ring) in enumerate(zip(names, made, strict=True))
        },
        contacts=[{"name": f"c{k}", "slave": f"r{k + 1}.inner", "master": f"r{k}.outer",
                   "friction": float(pick(rng, 0.0, 0.3)),
                   **({"interference": f} if f > 0 else {"gap": -f})} for k, f in enumerate(fit)],
        loads=[
            *([{"body": "r0", "kind": "temperature", "rise": heat,
                "expansion": 1.2e-5}] * (heat > 0)),
            *([{"body": "r0", "kind": "pressure", "boundary": "inner", "value": inside,
                "amplitude": {"fitted": 0, "loaded": 1, "let": 0}}] * (inside > 0)),
        ],
        stages=stages("fitted", "loaded", "let", increments=int(pick(rng, 1, 3))),
        results={"samples": 11, "points": {
            name: {"body": name, "at": [m * math.cos(0.6), m * math.sin(0.6)]}
            for name, m in zip(names, mid, strict=True)}},
    )  # fmt: skip
    known = {
        s: fitted(made, fit, f * inside)
        for s, f in (("fitted", 0.0), ("loaded", 1.0), ("let", 0.0))
    }
    known["released"] = np.zeros(count + 1)
    level = max(float(np.abs(p).max()) for p in known.values()) or 1e-4 * 2e5
    # quadratic elements: stress is right to about the square of their share of the radius
    rough = EXACT + 0.3 * max((1 - r.inner / r.outer) * r.outer / r.inner / n for r in made) ** 2

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        off, pushed = 0.0, 0.0
        for stage, p in known.items():
            warm = float(stage != "released")
            for k, (name, ring, m) in enumerate(zip(names, made, mid, strict=True)):
                wanted = ring.stress(m, 0.6, p[k], p[k + 1], warm)
                miss = np.abs(run.of("point_stress", name, stage) - wanted)
                off = max(off, float(miss.max()) / max(level, float(np.abs(wanted).max())))
            for k in range(count - 1):
                N = p[k + 1] * radii[k + 1] * math.pi / 2 * thickness
                size = level * radii[k + 1] * thickness
                pushed = max(pushed, near(run.contact(f"c{k}", stage)[0], N, size))
        return {"Lame stress": Figure(off, rough), "Lame force": Figure(pushed, rough)}

    what = f"{count} rings, {state}, fits {[f'{f:.2g}' for f in fit]}, {heat:g} K, {n} elements"
    return Draw(what, (tables,), check)
