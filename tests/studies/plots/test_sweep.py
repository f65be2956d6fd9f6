"""What figures over the sweep show: every run, at its place, told apart."""

from __future__ import annotations

import json
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from residua.cli import main
from solver.results.sliding_limits import johnson_limit, melan_limit
from studies import Store, Study, StudyError, open_study
from studies.storage.dataset import attributes_of
from studies.views.plots.fields import sweep_fields
from studies.views.plots.sweep import sweep_figure
from tests.studies.conftest import compute_here, fake_study
from tests.studies.plots.test_curves import swept as curves_over

ROOT = Path(__file__).parents[3]
RATIOS, FRICTIONS = np.array([1.8, 1.2, 2.4]), np.array([0.0, 0.2, 0.5, 0.3])
MARGINS = ("limit without hardening\n(Johnson)", "the same (Melan, von Mises)")


def swept(
    *, traction: float = 1.0, hardening: tuple[str, ...] = ("none", "kinematic")
) -> xr.Dataset:
    """Runs over hardening, a linked pressure and a linked slip; states 0 to 4 in turn."""
    sweep = ("hardening", "pressure", "slip")
    shape = (len(hardening), RATIOS.size, FRICTIONS.size)
    states = np.arange(np.prod(shape), dtype=float).reshape(shape) % 5
    slips = np.where(FRICTIONS > 0.0, traction, 0.0)
    return xr.Dataset(
        {
            "status": (sweep, np.full(shape, "ok", dtype=object), attributes_of("status")),
            "message": (sweep, np.full(shape, "", dtype=object)),
            "shakedown_state": (sweep, states, attributes_of("shakedown_state")),
            "creepage": (sweep, 0.25 * states - 0.5, attributes_of("creepage")),
            "residual_stress": ((*sweep, "x"), np.zeros((*shape, 2))),
        },
        coords={
            "hardening": list(hardening),
            "pressure": [f"p{ratio}" for ratio in RATIOS],
            "slip": [f"mu{friction}" for friction in FRICTIONS],
            "radius": ("pressure", 500.0 / RATIOS, {"units": "mm"}),
            "load_ratio": ("pressure", RATIOS, {"units": "1", "long_name": "load"}),
            "traction": ("slip", slips, {"units": "1"}),
            "friction": ("slip", FRICTIONS, {"units": "1"}),
        },
        attrs={"scene": "rolling", "parameters": '{"poisson_ratio": 0.3, "passes": 10}'},
    )


def marks_of(axes: Axes) -> dict[str, set[tuple[float, float]]]:
    """Return the places (friction, load ratio) by what their mark means."""
    lines = {str(line.get_label()): line for line in axes.get_lines()}
    return {
        name: {(float(x), float(y)) for x, y in np.transpose(line.get_data())}
        for name, line in lines.items()
        if name not in MARGINS
    }


def legend_of(sheet: Figure) -> list[str]:
    (legend,) = sheet.legends
    return [text.get_text() for text in legend.get_texts()]


def test_every_run_has_the_mark_of_its_state_at_its_load_and_friction() -> None:
    dataset = swept()
    sheet = sweep_figure(dataset, "shakedown_state")
    for hardening, axes in zip(["none", "kinematic"], sheet.axes[:2], strict=True):
        assert axes.get_title() == f"hardening {hardening}"
        marks = marks_of(axes)
        assert sum(map(len, marks.values())) == RATIOS.size * FRICTIONS.size
        for at, value in np.ndenumerate(dataset["shakedown_state"].sel(hardening=hardening)):
            meaning = dataset["shakedown_state"].attrs["flag_meanings"].split()[int(value)]
            assert (FRICTIONS[at[1]], RATIOS[at[0]]) in marks[meaning.replace("_", " ")]
    assert legend_of(sheet)[:2] == ["elastic", "elastic shakedown"]


