"""What a study accepts, and how it names what it asks for."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import studies.definition.expansion
import studies.definition.identity
from solver.shipped import SCENES
from studies import Study, StudyError, scene_schema
from studies.definition.identity import content_id, written
from studies.definition.sweep import MAXIMUM_RUNS
from studies.scenes.shipped import SHIPPED
from tests.counted import Calls, counted
from tests.studies import mistakes
from tests.studies.conftest import fake_study

ROOT = Path(__file__).parents[2]


GOOD = {**mistakes.GOOD, "name": "fake", "scene": "fake"}


@pytest.mark.parametrize(
    ("content", "field", "allowed"),
    [
        *mistakes.MISTAKES,
        (
            GOOD | {"sweep": {"friction": [0.5, 1.0]}, "parameters": {"state": "plane_strain"}},
            "sweep.friction[1]",
            "at most 0.9 in plane strain",
        ),
        (
            GOOD | {"sweep": {}, "parameters": {"state": "plane_strain", "friction": 1}},
            "parameters.friction",
            "at most 0.9 in plane strain",
        ),
    ],
)
def test_bad_input_names_field_value_and_what_is_allowed(
    content: Any, field: str, allowed: str
) -> None:
    with pytest.raises(StudyError) as caught:
        Study.from_dict(content)
    assert caught.value.field == field
    assert allowed in caught.value.allowed
    named = f"{field}: must be" if caught.value.value is None else f"{field} = "
    assert str(caught.value).startswith(named)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("scene", "content", "told"),
    [
        (
            "punch",
            {"parameters": {"half_width": -1}},
            "parameters.half_width = -1: must be a finite number > 0 and <= 1e+06 [mm]",
        ),
        (
            "punch",
            {"sweep": {"friction": [0.1, 11], "hardening": ["none", "mixed"]}},
            "sweep.friction[1] = 11: must be a finite number >= 0 and <= 10",
        ),
        (
            "punch",
            {"sweep": {"hardening": ["none", "soft"]}},
            "sweep.hardening[1] = 'soft': must be one of none, isotropic, kinematic, mixed, voce, "
            "power, table, chaboche, layered; a word of your own needs its file in the environment "
            "variable RESIDUA_PARTS",
        ),
        (
            "rolling",
            {"sweep": {"passes": [1, 2], "wheel": {"a": {"traction": 1}, "b": {"traction": 2}}}},
            "sweep.wheel.b.traction = 2: must be a finite number >= -0.99 and <= 1",
        ),
        (
            "rolling",
            {"sweep": {"friction": [0.3, 0], "traction": [0.5]}},
            "sweep.traction[0] = 0.5: must be 0 without friction "
            "(at friction = 0.0, traction = 0.5)",
        ),
    ],
)
def test_what_a_scene_refuses_is_told_in_the_words_of_the_study(
    scene: str, content: dict[str, Any], told: str
) -> None:
    with pytest.raises(StudyError) as caught:
        Study.from_dict({"name": "wrong", "scene": scene} | content)
    assert str(caught.value) == told


def many(runs: int) -> dict[str, Any]:
    """A study of the punch with so many runs, a multiple of 20, of four a loading path."""
    stresses = [300.0 + 0.01 * k for k in range(runs // 20)]
    sweep = {"load_ratio": [0.3, 0.5, 0.7, 0.9], "friction": [0.0, 0.1, 0.2, 0.3, 0.4]}
    return {"name": "many", "scene": "punch", "sweep": sweep | {"yield_stress": stresses}}


def peak(work: Callable[[], Any]) -> int:
    """Most bytes that the work holds at a time."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def held() -> tuple[int, int]:
    """Bytes that 4000 runs hold: what each value of an axis sets, and with their cases."""

    def passed(content: dict[str, Any]) -> None:
        study = Study.from_dict(content)
        for each in (study.run_ids(), study.cases(), study.paths()):
            assert sum(1 for _ in each)

    passed(many(20))  # what is kept for all studies of the scene
    return peak(lambda: Study.known(many(4000)).size), peak(lambda: passed(many(4000)))


@pytest.mark.processes
def test_memory_does_not_grow_with_the_number_of_runs() -> None:
    """Measured in a process of its own: the threads of a cluster would count."""
    program = "from tests.studies.test_study import held; print(*held())"
    told = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, check=True, capture_output=True, text=True
    )
    axis, runs = map(int, told.stdout.split())
    assert axis < 200_000
    assert runs < axis + 1_000_000  # 4000 cases would be 3 MB


