"""Stress intensity of a surface crack from the stress along depth of the body without it."""

from __future__ import annotations

import numpy as np

from solver.errors import ModelError
from solver.typing import Array

_ANGLE, _WEIGHT = np.polynomial.legendre.leggauss(96)
_PLACE = np.sin((_ANGLE + 1) * np.pi / 4)
"""Depths over the length of the crack; equal steps of angle take the singularity away."""
_SHARE = _PLACE**2
_SERIES = np.polynomial.Polynomial([0.2945, -0.3912, 0.7685, -0.9942, 0.5094])
_FACTOR = _WEIGHT * np.pi / 4 * (1 + (1 - _SHARE) * _SERIES(_SHARE))


def stress_intensity(depth: Array, stress: Array, lengths: Array) -> Array:
    """Return K_I (..., n) of an edge crack straight into a half-plane [MPa sqrt(mm)].

    K is linear in the stress. Negative values mean closed faces, on which a part of another load is
    lost: add the stresses of all loads first, or see `opened_range`.

    Parameters
    ----------
    depth : (m,) increasing, from the surface [mm]
    stress : (..., m) normal stress across the plane of the crack, linear in between [MPa]
    lengths : (n,) lengths of the crack, up to the last depth [mm]

    References
    ----------
    R.J. Hartranft, G.C. Sih, Methods of Analysis and Solutions of Crack Problems, Noordhoff (1973),
    chapter 4: the weight function, to .01 % for uniform stress.
    """
    lengths = np.atleast_1d(np.asarray(lengths, dtype=float))
    if lengths.min() <= 0 or lengths.max() > depth[-1]:
        raise ModelError("lengths", lengths.tolist(), f"must be above 0, at most {depth[-1]:g} mm")
    at = np.multiply.outer(lengths, _PLACE)
    flat = np.reshape(stress, (-1, len(depth)))
    each = np.array([np.interp(at, depth, own) for own in flat]) @ _FACTOR
    return np.asarray((each * 2 * np.sqrt(lengths / np.pi)).reshape(*np.shape(stress)[:-1], -1))


def opened_range(largest: Array, smallest: Array) -> Array:
    """Return the part of a range of K (n,) in which the crack is open: K < 0 counts as zero."""
    return np.maximum(largest, 0.0) - np.maximum(smallest, 0.0)


def arrest(lengths: Array, opened: Array, threshold: float) -> tuple[float, float]:
    """Return the length at which a crack that grows stops, and the smallest range before.

    It is infinite if the crack grows through all lengths, and NaN if it reaches one whose range is
    not known. The smallest range is that of the lengths before this one.

    Parameters
    ----------
    lengths : (n,) increasing, from the initial one on [mm]
    opened : (n,) range of K in which it is open, linear in between [MPa sqrt(mm)]
    threshold : range below which a crack does not grow
    """
    known = opened[: np.isnan(np.append(opened, np.nan)).argmax()]
    least = float(known.min()) if known.size else np.nan
    if not least < threshold:
        return np.inf if known.size == len(opened) else np.nan, least
    k = int((known < threshold).argmax())
    around = slice(max(k - 1, 0), k + 1)
    return float(np.interp(-threshold, -known[around], lengths[around])), least
