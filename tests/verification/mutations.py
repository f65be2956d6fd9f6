"""Faults put into the solver on purpose, one at a time, which the audit must notice.

Each takes a `pytest.MonkeyPatch` and stays in force for the whole run, its audit included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import solver.contact.interface
import solver.contact.links
import solver.loading.increment
import solver.loading.stepper
from solver.contact import candidates, complementarity
from solver.contact.problem import OPEN, STICK, ContactSolution
from solver.contact.system import System
from solver.fem import discretisation, substructure
from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation
from solver.fem.wheel import Wheel
from solver.loading.program import Tolerances
from solver.materials import Chaboche, PlasticState
from solver.model.body import Body
from solver.model.friction import BoundLines

Patch = pytest.MonkeyPatch
Fault = Callable[[Patch], None]

PUNCH: dict[str, Any] = {
    "smallest_element": 0.04, "growth": 2.0, "friction": 0.3, "load_ratio": 0.8571,
    "load_step": 0.3, "unload_steps": 2, "hardening": "isotropic",
}  # fmt: skip
ROLLING: dict[str, Any] = {
    "element_size": 3.0, "advance_step": 3.0, "growth": 1.5, "track": 9.0, "press_steps": 2,
    "unload_steps": 1,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutation:
    """A fault, the scene that has it, and the condition it breaks (one of several, if so)."""

    fault: Fault
    breaks: tuple[str, ...]
    scene: str = "punch"
    parameters: dict[str, Any] | None = None


# -- friction and contact ----------------------------------------------------------------------


def friction_times(factor: float) -> Fault:
    def fault(patch: Patch) -> None:
        bound = System.bound

        def scaled(*args: Any) -> BoundLines:
            return BoundLines(*(factor * of for of in bound(*args)))

        patch.setattr(System, "bound", scaled)

    return fault


def motion_offset(gap: float = 0.0, slip: float = 0.0) -> Fault:
    find = candidates.find_candidates

    def shifted(*args: Any, **options: Any) -> Any:
        found = find(*args, **options)
        offset = np.concatenate([np.full(found.n, gap), np.full(len(found.motion) - found.n, slip)])
        return replace(found, motion=found.motion + offset)

    def fault(patch: Patch) -> None:
        patch.setattr(solver.loading.increment, "find_candidates", shifted)

    return fault


def half_tangential_rows(patch: Patch) -> None:
    pair = solver.contact.interface.pair

    def halved(*args: Any) -> Any:
        found = pair(*args)
        return replace(found, tangent=tuple(side / 2 for side in found.tangent))

    patch.setattr(solver.contact.interface, "pair", halved)


def less_on_the_master(normal: float, tangential: float) -> Fault:
    """The master's part of the contact forces is multiplied by these factors."""
    on_part = candidates.Candidates.on_part

    def lessened(self: Any, part: int, forces: Any, size: int) -> Any:
        if part == MASTER:
            factor = np.full(len(forces), tangential)
            factor[: self.n] = normal
            forces = factor * forces
        return on_part(self, part, forces, size)

    def fault(patch: Patch) -> None:
        patch.setattr(candidates.Candidates, "on_part", lessened)

    return fault


MASTER = 1


def glue(patch: Patch) -> None:
    """What has touched once never opens again."""

    def glued(problem: Any, start: Any) -> ContactSolution | None:
        found = complementarity.solve_contact(problem, start)
        if found is None:
            return None
        status = np.where((found.status != OPEN) | (start != OPEN), STICK, OPEN)
        first = np.zeros(problem.n, dtype=int)
        forces = complementarity._forces(problem, status, first, problem.lines)
        return None if forces is None else ContactSolution(*forces[:2], status, False)

    patch.setattr(solver.contact.links, "solve_contact", glued)
    patch.setattr(candidates.Candidates, "violation", lambda self, stiffness: 0.0)


