"""Friction from next to nothing to the largest that is allowed."""

from __future__ import annotations

from solver import Material
from tests.stability.kinds.stacks import Layer, Stack
from tests.stability.trial import Scene

COEFFICIENTS = (0.0, 1e-13, 1e-9, 1e-5, 1e-4, 1.0, 3.0, 10.0)
SOFT = Material(youngs_modulus=2e4, poisson_ratio=0.4)
STRONG = Material(
    youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0, hardening="mixed",
    hardening_ratio=0.02,
)  # fmt: skip


def scenes() -> list[Scene]:
    """Return a soft body, narrower than the other, that widens on it."""
    upper = Layer(material=SOFT, cells=(6, 3))
    lower = Layer(material=STRONG, width=8.0, height=4.0, cells=(10, 4))
    return [
        Stack(
            layers=(upper, lower),
            pressure=280.0,
            friction=friction,
            sliding="finite" if k % 3 == 2 else "small",
            state=("plane_strain", "axisymmetric")[k % 2],
        ).scene()
        for k, friction in enumerate(COEFFICIENTS)
    ]
