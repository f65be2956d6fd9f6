"""Places in three coordinates: a section of a rail, from its fields to a file and a picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import RegularGridInterpolator
from scipy.sparse import eye_array

from solver import Material, ModelError
from solver.contact.state import BodyState
from solver.materials.state import PlasticState
from solver.results.acting import Acting
from solver.results.fields import Samples, SystemFields
from solver.results.figures import residual_extremes
from solver.results.maps import isochromatics, maps, profiles, surfaces
from solver.results.mesh_fields import to_meshio
from solver.results.named_places import NamedPlaces, at_named_places
from solver.results.record import Status
from solver.results.requested import RequestedNumber
from solver.results.run import FinishedRun
from solver.results.view import ACROSS_TRACK, NOWHERE, Places, View
from solver.scenes.driver import _labelled, _merged
from solver.shipped import SCENES
from solver.tensors import to_mandel, von_mises
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.views import solution
from studies.views.plots.mapped import whole
from studies.views.plots.picture import picture
from studies.views.tables import runs_table
from tests.studies.conftest import compute_here
from tests.studies.fakes import Canned
from tests.studies.plots.test_maps import mesh_of

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=350.0)
Z, Y = np.linspace(-3.0, 3.0, 7), np.linspace(-4.0, 0.0, 5)


def displaced(X: np.ndarray) -> np.ndarray:
    """Displacements (3, n) [mm] at places (3, n)."""
    _, y, z = X
    return 1e-3 * np.stack([z, y, 2 * z])


def stressed(X: np.ndarray) -> np.ndarray:
    """Stress xx, yy, zz, xy, yz, zx (6, n) [MPa]; yz grows with z only."""
    _, y, z = X
    return np.stack([z, y, z + y, 2 * z, 3 * z + 1, 4 * y])


class Rail:
    """A rail along x as results see bodies: its nodes are those of the section at x = 0.

    Parameters
    ----------
    axes : 3; with 2 it is a body in x and y with the first four components
    """

    names = ("rail",)
    n_unknowns = 0

    def __init__(self, axes: int = 3) -> None:
        z, y = (each.ravel() for each in np.meshgrid(Z, Y))
        self.space = np.stack([np.zeros_like(z), y, z])
        self.X = self.space if axes == 3 else np.stack([z, y])
        self.stress = stressed(self.space)[: 2 * axes]
        n, row = len(Z), np.arange(len(Z) - 1)
        first = (row + n * np.arange(len(Y) - 1)[:, None]).ravel()
        self.cells = np.stack([first, first + 1, first + n + 1, first + n], axis=1)

    def full(self, name: str) -> Any:
        top = np.flatnonzero(self.space[1] == 0.0)
        return SimpleNamespace(
            X=self.X, period=0.0, basis=SimpleNamespace(element_dofs=self.cells.T),
            body=SimpleNamespace(element="quad4", material=STEEL, every_load=()),
            boundary_nodes=lambda boundary: top,
        )  # fmt: skip

    def sampler(self, name: str, X: np.ndarray) -> Any:
        """Everything is the same along x."""
        assert len(X) == 3
        inside = (np.abs(X[2]) <= 3.0) & (X[1] >= -4.0) & (X[1] <= 0.0)

        def between(nodal: np.ndarray) -> np.ndarray:
            grid = np.moveaxis(nodal.reshape(*nodal.shape[:-1], len(Y), len(Z)), (-2, -1), (0, 1))
            found = RegularGridInterpolator((Y, Z), grid, bounds_error=False)(X[1:].T)
            return np.moveaxis(found, 0, -1)

        between.inside = inside
        return between

    def recovery(self, name: str) -> Any:
        return eye_array(self.X.shape[1], format="csr")

    def positions(self, name: str) -> np.ndarray:
        return self.X

    def state(self, name: str, at: Any) -> BodyState:
        mandel = at.factor * to_mandel(self.stress)
        return BodyState(
            time=0.0,
            u=displaced(self.space)[-len(self.X) :].T.ravel() * at.factor,
            stress=mandel,
            strain=2e-5 * to_mandel(at.factor * self.stress),
            plastic=PlasticState(mandel / 1e5, at.factor * 1e-3 * (3.0 + self.space[2])),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RailParameters:
    load_ratio: float = 1.0
    yield_stress: float = 500.0


def solved(factor: float) -> Any:
    return SimpleNamespace(state=SimpleNamespace(factor=factor), factor=factor)


VIEW = View(
    x=NOWHERE,
    y=np.linspace(-4.0, 1.0, 11),
    z=np.linspace(-3.0, 3.0, 13),
    depth=np.array([0.0, 1.0, 2.5]),
    station=np.array([-1.0, 2.0]),
    s=np.linspace(-2.0, 2.0, 9),
    profile_body="rail",
    surfaces={"rail": "top"},
    axis=ACROSS_TRACK,
)


def number(name: str, of: str, take: str, **where: Any) -> RequestedNumber:
    return RequestedNumber(name=name, of=of, take=take, stage="unloaded", **where)


PLACES = NamedPlaces(
    lines={
        "web": Places("rail", np.linspace([0.0, -1.0, -2.0], [0.0, -1.0, 2.0], 5).T),
        "slanted": Places("rail", np.linspace([0.0, -3.0, 0.0], [3.0, 0.0, 1.5], 5).T),
    },
    points={"foot": Places("rail", np.array([[5.0], [-2.0], [1.0]]))},
    contacts=(),
    numbers=(
        number("shear", "stress.yz", "maximum", body="rail"),
        number("boxed", "stress.yz", "maximum", body="rail", z=(-3.0, 1.0)),
        number("yielded", "plastic_strain", "maximum", body="rail"),
        number("sideways", "displacement.z", "minimum", line="web"),
        number("whole", "stress.yz", "integral", line="web"),
    ),
    samples=0,
)


def finished(parameters: RailParameters) -> FinishedRun:
    states = {"loaded": solved(2 * parameters.load_ratio), "unloaded": solved(1.0)}
    return FinishedRun(
        parameters=parameters,
        samples=Samples(Rail(), VIEW),
        acting=lambda at: Acting(),
        outcome=SimpleNamespace(points=states, error=None, history=()),
        check=None,
    )


def records(parameters: RailParameters, values: Any, monitor: Any) -> Iterator[Any]:
    for load_ratio in values:
        run = finished(replace(parameters, load_ratio=load_ratio))
        outputs = (maps, isochromatics, profiles, surfaces, residual_extremes)
        found = {**_merged(run, outputs), **at_named_places(run, PLACES, ())}
        record = _labelled(RAIL, run, Status.OK, (), found)
        fields = run.samples.fields.on_mesh(run.outcome.points)
        yield replace(record, mesh=lambda fields=fields: fields)


RAIL = Canned(
    name="rail",
    summary="fields that are known everywhere",
    parameters=RailParameters,
    branch="load_ratio",
    records=records,
    quantities=tuple(q for number in PLACES.numbers for q in number.quantities),
)


@pytest.fixture(scope="module")
def computed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Study, Store]]:
    """Two runs, read back by the store, and the data set of their study."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(SCENES, "rail", RAIL)
        sweep = {"load_ratio": [1.0, 2.0]}
        content = {"name": "rails", "scene": "rail", "sweep": sweep, "keep": "fields"}
        study, store = Study.from_dict(content), Store(tmp_path_factory.mktemp("rail"))
        compute_here(study, store, RAIL)
        yield study, store