def test_20_000_runs_are_checked_and_named_at_a_cost_in_proportion_to_their_number() -> None:
    """Ten times as many as 2 000 take about ten times as many calls."""

    def named(number: int) -> tuple[Calls, Study, set[str]]:
        with counted() as calls:
            study = Study.from_dict(many(number))
            ids = set(study.run_ids())
        return calls, study, ids

    few, *_ = named(2_000)
    calls, study, ids = named(20_000)
    assert calls < 12 * few.count
    assert len(ids) == study.size == 20_000
    assert sum(1 for _ in study.paths()) == 5_000


def test_content_known_already_is_not_gone_through() -> None:
    content = many(80_000)
    with counted() as calls:
        study = Study.known(content)
        assert study.size == 80_000
    assert calls < 500_000
    content["parameters"] = {"friction": 2}
    with pytest.raises(StudyError, match="swept too"):
        Study.known(content)


@pytest.mark.parametrize("name", ["punch", "rolling-table", "shakedown-map"])
def test_ids_are_those_of_the_whole_content(name: str) -> None:
    study = Study.from_toml(ROOT / "data" / "studies" / f"{name}.toml")
    scene = SCENES[study.scene]
    source = written(scene)
    cases = list(study.cases())
    assert [case.id for case in cases] == list(study.run_ids())
    for case in cases[::7]:
        assert case.id == content_id("run", scene.name, case.values, source)
    for path in study.paths():
        for case in path.cases:
            shared = {key: each for key, each in case.values.items() if key != scene.branch}
            assert path.id == content_id("path", scene.name, shared, source)
        assert path.parameters in [case.parameters for case in path.cases]
    assert {case.id for path in study.paths() for case in path.cases} == {c.id for c in cases}


