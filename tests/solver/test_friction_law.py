"""Laws of friction of one's own: in the solver, in its audit, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from solver import (
    Body,
    ContactPair,
    Material,
    Model,
    ModelError,
    Moved,
    PathControl,
    RigidBody,
    Stage,
    solve,
)
from solver.audit.report import audit
from solver.contact.problem import STICK
from solver.mesh import grid
from solver.model.friction import (
    BoundLines,
    ContactPlaces,
    Coulomb,
    FrictionLaw,
    lines_of,
    through,
)
from solver.model.rigid import line
from solver.rolling.load import RollingLoad
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.track import track_of
from solver.rolling.plane.wheel import RollingWheel
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import rim_of

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
WEAK = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
KNEES = [0.0, 50.0, 100.0, 200.0], [0.0, 30.0, 45.0, 50.0]
"""Pressure and shear at the knees of a bound [MPa]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Given(FrictionLaw):
    """The lines that are given."""

    lines: tuple[Any, ...]

    def bound(self, at: ContactPlaces) -> list[Any]:
        return list(self.lines)


@dataclass(frozen=True, slots=True, kw_only=True)
class Worn(FrictionLaw):
    """Friction that slip takes away, 0.3 exp(-slip / length)."""

    length: float

    def bound(self, at: ContactPlaces) -> list[Any]:
        return [(0.3 * np.exp(-at.slip / self.length), 0.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Smeared(FrictionLaw):
    """Friction that plastic strain of the slave's surface takes away."""

    def bound(self, at: ContactPlaces) -> list[Any]:
        return [(0.3 / (1 + 100.0 * at.plastic_strain), 0.0), (0.0, 0.5 * at.strength)]


def dragged(pressure: float, law: Any, material: Material = STEEL, **own: Any) -> Model:
    """Return a block under pressure, and the plate under it that is dragged by 0.02 mm."""
    block = Body(name="block", mesh=grid(np.linspace(-1, 1, 9), np.array([0.0, 0.04])),
                 material=material, supports={"top": "x"}, pressure={"top": pressure})  # fmt: skip
    plate = RigidBody(name="plate", surfaces={"top": line((3.0, 0.0), (-3.0, 0.0))},
                      x=Moved(value=0.02))  # fmt: skip
    pair = ContactPair(slave=("block", "bottom"), master=("plate", "top"), friction=law, **own)
    return Model(bodies=(block,), rigid=(plate,), contacts=(pair,))


def places(n: int = 3, **found: Any) -> ContactPlaces:
    def nothing() -> Any:
        raise AssertionError("nothing is looked for that no law asks for")

    names = ("strength", "plastic_strain", "slip")
    return ContactPlaces(
        n=n, **{f"find_{name}": (lambda v=found[name]: v) if name in found else nothing
                for name in names},
    )  # fmt: skip


@pytest.mark.solves
@pytest.mark.parametrize("pressure", [20.0, 75.0, 300.0])
def test_a_dragged_block_slides_at_the_bound_of_its_law(pressure: float) -> None:
    """The plate drags below the middle of the block: its pressure is uneven by a few per cent."""
    found = solve(dragged(pressure, Given(lines=tuple(through(*KNEES)))))
    slope = 5.0 / 100.0  # of the last line, which goes on
    exact = np.interp(pressure, *KNEES) + slope * max(pressure - KNEES[0][-1], 0.0)
    assert found.reaction("plate", "loaded")[0] == pytest.approx(2.0 * exact, rel=2e-3)
    assert found.audit().passed, found.audit().violations


def test_a_pair_makes_its_law_once() -> None:
    (number,), (given,) = (dragged(1.0, of).contacts for of in (0.3, Coulomb(friction=0.3)))
    assert number.law is number.law == given.law is given.friction
    assert number == replace(number, friction=0.3) and number.friction == 0.3


@pytest.mark.solves
def test_a_coefficient_is_coulombs_law_to_the_bit() -> None:
    numbers = solve(dragged(100.0, 0.3, WEAK))
    named = solve(dragged(100.0, Coulomb(friction=0.3), WEAK))
    assert np.array_equal(numbers.contact().shear, named.contact().shear)
    assert numbers.contact().shear.any()


@pytest.mark.solves
def test_friction_follows_the_slip_before_the_increment() -> None:
    """Each increment slips by the way of the plate but what the block gives way: little."""
    law, n = Worn(length=0.02), 10
    found = solve(dragged(100.0, law), control=PathControl(load_step=1 / n))
    slipped = found.loaded.start.contacts[0].slipped[0]
    assert slipped == pytest.approx(0.02 * (n - 1) / n, rel=0.05)
    contact = found.loaded.state.contacts[0]
    bound = 0.3 * np.exp(-slipped / law.length) * contact.normal
    assert np.abs(contact.tangential) == pytest.approx(bound)
    assert (contact.slipped[0] > slipped).all()
    assert found.audit().passed, found.audit().violations
    kept = found.unloaded.state.contacts[0].slipped[0]
    assert (kept >= contact.slipped[0]).all(), "taken apart they stay worn"


@pytest.mark.solves
def test_friction_follows_the_plastic_strain_of_the_surface() -> None:
    """The block yields at places before the last increment begins, and slides in it."""
    soft = replace(WEAK, hardening="isotropic")
    stages = (Stage(name="pressed", target=1.0, steps=4),)
    found = solve(dragged(500.0, Smeared(), soft), stages=stages)
    pressed = found.stages["pressed"]
    strain = found.system.plastic_strain(0, pressed.start)
    contact = pressed.state.contacts[0]
    area = found.system.interfaces[0].pairing(pressed.state.u).area
    most = 0.5 * soft.shear_yield_stress * area
    bound = np.minimum(0.3 / (1 + 100.0 * strain) * contact.normal, most)
    slips = contact.status > STICK
    assert np.abs(contact.tangential)[slips] == pytest.approx(bound[slips])
    assert (bound[slips] < most[slips]).any()
    assert (bound[slips] == most[slips]).any()
    assert strain[slips].max() > 1e-3
    assert found.audit("pressed").passed, found.audit("pressed").violations


@pytest.mark.solves
def test_the_audit_finds_shear_beyond_the_bound() -> None:
    found = solve(dragged(75.0, Given(lines=tuple(through(*KNEES)))))
    (contact,) = (state := found.loaded.state).contacts
    beyond = replace(contact, tangential=1.01 * contact.tangential)
    loaded = replace(found.loaded, state=replace(state, contacts=(beyond,)))
    for converged, wrong in ((found.loaded, False), (loaded, True)):
        check = audit(found.system, converged, found.unloaded, 0.0)
        told = any(text.startswith("audit_friction_excess") for text in check.violations)
        assert told == wrong


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([(-0.1, 0.0)], "slopes that are finite and at least 0, not -0.1"),
        ([(np.nan, 0.0)], "slopes that are finite"),
        ([(0.3, 5.0)], "zero without pressure: the least stress of its lines is 5 MPa"),
        ([(0.3, 0.0), (0.0, -2.0)], "the least stress of its lines is -2 MPa"),
        ([(0.3, np.array([0.0, 0.0, 1.0]))], "zero without pressure"),
        ([(0.3, np.nan)], "zero without pressure"),
        ([], "must give lines"),
        ([(0.3,)], "must give lines"),
        ([(np.ones(2), 0.0)], r"of numbers or of arrays \(3,\)"),
    ],
)
def test_lines_that_are_no_bound_are_refused(lines: list[Any], words: str) -> None:
    with pytest.raises(ModelError, match=f"friction_law = Given.*{words}"):
        lines_of(Given(lines=tuple(lines)), places())


