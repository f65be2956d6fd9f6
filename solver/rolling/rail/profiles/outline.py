"""Closed curves of straight lines and arcs, such as the outline of a section."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from solver.rolling.rail.profiles.points import checked_points
from solver.typing import Array, Ints

Pair = tuple[float, float]


_POINTS = 16
"""Number of Gauss points of a piece in integrals: exact to rounding for arcs up to a half
circle."""
_SAMPLES = 2001
"""Number of samples in the search for the highest point."""
_ARC = 0.1
"""Length of the arcs along a spline [mm]."""
_SHORT = 1e-9
"""Length of a piece over the whole length below which it is left out."""


@dataclass(frozen=True, slots=True)
class RoundedCorner:
    """A corner of a polygon, rounded by arcs that are tangent to each other and to both sides.

    Attributes
    ----------
    at : its position [mm]
    radii : of the arcs, in order [mm]; none leaves it sharp
    turns : angle by which each arc turns [rad], positive; empty for a single arc
    """

    at: Pair
    radii: tuple[float, ...] = ()
    turns: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Outline:
    """A closed curve, counterclockwise, whose pieces are straight lines and arcs.

    Places on it are lengths along the curve from its first joint.

    Attributes
    ----------
    joints : (2, n) ends of the pieces, in order [mm]
    bends : (n,) curvature of the piece from each joint to the next [1/mm]; positive turns left
    """

    joints: Array
    bends: Array

    @classmethod
    def rounded(cls, corners: Sequence[RoundedCorner]) -> Outline:
        """Return the polygon of these corners, counterclockwise, with rounded corners.

        The sides must have room for the arcs at their ends.
        """
        X = np.array([corner.at for corner in corners], dtype=float)
        sides = np.roll(X, -1, axis=0) - X
        units = sides / np.hypot(*sides.T)[:, None]
        joints, bends = [], []
        for k, corner in enumerate(corners):
            before, after = units[k - 1], units[k]
            turn = np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)
            turns = np.sign(turn) * np.array(corner.turns or [abs(turn)] * len(corner.radii))
            radii = np.array(corner.radii, dtype=float)
            steps = arcs(float(np.arctan2(before[1], before[0])), radii, turns)
            whole = np.column_stack([before, after])
            back = np.linalg.solve(whole, steps.sum(axis=1))[0] if len(radii) else 0.0
            ends = (X[k] - back * before)[:, None] + np.cumsum(np.c_[np.zeros(2), steps], axis=1)
            joints.append(ends)
            bends.append(np.append(np.sign(turn) / radii, 0.0))
        found = cls(np.hstack(joints), np.concatenate(bends))
        kept = found.lengths > _SHORT * found.length
        return cls(found.joints[:, kept], found.bends[kept])

    @property
    def _chords(self) -> Array:
        return np.roll(self.joints, -1, axis=1) - self.joints

    @property
    def lengths(self) -> Array:
        """Length of each piece (n,) [mm]."""
        chord = np.hypot(*self._chords)
        half = np.arcsin(np.clip(self.bends * chord / 2, -1, 1))
        return np.asarray(chord / np.sinc(half / np.pi))

    @property
    def length(self) -> float:
        """Length of the curve [mm]."""
        return float(self.lengths.sum())

    def at(self, s: Array) -> Array:
        """Return the points (2, ...) at lengths ``s`` along the curve [mm]."""
        piece, along = self._found(s)
        bend = self.bends[piece]
        heading = self._headings[piece] + bend * along / 2
        chord = along * np.sinc(bend * along / (2 * np.pi))
        return self.joints[:, piece] + chord * np.stack([np.cos(heading), np.sin(heading)])

    def direction(self, s: Array) -> Array:
        """Return the unit tangents (2, ...) at lengths ``s`` along the curve."""
        piece, along = self._found(s)
        heading = self._headings[piece] + self.bends[piece] * along
        return np.stack([np.cos(heading), np.sin(heading)])

    def curvature(self, s: Array) -> Array:
        """Return the curvature (...) at lengths ``s`` [1/mm]; positive turns left."""
        return self.bends[self._found(s)[0]]

    @property
    def _headings(self) -> Array:
        """Direction (n,) in which each piece begins [rad]."""
        chords = self._chords
        return np.arctan2(chords[1], chords[0]) - self.bends * self.lengths / 2

    def _found(self, s: Array) -> tuple[Ints, Array]:
        """Return the pieces at lengths ``s``, and the lengths from the beginnings of the pieces."""
        starts = np.cumsum([0.0, *self.lengths[:-1]])
        s = np.asarray(s, dtype=float) % self.length
        piece = np.searchsorted(starts, s, side="right") - 1
        return piece, s - starts[piece]

    def highest(self, between: Pair) -> float:
        """Return the length of the highest point of a part [mm]."""
        s = np.linspace(*between, _SAMPLES)
        k = int(self.at(s)[1].argmax())
        near = s[max(k - 1, 0)], s[min(k + 1, _SAMPLES - 1)]
        before, after = self.direction(np.array(near))[1]
        if not before > 0 > after:
            return float(s[k])
        return float(
            scipy.optimize.brentq(lambda s: self.direction(np.array(s))[1], *near, xtol=1e-12)
        )

    # -- area ----------------------------------------------------------------------------------

    @property
    def area(self) -> float:
        """Area [mm2]."""
        return float(self._moments()[0])

    @property
    def second_moments(self) -> Array:
        """Second moments of area about the centroid (2, 2): integrals of products [mm4]."""
        return self._moments()[1]

    def _moments(self) -> tuple[float, Array]:
        """Return area and second moments about the centroid, by Green's theorem.

        The integral of a homogeneous function of degree d over the area is 1 / (d + 2) of its
        integral times the distance of the tangent from the origin over the curve.
        """
        xi, weights = np.polynomial.legendre.leggauss(_POINTS)
        lengths = self.lengths
        starts = np.cumsum([0.0, *lengths[:-1]])
        s = (starts[:, None] + lengths[:, None] * (1 + xi) / 2).ravel()
        X, t = self.at(s), self.direction(s)
        dA = (X[0] * t[1] - X[1] * t[0]) * np.outer(lengths / 2, weights).ravel()
        area = dA.sum() / 2
        centroid = X @ dA / 3 / area
        second = (X * dA) @ X.T / 4 - area * np.outer(centroid, centroid)
        return area, second

    # -- motions -------------------------------------------------------------------------------

    def moved(self, by: Pair) -> Outline:
        """Return the curve moved by (z, y) [mm]."""
        return replace(self, joints=self.joints + np.array(by)[:, None])

    def turned(self, angle: float) -> Outline:
        """Return the curve turned about the origin, counterclockwise [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        return replace(self, joints=np.array([[c, -s], [s, c]]) @ self.joints)


def arcs(heading: float, radii: Array, turns: Array) -> Array:
    """Return the chords (2, n) of arcs, each tangent to the one before [mm].

    Parameters
    ----------
    heading : direction in which the first arc begins [rad]
    turns : angle by which each arc turns [rad], positive to the left
    """
    middle = heading + np.cumsum(turns) - turns / 2
    return np.asarray(
        2 * radii * np.sin(abs(turns) / 2) * np.array([np.cos(middle), np.sin(middle)])
    )


def smooth_curve(points: Array) -> tuple[Array, Array]:
    """Return joints and curvatures of short arcs along the cubic spline through points.

    Parameters
    ----------
    points : (2, n) points, the first coordinate increasing [mm]

    Returns
    -------
    joints (2, m) [mm], and the curvature (m - 1,) of the arcs between them [1/mm]

    Raises
    ------
    ModelError
        for ``points``, if they are fewer than four, or do not increase
    """
    X = checked_points(points)
    t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(X)))])
    curve = scipy.interpolate.CubicSpline(t, X, axis=1)
    at = np.linspace(0.0, t[-1], max(2, round(t[-1] / _ARC)) + 1)
    (dx, dy), (ax, ay) = curve((at[1:] + at[:-1]) / 2, 1), curve((at[1:] + at[:-1]) / 2, 2)
    return curve(at), (dx * ay - dy * ax) / np.hypot(dx, dy) ** 3
