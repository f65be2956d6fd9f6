"""Loading paths that one worker computes one after the other, because they share a set-up."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from itertools import islice

from solver.errors import ModelError
from solver.scenes import Scene
from studies.definition.cases import LoadingPath

_WINDOW = 500
"""Number of paths among which those of equal set-up are searched; no more are in memory."""
_MOST = 12
"""Largest number of paths in a bundle: a set-up is then a small part of its work."""
_EACH = 2
"""Number of bundles for each worker, if there are enough paths, so that none is idle for long."""

Bundle = tuple[LoadingPath, ...]


def bundles(
    scene: Scene, paths: Iterable[LoadingPath], workers: Callable[[], int]
) -> Iterator[Bundle]:
    """Yield the paths in bundles of equal set-up; single paths if the scene has no `Scene.setup`.

    Parameters
    ----------
    workers : returns the number of workers, which may change
    """
    paths = iter(paths)
    if scene.setup is None:
        yield from ((path,) for path in paths)
        return
    while window := list(islice(paths, _WINDOW)):
        most = most_together(len(window), workers())
        alike: dict[Hashable, list[LoadingPath]] = {}
        for path in window:
            alike.setdefault(setup_of(scene, path), []).append(path)
        for group in alike.values():
            count = -(-len(group) // most)  # bundles of nearly equal size
            yield from (
                tuple(group[len(group) * k // count : len(group) * (k + 1) // count])
                for k in range(count)
            )


def most_together(paths: int, workers: int) -> int:
    """Return the largest number of paths in a bundle."""
    return max(1, min(_MOST, paths // (_EACH * max(1, workers))))


def setup_of(scene: Scene, path: LoadingPath) -> Hashable:
    """Return the set-up of a path; its own one if the scene refuses its parameters or has none."""
    if scene.setup is None:
        return path.id
    try:
        return scene.setup(path.parameters)
    except ModelError:
        return path.id
