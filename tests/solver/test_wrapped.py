"""A law around another one passes on each member that it does not change."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from solver.materials import Elasticity, Heated, Law, Material, PlaneStress, TrescaMaterial, Voce
from solver.materials.law import Wrapped, attribute

MEMBERS = {name: member for name, member in vars(Law).items() if not name.startswith("_")}
OWN = {"respond", "linear_hardening"}
"""Members that every wrapper has for itself."""


def arguments(name: str) -> list[str]:
    return list(inspect.signature(getattr(Law, name)).parameters)[1:]


class Told(Law):
    """A law whose members all give their own name, and what they were given."""

    def flow_stress(self, state: Any) -> Any:
        raise NotImplementedError

    def respond(self, strain: Any, state: Any) -> Any:
        raise NotImplementedError


for _name, _member in MEMBERS.items():
    if isinstance(_member, attribute):
        setattr(Told, _name, property(lambda self, name=_name: name))
    else:
        setattr(Told, _name, lambda self, *given, name=_name: (name, *given))


@dataclass(frozen=True)
class Plain(Wrapped):
    law: Law

    def respond(self, strain: Any, state: Any) -> Any:
        return self.law.respond(strain, state)


def test_there_are_members() -> None:
    assert {
        "elasticity",
        "surface",
        "misfit",
        "ultimate_shear_stress",
    } <= MEMBERS.keys()


@pytest.mark.parametrize("name", sorted(MEMBERS.keys() - OWN))
def test_each_member_of_the_contract_is_that_of_the_wrapped_law(name: str) -> None:
    wrapped = Plain(Told())
    if isinstance(MEMBERS[name], attribute):
        assert getattr(wrapped, name) == name
    else:
        given = arguments(name)
        assert getattr(wrapped, name)(*given) == (name, *given)


def test_heat_changes_all_that_depends_on_stress_or_state() -> None:
    passed = [
        name
        for name, member in MEMBERS.items()
        if not isinstance(member, attribute) and {"stress", "state", "after"} & {*arguments(name)}
        if name not in vars(Heated)
    ]
    assert passed == []


def test_no_point_of_a_heated_body_is_stronger_than_its_ultimate_shear_stress() -> None:
    cold = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
    heated = Heated(law=cold, stiff=np.ones(2), strong=np.array([0.4, 0.7]))
    assert heated.ultimate_shear_stress == pytest.approx(0.7 * 300.0 / np.sqrt(3.0))
    assert PlaneStress(heated).ultimate_shear_stress == heated.ultimate_shear_stress


@pytest.mark.parametrize("kind", [PlaneStress, Heated])
def test_the_law_of_some_points_is_wrapped_alike(kind: type[Wrapped]) -> None:
    @dataclass(frozen=True)
    class Placed(Told):
        points: tuple[int, ...] = (0, 1, 2)

        def at(self, points: Any) -> Any:
            return replace(self, points=tuple(np.array(self.points)[points].tolist()))

    shares = {"stiff": np.ones(3), "strong": np.ones(3)} if kind is Heated else {}
    some = kind(law=Placed(), **shares).at(np.array([2, 0]))
    assert type(some) is kind
    assert some.law == Placed((2, 0))


def test_a_flow_of_a_heated_law_is_judged_as_by_the_law_of_its_constants() -> None:
    e, r = 0.7, 0.4
    cold, own = (
        TrescaMaterial(
            elasticity=Elasticity(youngs_modulus=E, poisson_ratio=0.3),
            curve=Voce(yield_stress=Re, saturation=Re / 2, rate=rate),
        )
        for E, Re, rate in ((2e5, 300.0, 200.0), (2e5 * e, 300.0 * r, 200.0 * e / r))
    )
    heated = Heated(law=cold, stiff=np.full(4, e), strong=np.full(4, r))
    rng = np.random.default_rng(1995)
    strain = rng.normal(0.0, 1e-4, (6, 4))
    strain[0] += 2e-3  # tension and compression, so that no two principal stresses are the same
    strain[2] -= 2e-3
    before = own.initial(4, 6)
    found = own.respond(strain, before)
    flow = found.state.plastic_strain + rng.normal(0.0, 1e-4, (6, 4))
    off = strain + flow - found.state.plastic_strain  # so that the flow alone is wrong
    given = off, found.stress, before, replace(found.state, plastic_strain=flow)
    np.testing.assert_allclose(heated.misfit(*given), own.misfit(*given), rtol=1e-9)
    assert heated.misfit(*given).min() > 1.0
