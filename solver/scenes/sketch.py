"""The bodies of a scene that has no model, to be drawn before it is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from solver.model.body import Body
from solver.typing import Array


class Sketch(NamedTuple):
    """The bodies of a scene before loading, in the plane of its map, where it has no model.

    Attributes
    ----------
    bodies : bodies with the meshes on which the scene is computed
    pairs : sides (body, boundary) that may touch
    springs : boundaries on springs, by body
    curves : (2, n) more surfaces by name [mm]
    """

    bodies: tuple[Body, ...]
    pairs: tuple[tuple[tuple[str, str], ...], ...] = ()
    springs: Mapping[str, Sequence[str]] = {}
    curves: Mapping[str, Array] = {}
