"""The outlines of bodies that a run stores: what they enclose, and maps that end at them."""

from __future__ import annotations

import numpy as np
import scipy  # loads ndimage when it is used: maps on meshes do not need it
import xarray as xr
from matplotlib.path import Path

from studies.views.plots.fields import OUTLINE, is_half, map_axes

Array = np.ndarray
_ON_LINE = 1e-9
"""Ratio of a position to the size of the bodies; below it a point is on the line of symmetry."""


def outlines_of(run: xr.Dataset, across: str, up: str) -> list[Array]:
    """Return the outlines (2, n) of bodies over two axes, of both halves; none if not stored."""
    names = [f"{OUTLINE}_{axis}" for axis in (across, up)]
    if not all(name in run for name in names):
        return []
    X = np.stack([run[name].to_numpy().squeeze() for name in names])
    known = np.isfinite(X[0])
    begins = np.flatnonzero(known & ~np.append(False, known[:-1]))
    ends = np.flatnonzero(known & ~np.append(known[1:], False)) + 1
    curves = [X[:, begin:end] for begin, end in zip(begins, ends, strict=True)]
    if is_half(run):
        curves += [curve[:, ::-1] * [[-1.0], [1.0]] for curve in curves]
    return curves


def lines_of(curves: list[Array], run: xr.Dataset) -> list[Array]:
    """Return the pieces (n, 2) of outlines that are borders: not the line of symmetry."""
    if not is_half(run):
        return [curve.T for curve in curves]
    near = _ON_LINE * max(np.ptp(curve) for curve in curves)
    found = []
    for curve in curves:
        inner = (np.abs(curve[0]) < near).astype(int)
        cuts = np.flatnonzero(inner[1:] & inner[:-1]) + 1
        found += [piece.T for piece in np.split(curve, cuts, axis=1) if piece.shape[1] > 1]
    return found


def clip_of(curves: list[Array]) -> Path:
    """Return what the outlines enclose: a body is on the left of each."""
    return Path.make_compound_path(*(Path(curve.T, closed=True) for curve in curves))


def reaching(values: xr.DataArray, curves: list[Array]) -> xr.DataArray:
    """Return a map in which places outside of the bodies have the value of the nearest place.

    So it reaches their outlines. What is unknown inside of them stays unknown.
    """
    across, up = map_axes(values)
    whole = values.transpose(up, across)
    places = np.stack(np.meshgrid(whole[across], whole[up]), axis=-1).reshape(-1, 2)
    turns = np.zeros(len(places), dtype=int)
    for curve in curves:
        way = np.sign(curve[0] @ np.roll(curve[1], -1) - curve[1] @ np.roll(curve[0], -1))
        turns += int(way) * Path(curve.T).contains_points(places)
    there = whole.notnull().to_numpy()
    outside = (turns <= 0).reshape(there.shape) & ~there
    if not there.any():
        return values
    nearest = scipy.ndimage.distance_transform_edt(
        ~there, return_distances=False, return_indices=True
    )
    filled = np.where(outside, whole.to_numpy()[tuple(nearest)], whole.to_numpy())
    return whole.copy(data=filled)
