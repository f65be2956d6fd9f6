"""Scene files of cylinders and balls: Hertz, Coulomb, and what friction may add."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from tests.stability.kinds.told import (
    COARSE,
    EXACT,
    LARGE,
    LEAN,
    PEAK,
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
from tests.verification.closed_forms import plane_strain_modulus, prandtl_pressure


class Pressed(NamedTuple):
    """A round body on a block: half-width or radius ``a`` of contact, elements of ``fine`` a.

    ``deep`` is a / R.
    """

    round_axis: bool
    rigid: bool
    a: float
    deep: float
    fine: float
    edges: int
    swapped: bool
    friction: float
    law: Tables
    increments: int

    @property
    def radius(self) -> float:
        """Of the round body [mm]."""
        return self.a / self.deep

    @property
    def modulus(self) -> float:
        """E* [MPa]."""
        E = plane_strain_modulus(self.law["youngs_modulus"], self.law["poisson_ratio"])
        return E if self.rigid else E / 2

    @property
    def force(self) -> float:
        """That presses [N]: Johnson, Contact Mechanics (1985), 4.22 and 4.43."""
        if self.round_axis:
            return 4 / 3 * self.modulus * self.a**2 * self.deep
        return math.pi * self.a * self.deep * self.modulus / 4

    @property
    def peak(self) -> float:
        """Largest pressure [MPa]: 4.24 and 4.45."""
        share = 2 / math.pi if self.round_axis else 0.5
        return share * self.modulus * self.deep

    @property
    def stuck(self) -> float:
        """Peak without slip, on a rigid cylinder, over that without friction."""
        return no_slip(3 - 4 * self.law["poisson_ratio"]) if self.rigid and self.friction else 1.0

    def peaked(self, top: float) -> Figure:
        """Return how far a peak is outside of what it may be."""
        return between(top / self.peak, 1.0, self.stuck)

    def tables(self, *, finer: int = 1, more: int = 1, x: Tables | None = None,
               rotation: Tables | None = None, law: Tables | None = None,
               names: Sequence[str] = ("on",), pushed: Tables | None = None) -> Tables:  # fmt: skip
        """Return the scene file; ``names`` are its stages before the release."""
        a, R = self.a, self.radius
        L, h = 25 * a, self.fine * a / finer
        close = [{"at": [0.0, 0.0], "size": h, "radius": max(1.5, self.fine) * a}]
        start = 0.0 if self.round_axis else -L
        held = {"left": "x", "bottom": "y"} if self.round_axis else {"bottom": "xy"}
        grown = {"size": L / 5, "growth": 1.5, "near": close}
        bodies: Tables = {"block": {"material": "m", "supports": held,
                                    "shape": box((start, L), (-L, 0.0), **grown)}}  # fmt: skip
        rigid, loads = {}, []
        if self.rigid:
            angles = [-90.0, -60.0] if self.round_axis else [-150.0, -30.0]
            rigid = {"tool": {
                "surfaces": {"rim": {"kind": "arc", "centre": [0.0, R], "radius": R,
                                     "angles": angles, "edges": self.edges}},
                "centre": [0.0, R], "y": pushed or {"pushed": -self.force},
                "x": x or {}, "rotation": rotation or {},
            }}  # fmt: skip
        else:
            shape = {"kind": "pad", "width": L, "height": L, "radius": R, **grown}
            # its sides keep it from rocking: as high as its radius it would turn about its centre
            held = {"left": "x", "right": "x"}
            bodies["tool"] = {"material": "m", "shape": shape, "supports": held}
            loads = [{"body": "tool", "kind": "pressure", "boundary": "top",
                      "value": self.force / L}]  # fmt: skip
        sides = ["block.top", "tool.rim" if self.rigid else "tool.bottom"]
        slave, master = sides[::-1] if self.swapped else sides
        return tabled(
            "axisymmetric" if self.round_axis else "plane_strain", 1.0,
            materials={"m": law or self.law}, bodies=bodies, rigid=rigid, loads=loads,
            contacts=[{"name": "c", "slave": slave, "master": master, "friction": self.friction}],
            stages=stages(*names, increments=self.increments * more),
            results={"samples": 801, "points": {"p": {"body": "block", "at": [a / 2, -a]}}},
            outputs={
                "top": {"of": "pressure", "contact": "c", "stage": names[0]},
                "across": {"of": "pressure", "take": "extent", "contact": "c", "stage": names[0]},
            },
        )  # fmt: skip

    @property
    def excused(self) -> tuple[str, ...]:
        """Whether so coarse a contact may fail: with fewer than four vertices across."""
        return (COARSE,) if self.fine > 0.5 else ()

    @property
    def lean(self) -> float:
        """How far the sum of forces along leaning normals may be from their resultant.

        Friction on them, which adds up to nothing along the surface, bears its share across it.
        """
        return EXACT + LEAN * self.deep**2 + self.friction * self.deep

    def figures(self, run: Told) -> Figures:
        """Return the figures of a frictionless press, or one with little friction."""
        (N, _), across = run.contact("c", "on"), run.record.scalars["across"]
        width = self.a * (1 if self.round_axis else 2)
        left = float(np.abs(run.of("point_stress", "p", "released")).max())
        ends = 1 if self.round_axis else 2  # each is known to an element
        return {
            "peak": self.peaked(run.record.scalars["top"]),
            "width": Figure(near(across, width), 0.05 + ends * self.fine * self.a / width),
            "force on arc": Figure(near(N, self.force), self.lean),
            "left": Figure(left / self.peak, EXACT),
        }


def _pressed(number: int, rng: Rng, *, fine: Sequence[float], friction: Sequence[float],
             rigid: bool | None = None, round_axis: bool | None = None) -> Pressed:  # fmt: skip
    axis = number % 3 == 2 if round_axis is None else round_axis
    return Pressed(
        round_axis=axis,
        rigid=axis or (bool(rng.random() < 0.6) if rigid is None else rigid),
        a=float(10 ** rng.uniform(-1.5, 1)),
        deep=float(pick(rng, 0.005, 0.02, 0.04)),
        fine=float(pick(rng, *fine)),
        edges=int(pick(rng, 2, 5, 60)),
        swapped=bool(rng.random() < 0.5),
        friction=0.0 if axis else float(pick(rng, *friction)),
        law=elastic(rng) | {"poisson_ratio": 0.3},
        increments=int(pick(rng, 1, 3)),
    )


def hertz(number: int, rng: Rng) -> Draw:
    """A cylinder or ball on a block, finely or much too coarsely meshed: Hertz."""
    p = _pressed(number, rng, fine=(0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.2, 3.0), friction=(0.0, 0.1))
    check = partial(_all, p.figures)
    return Draw(f"hertz {p}", (p.tables(),), check, p.excused)


def _all(figures: Callable[[Told], Figures], runs: Sequence[Told]) -> Figures:
    """Return the worst figures of runs."""
    every = [figures(run) for run in runs]
    return {n: max((f[n] for f in every), key=lambda f: f.value) for n in every[0]}


def moved(number: int, rng: Rng) -> Draw:
    """A ball pushed into a block by a given way, which also falls between coarse vertices."""
    p = _pressed(number, rng, fine=(0.1, 0.3, 0.6, 1.5, 3.0, 8.0), friction=(0.0,), round_axis=True)
    tables = p.tables(pushed={"moved": -p.a * p.deep})

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        return {"force of a way": Figure(near(run.contact("c", "on")[0], p.force),
                                         PEAK + 0.08 * min(p.fine, 1.0)),
                "peak": p.peaked(run.record.scalars["top"])}  # fmt: skip

    return Draw(f"moved {p}", (tables,), check, p.excused)


def refined(number: int, rng: Rng) -> Draw:
    """The same press, meshed twice as finely: peak and approach agree."""
    p = _pressed(number, rng, fine=(0.2, 0.3, 0.5), friction=(0.0,))
    files = (p.tables(), p.tables(finer=2))

    def check(runs: Sequence[Told]) -> Figures:
        tops = [run.record.scalars["top"] for run in runs]
        return {"meshes agree": Figure(near(tops[0], tops[-1]), PEAK)} | _all(p.figures, runs)

    return Draw(f"refined {p}", files, check, p.excused)


def fretting(number: int, rng: Rng) -> Draw:
    """A cylinder pressed, pushed to and fro by less than friction carries, in more increments."""
    p = _pressed(number, rng, fine=(0.2, 0.35), friction=(0.2, 0.5), rigid=True, round_axis=False)
    share = float(pick(rng, 0.3, 0.7, 0.9))
    Q = share * p.friction * p.force
    x = {"pushed": Q, "amplitude": {"on": 0.0, "to": 1.0, "fro": -1.0, "mid": 0.0}}
    files = tuple(p.tables(more=m, x=x, names=("on", "to", "fro", "mid")) for m in (1, 2, 4))

    def one(run: Told) -> Figures:
        back = {"to": 1.0, "fro": -1.0, "mid": 0.0}
        T = [abs(abs(run.contact("c", s)[1]) - abs(f) * Q) / (p.friction * p.force)
             for s, f in back.items()]  # fmt: skip
        held = [near(run.of("reaction_x", "block", s), -f * Q, p.friction * p.force)
                for s, f in back.items()]  # fmt: skip
        N = max(near(run.contact("c", s)[0], p.force) for s in back)
        return {"tangential force": Figure(max(T), p.deep + p.lean),
                "reaction": Figure(max(held), EXACT),
                "force on arc": Figure(N, p.lean),
                "peak": p.peaked(run.record.scalars["top"])}  # fmt: skip

    def check(runs: Sequence[Told]) -> Figures:
        scale = p.friction * p.peak
        q = [run.of("contact_shear", "c", "to") for run in runs]
        bears = p.friction * np.mean([run.of("contact_pressure", "c", "to") for run in runs])
        off = max(float(np.abs(each - q[-1]).mean() / bears) for each in q)
        moved = [run.of("motion_x", "tool", "to") for run in runs]
        return _all(one, runs) | {
            "increments agree on motion": Figure(max(near(m, moved[-1]) for m in moved), 0.03),
            # the share of friction that the audit lets be unknown
            "increments agree on shear": Figure(off, 0.1),
            "largest shear": Figure(float(np.nanmax(np.abs(q[-1]))) / scale, p.stuck + PEAK),
        }

    return Draw(f"fretting {share} {p}", files, check, p.excused)


def rolled(number: int, rng: Rng) -> Draw:
    """A wheel rolled to and fro, free, driven, locked or guided."""
    p = _pressed(number, rng, fine=(0.25, 0.4), friction=(0.0, 0.3), rigid=True, round_axis=False)
    way = float(pick(rng, 0.3, 1.0)) * p.a
    how = str(pick(rng, "free", "driven", "locked", "guided")) if p.friction else "guided"
    factors = {"on": 0.0, "to": 1.0, "fro": -1.0, "mid": 0.0}
    moment = 0.5 * p.friction * p.force * p.radius
    rotation: Tables = {
        "free": {"pushed": 0.0},
        "driven": {"pushed": moment, "amplitude": {"on": 0.0, "to": 1.0, "fro": 1.0}},
        "locked": {},
        "guided": {"moved": -math.degrees(way / p.radius), "amplitude": factors},
    }[how]
    x = {"moved": way, "amplitude": factors}
    names = tuple(factors)
    p = p._replace(increments=int(pick(rng, 2, 6)))
    tables = p.tables(x=x, rotation=rotation, names=names)
    slides = way > 4 * p.friction * p.deep * p.a

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N = max(near(run.contact("c", s)[0], p.force) for s in names)
        level = max(p.friction, p.deep) * p.force
        balance = max(
            near(run.of("reaction_x", "block", s), -run.of("reaction_x", "tool", s), level)
            for s in names
        )
        up = max(near(run.of("reaction_y", "block", s), p.force) for s in names)
        out = {"force on arc": Figure(N, p.lean),
               "reaction": Figure(max(balance, up), EXACT)}  # fmt: skip
        for stage, f in (("to", 1.0), ("fro", -1.0)):
            T = abs(run.contact("c", stage)[1]) / p.force
            wanted = {"free": 0.0, "driven": moment / p.radius / p.force}.get(how)
            if how == "locked" and slides and p.friction:
                wanted = p.friction
                drawn = near(run.of("reaction_x", "tool", stage), f * p.friction * p.force)
                out["dragged"] = Figure(drawn, p.deep + p.lean)
            if wanted is not None:
                out[f"tangential force {stage}"] = Figure(
                    abs(T - wanted), p.lean + p.deep * max(p.friction, p.deep)
                )
        left = float(np.abs(run.of("point_stress", "p", "released")).max())
        return out | {"left": Figure(left / p.peak, EXACT),
                      "peak": p.peaked(run.record.scalars["top"])}  # fmt: skip

    return Draw(f"{how} by {way:.2g} {p}", (tables,), check, p.excused)


def dented(number: int, rng: Rng) -> Draw:
    """A cylinder that dents what yields: declared force, pressure between known bounds."""
    p = _pressed(number, rng, fine=(0.25, 0.4), friction=(0.0, 0.2), rigid=True, round_axis=False)
    p = p._replace(law={"youngs_modulus": 2e5, "poisson_ratio": 0.3}, increments=8)
    over = float(pick(rng, 0.5, 1.5, 2.5))  # elastic peak over the pressure of first yield
    Y = p.peak / (over * 1.67)
    rule = str(pick(rng, "none", "isotropic", "kinematic"))
    law = p.law | {"yield_stress": Y, "hardening": rule}
    law |= {"hardening_ratio": 0.02} if rule != "none" else {}
    factors = {"on": 1.0, "off": 0.01, "again": 1.0}
    pushed = {"pushed": -p.force, "amplitude": factors}
    tables = p.tables(law=law, names=tuple(factors), pushed=pushed)

    def check(runs: Sequence[Told]) -> Figures:
        (run,) = runs
        N = max(near(run.contact("c", s)[0], f * p.force) for s, f in factors.items())
        top = run.record.scalars["top"]
        bound = prandtl_pressure(Y) if rule == "none" else p.peak
        most = min(p.stuck * p.peak, bound)
        out = {"force on arc": Figure(N, p.lean), "pressure at most": Figure(top / most, 1 + PEAK)}
        if over < 1:
            yielded = float(run.of("point_plastic_strain", "p", "again"))
            out |= {"yields below the limit": Figure(yielded, 0.0),
                    "peak": p.peaked(top)}  # fmt: skip
        return out

    return Draw(f"dented {rule} {over} {p}", (tables,), check, (*p.excused, LARGE))