def overlooked_contact(patch: Patch) -> None:
    """Every second vertex never comes near anything."""
    near, find = candidates._near, candidates.find_candidates

    def some(*args: Any) -> Any:
        found = near(*args)
        return found[found % 2 != 1]

    patch.setattr(candidates, "_near", some)
    patch.setattr(
        solver.loading.increment,
        "find_candidates",
        lambda *args, **options: replace(find(*args, **options), beyond=np.inf),
    )


def master_stands_still(patch: Patch) -> None:
    """Gaps do not see the master move."""
    facing = solver.contact.interface.Interface.facing

    def still(self: Any, u: Any, time: float = 0.0, **options: Any) -> Any:
        number = self.sides[1][0]
        seen = tuple(np.zeros_like(v) if k == number else v for k, v in enumerate(u))
        return facing(self, seen, time, **options)

    patch.setattr(solver.contact.interface.Interface, "facing", still)


# -- the law -----------------------------------------------------------------------------------


def other_material(*, stiff: float = 1.0, moves: float = 1.0) -> Fault:
    """Young's modulus and the moduli of the back stresses are multiplied by these factors."""

    @cache
    def other(body: Body) -> Body:
        law = body.material
        E, rules = law.elasticity.youngs_modulus, law.back_stresses
        elasticity = replace(law.elasticity, youngs_modulus=stiff * E)
        rules = tuple(replace(rule, modulus=moves * rule.modulus) for rule in rules)
        material = Chaboche(elasticity=elasticity, curve=law.curve, back_stresses=rules)
        return replace(body, material=material)

    def with_other(self: Any, u: Any, state: Any, time: float) -> Any:
        del time
        deformation = self.undeformed.at(u)
        return PartResponse(other(self.body).law.respond(deformation.strain, state), deformation)

    def fault(patch: Patch) -> None:
        patch.setattr(Discretisation, "respond", with_other)

    return fault


def more_flow(patch: Patch) -> None:
    respond = Discretisation.respond

    def flowing(self: Any, u: Any, state: Any, time: float) -> Any:
        found = respond(self, u, state, time)
        after = found.law.state
        plastic = state.plastic_strain + 1.3 * (after.plastic_strain - state.plastic_strain)
        flown = PlasticState(plastic, after.accumulated)
        return found._replace(law=found.law._replace(state=flown))

    patch.setattr(Discretisation, "respond", flowing)


def forgotten_flow(patch: Patch) -> None:
    """One increment begins as if nothing had yielded before."""
    advance = solver.loading.stepper.Stepper.reach

    def forgetful(self: Any, point: Any, target: float, **options: Any) -> Any:
        point = advance(self, point, target, **options)
        if not 0.75 < target < 0.85:
            return point
        state = point.now.state
        virgin = tuple(PlasticState.virgin(p.accumulated.size) for p in state.plastic)
        return replace(point, now=replace(point.now, state=replace(state, plastic=virgin)))

    patch.setattr(solver.loading.stepper.Stepper, "reach", forgetful)


def no_hoop_strain(patch: Patch) -> None:
    operator = discretisation.strain_operator
    patch.setattr(
        discretisation, "strain_operator", lambda v, g, r, state: operator(v, g, r, "plane_strain")
    )


# -- bodies and loads --------------------------------------------------------------------------


def heavier_points(patch: Patch) -> None:
    """Points stand for more volume than they have."""
    build = Discretisation.__init__

    def heavier(self: Any, body: Any) -> None:
        build(self, body)
        self.weights = 1.1 * self.weights
        self.undeformed = replace(self.undeformed, weights=self.weights)

    patch.setattr(Discretisation, "__init__", heavier)


def loads_times(kind: type, factor: float) -> Fault:
    external = kind.external  # type: ignore[attr-defined]

    def fault(patch: Patch) -> None:
        patch.setattr(kind, "external", lambda self, time, u=None: factor * external(self, time, u))

    return fault


def one_support_more(patch: Patch) -> None:
    """A side of the half-plane nobody named is held."""
    hold = Discretisation._hold

    def held(self: Any) -> None:
        declared = self.body
        if declared.name == "half_plane":
            self.body = replace(declared, supports={**declared.supports, "right": "x"})
        hold(self)
        self.body = declared

    patch.setattr(Discretisation, "_hold", held)


