"""Computed profiles set beside published numbers, with the convergence of the computation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.views.comparison.profiles import Computed, Level
from studies.views.comparison.reference import Published


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One published number beside the computed ones.

    Attributes
    ----------
    published : where the number comes from
    is_depth : whether it is the depth of the feature, or its value
    ours : level -> computed number, from coarse to fine; NaN where there is no such feature
    difference : of the finest computed number from the published one, or from its nearer bound.
        The finest has the smallest first size of its `Level`, and of several such runs the
        smallest second one
    changes : for each refinement, the change between its two finest levels, all else equal
    orders : for each refinement, the order at which its three finest levels settle, all else
        equal; NaN where there are fewer, or where they do not settle
    """

    published: Published
    is_depth: bool
    ours: Mapping[Level, float]
    difference: float
    changes: tuple[float, ...]
    orders: tuple[float, ...]

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of the published number, equal unless it was published by bounds."""
        return self.published.depth_bounds if self.is_depth else self.published.value_bounds

    @property
    def unit(self) -> str:
        """Unit of all numbers."""
        return "mm" if self.is_depth else self.published.unit


def compare(
    computed: Computed, published: Sequence[Published]
) -> tuple[list[Comparison], list[Published]]:
    """Return published numbers with what was computed, and those that were not computed."""
    compared: list[Comparison] = []
    absent: list[Published] = []
    for each in published:
        features = _features(computed, each)
        if not features:
            absent.append(each)
            continue
        for is_depth in (False, True):
            if each.has_depth if is_depth else each.has_value:
                ours = {level: found[is_depth] for level, found in features.items()}
                compared.append(_comparison(each, is_depth, ours))
    return compared, absent


def _features(computed: Computed, published: Published) -> dict[Level, tuple[float, float]]:
    """Return value and depth of a feature at each level that it was computed at."""
    own = computed.profiles.get(published.key, {})
    found = {level: profile.feature(published) for level, profile in own.items()}
    if published.reference is None:
        return found
    other = computed.profiles.get(published.reference, {})
    whole = {level: profile.feature(published)[0] for level, profile in other.items()}
    return {
        level: (100.0 * (value / whole[level] - 1.0) if whole[level] else np.nan, depth)
        for level, (value, depth) in found.items()
        if level in whole
    }


def _comparison(published: Published, is_depth: bool, ours: Mapping[Level, float]) -> Comparison:
    finest = min(ours)
    low, high = published.depth_bounds if is_depth else published.value_bounds
    return Comparison(
        published=published,
        is_depth=is_depth,
        ours=ours,
        difference=float(ours[finest] - np.clip(ours[finest], low, high)),
        changes=tuple(_change(_line(ours, axis)) for axis in range(len(finest))),
        orders=tuple(_order(_line(ours, axis)) for axis in range(len(finest))),
    )


def _line(ours: Mapping[Level, float], axis: int) -> list[tuple[float, float]]:
    """Return size and number, from fine to coarse, of levels that differ along one axis only.

    Of several such lines, that whose two finest sizes, which make the change, are the finest; of
    several of these, the one that is finest otherwise.
    """
    lines: dict[Level, list[tuple[float, float]]] = defaultdict(list)
    for level, value in sorted(ours.items()):
        lines[level[:axis] + level[axis + 1 :]].append((level[axis], value))
    return min(lines.values(), key=lambda line: [*(size for size, _ in line[:2]), np.inf])


def _change(line: Sequence[tuple[float, float]]) -> float:
    return line[0][1] - line[1][1] if len(line) > 1 else np.nan


def _order(line: Sequence[tuple[float, float]]) -> float:
    """Return p where the three finest numbers differ as ``h^p`` for one ratio of sizes h."""
    if len(line) < 3:
        return np.nan
    (fine, a), (middle, b), (coarse, c) = line[:3]
    if a == b or (c - b) / (b - a) <= 0 or not np.isclose(coarse / middle, middle / fine):
        return np.nan
    return float(np.log((c - b) / (b - a)) / np.log(middle / fine))
