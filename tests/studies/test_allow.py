"""Runs outside small-strain theory: not ok unless the study allows it, and never computed twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from studies import Store, Study, StudyError, StudyEvent, open_study, run_study
from studies.execution.estimate import estimate
from studies.views.tables import runs_table
from tests.studies.fakes import FAKE

pytestmark = pytest.mark.usefixtures("one_worker")

LARGE: dict[str, Any] = {
    "name": "large",
    "scene": "fake",
    "parameters": {"trouble": "large"},
    "sweep": {"load_ratio": [0.3, 0.9]},
}
ALLOWED = {**LARGE, "allow": ["large_strain"]}


def statuses(outcome: Any) -> list[str]:
    with open_study(outcome.dataset) as dataset:
        return [str(status) for status in dataset["status"].values.ravel()]


@pytest.mark.processes
def test_a_run_outside_theory_is_not_ok_and_has_its_numbers(store: Store) -> None:
    outcome = run_study(LARGE, store, workers=1)
    assert not outcome.ok
    assert outcome.counts == {"ok": 1, "outside_theory": 1}
    ((_, status, message),) = outcome.failed
    assert (status, message) == ("outside_theory", "strain reaches 14%")
    assert statuses(outcome) == ["ok", "outside_theory"]
    with open_study(outcome.dataset) as dataset:
        assert np.isfinite(dataset["peak_contact_pressure"]).all()


@pytest.mark.processes
def test_it_is_not_computed_again_as_it_would_be_the_same(store: Store) -> None:
    run_study(LARGE, store, workers=1)
    assert run_study(LARGE, store, workers=1).computed == []
    assert estimate(Study.from_dict(LARGE), store).to_compute == 0


@pytest.mark.processes
def test_a_study_that_allows_large_strain_takes_it_as_ok_and_computes_nothing(
    store: Store,
) -> None:
    """One run, one id, one file: the file and the catalogue keep what was found."""
    strict, lenient = Study.from_dict(LARGE), Study.from_dict(ALLOWED)
    assert list(strict.run_ids()) == list(lenient.run_ids())
    assert strict.id != lenient.id
    run_study(strict, store, workers=1)
    outcome = run_study(lenient, store, workers=1)
    assert outcome.computed == []
    assert outcome.ok and outcome.counts == {"ok": 2} and outcome.failed == []
    assert statuses(outcome) == ["ok", "ok"]
    with open_study(outcome.dataset) as dataset:
        assert list(dataset["message"].values.ravel()) == ["", "strain reaches 14%"]
    again = run_study(lenient, store, workers=1)
    assert not again.anew and again.counts == {"ok": 2}
    assert store.outcomes(lenient.id) == {"ok": 2}
    assert {row["status"] for row in store.catalogue.runs()[0]} == {"ok", "outside_theory"}


@pytest.mark.processes
def test_events_tell_the_status_as_the_study_takes_it(store: Store) -> None:
    events: list[StudyEvent] = []
    run_study(ALLOWED, store, workers=1, on_event=events.append)
    assert [event.status for event in events if event.kind == "run"] == ["ok", "ok"]


@pytest.mark.processes
def test_the_command_lists_them_and_returns_1_unless_they_are_allowed(
    study_file: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = study_file(trouble="large")
    arguments = ["run", str(path), "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(arguments) == 1
    told = capsys.readouterr().out
    assert "\noutside_theory: strain reaches 14%\n    2 runs: load_ratio = 0.9, " in told
    assert "4 runs (2 ok, 2 outside_theory)" in told
    path.write_text('allow = ["large_strain"]\n' + path.read_text())
    assert main(arguments) == 0
    told = capsys.readouterr().out
    assert "\nwarning: strain reaches 14%\n" in told
    assert "4 runs (4 ok; 2 with a warning), 0 computed" in told


def test_what_the_scene_allows_every_study_of_it_allows() -> None:
    scene = replace(FAKE, name="lenient", allow=("large_strain",))
    study = Study.from_dict(LARGE, scene=scene)
    assert study.allow == ["large_strain"]
    assert study.id == Study.from_dict(ALLOWED, scene=scene).id
    assert study.taken("outside_theory") == "ok"
    assert study.taken("audit_failed") == "audit_failed"


@pytest.mark.parametrize("wrong", ["large_strain", ["any"], ["large_strain"] * 2, {}, 1, ""])
def test_nothing_else_can_be_allowed(wrong: Any) -> None:
    with pytest.raises(StudyError, match=r"^allow"):
        Study.from_dict({**LARGE, "allow": wrong})


def test_a_study_that_allows_nothing_has_the_id_it_had() -> None:
    assert Study.from_dict(LARGE).id == Study.from_dict({**LARGE, "allow": []}).id
    assert Study.from_dict(ALLOWED).to_dict()["allow"] == ["large_strain"]


def table(beside: float) -> str:
    """Return the table of two runs; the peak of the second is this far from the corner."""
    over = ("load_ratio",)
    held = {
        "status": (over, np.full(2, "ok", dtype=object)),
        "max_plastic_strain": (over, [0.02, 0.5]),
        "audit_plastic_strain": (over, [0.02, 0.04]),
        "peak_contact_pressure": (over, [350.0, 900.0]),
        "peak_contact_pressure_s": (over, [0.0, 50.0 - beside]),
        "singular_s": ((*over, "singular"), [[50.0], [50.0]]),
        "singular_radius": ((*over, "singular"), [[0.25], [0.25]]),
    }
    return runs_table(xr.Dataset(held, coords={"load_ratio": [0.3, 0.6]}))


def test_the_table_marks_numbers_taken_at_a_singular_point() -> None:
    """The strain beside it stands in a column of its own."""
    rows = [line.split() for line in table(0.2).splitlines() if line.startswith("0.")]
    assert rows == [["0.3", "ok", "350", "0.02", "0.02"],
                    ["0.6", "ok", "900*", "0.5*", "0.04"]]  # fmt: skip
    assert table(0.2).rstrip().endswith("as the mesh is refined")
    assert "900 " in table(0.3) or "900\n" in table(0.3)
    assert "900*" not in table(0.3)


def test_a_scene_without_singular_points_has_neither_mark_nor_column() -> None:
    over = ("load_ratio",)
    held = {
        "status": (over, np.full(2, "ok", dtype=object)),
        "max_plastic_strain": (over, [0.02, 0.5]),
        "audit_plastic_strain": (over, [0.02, 0.5]),
    }
    told = runs_table(xr.Dataset(held, coords={"load_ratio": [0.3, 0.6]}))
    assert "*" not in told and "singular" not in told
