"""Between which mean pressures a punch without hardening collapses.

Limit analysis knows no elastic constants, and Coulomb friction leaves the collapse load between
that of frictionless and that of welded surfaces (D.C. Drucker, J. Appl. Mech. 21 (1954) 71-74).

*From below.* A column of uniform stress under the pressure, down to the support, everything else
free of stress, balances any pressure up to Re, in plane strain up to 2k = 2/sqrt(3) Re. Its edge
x = a is a line of the mesh, so a finite element solution has this field too: collapse at a lower
load is a wrong answer on every mesh.

*From above.* Mechanisms of welded bodies.

- Plane stress and plane strain: bands that cross inside the punch, which is as high as it is
  wide, and touch neither of its ends: Re and 2k. The column is then exact.
- Axisymmetric: the cylinder of height H becomes uniformly wider on a rough base:
  ``Re (1 + a / (3 sqrt(3) H))``.
- A punch that never yields, plane stress: a thin layer under it gets thicker out of plane:
  2/sqrt(3) Re. Axisymmetric: a rough flat circular punch, 6.05 k (G. Eason, R.T. Shield, ZAMP 11
  (1960) 33-43; there for Tresca, whose yield surface with k = Re / sqrt(3) encloses that of von
  Mises). Plane strain: L. Prandtl's (2 + pi) k, or less where the punch splits a small block.

A mesh makes mechanisms stiffer, so that it may carry a little more than the exact limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

PUNCH_HEIGHT = 2.0
"""Of the punch, in half-widths a."""
BLOCK_SIZE = 4.0
"""Width and depth of the half-plane, in half-widths a."""
_K = 1 / np.sqrt(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Collapse:
    """Mean pressure over yield stress: none collapse below ``safe``, all do above ``certain``."""

    safe: float
    certain: float


def collapse(state: str, *, elastic_punch: bool) -> Collapse:
    """Return the bounds of the collapse load of the punch without hardening."""
    certain = {
        (False, "plane_stress"): 1.0,
        (False, "plane_strain"): 2 * _K,
        (False, "axisymmetric"): 1 + _K / (3 * PUNCH_HEIGHT),
        (True, "plane_stress"): 2 * _K,
        (True, "plane_strain"): min((2 + np.pi) * _K, _splitting()),
        (True, "axisymmetric"): 6.05 * _K,
    }[elastic_punch, state]
    return Collapse(safe=float(2 * _K if state == "plane_strain" else 1.0), certain=float(certain))


def _splitting() -> float:
    """Return the pressure at which a wedge under the punch pushes the block's flank aside.

    The wedge has flanks of slope alpha and goes down with velocity 1; from its tip a line of
    slope beta runs down to the block's free side, and what lies above slides along it with
    velocity w. The least dissipation on both lines, over all slopes, balances the pressure.
    """
    alpha, beta = np.meshgrid(np.radians(np.arange(20, 75)), np.radians(np.arange(75)))
    depth = np.tan(alpha) + BLOCK_SIZE * np.tan(beta)
    w = np.cos(alpha) / np.sin(alpha + beta)  # the jump at the wedge is along its flank
    at_wedge = np.hypot(w * np.cos(beta), 1 - w * np.sin(beta)) / np.cos(alpha)
    pressure = _K * (at_wedge + w * BLOCK_SIZE / np.cos(beta))
    return float(pressure[depth < BLOCK_SIZE].min())