def test_a_scene_is_read_once_for_a_study(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    counted = studies.definition.expansion.written
    monkeypatch.setattr(
        studies.definition.expansion, "written", lambda scene: calls.append(scene) or counted(scene)
    )
    study = Study.from_dict(
        GOOD
        | {"sweep": {"both": {"a": {"friction": 0.1}, "b": {"friction": 0.2, "load_ratio": 1}}}}
    )
    assert (study.id, len(list(study.cases())), len(list(study.paths()))) == (study.id, 2, 2)
    assert len(calls) == 1


def test_a_sweep_too_large_is_refused_before_it_is_expanded() -> None:
    thousand = [(i + 1) / 1000 for i in range(1000)]
    sweep = {"friction": thousand, "load_ratio": thousand, "half_width": thousand}
    Study.from_dict(GOOD)  # what is looked up once
    with counted() as calls, pytest.raises(StudyError) as caught:
        Study.from_dict(GOOD | {"sweep": sweep, "parameters": {}})
    assert calls < 1_000, "in proportion to the axes, not to the values"
    assert caught.value.field == "sweep"
    assert "1000000000" in str(caught.value)
    assert str(MAXIMUM_RUNS) in caught.value.allowed


def test_equal_content_has_equal_ids_however_it_is_written() -> None:
    one = Study.from_dict(GOOD)
    other = Study.from_dict(
        {
            "sweep": {"load_ratio": [0.5, 0.3], "friction": [-0.0, 1e-1]},
            "parameters": {"half_width": 20.0, "seconds": 0},
            "scene": "fake",
            "name": "fake",
        }
    )
    assert one.id == other.id
    assert [case.id for case in one.cases()] == [case.id for case in other.cases()]


@pytest.mark.parametrize(
    "change",
    [{"name": "other"}, {"parameters": {"half_width": 21}}, {"sweep": {"friction": [0.0]}}],
)
def test_other_content_has_another_study_id(change: dict[str, Any]) -> None:
    assert Study.from_dict(GOOD | change).id != Study.from_dict(GOOD).id


def test_a_run_has_the_same_id_in_every_study() -> None:
    swept = fake_study("swept", {"load_ratio": [0.3, 0.9], "half_width": [10, 20]}, friction=0.2)
    single = fake_study("single", {"friction": [0.2]}, load_ratio=0.9, half_width=20.0)
    (run,) = single.cases()
    assert run.id in {case.id for case in swept.cases()}


def test_a_changed_solver_makes_new_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    before = Study.from_dict(GOOD)
    ids = before.id, next(before.cases()).id
    monkeypatch.setattr(studies.definition.identity, "solver_hash", lambda: "0" * 32)
    after = Study.from_dict(GOOD)
    assert after.id != ids[0]
    assert next(after.cases()).id != ids[1]


def test_axes_follow_the_scene_and_values_stay_as_written() -> None:
    study = Study.from_dict(GOOD)
    assert list(study.axes) == ["load_ratio", "friction"]
    assert study.axes["load_ratio"] == [0.5, 0.3]
    points = [(case.index, case.parameters.load_ratio) for case in study.cases()]
    assert points == [((0, 0), 0.5), ((0, 1), 0.5), ((1, 0), 0.3), ((1, 1), 0.3)]
    assert all(case.parameters.half_width == 20.0 for case in study.cases())


def test_paths_hold_what_differs_in_the_branch_parameter_only_in_increasing_order() -> None:
    paths = list(Study.from_dict(GOOD).paths())
    assert len(paths) == 2
    for path in paths:
        assert [case.parameters.load_ratio for case in path.cases] == [0.3, 0.5]
        assert len({case.parameters.friction for case in path.cases}) == 1
    assert len({path.id for path in paths}) == 2


def test_a_study_survives_its_dictionary_and_json() -> None:
    study = Study.from_dict(GOOD)
    again = Study.from_dict(json.loads(json.dumps(study.to_dict())))
    assert again == study
    assert again.id == study.id


def test_a_study_without_sweep_is_one_run() -> None:
    study = Study.from_dict({"name": "one", "scene": "fake"})
    (case,) = study.cases()
    assert study.size == 1
    assert case.index == ()


@pytest.mark.parametrize("text", ["name = ", "\x00", "a = 1\na = 2"])
def test_a_file_that_is_not_toml_is_one_clear_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "study.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match="valid TOML"):
        Study.from_toml(path)


def test_a_file_that_is_not_utf8_or_not_there_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(StudyError, match="must be saved as UTF-8, which line 1 is not"):
        Study.from_toml(tmp_path / "latin.toml")
    with pytest.raises(StudyError, match="must be a file to read: No such file"):
        Study.from_toml(tmp_path / "absent.toml")
    with pytest.raises(StudyError, match="must be a file"):
        Study.from_toml(tmp_path)


def test_the_error_survives_pickling() -> None:
    import pickle

    error = pickle.loads(pickle.dumps(StudyError("name", 3, "a text")))
    assert (error.field, error.value, error.allowed) == ("name", 3, "a text")


@pytest.mark.parametrize("name", [*SCENES, *SHIPPED])
def test_every_scene_describes_its_parameters(name: str) -> None:
    schema = scene_schema(name)
    assert schema["additionalProperties"] is False
    for parameter, known in schema["properties"].items():
        assert known["description"], parameter
        assert "default" in known or "`accuracy` sets it" in known["description"], parameter


def test_the_schema_carries_units_and_ranges() -> None:
    friction = scene_schema("fake")["properties"]["friction"]
    assert (friction["minimum"], friction["maximum"], friction["unit"]) == (0.0, 1.0, "1")
    assert scene_schema("fake")["properties"]["half_width"]["unit"] == "mm"


def test_the_ready_study_of_the_punch_is_45_runs_in_15_paths() -> None:
    study = Study.from_toml(ROOT / "data" / "studies" / "punch.toml")
    assert study.size == 45
    assert len(list(study.paths())) == 15


@pytest.mark.processes
@pytest.mark.parametrize(
    "program", ["import studies; studies.Study, studies.Store", "import service.app"]
)
def test_studies_and_the_service_load_neither_dask_nor_matplotlib_nor_xarray_nor_scipy(
    program: str,
) -> None:
    heavy = "('dask', 'distributed', 'matplotlib', 'xarray', 'scipy', 'skfem', 'numba')"
    code = f"{program}\nimport sys; print([m for m in {heavy} if m in sys.modules])"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert answer.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("rule", "name", "values"),
    [
        ("none", "hardening_ratio", [0.01, 0.02]),
        ("isotropic", "isotropic_fraction", [0.2, 0.8]),
        ("kinematic", "saturation", [10.0, 20.0]),
        ("voce", "hardening_ratio", [0.01, 0.02]),
    ],
)
def test_a_swept_parameter_that_changes_nothing_is_refused(
    rule: str, name: str, values: list[float]
) -> None:
    content: dict[str, Any] = {"name": "idle", "scene": "punch", "sweep": {name: values}}
    content["parameters"] = {"hardening": rule}
    if rule == "voce":
        content["parameters"]["saturation"] = 100.0
    with pytest.raises(StudyError, match=f"sweep.{name} = .*changes nothing in any run"):
        Study.from_dict(content)


