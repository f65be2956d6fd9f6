"""The families of scenes, and how many each has."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from tests.stability.kinds import (
    apart,
    behind,
    duplicate,
    folded,
    friction,
    hardening,
    limits,
    meshes,
    offsets,
    overlap,
    point,
    punches,
    ratios,
    reopening,
    rolling,
    same,
    stacks,
    units,
)
from tests.stability.trial import Scene

FAMILIES: dict[str, tuple[int, Callable[[], list[Scene]]]] = {
    "punch": (120, punches.scenes),
    "folded": (8, folded.scenes),
    "duplicate": (8, duplicate.scenes),
    "behind": (8, behind.scenes),
    "same": (2, same.scenes),
    "overlap": (12, overlap.scenes),
    "apart": (8, apart.scenes),
    "point": (6, point.scenes),
    "ratios": (12, ratios.scenes),
    "meshes": (8, meshes.scenes),
    "units": (6, units.scenes),
    "offsets": (5, offsets.scenes),
    "reopening": (5, reopening.scenes),
    "hardening": (8, hardening.scenes),
    "limits": (8, limits.scenes),
    "friction": (8, friction.scenes),
    "rolling": (40, rolling.scenes),
    "stack": (28, stacks.scenes),
}
"""How many scenes a family has (known before any is built), and what makes them."""

NAMES = [f"{family}-{k}" for family, (count, _) in FAMILIES.items() for k in range(count)]


@cache
def _made(family: str) -> list[Scene]:
    count, make = FAMILIES[family]
    scenes = make()
    assert len(scenes) == count, f"{family} has {len(scenes)} scenes"
    return scenes


def scene(name: str) -> Scene:
    """Return a scene by its name, ``family-number``."""
    family, _, number = name.rpartition("-")
    return _made(family)[int(number)]
