"""The runs of a study side by side."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from solver.linear import solvers
from solver.results.record import Record, Status
from solver.shipped import SCENES
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.storage import dataset as layout
from studies.storage import frame, provenance
from studies.storage.combine import combine
from studies.views.picking import one_run
from tests.counted import counted
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import Canned, described, record

ComputedStudy = tuple[Study, Store]


def test_every_point_of_the_sweep_is_the_run_that_was_computed(computed: ComputedStudy) -> None:
    study, store = computed
    with open_study(store.directory) as together:
        assert together["residual_stress"].dims[:3] == ("load_ratio", "friction", "hardening")
        assert together.attrs["title"] == "fake"
        assert json.loads(together.attrs["parameters"])["half_width"] == 50.0
        for case in study.cases():
            given = record(case.parameters)
            one = together.sel(
                load_ratio=case.values["load_ratio"], friction=case.values["friction"]
            ).squeeze("hardening")
            for name, (dimensions, values) in given.fields.items():
                assert one[name].dims == dimensions
                np.testing.assert_array_equal(one[name], values)
            assert one["increments"].item() == 10
            assert one["status"].item() == "ok"
        assert together["residual_stress"].attrs["units"] == "MPa"


@pytest.mark.parametrize(("halves", "told"), [((1, 1), 1), ((0, 0), 0), ((0, 1), 0), ((), 0)])
def test_a_study_is_of_symmetric_bodies_where_all_its_runs_are(
    store: Store, halves: tuple[int, ...], told: int
) -> None:
    study = fake_study(sweep={"friction": [0.0, 0.1]})
    cases = list(study.cases())
    for case, half in zip(cases, halves, strict=False):
        given = replace(record(case.parameters), symmetric=bool(half))
        store.write_run(case, given)
    store.save_study(study)
    with open_netcdf(combine(study, store, cases).path) as together:
        assert together.attrs["symmetric"] == told


def test_what_ran_is_told_of_all_runs_though_others_combine_them(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half of the runs come from a machine with another linear solver and an older library."""
    study = fake_study()
    cases = list(study.cases())
    for case, name, version in zip(
        cases, ["superlu", "pardiso"] * 2, ["1.0", "2.0"] * 2, strict=True
    ):
        monkeypatch.setattr(solvers, "chosen", lambda name=name: name)
        monkeypatch.setattr(provenance, "_versions", lambda version=version: {"numpy": version})
        store.write_run(case, record(case.parameters))
    monkeypatch.undo()
    store.save_study(study)
    with open_netcdf(combine(study, store, cases[:1]).path) as one:
        assert json.loads(one.attrs["versions"]) == {"numpy": "1.0"}
        assert one.attrs["linear_solver"] == "superlu"
    with open_netcdf(combine(study, store, cases).path) as all_:
        assert json.loads(all_.attrs["versions"]) == {"numpy": "1.0, 2.0"}
        assert all_.attrs["linear_solver"] == "pardiso, superlu"