def soft_condensation(patch: Patch) -> None:
    build = substructure._CondensedBody.__init__

    def softer(self: Any, *args: Any) -> None:
        build(self, *args)
        self.stiffness = 0.9 * self.stiffness

    patch.setattr(substructure._CondensedBody, "__init__", softer)
    patch.setattr(substructure, "_key", lambda *args: object())  # nothing is remembered


def hasty_release(patch: Patch) -> None:
    """The last increment is taken as converged as soon as it is begun."""
    build = solver.loading.increment.Increment.__init__

    def hasty(self: Any, *args: Any, **options: Any) -> None:
        build(self, *args, **options)
        if not self.contact and self.start.force_scale > 0:
            self.tolerances = Tolerances(residual=1.0)

    patch.setattr(solver.loading.increment.Increment, "__init__", hasty)


def load_left_on(patch: Patch) -> None:
    """Instead of being released, the bodies keep a hundredth of the load, in equilibrium."""
    advance = solver.loading.stepper.Stepper.reach

    def kept(self: Any, point: Any, target: float, *, contact: bool = True) -> Any:
        return advance(self, point, target if contact else 0.01 * point.now.state.time)

    patch.setattr(solver.loading.stepper.Stepper, "reach", kept)


MUTATIONS: dict[str, Mutation] = {
    "friction ignored": Mutation(fault=friction_times(0.0), breaks=("slip",)),
    "friction halved": Mutation(fault=friction_times(0.5), breaks=("slip",)),
    "slip offset by 2 um": Mutation(fault=motion_offset(slip=2e-3), breaks=("slip",)),
    "stress from 0.99 E": Mutation(fault=other_material(stiff=0.99), breaks=("law",)),
    "plastic flow times 1.3": Mutation(fault=more_flow, breaks=("law",)),
    "gap plus 1 um": Mutation(fault=motion_offset(gap=1e-3), breaks=("closed_gap", "overlap")),
    "tangential rows halved": Mutation(fault=half_tangential_rows, breaks=("action_reaction",)),
    "friction without reaction": Mutation(
        fault=less_on_the_master(1.0, 0.0), breaks=("action_reaction",)
    ),
    "a tenth of the pressure lost": Mutation(
        fault=less_on_the_master(0.9, 1.0), breaks=("action_reaction",)
    ),
    "friction beyond its bound": Mutation(fault=friction_times(1.1), breaks=("friction_excess",)),
    "contact that pulls": Mutation(fault=glue, breaks=("tension",), scene="rolling"),
    "every second vertex overlooked": Mutation(fault=overlooked_contact, breaks=("overlap",)),
    "gaps that do not see the master": Mutation(
        fault=master_stands_still, breaks=("closed_gap", "overlap")
    ),
    "half the back stress": Mutation(
        fault=other_material(moves=0.5),
        breaks=("law",),
        parameters={"hardening": "kinematic"},
    ),
    "flow forgotten between increments": Mutation(
        fault=forgotten_flow, breaks=("energy",), parameters={"load_step": 0.2, "unload_steps": 5}
    ),
    "no hoop strain": Mutation(
        fault=no_hoop_strain, breaks=("law",), parameters={"state": "axisymmetric"}
    ),
    "points of too much volume": Mutation(fault=heavier_points, breaks=("residual",)),
    "nine tenths of the pressure applied": Mutation(
        fault=loads_times(Discretisation, 0.9), breaks=("reactions",)
    ),
    "nine tenths of the axle's load": Mutation(
        fault=loads_times(Wheel, 0.9), breaks=("reactions",), scene="rolling"
    ),
    "a support too many": Mutation(fault=one_support_more, breaks=("residual",)),
    "a condensed body too soft": Mutation(
        fault=soft_condensation, breaks=("residual", "action_reaction"), scene="rolling"
    ),
    "a hundredth of the load left on": Mutation(
        fault=load_left_on, breaks=("contact_after_unloading",)
    ),
    "release not solved to the end": Mutation(fault=hasty_release, breaks=("residual",)),
}
