"""Imports run one way: residua -> service -> studies -> solver."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from studies.kinds import KINDS
from tests.architecture.sources import PACKAGES, ROOT, imported, modules

DATA = {"dask", "distributed", "xarray", "h5netcdf", "h5py", "netCDF4", "zarr", "pandas"}
WEB = {"fastapi", "starlette", "uvicorn", "httpx", "pydantic", "pydantic_settings"}
FORBIDDEN = {
    "solver": {"studies", "service", "residua", "tests", "matplotlib"} | DATA | WEB,
    "studies": {"service", "residua", "tests", "fastapi", "starlette", "uvicorn"},
    "service": {"residua", "tests", "dask", "distributed", "netCDF4"},
    "residua": {"tests", "matplotlib", "fastapi", "starlette", "uvicorn"} | DATA,
}


def imports(package: str) -> dict[str, set[str]]:
    """What each module of a package imports."""
    return {str(m): imported((ROOT / m).read_text(), package) for m in modules(package)}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_imports_against_the_direction(package: str) -> None:
    found = imports(package)
    assert found, f"{package} has no modules"
    breaches = {m: names & FORBIDDEN[package] for m, names in found.items()}
    assert not {m: sorted(names) for m, names in breaches.items() if names}


def test_two_modules_of_studies_import_dask() -> None:
    users = {m for m, names in imports("studies").items() if names & {"dask", "distributed"}}
    assert users == {"studies/execution/workers.py", "studies/execution/grid.py"}


def test_what_draws_is_in_its_folder() -> None:
    users = {Path(m) for m, names in imports("studies").items() if "matplotlib" in names}
    of_kinds = {path for path in users if path.match("studies/kinds/*/figure.py")}
    assert {path.parent for path in users - of_kinds} == {Path("studies/views/plots")}


def test_a_kind_of_study_is_known_in_its_folder_alone() -> None:
    """Others know `Kind` and the list; what fits parameters, and predicts in cells, has a name."""
    of_kinds = re.compile(rf"studies\.kinds\.(?:{'|'.join(KINDS)})\b")
    texts = {
        path.as_posix(): (ROOT / path).read_text() for each in PACKAGES for path in modules(each)
    }
    users = {path for path, text in texts.items() if of_kinds.search(text)}
    assert {path for path in users if not path.startswith("studies/kinds/")} == {
        "residua/commands.py", "service/reading.py",
        "studies/views/predict.py",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("import dask.array as da", "dask"),
        ("from distributed.client import Client", "distributed"),
        ("def later():\n    from dask import delayed", "dask"),
        ("if True:\n    import xarray", "xarray"),
        ("from . import record", "solver"),
    ],
)
def test_an_import_is_seen_wherever_it_stands(line: str, name: str) -> None:
    assert imported(line, "solver") == {name}
