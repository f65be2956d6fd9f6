"""Boundaries and pairs of them that give wrong answers are refused."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError
from solver.fem.discretisation import Discretisation
from solver.mesh import grid
from solver.model.loads import TravellingPressure

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
TRAVELLING = TravellingPressure(boundary="seam", half_width=0.5, peak=1.0)


def plate(name="plate", height=0.0, **fields):
    """Four by two, of eight squares; ``seam`` runs along its middle."""
    mesh = grid(np.arange(5.0), np.arange(3.0) + height)
    mesh = mesh.with_boundaries({"seam": lambda x: x[1] == height + 1}, boundaries_only=False)
    top = mesh.boundaries["top"]
    mesh = mesh.with_boundaries({"lid": top, "upper left": top[:2], "upper right": top[2:]})
    return Body(**({"name": name, "mesh": mesh, "material": STEEL} | fields))


# -- facets ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"pressure": {"seam": 1.0}}, "pressure"),
        ({"loads": (TRAVELLING,)}, "travelling_pressure"),
    ],
)
def test_loads_inside_a_body_are_refused(fields, field):
    with pytest.raises(ModelError) as caught:
        plate(**fields)
    assert (caught.value.field, caught.value.value) == (field, "seam")
    assert caught.value.allowed == (
        "must lie on the outside of body 'plate'; 4 of its facets are inside, one between elements "
        "0 and 1"
    )


@pytest.mark.parametrize("side", ["slave", "master"])
def test_contact_inside_a_body_is_refused(side):
    sides = {"slave": ("pad", "bottom"), "master": ("plate", "top")}
    pair = ContactPair(**(sides | {side: (sides[side][0], "seam")}))
    with pytest.raises(ModelError, match=f"^{side} = 'seam': must lie on the outside"):
        Model(bodies=(plate(), plate("pad", 2.0)), contacts=(pair,))


def test_supports_may_hold_a_body_inside():
    held = Discretisation(plate(supports={"seam": "xy"}))
    assert held.rigid.shape[1] == 0
    assert held.n - len(held.active) == 18


@pytest.mark.parametrize(
    ("facets", "allowed"),
    [
        (np.array([1, 1]), "each facet once"),
        (np.array([-1]), "from 0 to 21"),
        (np.array([22]), "from 0 to 21"),
        (np.arange(22) == 2, "from 0 to 21"),
    ],
    ids=["twice", "below", "above", "mask"],
)
@pytest.mark.parametrize("kind", ["supports", "pressure"])
def test_boundaries_that_are_not_sets_of_facets_are_refused(facets, allowed, kind):
    mesh = plate().mesh.with_boundaries({"wrong": facets})
    with pytest.raises(ModelError, match=f"^{kind} = 'wrong': must be a boundary .*{allowed}"):
        plate(mesh=mesh, **{kind: {"wrong": {"supports": "x", "pressure": 1.0}[kind]}})


# -- pairs -------------------------------------------------------------------------------------


@pytest.mark.parametrize("master", ["top", "lid", "upper left"])
def test_a_surface_in_contact_with_itself_is_refused(master):
    pair = ContactPair(slave=("plate", "top"), master=("plate", master))
    with pytest.raises(ModelError) as caught:
        Model(bodies=(plate(),), contacts=(pair,))
    assert caught.value.field == "contacts[0].master"
    assert caught.value.value == ("plate", master)
    assert caught.value.allowed == (
        "shares facets with slave ('plate', 'top'): must be another surface"
    )


@pytest.mark.parametrize("surface", ["top", "lid", "upper right"])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_pair_given_twice_is_refused(surface, swapped):
    sides = (("pad", "bottom"), ("plate", surface))
    again = ContactPair(**dict(zip(("master", "slave") if swapped else ("slave", "master"), sides,
                                   strict=True)))  # fmt: skip
    other = ContactPair(slave=("pad", "left"), master=("plate", "right"))
    first = ContactPair(slave=("pad", "bottom"), master=("plate", "top"))
    with pytest.raises(ModelError) as caught:
        Model(bodies=(plate(), plate("pad", 2.0)), contacts=(other, first, again))
    assert caught.value.field == "contacts[2]"
    assert caught.value.value == (again.slave, again.master)
    assert caught.value.allowed == "pairs surfaces that contacts[1] pairs: give each pair once"


@pytest.mark.parametrize("slave", ["pad", "plate"])
def test_bodies_of_different_thickness_are_no_pair(slave):
    """The pressure would be that on the area of the slave, whichever that is."""
    sides = {"pad": ("pad", "bottom"), "plate": ("plate", "top")}
    pair = ContactPair(slave=sides.pop(slave), master=sides.popitem()[1])
    bodies = plate(thickness=1.5), plate("pad", 2.0, thickness=0.5)
    with pytest.raises(ModelError) as caught:
        Model(bodies=bodies, contacts=(pair,))
    assert caught.value.field == "contacts[0]"
    assert caught.value.value == {"pad": 0.5, "plate": 1.5}
    assert caught.value.allowed.startswith("must join bodies of one thickness")
    Model(bodies=bodies)
    round_axis = [plate(n, y, thickness=t, kinematics="axisymmetric")
                  for n, y, t in (("plate", 0.0, 1.5), ("pad", 2.0, 0.5))]  # fmt: skip
    Model(bodies=tuple(round_axis), contacts=(pair,))


def test_one_surface_may_be_paired_with_several_others():
    bodies = (plate(), plate("one", 2.0), plate("two", 2.0))
    pairs = [
        ContactPair(slave=("one", "bottom"), master=("plate", "top")),
        ContactPair(slave=("two", "bottom"), master=("plate", "top")),
        ContactPair(slave=("one", "right"), master=("two", "left")),
        ContactPair(slave=("plate", "left"), master=("plate", "right")),
    ]
    assert Model(bodies=bodies, contacts=tuple(pairs))