def test_all_known_mistakes_of_a_study_are_told_in_other_processes_too() -> None:
    idle = {"saturation": 20.0, "isotropic_fraction": 0.3, "hardening_ratio": 0.05}
    sweep = {"load_ratio": [0.5, 20.0], "friction": [0.1, -0.95]}
    refused = {"name": "no", "scene": "fake", "parameters": {"state": "plane_strain"}}
    for content, fields in (
        ({"name": "idle", "scene": "punch", "parameters": idle}, [f"parameters.{n}" for n in idle]),
        (refused | {"sweep": sweep}, ["sweep.load_ratio[1]", "sweep.friction[1]"]),
    ):
        with pytest.raises(StudyError) as told:
            Study.from_dict(content)
        sent = pickle.loads(pickle.dumps(told.value))
        assert [each.field for each in sent.each] == fields
        assert [line.split(" = ")[0] for line in str(sent).splitlines()] == fields


def test_a_swept_parameter_that_changes_some_runs_is_taken() -> None:
    sweep = {"hardening": ["none", "isotropic"], "hardening_ratio": [0.01, 0.02]}
    assert Study.from_dict({"name": "some", "scene": "punch", "sweep": sweep}).size == 4


@pytest.mark.parametrize(
    ("scene", "given", "told"),
    [
        ("punch", {"hardening_ratio": 0.05}, "hardening_ratio = 0.05: .*hardening = isotropic or"),
        ("rolling", {"advance_step": 2.0}, "advance_step = 2.0: .*needs track other than endless"),
        ("rolling", {"load": "hertz"}, "friction = 0.2: .*load = contact or traction other than 0"),
        ("raceway", {"force": 300.0}, "force = 300.0: .*needs load_by = force"),
        ("punch", {"shear_limit": 0.5}, "shear_limit = 0.5: .*needs friction other than 0 or coh"),
        ("ball", {"load": 500.0, "load_ratio": 3.0}, "load_ratio = 3.0: .*needs load = 0"),
        ("elastic_punch", {"eta": 2.0}, "eta = 2.0: .*needs punch_groove other than 0"),
        (
            "rolling",
            {"sequence": [{"friction": 0.1}, {"friction": 0.2}], "friction": 0.4},
            "friction = 0.4: .*needs an entry of sequence without it",
        ),
        ("wheel_rail", {"seed": 3}, "seed = 3: .*needs load_spread other than 0 or lateral_spread"),
        ("wheel_rail", {"crown_radius": 200.0}, "crown_radius = 200.0: .*wheel_profile = crowned"),
        ("wheel_rail", {"straightening_stress": 90.0}, "_stress = 90.0: .*= roller_straightened"),
    ],
)
def test_a_parameter_that_changes_nothing_is_refused_however_it_is_given(
    scene: str, given: dict[str, Any], told: str
) -> None:
    content: dict[str, Any] = {"name": "idle", "scene": scene, "parameters": given}
    if given.get("load") == "hertz":
        given = given | {"friction": 0.2}
        content["parameters"] = given
    with pytest.raises(StudyError, match=rf"^parameters\..*{told}"):
        Study.from_dict(content)
    *fixed, (name, value) = given.items()
    content["parameters"] = dict(fixed)
    with pytest.raises(StudyError, match=rf"^sweep\.{name} = \[{value}\]: changes nothing"):
        Study.from_dict(content | {"sweep": {name: [value]}})
    linked = {"sweep": {"set": {"one": {name: value}}}}
    with pytest.raises(StudyError, match=rf"^sweep\.set\.one\.{name} = {value}: changes nothing"):
        Study.from_dict(content | linked)


def test_a_default_and_a_zero_that_change_nothing_are_taken() -> None:
    own = {"load": "hertz", "friction": 0.0, "force": 2000.0}
    Study.from_dict({"name": "usual", "scene": "raceway", "parameters": own})


def test_a_parameter_that_one_pass_of_a_sequence_uses_is_taken() -> None:
    own = {"crown_radius": 200.0, "sequence": [{}, {"wheel_profile": "crowned"}]}
    Study.from_dict({"name": "one", "scene": "wheel_rail", "parameters": own})
