"""Curves over one axis of the sweep, contours over two, and lines of several runs together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.contour import QuadContourSet
from matplotlib.lines import Line2D
from matplotlib.text import Text

from residua.cli import main
from studies import StudyError
from studies.storage.dataset import attributes_of
from studies.storage.seal import seal
from studies.views.plots.picture import picture
from studies.views.plots.sweep import sweep_figure
from tests.studies.plots.test_lines import legend_of, lines_of

LOADS, FRICTIONS, LAWS = [0.6, 0.2, 0.4], [0.0, 0.1], ["none", "kinematic"]


def swept(
    loads: list[float] = LOADS, frictions: list[float] = FRICTIONS, laws: list[str] = LAWS
) -> xr.Dataset:
    """Runs whose figure is load + 10 friction + 100 number of the law; a line of s as well."""
    sweep = ("load_ratio", "friction", "hardening")
    shape = tuple(map(len, (loads, frictions, laws)))
    value = np.add.outer(
        np.add.outer(loads, np.multiply(10.0, frictions)), 100.0 * np.arange(shape[2])
    )
    s = np.linspace(0.0, 4.0, 5)
    return xr.Dataset(
        {
            "status": (sweep, np.full(shape, "ok", dtype=object), attributes_of("status")),
            "message": (sweep, np.full(shape, "", dtype=object)),
            "increments": (sweep, value, {"units": "MPa", "long_name": "a figure"}),
            "contact_pressure": ((*sweep, "s"), value[..., None] * s, {"units": "MPa"}),
        },
        coords={
            "load_ratio": loads,
            "friction": frictions,
            "hardening": laws,
            "s": ("s", s, {"units": "mm"}),
        },
        attrs={"scene": "punch", "parameters": json.dumps({})},
    )


def points(line: Line2D) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in np.transpose(line.get_data())]


def test_one_swept_number_is_drawn_as_a_curve_for_each_of_the_rest() -> None:
    sheet = sweep_figure(swept(frictions=[0.1]), "increments")
    axes = sheet.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Load ratio", "Increments [MPa]")
    assert legend_of(sheet) == LAWS
    for number, line in enumerate(lines_of(sheet)):
        expected = [(load, load + 1.0 + 100.0 * number) for load in sorted(LOADS)]
        assert points(line) == [pytest.approx(each) for each in expected]
        assert line.get_linestyle() == "-"


def test_runs_without_a_value_are_marked_at_the_foot_and_named_once() -> None:
    dataset = swept(frictions=[0.0])
    for law in range(2):
        dataset["status"][0, 0, law] = "limit_load"
    sheet = sweep_figure(dataset, "increments")
    assert legend_of(sheet) == [*LAWS, "no equilibrium"]
    *curves, foot = lines_of(sheet)
    assert [at[0] for at in points(foot)] == [0.6, 0.6]
    assert all(y < 0.1 for _, y in points(foot))
    assert all(np.isnan(line.get_ydata()[-1]) for line in curves)


def test_labels_alone_stand_side_by_side() -> None:
    sheet = sweep_figure(swept(loads=[0.2], frictions=[0.0]), "increments")
    (line,) = lines_of(sheet)
    assert points(line) == [(0.0, pytest.approx(0.2)), (1.0, pytest.approx(100.2))]
    assert line.get_linestyle() == "None"
    assert [text.get_text() for text in sheet.axes[0].get_xticklabels()] == LAWS


def test_an_outcome_is_drawn_by_its_name() -> None:
    dataset = swept(frictions=[0.0], laws=["none"])
    dataset["status"][1, 0, 0] = "limit_load"
    axes = sweep_figure(dataset, "status").axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["ok", "limit load"]


def test_too_many_curves_ask_for_a_selection() -> None:
    laws = [f"law{number}" for number in range(13)]
    with pytest.raises(StudyError, match=r"13 curves, at most 12 .* of hardening"):
        sweep_figure(swept(frictions=[0.0], laws=laws), "increments")
    with pytest.raises(StudyError, match="nothing varies here"):
        sweep_figure(swept(loads=[0.2], frictions=[0.0], laws=["none"]), "increments")


def test_contours_are_drawn_where_a_sweep_is_dense_but_not_over_holes() -> None:
    few, many = [0.0, 0.1, 0.2], list(np.linspace(0.0, 0.7, 8))
    assert not contours(sweep_figure(swept(many, few, ["none"]), "increments").axes[0])
    dataset = swept(many, many[::-1], ["none"])
    dataset["status"][0, 0, 0] = "limit_load"  # load 0, friction 0.7
    filled, _ = contours(sweep_figure(dataset, "increments").axes[0])
    inside = [path.contains_point((0.69, 0.01)) for path in filled.get_paths()]
    assert not any(inside)
    middle = [path.contains_point((0.37, 0.33)) for path in filled.get_paths()]
    (level,) = np.flatnonzero(middle)
    assert filled.levels[level] <= 0.33 + 3.7 <= filled.levels[level + 1]


def contours(axes: Axes) -> list[QuadContourSet]:
    return [each for each in axes.collections if isinstance(each, QuadContourSet)]


def test_lines_of_several_runs_lie_over_one_axis() -> None:
    dataset = swept()
    dataset["status"][1, 1, 0] = "limit_load"  # load 0.2, friction 0.1, none
    selection = {"load_ratio": 0.4, "friction": 0.1}
    sheet = picture(dataset, "contact_pressure", selection=selection, over="hardening")
    assert legend_of(sheet) == LAWS
    first, second = lines_of(sheet)
    assert points(first)[-1] == (4.0, pytest.approx(4.0 * 1.4))
    assert points(second)[-1] == (4.0, pytest.approx(4.0 * 101.4))
    assert first.get_linestyle() != second.get_linestyle()
    left = {"load_ratio": 0.2, "friction": 0.1}
    assert (
        len(lines_of(picture(dataset, "contact_pressure", selection=left, over="hardening"))) == 1
    )
    with pytest.raises(StudyError, match="over = 'colour': must be one of load_ratio"):
        picture(dataset, "contact_pressure", over="colour")


def test_lines_of_runs_with_grids_of_their_own_lie_over_their_own_places() -> None:
    dataset = swept().rename(s="place").drop_vars("place").rename(place="s")
    own = np.outer([1.0, 2.0, 3.0], np.arange(5.0))
    dataset = dataset.assign_coords(
        s_fraction=("s", np.linspace(0.0, 1.0, 5)),
        s=(("load_ratio", "s"), own, {"units": "mm"}),
    )
    values = dataset["contact_pressure"].isel(friction=-1, hardening=0)
    for k, line in enumerate(lines_of(picture(dataset, "contact_pressure", over="load_ratio"))):
        x, y = np.transpose(points(line))
        assert x[-1] == own[k, -1]
        np.testing.assert_allclose(np.interp(own[k], x, y), values.isel(load_ratio=k))
        np.testing.assert_allclose(y, np.interp(x, own[k], values.isel(load_ratio=k)))


def test_other_places_that_differ_are_named_by_their_fraction() -> None:
    dataset = swept(loads=[0.2, 0.4], frictions=[0.1], laws=["none"])
    weights = xr.DataArray([1.0, 2.0], dims="station")
    dataset["residual_profile"] = dataset["contact_pressure"] * weights
    dataset = dataset.assign_coords(
        station_fraction=("station", [-1.0, 1.0]),
        station=(("load_ratio", "station"), [[-3.0, 3.0], [-4.0, 4.0]]),
    )
    sheet = picture(dataset, "residual_profile", over="load_ratio")
    assert legend_of(sheet) == ["0.2, -1", "0.2, 1", "0.4, -1", "0.4, 1"]
    missing = dataset.drop_vars("station_fraction")
    with pytest.raises(StudyError, match="changes station: these runs have no place in common"):
        picture(missing, "residual_profile", over="load_ratio")


def test_the_resolution_is_that_of_the_file(tmp_path: Path) -> None:
    swept(frictions=[0.0]).to_netcdf(tmp_path / "swept.nc")
    seal(tmp_path / "swept.nc", "dataset swept")
    widths = []
    for resolution in ("50", "300"):
        command = ["plot", str(tmp_path / "swept.nc"), "--field", "increments"]
        command += ["--resolution", resolution, "--out", str(tmp_path / "a.png")]
        assert main(command) == 0
        widths.append(matplotlib.image.imread(tmp_path / "a.png").shape[1])
    assert widths[1] == pytest.approx(6 * widths[0], abs=6)


def test_lines_are_laid_over_each_other_where_another_axis_changes_the_grid() -> None:
    dataset = swept().rename(s="place").drop_vars("place").rename(place="s")
    grids = np.outer(1.0 + np.arange(2), np.arange(5.0))  # by friction
    dataset = dataset.assign_coords(
        s_fraction=("s", np.linspace(0.0, 1.0, 5)), s=(("friction", "s"), grids)
    )
    dataset["map"] = (("load_ratio", "x"), np.ones((3, 2)))  # its grid differs along the axis
    dataset = dataset.assign_coords(x=(("load_ratio", "x"), np.arange(6.0).reshape(3, 2)))
    figure = picture(dataset, "contact_pressure", over="load_ratio")
    assert len(lines_of(figure)) == 3
    assert max(line.get_xdata().max() for line in lines_of(figure)) == grids[-1, -1]
    figure = picture(dataset, "contact_pressure", over="friction")
    assert [line.get_xdata().max() for line in lines_of(figure)] == list(grids[:, -1])


def test_lines_over_an_axis_are_selected_on_grids_that_another_one_moves() -> None:
    dataset = swept(laws=["none"])
    places = np.array([[-6.0, -0.5, 5.0], [-5.0, 0.0, 5.0]])  # by friction, of no common form
    moved = [dataset["contact_pressure"] + 100.0 * k for k in range(3)]
    dataset["profile"] = xr.concat(moved, "station")
    dataset = dataset.assign_coords(station=(("friction", "station"), places))
    chosen = {"friction": 0.1, "station": 0.0}
    figure = picture(dataset, "profile", selection=chosen, over="load_ratio")
    assert len(lines_of(figure)) == 3
    first = lines_of(figure)[0].get_ydata()
    expected = moved[1].isel(load_ratio=0, friction=1, hardening=0).to_numpy()
    np.testing.assert_array_equal(first, expected)


def test_each_value_of_an_axis_has_its_line() -> None:
    dataset = swept(loads=list(np.linspace(0.1, 0.8, 8)), frictions=[0.0], laws=["none"])
    assert len(lines_of(picture(dataset, "contact_pressure", over="load_ratio"))) == 8


def test_one_number_for_each_label_is_drawn_of_the_one_that_is_selected() -> None:
    dataset = swept(frictions=[0.0], laws=["none"])
    parts = dataset["increments"] * xr.DataArray(
        [[1.0, 2.0], [3.0, 4.0]], dims=("body", "component")
    )
    labels = {"body": ["punch", "half_plane"], "component": ["xx", "yy"]}
    dataset["largest"] = parts.assign_coords(labels)

    def drawn(**options: Any) -> list[float]:
        (line,) = lines_of(picture(dataset, "largest", **options))
        return list(np.divide(line.get_ydata(), line.get_xdata()))

    assert drawn() == pytest.approx([1.0] * 3)
    chosen = drawn(component="yy", selection={"body": "half_plane"})
    assert chosen == pytest.approx([4.0] * 3)
    with pytest.raises(StudyError, match="must be one of punch, half_plane"):
        drawn(selection={"body": "rail"})
    with pytest.raises(StudyError, match="bodi = 'rail': must be one of load_ratio"):
        drawn(selection={"bodi": "rail"})
    with pytest.raises(StudyError, match="largest has one value a run: leave it out"):
        drawn(zoom=1.0)


def test_an_axis_whose_points_differ_in_words_too_is_named_by_its_labels() -> None:
    dataset = swept(frictions=[0.1]).rename(hardening="steel")
    dataset = dataset.assign_coords(
        steel=["A", "B"], hardening=("steel", LAWS), hardening_ratio=("steel", [0.02, 0.024])
    )
    assert legend_of(sweep_figure(dataset, "increments")) == ["A", "B"]


@pytest.mark.parametrize("field", ["increments", "shakedown_state"])
def test_a_long_caption_ends_within_the_sheet(field: str) -> None:
    dataset = swept(frictions=[0.1])
    words = {"flag_values": [0, 1], "flag_meanings": "elastic a_state_of_many_words"}
    dataset["shakedown_state"] = (dataset["increments"] > 20.0).astype(int).assign_attrs(words)
    dataset.attrs["parameters"] = json.dumps(
        {"half_width": 43.5, "punch_height": 123.5, "half_plane_size": 512.5, "growth": 2.125,
         "smallest_element": 0.0215, "yield_stress": 512.5}
    )  # fmt: skip
    sheet = sweep_figure(dataset, field)
    sheet.canvas.draw()
    (caption,) = [each for each in sheet.findobj(Text) if "growth" in each.get_text()]
    assert caption.get_window_extent().x1 <= sheet.bbox.x1