@pytest.mark.parametrize(
    ("pressure", "shear", "words"),
    [
        ([0.0, 1.0, 2.0], [0.0, 0.1, 0.3], "shear = .*must be concave"),
        ([0.0, 1.0, 2.0], [0.0, 0.2, 0.1], "must not fall"),
        ([0.0, 1.0, 1.0], [0.0, 0.1, 0.2], "pressure = .*growing"),
        ([0.5, 1.0], [0.0, 0.1], r"the first point is \(0, 0\)"),
        ([0.0, 1.0], [0.0], "as many as shears"),
    ],
)
def test_points_of_no_concave_bound_are_refused(
    pressure: list[float], shear: list[float], words: str
) -> None:
    with pytest.raises(ModelError, match=words):
        through(pressure, shear)


def test_lines_through_points_meet_them() -> None:
    lines = lines_of(Given(lines=tuple(through(*KNEES))), places(1))
    found = [float(lines.least(np.array([p]))[0]) for p in KNEES[0]]
    assert found == pytest.approx(KNEES[1])


def test_lines_of_pairs_stand_side_by_side() -> None:
    one = lines_of(Coulomb(friction=0.3, cohesion=2.0), places(2))
    none = lines_of(Coulomb(), places(1))
    both = BoundLines.joined([one, none])
    assert both.least(np.full(3, 10.0)) == pytest.approx([5.0, 5.0, 0.0])
    assert both.rough.tolist() == [True, True, False]
    assert both.over(np.array([1.0, 2.0, 0.0])).least(np.full(3, 10.0)) == pytest.approx(
        [5.0, 7.0, 0.0]
    )


# -- tracks without ends -------------------------------------------------------------------------


def endless(law: FrictionLaw) -> Any:
    """Return the first pass of a wheel that is driven by half of Coulomb's full slip."""
    p = RollingParameters(element_size=2.0, friction=0.3, load_ratio=2.5)
    material = p.material()
    track = track_of(p.mesh_width, p.element_size, 1.15, material.elasticity)
    wheel = RollingWheel(
        track=track, rim=rim_of(p), friction=law, strength=material.shear_yield_stress,
        load=RollingLoad(force=p.force, drive=0.5 * 0.3 * p.force),
    )  # fmt: skip
    return next(iter(rolling(track, material, [wheel], [1])))


@pytest.mark.solves
def test_a_track_without_ends_asks_the_same_bound() -> None:
    plain = endless(Coulomb(friction=0.3)).loading
    same = endless(Given(lines=((0.3, 0.0),))).loading
    assert np.array_equal(plain.tangential, same.tangential)
    bent = Given(lines=((0.3, 0.0), (0.1, 100.0)))
    for law, mu, more in ((bent, 0.3, 100.0), (Coulomb(friction=0.1, cohesion=100.0), 1.1, 100.0)):
        found = endless(law).loading
        allowed = np.minimum(mu * found.pressure, 0.1 * found.pressure + more)
        slips = found.status > STICK
        assert np.abs(found.shear[slips]) == pytest.approx(allowed[slips], rel=1e-6)
        assert (allowed[slips] < 0.99 * mu * found.pressure[slips]).any()


@pytest.mark.solves
@pytest.mark.parametrize("law", [Worn(length=1.0), Smeared()])
def test_a_track_without_ends_refuses_a_law_of_the_state(law: FrictionLaw) -> None:
    with pytest.raises(ModelError, match=r"friction_law = .*must not depend on slip or plastic"):
        endless(law)
