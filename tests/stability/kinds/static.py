"""The static scenes at parameters that nobody would choose: every size, modulus and load.

Each is computed twice, the second time with lengths and moduli in other units: contact pressure,
powers and shares must not change, lengths must grow as the bodies do. Pressure carries the load.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from solver import Record
from studies.scenes.registry import scene_named
from tests.stability.trial import Figure, Scene

COUNT = 4
SEED = 1904
NAMES = ("ball", "rigid_punch", "elastic_punch", "shaft_hub")
SAME = 1e-5
"""What the other units may change, over the largest value: an iteration more or less."""
LENGTHS = ("radius", "half_width")


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A scene, its parameters, the value of its branch, and how the other units differ."""

    name: str
    given: Mapping[str, Any]
    value: float
    longer: float
    stiffer: float

    def runs(self) -> tuple[Record, Record]:
        """Return the record, and that in other units."""
        scaled = {
            name: value * self._factor(name) if isinstance(value, float) else value
            for name, value in self.given.items()
        }
        factor = self._factor(scene_named(self.name).branch)
        value = self.value * factor if factor != 1.0 else self.value
        return self._run(self.given, self.value), self._run(scaled, value)

    def _factor(self, name: str) -> float:
        if name in LENGTHS:
            return self.longer
        stresses = ("youngs_modulus", "yield_stress", "mean_pressure")
        return self.stiffer if name in stresses else 1.0

    def _run(self, given: Mapping[str, Any], value: float) -> Record:
        scene = scene_named(self.name)
        (record,) = scene.path(scene.parameters(**given), [value], lambda share: None)
        return record


def judge(drawn: Drawn, both: tuple[Record, Record]) -> dict[str, Figure]:
    """Return the figures."""
    one, _ = both
    figures = {"audit": Figure(float(sum(not r.status.solved for r in both)), 0.0)}
    if figures["audit"].value:
        return figures
    (_, p), (_, q) = (r.fields["contact_pressure"] for r in both)
    off = np.nanmax(np.abs(q / drawn.stiffer - p)) / np.nanmax(p)
    figures["pressure in other units"] = Figure(float(off), SAME)
    figures["nowhere"] = Figure(float((np.isnan(p) != np.isnan(q)).sum()), 0.0)
    width = [r.scalars["contact_half_width"] for r in both]
    figures["width in other units"] = Figure(abs(width[1] / drawn.longer / width[0] - 1), SAME)
    s, pressure = one.coordinates["s"], np.nan_to_num(p[0])
    at = s >= 0
    if drawn.name == "ball":
        force = np.trapezoid(2 * np.pi * s[at] * pressure[at], s[at])
        figures["force"] = Figure(abs(force / one.scalars["force"] - 1), 0.03)
    elif drawn.name != "shaft_hub":
        force = np.trapezoid(pressure[at], s[at]) / (one.parameters.half_width * drawn.value)
        # what the last sample leaves out of the singular pressure
        figures["force"] = Figure(abs(force - 1), 0.03)
    figures["tension"] = Figure(-float(np.nanmin(p)) / np.nanmax(p), 1e-9)
    return figures


def draw(number: int, rng: np.random.Generator) -> Drawn:
    """Return a scene."""
    name = NAMES[number % len(NAMES)]
    modulus = float(10 ** rng.uniform(1, 6))
    size = float(10 ** rng.uniform(-1.5, 3))
    given: dict[str, Any] = {
        "accuracy": "draft", "youngs_modulus": modulus,
        "poisson_ratio": float(rng.choice([0.0, 0.2, 0.3, 0.45])),
    }  # fmt: skip
    if name == "ball":
        given |= {
            "radius": size, "yield_stress": modulus * float(10 ** rng.uniform(-3.5, -2)),
            "yielding": str(rng.choice(["half_space", "ball"])),
            "hardening": str(rng.choice(["none", "isotropic", "kinematic"])),
            "load_step": 0.25, "load_ratio": float(rng.choice([0.3, 1.0, 2.0, 4.0])),
        }  # fmt: skip
        value = 1  # cycle
    else:
        given |= {"half_width": size, "friction": float(rng.choice([0.0, 0.1, 0.4, 1.0, 10.0]))}
        value = modulus * float(10 ** rng.uniform(-8, -1))
    if name == "shaft_hub":
        given |= {
            "loading": str(rng.choice(["pressure", "interference"])),
            "shaft_radius": float(rng.choice([0.3, 1.0, 4.0])),
            "hub_radius": float(rng.choice([1.2, 2.5, 8.0])),
        }
    if name == "elastic_punch":
        given |= {"state": str(rng.choice(["plane_strain", "plane_stress"]))}
        given |= {"half_plane_size": float(rng.choice([5.0, 40.0]))}
    return Drawn(
        name=name, given=given, value=value, longer=float(10 ** rng.uniform(-1.5, 1.5)),
        stiffer=float(10 ** rng.uniform(-1, 1)),
    )  # fmt: skip


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the scenes."""
    rng = np.random.default_rng(SEED)
    each = [draw(number, rng) for number in range(count)]
    return [
        Scene(what=f"{d.name} {dict(d.given)} {d.value:.4g}, {d.longer:.3g}, {d.stiffer:.3g}",
              run=d.runs, judge=partial(judge, d))
        for d in each
    ]  # fmt: skip
