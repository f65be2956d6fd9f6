"""Pictures of one, a few and many lines: each is drawn, told from the others and explained."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from solver.scenes.scene import Scene
from studies import StudyError
from studies.kinds.fit.figure import fit_figure
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from studies.views.differing import Change, Difference
from studies.views.plots.differing import difference_figure
from studies.views.plots.picture import picture
from studies.views.plots.sensitivity import sensitivity_figure
from studies.views.plots.setup import setup_figure
from tests.studies.plots.test_curves import swept
from tests.studies.plots.test_lines import legend_of, lines_of
from tests.studies.plots.test_maps import grid_map
from tests.studies.rolled import data_set
from tests.studies.test_sensitivity import OF, as_dataset

COUNTS = (1, 5, 13, 40)
FEW_OR_MANY = (1, 5, 40)
"""For pictures that look the same with any number above a dozen or so."""


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


def check_inside(sheet: Figure, share: float = 0.5) -> None:
    """Check that nothing is cut, and that the first axes have a share of the page."""
    sheet.draw_without_rendering()
    ink, size = sheet.get_tightbbox(), sheet.get_size_inches()
    assert min(ink.x0, ink.y0) >= 0.0
    assert (ink.x1 <= size[0], ink.y1 <= size[1]) == (True, True)
    assert sheet.axes[0].bbox.width > share * sheet.bbox.width
    assert sheet.axes[0].bbox.height > share * sheet.bbox.height


@pytest.mark.parametrize("count", FEW_OR_MANY)
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


@pytest.mark.parametrize("count", FEW_OR_MANY[1:])
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


def stack(count: int) -> Scene:
    """A scene of blocks on one another, with as many contact pairs."""
    tables: dict[str, Any] = {
        "name": "stack", "kinematics": "plane_strain",
        "materials": {"steel": {"youngs_modulus": 2e5, "poisson_ratio": 0.3}},
        "bodies": {
            f"block_{k}": {
                "material": "steel",
                "shape": {"kind": "rectangle", "x": [0, 4], "y": [k, k + 1], "size": 1.0},
            }
            for k in range(count + 1)
        },
        "contacts": [
            {"name": f"face_{k}", "slave": f"block_{k + 1}.bottom", "master": f"block_{k}.top"}
            for k in range(count)
        ],
        "stages": [{"name": "on", "increments": 1}],
    }  # fmt: skip
    tables["bodies"]["block_0"]["supports"] = {"bottom": "xy"}
    return file_scene(Description("stack.toml", tables, {}))


@pytest.mark.parametrize("count", FEW_OR_MANY)
def test_the_legend_of_a_scene_names_every_pair(count: int) -> None:
    sheet = setup_figure(stack(count))
    check_inside(sheet, share=0.0)
    (legend,) = sheet.legends
    ink, size = legend.get_window_extent(), sheet.bbox
    assert (ink.x0 >= size.x0, ink.y0 >= size.y0) == (True, True)
    named = [text.get_text() for text in legend.get_texts()]
    assert sum(name.startswith("contact ") for name in named) == count


def fitted(lines: int) -> xr.Dataset:
    """A fit of one parameter to measured lines of three values."""
    line, x = np.repeat(np.arange(lines), 3), np.tile([0.0, 1.0, 2.0], lines)
    along = {name: ("row", values) for name, values in (
        ("line", line), ("place", x), ("measured", x + line), ("measured_sigma", 0 * x + 1.0),
        ("fitted", x + line + 0.1),
    )}  # fmt: skip
    told = {"of": "contact_pressure", "over": "s", "at": "stage = loaded", "unit": "MPa"}
    of_lines = {f"line_{name}": ("lines", [word] * lines) for name, word in told.items()}
    found = {"parameter": ("parameter", ["friction"]), "friction": 0.3, "friction_sigma": 0.01}
    return xr.Dataset(along | of_lines | found, attrs={"title": "of many"})


def indices(count: int) -> tuple[xr.Dataset, xr.Dataset]:
    """Runs over parameters, and indices of sensitivity to them."""
    random = np.random.default_rng(count)
    dataset = as_dataset(random.random((9, count)), random.random(9))
    columns = {kind: random.random(count) for kind in ("first", "total")}
    effect = np.sort(random.random((count, 5)), axis=1)
    found = {name: ("parameter", values) for name, values in columns.items()} | {
        name: (("parameter", "share"), values)
        for name, values in (("effect", effect), ("place", effect))
    }
    names = [f"p{k}" for k in range(count)]
    told = {"method": "chaos", "of": OF, "runs": 9, "q2": 0.9}
    return dataset, xr.Dataset(found, coords={"parameter": names}, attrs=told)


@pytest.mark.parametrize("count", COUNTS[:-1])
def test_each_measured_line_and_each_parameter_has_its_panels(count: int) -> None:
    """Beside one another as many as a page has room for."""
    for sheet, shown in (
        (fit_figure(fitted(count)), 2 * count),
        (sensitivity_figure(*indices(count)), 2 + count),
    ):
        drawn = [axes for axes in sheet.get_axes() if axes.axison]
        assert len(drawn) == shown
        assert all(axes.has_data() for axes in drawn)
        assert sheet.get_size_inches()[0] < 20.0
        if count == 5:  # more than one row; to lay out more panels takes seconds
            check_inside(sheet, share=0.0)


@pytest.mark.parametrize("count", FEW_OR_MANY)
def test_the_variables_that_changed_most_have_bars(count: int) -> None:
    names = [f"largest_residual_stress_{k}" for k in range(count)]
    both = {name: (np.arange(3.0), np.arange(3.0) + 1.0) for name in names}
    changes = [
        Change(name, "MPa", 1.0, 10.0**-k, 1.0, 2.0, {}, {}, 3) for k, name in enumerate(names)
    ]
    sheet = difference_figure(
        Difference(names=("before", "after"), common=3, only=([], []), statuses=[],
                   changes=changes, unlike={}, unknown={}, pairs=both)
    )  # fmt: skip
    bars = sheet.axes[0]
    assert len(bars.patches) == min(count, 14)
    assert (f"of {count} variables" in bars.get_xlabel()) == (count > 14)
    check_inside(sheet, share=0.0)
