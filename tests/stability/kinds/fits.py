"""Hubs fitted on shafts of every size, and pushed along them, less or more than friction bears.

Both are as long as each other between smooth walls (plane strain), or the hub is free and pushed.
The pressure is Lame's for two materials; friction bears a push up to its coefficient times the
force of the fit, and cohesion times the area beside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Coulomb,
    Material,
    Model,
    Solution,
    Stage,
    Traction,
    solve,
)
from solver.mesh import grid
from tests.stability.trial import Figure, Scene, brief, tells

COUNT = 6
SEED = 1852
SHARES = (0.0, 0.4, 3.0)
"""Push over what friction bears of a hub between walls."""
BORNE = (0.5, 1.5)
"""What friction may bear of a free hub, over the same: the hub shrinks along or grows around, and
shear turns the stress that presses it on the shaft."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A hub and a shaft [N, mm, MPa]; ``squeeze`` is the interference over the shaft's radius."""

    radius: float
    outer: float
    squeeze: float
    gap: float
    stiffness: float
    poisson: tuple[float, float]
    friction: float
    cohesion: float
    share: float
    steps: int
    element: str

    @property
    def materials(self) -> tuple[Material, Material]:
        """Of shaft and hub."""
        return tuple(
            Material(youngs_modulus=E, poisson_ratio=nu)
            for E, nu in zip((2e5, 2e5 * self.stiffness), self.poisson, strict=True)
        )  # type: ignore[return-value]

    @property
    def closing(self) -> float:
        """What is left of the interference when the gap has closed [mm]."""
        return (self.squeeze - self.gap) * self.radius

    @property
    def pressure(self) -> float:
        """Lame's pressure in plane strain [MPa]."""
        (inside, outside), k = self.materials, self.outer**2
        soft = [
            (1 + m.poisson_ratio) / m.youngs_modulus * of
            for m, of in (
                (inside, 1 - 2 * inside.poisson_ratio),
                (outside, (1 - 2 * outside.poisson_ratio + k) / (k - 1)),
            )
        ]
        return max(self.closing, 0.0) / (self.radius * sum(soft))

    @property
    def area(self) -> float:
        """Of the contact [mm2]."""
        return 2 * np.pi * self.radius * self.length

    @property
    def length(self) -> float:
        """Of the hub [mm]."""
        return 2 * self.radius

    @property
    def push(self) -> float:
        """Pressure on the end of the hub [MPa]."""
        borne = (self.friction * self.pressure + self.cohesion * self.pressure) * self.area
        end = np.pi * self.radius**2 * (self.outer**2 - 1)
        return self.share * borne / end

    def solve(self) -> Solution:
        """Return the fit, and what the push makes of it."""
        R, L = self.radius, self.length
        z = np.linspace(0, L, 9)
        pushed = self.share > 0
        time = np.array([0.0, 1.0, 2.0])
        load = Traction(boundary="top", y=-self.push, amplitude=Amplitude(time, [0, 0, 1]))
        inside, outside = self.materials
        given = {"kinematics": "axisymmetric", "element": self.element}
        shaft = Body(name="shaft", mesh=grid(np.linspace(0, R, 4), z), material=inside,
                     supports={"bottom": "y", "top": "y"}, **given)  # fmt: skip
        hub = Body(name="hub", mesh=grid(R * np.geomspace(1, self.outer, 13), z), material=outside,
                   supports={} if pushed else {"bottom": "y", "top": "y"},
                   loads=(load,) if pushed else (), **given)  # fmt: skip
        law = Coulomb(friction=self.friction, cohesion=self.cohesion * self.pressure)
        pair = ContactPair(
            slave=("hub", "left"), master=("shaft", "right"), friction=law, gap=self.gap * R,
            interference=self.squeeze * R, amplitude=Amplitude(time, [0, 1, 1]),
        )  # fmt: skip
        stages = [Stage(name="fitted", target=1.0, steps=self.steps)]
        stages += [Stage(name="pushed", target=2.0, steps=8)] if pushed else []
        return solve(Model(bodies=(shaft, hub), contacts=(pair,)), stages=stages)


def judge(fit: Fit, solution: Solution) -> dict[str, Figure]:
    """Return the figures: Lame's pressure between walls, the balance of a push."""
    last = solution.stages["pushed" if fit.share else "fitted"]
    contact = last.state.contacts[0]
    N, T = contact.normal, contact.tangential
    force = max(fit.pressure * fit.area, 1e-12)
    figures = {"tension": Figure(-float(N.min()) / force, 0.0)}
    area = solution.system.interfaces[0].pairing(last.state.u).area
    bound = np.minimum(fit.friction * N + fit.cohesion * fit.pressure * area,
                       (fit.friction + (fit.cohesion > 0)) * N)  # fmt: skip
    figures["cone"] = Figure(float((np.abs(T) - bound).max()) / force, 1e-7)
    if fit.share:
        pushed = fit.push * np.pi * fit.radius**2 * (fit.outer**2 - 1)
        figures["push"] = Figure(abs(abs(T.sum()) - pushed) / pushed, 1e-6)
    else:
        # the smallest ring of elements sets the error of the hub
        figures["force"] = Figure(abs(float(N.sum()) - fit.pressure * fit.area) / force, 5e-3)
        figures["nothing"] = Figure(float(N.sum()) * (fit.closing <= 0), 0.0)
    name = "pushed" if fit.share else "fitted"
    return figures | {"audit": Figure(float(len(solution.audit(name).violations)), 0.0)}


def draw(number: int, rng: np.random.Generator) -> Fit:
    """Return a fit: of a watch or of a wheel set, tight, loose, soft or stiff."""
    share = SHARES[number % len(SHARES)]
    friction = float(rng.choice([0.05, 0.3, 1.0]))
    squeeze = float(10 ** rng.uniform(-6, -2.5))
    loose = float(rng.choice([0.0, 0.0, 0.5, 2.0])) if not share else 0.0
    return Fit(
        radius=float(10 ** rng.uniform(-2, 3)),
        outer=float(rng.choice([1.2, 2.0, 5.0])),
        squeeze=squeeze,
        gap=loose * squeeze,
        stiffness=float(rng.choice([1e-2, 1.0, 1e2])),
        poisson=(float(rng.choice([0.0, 0.3, 0.49])), float(rng.choice([0.0, 0.3, 0.49]))),
        friction=friction,
        cohesion=float(rng.choice([0.0, 0.0, 0.1])),
        share=share,
        steps=int(rng.choice([1, 4])),
        element=("quad8", "quad9")[number % 2],
    )


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the fits."""
    rng = np.random.default_rng(SEED)
    fits = [draw(number, rng) for number in range(count)]
    return [
        Scene(
            what=brief(f),
            run=f.solve,
            judge=partial(judge, f),
            # the time: the push begins at 1 and is whole at 2
            safe=1 + BORNE[0] / f.share if f.share > 1 else np.inf,
            certain=1 + BORNE[1] / f.share if f.share else np.inf,
            # with so much friction a fit can lose pressure by slipping
            honest=tells("no contact forces") if f.share > 1 and f.friction >= 1 else None,
            load=2.0 if f.share else 1.0,
        )
        for f in fits
    ]
