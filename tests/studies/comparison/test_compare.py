"""Published numbers beside computed profiles, on profiles whose features are known."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from solver.results.record import Record, Status
from solver.scenes import SCENES, Scene
from studies import Store, Study
from studies.definition.parameters import defaults, parameters_of
from studies.errors import StudyError
from studies.storage.combine import combine
from studies.views.comparison.compare import Comparison, _line, compare
from studies.views.comparison.problem import differences, other_problem
from studies.views.comparison.profiles import Computed, Profile, read_profiles
from studies.views.comparison.reference import (
    Published,
    published_cases,
    read_reference,
    reference_of,
)
from studies.views.comparison.refinement import sizes_of
from studies.views.comparison.table import comparison_table
from tests.studies.rolled import COMPONENTS, DEPTH, LOWEST, PEAK, data_set, profile, written

ROOT = Path(__file__).parents[3]


def published(**given: object) -> Published:
    usual = {"case": "A", "quantity": "minimum", "component": "xx", "unit": "MPa", "source": "p. 1"}
    return Published.model_validate(usual | given)


@pytest.fixture(scope="module")
def refined(tmp_path_factory: pytest.TempPathFactory) -> Computed:
    """Two cases at three meshes and two increments."""
    path = tmp_path_factory.mktemp("refined") / "a.nc"
    written(data_set({"A": 2, "B": 1}, (2.0, 1.0, 0.5), (2.0, 1.0)), path)
    return read_profiles([path], {})


def only(computed: Computed, each: Published) -> Comparison:
    compared, absent = compare(computed, [each])
    (one,) = compared
    assert not absent
    return one


@pytest.mark.parametrize(
    ("quantity", "value", "depth"),
    [
        ("surface", -100.0, 0.0),
        ("minimum", -200.0, LOWEST),
        ("maximum", 50.0, PEAK),
        ("local_maximum", 50.0, PEAK),
    ],
)
def test_features_are_read_from_the_profile_under_mid_track(
    refined: Computed, quantity: str, value: float, depth: float
) -> None:
    found, at = refined.profiles["B", 1][0.5, 1.0].feature(published(case="B", quantity=quantity))
    assert found == pytest.approx(value - 5.0 + 4.0)
    assert at == pytest.approx(depth)


def test_a_local_maximum_is_sought_between_the_given_depths_and_may_not_exist(
    refined: Computed,
) -> None:
    beyond = published(quantity="local_maximum", **{"from": 4.0, "to": 12.0})
    assert np.isnan(refined.profiles["A", 1][0.5, 1.0].feature(beyond)).all()
    one = beyond.model_copy(update={"value": 1.0})
    told = comparison_table(refined, *compare(refined, [one]), cases={})
    assert told.count("none") == 6
    assert told.endswith("compared 1 of 1 published numbers: 0 of 1 within 50 MPa")


def test_a_local_maximum_is_found_below_a_surface_that_lies_higher(refined: Computed) -> None:
    strain = published(quantity="local_maximum", component="plastic_strain", unit="1")
    assert refined.profiles["A", 1][1.0, 1.0].feature(strain) == pytest.approx((0.02, PEAK))


def test_difference_is_that_of_the_finest_level_and_changes_are_between_the_two_finest(
    refined: Computed,
) -> None:
    one = only(refined, published(value=-220.0))
    assert list(one.ours) == [
        (2.0, 2.0),
        (2.0, 1.0),
        (1.0, 2.0),
        (1.0, 1.0),
        (0.5, 2.0),
        (0.5, 1.0),
    ]
    assert one.difference == pytest.approx(-201.0 + 220.0)
    assert one.changes == pytest.approx((+5.0, -4.0))


def test_changes_are_found_where_mesh_and_increment_are_refined_apart(tmp_path: Path) -> None:
    meshes = written(
        data_set({"A": 1}, (2.0, 1.0, 0.5), fixed={"advance_step": 1.0}), tmp_path / "h.nc"
    )
    steps = written(
        data_set({"A": 1}, steps=(2.0, 1.0, 0.5), fixed={"element_size": 1.0}), tmp_path / "s.nc"
    )
    one = only(read_profiles([meshes, steps], {}), published(value=-200.0))
    assert list(one.ours) == [(2.0, 1.0), (1.0, 2.0), (1.0, 1.0), (1.0, 0.5), (0.5, 1.0)]
    assert one.difference == pytest.approx(-1.0)
    assert one.changes == pytest.approx((+5.0, -2.0))
    assert one.orders == pytest.approx((1.0, 1.0))


MESHES = [(2.0, 1.0), (1.0, 1.0), (0.5, 1.0)]
STEPS = [(1.0, 2.0), (1.0, 0.5)]


def test_a_longer_line_of_coarser_increments_does_not_take_the_change() -> None:
    levels = [*MESHES, (0.5, 0.5), (1.0, 0.5)]
    values = {level: 10.0 * level[0] * level[1] for level in levels}
    assert [value for _, value in _line(values, 0)] == [2.5, 5.0]
    assert [value for _, value in _line(values, 1)] == [2.5, 5.0]


@pytest.mark.parametrize(
    ("levels", "finest", "meshes", "increments"),
    [
        ([*MESHES, *STEPS, (0.25, 1.0)], (0.25, 1.0), (0.25, 0.5), (0.5, 1.0)),
        ([*MESHES, *STEPS, (0.25, 0.5)], (0.25, 0.5), (0.25, 1.0), (0.5, 1.0)),
        ([*MESHES, *STEPS, (0.25, 1.0), (0.25, 0.5)], (0.25, 0.5), (0.25, 0.5), (0.5, 1.0)),
        ([*MESHES, *STEPS, (0.25, 0.3)], (0.25, 0.3), None, None),
    ],
)
def test_a_change_lies_on_the_line_that_holds_the_finest(
    tmp_path: Path,
    levels: list[tuple[float, float]],
    finest: tuple[float, float],
    meshes: tuple[float, float] | None,
    increments: tuple[float, float] | None,
) -> None:
    paths = [written(data_set({"A": 1}, (h,), (s,)), tmp_path / f"{h}-{s}.nc") for h, s in levels]
    one = only(read_profiles(paths, {}), published(value=-200.0))
    assert one.difference == pytest.approx(-10.0 * finest[0] + 4.0 * finest[1])
    changes = [
        slope * (pair[0] - pair[1]) if pair else np.nan
        for slope, pair in ((-10.0, meshes), (4.0, increments))
    ]
    assert one.changes == pytest.approx(changes, nan_ok=True)


def test_a_level_that_is_neither_swept_nor_fixed_is_the_default_of_the_scene(
    tmp_path: Path,
) -> None:
    dataset = data_set({"A": 1}, fixed={"element_size": 1.0, "advance_step": 1.0})
    path = written(dataset, tmp_path / "a.nc")
    with xr.open_dataset(path) as stored:
        bare = stored.load().assign_attrs(parameters="{}")
    bare.to_netcdf(tmp_path / "b.nc")
    usual = defaults(SCENES["rolling"], {})
    level = (usual["element_size"], usual["advance_step"])
    assert read_profiles([tmp_path / "b.nc"], {}).levels == [level]


@pytest.mark.parametrize(
    ("low", "high", "difference"),
    [(-300.0, -250.0, +49.0), (-210.0, -190.0, 0.0), (None, -210.0, +9.0), (-190.0, None, -11.0)],
)
def test_the_difference_from_bounds_is_that_from_the_nearer_one(
    refined: Computed, low: float | None, high: float | None, difference: float
) -> None:
    one = only(refined, published(low=low, high=high))
    assert one.difference == pytest.approx(difference)


def test_a_change_is_taken_against_another_pass_at_the_same_level(refined: Computed) -> None:
    grown = published(
        quantity="maximum", component="plastic_strain", value=100.0, unit="%", against="A/1",
        **{"pass": 2},
    )  # fmt: skip
    one = only(refined, grown)
    assert set(one.ours.values()) == {100.0}
    assert one.difference == 0.0


def test_value_and_depth_of_a_feature_are_two_numbers(refined: Computed) -> None:
    value, depth = compare(refined, [published(value=-200.0, depth=7.0)])[0]
    assert (value.unit, depth.unit) == ("MPa", "mm")
    assert depth.difference == pytest.approx(+1.0)


def test_numbers_of_cases_and_passes_that_were_not_computed_are_told_apart(
    refined: Computed,
) -> None:
    wanted = [published(case="C", value=1.0), published(case="B", value=1.0, **{"pass": 2})]
    against = published(value=1.0, unit="%", against="C/1")
    assert compare(refined, [*wanted, against]) == ([], [*wanted, against])


def test_profiles_are_found_in_the_data_set_of_a_study(tmp_path: Path) -> None:
    cases = {"twice": {"passes": 2, "traction": 0.3}, "hard": {"hardening": "kinematic"}}
    study = Study.from_dict(
        {
            "name": "linked",
            "scene": "rolling",
            "parameters": {"advance_step": 2.0},
            "sweep": {"case": cases, "element_size": [2.0, 1.0]},
        }
    )
    store = Store(tmp_path / "out")
    for case in study.cases():
        passes, size = case.values["passes"], case.values["element_size"]
        numbers = np.arange(1, passes + 1)
        line = profile(-100.0, -60.0, 50.0, -200.0) - size
        stress = np.tile(line, (passes, 3, 4, 1)) * numbers[:, None, None, None]
        record = Record(
            parameters=case.parameters,
            status=Status.OK,
            coordinates={
                "pass": numbers,
                "station": np.array([-10.0, 0.0, 10.0]),
                "component": np.array(COMPONENTS),
                "depth": DEPTH,
            },
            fields={"residual_profile": (("pass", "station", "component", "depth"), stress)},
        )
        store.write_run(case, record)
    store.save_study(study)
    combine(study, store, list(study.cases()))
    computed = read_profiles([store.directory], {})
    assert set(computed.profiles) == {("twice", 1), ("twice", 2), ("hard", 1)}
    assert computed.levels == [(2.0, 2.0), (1.0, 2.0)]
    one = only(computed, published(case="twice", value=-400.0, **{"pass": 2}))
    assert list(one.ours.values()) == pytest.approx([-404.0, -402.0])


def test_failed_runs_are_not_compared(tmp_path: Path) -> None:
    dataset = data_set({"A": 1, "B": 1})
    dataset["status"][{"case": 1}] = "limit_load"
    assert set(read_profiles([written(dataset, tmp_path / "a.nc")], {}).profiles) == {("A", 1)}
    dataset["status"][:] = "limit_load"
    assert "must hold a run that succeeded" in refused(written(dataset, tmp_path / "b.nc"))


def refused(*paths: Path) -> str:
    with pytest.raises(StudyError) as caught:
        read_profiles(paths, {})
    return str(caught.value)


def test_two_problems_in_one_data_set_are_refused_unless_one_is_chosen(tmp_path: Path) -> None:
    path = written(data_set({"A": 1}, frictions=(0.1, 0.3)), tmp_path / "a.nc")
    assert refused(path).endswith(
        "case A, pass 1 is another problem there: friction 0.3, not 0.1; --select friction=VALUE"
    )
    one = only(read_profiles([path], {"friction": "0.3"}), published(value=-206.0))
    assert one.difference == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("fixed", "told"),
    [
        ({"track": 24.0}, "track 24, not endless"),
        ({"until": "decided"}, "until decided, not passes"),
        ({"traction": 0.5, "growth": 1.5}, "traction 0.5, not 0;"),
    ],
)
def test_data_sets_of_different_problems_are_not_meshes_of_one(
    tmp_path: Path, fixed: dict[str, Any], told: str
) -> None:
    usual = written(data_set({"A": 1}, (1.0,)), tmp_path / "a.nc")
    other = written(data_set({"A": 1, "B": 1}, (2.0,), fixed=fixed), tmp_path / "b.nc")
    assert f"b.nc': case A, pass 1 is another problem there: {told}" in refused(usual, other)


def test_the_way_of_later_passes_makes_no_other_problem_of_the_first(tmp_path: Path) -> None:
    there = {"direction": "back_and_forth"}
    paths = [
        written(data_set({"A": passes}, (size,), fixed=fixed), tmp_path / f"{size}.nc")
        for size, passes, fixed in ((2.0, 1, {}), (1.0, 2, there), (0.5, 2, {}))
    ]
    assert read_profiles(paths[:2], {}).levels == [(2.0, 1.0), (1.0, 1.0)]
    told = "case A, pass 2 is another problem there: direction same, not back_and_forth"
    assert told in refused(*paths[1:])


def test_two_results_at_one_refinement_are_refused_with_what_refines_too(tmp_path: Path) -> None:
    usual = written(data_set({"A": 1}), tmp_path / "a.nc")
    coarse = data_set({"A": 1}, fixed={"growth": 1.5})
    there = "case A, pass 1 has another result at the same refinement there:"
    changed = coarse.assign(residual_profile=coarse["residual_profile"] + 1.0)
    told = refused(usual, written(changed, tmp_path / "b.nc"))
    assert f"{there} growth 1.5, not 1.15; compare data sets one by one" in told
    again = changed.assign_attrs(parameters="{}")
    told = refused(usual, written(again, tmp_path / "c.nc"))
    assert f"{there} made with another version of the solver" in told
    assert read_profiles([usual, written(coarse, tmp_path / "d.nc")], {}).levels == [(1.0, 1.0)]


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_what_refines_is_a_parameter_of_the_scene(scene: Scene) -> None:
    assert scene.refining <= parameters_of(scene).keys()


def test_sizes_are_what_can_be_halved_again_and_again() -> None:
    names = {name: [size.name for size in sizes_of(SCENES[name])] for name in ("punch", "rolling")}
    assert names == {
        "punch": ["smallest_element", "load_step"],
        "rolling": ["element_size", "advance"],
    }


def test_meshes_whose_growth_goes_with_their_side_are_of_one_problem(tmp_path: Path) -> None:
    paths = [
        written(data_set({"A": 1}, (size,), fixed={"growth": growth}), tmp_path / f"{size}.nc")
        for size, growth in ((2.0, 1.3225), (1.0, 1.15), (0.5, 1.0724))
    ]
    computed = read_profiles(paths, {})
    assert computed.levels == [(2.0, 1.0), (1.0, 1.0), (0.5, 1.0)]
    assert only(computed, published(value=-200.0)).orders[0] == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["rolling-convergence", "rolling-fine"])
def test_studies_of_convergence_refine_depth_with_length_and_nothing_else(name: str) -> None:
    """Growth to the power of 1 / element size is one number: sides in depth halve everywhere."""
    study = Study.from_toml(ROOT / "data" / "studies" / f"{name}.toml")
    scene, cases = SCENES["rolling"], published_cases("rolling")
    for case in study.cases():
        base, place = cases[study.place(case)["case"]], study.place(case)
        assert not other_problem(scene, case.values, base, 1), place
        assert set(differences(case.values, base)) <= scene.refining | {"passes", "direction"}
        assert case.values["growth"] == pytest.approx(1.15 ** case.values["element_size"], abs=1e-4)


def test_an_advance_that_was_chosen_by_the_run_is_its_increment(tmp_path: Path) -> None:
    dataset = data_set({"A": 1}, fixed={"advance_tolerance": 0.01, "track": 24.0})
    dataset["advance"] = xr.full_like(dataset["status"], 0.25, dtype=float)
    usual = written(data_set({"A": 1}, fixed={"track": 24.0}), tmp_path / "a.nc")
    computed = read_profiles([usual, written(dataset, tmp_path / "b.nc")], {})
    assert computed.axes == ("element_size", "advance")
    assert computed.levels == [(1.0, 1.0), (1.0, 0.25)]


def test_the_same_result_given_twice_is_one_result(tmp_path: Path) -> None:
    paths = [written(data_set({"A": passes}), tmp_path / f"{passes}.nc") for passes in (1, 2)]
    assert read_profiles(paths, {}).levels == [(1.0, 1.0)]


def test_data_without_cases_are_refused(tmp_path: Path) -> None:
    path = written(data_set({"A": 1}).isel(case=0, drop=True), tmp_path / "a.nc")
    with pytest.raises(StudyError, match="must hold residual profiles of cases"):
        read_profiles([path], {})


def test_compare_prints_writes_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = {"T1": 2, "T3": 2, "T6": 1, "T7": 1}
    data = written(data_set(cases, (2.0, 1.0, 0.5)), tmp_path / "a.nc")
    picture, rows = tmp_path / "a.png", tmp_path / "a.csv"
    assert main(["compare", str(data), "--out", str(picture), "--csv", str(rows)]) == 0
    lines = capsys.readouterr().out.splitlines()
    (minimum,) = [line for line in lines if line.startswith("T1    1     sigma_x lowest  ")]
    assert minimum.split()[-9:] == [
        "about", "-220", "-216", "-206", "-201", "+19", "+5", "(1.0)", "-",
    ]  # fmt: skip
    assert "published, but not computed here: 2 of T8/1" in lines
    (departures,) = [line for line in lines if line.startswith("not the published case: ")]
    assert "T1, T3, T6, T7 load_ratio 2.7 (published 2.709163)" in departures
    assert "; T1 direction same (published back_and_forth)" in departures
    assert "; T3 traction 0 (published 0.75)" in departures
    assert "passes" not in departures and "advance_step" not in departures
    assert lines[-3].startswith("compared 32 of 34 published numbers: ")
    assert picture.read_bytes().startswith(b"\x89PNG")
    with rows.open() as file:
        (first, *_) = csv.DictReader(file)
    assert float(first["element_size=0.5 advance=1"]) == pytest.approx(-201.0)


def test_compare_takes_published_numbers_of_the_user(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = str(written(data_set({"mine": 1}), tmp_path / "a.nc"))
    mine = tmp_path / "r.csv"
    mine.write_text("case,quantity,component,value,unit,source\nmine,surface,zz,-100,MPa,my rig")
    assert main(["compare", data, "--reference", str(mine)]) == 0
    told = capsys.readouterr().out
    assert "1 of 1 within 50 MPa" in told and "not the published case" not in told
    assert main(["compare", data, "--reference", str(tmp_path / "none.csv")]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err
    assert main(["compare", str(tmp_path)]) == 2
    assert "must be a data set, a study or an output directory" in capsys.readouterr().err


def test_the_published_cases_of_rolling_depart_from_themselves_in_nothing() -> None:
    cases = published_cases("rolling")
    rows = read_reference(reference_of("rolling"))
    assert {row.case for row in rows} <= set(cases)
    profile = Profile(depth=DEPTH, values={}, parameters=cases["T3"] | {"element_size": 0.1})
    same = Computed(scene="rolling", axes=(), profiles={("T3", 2): {(): profile}})
    assert "not the published" not in comparison_table(same, [], [], cases)


@pytest.mark.parametrize("option", ["--out", "--csv"])
def test_a_file_that_cannot_be_written_is_told_instead_of_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    data = written(data_set({"T1": 1}), tmp_path / "a.nc")
    assert main(["compare", str(data), option, str(tmp_path / "nowhere" / "a.png")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert f"{option} = " in printed.err and "cannot be written" in printed.err
