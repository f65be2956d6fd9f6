"""Computed profiles set beside published numbers, with the convergence of the computation."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studies.profiles import Computed, Level
from studies.reference import Published


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One published number beside the computed ones.

    Attributes
    ----------
    published : where the number comes from
    is_depth : whether it is the depth of the feature, or its value
    ours : level -> computed number, from coarse to fine; NaN where there is no such feature
    difference : of the finest computed number from the published one, or from its nearer bound
    changes : for each refinement, the change between its two finest levels
    """

    published: Published
    is_depth: bool
    ours: Mapping[Level, float]
    difference: float
    changes: tuple[float, ...]

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
        changes=tuple(_change(ours, axis) for axis in range(len(finest))),
    )


def _change(ours: Mapping[Level, float], axis: int) -> float:
    """Return the change between the two finest levels along an axis, all else being equal."""
    lines: dict[Level, dict[float, float]] = defaultdict(dict)
    for level, value in ours.items():
        lines[level[:axis] + level[axis + 1 :]][level[axis]] = value
    refined = {others: sorted(line)[:2] for others, line in lines.items() if len(line) > 1}
    if not refined:
        return np.nan
    others = min(refined, key=lambda key: (refined[key], key))
    fine, coarse = refined[others]
    return lines[others][fine] - lines[others][coarse]