def test_a_run_without_success_is_marked_by_its_status_whatever_it_holds() -> None:
    dataset = swept(hardening=("none",))
    named = {(1, 2): "limit_load", (2, 0): "missing", (0, 3): "audit_failed",
             (2, 2): "outside_theory"}  # fmt: skip
    for (row, column), status in named.items():
        dataset["status"][0, row, column] = status
    dataset["shakedown_state"][0, 1, 1] = np.nan
    sheet = sweep_figure(dataset, "shakedown_state")
    marks = marks_of(sheet.axes[0])
    assert marks["no equilibrium"] == {(0.5, 1.2)}
    assert marks["failed or missing"] == {(0.0, 2.4), (0.3, 1.8)}
    assert marks["no value"] == {(0.2, 1.2)}
    assert marks["outside small-strain theory"] == {(FRICTIONS[2], RATIOS[2])}
    assert sum(map(len, marks.values())) == RATIOS.size * FRICTIONS.size
    assert {"no equilibrium", "failed or missing", "no value"} < set(legend_of(sheet))
    statuses = marks_of(sweep_figure(dataset, "status").axes[0])
    assert statuses["limit load"] == {(0.5, 1.2)}
    assert len(statuses["ok"]) == RATIOS.size * FRICTIONS.size - len(named)


def test_numbers_share_one_scale_of_colours_with_zero_in_the_middle() -> None:
    dataset = swept()
    dataset["status"][0, 0, 0] = "limit_load"
    dataset["creepage"][1, 0, 0] = -0.9
    sheet = sweep_figure(dataset, "creepage")
    clouds = []
    for axes in sheet.axes[:2]:
        (cloud,) = (each for each in axes.collections if isinstance(each, PathCollection))
        assert cloud.get_clim() == (-0.9, 0.9)
        clouds.append(cloud)
    assert [len(cloud.get_offsets()) for cloud in clouds] == [11, 12]
    x, y = clouds[1].get_offsets().T
    expected = (
        dataset["creepage"].isel(hardening=1).swap_dims(pressure="load_ratio", slip="friction")
    )
    for value, friction, ratio in zip(clouds[1].get_array(), x, y, strict=True):
        assert value == expected.sel(load_ratio=ratio, friction=friction)
    assert legend_of(sheet) == ["no equilibrium"]


def test_limits_are_those_of_theory_and_drawn_for_full_slip_only() -> None:
    sheet = sweep_figure(swept(), "shakedown_state")
    for axes in sheet.axes[:2]:
        lines = {str(line.get_label()): line for line in axes.get_lines()}
        for name, limit in zip(MARGINS, (johnson_limit(0.5), melan_limit(0.5, 0.3)), strict=True):
            x, y = lines[name].get_data()
            assert (x[0], x[-1]) == (0.0, 0.5)
            assert y[0] == pytest.approx(4.0 / sqrt(3), rel=1e-4)
            assert y[-1] == pytest.approx(limit / sqrt(3))
    labels = [axes.child_axes[0].get_ylabel() for axes in sheet.axes[:2]]
    assert labels == ["", "$p_0$ / k"]
    points = swept().assign_attrs(scene="raceway", parameters='{"poisson_ratio": 0.3}')
    assert sweep_figure(points, "shakedown_state").axes[1].child_axes[0].get_ylabel() == labels[1]
    for other in (
        sweep_figure(points, "shakedown_state"),
        sweep_figure(swept(traction=0.75), "shakedown_state"),
        sweep_figure(swept(), "creepage"),
    ):
        drawn = {str(line.get_label()) for axes in other.axes for line in axes.get_lines()}
        assert not drawn & set(MARGINS)


