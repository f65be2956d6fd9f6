"""Wear and slip of a pad that slides over a block, in scene files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.studies.scenes.conftest import built

FRICTION, COEFFICIENT = 0.3, 1e-8
NUMBERS = ("wear_depth", "slip_length", "slip_work", "slip_share", "fretting_parameter")


def rectangle(x: list[float], y: list[float]) -> dict[str, Any]:
    return {"kind": "rectangle", "x": x, "y": y, "size": 0.5}


def sliding(slave: str = "base.top", friction: float = FRICTION, **wear: str) -> dict[str, Any]:
    """Return the scene of a pad that is pressed on a longer block, slides and is lifted."""
    sides = {"base.top", "pad.bottom"}
    (master,) = sides - {slave}
    times = {"pressed": 1, "slid": 1, "lifted": -1}
    return {
        "name": "sliding",
        "materials": {"steel": {"youngs_modulus": 2e5, "poisson_ratio": 0.3}},
        "bodies": {
            "base": {
                "material": "steel", "supports": {"bottom": "xy"},
                "shape": rectangle([-10.0, 10.0], [-4.0, 0.0]),
            },
            "pad": {"material": "steel", "shape": rectangle([-7.0, -3.0], [0.0, 2.0])},
        },
        "contacts": [
            {"name": "face", "slave": slave, "master": master, "friction": friction,
             "sliding": "finite"}
        ],
        "loads": [
            {"body": "pad", "kind": "displacement", "boundary": "top", "x": 0.0, "y": -0.002,
             "amplitude": times},
            {"body": "pad", "kind": "displacement", "boundary": "top", "x": 6.0,
             "amplitude": {"pressed": 0, "slid": 1, "lifted": 1}},
        ],
        "stages": [{"name": "pressed"}, {"name": "slid", "increments": 24}, {"name": "lifted"}],
        "results": {
            "wear": {"since": "pressed", "until": "slid", "coefficient": COEFFICIENT, **wear}
        },
    }  # fmt: skip


def numbers(content: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of wear of the run of a scene."""
    scene = built(content)
    (record,) = scene.path(scene.parameters(), [], lambda done: None)
    assert record.status.name == "OK", record.message
    return {name: record.scalars[name] for name in NUMBERS}


@pytest.mark.solves
def test_wear_stays_where_the_contact_was() -> None:
    """It depends neither on where the pad is in the end nor on whether it is still there."""
    found, absent = numbers(sliding()), sliding(until="lifted")
    absent["contacts"][0]["active"] = ["pressed", "slid"]
    gone = numbers(absent)
    assert gone["wear_depth"] == pytest.approx(found["wear_depth"])
    assert gone["slip_work"] == pytest.approx(found["slip_work"])
    assert found["slip_work"] == pytest.approx(FRICTION * found["wear_depth"] / COEFFICIENT)


@pytest.mark.solves
def test_wear_of_a_growing_pressure_needs_no_small_increments() -> None:
    """Pressure and way grow together: wear is that of the mean pressure over the way."""

    def worn(increments: int) -> float:
        content = sliding("pad.bottom")
        content["loads"] = [
            {"body": "pad", "kind": "displacement", "boundary": "top", "x": 0.0, "y": -0.008,
             "amplitude": {"pressed": 0.25, "slid": 1}},
            {"body": "pad", "kind": "displacement", "boundary": "top", "x": 0.2,
             "amplitude": {"pressed": 0, "slid": 1}},
        ]  # fmt: skip
        content["stages"] = [{"name": "pressed"}, {"name": "slid", "increments": increments}]
        return numbers(content)["wear_depth"]

    assert worn(2) == pytest.approx(worn(16), rel=0.02)


@pytest.mark.solves
def test_nothing_slides_where_all_stick() -> None:
    content = sliding("pad.bottom", friction=2.0)
    content["contacts"][0]["sliding"] = "small"
    content["loads"][1]["x"] = 1e-6
    found = numbers(content)
    assert found["slip_share"] == 0.0
    assert found["slip_length"] < 1e-9


@pytest.mark.solves
def test_slip_is_not_known_without_friction() -> None:
    assert all(np.isnan(value) for value in numbers(sliding(friction=0.0)).values())


@pytest.mark.solves
def test_a_rigid_slave_has_no_tension() -> None:
    content = sliding("pad.bottom")
    del content["bodies"]["pad"], content["loads"], content["stages"][2]
    places = [[x, 0.0] for x in np.linspace(-7.0, -3.0, 11).tolist()]
    content["rigid"] = {"pad": {
        "surfaces": {"bottom": {"kind": "line", "points": places}},
        "x": {"moved": 0.2, "amplitude": {"pressed": 0, "slid": 1}}, "y": {"moved": -0.002},
    }}  # fmt: skip
    found = numbers(content)
    assert np.isnan(found["fretting_parameter"]) and found["slip_share"] == 1.0
    assert found["slip_length"] == pytest.approx(0.2, rel=0.01)


@pytest.mark.long
@pytest.mark.solves
def test_tension_is_that_of_the_surface_though_the_slave_is_condensed() -> None:
    content = sliding()
    condensed = numbers(content)
    content["materials"]["steel"] |= {"yield_stress": 1e5}  # never reached, but not condensed
    assert numbers(content) == pytest.approx(condensed, rel=1e-6)
