"""Laws that the tests of the contract run over, one of them written here."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Elasticity,
    Law,
    Layered,
    Material,
    PlaneStress,
    PlasticState,
    Power,
    Response,
    SmoothMaterial,
    SmoothSurface,
    Table,
    TrescaMaterial,
    Voce,
)
from solver.materials.law import Wrapped
from tests.solver.back_stress_rules import BurletCailletaud, OhnoWang
from tests.solver.yield_surfaces import Hosford, Odd, Quick

HARDENING = ["none", "isotropic", "kinematic", "mixed"]


STEEL = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
SOFT = Voce(yield_stress=350.0)
CURVES = {
    "none": SOFT,
    "linear": Voce(yield_stress=350.0, modulus=4918.0),
    "voce": Voce(yield_stress=350.0, saturation=120.0, rate=300.0),
    "power": Power(yield_stress=350.0, youngs_modulus=2e5, exponent=0.1),
    "table": Table(plastic_strain=(0.0, 0.002, 0.02), stress=(350.0, 420.0, 480.0)),
}
BACK_STRESSES = {
    "prager": (ArmstrongFrederick(5000.0),),
    "fading": (
        ArmstrongFrederick(60_000.0, 600.0),
        ArmstrongFrederick(4000.0, 20.0),
        ArmstrongFrederick(500.0),
    ),
    "burlet cailletaud": (
        BurletCailletaud(60_000.0, 600.0, 0.1),
        BurletCailletaud(4000.0, 20.0, 0.1),
    ),
    "ohno wang": (OhnoWang(60_000.0, 100.0), OhnoWang(4000.0, 200.0)),
}
SURFACES = {
    "hosford 2": Hosford(2.0),
    "hosford 8": Hosford(8.0),
    "hosford 20": Hosford(20.0),
    "hosford 8, quick": Quick(8.0),
    "odd": Odd(),
}
LAYERED = Layered.of_curve(
    STEEL, strain=(350.0 / 2e5, 0.003, 0.01), stress=(350.0, 430.0, 500.0), slope=2000.0
)


def steel(hardening: str = "none", ratio: float = 0.024, **fields: Any) -> Material:
    """Return a steel of Re = 350 MPa."""
    given = {"youngs_modulus": 2e5, "poisson_ratio": 0.3, "yield_stress": 350.0} | fields
    return Material(hardening=hardening, hardening_ratio=ratio, **given)


def chaboche(back_stresses: str, curve: str = "voce") -> Chaboche:
    """Return a law with these back stresses and this curve."""
    return Chaboche(
        elasticity=STEEL, curve=CURVES[curve], back_stresses=BACK_STRESSES[back_stresses]
    )


def smooth(surface: SmoothSurface, curve: str = "voce") -> SmoothMaterial:
    """Return a law with this surface and this curve."""
    return SmoothMaterial(elasticity=STEEL, curve=CURVES[curve], surface=surface)


@dataclass(frozen=True, slots=True)
class Centred(PlasticState):
    """Remembers the centre of its yield surface (n_components, n_points) [MPa]."""

    centre: np.ndarray
    TENSORS: ClassVar[tuple[str, ...]] = ("plastic_strain", "centre")


@dataclass(frozen=True)
class StoredCentre(Law):
    """Kinematic hardening whose back stress is an internal variable; ``like`` gives numbers."""

    like: Material

    @cached_property
    def elasticity(self) -> Elasticity:
        return self.like.elasticity

    @property
    def hardens(self) -> bool:
        return True

    def initial(self, n_points: int, n_components: int) -> Centred:
        zero = np.zeros((n_components, n_points))
        return Centred(zero, np.zeros(n_points), zero)

    def flow_stress(self, state: PlasticState) -> np.ndarray:
        return np.full(state.accumulated.shape, self.like.yield_stress)

    def back_stress(self, state: Any) -> np.ndarray:
        return state.centre

    def respond(self, strain: np.ndarray, state: Any) -> Response:
        G, Hk = self.elasticity.shear_modulus, self.like.kinematic_modulus
        C = self.stiffness(len(strain))
        trial = C @ (strain - state.plastic_strain)
        f = self.yield_value(trial, state)
        N = self.surface.normal(trial - state.centre)
        dp = np.maximum(f, 0.0) / (3 * G + Hk)
        flow = dp * N
        after = replace(
            state,
            plastic_strain=state.plastic_strain + flow,
            accumulated=state.accumulated + dp,
            centre=state.centre + 2 / 3 * Hk * flow,
        )
        n = np.sqrt(2 / 3) * N
        q = np.where(f > 0, f, 0.0) + self.like.yield_stress  # none of what stays elastic
        shrunk = 2 * G * np.where(f > 0, 3 * G * dp / q, 0.0)
        P = (C - self.elasticity.bulk_modulus * _ones(len(strain))) / (2 * G)
        turned = np.where(f > 0, 2 * G * 3 * G / (3 * G + Hk), 0.0) - shrunk
        tangent = C[:, :, None] - shrunk * P[:, :, None] - turned * n[:, None] * n[None]
        return Response(trial - 2 * G * flow, tangent, after, f > 0)


def _ones(n: int) -> np.ndarray:
    one = (np.arange(n) < 3).astype(float)
    return np.outer(one, one)


@dataclass(frozen=True)
class Forwarded(Wrapped):
    """A law that does not say that its hardening is linear."""

    law: Law

    def respond(self, strain: np.ndarray, state: PlasticState) -> Response:
        return self.law.respond(strain, state)


LAWS: dict[str, tuple[Law, int]] = {
    **{f"radial {h} {n}": (steel(h), n) for h in HARDENING for n in (4, 6)},
    **{f"projected {h}": (PlaneStress(steel(h)), 4) for h in HARDENING},
    **{f"wrapped {h}": (PlaneStress(Forwarded(steel(h))), 4) for h in HARDENING},
    **{
        f"tresca {c} {n}": (TrescaMaterial(elasticity=STEEL, curve=CURVES[c]), n)
        for c in CURVES
        for n in (4, 6)
    },
    "tresca, wrapped": (PlaneStress(TrescaMaterial(elasticity=STEEL, curve=SOFT)), 4),
    **{f"{s} {n}": (smooth(SURFACES[s]), n) for s in SURFACES for n in (4, 6)},
    **{f"hosford 8, {c}": (smooth(Hosford(8.0), c), 6) for c in CURVES if c != "voce"},
    **{f"{s}, wrapped": (PlaneStress(smooth(SURFACES[s], "none")), 4) for s in SURFACES},
    **{f"curve {c}": (Chaboche(elasticity=STEEL, curve=CURVES[c]), 6) for c in CURVES},
    **{f"back stresses {b} {n}": (chaboche(b), n) for b in BACK_STRESSES for n in (4, 6)},
    # Ohno and Wang's equations take twenty times as long in plane stress
    **{f"{b}, wrapped": (PlaneStress(chaboche(b)), 4) for b in ("fading", "burlet cailletaud")},
    "layered 4": (LAYERED, 4),
    "layered 6": (LAYERED, 6),
    "layered, wrapped": (PlaneStress(LAYERED), 4),
    "own 4": (StoredCentre(steel("kinematic")), 4),
    "own 6": (StoredCentre(steel("kinematic")), 6),
    "own, wrapped": (PlaneStress(StoredCentre(steel("kinematic"))), 4),
}
"""Name -> law and its number of components."""
