"""Pictures of one, a few and many lines: each is drawn, told from the others and explained."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from studies import StudyError
from studies.views.plots.picture import picture
from tests.studies.plots.test_curves import swept
from tests.studies.plots.test_lines import legend_of, lines_of
from tests.studies.plots.test_maps import grid_map
from tests.studies.rolled import data_set

COUNTS = (1, 2, 5, 13, 40)


def along_lines(*, loads: int = 1, lines: int = 1, stages: int = 1) -> xr.Dataset:
    """Runs over load with stress along lines of the bodies, in stages."""
    dataset = swept(list(np.linspace(0.1, 4.0, loads)), [0.1], ["none"])
    fraction = np.linspace(0.0, 1.0, 30)
    size = np.arange(1.0, loads * lines * stages + 1.0).reshape(loads, 1, 1, lines, stages, 1)
    dims = ("load_ratio", "friction", "hardening", "line", "stage", "fraction")
    dataset["line_stress"] = (dims, size * np.sin(6.0 * fraction), {"units": "MPa"})
    return dataset.assign_coords(
        fraction=fraction,
        line=[f"below_the_edge_{number}" for number in range(lines)],
        stage=[f"cycle_{number}" for number in range(stages)],
    )


def told_apart(sheet: Figure) -> set[tuple[object, str]]:
    return {(to_rgba(line.get_color()), line.get_linestyle()) for line in lines_of(sheet)}


def check_inside(sheet: Figure) -> None:
    """Check that nothing is cut, and that the axes are what is seen."""
    sheet.draw_without_rendering()
    ink, size = sheet.get_tightbbox(), sheet.get_size_inches()
    assert min(ink.x0, ink.y0) >= 0.0
    assert (ink.x1 <= size[0], ink.y1 <= size[1]) == (True, True)
    assert sheet.axes[0].bbox.width > 0.5 * sheet.bbox.width
    assert sheet.axes[0].bbox.height > 0.5 * sheet.bbox.height


@pytest.mark.parametrize("count", COUNTS)
def test_labels_of_a_field_have_lines_of_their_own_or_some_of_them_have(count: int) -> None:
    for dataset, name in (
        (along_lines(stages=count), "stage"),
        (along_lines(lines=count), "line"),
    ):
        sheet = picture(dataset, "line_stress")
        shown = min(count, 6)
        assert len(told_apart(sheet)) == len(lines_of(sheet)) == shown
        assert len(legend_of(sheet)) == (shown if count > 1 else 0)
        check_inside(sheet)
        if count > 6:
            assert sheet.axes[0].get_legend().get_title().get_text() == f"{name} (6 of {count})"


@pytest.mark.parametrize("count", COUNTS)
def test_values_of_a_swept_number_have_colours_in_their_order(count: int) -> None:
    dataset = along_lines(loads=count).isel(load_ratio=slice(None, None, -1))
    sheet = picture(dataset, "line_stress", over="load_ratio")
    lines = lines_of(sheet)
    assert len(lines) == count
    assert len(told_apart(sheet)) == count
    lines.sort(key=lambda line: float(np.max(line.get_ydata())))
    brightness = [sum(to_rgba(line.get_color())[:3]) for line in lines]
    assert brightness == sorted(brightness)
    check_inside(sheet)
    if count > 12:
        (_, bar) = sheet.axes
        assert bar.get_xlabel() == "Load ratio"
        named = [text.get_text() for text in bar.get_xticklabels()]
        assert (named[0], named[-1]) == ("0.1", "4")
        assert legend_of(sheet) == []


def test_styles_tell_stages_apart_where_a_bar_explains_colours() -> None:
    sheet = picture(along_lines(loads=13, stages=3), "line_stress", over="load_ratio")
    assert len(told_apart(sheet)) == len(lines_of(sheet)) == 39
    assert legend_of(sheet) == ["cycle 0", "cycle 1", "cycle 2"]
    (colour,) = {to_rgba(line.get_color()) for line in sheet.axes[0].get_legend().get_lines()}
    assert colour[0] == colour[1] == colour[2], "grey, as dashes stand for lines of every colour"
    check_inside(sheet)


@pytest.mark.parametrize("count", COUNTS)
def test_labels_of_an_axis_have_lines_until_they_cannot_be_told_apart(count: int) -> None:
    laws = [f"law_{number}" for number in range(count)]
    dataset = swept([0.2], [0.1], laws)
    if count > 12:
        with pytest.raises(StudyError, match=f"{count} values, of which 12 can be distinguished"):
            picture(dataset, "contact_pressure", over="hardening")
    else:
        sheet = picture(dataset, "contact_pressure", over="hardening")
        assert len(told_apart(sheet)) == count
        check_inside(sheet)


def test_profiles_of_rolling_lie_over_the_axis_that_changes_them() -> None:
    dataset = data_set({"A": 2}, frictions=np.linspace(0.1, 0.5, 5))
    sheet = picture(dataset, "residual_profile", over="friction")
    assert len(told_apart(sheet)) == len(lines_of(sheet)) == 10
    assert len(legend_of(sheet)) == 10
    check_inside(sheet)


@pytest.mark.parametrize("count", COUNTS)
def test_curves_are_told_apart_or_a_selection_is_asked_for(count: int) -> None:
    laws = [f"law_{number}" for number in range(count)]
    dataset = swept([0.2, 0.4], [0.1], laws)
    if count > 12:
        with pytest.raises(StudyError, match=f"{count} curves, at most 12"):
            picture(dataset, "increments")
    else:
        sheet = picture(dataset, "increments")
        looks = {(line.get_color(), line.get_marker()) for line in lines_of(sheet)}
        assert len(looks) == count
        assert len(legend_of(sheet)) == (count if count > 1 else 0)
        check_inside(sheet)


@pytest.mark.parametrize("count", COUNTS[1:])
def test_labels_across_do_not_lie_over_each_other(count: int) -> None:
    sheet = picture(swept([0.2], [0.1], [f"law_{n}" for n in range(count)]), "increments")
    check_inside(sheet)
    boxes = [text.get_window_extent() for text in sheet.axes[0].get_xticklabels()]
    assert len(boxes) == count
    assert all(left.x1 <= right.x0 for left, right in pairwise(boxes))


@pytest.mark.parametrize("count", COUNTS[1:])
@pytest.mark.parametrize("field", ["increments", "status"])
def test_two_numbers_are_drawn_over_each_other(count: int, field: str) -> None:
    numbers = list(np.linspace(0.1, 0.5, count))
    for across in (numbers, [0.1, 0.2]):
        sheet = picture(swept(numbers, across, ["none"]), field)
        clouds = [c for c in sheet.axes[0].collections if isinstance(c, PathCollection)]
        places = sum(len(cloud.get_offsets()) for cloud in clouds)
        marks = sum(line.get_xdata().size for line in sheet.axes[0].lines)
        assert places + marks == count * len(across)
        sheet.draw_without_rendering()
        assert sheet.get_tightbbox().x1 <= sheet.get_figwidth()


@pytest.mark.parametrize("count", COUNTS)
def test_a_map_is_that_of_the_last_stage(count: int) -> None:
    run = grid_map(np.arange(1.0, 4.0), np.arange(-3.0, 0.0))
    values = np.arange(count)[:, None, None] + np.ones((3, 3))
    run["map_stress"] = (("stage", "y", "x"), values, {"units": "MPa"})
    (mesh,) = picture(run, "map_stress").axes[0].collections
    assert np.unique(mesh.get_array().compressed()) == [count]
