"""What a picture of a scene before its computation shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.quiver import Quiver

from residua.cli import main
from solver.mesh import grid
from studies import StudyError
from studies.scenes.registry import beside, scene_named
from studies.scenes.scene import read_scene
from studies.views.plots.acting import outward
from studies.views.plots.setup import setup_figure
from tests.studies.plots.test_many import check_inside

DATA = Path(__file__).parents[3] / "data/scenes"
SCENE = """
name = "block"
summary = "a block under a rigid ball"
kinematics = "plane_strain"
symmetric = true
[parameters.p]
default = 20.0
unit = "MPa"
description = "pressure"
[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = 300
[bodies.block]
material = "steel"
supports = { left = "x", bottom = "xy" }
[bodies.block.shape]
kind = "rectangle"
x = [0.0, 4.0]
y = [0.0, 2.0]
size = 0.5
[rigid.ball]
y = { moved = -0.1 }
[rigid.ball.surfaces.face]
kind = "arc"
centre = [0, 12]
radius = 10
angles = [-90, -80]
edges = 4
[[contacts]]
name = "face"
slave = "block.top"
master = "ball.face"
gap = 0.0
[[loads]]
body = "block"
kind = "pressure"
boundary = "right"
value = "$p"
[[loads]]
body = "block"
kind = "temperature"
rise = 50.0
expansion = 1e-5
[loading]
factor = 1.0
step = 0.1
[results.lines.below]
body = "block"
start = [0.0, 2.0]
end = [0.0, 0.0]
[results.points.corner]
body = "block"
at = [4.0, 0.0]
"""


def legend_of(sheet: Figure) -> list[str]:
    (legend,) = sheet.legends
    return [text.get_text() for text in legend.get_texts()]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "block.toml"
    path.write_text(SCENE)
    return path


def test_it_shows_what_acts_where_and_in_which_direction(file: Path) -> None:
    scene = scene_named("block.toml", beside(file.parent))
    sheet = setup_figure(scene, {"p": 30.0}, window=(-1.0, 5.0, -1.0, 4.0))
    (axes,) = sheet.axes
    assert {"left", "right", "top", "bottom", "ball.face"} == {t.get_text() for t in axes.texts}
    pressure, motion = (
        np.stack([each.U, each.V]) for each in axes.collections if isinstance(each, Quiver)
    )
    np.testing.assert_allclose(pressure / np.abs(pressure).max(), [[-1.0] * 4, [0.0] * 4])
    np.testing.assert_allclose(motion, [[0.0], [-1.0]])
    known = legend_of(sheet)
    told = (
        "pressure block.right: 30 MPa",
        "temperature block: rise 50 K",
        "contact block.top – ball.face",
        "ball: moved y \N{MINUS SIGN}0.1 mm",
        "held: x, y",
        "line below",
        "point corner",
    )
    assert [name for name in told if not any(each.startswith(name) for each in known)] == []
    assert known[0].startswith("block: elastic-plastic, 4 × 2 mm\n32 elements quad8")
    assert "p 30 MPa" in axes.get_title(loc="left")
    red = [each for each in axes.collections if isinstance(each, LineCollection)
           and to_hex(each.get_color()[0]) == "#d62728"]  # fmt: skip
    assert [np.ptp(np.concatenate(each.get_segments()), axis=0).tolist() for each in red] == [
        [4, 0]
    ]
    check_inside(sheet)


def test_outward_normals_point_away_from_a_body() -> None:
    mesh = grid(np.linspace(0.0, 1.0, 3), np.linspace(0.0, 2.0, 4))
    for name, way in (("left", [-1, 0]), ("right", [1, 0]), ("top", [0, 1]), ("bottom", [0, -1])):
        ends, normal = outward(mesh, mesh.boundaries[name])
        length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=0)
        np.testing.assert_allclose(normal, np.outer(way, length), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "values", "bodies"),
    [
        ("punch", {"accuracy": "draft"}, {"punch", "half_plane"}),
        ("rolling", {"accuracy": "draft"}, {"wheel", "half_space"}),
        ("rolling", {"accuracy": "draft", "load": "hertz", "track": 20.0}, {"half_space"}),
        ("raceway", {"accuracy": "draft"}, {"raceway"}),
    ],
)
def test_scenes_of_the_package_are_drawn_whole_and_near(
    name: str, values: dict[str, object], bodies: set[str]
) -> None:
    sheet = setup_figure(scene_named(name), values)
    whole, near = sheet.axes
    assert near.get_xlim()[1] < whole.get_xlim()[1]
    assert bodies <= {text.partition(":")[0] for text in legend_of(sheet)}


def test_the_command_draws_a_scene_or_the_first_run_of_a_study(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, picture = tmp_path / "study.toml", tmp_path / "block.png"
    study.write_text('name = "s"\nscene = "block.toml"\n[sweep]\np = [7.5, 8]\n')
    for what in (file, study):
        assert main(["draw", str(what), "--set", "p=5", "--out", str(picture)]) == 0
        assert picture.read_bytes().startswith(b"\x89PNG")
    mistakes = {
        "friction": ["--set", "friction=1"],
        "p = 'soft'": ["--set", "p=soft"],
        "window": ["--window", "8", "9", "0", "1"],
        "zoom": ["--zoom", "0"],
        "zoom = 1.7e+308": ["--zoom", "1.7e308"],
        "resolution": ["--resolution", "9"],
    }
    for name, given in mistakes.items():
        assert main(["draw", str(file), *given, "--out", str(picture)]) == 2
        assert name in capsys.readouterr().err


def test_a_scene_without_a_model_is_refused() -> None:
    def model(parameters: object) -> NoReturn:
        raise NotImplementedError

    with pytest.raises(StudyError, match="no model to draw"):
        setup_figure(replace(scene_named("punch"), model=model))


def test_a_removal_is_drawn_in_its_region_and_a_panel_is_as_large_as_it_can_be() -> None:
    sheet = setup_figure(scene_named("expansion.toml", beside(DATA)))
    sheet.draw_without_rendering()
    whole, close = sheet.axes
    (skin,) = (each for each in close.collections if each.get_hatch())
    reach = np.vstack([each.vertices for each in skin.get_paths()])[:, 0]
    assert (reach.min(), reach.max()) == pytest.approx((3.0, 3.2))
    assert "removal plate.skin" in legend_of(sheet)
    assert close.get_position().width == pytest.approx(whole.get_position().width, rel=0.1)
    assert "wall: rigid" not in legend_of(setup_figure(scene_named("bending.toml", beside(DATA))))


@pytest.mark.parametrize("name", ["bolt", "expansion"])
def test_names_of_boundaries_do_not_stand_on_one_another(name: str) -> None:
    """Also in a sleeve and in a thin plate, whose names would not fit inside."""
    sheet = setup_figure(scene_named(f"{name}.toml", beside(DATA)))
    sheet.draw_without_rendering()
    for axes in sheet.axes:
        seen = [each for each in axes.texts if axes.viewLim.contains(*each.xy)]
        boxes = [each.get_window_extent() for each in seen]
        assert len(boxes) >= 4
        for k, one in enumerate(boxes):
            assert not any(one.overlaps(other) for other in boxes[:k]), seen[k]


def test_forces_and_motions_have_their_units() -> None:
    told = legend_of(setup_figure(scene_named("bolt.toml", beside(DATA))))
    assert "nut: force y \N{MINUS SIGN}20000 N" in told
    assert "end: moment 6000 N mm" in legend_of(
        setup_figure(scene_named("bending.toml", beside(DATA)))
    )


def test_pairs_on_one_boundary_have_their_own_colours_and_removed_regions_are_hatched(
    tmp_path: Path,
) -> None:
    again = SCENE[SCENE.index("[rigid.ball]") : SCENE.index("[[loads]]")]
    other = again.replace("ball", "roll").replace('name = "face"', 'name = "other"')
    stages = '[[stages]]\nname = "on"\n[[stages]]\nname = "off"\nremove = ["block.skin"]\n'
    text = SCENE.replace("[loading]\nfactor = 1.0\nstep = 0.1\n", other + stages)
    text += "[bodies.block.regions]\nskin = { y = [1.0, 2.0], x = [1.0, 2.0] }\n"
    (tmp_path / "block.toml").write_text(text)
    sheet = setup_figure(beside(tmp_path)("block.toml"))
    (legend,) = sheet.legends
    colours = {
        text.get_text(): to_hex(line.get_color())
        for text, line in zip(legend.get_texts(), legend.legend_handles, strict=True)
        if isinstance(line, Line2D)
    }
    one, two = colours["ball: rigid"], colours["roll: rigid"]
    assert one != two
    assert colours["contact block.top – ball.face"] == one
    assert colours["contact block.top – roll.face"] == two
    axes = sheet.axes[0]
    drawn = [
        {*map(to_hex, each.get_color())}
        for each in axes.collections
        if isinstance(each, LineCollection)
    ]
    assert {one, two} in drawn
    (skin,) = (each for each in axes.collections if each.get_hatch())
    assert len(skin.get_paths()) == 2 * 2
    assert "removal block.skin" in [text.get_text() for text in legend.get_texts()]


def test_each_link_line_and_point_differs_in_the_legend() -> None:
    for name in ("bolt", "pin"):
        sheet = setup_figure(read_scene(DATA / f"{name}.toml"))
        (legend,) = sheet.legends
        drawn = zip(legend.legend_handles, legend.get_texts(), strict=True)
        looks = [
            (line.get_color(), line.get_linestyle(), line.get_marker())
            for line, text in drawn
            if isinstance(line, Line2D) and text.get_text().startswith(("link", "springs", "line "))
        ]
        assert len(looks) > 1 and len({*looks}) == len(looks)


def test_without_a_map_the_close_up_is_where_surfaces_in_contact_are_meshed_finest(
    tmp_path: Path,
) -> None:
    """Not at an end of the other surfaces, whose elements are as short across."""
    shape = SCENE[SCENE.index("kind = ") : SCENE.index("[rigid.ball]")]
    near = "near = [{ at = [10.4, 0.4], size = 0.05, radius = 0.3 }]"
    fillet = (
        'kind = "fillet"\nwide = 15\nnarrow = 10\nradius = 1.5\nlengths = [8, 10]\nsize = 1.0\n'
        f"{near}\n"
    )
    text = SCENE.replace(shape, fillet).replace("centre = [0, 12]", "centre = [11.288, 1.288]")
    text = text.replace("radius = 10\nangles = [-90, -80]", "radius = 1.2\nangles = [180, 270]")
    text = text.replace("block.top", "block.fillet").partition("[results.lines")[0]
    (tmp_path / "block.toml").write_text(text)
    _, close = setup_figure(beside(tmp_path)("block.toml")).axes
    assert close.viewLim.contains(10.44, 0.44), "the middle of the fillet"
    assert close.get_xlim()[1] < 12.5


def test_of_two_fine_ends_the_close_up_is_at_the_one_in_contact(tmp_path: Path) -> None:
    shape = SCENE[SCENE.index("kind = ") : SCENE.index("[rigid.ball]")]
    x = "[{ at = 0, size = 0.1 }, { at = 20, size = 0.1 }]"
    y = "[{ at = -5 }, { at = 0, size = 0.1 }]"
    block = f'kind = "grid"\ngrowth = 1.3\nx = {x}\ny = {y}\n'
    text = SCENE.replace(shape, block).replace("[0, 12]", "[0, 10]").partition("[results.lines")[0]
    (tmp_path / "block.toml").write_text(text)
    _, close = setup_figure(beside(tmp_path)("block.toml")).axes
    assert close.get_xlim()[1] < 10 and close.viewLim.contains(0.1, 0.0)


def test_a_tool_no_larger_than_the_bodies_is_seen_whole_and_its_name_within_the_axes() -> None:
    (axes,) = setup_figure(scene_named("mandrel.toml", beside(DATA))).axes
    axes.figure.draw_without_rendering()
    (arrow,) = (each for each in axes.collections if isinstance(each, Quiver))
    assert axes.viewLim.contains(*arrow.XY[0]) and axes.get_ylim()[0] < -7.0
    (name,) = (each for each in axes.texts if each.get_text() == "mandrel.face")
    assert axes.get_window_extent().contains(*name.get_window_extent().min)
