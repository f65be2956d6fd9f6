"""The file of a run: its variables, their order, and writers in several threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from studies import Store, Study, open_netcdf
from studies.storage import runfile, seal

RUN_ID = "0" * 32
NAMES = ("wide", "deep", "a", "zeta", "beta", "mu", "omega", "kappa", "b", "c")


def run(run_id: str = RUN_ID, names: tuple[str, ...] = NAMES) -> xr.Dataset:
    values = {name: ("x", np.full(50, float(number))) for number, name in enumerate(names)}
    return xr.Dataset(values, attrs={"id": run_id})


def names_in(path: Path) -> list[str]:
    with runfile.opened(path) as file:
        return [name for name in runfile.variables(file) if name in NAMES]


def test_variables_keep_their_order(tmp_path: Path) -> None:
    path = tmp_path / f"{RUN_ID}.nc"
    path.write_bytes(runfile.sealed(run()))
    assert names_in(path) == list(NAMES)


def test_a_file_that_does_not_tell_their_order_is_read(tmp_path: Path) -> None:
    path = tmp_path / f"{RUN_ID}.nc"
    run().to_netcdf(path, engine="netcdf4")
    seal.seal(path, f"run {RUN_ID}")
    assert sorted(names_in(path)) == sorted(NAMES)


def test_threads_write_at_once(tmp_path: Path) -> None:
    paths = [tmp_path / f"{number:032x}.nc" for number in range(40)]
    with ThreadPoolExecutor(4) as threads:
        list(threads.map(lambda path: path.write_bytes(runfile.sealed(run(path.stem))), paths))
    for path in paths:
        with runfile.opened(path) as file:
            found = {name: float(file[name][7]) for name in NAMES}
        assert found == {name: float(number) for number, name in enumerate(NAMES)}


def test_a_run_that_cannot_be_written_leaves_no_file_open(monkeypatch: pytest.MonkeyPatch) -> None:
    opened = []
    make = netCDF4.Dataset

    def watched(*args: object, **settings: object) -> netCDF4.Dataset:
        opened.append(make(*args, **settings))
        return opened[-1]

    monkeypatch.setattr(netCDF4, "Dataset", watched)
    wrong = run().assign(a=("x", [object()] * 50))
    with pytest.raises((TypeError, ValueError)):
        runfile.sealed(wrong)
    assert [file.isopen() for file in opened] == [False]


def test_a_run_of_an_earlier_version_has_its_outcome_in_the_catalogue(
    computed: tuple[Study, Store], store: Store
) -> None:
    study, theirs = computed
    (case, *_) = study.cases()
    with open_netcdf(theirs.run_path(case.id)) as now:
        codes = np.full(now["status"].shape, 1, dtype=np.int8)
        meanings = {"flag_meanings": "ok limit_load not_converged"}
        earlier = now.load().assign(status=(now["status"].dims, codes, meanings))
    path = store.run_path(case.id)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(runfile.sealed(earlier))
    assert runfile.row(path)["status"] == "limit_load"
