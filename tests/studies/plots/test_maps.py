"""What maps show, and which figure suits a field."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.text import Text

from solver.materials.library import named
from solver.shipped import SCENES
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.definition.parameters import parameters_of
from studies.views.plots.captions import setting
from studies.views.plots.lines import line_figure
from studies.views.plots.mapped import whole
from studies.views.plots.maps import map_figure
from studies.views.plots.picture import picture
from studies.views.shown import shown as values_shown
from tests.studies.conftest import compute_here, fake_study

ComputedStudy = tuple[Study, Store]


def mesh_of(sheet: Figure) -> tuple[Axes, QuadMesh]:
    axes = sheet.axes[0]
    (mesh,) = (each for each in axes.collections if isinstance(each, QuadMesh))
    return axes, mesh


def texts_of(sheet: Figure) -> str:
    axes = sheet.axes[0]
    texts = [axes.get_title(loc="left"), *(text.get_text() for text in axes.texts)]
    return " ".join(texts).replace("\N{NO-BREAK SPACE}", " ")


def grid_map(
    x: np.ndarray, y: np.ndarray, component: str | None = None, *, symmetric: bool = False
) -> xr.Dataset:
    """Return a successful run with one map that is different everywhere."""
    values = 1.0 + np.arange(y.size * x.size, dtype=float).reshape(y.size, x.size)
    run = xr.Dataset(
        {"status": "ok", "message": "", "contact_half_width": x.max() / 2},
        coords={"x": ("x", x, {"units": "mm"}), "y": ("y", y, {"units": "mm"})},
        attrs={
            "scene": "fake",
            "parameters": '{"state": "plane_strain"}',
            "symmetric": int(symmetric),
        },
    )
    attributes = {"long_name": "a quantity with a long name", "units": "MPa"}
    if component is None:
        run["quantity"] = (("y", "x"), values, attributes)
    else:
        run = run.assign_coords(component=[component])
        run["quantity"] = (("component", "y", "x"), values[None], attributes)
    return run


def test_a_stress_map_has_zero_in_the_middle_of_its_colours(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        sheet = map_figure(together, "residual_stress", "xx")
    axes, mesh = mesh_of(sheet)
    low, high = mesh.get_clim()
    assert low == -high < 0.0
    assert axes.get_aspect() == 1.0
    assert axes.child_axes[0].get_ylabel() == r"residual stress $\sigma_{xx}$ [MPa]"
    words = texts_of(sheet)
    assert r"Residual stress $\sigma_{xx}$" in words
    assert "load ratio 0.9" in words
    assert "friction 0.4" in words


def test_a_strain_map_begins_at_zero_and_shows_the_values_as_they_are(
    computed: ComputedStudy,
) -> None:
    study, store = computed
    case = next(study.cases())
    with open_netcdf(store.run_path(case.id)) as run:
        _, mesh = mesh_of(map_figure(run, "plastic_strain"))
        values = run["plastic_strain"].squeeze().to_numpy()
    assert mesh.get_clim()[0] == 0.0
    drawn = np.asarray(mesh.get_array())
    np.testing.assert_array_equal(drawn[:, -values.shape[1] :], values)


@pytest.mark.parametrize("first", [0.0, 0.5])
@pytest.mark.parametrize(
    ("component", "sign"), [(None, 1), ("xx", 1), ("yz", 1), ("xy", -1), ("zx", -1)]
)
def test_half_a_body_is_drawn_whole(first: float, component: str | None, sign: int) -> None:
    run = grid_map(first + np.arange(6.0), np.arange(-4.0, 0.0), component, symmetric=True)
    values = run["quantity"].isel(component=0) if component else run["quantity"]
    both = whole(values)
    assert both.sizes["x"] == (12 if first else 11)
    np.testing.assert_array_equal(both["x"], -both["x"][::-1])
    right = both.sel(x=slice(first, None))
    np.testing.assert_array_equal(right, values)
    left = both.sel(x=slice(None, -0.1))
    np.testing.assert_array_equal(left[:, ::-1], sign * both.sel(x=slice(0.1, None)))
    drawn = np.asarray(mesh_of(map_figure(run, "quantity"))[1].get_array())
    np.testing.assert_array_equal(drawn, both)


def test_between_the_halves_of_a_map_that_begins_away_from_their_line_nothing_is_drawn() -> None:
    x = np.array([-1.0, 5.0, 6.0, 7.0])
    values = grid_map(x, np.array([0.0, 1.0]), symmetric=True)["quantity"]
    both = whole(values)
    assert both["x"].to_numpy().tolist() == [-7.0, -6.0, -5.0, -4.0, 4.0, 5.0, 6.0, 7.0]
    assert both.sel(x=[-4.0, 4.0]).isnull().all()
    assert both.sel(x=[-5.0, 5.0]).notnull().all()
    near = whole(grid_map(x - 4.5, np.array([0.0, 1.0]))["quantity"])
    assert near["x"].to_numpy().tolist() == [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5]


def test_a_map_reaches_its_outline_where_the_edges_of_elements_are_chords() -> None:
    """Places between the chord y = 0 and the outline y = 0.3 belong to no element."""
    outline = np.array([[-9.0, 9.0, 9.0, -9.0, -9.0], [-9.0, -9.0, 0.3, 0.3, -9.0]])
    run = grid_map(np.arange(6.0), np.arange(-3.0, 1.5) + 0.25)
    run = run.assign(outline_x=("outline", outline[0]), outline_y=("outline", outline[1]))
    unknown = (run["x"] > 2.0) & (run["y"] < -1.0)  # inside of the body
    chord = (run["y"] > 0.0) & (run["y"] < 0.3)
    beyond = run["y"] > 0.3
    run["quantity"] = run["quantity"].where(~(unknown | chord | beyond))
    drawn = mesh_of(map_figure(run, "quantity"))[1].get_array().filled(np.nan)
    np.testing.assert_array_equal(np.isnan(drawn), unknown.transpose("y", "x"))
    np.testing.assert_array_equal(drawn[3], run["quantity"][2])


def test_a_caption_has_the_accuracy_with_which_a_run_was_computed() -> None:
    words = {"flag_values": [0, 1], "flag_meanings": "draft standard"}
    run = grid_map(np.arange(3.0), np.arange(-2.0, 1.0))
    run.attrs |= {"scene": "wheel_rail", "parameters": '{"accuracy": "draft"}'}
    for stored, told in ((0, "accuracy draft"), (1, "accuracy draft, computed with standard")):
        given = run.assign(computed_accuracy=((), stored, words))
        shown = " ".join(texts_of(map_figure(given, "quantity")).split())
        assert f"{told} A quantity" in shown


def test_a_map_ends_at_the_outlines_of_the_bodies() -> None:
    """A square with a hole, on a grid that meets neither its sides nor those of the hole."""
    square = np.array([[0.0, 4.2, 4.2, 0.0, 0.0], [-4.2, -4.2, 0.0, 0.0, -4.2]])
    hole = np.array([[1.4, 1.4, 2.6, 2.6, 1.4], [-2.6, -1.4, -1.4, -2.6, -2.6]])
    points = np.hstack([square, [[np.nan], [np.nan]], hole])
    run = grid_map(np.arange(6.0), np.arange(-5.0, 1.0), symmetric=True)
    run = run.assign(outline_x=("outline", points[0]), outline_y=("outline", points[1]))
    X, Y = np.meshgrid(run["x"], run["y"])
    inside = (X < 4.2) & (Y > -4.2) & ~((X == 2.0) & (Y == -2.0))
    unknown = (X == 3.0) & (Y == -3.0)  # of a body, not outside of it
    run["quantity"] = run["quantity"].where(inside & ~unknown)
    axes, mesh = mesh_of(map_figure(run, "quantity"))
    drawn = np.asarray(mesh.get_array().filled(np.nan))[:, 5:]
    values = run["quantity"].to_numpy()
    np.testing.assert_array_equal(np.isnan(drawn), unknown)
    np.testing.assert_array_equal(drawn[inside & ~unknown], values[inside & ~unknown])
    assert drawn[2, 5] == values[2, 4]  # beyond the side the value of the nearest place
    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    picture_of = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
    outside = np.round(255 * np.array(to_rgb(axes.get_facecolor())))
    places = [(4.1, -1.0), (-4.1, -1.0), (4.3, -1.0), (2.0, -2.0), (-2.0, -2.0)]
    for k, place in enumerate(places):
        across, up = axes.transData.transform(place).astype(int)
        assert (picture_of[up, across] == outside).all() == (k > 1)
    (lines,) = (each for each in axes.collections if isinstance(each, LineCollection))
    ends = np.vstack(lines.get_segments())
    assert ends[:, 0].min() == -4.2 and ends[:, 0].max() == 4.2
    steps = [np.diff(each, axis=0) for each in lines.get_segments()]
    along = [np.abs(each[:-1, 0]) + np.abs(step[:, 0])
             for each, step in zip(lines.get_segments(), steps, strict=True)]  # fmt: skip
    assert min(each.min() for each in along) > 0.0  # the line of symmetry is no border


def test_a_window_below_the_surface_shows_that_part_alone() -> None:
    run = grid_map(np.arange(9.0), np.arange(-8.0, 1.0), "xx")
    axes, _ = mesh_of(map_figure(run, "quantity", window=(2.0, 6.0, -8.0, -4.0)))
    assert axes.get_ylim() == (-8.0, -4.0)
    assert not axes.lines, "the edge of contact lies outside"


@pytest.mark.parametrize("last", [0.0, 4.0])
def test_the_edges_of_contact_are_seen_where_the_map_ends_at_the_surface(last: float) -> None:
    """They are on screen as in the legend, below the words above the map."""
    y = np.linspace(-8.0, last, 200)  # its highest cell ends 0.03 above
    axes, _ = mesh_of(map_figure(grid_map(np.arange(-8.0, 9.0), y, "xx"), "quantity"))
    (marks,) = axes.lines
    assert marks.get_xdata().tolist() == [-4.0, 4.0]
    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    drawn = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
    point = canvas.figure.dpi / 72.0
    for across, up in axes.transData.transform([(-4.0, 0.0), (4.0, 0.0)]):
        above = int(np.ceil(up + 3.0 * point))
        assert (drawn[above, int(across - point) : int(across + point)] < 40).all()
    title = axes.get_title(loc="left")
    (words,) = (each for each in axes.findobj(Text) if each.get_text() == title)
    assert up + 4.0 * point < words.get_window_extent().y0


def test_of_several_stages_the_last_is_drawn_and_told() -> None:
    run = grid_map(np.arange(3.0), np.arange(2.0), "xx").rename(quantity="map_stress")
    stages = [run["map_stress"], 2.0 * run["map_stress"]]
    run["map_stress"] = xr.concat(stages, "stage").assign_coords(stage=["pressed", "pushed"])
    run["map_stress"].attrs.update(stages[0].attrs)
    sheet = map_figure(run)
    _, mesh = mesh_of(sheet)
    assert np.asarray(mesh.get_array()).max() == 12.0
    assert "pushed" in texts_of(sheet)
    first = picture(run, selection={"stage": "pressed"})
    assert np.asarray(mesh_of(first)[1].get_array()).max() == 6.0


@pytest.mark.parametrize("first", [0.0, 0.5])
def test_bodies_that_are_not_said_to_be_symmetric_are_drawn_as_they_are(first: float) -> None:
    run = grid_map(first + np.arange(11.0), np.arange(3.0))
    for given in (run, run.drop_attrs(deep=False).assign_attrs(scene="fake", parameters="{}")):
        drawn = np.asarray(mesh_of(map_figure(given, "quantity"))[1].get_array())
        np.testing.assert_array_equal(drawn, run["quantity"])


def test_the_stored_run_and_its_study_say_that_half_the_bodies_were_computed(
    computed: ComputedStudy,
) -> None:
    study, store = computed
    with open_netcdf(store.run_path(next(study.cases()).id)) as run:
        assert run.attrs["symmetric"] == 1
    with open_study(store.directory) as together:
        assert together.attrs["symmetric"] == 1
        x = mesh_of(map_figure(together, "residual_stress"))[0].get_xlim()
    assert x[0] == -x[1]


@pytest.mark.parametrize("size", [(0.5, 6.0), (9.0, 0.5), (1e-3, 2e-3)])
def test_no_label_is_cut_and_the_bar_is_as_tall_as_the_map(size: tuple[float, float]) -> None:
    width, height = size
    run = grid_map(np.linspace(1.0, 1.0 + width, 40), np.linspace(-height, 0.0, 30))
    run = run.assign_coords(friction=0.4, hardening="isotropic", load_ratio=0.8571)
    run["quantity"][0, 0] = 1e5
    sheet = map_figure(run, "quantity")
    axes = sheet.axes[0]
    sheet.draw_without_rendering()
    inked = sheet.get_tightbbox()
    assert inked.x0 >= 0.0
    assert inked.y0 >= 0.0
    assert inked.x1 <= sheet.get_figwidth()
    assert inked.y1 <= sheet.get_figheight()
    map_box, bar_box = (each.get_window_extent() for each in (axes, axes.child_axes[0]))
    # An arrow for values beyond the colours takes 3 % at either end of the bar.
    assert 0.94 * map_box.height < bar_box.height < 1.001 * map_box.height


def test_colours_that_leave_values_out_say_so() -> None:
    run = grid_map(np.arange(1.0, 101.0), np.arange(-10.0, 0.0), "xx")
    everything = map_figure(run, "quantity")
    assert mesh_of(everything)[1].get_clim()[1] == 1000.0
    assert "beyond" not in texts_of(everything)
    run["quantity"][0, 0, 0] = -1e6
    sheet = map_figure(run, "quantity")
    assert mesh_of(sheet)[1].get_clim()[1] < 1000.0
    assert "0.2% of the map lies beyond" in texts_of(sheet)
    assert "\N{MINUS SIGN}1e+06 to 1000" in texts_of(sheet)


def test_what_lies_beyond_the_colours_is_told_as_an_area() -> None:
    y = np.concatenate([np.linspace(-50.0, -1.0, 50), np.linspace(-0.01, -0.001, 10)])
    run = grid_map(np.arange(1.0, 101.0), y)
    run["quantity"][:] = 1.0
    run["quantity"][-10:] = 1000.0  # a sixth of the points, in 2 % of the area
    sheet = map_figure(run, "quantity")
    assert mesh_of(sheet)[1].get_clim()[1] == 1000.0
    run["quantity"][-10:-1] = 1.0  # 1e-5 of it
    sheet = map_figure(run, "quantity")
    assert mesh_of(sheet)[1].get_clim()[1] == 1.0
    assert "0.0% of the map lies beyond" in texts_of(sheet)


def test_a_window_shows_that_part_of_both_halves() -> None:
    run = grid_map(np.arange(20.0) + 0.5, np.arange(-20.0, 0.0), symmetric=True)
    axes, mesh = mesh_of(map_figure(run, "quantity", window=(-3.0, 5.0, -8.0, -2.0)))
    assert axes.get_xlim() == (-2.5, 4.5)
    assert axes.get_ylim() == (-8.0, -2.0)
    assert np.shape(mesh.get_array()) == (7, 8)
    for wrong in [(5.0, -3.0, -8.0, -2.0), (30.0, 40.0, -8.0, -2.0), (0.0, 1.0, -8.0, -2.0)]:
        with pytest.raises(StudyError, match=r"window = .* must be x0 x1 y0 y1"):
            map_figure(run, "quantity", window=wrong)


@pytest.mark.parametrize(("name", "side"), [("punch", 5e-4 * 50.0), ("rolling", 8.2918 / 64)])
def test_maps_are_as_fine_as_the_elements_near_the_contact(name: str, side: float) -> None:
    scene = SCENES[name]
    view = scene.view(scene.parameters())
    rows = np.abs(view.y)
    assert rows.min() < 0.51 * side
    assert np.diff(np.sort(rows[view.y < 0])).max() < 60 * side
    if name == "punch":
        assert np.abs(view.x - 50.0).min() < 0.51 * side
        assert (view.y > 0).any()


def test_zoom_shows_the_neighbourhood_of_the_edge(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        axes, _ = mesh_of(map_figure(together, zoom=30.0))
    half_cell = 12.5
    low, high = axes.get_xlim()
    assert 50.0 - 30.0 - half_cell <= low < 50.0 < high <= 50.0 + 30.0 + half_cell


def test_zoom_is_about_the_centre_of_a_contact_computed_whole() -> None:
    run = grid_map(np.arange(-20.0, 21.0), np.arange(-20.0, 0.0))
    for half_width in (6.0, np.nan):
        run["contact_half_width"] = half_width
        axes, _ = mesh_of(map_figure(run, "quantity", zoom=4.0))
        assert axes.get_xlim() == (-4.0, 4.0)


def test_zoom_to_an_edge_that_is_not_known_says_what_is_missing() -> None:
    run = grid_map(np.arange(20.0), np.arange(-20.0, 0.0), symmetric=True)
    run["contact_half_width"] = np.nan
    for given in (run, run.drop_vars("contact_half_width")):
        with pytest.raises(StudyError, match="this run has no contact_half_width: leave it out"):
            map_figure(given, "quantity", zoom=4.0)
        assert mesh_of(map_figure(given, "quantity"))[1].get_clim()[1] == 400.0


def test_a_figure_tells_every_parameter_that_is_not_the_default() -> None:
    run = grid_map(np.arange(-20.0, 21.0), np.arange(-20.0, 0.0))
    given = {"track": 64.0, "passes": 1, "until": "decided", "load": "hertz", "friction": 0.1}
    run = run.assign_attrs(scene="rolling", parameters=json.dumps(given))
    run = run.assign_coords(friction=0.3)
    words = texts_of(map_figure(run, "quantity"))
    assert "rolling · friction 0.3 · track 64 mm · until decided · load hertz" in words
    assert "passes" not in words, "one pass is the default"


def test_the_figure_suits_the_field(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        assert picture(together, "residual_stress").axes[0].child_axes
        assert picture(together, "contact_pressure").axes[0].lines
        assert picture(together, "increments").axes[0].lines


def test_an_axis_of_the_sweep_may_be_called_like_a_coordinate(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together:
        swept = together.rename(friction="z")
        axes, mesh = mesh_of(picture(swept, "residual_stress"))
        np.testing.assert_array_equal(
            np.ma.getdata(mesh.get_array()),
            np.ma.getdata(mesh_of(picture(together, "residual_stress"))[1].get_array()),
        )
        assert picture(swept, "pass_creepage", selection={"pass": 1}).axes[0].lines
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$x$ [mm]", "$y$ [mm]")


def test_an_unknown_field_is_told_what_can_be_drawn(computed: ComputedStudy) -> None:
    _, store = computed
    with open_study(store.directory) as together, pytest.raises(StudyError) as caught:
        picture(together, "incremets")
    told, _, meant = caught.value.allowed.removeprefix("must be one of ").partition("; ")
    names = told.partition(" and ")[0].split(", ")
    assert set(names) <= set(together.data_vars) and "message" not in names
    assert meant == "did you mean increments?"


def test_a_field_that_is_zero_everywhere_is_drawn(store: Store) -> None:
    study = fake_study(sweep={"friction": [0.0]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        together["residual_stress"] = 0.0 * together["residual_stress"]
        together["plastic_strain"] = 0.0 * together["plastic_strain"]
        for field in ("residual_stress", "plastic_strain"):
            low, high = mesh_of(map_figure(together, field))[1].get_clim()
            assert low < high


@pytest.mark.parametrize(
    ("held", "told"), [("true", "elastic punch"), ("false", "not elastic punch")]
)
def test_a_swept_truth_value_is_told_by_its_name(held: str, told: str) -> None:
    run = xr.Dataset(coords={"elastic_punch": held}, attrs={"scene": "punch", "parameters": "{}"})
    assert setting(run).replace("\u00a0", " ").endswith(f"· {told}")


def rolled() -> xr.Dataset:
    """A run with a contact of 8 mm along and 4 across, which sticks where x > 0, and a wheel."""
    x, z, y = np.arange(-10.0, 11.0), np.arange(-12.0, 13.0), np.arange(-4.0, 1.0)
    X, Z = np.meshgrid(x, z, indexing="ij")
    closed = (abs(X) <= 4.0) & (abs(Z) <= 2.0)
    fields = {
        "patch_status": closed * np.where(X > 0, 1, 2),
        "patch_pressure": 900.0 * closed,
        "patch_shear_x": -200.0 * closed,
        "patch_shear_z": 50.0 * closed * Z,
        "patch_slip_x": np.where(closed, 1e-3 * (X < 0), np.nan),
        "patch_slip_z": np.where(closed, 0.0, np.nan),
    }
    run = xr.Dataset(
        {"status": "ok", "message": ""}
        | {name: (("x", "z"), each) for name, each in fields.items()},
        coords={"x": x, "y": y, "z": z},
        attrs={"scene": "fake", "parameters": '{"state": "plane_strain"}'},
    ).assign(status="ok", message="")
    run["patch_pressure"].attrs["units"] = run["patch_shear_x"].attrs["units"] = "MPa"
    run["patch_shear_z"].attrs["units"] = "MPa"
    flags = {"flag_values": [0, 1, 2], "flag_meanings": "open stick slip"}
    run["patch_status"].attrs |= flags
    run["map_mises"] = (("y", "z"), np.ones((y.size, z.size)), {"units": "MPa"})
    run["wheel_surface"] = ("z", 0.05 * z**2)
    return run


def names_of(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_a_caption_has_no_units_of_words() -> None:
    parameters = {"load_by": "force", "force": 3000.0, "groove_radius": "conformity"}
    run = xr.Dataset(
        coords={"load_ratio": 2.5, "conformity": 0.515},
        attrs={"scene": "raceway", "parameters": json.dumps(parameters)},
    )
    told = setting(run).replace("\u00a0", " ")
    assert told.endswith("load by force · force 3000 N · groove radius conformity")


def test_a_contact_is_drawn_with_its_edges_and_its_shear() -> None:
    axes, mesh = mesh_of(map_figure(rolled(), "patch_pressure"))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$z$", "$x$")
    assert axes.get_xlim() == (-3.5, 3.5)  # a fifth of 8 mm around it
    assert axes.get_ylim() == (-5.5, 5.5)
    assert np.ma.count(np.ma.masked_invalid(mesh.get_array())) == 9 * 5
    assert names_of(axes) == [
        "edge of contact", "edge of stick", "shear on the surface, at most 224 MPa",
    ]  # fmt: skip
    (arrows,) = (each for each in axes.collections if isinstance(each, Quiver))
    assert np.ma.array(arrows.V, mask=arrows.Umask).max() < 0.0
    assert mesh.get_clim() == (0.0, 900.0)


@pytest.mark.parametrize("size", [1e-2, 1e2])
@pytest.mark.parametrize("longer", [1.0, 20.0])
def test_a_contact_of_any_size_and_form_is_not_hidden(size: float, longer: float) -> None:
    x, z = np.linspace(-10.0, 10.0, 201), np.linspace(-12.0, 12.0, 241)
    run = rolled().sel(x=x, z=z, method="nearest")
    run = run.assign_coords(x=size * x, z=size * longer * z)
    run["patch_pressure"][100, 120] = 9e5  # colours end before it, as a note says
    sheet = map_figure(run, "patch_pressure")
    axes, _ = mesh_of(sheet)
    sheet.draw_without_rendering()
    legend = axes.get_legend()
    assert legend is not None
    box = legend.get_window_extent()
    assert 0.0 <= box.y0
    assert box.y1 <= axes.xaxis.label.get_window_extent().y0
    note = next(each for each in axes.texts if "Colours end" in each.get_text())
    assert note.get_window_extent().y1 <= box.y0
    (arrows,) = (each for each in axes.collections if isinstance(each, Quiver))
    for places, length, shown in (
        (arrows.X, arrows.U, axes.get_xlim()),
        (arrows.Y, arrows.V, axes.get_ylim()),
    ):
        ends = np.ma.masked_invalid(places + np.ma.array(length, mask=arrows.Umask) / arrows.scale)
        assert shown[0] <= ends.min()
        assert ends.max() <= shown[1]
    assert np.ma.count(np.ma.array(arrows.U, mask=arrows.Umask)) >= 10


def test_slip_is_drawn_with_arrows_of_slip_and_shear_has_two_signs() -> None:
    axes, _ = mesh_of(map_figure(rolled(), "patch_slip_x"))
    assert names_of(axes)[-1] == "slip on the surface, at most 0.001"
    _, mesh = mesh_of(map_figure(rolled(), "patch_shear_x"))
    assert mesh.get_clim() == (-200.0, 200.0)


def test_flags_are_named_beside_their_colours() -> None:
    sheet = map_figure(rolled(), "patch_status")
    beside = [*sheet.axes[1:], *sheet.axes[0].child_axes]
    labels = [each.get_text() for axes in beside for each in axes.get_yticklabels()]
    assert {"open", "stick", "slip"} <= set(labels)


@pytest.mark.parametrize(("stress", "level", "none"), [(2e-5, 900.0, True), (2e-5, 1e-3, False)])
def test_stress_below_rounding_of_the_level_is_drawn_as_none(
    stress: float, level: float, none: bool
) -> None:
    run = grid_map(np.arange(9.0), np.arange(-8.0, 1.0), "xx")
    run["quantity"] = run["quantity"] * 0.0 + stress
    run["quantity"].attrs |= {"long_name": "residual stress", "units": "MPa"}
    run["highest_mises"] = ((), level, {"units": "MPa"})
    sheet = map_figure(run, "quantity")
    assert ("No residual stress: it is zero everywhere." in texts_of(sheet)) == none
    _, mesh = mesh_of(sheet)
    assert bool(np.any(mesh.get_array())) != none
    line = run.rename(x="s")[["quantity", "highest_mises", "status", "message"]].isel(y=0)
    drawn = line_figure(line, "quantity").axes[0]
    assert bool(np.any(drawn.lines[0].get_ydata())) != none
    assert any("No residual stress" in text.get_text() for text in drawn.texts) == none


def test_a_map_of_one_body_is_drawn_between_its_points_and_one_of_two_in_cells() -> None:
    """Along the border of two bodies stress jumps."""
    run = grid_map(np.arange(9.0), np.arange(-8.0, 1.0), "xx")
    for bodies, shading in ((["rail"], "gouraud"), (["punch", "half_plane"], "flat")):
        _, mesh = mesh_of(map_figure(run.assign_coords(body=bodies), "quantity"))
        assert mesh._shading == shading


def test_a_caption_leaves_out_what_changes_nothing() -> None:
    given = {"load_by": "force", "load_ratio": 2.5, "force": 8000.0, "friction": 0.1}
    run = xr.Dataset(
        coords={"load_ratio": 2.5, "force": 8000.0},
        attrs={"scene": "raceway", "parameters": json.dumps(given)},
    )
    words = setting(run).replace("\N{NO-BREAK SPACE}", " ")
    assert "force 8000" in words and "load ratio" not in words


def test_a_caption_names_the_steel_also_if_it_is_the_usual_one() -> None:
    def told(**values: Any) -> str:
        run = xr.Dataset(attrs={"scene": "punch", "parameters": json.dumps(values)})
        return setting(run).replace("\N{NO-BREAK SPACE}", " ")

    usual = parameters_of(SCENES["punch"])["yield_stress"].default
    assert told(yield_stress=usual).endswith(f"yield stress {usual:g} MPa")
    assert told(yield_stress=None) == "punch"
    steel = named("rail-steel")
    assert told(**steel) == "punch · material rail-steel"
    other = told(**{**steel, "yield_stress": 480.0})
    assert "yield stress 480 MPa" in other and "rail-steel" not in other
    swept = xr.Dataset(attrs={"scene": "punch", "parameters": json.dumps(steel)})
    swept = swept.assign_coords(yield_stress=((), steel["yield_stress"], {"units": "MPa"}))
    assert f"yield stress {steel['yield_stress']:g}" in setting(swept).replace("\xa0", " ")
    swept = swept.assign_coords(material=((), "own", {"sets": "yield_stress"}))
    assert "material own" in (words := setting(swept).replace("\xa0", " "))
    assert "yield stress" not in words


def test_a_caption_leaves_out_the_load_of_a_run_whose_passes_have_their_own() -> None:
    passes = [{"load": 35e3, "traction": 0.1}, {"load": 110e3}]
    given = {"load": 110e3, "traction": 0.2, "sequence": passes}
    attrs = {"scene": "wheel_rail", "parameters": json.dumps(given)}
    words = setting(xr.Dataset(attrs=attrs)).replace("\N{NO-BREAK SPACE}", " ")
    assert words.endswith("traction 0.2 · sequence 2 tables") and "110" not in words


def test_the_caption_of_a_contact_names_the_pass_that_it_is_of() -> None:
    run = rolled().assign_coords({"pass": [1, 2]})
    run.attrs |= {"scene": "wheel_rail", "parameters": '{"load": 110e3, "passes": 2}'}
    run["pass_load"] = ("pass", [11e4, 35e3], {"units": "N"})
    run["pass_traction"] = ("pass", [0.0, 0.1], {"units": "1"})

    def told(field: str) -> str:
        return " ".join(texts_of(map_figure(run, field)).split())

    assert all(each in told("patch_pressure") for each in ("pass 2", "load 35000 N", "n 0.1"))
    assert "load 110000 N" in told("map_mises") and "pass 2" not in told("map_mises")
    run["pass_load"], run["pass_traction"] = run["pass_load"] * 0.0, run["pass_traction"] * 0.0
    assert "load 110000 N" in told("patch_pressure") and "pass 2" not in told("patch_pressure")


def test_a_section_is_drawn_with_the_wheel_above_it() -> None:
    axes, _ = mesh_of(map_figure(rolled(), "map_mises"))
    assert names_of(axes) == ["wheel before contact"]
    assert axes.get_ylim() == (-4.0, 3.0)
    below, _ = mesh_of(map_figure(rolled(), "map_mises", window=(-5.0, 5.0, -4.0, -1.0)))
    assert below.get_legend() is None


def test_the_map_of_another_run_is_subtracted_over_the_same_axes_only() -> None:
    x, y = np.linspace(0.0, 1.0, 5), np.linspace(-1.0, 0.0, 4)
    run = grid_map(x, y)
    (field,) = (str(name) for name in run.data_vars if run[name].ndim == 2)
    assert not values_shown(run, field, minus=run).arrays[field].any()
    apart = values_shown(run, field, minus=grid_map(x + 10.0, y))
    assert np.isnan(apart.arrays[field]).all()
    assert apart.head["high"] == 1.0
    with pytest.raises(StudyError, match="is over x, z in the other run, and over x, y here"):
        values_shown(run, field, minus=run.rename(y="z"))