def test_an_axis_whose_numbers_repeat_is_told_by_its_labels(store: Store) -> None:
    case = {"A": {"passes": 2}, "B": {"passes": 2, "state": "plane_strain"}}
    study = fake_study(
        sweep={"case": case, "half_width": [20.0, 50.0], "friction": [0.0, 0.4, 0.2, 0.6]}
    )
    compute_here(study, store)
    with open_study(store.directory) as together:
        sheet = sweep_figure(together, "peak_residual_tension")
        panels = sheet.axes[:2]
        assert [axes.get_title() for axes in panels] == ["case A", "case B"]
        (cloud,) = panels[0].collections
        # friction is of the usual numbers, so it goes up
        assert {tuple(at) for at in cloud.get_offsets()} == {
            (width, friction) for width in (20.0, 50.0) for friction in (0.0, 0.2, 0.4, 0.6)
        }
        curves = sweep_figure(together.isel(half_width=[0]), "increments").axes[0]
        assert curves.get_xlabel() == "Friction"
        with pytest.raises(StudyError, match="but nothing varies here"):
            sweep_figure(together.isel(case=[0], half_width=[0], friction=[0]), "increments")


def test_panels_of_a_linked_axis_are_headed_by_its_labels() -> None:
    dataset = swept().rename(hardening="material").assign_coords(passes=("material", [10, 40]))
    sheet = sweep_figure(dataset, "shakedown_state")
    assert [axes.get_title() for axes in sheet.axes[:2]] == ["material none", "material kinematic"]


def test_a_field_without_values_is_refused() -> None:
    dataset = swept()
    for field in ("creepage", "shakedown_state"):
        dataset[field] = dataset[field].where(dataset["status"] != "ok")
        with pytest.raises(StudyError, match=f"field = '{field}': has no value in the run"):
            sweep_figure(dataset, field)


@pytest.mark.parametrize("hardening", [("none",), ("none", "kinematic")])
@pytest.mark.parametrize("field", ["shakedown_state", "creepage"])
def test_nothing_is_cut_and_the_legend_lies_beside_panels_of_a_good_size(
    hardening: tuple[str, ...], field: str
) -> None:
    dataset = swept(hardening=hardening)
    dataset["status"][0, 0, 0] = "limit_load"
    dataset["load_ratio"].attrs["long_name"] = "a very long description " * 8
    given = {"poisson_ratio": 0.3, "passes": 10, "track": 64.0, "until": "decided", "growth": 1.2}
    dataset.attrs["parameters"] = json.dumps(given | {"element_size": 2.0, "advance_step": 4.0})
    sheet = sweep_figure(dataset, field)
    sheet.draw_without_rendering()
    inked = sheet.get_tightbbox()
    assert (inked.x0 >= 0.0, inked.y0 >= 0.0) == (True, True)
    assert inked.x1 <= sheet.get_figwidth()
    assert inked.y1 <= sheet.get_figheight()
    (legend,) = sheet.legends
    box, heads = legend.get_window_extent(), [text.get_window_extent() for text in sheet.texts]
    assert len(heads) == 2
    for head in heads:
        assert not any(head.overlaps(each) for each in (box, *(a.bbox for a in sheet.axes)))
    panels = sheet.axes[: len(hardening)]
    for axes in panels:
        assert not axes.get_tightbbox().overlaps(box)
        assert axes.bbox.width > 0.75 * axes.bbox.height
    assert panels[0].get_ylabel() == "Load ratio"
    assert panels[0].get_xlabel() == "Friction"


def test_whole_numbers_have_whole_ticks() -> None:
    dataset = swept().drop_vars("friction").assign_coords(passes=("slip", [1, 2, 3, 4]))
    (axes, *_) = sweep_figure(dataset, "creepage").axes
    assert axes.get_xlabel() == "Passes"
    ticks = axes.get_xticks()
    assert len(ticks) > 3
    np.testing.assert_array_equal(ticks, np.round(ticks))
    assert not np.array_equal(axes.get_yticks(), np.round(axes.get_yticks()))


def test_too_many_panels_are_refused() -> None:
    many = xr.concat([swept()] * 4, "radius_of_rim").transpose(..., "radius_of_rim")
    many = many.assign_coords(radius_of_rim=["a", "b", "c", "d"])
    many = many.transpose("hardening", "radius_of_rim", "pressure", "slip", ...)
    with pytest.raises(
        StudyError, match="8 panels, at most 6 are drawn: select values of hardening, radius_of_rim"
    ):
        sweep_figure(many, "creepage")


