"""Axes that move several parameters together, from the study file to what is printed and drawn."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from solver.results.quantities import QUANTITIES
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.definition.vocabulary import LABEL_ATTRIBUTES
from studies.views.picking import one_run
from studies.views.plots.lines import line_figure
from studies.views.plots.maps import map_figure
from studies.views.tables import runs_table
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import record
from tests.studies.plots.test_maps import texts_of

pytestmark = pytest.mark.usefixtures("one_worker")

ROOT = Path(__file__).parents[2]

CASE: dict[str, dict[str, Any]] = {
    "B": {"friction": 0.4, "passes": 2},
    "A": {"hardening": "isotropic"},
    "C": {},
}
SWEEP = {"half_width": [20.0, 50.0], "case": CASE}


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Store]:
    """A computed study with a linked axis and another one."""
    study, store = fake_study("linked", SWEEP), Store(tmp_path_factory.mktemp("linked") / "out")
    compute_here(study, store)
    return study, store


def refused(sweep: Any, **fixed: Any) -> StudyError:
    with pytest.raises(StudyError) as caught:
        fake_study("wrong", sweep, **fixed)
    return caught.value


def test_a_label_sets_its_parameters_and_what_it_leaves_out_is_the_default() -> None:
    study = fake_study("linked", {"case": CASE}, half_width=20.0)
    found = [
        (study.place(case)["case"], p.friction, p.hardening, p.passes, p.half_width)
        for case in study.cases()
        for p in [case.parameters]
    ]
    assert found == [
        ("B", 0.4, "none", 2, 20.0),
        ("A", 0.0, "isotropic", 1, 20.0),
        ("C", 0.0, "none", 1, 20.0),
    ]
    assert study.fixed.keys().isdisjoint({"friction", "hardening", "passes"})


def test_linked_axes_multiply_with_each_other_and_with_lists() -> None:
    mesh = {"coarse": {"points": 3}, "fine": {"points": 9, "seconds": 0.5}}
    study = fake_study("linked", {"load_ratio": [0.9, 0.3], "mesh": mesh, "case": CASE})
    assert list(study.axes) == ["case", "mesh", "load_ratio"]
    assert study.size == 12
    cases = list(study.cases())
    places = [study.place(case) for case in cases]
    assert places[0] == {"case": "B", "mesh": "coarse", "load_ratio": 0.9}
    assert places[1] == {"case": "B", "mesh": "coarse", "load_ratio": 0.3}
    assert places[2] == {"case": "B", "mesh": "fine", "load_ratio": 0.9}
    assert places[-1] == {"case": "C", "mesh": "fine", "load_ratio": 0.3}
    assert [case.index for case in cases[::5]] == [(0, 0, 0), (1, 0, 1), (2, 1, 0)]
    for case, place in zip(cases, places, strict=True):
        assert case.values["load_ratio"] == place["load_ratio"]
        assert case.values["points"] == mesh[place["mesh"]]["points"]
        assert case.values["friction"] == CASE[place["case"]].get("friction", 0.0)


def test_runs_have_the_ids_they_have_in_any_other_study() -> None:
    linked = fake_study("linked", {"case": CASE})
    single = fake_study("single", {"friction": [0.4]}, passes=2)
    assert next(linked.cases()).id == next(single.cases()).id


def test_labels_that_set_the_branch_parameter_share_a_path() -> None:
    low, high = {"load_ratio": 0.3, "friction": 0.1}, {"load_ratio": 0.9, "friction": 0.1}
    other = {"load_ratio": 0.3, "friction": 0.2}
    study = fake_study("linked", {"case": {"high": high, "other": other, "low": low}})
    paths = [[study.place(case)["case"] for case in path.cases] for path in study.paths()]
    assert paths == [["low", "high"], ["other"]]


def test_equal_tables_have_equal_ids_and_the_order_of_labels_counts() -> None:
    study = fake_study("linked", SWEEP)
    written_out = {label: {"friction": 0, "passes": 1} | CASE[label] for label in CASE}
    assert fake_study("linked", {"case": written_out, "half_width": [20, 50]}).id == study.id
    assert fake_study("linked", SWEEP | {"case": dict(sorted(CASE.items()))}).id != study.id
    again = Study.from_dict(json.loads(json.dumps(study.to_dict())))
    assert again == study
    assert (again.id, again.axes) == (study.id, study.axes)
    assert study.axes["case"] == ["B", "A", "C"]


@pytest.mark.parametrize(
    ("sweep", "field", "allowed"),
    [
        ({"friction": CASE}, "sweep.friction", "must be a list of values"),
        ({"case": {}}, "sweep.case", "one label or more"),
        ({"a b": CASE}, "sweep.a b", "beginning with a letter"),
        ({"1st": CASE}, "sweep.1st", "beginning with a letter"),
        ({7: CASE}, "sweep.7", "beginning with a letter"),
        ({"case": {"": {}}}, "sweep.case", "must be 1 to 80"),
        ({"case": {".a": {}}}, "sweep.case", "not beginning with a dot"),
        ({"case": {3: {}}}, "sweep.case", "must be 1 to 80"),
        ({"case": {"A": 0.3}}, "sweep.case.A", "a table of parameters"),
        ({"case": {"A": [0.3]}}, "sweep.case.A", "a table of parameters"),
        ({"case": {"A": {"frictoin": 1}}}, "sweep.case.A.frictoin", "did you mean friction?"),
        ({"case": {"A": {"friction": 2}}}, "sweep.case.A.friction", ">= 0 and <= 1"),
        ({"case": {"A": {"friction": [0.1]}}}, "sweep.case.A.friction", "a finite number"),
        ({"case": CASE | {"D": {"passes": 1}}}, "sweep.case.D", "the same parameters as C"),
        (
            {"case": CASE, "friction": [0.1]},
            "sweep.friction",
            "which sweep.case sets too: keep one",
        ),
        (
            {"case": CASE, "z": {"A": {"passes": 3}}},
            "sweep.z",
            "sets passes, which sweep.case sets",
        ),
    ],
)
def test_a_wrong_linked_axis_names_field_and_what_is_allowed(
    sweep: Any, field: str, allowed: str
) -> None:
    error = refused(sweep)
    assert error.field == field
    assert allowed in error.allowed
    assert str(error).count("\n") == 0


@pytest.mark.parametrize("name", sorted(QUANTITIES.keys() | LABEL_ATTRIBUTES.keys()))
def test_an_axis_cannot_have_the_name_of_a_variable(name: str) -> None:
    error = refused({name: CASE})
    assert error.field == f"sweep.{name}"
    assert "has a variable of this name" in error.allowed


def test_a_fixed_parameter_cannot_be_set_by_a_label() -> None:
    error = refused({"case": CASE}, friction=0.2)
    assert (error.field, error.value) == ("parameters.friction", 0.2)
    assert "swept too, by sweep.case" in error.allowed


def test_a_table_too_large_is_refused() -> None:
    labels = {f"L{i}": {"friction": i / 1000} for i in range(1000)}
    error = refused({"case": labels, "half_width": [1.0 + i for i in range(101)]})
    assert error.value == "101000 runs"
    assert "1000 case" in error.allowed


@pytest.mark.parametrize(
    ("sweep", "fixed", "field", "where"),
    [
        (
            {"case": {"A": {}, "B": {"friction": 1}}},
            {"state": "plane_strain"},
            "case.B.friction",
            "",
        ),
        (
            {"friction": [0.1, 1.0], "case": {"A": {}, "B": {"state": "plane_strain"}}},
            {},
            "friction[1]",
            "friction = 1.0",
        ),
    ],
)
def test_a_combination_the_scene_refuses_is_told_with_its_label(
    sweep: Any, fixed: Any, field: str, where: str
) -> None:
    error = refused(sweep, **fixed)
    assert (error.field, error.value) == (f"sweep.{field}", 1.0)
    assert "at most 0.9 in plane strain" in error.allowed
    assert where in error.allowed
    assert error.allowed.endswith("where case = B")


def test_the_data_set_has_labels_for_a_dimension_and_what_they_set_for_coordinates(
    linked: tuple[Study, Store],
) -> None:
    study, store = linked
    with open_study(store.directory) as together:
        sweep = ("load_ratio", "case", "half_width")
        assert together["status"].dims == sweep
        assert together["residual_stress"].dims[:3] == sweep
        assert together["case"].values.tolist() == ["B", "A", "C"]
        assert together["friction"].attrs["units"] == "1"
        assert together["passes"].attrs["long_name"] == "passes over the body"
        for name, values in {
            "friction": [0.4, 0.0, 0.0],
            "hardening": ["none", "isotropic", "none"],
            "passes": [2, 1, 1],
        }.items():
            assert name in together.coords
            assert together[name].dims == ("case",)
            assert together[name].values.tolist() == values
        assert together["passes"].dtype.kind == "i"
        for case in study.cases():
            given = record(case.parameters)
            one = one_run(together, study.place(case))
            np.testing.assert_array_equal(
                one["residual_stress"], given.fields["residual_stress"][1]
            )
            assert one["friction"].item() == case.values["friction"]
            assert one["peak_contact_pressure"] == given.scalars["peak_contact_pressure"]
        status = together["status"].isel(case=[0, 1]).swap_dims(case="friction")
        assert (status.sel(friction=0.4, half_width=20.0) == "ok").all()


def test_other_readers_find_the_coordinates_by_the_cf_attribute(
    linked: tuple[Study, Store],
) -> None:
    study, store = linked
    with netCDF4.Dataset(store.dataset_path(study.id)) as file:
        for name in ("residual_stress", "increments", "status", "message"):
            assert file[name].coordinates.split() == ["friction", "hardening", "passes"]
        assert "_FillValue" not in file["passes"].ncattrs()
        assert file["hardening"][:].tolist() == ["none", "isotropic", "none"]


def test_the_file_of_a_run_does_not_know_the_labels(linked: tuple[Study, Store]) -> None:
    study, store = linked
    with open_netcdf(store.run_path(next(study.cases()).id)) as run:
        assert run["status"].dims == ("load_ratio", "friction", "hardening")
        assert "case" not in run.variables


def test_runs_not_computed_are_missing_under_their_label(store: Store) -> None:
    study = fake_study("linked", {"case": {"A": {"load_ratio": 0.9}, "B": {}}}, trouble="limit")
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert together["status"].values.ravel().tolist() == ["limit_load", "ok"]
        assert one_run(together)["case"].item() == "B"


def test_a_grid_that_goes_on_in_other_runs_is_one_grid(store: Store) -> None:
    study = fake_study(sweep={"passes": [2, 1, 3]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert together["pass"].values.tolist() == [1, 2, 3]
        assert "pass" in together.indexes
        creepage = together["pass_creepage"].squeeze()
        for number, there in {
            1: [True] * 3,
            2: [True, False, True],
            3: [False, False, True],
        }.items():
            assert creepage.sel({"pass": number}).notnull().values.tolist() == there


def test_a_run_is_selected_by_label_or_by_what_the_label_sets(
    linked: tuple[Study, Store],
) -> None:
    _, store = linked
    with open_study(store.directory) as together:
        assert one_run(together, {"friction": "0.4"})["case"].item() == "B"
        chosen = one_run(together, {"passes": 1, "hardening": "none", "half_width": 20})
        assert (chosen["case"].item(), chosen["half_width"].item()) == ("C", 20.0)
        with pytest.raises(StudyError, match=r"case = 'D': must be one of B, A, C$"):
            one_run(together, {"case": "D"})
        with pytest.raises(StudyError, match=r"friction = 0.4: must be one of 0.0$"):
            one_run(together, {"case": "A", "friction": 0.4})
        with pytest.raises(StudyError, match=r"load_ratio, case, half_width, friction, hardening"):
            one_run(together, {"speed": 1})


def test_a_figure_tells_the_label_and_what_it_sets(linked: tuple[Study, Store]) -> None:
    _, store = linked
    with open_study(store.directory) as together:
        words = texts_of(map_figure(one_run(together, {"case": "A"})))
    for part in ("case A", "hardening isotropic", "friction 0", "passes 1", "half width 50 mm"):
        assert part in words


def test_what_a_run_lacks_is_no_line_of_a_figure(linked: tuple[Study, Store]) -> None:
    _, store = linked
    with open_study(store.directory) as together:
        one = one_run(together, {"case": "B"})
        profile = one["pass_creepage"] * xr.DataArray([1.0, 2.0], {"depth": [0.0, 1.0]}, "depth")
        names = {}
        for missing in (0, 1):
            one["profile"] = profile.where(one["pass"] != missing + 1)
            sheet = line_figure(one, "profile")
            assert len([line for line in sheet.axes[0].lines if len(line.get_xdata()) > 1]) == 2
            names[missing] = texts_of(sheet)
    assert "pass 2" in names[0]
    assert "pass 1" in names[1]


@pytest.mark.processes
def test_run_show_and_plot_speak_of_labels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out, picture = tmp_path / "study.toml", tmp_path / "out", tmp_path / "a.png"
    file.write_text(
        'name = "linked"\nscene = "fake"\n[sweep.case]\n'
        'A = { friction = 0.4, passes = 2 }\nB = { hardening = "isotropic" }\n'
    )
    assert main(["run", str(file), "--out", str(out), "--workers", "1"]) == 0
    names = re.findall(r"ok  (.*?)(?:  |\n)", capsys.readouterr().err)  # then the time left
    assert sorted(names) == ["case = A", "case = B"]
    assert main(["show", str(out)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["case", "friction", "hardening", "passes", "status"] in [line[:5] for line in lines]
    assert ["A", "0.4", "none", "2", "ok"] in [line[:5] for line in lines]
    assert ["B", "0", "isotropic", "1", "ok"] in [line[:5] for line in lines]
    plot = ["plot", str(out), "--out", str(picture)]
    assert main([*plot, "--select", "case=B"]) == 0
    assert picture.stat().st_size > 10_000
    assert main([*plot, "--select", "case=C"]) == 2
    assert capsys.readouterr().err == "residua: case = 'C': must be one of A, B\n"


def test_show_tells_a_single_run_with_its_label(
    store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    compute_here(fake_study("one", {"case": {"A": {"friction": 0.4}}}), store)
    assert main(["show", str(store.directory)]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["case", "A"] in lines
    assert ["friction", "0.4"] in lines


def test_a_wide_table_goes_on_below_its_first_columns(linked: tuple[Study, Store]) -> None:
    _, store = linked
    with open_study(store.directory) as together:
        assert runs_table(together).count("case") == 1
        status = together["status"]
        wide = together.assign(
            {
                f"{size}_residual_{name}": xr.full_like(status, -123.456, float)
                for size in ("surface", "lowest", "depth_of_lowest")
                for name in ("x", "z")
            }
        )
        first, second = runs_table(wide).split("\n\n")
    for block in (first, second):
        lines = block.splitlines()
        assert max(map(len, lines)) <= 120
        assert [line.split()[:2] for line in lines[-6:]] == [
            [label, width] for label in "BAC" for width in ("20", "50")
        ]
    assert "status" in first
    assert first.count("-123.5") + second.count("-123.5") == 6 * 6
    assert "cpu" in second


TABLE = {
    "T1": (2, 0.0, "none", "back_and_forth"),
    "T2": (1, 0.3, "none", "same"),
    "T3": (2, 0.75, "none", "same"),
    "T4": (1, 1.0, "none", "same"),
    "T5": (1, -0.3, "none", "same"),
    "T6": (1, -0.75, "none", "same"),
    "T7": (1, 0.0, "kinematic", "same"),
    "T8": (1, 0.0, "isotropic", "same"),
    "T9": (1, 0.75, "kinematic", "same"),
    "T10": (1, -0.75, "kinematic", "same"),
}


def test_the_ready_table_of_rolling_is_the_published_one() -> None:
    study = Study.from_toml(ROOT / "data" / "studies" / "rolling-table.toml")
    found = {}
    for case in study.cases():
        p = case.parameters
        found[study.place(case)["case"]] = (p.passes, p.traction, p.hardening, p.direction)
        assert (p.friction, p.yield_stress, p.hardening_ratio, p.track) == (0.3, 502, 0.024, 50)
        assert p.peak_pressure == pytest.approx(1360.0)
        assert p.half_width == pytest.approx(8.29, abs=0.005)
        assert p.load == "contact"
    assert found == TABLE
    assert list(found) == list(TABLE)