def test_text_axes_are_labels_and_come_after_the_usual_ones(store: Store) -> None:
    study = fake_study(sweep={"state": ["plane_strain", "plane_stress"], "friction": [0.0, 0.1]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert together["plastic_strain"].dims == (
            "load_ratio", "friction", "hardening", "state", "y", "x",
        )  # fmt: skip
        assert list(together["state"].values) == ["plane_strain", "plane_stress"]


def test_labels_that_only_some_runs_have_are_joined_by_name(store: Store) -> None:
    """The stress tensor has zz in plane strain only; xy must not land in its place."""
    study = fake_study(sweep={"state": ["plane_stress", "plane_strain"]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert set(together["component"].values) == {"xx", "yy", "zz", "xy"}
        for case in study.cases():
            given = record(case.parameters)
            there = list(given.coordinates["component"])
            stress = together["residual_stress"].sel(state=case.values["state"]).squeeze()
            np.testing.assert_array_equal(
                stress.sel(component=there), given.fields["residual_stress"][1]
            )
        absent = together["residual_stress"].sel(state="plane_stress", component="zz")
        assert absent.isnull().all()


def test_grids_that_differ_stay_with_their_runs(store: Store) -> None:
    study = fake_study(sweep={"half_width": [10.0, 50.0], "points": [4, 6]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert together["points"].dtype.kind == "i"
        for case in study.cases():
            given = record(case.parameters)
            one = one_run(
                together, {"half_width": case.values["half_width"], "points": case.values["points"]}
            )
            assert one["x"].dims == ("x",)
            np.testing.assert_array_equal(one["x"], given.coordinates["x"])
            np.testing.assert_array_equal(
                one["residual_stress"], given.fields["residual_stress"][1]
            )
            edge = one["residual_stress"].sel(x=case.values["half_width"], method="nearest")
            assert edge.sizes == {"component": 3, "y": case.values["points"] + 1}


def test_grids_that_differ_by_rounding_are_one_grid(store: Store) -> None:
    study = fake_study(sweep={"half_width": [50.0, 50.0 * (1 + 2e-16)]})
    compute_here(study, store)
    with open_study(store.directory) as together:
        assert together["x"].dims == ("x",)
        assert "x" in together.indexes


@pytest.mark.parametrize(
    ("trouble", "status", "message"),
    [
        ("limit", "limit_load", "flows at 0.75"),
        ("bare", "not_converged", "increment 3"),
        ("raise", "error", "ZeroDivisionError: the stiffness is gone"),
        ("short", "error", "without a record"),
    ],
)
def test_failed_points_are_nan_with_status_and_message(
    store: Store, trouble: str, status: str, message: str
) -> None:
    compute_here(fake_study(trouble=trouble), store)
    with open_study(store.directory) as together:
        failed = together.sel(load_ratio=0.9)
        assert (failed["status"] == status).all()
        assert all(message in text for text in failed["message"].values.flat)
        assert failed["residual_stress"].isnull().all()
        assert failed["increments"].isnull().all()
        good = together.sel(load_ratio=0.3)
        assert (good["status"] == "ok").all()
        assert good["contact_pressure"].notnull().all()


def test_runs_not_computed_are_missing(store: Store) -> None:
    study = fake_study()
    compute_here(study, store)
    gone = next(study.cases())
    store.run_path(gone.id).unlink()
    combine(study, store, list(study.cases()))
    with open_study(store.dataset_path(study.id)) as together:
        statuses = together["status"].squeeze().values
        assert statuses.ravel().tolist() == ["missing", "ok", "ok", "ok"]


def test_a_study_of_which_nothing_is_computed_is_all_missing(store: Store) -> None:
    study = fake_study()
    store.save_study(study)
    combine(study, store, list(study.cases()))
    with open_study(store.directory) as together:
        assert (together["status"] == "missing").all()


def test_other_readers_agree(computed: ComputedStudy) -> None:
    study, store = computed
    with netCDF4.Dataset(store.dataset_path(study.id)) as file:
        assert file["hardening"][:].tolist() == ["none"]
        assert file["friction"][:].tolist() == [0.0, 0.4]
        assert file["increments"][:].tolist() == [[[10], [10]], [[10], [10]]]
        assert file["residual_stress"].chunking()[:3] == [1, 1, 1]


@pytest.mark.parametrize(("level", "copied"), [(1, True), (4, False)])
def test_fields_stay_compressed_as_they_are_in_the_files_of_runs(
    store: Store, level: int, copied: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a run's file is compressed otherwise, as by another version, its values are written."""
    stored, read, decompressed = layout.storage_of, frame._values, set()

    def compressed(variable: layout.Variable) -> dict[str, Any]:
        found = stored(variable)
        return found | ({"complevel": level} if "complevel" in found else {})

    def values(variable: h5py.Dataset) -> np.ndarray:
        decompressed.add(variable.name)
        return read(variable)

    study = fake_study(sweep={"friction": [0.0, 0.1]})
    monkeypatch.setattr(layout, "storage_of", compressed)
    compute_here(study, store)
    monkeypatch.setattr(frame, "_values", values)
    with open_netcdf(combine(study, store, list(study.cases())).path) as together:
        for case in study.cases():
            one = together.sel(friction=case.values["friction"]).squeeze()
            given = record(case.parameters).fields["residual_stress"][1]
            np.testing.assert_array_equal(one["residual_stress"], given)
    assert ("/residual_stress" in decompressed) is not copied


def test_combining_45_runs_takes_seconds(store: Store) -> None:
    sweep = {"load_ratio": [0.3, 0.5, 0.7], "friction": [i / 20 for i in range(15)]}
    study = fake_study(sweep=sweep, points=20)
    compute_here(study, store)
    with counted() as calls:
        combine(study, store, list(study.cases()))
    assert calls < 500_000


def test_open_study_takes_a_directory_a_study_or_a_file(computed: ComputedStudy) -> None:
    study, store = computed
    for path in (store.directory, store.study_path(study.id), store.dataset_path(study.id)):
        with open_study(str(path)) as together:
            assert together.attrs["id"] == study.id
            assert not together["residual_stress"].variable._in_memory


def test_open_study_says_what_it_needs(store: Store, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="must be a data set"):
        open_study(tmp_path / "nowhere")
    (tmp_path / "text.nc").write_text("not netCDF")
    with pytest.raises(StudyError, match="is not a file as Residua has written it"):
        open_study(tmp_path / "text.nc")
    for name in ("one", "two"):
        compute_here(fake_study(name), store)
    with pytest.raises(StudyError, match="several studies"):
        open_study(store.directory)


def test_one_run_prefers_what_succeeded_with_most_load_and_friction(store: Store) -> None:
    compute_here(fake_study(trouble="limit"), store)
    with open_study(store.directory) as together:
        best = one_run(together)
        assert (best["load_ratio"].item(), best["friction"].item()) == (0.3, 0.4)
        with pytest.raises(StudyError, match=r"flows at 0.75"):
            one_run(together, {"load_ratio": "0.9"})
        with pytest.raises(StudyError, match=r"one of 0.0, 0.4"):
            one_run(together, {"friction": "0.3"})
        with pytest.raises(StudyError, match=r"one of load_ratio, friction, hardening"):
            one_run(together, {"speed": "1"})


def test_grids_that_differ_in_scale_have_a_fraction_as_their_index(tmp_path: Path) -> None:
    """Runs of other lengths are compared at the same share of it, never at unlike places unsaid."""
    study, store = fake_study(sweep={"half_width": [10.0, 50.0]}), Store(tmp_path)
    compute_here(study, store)
    together = open_study(store.directory)
    assert "x" not in together.indexes and together["x"].dims[0] != "x"
    assert {"x_fraction"} <= set(together.indexes)
    assert together["x_fraction"].attrs["units"] == "1"
    narrow, wide = (together.sel(half_width=a).squeeze() for a in (10.0, 50.0))
    difference = wide["residual_stress"] - narrow["residual_stress"]
    assert difference.sizes["x"] == together.sizes["x"]
    assert "x" not in difference.coords, "the positions differ: none is told"
    there = together["x"].sel(x_fraction=1.0, method="nearest").squeeze()
    ratio = there.sel(half_width=50.0) / there.sel(half_width=10.0)
    assert ratio.item() == pytest.approx(5.0)
    alone = one_run(together.sel(half_width=[10.0]))
    assert "x" in alone.indexes and "x_fraction" not in alone.variables


def test_grids_that_differ_otherwise_have_no_index(tmp_path: Path) -> None:
    study = fake_study(sweep={"half_width": [10.0, 50.0], "points": [4, 6]})
    compute_here(study, Store(tmp_path))
    together = open_study(tmp_path)
    assert "x_fraction" not in together.variables


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_the_outcome_of_a_run_is_a_word_for_every_reader(
    store: Store, engine: Literal["h5netcdf", "netcdf4"]
) -> None:
    study = fake_study(trouble="limit")
    compute_here(study, store)
    with (
        open_study(store.dataset_path(study.id)) as ours,
        xr.open_dataset(store.dataset_path(study.id), engine=engine) as plain,
        xr.open_dataset(store.run_path(next(study.cases()).id), engine=engine) as run,
    ):
        for dataset in (ours, plain):
            ok = dataset.status == "ok"
            assert ok.sel(load_ratio=0.3).all()
            assert not ok.sel(load_ratio=0.9).any()
            assert (dataset.status.sel(load_ratio=0.9) == "limit_load").all()
            assert dataset.peak_contact_pressure.notnull().equals(ok)
        assert (run.status == "ok").all()


def test_no_outcome_is_made_up_between_runs(store: Store) -> None:
    study = fake_study(trouble="limit")
    compute_here(study, store)
    with open_study(store.dataset_path(study.id)) as dataset:
        between = dataset.drop_dims(["component", "stage", "body", "pass"], errors="ignore")
        between = between[["status", "peak_contact_pressure"]].interp(load_ratio=[0.4, 0.6, 0.8])
        assert set(between.status.values.ravel()) == {"ok", "limit_load"}
        assert between.peak_contact_pressure.isnull().all(), "beside a run that has no value"
        assert "status" not in dataset.mean("load_ratio")


def test_the_numbers_of_an_earlier_version_are_read_as_words(tmp_path: Path) -> None:
    earlier = ("ok", "limit_load", "not_converged", "audit_failed", "error", "missing")
    attributes = {"flag_values": np.arange(6, dtype=np.int8), "flag_meanings": " ".join(earlier)}
    codes = ("load_ratio", np.array([0, 1, 5], dtype=np.int8), attributes)
    old = xr.Dataset({"status": codes}, coords={"load_ratio": [0.1, 0.2, 0.3]})
    old.to_netcdf(tmp_path / "dataset.nc", engine="h5netcdf")
    with open_study(tmp_path / "dataset.nc", unchecked=True) as dataset:
        assert dataset.status.values.tolist() == ["ok", "limit_load", "missing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plain:
    """Parameters without one that every data set has as a dimension."""

    force: float = described(1.0, "force")


def _pressed(
    parameters: _Plain, values: Sequence[float], monitor: Callable[[float], None]
) -> Iterator[Record]:
    for value in values:
        fields = {"contact_pressure": (("s",), value * np.arange(3.0))}
        yield Record(
            parameters=replace(parameters, force=value), status=Status.OK,
            coordinates={"s": np.arange(3.0)}, fields=fields,
            scalars={"increments": 2.0, "contact_half_width": value}, symmetric=True,
        )  # fmt: skip


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_one_run_of_a_scene_without_usual_axes_has_numbers_without_dimensions(
    store: Store, engine: Literal["h5netcdf", "netcdf4"], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Canned(
        name="plain", summary="a force", parameters=_Plain, branch="force", records=_pressed
    )
    monkeypatch.setitem(SCENES, scene.name, scene)
    study = Study.from_dict({"name": "one", "scene": "plain", "parameters": {"force": 3.0}})
    compute_here(study, store, scene)
    with xr.open_dataset(store.dataset_path(study.id), engine=engine) as dataset:
        assert dataset.status.item() == "ok" and dataset.status.dims == ()
        assert dataset.increments.item() == 2
        assert dataset.contact_half_width.item() == 3.0
        assert dataset.contact_pressure.values.tolist() == [0.0, 3.0, 6.0]
