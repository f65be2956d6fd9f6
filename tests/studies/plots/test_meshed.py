"""Maps of runs that keep their mesh: deformed, with outlines, directions and both halves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver

from solver.results.mesh_fields import MeshFields
from studies import StudyError
from studies.storage import ugrid
from studies.views.plots.captions import symbol
from studies.views.plots.mapped import mesh_maps, on_mesh
from studies.views.plots.maps import map_figure
from studies.views.plots.picture import picture
from studies.views.shown import outline, shown
from tests.studies.plots.test_many import check_inside
from tests.studies.plots.test_maps import grid_map, texts_of

QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


def kept(*, symmetric: bool = False, grid: bool = True) -> xr.Dataset:
    """A run with two bodies: two squares, and two triangles above them, in two stages.

    Stress xx is 10 x, xy is 2, and the bodies are moved down by 0.1 x.
    """
    x, y = np.meshgrid([0.0, 1.0, 2.0], [-1.0, 0.0])
    lower = np.stack([x.ravel(), y.ravel()])
    upper = np.array([[0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    X = np.hstack([lower, upper])
    nothing = np.zeros(X.shape[1])
    stress = np.stack([10.0 * X[0], nothing, nothing, nothing + 2.0])
    end = {
        "displacement": np.stack([nothing, -0.1 * X[0]]), "stress": stress,
        "mises": np.abs(stress[0]), "plastic_strain": 1e-3 * X[0], "plastic_tensor": 1e-4 * stress,
        "strain": 2e-4 * stress,
    }  # fmt: skip
    begin = {name: 3.0 * values for name, values in end.items()}
    bodies = {"block": ("quad4", QUADS), "pad": ("tri3", 6 + np.array([[0, 1, 2], [0, 2, 3]]))}
    fields = MeshFields(X=X, bodies=bodies, stages={"loaded": begin, "unloaded": end})
    run = grid_map(np.linspace(0.1, 1.9, 4), np.linspace(-0.9, 0.9, 4), symmetric=symmetric)
    if not grid:
        run = run.drop_dims(["x", "y"]).drop_vars("contact_half_width")
    return run.assign(ugrid.variables(fields)).assign_attrs(keep="fields", id="x")


def test_values_are_those_of_the_nodes_on_every_face() -> None:
    drawn = on_mesh(kept(), "residual_stress", "xx")
    np.testing.assert_array_equal(drawn.values, 10.0 * drawn.X[0])
    assert drawn.triangles.shape == (6, 3)
    a, b, c = (drawn.X[:, drawn.triangles[:, k]] for k in range(3))
    area = np.abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]).sum() / 2.0
    assert area == pytest.approx(4.0)
    assert len(drawn.edges) == 6 + 4  # around the squares, and around the triangles
    assert drawn.box == pytest.approx((0.1, 1.9, -0.9, 0.9))
    begin = on_mesh(kept(), "map_mises", stage="loaded")
    np.testing.assert_array_equal(begin.values, 30 * drawn.X[0])
    for name, share, letter in (("plastic_tensor", 1.0, r"^{\mathrm{p}}"), ("strain", 2.0, "")):
        values = on_mesh(kept(), f"map_{name}", "xx").values
        np.testing.assert_allclose(values, share * 1e-3 * drawn.X[0])
        assert symbol(values) == rf"$\varepsilon{letter}_{{xx}}$"


def test_both_halves_are_mirrored_with_the_sign_of_shear() -> None:
    for name, sign in (("xx", 1.0), ("xy", -1.0), ("principal_1", 1.0), ("tresca", 1.0)):
        drawn = on_mesh(kept(symmetric=True), "residual_stress", name)
        half = drawn.X.shape[1] // 2
        np.testing.assert_array_equal(drawn.X[0, half:], -drawn.X[0, :half])
        np.testing.assert_allclose(drawn.values[half:], sign * drawn.values[:half])
        assert drawn.box == pytest.approx((-1.9, 1.9, -0.9, 0.9))
        assert drawn.signed == (name != "tresca")
    run = kept(symmetric=True)
    run["mesh_displacement_x"] = run["mesh_displacement_x"] + 0.3
    for axis, sign in (("x", -1.0), ("y", 1.0)):
        moved = on_mesh(run, "map_displacement", axis).values
        np.testing.assert_allclose(moved[half:], sign * moved[:half])
    on_line = np.abs(drawn.X[0][drawn.edges]).max(axis=1) < 1e-12
    assert not on_line.any()  # the line of symmetry is no outline


def test_bodies_are_drawn_deformed_by_a_factor() -> None:
    flat, bent = (on_mesh(kept(), "plastic_strain", deformed=factor) for factor in (0.0, 5.0))
    np.testing.assert_allclose(bent.X - flat.X, np.stack([0.0 * flat.X[0], -0.5 * flat.X[0]]))
    assert "5 times as large" in bent.note
    sheet = map_figure(kept(), "map_displacement", "y", deformed=5.0)
    assert "5 times as large" in texts_of(sheet)
    with pytest.raises(StudyError, match=r"deformed = 2\.0: needs the mesh: a study with keep"):
        map_figure(grid_map(np.arange(1.0, 5.0), np.arange(4.0)), "quantity", deformed=2.0)


def test_a_principal_stress_has_its_directions_in_the_bodies() -> None:
    sheet = map_figure(kept(), "map_stress", "principal_1", window=(0.0, 2.0, -1.0, 1.0))
    (axes,) = sheet.axes
    (bars,) = (each for each in axes.collections if isinstance(each, Quiver))
    x, way = bars.XY[:, 0], np.stack([bars.U, bars.V])
    # tan of twice the angle of the first principal direction is 2 xy / (xx - yy)
    angle = np.arctan2(way[1], way[0])
    np.testing.assert_allclose(np.tan(2 * angle[x > 0]), 4.0 / (10.0 * x[x > 0]), rtol=1e-9)
    assert r"Stress $\sigma_{1}$" in texts_of(sheet)
    assert any(isinstance(each, LineCollection) for each in axes.collections)
    check_inside(sheet)


def test_a_part_may_lie_outside_of_the_grid_and_a_grid_is_not_needed() -> None:
    assert on_mesh(kept(), "map_mises", window=(1.95, 2.5, -0.95, 0.0)).box[0] == 1.95
    bare = on_mesh(kept(grid=False), "residual_stress")
    assert bare.box == (0.0, 2.0, -1.0, 1.0)
    run = kept(grid=False)
    assert {each["name"] for each in outline(run)["maps"]} == set()
    assert "residual_stress" in mesh_maps(run)
    assert "Residual stress" in texts_of(picture(run, "residual_stress"))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"component": "rr"}, "component = 'rr'"),
        ({"stage": "released"}, "must be one of loaded, unloaded"),
        ({"window": (5.0, 6.0, 0.0, 1.0)}, "window = .* contain two points"),
        ({"window": (1.0, 0.0, 0.0, 1.0)}, "window = "),
        ({"zoom": -1.0}, "zoom = -1.0"),
    ],
)
def test_what_is_not_there_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(StudyError, match=told):
        map_figure(kept(), "map_stress", **given)


def test_a_run_of_an_earlier_version_lacks_the_components_of_plastic_strain() -> None:
    run = kept()
    run = run.drop_vars([name for name in run if str(name).startswith("mesh_plastic_strain_")])
    assert on_mesh(run, "plastic_strain").values.notnull().all()
    with pytest.raises(StudyError, match="field = 'map_plastic_tensor': is not kept in the file"):
        on_mesh(run, "map_plastic_tensor", "xx")


def test_maps_on_a_grid_have_invariants_too() -> None:
    x, y = np.linspace(0.5, 4.5, 5), np.linspace(-3.5, -0.5, 4)
    run = grid_map(x, y, "xx").drop_vars(["quantity", "component"])
    stress = np.zeros((4, 4, 5))
    stress[3] = 50.0
    run = run.assign_coords(component=["xx", "yy", "zz", "xy"])
    run["residual_stress"] = (("component", "y", "x"), stress, {"units": "MPa"})
    for name, value in (("principal_1", 50.0), ("principal_3", -50.0), ("tresca", 100.0)):
        assert (shown(run, "residual_stress", name).arrays["residual_stress"] == value).all()
    (bars,) = (
        each
        for each in map_figure(run, "residual_stress", "principal_1").axes[0].collections
        if isinstance(each, Quiver)
    )
    np.testing.assert_allclose(bars.U, bars.V)


def test_a_deformed_body_is_shown_whole() -> None:
    run = kept(grid=False)
    assert on_mesh(run, "map_mises").box == pytest.approx((0.0, 2.0, -1.0, 1.0))
    assert on_mesh(run, "map_mises", deformed=10.0).box == pytest.approx((0.0, 2.0, -3.0, 1.0))


def test_removed_material_is_left_out_of_its_stage() -> None:
    run = kept()
    for axis in "xy":
        moved = run[f"mesh_displacement_{axis}"]
        moved[{"time": 1, "mesh_node": [2, 5]}] = np.nan  # the right square
    assert on_mesh(run, "map_mises", stage="loaded").triangles.shape == (6, 3)
    for deformed in (0.0, 0.5):
        left = on_mesh(run, "map_mises", stage="unloaded", deformed=deformed)
        assert left.triangles.shape == (4, 3)
        assert not {2, 5} & {*left.triangles.ravel().tolist()}
        assert np.isfinite(left.box).all()
        assert len(left.edges) == 4 + 4


def test_contact_is_marked_where_pairs_press_at_the_stage() -> None:
    pressure = np.zeros((2, 2, 3))
    pressure[0, 0] = 1.0  # the first of two pairs, in the first of two stages
    run = kept().assign(
        contact_x=(("contact", "fraction"), np.tile([0.2, 0.5, 0.8], (2, 1))),
        contact_y=(("contact", "fraction"), np.zeros((2, 3))),
        contact_pressure=(("contact", "stage", "fraction"), pressure),
    )
    run = run.assign_coords(stage=["loaded", "unloaded"])

    def marks(field: str, stage: str | None = None) -> list[str]:
        (axes, *_) = map_figure(run, field, stage=stage).axes
        return [
            str(line.get_label())
            for line in axes.lines
            if len(np.atleast_1d(line.get_xdata())) == 3
        ]

    assert marks("map_mises", "loaded") == ["contact"]
    assert marks("map_mises", "unloaded") == []
    assert marks("residual_stress") == ["contact under load"]