@pytest.fixture(scope="module")
def dataset(computed: tuple[Study, Store]) -> Iterator[xr.Dataset]:
    with open_study(computed[1].directory) as found:
        assert (found["status"] == "ok").all(), found["message"].to_numpy()
        yield found.isel(load_ratio=0)


def test_the_file_has_six_components_and_the_axes_of_the_section(dataset: xr.Dataset) -> None:
    assert dataset["component"].to_numpy().tolist() == ["xx", "yy", "zz", "xy", "yz", "zx"]
    assert "x" not in dataset.variables
    assert dataset["residual_stress"].dims == ("component", "y", "z")
    assert dataset["map_mises"].dims == ("stage", "y", "z")
    assert dataset["z"].attrs["units"] == dataset["y"].attrs["units"] == "mm"
    assert "axis" not in dataset["z"].attrs, "by CF the axis Z is vertical"
    inside = dataset.sel(y=slice(None, 0.0))
    y, z = xr.broadcast(inside["y"], inside["z"])
    own = stressed(np.stack([0 * y, y, z]))
    np.testing.assert_allclose(inside["residual_stress"], own, atol=1e-12)
    np.testing.assert_allclose(inside["stress_difference"], 2 * np.hypot(z, 6 * z + 2), atol=1e-12)
    assert dataset["residual_stress"].sel(y=slice(0.1, None)).isnull().all()


