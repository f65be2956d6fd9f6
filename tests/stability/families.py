"""The families of scenes, and how many each has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

from tests.stability.kinds import (
    apart,
    behind,
    columns,
    cycles,
    deep,
    duplicate,
    endless,
    files,
    fits,
    folded,
    friction,
    hardening,
    heat,
    laws,
    limits,
    meshes,
    offsets,
    overlap,
    point,
    prism,
    punches,
    ratios,
    reopening,
    rigid,
    rolling,
    same,
    stacks,
    static,
    stretched,
    track,
    units,
    wild,
)
from tests.stability.trial import Scene


class Family(NamedTuple):
    """Scenes of one kind.

    Attributes
    ----------
    short : numbers of those that the test suite runs, but for `SLOW`, known before any is built
    long : how many there are
    make : (count) -> the first so many scenes
    """

    short: Sequence[int]
    long: int
    make: Callable[[int], list[Scene]]


def _all(count: int, make: Callable[[], list[Scene]]) -> Family:
    """Return a family that is written down one by one."""
    return Family(range(count), count, lambda _: make())


FAMILIES: dict[str, Family] = {
    "punch": Family(punches.SHORT, 260, punches.scenes),
    "folded": _all(8, folded.scenes),
    "duplicate": _all(8, duplicate.scenes),
    "behind": _all(8, behind.scenes),
    "same": _all(2, same.scenes),
    "overlap": _all(12, overlap.scenes),
    "apart": _all(8, apart.scenes),
    "point": _all(6, point.scenes),
    "ratios": _all(11, ratios.scenes),
    "meshes": _all(8, meshes.scenes),
    "units": _all(6, units.scenes),
    "offsets": _all(5, offsets.scenes),
    "reopening": _all(5, reopening.scenes),
    "hardening": _all(8, hardening.scenes),
    "laws": Family(range(laws.COUNT), 120, laws.scenes),
    "limits": _all(8, limits.scenes),
    "friction": _all(8, friction.scenes),
    "rolling": Family(rolling.SHORT, 80, rolling.scenes),
    "stack": Family(range(stacks.COUNT), 140, stacks.scenes),
    "columns": Family(range(columns.COUNT), 120, columns.scenes),
    "wild": Family(range(wild.COUNT), 120, wild.scenes),
    "cycles": Family(range(cycles.COUNT), 40, cycles.scenes),
    "track": Family(track.SHORT, 60, track.scenes),
    "heat": Family(range(heat.COUNT), 120, heat.scenes),
    "fits": Family(range(fits.COUNT), 90, fits.scenes),
    "rigid": Family(range(rigid.COUNT), 60, rigid.scenes),
    "static": Family(range(static.COUNT), 48, static.scenes),
    "stretched": Family(range(stretched.COUNT), 60, stretched.scenes),
    "deep": Family(deep.SHORT, 60, deep.scenes),
    "endless": Family(endless.SHORT, 300, endless.scenes),
    "files": Family(range(files.COUNT), 200, files.scenes),
    "prism": Family(range(prism.COUNT), 300, prism.scenes),
}

FOUND = ["prism-124", "files-18", "files-169", "rigid-11"]
"""Scenes that were once answered wrongly or not at all, beyond the first of their family."""
SLOW = ("hardening-7", "prism-3", "prism-4", "rigid-3", "stack-2", "stack-10", "stack-24",
        "static-1", "static-2", "stretched-1", "wild-3")  # fmt: skip
"""Scenes of the first of their family that take more than a second: others do what they do."""
NAMES = [
    name
    for family, own in FAMILIES.items()
    for k in own.short
    if (name := f"{family}-{k}") not in SLOW
] + FOUND
"""The scenes of the test suite."""
EVERY = [f"{family}-{k}" for family, own in FAMILIES.items() for k in range(own.long)]


@cache
def _made(family: str, count: int) -> list[Scene]:
    scenes = FAMILIES[family].make(count)
    assert len(scenes) == count, f"{family} has {len(scenes)} scenes"
    return scenes


def scene(name: str) -> Scene:
    """Return a scene by its name, ``family-number``."""
    family, _, number = name.rpartition("-")
    own = FAMILIES[family]
    few = own.short[-1] + 1
    return _made(family, few if int(number) < few else own.long)[int(number)]
