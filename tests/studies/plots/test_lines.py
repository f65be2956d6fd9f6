"""What figures of lines show: enough to read, the rest by selection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from residua.cli import main
from studies import Store, Study, StudyError, open_study
from studies.views.plots.lines import line_figure
from studies.views.plots.picture import picture
from tests.studies.conftest import compute_here
from tests.studies.plots.test_maps import grid_map, texts_of
from tests.studies.rolled import data_set, written


def lines_of(sheet: Figure) -> list[Line2D]:
    """Return the lines of a figure but the one that marks zero."""
    return [line for line in sheet.axes[0].lines if line.get_zorder() > 0.0]


def legend_of(sheet: Figure) -> list[str]:
    legend = sheet.axes[0].get_legend()
    return [text.get_text() for text in legend.get_texts()] if legend else []


def rolled(passes: int) -> xr.Dataset:
    """A study of two cases: one with all passes, one with a single pass."""
    return data_set({"long": passes, "short": 1})


def test_a_pressure_figure_has_a_line_for_each_stage(computed: tuple[Study, Store]) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        sheet = line_figure(together, "contact_pressure")
    assert legend_of(sheet) == ["loaded", "unloaded"]
    assert sheet.axes[0].get_ylabel() == "contact pressure [MPa]"


def test_depth_ends_where_nothing_is_left() -> None:
    depth = np.arange(0.0, 100.0)
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0))
    run = run.assign_coords(depth=("depth", depth, {"units": "mm"}), station=[0.0, 1.0])
    profile = np.stack([np.exp(-depth), 5.0 * np.exp(-depth / 2.0)])
    run["profile"] = (("station", "depth"), profile)
    end = line_figure(run, "profile").axes[0].get_xlim()[1]
    assert np.exp(-end / 2.0) < 0.02 < np.exp(-(end - 1.0) / 2.0)
    assert line_figure(run, "profile", zoom=50.0).axes[0].get_xlim()[1] == 50.0
    run["profile"] = 0.0 * run["profile"]
    assert line_figure(run, "profile").axes[0].get_xlim()[1] == 99.0


def test_a_field_over_one_axis_is_a_line_along_it() -> None:
    """Residual stress at the surface of a rail lies over z."""
    z = np.linspace(-30.0, 30.0, 61)
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0))
    run = run.assign_coords(z=("z", z, {"units": "mm"}), component=["xx", "zz"])
    run["running_surface_residual"] = (("component", "z"), np.stack([z, np.cos(z)]))
    sheet = picture(run, "running_surface_residual", component="zz")
    (line,) = lines_of(sheet)
    np.testing.assert_allclose(np.transpose(line.get_xydata()), [z, np.cos(z)])
    assert sheet.axes[0].get_xlabel() == "$z$ [mm]"
    near = picture(run, "running_surface_residual", zoom=10.0)
    assert near.axes[0].get_xlim() == (-10.0, 10.0)


def test_few_passes_are_told_by_colour_and_stations_by_style() -> None:
    sheet = picture(rolled(2), "residual_profile", selection={"case": "long"})
    lines = lines_of(sheet)
    assert len(lines) == 6
    assert len({str(line.get_color()) for line in lines}) == 2
    assert len({line.get_linestyle() for line in lines}) == 3
    assert len({(str(line.get_color()), line.get_linestyle()) for line in lines}) == 6


def test_of_many_passes_some_are_drawn_first_and_last_included_at_the_middle_station() -> None:
    dataset = rolled(20)
    sheet = picture(dataset, "residual_profile", selection={"case": "long"})
    assert legend_of(sheet) == ["1", "5", "9", "12", "16", "20"]
    assert "station 0" in texts_of(sheet)
    run = dataset["residual_profile"].sel({"case": "long", "component": "xx", "station": 0.0})
    for line, number in zip(lines_of(sheet), (1, 5, 9, 12, 16, 20), strict=True):
        shown = np.asarray(line.get_ydata())
        expected = run.sel({"pass": number}).to_numpy().ravel()
        np.testing.assert_array_equal(shown, expected[: shown.size])
    brightness = [sum(line.get_color()[:3]) for line in lines_of(sheet)]
    assert brightness == sorted(brightness), "a sequence of colours"


def test_the_legend_lies_inside_the_figure_below_the_title() -> None:
    dataset = rolled(4)
    dataset["residual_profile"] *= 1e-15  # a scale of its own stands above the axes
    sheet = picture(dataset, "residual_profile", selection={"case": "long"})
    assert len(legend_of(sheet)) == 12, "the most lines that are drawn"
    sheet.draw_without_rendering()
    box = sheet.axes[0].get_legend().get_window_extent()
    title = sheet.axes[0]._left_title.get_window_extent()
    assert box.x1 <= sheet.bbox.x1
    assert box.y0 >= 0.0
    assert box.y1 <= title.y0
    assert title.y1 <= sheet.axes[0].texts[0].get_window_extent().y0
    assert sheet.axes[0].bbox.width > 0.6 * sheet.bbox.width


def test_passes_that_a_run_has_not_made_take_no_place() -> None:
    sheet = picture(rolled(20), "residual_profile", selection={"case": "short"})
    assert len(lines_of(sheet)) == 3
    assert "pass 1" in texts_of(sheet)


def test_a_field_is_selected_along_its_own_dimensions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset = rolled(20)
    chosen = {"case": "long", "pass": "7", "station": "10"}
    (line,) = lines_of(picture(dataset, "residual_profile", "zz", selection=chosen))
    expected = dataset["residual_profile"].sel(
        {"case": "long", "component": "zz", "pass": 7, "station": 10.0}
    )
    shown = np.asarray(line.get_ydata())
    np.testing.assert_array_equal(shown, expected.to_numpy().ravel()[: shown.size])
    file, out = written(dataset, tmp_path / "a.nc"), tmp_path / "a.png"
    plot = ["plot", str(file), "--out", str(out), "--field", "residual_profile"]
    assert main([*plot, "--select", "case=long", "pass=7", "station=0"]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")
    capsys.readouterr()
    for wrong, named in [
        (["station=5"], "station = '5': must be one of -10.0, 0.0, 10.0"),
        (["pas=5"], "case, element_size, advance_step, passes, pass, station; did you mean pass"),
        (["depth=5"], "depth = '5': must be one of load_ratio"),
        (["case=short", "pass=2"], "field = 'residual_profile': has no value in the run"),
        (["pass=2", "pass=3"], "--select = 'pass=3': pass is given already, as 2"),
    ]:
        assert main([*plot, "--select", *wrong]) == 2
        assert named in capsys.readouterr().err


def test_zoom_of_a_line_is_about_the_centre_of_a_contact_computed_whole() -> None:
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0))
    run["contact_half_width"] = 8.0
    for symmetric, middle in ((0, 0.0), (1, 8.0)):
        one = run.assign_coords(s=np.arange(-20.0, 20.0)).assign_attrs(symmetric=symmetric)
        one["pressure"] = (("s",), np.ones(40))
        limits = line_figure(one, "pressure", zoom=5.0).axes[0].get_xlim()
        assert limits == (middle - 5.0, middle + 5.0)
    one["contact_half_width"] = np.nan
    with pytest.raises(StudyError, match="this run has no contact_half_width"):
        line_figure(one, "pressure", zoom=5.0)


def test_lines_without_values_are_refused() -> None:
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0)).assign_coords(s=[0.0, 1.0])
    run["pressure"] = (("s",), np.full(2, np.nan))
    with pytest.raises(StudyError, match="field = 'pressure': has no value in the run"):
        line_figure(run, "pressure")
    with pytest.raises(StudyError, match="field = 'shear': must be one of pressure"):
        line_figure(run, "shear")


def test_a_course_is_drawn_over_increments_and_has_no_zoom() -> None:
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0))
    run = run.assign_coords(increment=("increment", np.arange(4), {"units": "1"}))
    run["force"] = ("increment", np.array([0.0, 2.0, 3.0, np.nan]), {"units": "N"})
    (line,) = lines_of(line_figure(run, "force"))
    assert np.asarray(line.get_xdata()).tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(StudyError, match="force lies over increment, no length: leave it out"):
        line_figure(run, "force", zoom=1.0)


def test_lines_over_points_have_the_colours_of_a_parameter(store: Store) -> None:
    points = [{"friction": 0.1, "load_ratio": 0.5}, {"friction": 0.3, "load_ratio": 0.4}]
    study = Study.from_dict({"name": "fake", "scene": "fake", "points": points})
    compute_here(study, store)
    with open_study(store.directory) as dataset:
        for over, name, first in (("point", "load ratio", "0.5"), ("friction", "friction", "0.1")):
            legend = picture(dataset, "contact_pressure", over=over).axes[0].get_legend()
            assert legend is not None and legend.get_title().get_text().startswith(name)
            assert legend.get_texts()[0].get_text().startswith(first)
        with pytest.raises(StudyError, match=r"over = 'wear': must be one of .*point.*friction"):
            picture(dataset, "contact_pressure", over="wear")
