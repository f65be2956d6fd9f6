"""Maps, profiles and lines of stress and plastic strain."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import declare
from solver.tensors import not_below_zero, stress_difference, to_tensor, von_mises

if TYPE_CHECKING:
    from solver.results.look import Look, Values

_MAP = ("y", "x")

RESIDUAL_STRESS = declare("residual_stress", "residual stress", "MPa", dims=("component", *_MAP))
RESIDUAL_MISES = declare(
    "residual_mises", "von Mises stress of the residual stress", "MPa", dims=_MAP
)
PLASTIC_STRAIN = declare("plastic_strain", "equivalent plastic strain after unloading", dims=_MAP)
MISES_LOADED = declare("mises_loaded", "von Mises stress under load", "MPa", dims=_MAP)
STRESS_DIFFERENCE = declare(
    "stress_difference",
    "difference of the principal stresses in the plane under load", "MPa", dims=_MAP,
)  # fmt: skip
RESIDUAL_PROFILE = declare(
    "residual_profile", "residual stress along depth", "MPa",
    dims=("station", "component", "depth"),
)  # fmt: skip
PLASTIC_STRAIN_PROFILE = declare(
    "plastic_strain_profile",
    "equivalent plastic strain along depth after unloading",
    dims=("station", "depth"),
)
MAP_STRESS = declare("map_stress", "stress", "MPa", dims=("stage", "component", *_MAP))
MAP_MISES = declare("map_mises", "von Mises stress", "MPa", dims=("stage", *_MAP))
MAP_PLASTIC_STRAIN = declare(
    "map_plastic_strain", "equivalent plastic strain", dims=("stage", *_MAP)
)
SURFACE_RESIDUAL = declare(
    "surface_residual", "residual stress at the contact surface", "MPa",
    dims=("body", "component", "s"),
)  # fmt: skip
SURFACE_MISES = declare(
    "surface_mises", "von Mises stress at the surface of the lower body", "MPa",
    dims=("stage", "s"),
)  # fmt: skip


def maps(look: Look) -> Values:
    """Return maps around the contact: residual stress, plastic strain, stress under load."""
    samples = look.samples
    residual = samples.on_map(lambda body: samples.stress(body, look.unloaded))
    under_load = samples.on_map(lambda body: samples.stress(body, look.loaded))
    strain = not_below_zero(
        samples.on_map(lambda body: samples.plastic_strain(body, look.unloaded))
    )
    return {
        RESIDUAL_STRESS: to_tensor(residual),
        RESIDUAL_MISES: von_mises(residual),
        PLASTIC_STRAIN: strain,
        MISES_LOADED: von_mises(under_load),
    }


def stress_maps(look: Look) -> Values:
    """Return maps of stress and plastic strain in all stages, of bodies that are not released."""
    samples = look.samples
    states = [state for state, _ in look.stages]
    stress = [samples.on_map(partial(samples.stress, converged=at)) for at in states]
    strain = [samples.on_map(partial(samples.plastic_strain, converged=at)) for at in states]
    return {
        MAP_STRESS: np.stack([to_tensor(each) for each in stress]),
        MAP_MISES: np.stack([von_mises(each) for each in stress]),
        MAP_PLASTIC_STRAIN: not_below_zero(np.stack(strain)),
    }


def isochromatics(look: Look) -> Values:
    """Return the map whose contours are isochromatics: twice the largest shear in the plane."""
    samples = look.samples
    stress = samples.on_map(lambda body: samples.stress(body, look.loaded))
    return {STRESS_DIFFERENCE: stress_difference(stress)}


def profiles(look: Look) -> Values:
    """Return residual stress and plastic strain along depth."""
    stress, strain = look.samples.profile(look.unloaded)
    return {RESIDUAL_PROFILE: stress, PLASTIC_STRAIN_PROFILE: strain}


def surfaces(look: Look) -> Values:
    """Return residual stress along the contact surfaces, and von Mises stress of the lower one."""
    samples, bodies = look.samples, look.view.surfaces
    return {
        SURFACE_RESIDUAL: np.stack([samples.on_surface(body, look.unloaded) for body in bodies]),
        SURFACE_MISES: np.stack([samples.surface_mises(c, x) for c, x in look.stages]),
    }
