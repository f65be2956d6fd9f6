"""Isotropic linear elasticity: the constants, the stiffness and the energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.parameters import Checked, Infinite, Modulus, Poisson
from solver.tensors import projections
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Elasticity(Checked):
    """Hooke's law of an isotropic material.

    Attributes
    ----------
    youngs_modulus : E [MPa]; inf for a rigid wheel, but a body that may yield needs a finite one
    poisson_ratio : nu

    Raises
    ------
    ModelError
        if a number is out of its range
    """

    youngs_modulus: Modulus | Infinite
    poisson_ratio: Poisson

    @property
    def shear_modulus(self) -> float:
        """G [MPa]."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def bulk_modulus(self) -> float:
        """K [MPa]."""
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))

    @property
    def plane_strain_modulus(self) -> float:
        """E / (1 - nu^2): slope of stress over strain if one lateral strain is zero [MPa]."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    def stiffness(self, n_components: int) -> Array:
        """Return the stiffness (n_components, n_components) on Mandel strain [MPa]."""
        trace, deviatoric = projections(n_components)
        return self.bulk_modulus * trace + 2 * self.shear_modulus * deviatoric

    def strain(self, stress: Array) -> Array:
        """Return the Mandel strain (n_components, ...) of Mandel stress of that shape [MPa]."""
        E, nu = self.youngs_modulus, self.poisson_ratio
        out = (1 + nu) / E * stress
        out[:3] -= nu / E * stress[:3].sum(axis=0)
        return np.asarray(out)

    def energy_density(self, stress: Array) -> Array:
        """Return the elastic energy (...) of Mandel stress (n_components, ...) [N mm/mm3]."""
        E, nu = self.youngs_modulus, self.poisson_ratio
        square = (1 + nu) * (stress**2).sum(axis=0) - nu * stress[:3].sum(axis=0) ** 2
        return np.asarray(square / (2 * E))

    def biaxial_stress(self, strain: Array) -> Array:
        """Return the two normal stresses (2, n) of two normal elastic strains (2, n) [MPa].

        The third normal stress is zero, as at a free surface.
        """
        nu = self.poisson_ratio
        return self.plane_strain_modulus * np.stack(
            [strain[0] + nu * strain[1], strain[1] + nu * strain[0]]
        )