def test_profiles_and_surface_of_the_section_lie_across_the_track(dataset: xr.Dataset) -> None:
    profile, surface = dataset["residual_profile"], dataset["surface_residual"]
    z, depth = xr.broadcast(dataset["station"], dataset["depth"])
    own = stressed(np.stack([0 * z, -depth, z]))
    np.testing.assert_allclose(profile.transpose("component", ...), own, atol=1e-12)
    s = dataset["s"].to_numpy()
    own = stressed(np.stack([0 * s, 0 * s, s]))
    np.testing.assert_allclose(surface.sel(body="rail"), own, atol=1e-12)
    on_top = np.stack([0 * Z, 0 * Z, Z])
    mises = np.interp(s, Z, von_mises(to_mandel(stressed(on_top))))
    np.testing.assert_allclose(dataset["surface_mises"].sel(stage="unloaded"), mises)


def test_lines_and_points_have_three_coordinates(dataset: xr.Dataset) -> None:
    for name, line in PLACES.lines.items():
        here = dataset.sel(line=name)
        X = np.stack([here[f"line_{axis}"] for axis in "xyz"])
        np.testing.assert_array_equal(X, line.X)
        step = np.linalg.norm(line.X[:, 1] - line.X[:, 0])
        np.testing.assert_allclose(here["line_s"], step * np.arange(5))
        stress = here["line_stress"].sel(stage="unloaded")
        assert stress.dims == ("component", "fraction")
        np.testing.assert_allclose(stress, stressed(X), atol=1e-12)
    foot = dataset.sel(point="foot")
    X = PLACES.points["foot"].X
    assert [float(foot[f"point_{axis}"]) for axis in "xyz"] == X[:, 0].tolist()
    moved = [foot[f"point_displacement_{axis}"].sel(stage="loaded").item() for axis in "xyz"]
    assert moved == pytest.approx((2 * displaced(X))[:, 0])
    np.testing.assert_allclose(foot["point_stress"].sel(stage="unloaded"), stressed(X)[:, 0])
    words = dataset["point_displacement_z"].attrs
    assert words["long_name"] == "displacement of the point along z"
    assert words["units"] == "mm"


def test_numbers_are_taken_of_what_has_three_axes(dataset: xr.Dataset) -> None:
    def told(name: str) -> list[float]:
        return [float(dataset[f"{name}{place}"]) for place in ("", "_x", "_y", "_z")]

    assert told("shear")[0] == 10.0
    assert told("shear")[3] == 3.0
    assert told("boxed")[::3] == [4.0, 1.0]
    assert told("yielded")[::3] == pytest.approx([6e-3, 3.0])
    assert told("sideways") == pytest.approx([-4e-3, 0.0, -1.0, -2.0])
    assert float(dataset["whole"]) == pytest.approx(4.0)
    assert "whole_z" not in dataset
    assert dataset["sideways"].attrs["units"] == "mm"
    assert dataset["shear"].attrs["units"] == "MPa"
    assert dataset["shear_z"].attrs == {"long_name": "z where shear is", "units": "mm"}


def test_extremes_of_the_body_have_a_place_in_three_coordinates(dataset: xr.Dataset) -> None:
    here = dataset.sel(body="rail", component="yz")
    assert float(here["residual_max"]) == 10.0
    assert [float(here[f"residual_max_{axis}"]) for axis in "xz"] == [0.0, 3.0]
    assert float(here["residual_min_z"]) == -3.0
    assert float(here["surface_residual_max_s"]) == 3.0
    assert here["residual_max_z"].attrs["long_name"].startswith("position along z of the largest")


