"""Studies that keep the runs of another one and add to them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from studies import Store, Study, StudyError, run_study
from studies.definition.files import read_study
from studies.kinds.goal.search import Goal
from tests.studies.conftest import compute_here
from tests.studies.fakes import FAKE

BASE = {
    "name": "base",
    "scene": "fake",
    "parameters": {"half_width": 20.0},
    "sweep": {"load_ratio": [0.25, 0.5], "friction": [0.0, 0.3]},
}
POINTS = {"name": "base", "scene": "fake", "points": [{"friction": 0.1}, {"friction": 0.2}]}


def more(base: dict[str, Any] = BASE, **added: Any) -> Study:
    return Study.from_dict({"name": "more", "extends": base, **added})


def full(**content: Any) -> Study:
    return Study.from_dict({"name": "more", "scene": "fake", **content})


def test_an_axis_gets_more_values_and_keeps_its_order() -> None:
    study = more(sweep={"load_ratio": [0.3, 0.5]})
    sweep = {"load_ratio": [0.25, 0.3, 0.5], "friction": [0.0, 0.3]}
    assert study.id == full(parameters=BASE["parameters"], sweep=sweep).id
    assert {*Study.from_dict(BASE).run_ids()} < {*study.run_ids()}


@pytest.mark.parametrize(("name", "value"), [("half_width", 20.0), ("hardening", "none")])
def test_a_parameter_that_did_not_vary_becomes_an_axis(name: str, value: Any) -> None:
    other = 50.0 if name == "half_width" else "isotropic"
    study = more(sweep={name: [other]})
    assert sorted(study.axes[name]) == sorted([value, other])
    assert {*Study.from_dict(BASE).run_ids()} < {*study.run_ids()}
    assert study.size == 8


def test_labels_are_added() -> None:
    wheels = {"free": {"passes": 2}, "braked": {"friction": 0.3}}
    base = {"name": "base", "scene": "fake", "sweep": {"wheel": wheels}}
    study = more(base, sweep={"wheel": {"pulled": {"friction": 0.1}}})
    assert study.id == full(sweep={"wheel": wheels | {"pulled": {"friction": 0.1}}}).id
    changed = {"free": {"passes": 3}}
    with pytest.raises(StudyError, match=r"sweep.wheel.free .*is a label of base"):
        more(base, sweep={"wheel": changed})


def test_points_follow_those_that_are_there() -> None:
    study = more(POINTS, points=[{"friction": 0.2, "passes": 3}, {"friction": 0.2}])
    listed = [
        {"friction": 0.1, "passes": 1},
        {"friction": 0.2, "passes": 1},
        {"friction": 0.2, "passes": 3},
    ]
    assert study.id == full(points=listed).id
    ids = list(study.run_ids())
    assert ids[:2] == list(Study.from_dict(POINTS).run_ids())


def test_a_sample_goes_on() -> None:
    short = {"method": "sobol", "num": 8, "ranges": {"friction": [0.0, 0.4], "passes": [1, 9]}}
    base = {"name": "base", "scene": "fake", "sample": short, "sweep": {"load_ratio": [0.2, 0.4]}}
    study = more(base, sample=short | {"num": 16})
    assert study.id == full(sample=short | {"num": 16}, sweep=base["sweep"]).id
    assert study.size == 32


def test_the_runs_of_a_grid_become_points() -> None:
    study = more(points=[{"friction": 0.1, "load_ratio": 0.7, "passes": 2}])
    ids = list(study.run_ids())
    assert ids[:4] == list(Study.from_dict(BASE).run_ids())
    assert study.size == 5
    assert study.sweep["point"][4] == {"load_ratio": 0.7, "friction": 0.1, "passes": 2}
    named = more(points=[{"case": "T", "friction": 0.1, "load_ratio": 0.7}])
    assert [each["case"] for each in named.sweep["point"]][2:] == ["base-2", "base-3", "T"]


def test_one_run_gets_points_and_names_stay() -> None:
    single = {"name": "base", "scene": "fake", "parameters": {"friction": 0.2}}
    study = more(single, points=[{"friction": 0.1, "passes": 2}])
    assert next(study.run_ids()) == next(Study.from_dict(single).run_ids())
    cases = POINTS | {"points": [{"case": "A", "friction": 0.1}, {"case": "B", "friction": 0.2}]}
    study = more(cases, points=[{"case": "C", "friction": 0.3}])
    assert [each["case"] for each in study.sweep["point"]] == ["A", "B", "C"]


def test_a_goal_is_searched_at_more_places() -> None:
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    base = {"name": "base", "scene": "fake", "goal": goal, "sweep": {"friction": [0.0, 0.4]}}
    study = more(base, sweep={"friction": [0.2]})
    assert study.axes["friction"] == [0.0, 0.2, 0.4]
    assert study.choice["goal"] == Goal.read(goal, FAKE, {}).content
    with pytest.raises(StudyError, match="is what the goal searches"):
        more(base, sweep={"load_ratio": [0.2]})


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ({}, "extends = 'base': nothing is added"),
        (
            {"parameters": {"passes": 2}, "sweep": {"friction": [0.1]}},
            "parameters = .*cannot be changed",
        ),
        ({"scene": "punch", "sweep": {"friction": [0.1]}}, "scene = 'punch': must be that of base"),
        ({"sweep": {"wheel": {"a": {"passes": 2}}}}, "sweep.wheel .*must be an axis of labels"),
        ({"points": [{"friction": 0.1}]}, "points = '1 points': must set load_ratio, which base"),
        (
            {"sweep": {"a": [{"passes": 2}], "b": [{"points": 3}]}},
            "sweep.b = '1 points': is a second set of points",
        ),
    ],
)
def test_what_does_not_fit_is_refused(added: dict[str, Any], said: str) -> None:
    with pytest.raises(StudyError, match=said):
        more(**added)


def test_points_that_do_not_fit_are_refused() -> None:
    swept = POINTS | {"sweep": {"passes": [1, 2]}}
    with pytest.raises(StudyError, match="passes is swept by passes of base"):
        more(swept, points=[{"friction": 0.3, "passes": 3}])
    with pytest.raises(StudyError, match="has its points in point: add to these"):
        more(POINTS, sweep={"other": [{"friction": 0.3}]})
    with pytest.raises(StudyError, match="is set by point of base"):
        more(POINTS, sweep={"friction": [0.3]})


def test_a_study_is_found_by_file_name_and_id(tmp_path: Path) -> None:
    store, base = Store(tmp_path / "out"), Study.from_dict(BASE)
    compute_here(base, store)
    store.save_study(base)
    (tmp_path / "base.toml").write_text(
        'name = "base"\nscene = "fake"\n[parameters]\nhalf_width = 20\n'
        "[sweep]\nload_ratio = [0.25, 0.5]\nfriction = [0.0, 0.3]\n"
    )
    ids = set()
    for named in ("base.toml", "base", base.id):
        text = f'name = "more"\nextends = "{named}"\n[sweep]\nfriction = [0.1]\n'
        (tmp_path / "more.toml").write_text(text)
        study = Study.from_toml(tmp_path / "more.toml", (), store.definition, store.scene)
        ids.add(study.id)
    assert len(ids) == 1
    assert len(set(study.run_ids()) & set(store.sound(study.run_ids()))) == 4
    (tmp_path / "more.toml").write_text('name = "more"\nextends = "base"\n')
    with pytest.raises(StudyError, match="extends = 'base': must be a study file, or name or id"):
        Study.from_toml(tmp_path / "more.toml")
    store.save_study(Study.from_dict(BASE | {"note": "again"}))
    with pytest.raises(StudyError, match="is the name of several studies"):
        store.definition("base")


def test_a_circle_of_files_is_refused(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        text = f'name = "{name}"\nextends = "{other}.toml"\n[sweep]\nfriction = [0.1]\n'
        (tmp_path / f"{name}.toml").write_text(text)
    with pytest.raises(StudyError, match=r"extends = '[ab].toml': extends a study that extends it"):
        Study.from_toml(tmp_path / "a.toml")


def test_a_scene_is_beside_the_first_of_three_study_files(tmp_path: Path) -> None:
    (tmp_path / "one" / "two").mkdir(parents=True)
    (tmp_path / "one" / "two" / "a.toml").write_text('name = "a"\nscene = "pin.toml"\n')
    (tmp_path / "one" / "b.toml").write_text('name = "b"\nextends = "two/a.toml"\n')
    (tmp_path / "c.toml").write_text('name = "c"\nextends = "one/b.toml"\n')
    content = read_study(tmp_path / "c.toml")
    assert content["extends"]["extends"]["scene"] == "one/two/pin.toml"


def test_two_studies_of_two_directories_become_one_without_computing(tmp_path: Path) -> None:
    """As docs/howto/points.md says."""
    content = [
        {"name": name, "scene": "fake", "sweep": {"load_ratio": values}}
        for name, values in (("a", [0.3, 0.5]), ("b", [0.7]))
    ]
    stores = [Store(tmp_path / each["name"]) for each in content]
    for each, store in zip(content, stores, strict=True):
        run_study(Study.from_dict(each), store, workers=0)
    for file in (stores[1].directory / "runs").glob("*.nc"):
        shutil.copy(file, stores[0].directory / "runs")
    both = {"name": "both", "extends": content[0], "sweep": content[1]["sweep"]}
    found = run_study(Study.from_dict(both), stores[0], workers=0)
    assert found.ok and not found.computed and found.counts == {"ok": 3}


def test_all_mistakes_of_a_study_that_extends_another_are_reported_at_once() -> None:
    base = {"name": "a", "scene": "fake", "sweep": {"load_ratio": [0.3]}}
    wrong = {"parameters": {"friction": 0.1}, "sweep": {"load_ratio": [-1]}, "tags": ["a b"]}
    with pytest.raises(StudyError) as caught:
        Study.from_dict({"name": "b", "extends": base, **wrong})
    fields = {each.field for each in caught.value.each}
    assert fields == {"parameters", "sweep.load_ratio[0]", "tags[0]"}
