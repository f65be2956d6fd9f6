"""The audit notices each of the faults that are put into the solver on purpose."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from solver import SCENES, Record
from solver.scenes.scene import Scene
from tests.verification import mutations, mutations_stored
from tests.verification.mutations import PUNCH, ROLLING, Fault, Mutation
from tests.verification.mutations_stored import FIT, PRESSED, TO_AND_FRO, UNSEEN, of_file

BASE: dict[str, tuple[str, dict[str, Any], tuple[float, ...]]] = {
    "punch": ("punch", PUNCH, ()),
    "rolling": ("rolling", ROLLING, ()),
    "pressed": ("punch", PRESSED, ()),
    "branches": ("punch", PRESSED, (0.6,)),
    "to and fro": ("rolling", TO_AND_FRO, ()),
    "fit": ("shaft_hub", FIT, ()),
}
"""Label -> scene, parameters of a coarse run, and loads of runs that it branches from."""
MUTATIONS = mutations.MUTATIONS | mutations_stored.MUTATIONS


def run(label: str, **changes: Any) -> Record:
    """Return the record of a coarse run."""
    name, coarse, others = BASE.get(label, ("", {}, ()))
    found: Scene = SCENES[name] if name else of_file()
    parameters = found.parameters(**(coarse | changes))
    own = getattr(parameters, found.branch) if found.branch else 0.0
    return list(found.path(parameters, [*others, own], lambda done: None))[-1]


@pytest.mark.parametrize(
    ("label", "changes"),
    {
        (each.scene, str(each.parameters)): (each.scene, each.parameters or {})
        for each in MUTATIONS.values()
    }.values(),
)
def test_without_a_fault_the_same_runs_pass(label: str, changes: dict[str, Any]) -> None:
    assert run(label, **changes).status.name == "OK"


@pytest.mark.parametrize("mutation", MUTATIONS.values(), ids=MUTATIONS)
def test_a_fault_is_noticed(mutation: Mutation, monkeypatch: pytest.MonkeyPatch) -> None:
    mutation.fault(monkeypatch)
    record = run(mutation.scene, **(mutation.parameters or {}))
    assert record.status.name == "AUDIT_FAILED", record.message
    assert any(f"audit_{name} = " in record.message for name in mutation.breaks), record.message


@pytest.mark.parametrize(("fault", "test"), UNSEEN.values(), ids=UNSEEN)
def test_a_fault_that_no_audit_sees_is_seen_by_a_test(
    fault: Fault, test: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    test()
    fault(monkeypatch)
    with pytest.raises(AssertionError):
        test()
