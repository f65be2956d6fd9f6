"""What the file of a run holds."""

from __future__ import annotations

import importlib.metadata
import json

import netCDF4
import numpy as np
import pytest

import solver
from solver.linear.solvers import chosen
from solver.results.quantities import QUANTITIES
from solver.results.record import Record, Status
from studies import Store, Study, open_netcdf
from studies.storage import provenance, ran
from studies.storage.dataset import run_content
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import FAKE, record

ComputedStudy = tuple[Study, Store]


def test_a_run_has_the_usual_sweep_dimensions_of_size_one(computed: ComputedStudy) -> None:
    study, store = computed
    case = next(study.cases())
    with open_netcdf(store.run_path(case.id)) as run:
        assert run["residual_stress"].dims == (
            "load_ratio", "friction", "hardening", "component", "y", "x",
        )  # fmt: skip
        assert run["residual_stress"].shape[:3] == (1, 1, 1)
        assert run["load_ratio"].item() == 0.3
        assert run["hardening"].item() == "none"
        assert list(run["stage"].values) == ["loaded", "unloaded"]


def test_stored_values_are_the_records_to_the_last_bit(computed: ComputedStudy) -> None:
    study, store = computed
    for case in study.cases():
        given = record(case.parameters)
        with open_netcdf(store.run_path(case.id)) as run:
            for name, (dimensions, values) in given.fields.items():
                kept = run[name].squeeze(["load_ratio", "friction", "hardening"])
                assert kept.dims == dimensions
                np.testing.assert_array_equal(kept, values)
            for name, number in given.scalars.items():
                assert run[name].item() == number


def test_the_file_of_a_run_does_not_depend_on_the_study(store: Store) -> None:
    swept = fake_study("swept", {"half_width": [10.0, 20.0]})
    compute_here(swept, store)
    (one, _) = swept.cases()
    other = Store(store.directory / "other")
    compute_here(fake_study("single", {"friction": [0.0]}, half_width=10.0), other)
    with open_netcdf(store.run_path(one.id)) as a, open_netcdf(other.run_path(one.id)) as b:
        assert a.drop_attrs(deep=False).identical(b.drop_attrs(deep=False))
        of_the_process = dict.fromkeys(["created", *ran.MEANINGS])
        assert a.attrs | of_the_process == b.attrs | of_the_process


def test_every_number_has_a_long_name_and_known_ones_have_units(computed: ComputedStudy) -> None:
    study, store = computed
    with open_netcdf(store.run_path(next(study.cases()).id)) as run:
        for name, variable in run.variables.items():
            assert variable.attrs["long_name"], name
        assert run["residual_stress"].attrs["units"] == "MPa"
        assert run["x"].attrs["units"] == "mm"
        assert run["friction"].attrs == {"long_name": "friction", "units": "1"}
        assert run["status"].item() == "ok"


def test_provenance_is_in_the_attributes(computed: ComputedStudy) -> None:
    study, store = computed
    case = next(study.cases())
    with open_netcdf(store.run_path(case.id)) as run:
        assert run.attrs["Conventions"] == "CF-1.11"
        assert run.attrs["id"] == case.id
        assert json.loads(run.attrs["parameters"]) == case.values
        versions = json.loads(run.attrs["versions"])
        assert versions.keys() == {
            "solver", "numba", "mkl", "numpy", "scipy", "scikit-fem", "xarray",
        }  # fmt: skip
        assert versions["numpy"] == np.__version__
        assert versions["solver"] == solver.__version__
        assert run.attrs["linear_solver"] == chosen()
        assert run.attrs["created"]
        assert len(run.attrs["solver_source"]) == 32


@pytest.mark.parametrize(
    ("asked", "told"), [("superlu", "superlu"), ("nonsense", "none"), ("auto", chosen())]
)
def test_the_linear_solver_that_ran_is_told_also_by_a_run_that_broke(
    asked: str, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RESIDUA_LINEAR_SOLVER", asked)
    case = next(fake_study().cases())
    assert run_content(FAKE, case, record(case.parameters)).attrs["linear_solver"] == told
    assert run_content(FAKE, case, "lost").attrs["linear_solver"] == told


def test_a_library_that_is_not_installed_is_told_as_none(monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.metadata.version

    def without_mkl(name: str) -> str:
        if name == "mkl":
            raise importlib.metadata.PackageNotFoundError(name)
        return known(name)

    monkeypatch.setattr(importlib.metadata, "version", without_mkl)
    assert provenance._versions.__wrapped__() == provenance._versions() | {"mkl": "none"}


def test_counts_are_integers_with_a_fill_value_and_other_readers_agree(
    computed: ComputedStudy,
) -> None:
    study, store = computed
    with netCDF4.Dataset(store.run_path(next(study.cases()).id)) as file:
        assert file["increments"].dtype == np.int32
        assert file["increments"]._FillValue == -1
        assert file["increments"][:].item() == 10
        assert file["message"][:].item() == ""
        assert file["residual_stress"].filters()["shuffle"]
        assert file["residual_stress"].filters()["complevel"] == 1


def test_a_dimension_without_coordinate_is_refused() -> None:
    case = next(fake_study().cases())
    lost = Record(
        parameters=case.parameters,
        status=Status.OK,
        fields={"plastic_strain": (("x",), np.ones(3))},
    )
    with pytest.raises(ValueError, match="plastic_strain"):
        run_content(FAKE, case, lost)


def test_every_quantity_of_the_table_has_a_unit_that_is_si_or_one() -> None:
    si = {"1", "MPa mm^0.5", "MPa^2 mm", "mm", "mm2", "rad", "MPa", "N", "N/mm", "N mm", "s"}
    labels = {name for name, each in QUANTITIES.items() if not each.units}
    assert labels == {
        "component", "stage", "body", "line", "point", "contact", "part", "singular", "tip"
    }  # fmt: skip
    assert {each.units for each in QUANTITIES.values() if each.units} == si
