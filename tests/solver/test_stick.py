"""How much of a contact sticks, by what its points do."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from solver.results.acting import Acting, ContactResult
from solver.results.contact import STICK_FRACTION, STICK_HALF_WIDTH, stick, stick_half_width


def points(x, closed, sticking):
    s, none = np.array(x, dtype=float), np.zeros(len(x))
    return ContactResult(
        s=s,
        X=np.stack([s, none]),
        area=none,
        pressure=np.array(closed, dtype=float),
        shear=none,
        pressure_deformed=none,
        gap=none,
        slip=none,
        closed=np.array(closed, dtype=bool),
        sticking=np.array(sticking, dtype=bool),
    )


@pytest.mark.parametrize(
    ("closed", "sticking", "half", "whole"),
    [
        ("1111", "1100", 1.5, 0.75),  # slip beyond: half-way
        ("1110", "1110", 2.0, 1.0),  # open beyond: the contact ends there
        ("1111", "1111", 3.0, 1.5),
        ("1111", "0110", 2.5, 1.0),
        ("1111", "0000", 0.0, 0.0),
        ("0000", "0000", 0.0, 0.0),
    ],
)
def test_the_end_of_the_part_that_sticks(closed, sticking, half, whole):
    """``half`` of bodies symmetric about x = 0, ``whole`` where all of the contact is computed."""
    row = points(range(4), [c == "1" for c in closed], [c == "1" for c in sticking])
    assert stick_half_width(row, symmetric=True) == half
    assert stick_half_width(row, symmetric=False) == whole


def test_without_contact_nothing_is_known() -> None:
    run = SimpleNamespace(acting=lambda at: Acting(), loaded=None)
    found = stick(run)
    assert np.isnan([found[STICK_HALF_WIDTH], found[STICK_FRACTION]]).all()
