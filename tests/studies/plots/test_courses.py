"""Lines over increments and stages: ends of stages, loops, and the part in which they lie."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from studies import StudyError
from studies.views.plots.fields import placed
from studies.views.plots.lines import _other
from studies.views.plots.picture import picture
from studies.views.shown import outline
from tests.studies.plots.test_curves import swept
from tests.studies.plots.test_lines import legend_of, lines_of
from tests.studies.plots.test_many import COUNTS, check_inside

SWEEP = ("load_ratio", "friction", "hardening")


def course(stages: int, parts: int = 1) -> xr.Dataset:
    """A run with a force and a motion over increments, four in each stage."""
    run = swept([0.5], [0.1], ["none"])
    time = np.arange(4 * stages + 1) / 4.0
    names = [f"stage_{number}" for number in range(stages)]
    part = [f"part_{number}" for number in range(parts)]
    run = run.assign_coords(increment=np.arange(len(time)), stage=names, part=part)
    force, motion = np.sin(time), 0.1 * np.sin(time - 0.3)
    share = np.arange(1.0, parts + 1.0)[:, None] / parts
    run["increment_time"] = ((*SWEEP, "increment"), time[None, None, None])
    run["force"] = ((*SWEEP, "increment"), force[None, None, None], {"units": "N"})
    moved = (share * motion)[None, None, None]
    run["motion"] = ((*SWEEP, "part", "increment"), moved, {"units": "mm", "long_name": "motion"})
    return run


def ends_of(sheet: Figure) -> list[str]:
    return [text.get_text() for text in sheet.axes[0].texts if text.get_text().startswith("stage_")]


@pytest.mark.parametrize("count", COUNTS)
def test_ends_of_stages_are_marked_unless_they_are_too_many(count: int) -> None:
    sheet = picture(course(count), "force")
    assert ends_of(sheet) == ([f"stage_{k}" for k in range(count)] if count <= 12 else [])
    marks = [line for line in lines_of(sheet) if line.get_marker() == "o"]
    for number, mark in enumerate(marks, start=1):
        assert mark.get_xdata()[0] == 4 * number
        assert mark.get_ydata()[0] == np.sin(number)
    check_inside(sheet)


def test_ends_of_stages_are_marked_on_the_lines_of_several_runs() -> None:
    run = course(2)
    other = run.assign_coords(friction=[0.2])
    other["force"] = 2.0 * other["force"]
    both = xr.concat([run, other], "friction", join="outer")
    sheet = picture(both, "force", over="friction")
    marks = [line for line in lines_of(sheet) if line.get_marker() == "o"]
    found = sorted(float(mark.get_ydata()[0]) for mark in marks)
    assert found == sorted([k * np.sin(end) for k in (1, 2) for end in (1.0, 2.0)])


@pytest.mark.parametrize("parts", COUNTS)
def test_a_force_over_a_displacement_is_a_loop(parts: int) -> None:
    run = course(5, parts)
    sheet = picture(run, "force", against="motion")
    (loop,) = (line for line in lines_of(sheet) if line.get_marker() != "o")
    np.testing.assert_allclose(loop.get_ydata(), run["force"].squeeze())
    np.testing.assert_allclose(loop.get_xdata(), run["motion"].squeeze(SWEEP)[-1])
    assert sheet.axes[0].get_xlabel() == f"motion (part_{parts - 1}) [mm]"
    assert ends_of(sheet)[-1] == "stage_4"
    check_inside(sheet)


def test_a_force_of_contact_lies_over_the_motion_of_its_own_body() -> None:
    run = course(2, 3).assign_coords(contact=["first", "second"])
    run["force"] = run["force"].expand_dims(contact=run["contact"], axis=3)
    contacts = [
        {"name": name, "slave": "block.top", "master": f"part_{k}.cap"}
        for name, k in (("second", 0), ("first", 1))
    ]
    known = run.assign_attrs(scene_file=json.dumps({"contacts": contacts}))
    motion = run["motion"].squeeze(SWEEP)
    over = _other(known, run["force"], "motion")
    np.testing.assert_array_equal(over.squeeze(SWEEP), motion[[1, 0]])
    assert over.attrs["long_name"] == "motion (part_1, part_0)"
    sheet = picture(run, "force", against="motion", selection={"part": "part_1"})
    loops = [line for line in lines_of(sheet) if line.get_marker() != "o"]
    for loop in loops:
        np.testing.assert_array_equal(loop.get_xdata(), motion[1])
    assert len(loops) == 2
    with pytest.raises(StudyError, match="part = 'one': must be one of"):
        picture(run, "force", against="motion", selection={"part": "one"})


def test_a_force_of_each_body_lies_over_the_motion_of_the_same_body() -> None:
    run = course(2, 2)
    run["reaction"] = run["motion"].copy(data=np.cos(run["motion"])).assign_attrs(units="N")
    sheet = picture(run, "reaction", against="motion")
    for loop in (line for line in lines_of(sheet) if line.get_marker() != "o"):
        np.testing.assert_allclose(loop.get_ydata(), np.cos(loop.get_xdata()))
    assert sheet.axes[0].get_xlabel() == "motion [mm]"
    assert legend_of(sheet) == ["part 0", "part 1"]


def cycled() -> xr.Dataset:
    """A study of two runs with three cycles and with two."""
    run = course(1).assign_coords(cycle=[1, 2, 3])
    run["cycle_work"] = ((*SWEEP, "cycle"), np.array([[[[5.0, 3.0, 2.0]]]]), {"units": "N mm"})
    other = run.assign_coords(friction=[0.2])
    other["cycle_work"] = other["cycle_work"] * [2.0, 2.0, np.nan]
    return xr.concat([run, other], "friction", join="outer")


def test_a_number_of_cycles_is_a_line_of_one_run_and_the_last_cycle_of_several() -> None:
    both = cycled()
    sheet = picture(both, "cycle_work", selection={"friction": 0.1})
    (line,) = (each for each in lines_of(sheet) if each.get_marker() == "o")
    assert line.get_xdata().tolist() == [1, 2, 3]
    assert line.get_ydata().tolist() == [5.0, 3.0, 2.0]
    sheet = picture(both, "cycle_work", over="friction")
    assert [line.get_ydata().tolist() for line in lines_of(sheet) if line.get_marker() == "o"] == [
        [5.0, 3.0, 2.0], [10.0, 6.0],
    ]  # fmt: skip
    (dots,) = picture(both, "cycle_work").axes[0].lines
    assert dots.get_ydata().tolist() == [2.0, 6.0]
    (dots,) = picture(both, "cycle_work", selection={"cycle": 1}).axes[0].lines
    assert dots.get_ydata().tolist() == [5.0, 10.0]


def test_contact_lies_over_x_where_its_slave_does() -> None:
    x = np.linspace(3.0, 1.0, 5)  # the slave begins at its right end
    run = xr.Dataset(coords={"contact": ["face"]})
    dims = ("contact", "fraction")
    run["contact_pressure"] = (dims, np.arange(5.0)[None])
    run = run.assign(contact_x=(dims, x[None]), contact_s=(dims, 3.0 - x[None]))
    for y, at in ((np.zeros(5), x), (0.1 * x, 3.0 - x)):
        of = placed(run["contact_pressure"], run.assign(contact_y=(dims, y[None])))
        np.testing.assert_array_equal(of["distance"].squeeze(), at)


def touching(stages: int, pairs: int = 1, *, released: bool) -> xr.Dataset:
    """A run with the pressure of pairs along contacts 20 mm long, of which 2 mm touch."""
    run = swept([0.5], [0.1], ["none"])
    s = np.linspace(-10.0, 10.0, 201)
    size = np.arange(1.0, stages + 1.0)
    if released:
        size[-1] = 0.0
    pressure = np.sqrt(np.maximum(1.0 - s**2, 0.0)) * size[:, None]
    run = run.drop_dims("s").assign_coords(
        s=("s", s, {"units": "mm"}),
        stage=[f"stage_{k}" for k in range(stages)],
        contact=[f"pair_{k}" for k in range(pairs)],
    )
    both = np.repeat(pressure[None], pairs, axis=0)
    dims = (*SWEEP, "contact", "stage", "s")
    run["contact_pressure"] = (dims, both[None, None, None], {"units": "MPa"})
    return run.assign(plastic_strain=0.0) if released else run


@pytest.mark.parametrize("count", COUNTS)
def test_the_axis_ends_where_nothing_happens(count: int) -> None:
    sheet = picture(touching(count, released=False), "contact_pressure")
    low, high = sheet.axes[0].get_xlim()
    assert -2.0 < low < -1.0 < 1.0 < high < 2.0
    assert sheet.axes[0].get_xlabel() == "distance from the middle $s$ [mm]"
    wide = picture(touching(count, released=False), "contact_pressure", zoom=8.0)
    assert wide.axes[0].get_xlim() == pytest.approx((-8.0, 8.0))
    part = picture(
        touching(count, released=False), "contact_pressure", window=(-0.5, 0.5, 0.0, 2.0)
    )
    assert (part.axes[0].get_xlim(), part.axes[0].get_ylim()) == ((-0.5, 0.5), (0.0, 2.0))
    check_inside(part)


def test_without_a_stage_the_last_one_under_load_is_drawn_and_named() -> None:
    for released, last in ((True, 4), (False, 5)):
        run = touching(6, pairs=5, released=released)
        sheet = picture(run, "contact_pressure")
        assert len(lines_of(sheet)) == 5
        assert float(np.max(lines_of(sheet)[0].get_ydata())) == last + 1.0
        assert f"stage\N{NO-BREAK SPACE}stage_{last}".replace("_", "\N{NO-BREAK SPACE}") in (
            sheet.axes[0].get_title(loc="left")
        )


@pytest.mark.parametrize("count", COUNTS)
def test_lines_over_a_dimension_of_the_field_have_one_value_of_others(count: int) -> None:
    stages = picture(touching(count, pairs=3, released=False), "contact_pressure", over="stage")
    shown = min(count, 6)
    assert len(lines_of(stages)) == shown
    assert "pair" in stages.axes[0].get_title(loc="left")
    pairs = picture(touching(3, pairs=count, released=False), "contact_pressure", over="contact")
    assert len(lines_of(pairs)) == min(count, 6)
    if count > 1:
        assert legend_of(pairs)[0] == "pair 0"


def test_what_cannot_be_drawn_is_refused() -> None:
    run = course(3)
    for given, told in (
        ({"against": "moton"}, "against = 'moton': .* did you mean motion"),
        ({"zoom": 1.0}, "zoom = 1.0"),
        ({"window": (1.0, 0.0, 0.0, 1.0)}, "window = "),
        ({"over": "stages"}, "over = 'stages'"),
        ({"over": "pas", "field": "motion"}, "load_ratio, friction, hardening, part"),
    ):
        with pytest.raises(StudyError, match=told):
            picture(run, **{"field": "force", **given})
    with pytest.raises(StudyError, match="does not lie over increments"):
        picture(touching(2, released=False), "contact_pressure", against="force")


def test_stress_is_the_first_line_and_rounding_the_last() -> None:
    run = course(1)
    for name, size, units in (("gap", 1e-15, "mm"), ("mises", 1.0, "MPa"), ("stress", 9.0, "MPa")):
        run[f"line_{name}"] = ((*SWEEP, "increment"), size * run["force"].data, {"units": units})
    names = [each["name"] for each in outline(run.squeeze(SWEEP))["lines"]]
    assert names[0] == "line_stress" and names[-1] == "line_gap"
