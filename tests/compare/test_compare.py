"""Two computations are the same to the limit, or what differs is named."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from studies import Study
from tests.compare import ids
from tests.compare.__main__ import computed, jobs
from tests.compare.changes import HUNG, LIMIT, compared
from tests.compare.worker import named, sampled
from tests.faults import ROOT

STRESS = np.array([100.0, np.nan, 1e-3, 0.0])
BEFORE = {
    "status": "OK",
    "stress": STRESS,
    "iterations": 4,
    "record.cpu_seconds": 1.0,
    "stage": ["a"],
}


def test_numbers_that_moved_less_than_the_limit_are_the_same() -> None:
    close = BEFORE | {"stress": STRESS + 0.5 * LIMIT * 100.0, "record.cpu_seconds": 2.0}
    row = compared({"run": BEFORE}, {"run": close})
    assert row.same
    assert (row.runs, row.values) == (1, 7)
    assert row.worst == (pytest.approx(0.5 * LIMIT, rel=1e-4), "run: stress")


@pytest.mark.parametrize(
    ("name", "value", "change"),
    [
        ("stress", STRESS + 2 * LIMIT * 100.0, 2 * LIMIT),
        ("stress", np.array([100.0, 1.0, 1e-3, 0.0]), np.inf),
        ("stress", np.array([np.inf, np.nan, 1e-3, 0.0]), np.inf),
        ("stress", STRESS[:2], np.inf),
        ("iterations", 5, 0.25),
        ("stage", ["b"], np.inf),
    ],
)
def test_a_number_that_moved_is_named(name: str, value: object, change: float) -> None:
    row = compared({"run": BEFORE}, {"run": BEFORE | {name: value}})
    assert not row.same
    assert row.moved == [(pytest.approx(change, rel=1e-4), f"run: {name}")]


def test_zeros_that_changed_moved_and_what_rounding_changes_did_not() -> None:
    zero, forces = {"figure": np.zeros(2)}, {"audit_tension": 1e-12}
    assert compared({"run": zero}, {"run": {"figure": np.full(2, 1e-30)}}).moved[0][0] == np.inf
    assert compared({"run": forces}, {"run": {"audit_tension": 3e-12}}).same


def test_statuses_that_differ_and_what_one_side_has_are_named() -> None:
    failed = BEFORE | {"status": "NOT_CONVERGED"}
    row = compared({"a": BEFORE, "b": BEFORE}, {"a": failed, "b": BEFORE | {"more": 1.0}, "c": {}})
    assert not row.same
    assert row.statuses == [("a", "OK", "NOT_CONVERGED")]
    assert row.alone == ["c (only new)", "b: more (only new)"]


def test_a_scene_that_took_too_long_before_is_left_out() -> None:
    row = compared({"a": {"status": HUNG}}, {"a": BEFORE})
    assert row.same
    assert (row.runs, row.left_out) == (0, 1)


def test_every_study_and_every_family_is_compared_in_a_fixed_choice() -> None:
    studies = ROOT / "data/studies"
    found = jobs(studies, 6, 200)
    assert found == jobs(studies, 6, 200)
    assert {f"study {file.stem}" for file in studies.glob("*.toml")} < found.keys()
    counts = [len(of[1][0]) for of in found.values() if of[0] == "family"]
    assert sum(counts) == 200
    assert min(counts) >= 2


@pytest.mark.parametrize(
    "file", sorted((ROOT / "data/studies").glob("*.toml")), ids=lambda file: file.stem
)
def test_the_choice_of_a_study_has_runs_of_the_study(file: Path) -> None:
    study = Study.from_toml(file)
    choice = sampled(study, 2)
    assert choice.kind.chooses or choice.size == 2
    assert {*choice.run_ids()} <= {*study.run_ids()}


def test_studies_whose_ids_are_compared_are_of_many_kinds_in_a_fixed_choice() -> None:
    found = dict(ids.contents())
    assert found == dict(ids.contents())
    entries = {entry for each in found.values() for entry in each}
    assert {"goal", "refine", "fit", "points", "sample", "extends", "keep", "allow"} < entries


def test_runs_are_named_alike_in_any_order_and_with_other_parameters() -> None:
    before = [('{"a": 2, "b": 1}', {"n": 2}), ('{"a": 1, "b": 1}', {"n": 1})]
    after = [('{"b": 1, "aa": 0, "a": 1}', {"n": 1}), ('{"b": 1, "aa": 0, "a": 2}', {"n": 2})]
    assert named(before) == named(after) == {"run 0": {"n": 1}, "run 1": {"n": 2}}


@pytest.mark.processes
def test_a_checkout_computes_with_its_own_interpreter(tmp_path: Path) -> None:
    for name in ("solver", "studies", "tests"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    seconds, memory, runs = computed(tmp_path, ("family", (["heat-0"], 20.0)))
    assert seconds > 0
    assert memory > 0
    assert runs["heat-0"]["status"] == "answer"
    assert np.ptp(runs["heat-0"]["displacement"]) > 0
