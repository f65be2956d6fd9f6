"""Runs that keep the fields at their nodes: UGRID in the file of the run, VTU for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from residua.cli import main
from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.mesh import grid
from studies import Store, Study, StudyError, run_study
from studies.scenes.scene import read_scene
from studies.storage import ugrid
from studies.views import solution
from studies.views.plots.picture import drawn_from
from studies.views.reading import open_netcdf

pytestmark = [pytest.mark.processes, pytest.mark.solves, pytest.mark.usefixtures("one_worker")]

PIN = read_scene(Path(__file__).parents[2] / "data/scenes/pin.toml")
CONTENT: dict[str, Any] = {
    "name": "pins", "parameters": {"clearance": 0.02}, "sweep": {"load_ratio": [0.2, 0.5]},
}  # fmt: skip


@pytest.fixture(scope="module")
def pressed() -> Solution:
    """Two blocks with different elements, pressed together until the upper one yields."""
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=175.0)
    x = np.linspace(0.0, 2.0, 3)
    upper = Body(name="upper", mesh=grid(x, x, "tri"), material=steel, element="tri6",
                 supports={"left": "x"}, pressure={"top": 200.0})  # fmt: skip
    lower = Body(name="lower", mesh=grid(2 * x, x - 2), material=steel, element="quad8",
                 supports={"left": "x", "bottom": "y"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"))
    return solve(Model(bodies=(upper, lower), contacts=(pair,)))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Store]:
    """A study that keeps fields, computed where its runs had been computed without them."""
    store = Store(tmp_path_factory.mktemp("kept"))
    plain = run_study(CONTENT, store, scene=PIN, workers=1)
    study = Study.from_dict(CONTENT | {"keep": "fields"}, scene=PIN)
    first = run_study(study, store, workers=1)
    again = run_study(study, store, workers=1)
    bare = run_study(CONTENT, store, scene=PIN, workers=1)
    counts = [len(each.computed) for each in (plain, first, again, bare)]
    assert counts == [2, 2, 0, 0]  # computed anew for the fields, and never again
    assert first.study_id != plain.study_id
    with open_netcdf(plain.dataset) as one, open_netcdf(first.dataset) as other:
        assert set(one.variables) == set(other.variables)
        xr.testing.assert_identical(one["residual_stress"], other["residual_stress"])
    return study, store


def run_of(kept: tuple[Study, Store], index: int = 1) -> Path:
    study, store = kept
    return store.run_path(list(study.run_ids())[index])


def corners(run: xr.Dataset) -> np.ndarray:
    """Return the nodes of the faces, triangles with their last corner twice."""
    nodes = run["mesh_face_nodes"].to_numpy()
    nodes = np.where(np.isnan(nodes), nodes[:, [2]], nodes)
    return nodes.astype(int)


def test_faces_cover_the_bodies_once(kept: tuple[Study, Store]) -> None:
    with open_netcdf(run_of(kept)) as run:
        topology = run["mesh"].attrs
        assert topology["cf_role"] == "mesh_topology"
        assert topology["node_coordinates"].split() == ["mesh_node_x", "mesh_node_y"]
        assert run[topology["face_node_connectivity"]].attrs["start_index"] == 0
        x, y = (run[name].to_numpy()[corners(run)] for name in topology["node_coordinates"].split())
        twice = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
        assert (twice > 0).all()  # counterclockwise
        names = run["mesh_body"].attrs["flag_meanings"].split()
        assert names == ["plate", "pin"]
        area = twice[run["mesh_body"].to_numpy() == names.index("pin")].sum() / 2
        # half of a ring of radii 0.5 and 9.98 mm, its circles polygons
        assert area == pytest.approx(np.pi / 2 * (9.98**2 - 0.5**2), rel=0.01)
        used = np.unique(corners(run))
        np.testing.assert_array_equal(used, np.arange(run.sizes["mesh_node"]))
        for name in ("mesh_mises", "mesh_stress_xx", "mesh_displacement_y"):
            each = run[name]
            assert (each.attrs["mesh"], each.attrs["location"]) == ("mesh", "node")
            assert each.dims == ("time", "mesh_node")


def test_plastic_strain_keeps_the_volume_and_makes_the_equivalent_one(pressed: Solution) -> None:
    at = pressed.mesh_fields().stages["unloaded"]
    xx, yy, zz, xy = at["plastic_tensor"]
    most = at["plastic_strain"].max()
    assert most > 1e-6
    np.testing.assert_allclose(xx + yy + zz, 0.0, atol=1e-9 * most)
    equivalent = np.sqrt(2.0 / 3.0 * (xx**2 + yy**2 + zz**2 + 2.0 * xy**2))
    assert (equivalent <= (1.0 + 1e-9) * most).all()
    k = at["plastic_strain"].argmax()
    assert yy[k] < 0.0 < xx[k]  # pressed flat
    assert equivalent[k] == pytest.approx(most, rel=0.05)


def test_the_fields_are_those_of_the_solution(pressed: Solution) -> None:
    fields = pressed.mesh_fields()
    made = xr.Dataset(ugrid.variables(fields), attrs={"keep": "fields", "id": "x"})
    again = solution.read(made)
    assert list(again.stages) == ["loaded", "unloaded"]
    np.testing.assert_array_equal(again.X, fields.X)
    for name, (element, cells) in fields.bodies.items():
        assert again.bodies[name][0] == element
        np.testing.assert_array_equal(again.bodies[name][1], cells)
    for stage, values in fields.stages.items():
        for name, value in values.items():
            np.testing.assert_array_equal(again.stages[stage][name], value)


def test_a_run_is_written_for_paraview(kept: tuple[Study, Store], tmp_path: Path) -> None:
    folder = tmp_path / "vtu"
    assert main(["export", str(run_of(kept)), "--vtu", str(folder)]) == 0
    sets = ElementTree.parse(folder / "stages.pvd").getroot().findall("Collection/DataSet")
    assert [each.get("name") for each in sets] == ["loaded", "unloaded"]
    mesh = meshio.read(folder / str(sets[0].get("file")))
    with open_netcdf(run_of(kept)) as run:
        loaded = run["mesh_stress_yy"].isel(time=0)
        np.testing.assert_array_equal(mesh.point_data["stress_yy"], loaded)
        assert float(loaded.min()) < -100.0


def test_a_map_and_lines_are_written_as_csv(kept: tuple[Study, Store], tmp_path: Path) -> None:
    def exported(field: str, *more: str) -> pd.DataFrame:
        out = tmp_path / "points.csv"
        assert main(["export", str(run_of(kept)), "--csv", str(out), "--field", field, *more]) == 0
        return pd.read_csv(out)

    with open_netcdf(run_of(kept)) as dataset:
        run = dataset.isel(dict.fromkeys(dataset["status"].dims, 0))
        stress = run["map_mises"].sel(stage="loaded", drop=True)
        found = exported("map_mises", "--stage", "loaded")
        assert [*found] == ["x", "y", "map_mises"]
        assert len(found) == 2 * int(stress.notnull().sum()), "of the half that is drawn too"
        own = found[found["x"] > 0.0]
        at = {name: xr.DataArray(own[name].to_numpy(), dims="point") for name in ("x", "y")}
        np.testing.assert_array_equal(stress.sel(at), own["map_mises"])
        assert own["map_mises"].max() > 10.0

        pressure = run["contact_pressure"].transpose("contact", "stage", ...)
        found = exported("contact_pressure")
        assert [*found] == ["contact", "stage", "distance", "contact_pressure"]
        distance = run["contact_s"].broadcast_like(pressure).transpose(*pressure.dims)
        there = pressure.notnull().to_numpy()
        for name, right in (("contact_pressure", pressure), ("distance", distance)):
            np.testing.assert_array_equal(found[name], right.to_numpy()[there])
        assert {*found["stage"]} == {*run["stage"].to_numpy()}


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ([], "--csv, --vtu"),
        (["--csv", "a", "--vtu", "b"], "--csv, --vtu"),
        (["--csv", "a", "--field", "friction"], "field = 'friction': must be one of"),
        (["--csv", "a", "--field", "contact_pressure", "--stage", "loaded"], "is for maps"),
    ],
)
def test_what_cannot_be_exported_is_refused(
    kept: tuple[Study, Store], capsys: pytest.CaptureFixture[str], asked: list[str], text: str
) -> None:
    assert main(["export", str(run_of(kept)), *asked]) == 2
    assert text in capsys.readouterr().err
    assert not Path("a").exists()


def test_a_run_of_a_study_is_found_by_its_place(kept: tuple[Study, Store], tmp_path: Path) -> None:
    study, store = kept
    where = str(store.study_path(study.id))
    for k, load in enumerate(("0.2", "0.5")):
        folder = tmp_path / load
        assert main(["export", where, "--select", f"load_ratio={load}", "--vtu", str(folder)]) == 0
        mesh = meshio.read(folder / "0-loaded.vtu")
        with open_netcdf(run_of(kept, k)) as run:
            np.testing.assert_array_equal(mesh.point_data["mises"], run["mesh_mises"].isel(time=0))


def test_a_run_without_fields_is_refused(
    computed: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, store = computed
    run = store.run_path(next(study.run_ids()))
    assert main(["export", str(run), "--vtu", str(tmp_path / "vtu")]) == 2
    assert 'keep = "fields"' in capsys.readouterr().err
    assert not (tmp_path / "vtu").exists()


def test_a_file_in_the_place_of_the_folder_is_refused(
    kept: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vtu").write_text("")
    assert main(["export", str(run_of(kept)), "--vtu", str(tmp_path / "vtu")]) == 2
    assert "must be a folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("own", "text"),
    [
        ({"keep": "all"}, "keep.*must be fields$"),
        ({"keep": True}, "keep.*must be fields$"),
        ({"keep": ["fields"]}, "keep.*must be fields$"),
        ({"note": 5}, "note.*must be a text"),
        ({"note": "x" * 4001}, "note.*must have at most 4000 characters"),
        ({"note": "a\x00b"}, "note.*must have no control characters"),
        ({"tags": "rail"}, "tags.*must be a list"),
        ({"tags": ["a b"]}, r"tags\[0\].*must be 1 to 80 of"),
        ({"tags": ["rail", "rail"]}, r"tags\[1\].*is there already"),
    ],
)
def test_labels_of_a_study_are_checked(own: dict[str, Any], text: str) -> None:
    with pytest.raises(StudyError, match=text):
        Study.from_dict(CONTENT | own, scene=PIN)


def test_labels_make_another_study_of_the_same_runs() -> None:
    plain = Study.from_dict(CONTENT, scene=PIN)
    told = Study.from_dict(CONTENT | {"note": "π\nand more", "tags": ["rail", "a1"]}, scene=PIN)
    assert told.id != plain.id
    assert list(told.run_ids()) == list(plain.run_ids())
    assert "note" not in plain.to_dict()
    again = Study.from_dict(told.to_dict(), scene=PIN)
    assert (again.id, again.note, again.tags) == (told.id, told.note, told.tags)


def test_the_maps_of_a_study_are_drawn_on_the_mesh_of_the_run_and_numbers_over_all_runs(
    kept: tuple[Study, Store], tmp_path: Path
) -> None:
    study, store = kept
    where = store.study_path(study.id)
    with open_netcdf(store.dataset_path(study.id)) as dataset:
        chosen = {"load_ratio": "0.2"}
        with drawn_from(where, dataset, "map_mises", {**chosen, "stage": "loaded"}) as found:
            run, left = found
            assert left == {"stage": "loaded"}
            assert run.attrs["id"] == next(iter(study.run_ids()))
            assert run["load_ratio"].item() == 0.2
        for field in ("tension", "line_mises"):
            with drawn_from(where, dataset, field, chosen) as (whole, left):
                assert whole is dataset and left == chosen
    out = tmp_path / "map.png"
    select = ["--select", "load_ratio=0.5", "stage=loaded", "--deformed", "50"]
    assert main(["plot", str(where), "--field", "map_stress", *select, "--out", str(out)]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")
