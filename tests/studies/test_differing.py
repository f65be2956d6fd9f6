"""Two studies compared: runs aligned by parameters, and the largest change of each variable."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from residua.cli import main
from studies import Store, Study, StudyError, diff, open_study
from studies.storage.combine import combine
from studies.views.differing import difference_table
from studies.views.plots.differing import difference_figure
from tests.studies import test_refine
from tests.studies.fakes import SWITCHED, record
from tests.studies.test_goal import search_here

SWEEP = {"load_ratio": [0.25, 0.5], "friction": [0.0, 0.3]}


def made(place: Path, change: Any = lambda run: run, **content: Any) -> Path:
    """Store a study of the fake scene whose records are changed; return its directory."""
    scene = content.pop("own", None)
    study = Study.from_dict({"name": place.name, "scene": "fake", **content}, scene)
    store = Store(place)
    for case in study.cases():
        store.write_run(case, change(record(case.parameters)))
    store.save_study(study)
    combine(study, store, study.cases())
    return store.study_path(study.id)


def found(first: Path, second: Path) -> Any:
    with open_study(first) as before, open_study(second) as after:
        return diff(before, after)


def doubled(run: Any) -> Any:
    """Change one number, one value of a map, and one status."""
    if run.parameters.load_ratio < 0.5 or run.parameters.friction < 0.3:
        return run
    dims, stress = run.fields["residual_stress"]
    stress = stress.copy()
    stress[1, 2, 3] += 7.0
    scalars = run.scalars | {"peak_contact_pressure": 2.0 * run.scalars["peak_contact_pressure"]}
    fields = run.fields | {"residual_stress": (dims, stress)}
    return replace(run, scalars=scalars, fields=fields)


def test_a_study_does_not_differ_from_its_copy(tmp_path: Path) -> None:
    same = found(made(tmp_path / "a", sweep=SWEEP), made(tmp_path / "b", sweep=SWEEP))
    assert same.same
    assert same.common == 4
    assert difference_table(same) == "4 runs in common\nno value differs"


def test_two_studies_of_one_name_are_told_apart(tmp_path: Path) -> None:
    one = made(tmp_path / "a" / "tour", sweep=SWEEP)
    other = made(tmp_path / "b" / "tour", sweep={**SWEEP, "friction": [0.0]})
    assert "only in tour (first)" in difference_table(found(one, other))


def test_the_largest_change_is_told_with_its_place(tmp_path: Path) -> None:
    before, after = (made(tmp_path / name, change, sweep=SWEEP) for name, change in (
        ("a", lambda run: run), ("b", doubled),
    ))  # fmt: skip
    told = found(before, after)
    pressure, stress = told.changes
    assert (pressure.variable, pressure.relative, pressure.runs) == (
        "peak_contact_pressure",
        1.0,
        1,
    )
    assert pressure.run == {"load_ratio": 0.5, "friction": 0.3}
    assert stress.variable == "residual_stress"
    assert stress.absolute == pytest.approx(7.0)
    assert stress.after - stress.before == pytest.approx(7.0)
    with open_study(after) as dataset:
        at = dataset.residual_stress.sel(**stress.run).squeeze(drop=True).sel(**stress.place)
        assert at.item() == stress.after
    text = difference_table(told)
    assert "peak_contact_pressure" in text
    assert "load_ratio = 0.5, friction = 0.3" in text


def test_runs_of_a_grid_meet_those_of_points_and_labels(tmp_path: Path) -> None:
    grid = made(tmp_path / "a", sweep=SWEEP)
    points = [{"case": "A", "load_ratio": 0.5, "friction": 0.3}, {"case": "B", "friction": 0.1}]
    told = found(grid, made(tmp_path / "b", doubled, points=points))
    assert told.common == 1
    assert len(told.only[0]) == 3
    assert told.only[1] == [{"load_ratio": 0.5, "friction": 0.1}]
    assert {each.variable for each in told.changes} == {"peak_contact_pressure", "residual_stress"}
    labels = {"x": {"friction": 0.0}, "y": {"friction": 0.3, "passes": 1}}
    sweep = {"wheel": labels, "load_ratio": [0.25, 0.5]}
    assert found(grid, made(tmp_path / "c", sweep=sweep)).same


def test_other_grids_are_interpolated_and_statuses_told(tmp_path: Path) -> None:
    coarse = made(tmp_path / "a", parameters={"points": 101})
    fine = made(tmp_path / "b", parameters={"points": 201})
    with open_study(coarse) as before, open_study(fine) as after:
        assert diff(before, after).common == 0
        told = diff(before, after, ["points"])
        with pytest.raises(StudyError, match="ignore = 'point': must be one of"):
            diff(before, after, ["point"])
    assert told.common == 1
    assert 0.0 < max(each.relative for each in told.changes) < 1e-2
    limit = {"trouble": "limit", "load_ratio": 0.9}
    failed = made(tmp_path / "c", lambda run: "no stiffness", parameters=limit)
    told = found(made(tmp_path / "d", parameters=limit), failed)
    assert told.statuses == [({}, "ok", "error")]
    with pytest.raises(StudyError, match="no run has results in both studies"):
        difference_figure(told)


def test_answers_are_not_compared_with_runs(tmp_path: Path) -> None:
    goal = {"find": "first_yield", "between": [0.1, 1.0]}
    search_here(Study.from_dict({"name": "goal", "scene": "fake", "goal": goal}), Store(tmp_path))
    with open_study(tmp_path) as answers, open_study(made(tmp_path / "b", sweep=SWEEP)) as runs:
        with pytest.raises(StudyError, match="runs = 'b': has runs, the other study answers: both"):
            diff(answers, runs)
        assert diff(answers, answers).same


def test_a_parameter_of_one_version_does_not_count(tmp_path: Path) -> None:
    path = made(tmp_path / "a", sweep=SWEEP)
    with open_study(path) as before, open_study(path) as after:
        after.attrs["parameters"] = after.attrs["parameters"].replace('"passes": 1, ', "")
        told = diff(before, after)
        assert (told.common, told.unknown) == (4, {"passes": 1})
        with pytest.raises(StudyError, match="must be that of the other study, fake"):
            diff(before, after.assign_attrs(scene="punch"))


def test_the_command_prints_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = made(tmp_path / "a", sweep=SWEEP), made(tmp_path / "b", doubled, sweep=SWEEP)
    paths = [str(first), str(second)]
    assert main(["diff", *paths, "--out", str(tmp_path / "diff.png")]) == 0
    assert "4 runs in common" in capsys.readouterr().out
    assert (tmp_path / "diff.png").stat().st_size > 10_000
    assert main(["diff", *paths, "--out", str(tmp_path / "x.png"), "--field", "peak"]) == 2
    assert "peak_contact_pressure" in capsys.readouterr().err


def test_the_picture_has_a_bar_for_each_change_and_a_mark_for_each_run(tmp_path: Path) -> None:
    told = found(made(tmp_path / "a", sweep=SWEEP), made(tmp_path / "b", doubled, sweep=SWEEP))
    bars, pairs = difference_figure(told).axes
    assert len(bars.patches) == 2
    before, after = pairs.lines[1].get_data()
    assert np.sum(before != after) == 1


def test_cells_of_refinements_are_not_compared(tmp_path: Path) -> None:
    for name, halvings in (("a", 1), ("b", 2)):
        search_here(test_refine.study({"halvings": halvings}), Store(tmp_path / name))
    different = found(tmp_path / "a", tmp_path / "b")
    assert different.common > 9
    assert (different.unlike, different.changes) == ({}, [])


def test_switches_and_what_is_not_given_meet(tmp_path: Path) -> None:
    points = [{"friction": 0.1, "width": 1.0, "hot": True}, {"friction": 0.2, "hot": True}]
    first = made(tmp_path / "a", own=SWITCHED, points=points)
    sweep = {"friction": [0.2, 0.3]}
    second = made(tmp_path / "b", own=SWITCHED, parameters={"hot": True}, sweep=sweep)
    different = found(first, second)
    assert different.common == 1
    assert [len(each) for each in different.only] == [1, 1]