def test_the_command_draws_one_value_a_run_over_the_sweep(
    computed: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, store = computed
    picture = tmp_path / "a.png"
    arguments = ["plot", str(store.directory), "--out", str(picture), "--field", "increments"]
    with open_study(store.directory) as together:
        assert {"status", "increments"} <= set(sweep_fields(together))
        assert not {"message", "residual_stress"} & set(sweep_fields(together))
    assert main(arguments) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    for wrong, named in [
        (["--window", "0", "1", "0", "1"], "window = [0.0, 1.0, 0.0, 1.0]: increments has one"),
        (["--over", "friction"], "over = 'friction': increments has one value a run"),
        (["--resolution", "9"], "resolution = 9.0: must be 50 to 600 dots per inch"),
        (["--component", "xx"], "component = 'xx': increments has one value a run"),
        (["--zoom", "3"], "zoom = 3.0: increments has one value a run"),
    ]:
        assert main([*arguments, *wrong]) == 2
        assert named in capsys.readouterr().err


def test_the_shakedown_map_asks_for_loads_on_both_sides_of_the_limit_on_one_mesh() -> None:
    study = Study.from_toml(ROOT / "data" / "studies" / "shakedown-map.toml")
    runs = [case.parameters for case in study.cases()]
    assert all(run.half_width == pytest.approx(8.0, rel=1e-3) for run in runs)
    assert all(run.traction == (run.friction > 0.0) for run in runs)
    for friction in {run.friction for run in runs}:
        loads = {sqrt(3) * run.load_ratio for run in runs if run.friction == friction}
        assert min(loads) < melan_limit(friction, 0.3) <= johnson_limit(friction) < max(loads)


def test_the_map_of_point_contact_asks_for_ellipses_of_one_pressure_on_three_meshes() -> None:
    """Its loads are on both sides of the limits without friction, 4.22, 4.68 and 5.78."""
    study = Study.from_toml(ROOT / "data" / "studies" / "raceway-shakedown.toml")
    limits = {0.5: 4.22, 1.0: 4.68, 2.0: 5.78}
    runs: dict[float, list[Any]] = {ratio: [] for ratio in limits}
    for case in study.cases():
        ellipse = case.parameters.ellipse
        runs[round(ellipse.a / ellipse.b, 3)].append(case.parameters)
        assert ellipse.peak_pressure == pytest.approx(3000.0, rel=1e-3)
    for ratio, each in runs.items():
        assert len({(*run.size, run.elements) for run in each}) == 1
        assert all(run.traction == (run.friction > 0.0) for run in each)
        loads = {sqrt(3) * run.load_ratio for run in each if run.friction == 0.0}
        assert min(loads) < limits[ratio] < max(loads)


def test_few_values_are_labelled_lines_and_many_are_a_plane() -> None:
    """Two or three values of each number: marks in a plane would tell nothing."""
    for loads in (2, 3, 5):
        number = swept_numbers(loads, 3)
        sheet = sweep_figure(number, "creepage")
        axes = sheet.axes[0]
        assert bool(axes.lines) == (loads <= 3)
        if loads <= 3:
            assert axes.get_xlabel() == "Load ratio"
            assert [t.get_text() for t in axes.get_legend().get_texts()] == ["0", "0.1", "0.2"]
            np.testing.assert_array_equal(axes.lines[1].get_ydata(), number["creepage"][:, 1, 0])


def swept_numbers(loads: int, frictions: int) -> xr.Dataset:
    runs = curves_over(list(1.0 + np.arange(loads)), list(0.1 * np.arange(frictions)), ["none"])
    size = np.arange(1.0, loads * frictions + 1.0).reshape(loads, frictions, 1)
    runs["creepage"] = (("load_ratio", "friction", "hardening"), size)
    return runs