def test_the_picture_has_z_across_and_y_up(dataset: xr.Dataset) -> None:
    sheet = picture(dataset, "residual_stress", "yz")
    axes, mesh = mesh_of(sheet)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$z$ [mm]", "$y$ [mm]")
    drawn = np.ma.getdata(mesh.get_array())
    z, y = dataset["z"].to_numpy(), dataset["y"].to_numpy()
    expected = np.where(y[:, None] <= 0.0, 3 * z + 1, np.nan)
    np.testing.assert_allclose(drawn[y <= 0.0], expected[y <= 0.0], atol=1e-12)
    assert axes.get_xlim() == (-3.0, 3.0)
    assert axes.get_ylim() == (-4.0, 1.0)
    part, mesh = mesh_of(picture(dataset, "map_mises", window=(0.0, 1.0, -2.0, -1.0)))
    assert part.get_xlim() == (0.0, 1.0)
    with pytest.raises(StudyError, match="must be z0 z1 y0 y1"):
        picture(dataset, "map_mises", window=(9.0, 10.0, 0.0, 1.0))


@pytest.mark.parametrize(("component", "sign"), [("xy", 1), ("yz", -1), ("zx", -1), ("zz", 1)])
def test_half_a_section_is_drawn_whole(dataset: xr.Dataset, component: str, sign: int) -> None:
    values = dataset["residual_stress"].sel(component=component, z=slice(0.0, None))
    both = whole(values.dropna("y"))
    np.testing.assert_array_equal(both["z"], dataset["z"])
    left, right = both.sel(z=slice(None, -0.1))[:, ::-1], both.sel(z=slice(0.1, None))
    np.testing.assert_array_equal(left, sign * right.to_numpy())


def test_lines_are_drawn_and_places_of_numbers_left_out_of_tables(
    computed: tuple[Study, Store], dataset: xr.Dataset
) -> None:
    sheet = picture(dataset, "line_stress", "zx", selection={"stage": "unloaded"})
    drawn = {line.get_label(): line.get_ydata() for line in sheet.axes[0].lines}
    np.testing.assert_allclose(drawn["slanted"], 4 * PLACES.lines["slanted"].X[1], atol=1e-12)
    with open_study(computed[1].directory) as both:
        words = set(runs_table(both).split())
    assert {"shear", "sideways"} <= words
    assert not {"x", "y", "z"} & words


def test_fields_that_are_kept_are_read_as_they_were(computed: tuple[Study, Store]) -> None:
    study, store = computed
    rail = Rail()
    with open_netcdf(store.run_path(next(study.cases()).id)) as run:
        assert run["mesh"].attrs["node_coordinates"] == "mesh_node_x mesh_node_y mesh_node_z"
        kept = solution.read(run)
    np.testing.assert_array_equal(kept.X, rail.X)
    np.testing.assert_allclose(kept.stages["unloaded"]["stress"], rail.stress)
    np.testing.assert_allclose(kept.stages["loaded"]["displacement"], 2 * displaced(rail.X))
    mesh = to_meshio(kept, "unloaded")
    np.testing.assert_array_equal(mesh.points, rail.X.T)
    np.testing.assert_allclose(mesh.point_data["stress_zx"], 4 * rail.X[1])


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"of": "stress.yz"}, "must be one of stress.xx, stress.yy, stress.zz, stress.xy"),
        ({"of": "displacement.z"}, "hydrostatic, displacement.x, displacement.y$"),
        ({"of": "mises", "z": (0.0, 1.0)}, "must be left out: places of this body have x, y"),
    ],
)
def test_what_a_body_in_two_coordinates_has_not_is_refused(
    asked: dict[str, Any], told: str
) -> None:
    wanted = number("wrong", asked.pop("of"), "maximum", body="rail", **asked)
    fields = SystemFields(Rail(axes=2))
    with pytest.raises(ModelError, match=told):
        wanted.values(fields, solved(1.0), {}, {})


def test_a_section_that_meets_no_body_names_its_axes() -> None:
    above = replace(VIEW, y=np.array([1.0, 2.0]))
    with pytest.raises(ModelError, match="from z to z and from y to y"):
        Samples(Rail(), above)
