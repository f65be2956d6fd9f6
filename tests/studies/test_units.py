"""Numbers that are written with a unit."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from studies import Study, StudyError
from studies.definition.parameters import parameters_of, read_values
from studies.errors import SceneError
from studies.kinds.fit.fitting import Fit
from studies.kinds.goal.search import Goal
from studies.kinds.refine.refinement import Refine
from studies.scenes.description import Description
from studies.scenes.registry import scene_named
from studies.units import LONGEST, UnitError, converted, is_quantity
from tests.studies.conftest import fake_study
from tests.studies.scenes.conftest import blocks, built
from tests.studies.scenes.mistakes import put

INCH, POUND, GRAVITY = 25.4, 0.45359237, 9.80665


@pytest.mark.parametrize(
    ("text", "unit", "number"),
    [
        ("195 GPa", "MPa", 195000),
        ("0.0123 m", "mm", 12.3),
        ("-2in", "mm", -2 * INCH),
        (" 1e-3 kN ", "N", 1),
        ("30 ksi", "MPa", 30e3 * POUND * GRAVITY / INCH**2),
        ("7850 kg/m^3", "t/mm3", 7.85e-9),
        ("7850 kg m-3", "t/mm^3", 7.85e-9),
        ("0.2 kN/mm²", "MPa", 200),
        ("3 N·m", "N mm", 3000),
        ("12 1/K", "1/K", 12),
        ("12e-6/degC", "1/K", 12e-6),
        ("30 deg", "rad", math.pi / 6),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("5 %", "1", 0.05),
        ("1 µm", "mm", 0.001),
    ],
)
def test_a_number_is_as_if_typed_in_the_other_unit(text: str, unit: str, number: float) -> None:
    found = converted(text, unit)
    assert found == pytest.approx(number, rel=4e-16, abs=0.0), "rounded once"
    assert isinstance(found, int) == float(number).is_integer()


@pytest.mark.parametrize(
    ("text", "unit", "why"),
    [
        ("3 mm", "1", "mm is a length"),
        ("3 MPa", "N", "MPa is a stress"),
        ("30 deg", "1", "deg is an angle"),
        ("50 Hz", "rad/s", "Hz is a frequency"),
        ("20 degC", "K", "degC has a zero of its own"),
        ("3 dB", "1", "dB has a zero of its own"),
        ("3 furlongs^9", "mm", "is something else"),
        ("3 lines", "mm", "lines is no known unit"),
        ("3 nan", "mm", "nan is no known unit"),
        ("3 1/neper", "mm", "1/neper is no known unit"),
        ("3 mm", "rows", "its own unit cannot be converted: rows is no known unit"),
        ("1e999 km", "mm", "is not finite"),
    ],
)
def test_another_dimension_is_refused(text: str, unit: str, why: str) -> None:
    assert is_quantity(text)
    with pytest.raises(UnitError, match=why):
        converted(text, unit)


@pytest.mark.parametrize(
    "text",
    [
        "60e1", "3e2*x", "2*$radius mm", "3 mm^99", "1e999 km**99**99", "2 km^9^9", "1e9999 mm",
        "3 (mm)", "3 mm.__class__", "mm", "", "3 __import__('os')", "3 mm\n4 mm",
        "9" * LONGEST + " mm", "3 " + "m" * 100_000, "9" * 100_000, "3" + " " * 100_000 + "m",
    ],
)  # fmt: skip
def test_other_texts_are_no_numbers_with_a_unit(text: str) -> None:
    assert not is_quantity(text)
    with pytest.raises(UnitError, match=f"at most {LONGEST} characters"):
        converted(text, "mm")


def test_ids_are_those_of_the_numbers_in_the_units_of_the_parameters() -> None:
    plain = fake_study(sweep={"half_width": [10.0, 50.8]}, friction=0.05)
    units = fake_study(sweep={"half_width": ["1 cm", "2 in"]}, friction="5 %")
    assert (units.id, [*units.run_ids()]) == (plain.id, [*plain.run_ids()])
    ends = {"start": 10.0, "stop": 50.8, "num": 3}
    plain = fake_study(sweep={"half_width": ends})
    assert fake_study(sweep={"half_width": ends | {"stop": "2 in"}}).id == plain.id


def with_points(**content: Any) -> Study:
    return Study.from_dict({"name": "points", "scene": "fake", **content})


def test_points_and_samples_have_units_in_cells_headings_and_ranges() -> None:
    plain = with_points(points=[{"half_width": 10.0}, {"half_width": 50.8}])
    cells = with_points(points=[{"half_width": "1 cm"}, {"half_width": "2 in"}])
    heads = with_points(points=[{"half_width [cm]": "1"}, {"half_width [in]": 2}])
    assert plain.id == cells.id == heads.id
    sample: dict[str, Any] = {"method": "halton", "num": 3}
    ranges = [{"half_width": each} for each in ([10.0, 50.8], ["1 cm", "2 in"])]
    drawn = [with_points(sample=sample | {"ranges": each}).id for each in ranges]
    assert drawn[0] == drawn[1]


def test_a_wrong_unit_of_a_study_is_one_error_with_what_is_allowed() -> None:
    with pytest.raises(StudyError) as caught:
        fake_study(sweep={"half_width": [10.0]}, friction="3 mm")
    told = "parameters.friction = '3 mm': must be a finite number >= 0 and <= 1; mm is a length"
    assert str(caught.value) == told


def test_words_stay_words_and_the_command_takes_units() -> None:
    scene = scene_named("wheel_rail")
    found = read_values(scene, {"rail_profile": "60e1", "yaw": "0.1 deg", "load": "80 kN"})
    assert found == {"rail_profile": "60e1", "yaw": math.radians(0.1), "load": 80000.0}
    assert {type(each) for each in found.values()} == {str, float}
    span = parameters_of(scene)["span"]
    assert (span.read("endless", ""), span.read("2 m", "")) == ("endless", 2000.0)
    with pytest.raises(StudyError, match=r"must be .*endless.*; N is a force"):
        span.read("2 N", "")


@pytest.mark.parametrize(
    ("where", "units", "plain"),
    [
        ("materials.steel.youngs_modulus", "200 GPa", 200000),
        ("bodies.upper.shape.x", [0, "1.5 in"], [0, 38.1]),
        ("parameters.wide.default", "0.4 cm", 4),
        ("parameters.wide.range", ["1 mm", 100], [1, 100]),
        ("links", [{"stiffness": "2 kN/mm^3"}], [{"stiffness": 2000}]),
        (
            "rigid",
            {"tool": {"y": {"pushed": "-2 kN"}, "rotation": {"pushed": "1 N m", "moved": "1 deg"}}},
            {"tool": {"y": {"pushed": -2000}, "rotation": {"pushed": 1000, "moved": 1}}},
        ),
        (
            "loads",
            [{"kind": "temperature", "rise": "80 K", "expansion": "12 1/MK"}],
            [{"kind": "temperature", "rise": 80, "expansion": 12e-6}],
        ),
        (
            "loads",
            [{"kind": "gravity", "density": "7.85 g/cm3", "y": "-9.80665 m/s2"}],
            [{"kind": "gravity", "density": 7.85e-9, "y": -9806.65}],
        ),
        (
            "results.map",
            {"x": [{"start": "1 cm", "stop": 11, "num": 2}, "2 in"]},
            {"x": [{"start": 10, "stop": 11, "num": 2}, 50.8]},
        ),
        ("outputs.least.x", ["-1 in", 0], [-25.4, 0]),
        ("derived.side", "1 in", 25.4),
        ("derived.side", "195 GPa", 195000),
        ("derived.side", "3 kN m", 3000000),
    ],
)
def test_a_scene_file_with_units_has_the_id_of_that_without(
    where: str, units: Any, plain: Any
) -> None:
    found = []
    for value in (units, plain):
        content = blocks()
        put(*where.split("."), value)(content)
        found.append(Description("blocks.toml", content, {}))
    assert found[0].content == found[1].content
    assert found[0].digest == found[1].digest


@pytest.mark.parametrize(
    ("text", "why"), [("30 deg", "deg is an angle"), ("3 candela", "candela is something else")]
)
def test_a_derived_number_has_a_unit_of_the_project(text: str, why: str) -> None:
    content = blocks()
    content["derived"]["side"] = text
    with pytest.raises(SceneError, match=rf"derived\.side = '{text}'.* N, mm, MPa.*; {why}"):
        built(content)


@pytest.mark.parametrize("text", ["3/h", "3 N h", "2 /h"])
def test_a_unit_that_is_the_name_of_a_parameter_is_refused(text: str) -> None:
    content = blocks()
    content["parameters"]["h"] = {"default": 2.0, "unit": "mm", "description": "height"}
    content["derived"]["side"] = text
    with pytest.raises(SceneError, match=rf"derived\.side = '{text}'.*write \$h if it is meant"):
        built(content)
    content["derived"]["side"] = "1 in"
    assert Description("blocks.toml", content, {}).content["derived"]["side"] == 25.4


PUNCH = scene_named("punch")
BOUNDS = {"yield_stress": [200.0, 600.0]}


def test_what_chooses_runs_has_units_of_the_numbers_that_it_compares() -> None:
    goal = {"of": "peak_residual_tension", "between": [0.1, 0.9]}
    found = [Goal.read(goal | {"at": each}, PUNCH, {}) for each in (1500, "1.5 GPa")]
    assert found[0] == found[1]
    refine = {"of": ["peak_residual_tension", "contact_half_width"]}
    axes: Any = {"load_ratio": [0.5, 0.9]}
    until = {"peak_residual_tension": 5.0, "contact_half_width": 0.0254}, {
        "peak_residual_tension": "0.005 GPa", "contact_half_width": "0.001 in",
    }  # fmt: skip
    refined = [Refine.read(refine | {"until": each}, PUNCH, axes) for each in until]
    assert refined[0] == refined[1]
    line = {"of": "residual_profile", "over": "depth", "places": [0, 25.4], "values": [-50, 20],
            "sigma": 2.0, "at": {"component": "xx"}}  # fmt: skip
    units = {"places": [0, "1 in"], "values": [-50, "0.02 GPa"], "sigma": "2e6 Pa"}
    fits = [
        Fit.read({"measured": [each], "ranges": BOUNDS}, PUNCH, {}) for each in (line, line | units)
    ]
    assert fits[0] == fits[1]


@pytest.mark.parametrize(
    ("check", "told"),
    [
        (
            lambda: Goal.read(
                {"of": "peak_residual_tension", "at": "3 mm", "between": [0.1, 0.9]}, PUNCH, {}
            ),
            "at = '3 mm': must be a number in MPa; mm is a length",
        ),
        (
            lambda: Refine.read(
                {"of": "contact_half_width", "until": {"contact_half_width": "1 N"}}, PUNCH,
                {"load_ratio": [0.5, 0.9]},
            ),
            "until.contact_half_width = '1 N': must be a number in mm; N is a force",
        ),
        (
            lambda: Fit.read(
                {"measured": [{"of": "residual_profile", "over": "depth", "places": ["1 s", 2],
                  "values": [1, 2], "at": {}}], "ranges": BOUNDS}, PUNCH, {},
            ),
            "measured[0].places[0] = '1 s': must be a number in mm; s is a time",
        ),
    ],
)  # fmt: skip
def test_another_dimension_of_a_number_that_is_compared_is_refused(
    check: Callable[[], Any], told: str
) -> None:
    with pytest.raises(StudyError) as caught:
        check()
    assert str(caught.value) == told


@pytest.mark.processes
def test_only_a_text_with_a_unit_loads_pint() -> None:
    program = (
        "import sys\n"
        "from residua.cli import main\n"
        "from studies.scenes.registry import scene_named\n"
        "scene_named('wheel_rail')\n"
        "main(['scenes'])\n"
        "assert 'pint' not in sys.modules\n"
        "from studies.units import converted\n"
        "assert converted('1 m', 'mm') == 1000 and 'pint' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, stdout=subprocess.DEVNULL)
