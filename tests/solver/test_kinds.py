"""Values of another kind than declared are refused by field, value and what is allowed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from solver import (
    Body,
    ContactPair,
    Coulomb,
    Link,
    Material,
    Model,
    ModelError,
    PathControl,
    RigidBody,
    SingularPoint,
    Solution,
    Stage,
    Tolerances,
    solve,
)
from solver.contact.system import System
from solver.loading.outcome import Tally
from solver.mesh import grid
from solver.model.friction import ContactPlaces, FrictionLaw, Value
from solver.parameters import Length, require
from solver.scenes.punch import PunchParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Worn(FrictionLaw):
    """A law of a user's own, without any check of its own."""

    length: Length

    def bound(self, at: ContactPlaces) -> list[tuple[Value, Value]]:
        return [(0.1, 0.0)]


STEEL = {"youngs_modulus": 2e5, "poisson_ratio": 0.3}
PLATE: dict[str, Any] = {
    "name": "plate", "mesh": grid(np.arange(2.0), np.arange(2.0)), "material": Material(**STEEL),
}  # fmt: skip
BODY = Body(**PLATE, supports={"bottom": "xy"})
PAIR = {"slave": ("up", "bottom"), "master": ("plate", "top")}
STAGE = {"name": "pressed", "target": 1.0}
HELD = "a dict of text to one of x, y, z, xy, xz, yz, xyz"


@pytest.mark.parametrize(
    ("make", "given", "field", "value", "allowed"),
    [
        (Material, STEEL, "yield_stress", "300", "a number or inf"),
        (Material, STEEL, "yield_stress", True, "a number or inf"),
        (ContactPair, PAIR, "friction", "0.3", "a number or FrictionLaw"),
        (ContactPair, PAIR, "slave", "up.bottom", "a tuple (text, text)"),
        (ContactPair, PAIR, "slave", ("up", "bottom", "left"), "a tuple (text, text)"),
        (ContactPair, PAIR, "amplitude", 2.0, "Amplitude or None"),
        (Link, {}, "slave", "up.bottom", "a tuple (text, text)"),
        (Model, {}, "bodies", BODY, "a tuple of Body"),
        (Model, {}, "bodies", {BODY.name}, "a tuple of Body"),
        (SingularPoint, {"radius": 1.0}, "at", np.array(3.0), "a tuple (a number, a number)"),
        (Model, {"bodies": [BODY]}, "contacts", ContactPair(**PAIR), "a tuple of ContactPair"),
        (Body, PLATE, "supports", ["left"], HELD),
        (Body, PLATE, "material", "steel", "Law"),
        (Body, PLATE, "mesh", "plate.msh", "Mesh"),
        (Body, PLATE, "condense", "no", "true or false"),
        (RigidBody, {"name": "tool"}, "x", 0.1, "Moved or Pushed"),
        (SingularPoint, {"radius": 1.0}, "at", 3.0, "a tuple (a number, a number)"),
        (PathControl, {}, "unload_steps", 2.5, "an integer"),
        (Stage, STAGE, "steps", 2.5, "an integer"),
    ],
)
def test_a_field_of_another_kind_is_refused(
    make: Any, given: dict[str, Any], field: str, value: object, allowed: str
) -> None:
    with pytest.raises(ModelError) as caught:
        make(**(given | {field: value}))
    named = f"pressed.{field}" if make is Stage else field
    assert (caught.value.field, caught.value.allowed) == (named, f"must be {allowed}")
    assert caught.value.value is value or caught.value.value == value


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Coulomb(shear_limit=99), "shear_limit = 99: must be at least 0 and at most 10"),
        (
            lambda: ContactPair(**PAIR, friction=11.0),
            "friction = 11.0: must be at least 0 and at most 10 or FrictionLaw",
        ),
        (
            lambda: Material(**STEEL, hardening_ratio=0.95),
            "hardening_ratio = 0.95: must be at least 0 and at most 0.9",
        ),
        (
            lambda: Material(**STEEL, yield_stress=-1.0),
            "yield_stress = -1.0: must be greater than 0 [MPa] or inf",
        ),
        (lambda: Tolerances(residual=0.0), "residual = 0.0: must be greater than 0"),
        (lambda: Worn(length=-2.0), "length = -2.0: must be greater than 0 and at most 1e+06 [mm]"),
        (
            lambda: PunchParameters(curve=((0.0, math.nan),)),
            "curve[0][1] = nan: must be a finite number",
        ),
        (lambda: Model(bodies=(BODY, "up")), "bodies[1] = 'up': must be Body"),
        (lambda: Body(**PLATE, pressure={"left": "1"}), "pressure.left = '1': must be a number"),
    ],
)  # fmt: skip
def test_a_value_outside_of_its_declared_range_is_refused(make: Any, message: str) -> None:
    with pytest.raises(ModelError) as caught:
        make()
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("given", "field", "allowed"),
    [
        ({"model": BODY}, "model", "must be Model"),
        ({"load": "2"}, "load", "must be a number or None"),
        ({"stages": Stage(**STAGE)}, "stages", "must be a tuple of Stage"),
        ({"control": "fine"}, "control", "must be PathControl or None"),
        ({"load": 3.0, "stages": [Stage(**STAGE)]}, "load", "must be left out if stages are given"),
    ],
)
def test_what_solve_cannot_use_is_refused(given: dict[str, Any], field: str, allowed: str) -> None:
    with pytest.raises(ModelError) as caught:
        solve(**({"model": Model(bodies=(BODY,))} | given))
    assert (caught.value.field, caught.value.allowed) == (field, allowed)


@pytest.mark.parametrize("read", ["nodes", "displacement", "stress", "strain", "plastic_strain",
                                  "plastic_tensor", "initial_stress"])  # fmt: skip
def test_fields_of_an_unknown_body_are_refused(read: str) -> None:
    system = System(Model(bodies=(BODY,)))
    solution = Solution(system=system, stages={"unloaded": None}, tally=Tally())  # type: ignore[dict-item]
    with pytest.raises(ModelError, match=r"^body = 'low': must be one of plate$"):
        getattr(solution, read)("low")


@pytest.mark.parametrize("pair", [3, "up", 0.0, -2])
def test_an_unknown_pair_is_refused(pair: Any) -> None:
    upper = Body(**PLATE | {"name": "up", "mesh": grid(np.arange(2.0), np.arange(2.0) + 1)},
                 supports={"top": "xy"})  # fmt: skip
    system = System(Model(bodies=(BODY, upper), contacts=(ContactPair(**PAIR),)))
    solution = Solution(system=system, stages={"loaded": None}, tally=Tally())  # type: ignore[dict-item]
    with pytest.raises(ModelError, match=r"^pair = .*: must be from 0 to 0$"):
        solution.contact(pair)


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (3, float),
        (np.float32(3), float),
        (np.array(3.0), float),
        (np.int64(3), int),
        (np.True_, bool),
        (np.array([0.0, 1.0]), tuple[float, float]),
        ([0.0, 1], tuple[float, ...]),
        ((), tuple[float, ...]),
    ],
)
def test_numbers_and_lists_of_arrays_are_numbers_and_lists(value: object, hint: Any) -> None:
    require("field", value, hint)
