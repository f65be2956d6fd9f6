"""Each of the faults is noticed that are put on purpose into the solver and into its files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from solver import Record
from solver.results.record import Status
from solver.scenes.scene import Scene
from studies import Store, Study
from studies.definition.cases import Case
from studies.definition.identity import solver_hash
from studies.errors import FileDiffers
from studies.execution.task import PathTask, walk
from studies.scenes.registry import scene_named
from studies.storage import runfile
from tests.recomputed import RecordDiffers
from tests.verification import mutations, mutations_stored
from tests.verification.mutations import PUNCH, ROLLING, Fault, Mutation
from tests.verification.mutations_file import FILE_FAULTS, FileFault, every_run_is_ok
from tests.verification.mutations_stored import FIT, PRESSED, STORED, TO_AND_FRO, UNSEEN, of_file

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
    found: Scene = scene_named(name) if name else of_file()
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
    if STORED in mutation.breaks:
        with pytest.raises(RecordDiffers):
            run(mutation.scene, **(mutation.parameters or {}))
        return
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


COARSE = Study.from_dict({"name": "coarse", "scene": "punch", "parameters": PUNCH, "sweep": {}})


@pytest.fixture(scope="module")
def case() -> Case:
    return next(COARSE.cases())


@pytest.fixture(scope="module")
def audited() -> Record:
    """The record of a coarse run that has passed its audit, with fields at its nodes.

    A file costs as many milliseconds as it has variables: numbers and minima that no fault touches
    are left out.
    """
    found = run("punch")
    assert found.status is Status.OK
    numbers = {k: v for k, v in found.scalars.items() if not k.startswith("audit_")}
    fields = {k: v for k, v in found.fields.items() if "residual_min" not in k}
    return replace(found, scalars=numbers, fields=fields).with_one_mesh()


@pytest.mark.parametrize("status", [Status.OK, Status.AUDIT_FAILED])
def test_without_a_fault_the_file_of_a_run_says_what_was_audited(
    case: Case, audited: Record, status: Status, tmp_path: Path
) -> None:
    row = Store(tmp_path).write_run(case, replace(audited, status=status), "fields")
    assert row["status"] == status.name.lower()
    assert row == runfile.row(Store(tmp_path).run_path(case.id))


@pytest.mark.parametrize("fault", FILE_FAULTS.values(), ids=FILE_FAULTS)
def test_a_fault_of_the_file_is_refused(
    fault: FileFault, case: Case, audited: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault.fault(monkeypatch)
    with pytest.raises(FileDiffers) as told:
        Store(tmp_path).write_run(case, replace(audited, status=fault.status), "fields")
    assert any(fault.told in each for each in told.value.differences), told.value.differences
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_run_whose_file_would_say_something_else_has_failed(
    case: Case, audited: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The catalogue, the file and the study have the reason, and none has a number."""
    FILE_FAULTS["a map times 1e-3"].fault(monkeypatch)
    row = walked(case, audited, tmp_path, monkeypatch)
    assert row == runfile.row(Store(tmp_path).run_path(case.id))
    assert row["status"] == "error"
    assert row["message"].startswith("FileDiffers: the file would differ from the computed results")
    assert "residual_stress has other values" in row["message"]
    assert row["scalars"] == {}


def test_where_no_file_says_what_it_should_there_is_none(
    case: Case, audited: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    every_run_is_ok(monkeypatch)
    failed = replace(audited, status=Status.AUDIT_FAILED)
    with pytest.raises(FileDiffers, match="status has other values"):
        walked(case, failed, tmp_path, monkeypatch)
    assert list(tmp_path.rglob("*.nc")) == []


def walked(
    case: Case, record: Record, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> dict[str, Any]:
    """Carry out the task of a run whose record is known; return the row that it reports."""
    (path,) = COARSE.paths()
    monkeypatch.setattr(Scene, "path", lambda *_: iter([record]))
    heard: list[dict[str, Any]] = []
    walk(PathTask(case.scene, (path,), directory, solver_hash()), heard.append, lambda: False)
    return next(each["row"] for each in heard if "row" in each)
