"""The audit notices each of the faults that are put into the solver on purpose."""

from __future__ import annotations

from typing import Any

import pytest

from solver import SCENES, Record
from tests.verification.mutations import MUTATIONS, PUNCH, ROLLING, Mutation

BASE: dict[str, dict[str, Any]] = {"punch": PUNCH, "rolling": ROLLING}


def run(scene: str, **changes: Any) -> Record:
    """Return the one record of a coarse run."""
    found = SCENES[scene]
    parameters = found.parameters(**(BASE[scene] | changes))
    (record,) = found.path(parameters, [getattr(parameters, found.branch)], lambda done: None)
    return record


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("punch", {}),
        ("punch", {"hardening": "kinematic"}),
        ("punch", {"state": "axisymmetric"}),
        ("rolling", {}),
        ("rolling", {"traction": 0.0}),
    ],
)
def test_without_a_fault_the_same_runs_pass(scene: str, changes: dict[str, Any]) -> None:
    assert run(scene, **changes).status.name == "OK"


@pytest.mark.parametrize("mutation", MUTATIONS.values(), ids=MUTATIONS)
def test_a_fault_is_noticed(mutation: Mutation, monkeypatch: pytest.MonkeyPatch) -> None:
    mutation.fault(monkeypatch)
    record = run(mutation.scene, **(mutation.parameters or {}))
    assert record.status.name == "AUDIT_FAILED", record.message
    assert any(f"audit_{name} = " in record.message for name in mutation.breaks), record.message
