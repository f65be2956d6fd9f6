"""A material with a smooth user-defined yield surface and isotropic hardening."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.materials.curves import Curve
from solver.materials.growing import GrowingLaw
from solver.materials.principal_return import Returned, grown, principal_return
from solver.materials.smooth_surface import SmoothSurface, base, falling_angle, polar
from solver.materials.state import PlasticState, Response
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothMaterial(GrowingLaw):
    """An isotropic elastic material that yields on a smooth surface, with associated flow.

    Attributes
    ----------
    surface : the shape of its yield surface

    Raises
    ------
    ModelError
        if the surface is not smooth or not convex, or does not give the stress in tension
    """

    surface: SmoothSurface

    def __post_init__(self) -> None:
        self.surface.check()

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress, tangent and new state by the return in principal stresses."""

        def returned(trial: Array, before: Array) -> Returned:
            G = self.elasticity.shear_modulus
            return smooth_return(trial, before, G, self.curve, self.surface)

        return principal_return(strain, state, self.elasticity, self.curve, self.surface, returned)


def smooth_return(
    trial: Array, before: Array, G: float, curve: Curve, surface: SmoothSurface
) -> Returned:
    """Return to the surface along its normal.

    A deviator has the size r and the Lode angle x; on the surface f(x) r = R(p). The normal has the
    components f along the deviator and f' across it. If the trial stress has size t and angle y:

    1. along: t cos(y - x) = r + 2 G dp f, so that 2 G f^2 dp + R(p + dp) = t cos(y - x) f
    2. across: t sin(y - x) = 2 G dp f', solved for x with dp(x) from step 1. There is one root,
       since a convex surface has only one point nearest to the trial stress: the left side is
       larger below the root and smaller above it
    3. derivative: (I + 2 G dp H)^-1 less its part along the normal, where H = (f + f'') / r is the
       curvature across

    Parameters
    ----------
    trial : (3, n) principal trial stresses s1 >= s2 >= s3 beyond the surface [MPa]
    before : (n,) p, the accumulated plastic strain
    """
    size, angle = polar(trial)
    first = curve.flow_stress(before)

    def solved(x: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return f, f', f + f'', r, dp and the slope of R, each (n,), at angles (n,)."""
        f, slope, bend = surface.at(x)
        along = np.maximum(size * np.cos(angle - x) * f, first)
        growth, hardening = grown(2 * G * f**2, along, before, curve)
        return f, slope, f + bend, curve.flow_stress(before + growth) / f, growth, hardening

    def across(x: Array) -> tuple[Array, Array]:
        f, slope, round_, r, growth, hardening = solved(x)
        excess = size * np.sin(angle - x) - 2 * G * growth * slope
        resisted = 2 * G * slope**2 / (2 * G * f**2 + hardening)
        return excess, -(r * (1 + resisted) + 2 * G * growth * round_)  # exact at the root

    x = falling_angle(across, angle, size)
    f, slope, round_, r, growth, hardening = solved(x)
    out, aside = base(x)
    shrunk = 1 / (1 + 2 * G * growth * round_ / r)
    flow = growth * (f * out + slope * aside)
    m = f * out + shrunk * slope * aside
    stiff = 2 * G * (f**2 + shrunk * slope**2) + hardening
    derivative = out[:, None] * out[None] + shrunk * aside[:, None] * aside[None] + 1 / 3
    return Returned(flow, growth, derivative - 2 * G / stiff * m[:, None] * m[None])
