"""A scene with every kind of entry: whatever its increments and motion, it passes its audit."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from solver import Status
from studies.scenes.description import Description
from studies.scenes.scene import file_scene

FILE = Path(__file__).parents[1] / "studies" / "scenes" / "everything.toml"


@pytest.mark.parametrize(
    ("parts", "turn"), [(1, 1e-2), pytest.param(10, 1e-3, marks=pytest.mark.long)]
)
def test_a_scene_of_everything_is_ok_once_its_contacts_are_resolved(
    parts: int, turn: float
) -> None:
    """The file itself is coarse: its contacts are narrower than an element, which is told."""
    tables = tomllib.loads(FILE.read_text())
    tables["rigid"]["plate"]["y"]["moved"] = -0.1
    tables["bodies"]["ring"]["shape"]["near"] = [
        {"at": [0, 10], "size": 0.1}, {"at": [0, -10], "size": 0.1},
    ]  # fmt: skip
    scene = file_scene(Description(FILE.name, tables, {}))
    parameters = scene.parameters(parts=parts, turn=turn, element=0.15)
    (record,) = scene.path(parameters, [0.0], lambda share: None)
    assert record.status is Status.OK, record.message
    assert record.scalars["audit_contact_resolution"] < 0.3
    assert 0.005 < record.scalars["audit_plastic_strain"] < 0.02
