"""No file in the directory where service or command is started is run for a module of theirs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT
from tests.service.servers import Server, environment, fake_study

COMMAND = """import sys
from residua.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""
TRAP = "from pathlib import Path; Path({told!r}).open('a').write(__name__ + '\\n')\n"
FOREIGN = ("h5py", "netCDF4", "solver", "studies", "service", "anyio", "multiprocessing", "random")
"""Modules of the product, of libraries and of Python."""


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A directory with files that are named like modules, and that tell if they are run."""
    home = tmp_path / "home"
    home.mkdir()
    for name in FOREIGN:
        (home / f"{name}.py").write_text(TRAP.format(told=str(tmp_path / "told")))
    return home


def installed(tmp_path: Path) -> list[str]:
    """Return the command as pip installs it: a script in a folder that has nothing else."""
    script = tmp_path / "bin" / "residua"
    script.parent.mkdir()
    script.write_text(COMMAND)
    return [sys.executable, str(script)]


def test_files_where_the_service_is_started_are_not_run(home: Path, tmp_path: Path) -> None:
    command = [*installed(tmp_path), "serve"]
    (home / "own.py").write_text("from pathlib import Path; Path(__file__ + '.run').touch()\n")
    service = Server(home, settings={"RESIDUA_PARTS": "own.py"}, command=command).start()
    try:
        assert service.finished(service.post(fake_study("here")))["status"] == "successful"
        posted = (ROOT / "data" / "scenes" / "pin.toml", ROOT / "data" / "scenes" / "pin.msh")
        files = zip(("scene", "meshes"), posted, strict=True)
        answer = service.client.post(
            "/scenes", files={name: (path.name, path.read_bytes()) for name, path in files}
        )
        assert answer.status_code == 201, answer.text
    finally:
        service.close()
    assert not (tmp_path / "told").exists(), (tmp_path / "told").read_text()
    assert (home / "own.py.run").exists(), "a user's own parts are run"


def test_files_where_a_study_is_run_are_not_run(home: Path, tmp_path: Path) -> None:
    (home / "study.toml").write_text(
        'name = "here"\nscene = "fake"\n[sweep]\nload_ratio = [0.25, 0.5]\nfriction = [0.0, 0.3]\n'
    )
    done = subprocess.run(
        [*installed(tmp_path), "run", "study.toml", "--out", "out", "--workers", "1"],
        cwd=home,
        env=environment(tmp_path / "computed.log"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "told").exists(), (tmp_path / "told").read_text()


def test_started_as_a_module_the_service_leaves_the_directory_alone(tmp_path: Path) -> None:
    """Python looks there for ``python -m residua``; from its start on, the service does not."""
    home = tmp_path / "home"
    home.mkdir()
    (home / "h5py.py").write_text(TRAP.format(told=str(tmp_path / "told")))
    service = Server(home, command=[sys.executable, "-m", "residua", "serve"]).start()
    try:
        study = service.post(fake_study("here"))
        assert service.finished(study)["status"] == "successful"
        assert service.client.get(f"/studies/{study}/dataset.nc").status_code == 200
    finally:
        service.close()
    assert not (tmp_path / "told").exists()


@pytest.mark.parametrize("name", ["solver", "studies", "service"])
def test_packages_of_others_on_the_path_are_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").touch()
    done = subprocess.run(
        [*installed(tmp_path), "serve"],
        env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert f"Python finds the package {name!r} at {tmp_path / name}.py" in done.stderr
    assert done.stderr.count("\n") == 1
