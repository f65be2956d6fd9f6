"""Axes of points, from the study file to what is printed and drawn."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from residua.cli import main
from solver.shipped import SCENES
from studies import Store, Study, StudyError, estimate, open_study, to_grid
from studies.definition.parameters import parameters_of
from studies.toml import CASE
from studies.views.picking import one_run
from studies.views.plots.picture import picture
from studies.views.tables import runs_table
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import record

TESTS: list[dict[str, Any]] = [
    {"case": "T 1", "friction": 0.1, "load_ratio": 0.9},
    {"case": "T 2", "friction": 0.1, "load_ratio": 0.3, "passes": 2},
    {"case": "T 3", "friction": 0.1, "load_ratio": 0.3},
]
GRID = [{"friction": f, "load_ratio": r} for r in (0.6, 0.2, 0.4) for f in (0.3, 0.1)]


def with_points(points: Any, **content: Any) -> Study:
    return Study.from_dict({"name": "points", "scene": "fake", "points": points, **content})


def from_file(folder: Path, table: str, head: str = '[points]\nfile = "tests.csv"\n') -> Study:
    (folder / "tests.csv").write_text(table, encoding="utf-8")
    path = folder / "study.toml"
    path.write_text(f'name = "points"\nscene = "fake"\n{head}')
    return Study.from_toml(path)


def refused(points: Any, **content: Any) -> StudyError:
    with pytest.raises(StudyError) as caught:
        with_points(points, **content)
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.fixture(scope="module")
def computed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Store]:
    """Named points, which multiply with another axis."""
    study = with_points(TESTS, sweep={"half_width": [20.0, 50.0]})
    store = Store(tmp_path_factory.mktemp("points") / "out")
    compute_here(study, store)
    return study, store


def test_points_multiply_with_axes_and_share_paths_and_runs_with_other_studies() -> None:
    study = with_points(TESTS, sweep={"half_width": [20.0, 50.0]})
    assert (study.size, study.axes) == (6, {"point": [0, 1, 2], "half_width": [20.0, 50.0]})
    places = [[study.place(case)["point"] for case in path.cases] for path in study.paths()]
    assert places == [[2, 0], [2, 0], [1], [1]], "points that differ in load share a path"
    other = fake_study(sweep={"load_ratio": [0.3], "passes": [2]}, friction=0.1, half_width=20.0)
    assert next(other.run_ids()) == list(study.run_ids())[2]
    assert len(set(study.run_ids())) == 6


def test_what_a_point_leaves_out_is_the_default_however_it_is_written(tmp_path: Path) -> None:
    table = (
        "# three tests\n\n"
        "case, friction [1], load_ratio [-], passes\nT 1, 0.1, 0.9,\nT 2,0.1,3e-1,2\nT 3,.1,0.3,\n"
    )
    study = with_points(TESTS)
    assert [each["passes"] for each in study.sweep["point"]] == [1, 2, 1]
    named = Study.from_dict({"name": "points", "scene": "fake", "sweep": {"point": TESTS}})
    stored = Study.from_dict(json.loads(json.dumps(study.to_dict())))
    ids = {study.id, named.id, stored.id, from_file(tmp_path, table).id}
    decimal = table.replace(", ", ";").replace(",", ";").replace(".", ",").replace(";,1", ";0,1")
    assert ids == {from_file(tmp_path, decimal).id}
    assert ids == {from_file(tmp_path, table, 'points = "tests.csv"\n').id}
    assert with_points(TESTS[::-1]).id != study.id


def test_an_axis_of_points_may_have_any_name_and_there_may_be_several(tmp_path: Path) -> None:
    head = (
        'points = [{ friction = 0.2 }, { friction = 0.1 }]\n[sweep.test]\nfile = "tests.csv"\n'
        '[sweep.trial]\nmethod = "halton"\nnum = 3\nranges = { half_width = [10.0, 20.0] }\n'
    )
    study = from_file(tmp_path, "load_ratio\tpasses\n0.3\t1\n0.9\t2\n", head)
    assert study.axes == {"point": [0, 1], "test": [0, 1], "trial": [0, 1, 2]}
    assert study.size == 12


@pytest.mark.parametrize("table", ["parameters", "sweep"])
def test_a_file_of_points_in_a_wrong_table_is_told_its_place(tmp_path: Path, table: str) -> None:
    """It is not read as a curve. The fake scene has a parameter of this name."""
    path = tmp_path / "study.toml"
    path.write_text(f'name = "p"\nscene = "punch"\n[{table}]\npoints = "tests.csv"\n')
    allowed = "is an entry of the study, not of this table: write points above all tables"
    with pytest.raises(StudyError, match=f"^{table}.points = 'tests.csv': {allowed}"):
        Study.from_toml(path)


def test_a_text_of_the_study_is_not_told_to_be_a_table() -> None:
    content = {"name": "p", "scene": "punch", "sweep": {"doi": ["10.5281/zenodo.1"]}}
    with pytest.raises(StudyError, match=r"write doi above all tables$"):
        Study.from_dict(content)


def test_a_file_of_points_may_name_curves(tmp_path: Path) -> None:
    (tmp_path / "worn.csv").write_text("-40, 2.7\n-36, 2.2\n0, 0\n40, 1\n")
    (tmp_path / "tests.csv").write_text("case,wheel_profile\nnew,s1002\nworn,worn.csv\n")
    path = tmp_path / "study.toml"
    path.write_text('name = "p"\nscene = "wheel_rail"\n[points]\nfile = "tests.csv"\n')
    _, worn = Study.from_toml(path).cases()
    assert worn.values["wheel_profile"][0] == [-40.0, 2.7]


def test_words_and_names_in_a_file_of_points_stay_as_they_are_written(tmp_path: Path) -> None:
    names = ["007", "7", "1.10", "1.1", "1_2", "1e5", "true", "nan"]
    rows = "".join(f"{name},0.{k + 1}\n" for k, name in enumerate(names))
    points: Any = from_file(tmp_path, f"case,friction\n{rows}").sweep["point"]
    assert [each["case"] for each in points] == names
    points = from_file(tmp_path, "case;friction\n1,10;0,1\n1,1;,2\n").sweep["point"]
    assert [list(each.values()) for each in points] == [["1,10", 0.1], ["1,1", 0.2]]
    path = tmp_path / "rail.toml"
    path.write_text('name = "p"\nscene = "wheel_rail"\n[points]\nfile = "tests.csv"\n')
    (tmp_path / "tests.csv").write_text("rail_profile,lateral_position\n60e1,-1e0\n60e1,1\n")
    found: Any = Study.from_toml(path).sweep["point"]
    words = [(each["rail_profile"], each["lateral_position"]) for each in found]
    assert words == [("60e1", -1.0), ("60e1", 1.0)]


@pytest.mark.parametrize("text", ["1_2", "nan", "0x1", "1e999", "true", "\u0661", "0.1.2"])
def test_what_is_no_number_in_a_file_is_none(tmp_path: Path, text: str) -> None:
    with pytest.raises(StudyError, match=rf"points\[0\]\.friction = '{text}': must be .* >= 0"):
        from_file(tmp_path, f"friction\n{text}\n0.1\n")


def test_lines_without_text_and_indented_remarks_are_no_points(tmp_path: Path) -> None:
    table = "  # a\n,,\ncase,friction,passes\n , ,\nA.csv,0.1,\n\t# b\nx.txt,0.2,2\n,,\n\n"
    points = from_file(tmp_path, table).sweep["point"]
    assert [list(each.values()) for each in points] == [["A.csv", 0.1, 1], ["x.txt", 0.2, 2]]
    tabs = "case\tfriction\tpasses\nA.csv\t0.1\t\nx.txt\t0.2\t2\n\t0.3\t\n"
    with pytest.raises(StudyError, match=r"points\[2\]\.case: must be given"):
        from_file(tmp_path, tabs)


def test_the_data_set_has_numbers_for_a_dimension_and_parameters_for_coordinates(
    computed: tuple[Study, Store],
) -> None:
    study, store = computed
    with open_study(store.directory) as dataset:
        assert dataset["status"].dims == ("hardening", "point", "half_width")
        assert dataset["point"].values.tolist() == [0, 1, 2]
        assert dataset["point"].attrs["sets"] == "case load_ratio friction passes"
        assert dataset["case"].values.tolist() == ["T 1", "T 2", "T 3"]
        assert dataset["load_ratio"].values.tolist() == [0.9, 0.3, 0.3]
        assert dataset["friction"].attrs["units"] == "1"
        for case in study.cases():
            one = one_run(dataset, study.place(case))
            given = record(case.parameters).fields["residual_stress"][1]
            np.testing.assert_array_equal(one["residual_stress"], given)
        assert one_run(dataset, {"case": "T 2", "half_width": 20})["passes"].item() == 2
        lines = [line.split() for line in runs_table(dataset).splitlines()]
        assert ["0", "20", "T", "1", "0.9", "0.1", "1", "ok"] in [line[:8] for line in lines]


def test_an_estimate_counts_the_paths_of_points(computed: tuple[Study, Store]) -> None:
    _, store = computed
    more = with_points(
        [*TESTS, {"case": "T 4", "friction": 0.2}], sweep={"half_width": [20.0, 50.0]}
    )
    found = estimate(more, store)
    assert (found.runs, found.to_compute, found.paths) == (8, 2, 2)


def test_points_that_are_a_grid_become_its_dimensions(store: Store) -> None:
    study = with_points(GRID, sweep={"passes": [1, 2]})
    compute_here(study, store)
    with open_study(store.directory) as dataset:
        grid = to_grid(dataset)
        assert grid["status"].dims == ("hardening", "load_ratio", "friction", "passes")
        assert grid["residual_stress"].dims[:4] == grid["status"].dims
        assert grid["load_ratio"].values.tolist() == [0.2, 0.4, 0.6]
        assert grid["friction"].attrs == dataset["friction"].attrs
        for k, point in enumerate(GRID):
            same = grid.sel(point), dataset.sel(point=k)
            np.testing.assert_array_equal(*(each["residual_stress"] for each in same))
        with pytest.raises(StudyError, match="axis = 'passes': must be one of point"):
            to_grid(dataset, "passes")
        with pytest.raises(StudyError, match=r"5 points': are no grid: 5 of its 6 places"):
            to_grid(dataset.isel(point=slice(5)))


def test_points_are_drawn_as_curve_as_grid_as_plane_or_over_each_parameter(store: Store) -> None:
    over = {
        "curve": [{"friction": f} for f in (0.1, 0.4, 0.3)],
        "grid": GRID,
        "plane": GRID[:-1],
        "cloud": [each | {"passes": k, "hardening": "none"} for k, each in enumerate(GRID, 1)],
    }
    field, drawn = "peak_contact_pressure", {}
    for name, points in over.items():
        study = with_points(points, name=name, parameters={"trouble": "limit"})
        compute_here(study, store)
        with open_study(store.directory, name) as dataset:
            drawn[name] = picture(dataset, field)
    labels = {name: [axes.get_xlabel() for axes in each.axes] for name, each in drawn.items()}
    assert labels["curve"] == ["Friction"]
    assert drawn["curve"].axes[0].lines[0].get_xdata().tolist() == [0.1, 0.3, 0.4]
    assert (labels["grid"][0], labels["plane"][0]) == ("Load ratio", "Friction")
    assert drawn["plane"].axes[0].get_ylabel() == "Load ratio"
    assert len(drawn["plane"].axes[0].collections[0].get_offsets()) == 5
    assert labels["cloud"] == ["Load ratio", "Friction", "Passes"]
    assert len(drawn["cloud"].axes[2].lines[0].get_xdata()) == 6


def test_points_without_a_value_are_marked_at_the_foot_of_every_panel(store: Store) -> None:
    points = [{"load_ratio": 0.3 * k, "friction": 0.1 * k, "passes": 1 + k % 2} for k in (1, 2, 3)]
    study = with_points(points, parameters={"trouble": "limit"}, sweep={"half_width": [20, 50]})
    compute_here(study, store)
    with open_study(store.directory) as dataset:
        sheet = picture(dataset, "peak_contact_pressure")
    names = [text.get_text() for text in sheet.legends[0].get_texts()]
    assert names == ["half width 20 mm", "half width 50 mm", "no equilibrium"]
    for axes in sheet.axes:
        assert [len(line.get_xdata()) for line in axes.lines] == [2, 1, 2, 1]


@pytest.mark.parametrize(
    ("points", "field", "allowed"),
    [
        ([], "points", "must be a list of points"),
        ("tests", "points", "must be a list of points"),
        ({"A": {"friction": 0.1}}, "points", "labels are [sweep.NAME]"),
        ({"method": "lhs", "num": 2}, "points", "a sample is [sample]"),
        ([{"friction": 0.1}] * 100_001, "points", "at most 100000 are allowed"),
        ([{"friction": 0.1}, 3], "points[1]", "must be a table of parameters"),
        ([{}], "points", "must set a parameter"),
        ([{"case": "A"}], "points", "must set a parameter"),
        ([{"frictoin": 0.1}], "points[0].frictoin", "did you mean friction?"),
        ([{"friction": "a"}], "points[0].friction", ">= 0 and <= 1"),
        ([{"friction": 0.1}, {"friction": 2}], "points[1].friction", ">= 0 and <= 1"),
        ([{"half_width [N]": 1}], "points[0].half_width", "must be a number in mm; N is a force"),
        ([{"friction [mm]": 1}], "points[0].friction", "without unit; mm is a length"),
        ([{"friction [1]": 1, "friction": 1}], "points[0].friction", "is given twice"),
        ([{"friction": 0}, {"friction": -0.0}], "points[1]", "sets the same parameters as 0"),
        ([{"friction": 0, "case": "A"}, {"friction": 1}], "points[1].case", "for all points"),
        ([{"friction": k, "case": "A"} for k in (0, 1)], "points[1].case", "names point 0 too"),
        ([{"friction": 0, "case": ""}], "points[0].case", "a text of 1 to 80"),
        ({"file": "tests.csv"}, "points", "only a study file can"),
    ],
)
def test_wrong_points_are_refused_with_their_place(points: Any, field: str, allowed: str) -> None:
    error = refused(points)
    assert (error.field, allowed in error.allowed) == (field, True), str(error)


@pytest.mark.parametrize("scene", [*SCENES])
def test_no_parameter_takes_a_table_so_that_a_list_of_tables_is_points(scene: str) -> None:
    for parameter in parameters_of(SCENES[scene]).values():
        assert parameter.name != CASE
        named = parameter.schema.get("$defs", {})
        options = [
            named[each["$ref"].rpartition("/")[2]] if "$ref" in each else each
            for each in parameter.schema.get("anyOf", [parameter.schema])
        ]
        assert all(each.keys() & {"type", "enum", "const"} for each in options), parameter.schema
        assert "object" not in [each.get("type") for each in options], parameter.name
        with pytest.raises(StudyError):
            parameter.normalise({}, parameter.name)


def test_a_parameter_is_set_in_one_place() -> None:
    error = refused(GRID, sweep={"friction": [0.1]})
    assert str(error) == ("sweep.friction = [0.1]: sets friction, which points sets too: keep one")
    assert "is swept too, by the points" in refused(GRID, parameters={"friction": 0.1}).allowed
    error = refused(GRID, sample={"method": "lhs", "num": 2, "ranges": {"passes": [1, 2]}})
    assert (error.field, "points is given too" in error.allowed) == ("sample", True)
    assert refused(GRID, sweep={"point": [{"passes": 2}]}).field == "sweep.point"
    labels = {"A": {"passes": 1}, "B": {"passes": 2}}
    assert "which sweep.case sets too" in refused(TESTS[:1], sweep={"case": labels}).allowed


def test_a_combination_the_scene_refuses_is_told_with_its_point() -> None:
    points = [{"friction": 0.5, "case": "A"}, {"friction": 1.0, "case": "B"}]
    error = refused(points, parameters={"state": "plane_strain"})
    assert str(error) == ("points[1].friction = 1.0: at most 0.9 in plane strain, where point = B")


def test_a_scene_with_named_points_needs_another_name(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    (tmp_path / "pad.toml").write_text((root / "data/scenes/fretting.toml").read_text())
    text = 'name = "p"\nscene = "pad.toml"\n{}\nfriction = 0.3\n[[{}]]\nfriction = 0.4\n'
    path = tmp_path / "study.toml"
    path.write_text(text.format("[[points]]", "points"))
    with pytest.raises(StudyError, match=r"sweep\.point = .*give the points of the study another"):
        Study.from_toml(path)
    path.write_text(text.format("[[sweep.test]]", "sweep.test"))
    assert Study.from_toml(path).axes == {"test": [0, 1]}


@pytest.mark.parametrize(
    ("table", "allowed"),
    [
        ("friction\n", "a line for each point"),
        ("friction,friction\n0.1,0.2\n", "has the heading 'friction' twice"),
        ("friction,\n0.1,0.2\n", "a column without heading"),
        ("", "a line for each point"),
        (",\n,\n", "a line for each point"),
        ('friction\n0.1\n"' + "1" * 200_000, "must have cells in line 3: field larger"),
        ('case,friction\n"A,0.1\nB,0.2\n', "has 1 cells in line 2, and 2 headings"),
        ("# a\nfriction\n\n0.1\n0.1,0.2\n", "has 2 cells in line 5, and 1 headings"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(tmp_path: Path, table: str, allowed: str) -> None:
    with pytest.raises(StudyError) as caught:
        from_file(tmp_path, table)
    assert caught.value.field == "points.file"
    assert allowed in caught.value.allowed
    with pytest.raises(StudyError, match=r"points\.num = 3: must be in the file, or left out"):
        from_file(tmp_path, table, '[points]\nfile = "tests.csv"\nnum = 3\n')


def test_a_file_that_is_missing_is_told(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"points\.file = .*other.csv': must be a file to read"):
        from_file(tmp_path, "", '[points]\nfile = "other.csv"\n')


@pytest.mark.processes
@pytest.mark.usefixtures("one_worker")
def test_run_show_and_plot_speak_of_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from_file(tmp_path, "case,friction [1],load_ratio\nT1,0.1,0.3\nT2,0.2,0.6\n")
    run = ["run", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out")]
    assert main([*run, "--dry-run"]) == 0
    assert "2 in all, 2 to compute" in capsys.readouterr().out
    assert main([*run, "--workers", "1"]) == 0
    # then the time left; on a busy machine there are lines without a run
    assert sorted(re.findall(r"ok  (.*?)(?:  |\n)", capsys.readouterr().err)) == [
        "point = 0: T1, load_ratio = 0.3, friction = 0.1",
        "point = 1: T2, load_ratio = 0.6, friction = 0.2",
    ]
    plot = ["plot", str(tmp_path / "out"), "--out", str(tmp_path / "a.png")]
    assert main([*plot, "--select", "case=T2"]) == 0
    assert main([*plot, "--field", "increments"]) == 0
    assert main([*plot, "--select", "case=T3"]) == 2
    assert capsys.readouterr().err == "residua: case = 'T3': must be one of T1, T2\n"
