"""Draws of scene files: what is declared, what a record tells, and the words of their tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from solver import Record
from tests.stability.trial import Figure, Figures

STATES = ("plane_stress", "plane_strain", "axisymmetric")
PLANE = STATES[:2]
EXACT = 1e-5
"""Miss of what elements hold exactly: force is in balance to 1e-6 of its level."""
LEAN = 3.0
"""Normals of a contact of half-width a lean by a / R: forces along them add up to more than their
resultant by so many squares of that, at most."""
PEAK = 0.05
"""Miss of the peak of Hertz in a contact that passes its audit."""

COARSE = "AUDIT_FAILED.*audit_contact_resolution"
LATE = "AUDIT_FAILED.*audit_touch_time"
"""A block that tips lifts off at its back, and touches again when it is dragged back."""
LARGE = "OUTSIDE_THEORY.*plastic strain"

Tables = dict[str, Any]
Rng = np.random.Generator


class Draw(NamedTuple):
    """Scene files that solve one problem, in different increments or meshes, and what is known.

    ``excused`` are patterns, one of which the status and message of a run that is not ok must have.
    ``limit`` says that no equilibrium exists.
    """

    what: str
    files: tuple[Tables, ...]
    check: Callable[[Sequence[Told]], Figures]
    excused: tuple[str, ...] = ()
    limit: bool = False


@dataclass(frozen=True)
class Told:
    """A record, by the names that its file gives."""

    tables: Tables
    record: Record

    def of(self, name: str, part: str, stage: str) -> Any:
        """Return a field of a named point, part or contact at the end of a stage."""
        dims, values = self.record.fields[name]
        names = [str(n) for n in self.record.coordinates[dims[0]]]
        stages = [each["name"] for each in self.tables["stages"]]
        if dims[1] == "increment":
            at = sum(s["increments"] for s in self.tables["stages"][: stages.index(stage) + 1])
            return float(values[names.index(part), at])
        return values[names.index(part), list(self.record.coordinates["stage"]).index(stage)]

    def both(self, name: str, part: str, stage: str) -> np.ndarray:
        """Return the components of a vector along x and y."""
        return np.array([self.of(f"{name}_{axis}", part, stage) for axis in "xy"])

    def contact(self, pair: str, stage: str) -> tuple[float, float]:
        """Return the normal and the tangential force of a pair [N]."""
        normal, tangential = (f"contact_{way}_force" for way in ("normal", "tangential"))
        return self.of(normal, pair, stage), self.of(tangential, pair, stage)

    @property
    def stages(self) -> list[str]:
        """Names of the stages."""
        return [each["name"] for each in self.tables["stages"]]


# -- tables ----------------------------------------------------------------------------------------


def near(of: float, to: float, scale: float = 0.0) -> float:
    """Return the miss of a number over the one it must be, or over a scale."""
    return abs(of - to) / (scale or abs(to))


def between(share: float, low: float, high: float) -> Figure:
    """Return how far a peak is outside of two known ones."""
    return Figure(max(low - share, share / high - 1, 0.0), PEAK)


def no_slip(kappa: float) -> float:
    """Return the peak of a rigid cylinder that does not slip over that without friction.

    A flat strip of half-width t that does not slip has cosh(pi eta) / (pi t) of its force per area
    in its middle, with eta = ln(kappa) / (2 pi): Johnson (1985), 2.8(b). The cylinder is the sum of
    strips that grow; for its force a is smaller by sqrt(1 + 4 eta^2). With friction the peak is
    between both.
    """
    eta = math.log(kappa) / (2 * math.pi)
    return math.cosh(math.pi * eta) * math.sqrt(1 + 4 * eta**2)


def stages(*names: str, increments: int, release: bool = True) -> list[Tables]:
    """Return stages of as many increments, and a release."""
    out: list[Tables] = [{"name": name, "increments": increments} for name in names]
    return out + [{"name": "released", "increments": increments, "release": True}] * release


def box(x: tuple[float, float], y: tuple[float, float], size: float, **more: Any) -> Tables:
    """Return the table of a rectangle."""
    return {"kind": "rectangle", "x": list(x), "y": list(y), "size": size, **more}


def pick(rng: Rng, *choices: Any) -> Any:
    """Return one of these."""
    return choices[int(rng.integers(len(choices)))]


def elastic(rng: Rng) -> Tables:
    """Return the table of an elastic material."""
    return {
        "youngs_modulus": float(pick(rng, 2e5, 7e4, 3e3)),
        "poisson_ratio": float(pick(rng, 0.0, 0.3, 0.45)),
    }


def tabled(state: str, thickness: float, **tables: Any) -> Tables:
    return {"name": "drawn", "kinematics": state, "thickness": thickness, **tables}
