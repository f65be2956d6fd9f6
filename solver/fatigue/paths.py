"""Paths of stress and strain over a cycle, at points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.late import late
from solver.typing import Array

_balls, _largest_shear = late("fatigue.kernels", "balls", "largest_shear")

_DEVIATOR = np.array(
    [[1, -1, 0, 0, 0, 0], [-1 / 3**0.5, -1 / 3**0.5, 2 / 3**0.5, 0, 0, 0], *2 * np.eye(6)[3:]]
) / np.sqrt(2.0)  # fmt: skip
"""The five coordinates of a deviator, whose square sum is that of its components."""


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Paths over a cycle, closed or not, at n points.

    Attributes
    ----------
    stress : (n, n_instants, 6), tensor components xx, yy, zz, xy, yz, zx; or 4, in the plane [MPa]
    strain : the same of strain (``xy`` is half the engineering shear), or None if not known
    """

    stress: Array
    strain: Array | None = None

    def __post_init__(self) -> None:
        for name in ("stress", "strain"):
            given = getattr(self, name)
            if given is None:
                continue
            array = np.asarray(given, dtype=float)
            if array.ndim != 3 or array.shape[2] not in (4, 6) or array.shape[1] < 2:
                allowed = "must be (n_points, 2 instants or more, 6), or 4 in the plane"
                raise ModelError(name, array.shape, allowed)
            if not np.isfinite(array).all():
                raise ModelError(name, "inf or nan", "must be finite: leave out other points")
            whole = np.zeros((*array.shape[:2], 6))
            whole[..., : array.shape[2]] = array
            object.__setattr__(self, name, whole)
        if self.strain is not None and self.strain.shape != self.stress.shape:
            raise ModelError("strain", self.strain.shape, f"must be that of {self.stress.shape}")

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.stress)

    @property
    def pressure(self) -> Array:
        """Hydrostatic stress (n, n_instants), positive in tension [MPa]."""
        return np.asarray(self.stress[..., :3].mean(axis=2))

    @property
    def deviator_balls(self) -> tuple[Array, Array]:
        """Centres (n, 6) and radii (n,) of the smallest balls around paths of the deviator [MPa].

        The radius is in the norm of tensors: divided by sqrt(2) it is the amplitude of sqrt(J2).
        """
        centres, radii = _balls(np.einsum("ab,ptb->pat", _DEVIATOR, self.stress))
        return centres @ _DEVIATOR * [1.0, 1.0, 1.0, 0.5, 0.5, 0.5], radii

    def largest_shear(self, centres: Array) -> Array:
        """Return the largest shear stress (n, n_instants) of deviators minus centres [MPa]."""
        moved = self.stress - centres[:, None]
        moved[..., :3] -= moved[..., :3].mean(axis=2, keepdims=True)
        return np.asarray(_largest_shear(np.ascontiguousarray(moved.swapaxes(1, 2))))

    @property
    def known(self) -> list[Array]:
        """The paths of stress and, if known, of strain."""
        return [own for own in (self.stress, self.strain) if own is not None]
