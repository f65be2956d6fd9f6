"""Wear and fretting of a contact, from its pressure, shear and slip over a cycle."""

from __future__ import annotations

import numpy as np

from solver.typing import Array


def archard_depth(pressure: Array, slip: Array, coefficient: float) -> Array:
    """Return the depth (n,) worn in a cycle, coefficient times the integral of pressure over slip.

    Parameters
    ----------
    pressure, slip : (n_instants, n); slip is accumulated or relative [MPa, mm]
    coefficient : k / H of Archard's law [1/MPa]

    References
    ----------
    J.F. Archard, J. Appl. Phys. 24 (1953) 981-988.
    """
    moved = np.abs(np.diff(slip, axis=0))
    return np.asarray(coefficient * ((pressure[1:] + pressure[:-1]) / 2 * moved).sum(axis=0))


def slip_work(shear: Array, slip: Array) -> Array:
    """Return the frictional work (n,) of a cycle per area [N/mm]; arguments as in `archard_depth`.

    What slips between two instants has reached its shear by the second one. Friction acts against
    slip: the work is positive whatever the signs.
    """
    return np.asarray(np.abs(shear[1:] * np.diff(slip, axis=0)).sum(axis=0))


def ruiz(tension: Array, shear: Array, slip: Array) -> Array:
    """Return Ruiz's fretting parameter (n,), largest tension along the surface x shear x slip.

    Parameters
    ----------
    tension, shear, slip : (n_instants, n) [MPa, MPa, mm]; of slip its range counts

    References
    ----------
    C. Ruiz, P.H.B. Boddington, K.C. Chen, Exp. Mech. 24 (1984) 208-217.
    """
    largest = np.maximum(tension, 0.0).max(axis=0)
    return np.asarray(largest * np.abs(shear).max(axis=0) * np.ptp(slip, axis=0))
