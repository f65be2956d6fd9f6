"""Internal variables of a material law, and its response."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from solver.typing import Array, Bools, Ints


@dataclass(frozen=True, slots=True)
class PlasticState:
    """Internal variables at the points of a body; never changed, only replaced.

    For more internal variables inherit from this class and add arrays, points last. Name those that
    are tensors, ``(..., n_components, n_points)``, in `TENSORS` too.

    Attributes
    ----------
    TENSORS : names of the internal variables that are Mandel tensors
    plastic_strain : (n_components, n_points) Mandel
    accumulated : (n_points,) sum of the plastic multipliers: plastic strain grows by the
        multiplier times `YieldSurface.normal`. With von Mises it is the equivalent plastic
        strain, the sum of sqrt(2/3) |d plastic_strain|
    """

    plastic_strain: Array
    accumulated: Array
    TENSORS: ClassVar[tuple[str, ...]] = ("plastic_strain",)

    @classmethod
    def virgin(cls, n_points: int, n_components: int = 4) -> PlasticState:
        """Return the state of a material that has never yielded."""
        return PlasticState(np.zeros((n_components, n_points)), np.zeros(n_points))

    def at(self, points: Ints) -> Self:
        """Return the internal variables of some points."""
        return replace(self, **{f.name: getattr(self, f.name)[..., points] for f in fields(self)})

    @property
    def mirrored(self) -> Self:
        """The internal variables in a frame whose x axis is reversed."""
        sign = np.ones((len(self.plastic_strain), *[1] * self.accumulated.ndim))
        sign[3::2] = -1.0  # xy, and zx in three dimensions
        return replace(self, **{name: getattr(self, name) * sign for name in self.TENSORS})

    @property
    def packed(self) -> Array:
        """All internal variables as one array (n, n_points), plastic strain first."""
        points = self.accumulated.shape
        return np.concatenate(
            [getattr(self, name).reshape(size, *points) for name, _, size in self._layout]
        )

    def unpacked(self, packed: Array) -> Self:
        """Return internal variables of the same law from an array like `packed` (n, ...)."""
        found, begin = {}, 0
        for name, shape, size in self._layout:
            found[name] = packed[begin : begin + size].reshape(*shape, *packed.shape[1:])
            begin += size
        return replace(self, **found)

    @property
    def _layout(self) -> list[tuple[str, tuple[int, ...], int]]:
        """Name, shape without points and number of components of each internal variable."""
        points = self.accumulated.ndim
        shapes = [(f.name, getattr(self, f.name).shape) for f in fields(self)]
        each = [(name, shape[: len(shape) - points]) for name, shape in shapes]
        return [(name, shape, math.prod(shape)) for name, shape in each]

    def stretched(self, factor: Array) -> Self:
        """Return the internal variables with all strains multiplied by factors (n_points,)."""
        return replace(self, **{f.name: getattr(self, f.name) * factor for f in fields(self)})

    def stepped(self, own: PlasticState, after: PlasticState, factor: Array, flows: Bools) -> Self:
        """Return these internal variables after a step computed with stretched strains.

        Values that the step did not change are kept exactly: the rounding of stretching and its
        inverse would look like plastic flow.

        Parameters
        ----------
        own, after : the stretched internal variables before and after the step
        factor : (n_points,) factor of the stretched strains
        flows : (n_points,) whether the point flows in the step
        """
        back = after.stretched(1 / factor)
        kept = {}
        for name in (f.name for f in fields(self)):
            changed = flows & (getattr(after, name) != getattr(own, name))
            kept[name] = np.where(changed, getattr(back, name), getattr(self, name))
        return replace(self, **kept)


class Response(NamedTuple):
    """The response of a law to a strain.

    ``stress`` (n_components, n_points) Mandel [MPa]; ``tangent`` (n_components, n_components,
    n_points), the derivative of stress by strain [MPa]; ``state`` the new internal variables;
    ``yielding`` (n_points,) bool, true where the tangent is not the elastic stiffness.
    """

    stress: Array
    tangent: Array
    state: PlasticState
    yielding: Bools
