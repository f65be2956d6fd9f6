"""Every script and notebook of `examples/` runs, and what it asserts holds."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from residua.cli import main
from tests.architecture.sources import ROOT
from tests.programs import Programs

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


def test_the_page_of_the_examples_names_each() -> None:
    page = (ROOT / "examples/README.md").read_text()
    assert not [path.name for path in EXAMPLES + NOTEBOOKS if f"]({path.name})" not in page]


def test_there_are_examples() -> None:
    assert "own_law.py" in {path.name for path in EXAMPLES}
    assert "study_to_figure.ipynb" in {path.name for path in NOTEBOOKS}


def run(file: Path, folder: Path, programs: Programs) -> None:
    paths = [str(ROOT), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    environment["RESIDUA_WORKERS"] = "1"  # of the service: each imports for seconds
    done = programs.run(file, folder, environment, strict=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.processes
@pytest.mark.parametrize(
    ("program", "code", "told"),
    [
        ("print(5)", 0, ""),
        ("import sys\nsys.exit('why')", 1, "why\n"),
        ("import sys\nsys.exit(3)", 3, ""),
        ("import warnings\nwarnings.warn('old', stacklevel=1)", 1, "UserWarning: old\n"),
    ],
)
def test_a_program_ends_as_python_would_end_it(
    program: str, code: int, told: str, tmp_path: Path, programs: Programs
) -> None:
    (tmp_path / "program.py").write_text(program)
    done = programs.run(tmp_path / "program.py", tmp_path, os.environ, strict=True)
    assert done.returncode == code and done.stderr.endswith(told)
    assert done.stdout == ("5\n" if "print" in program else "")


@pytest.mark.pages
@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(script: Path, tmp_path: Path, programs: Programs) -> None:
    run(script, tmp_path, programs)
    assert "assert" in script.read_text(), "an example checks what it shows"


@pytest.mark.pages
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_cells_of_a_notebook_run_after_make_run(
    notebook: Path, tmp_path: Path, programs: Programs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They run on a coarse and small form of the study that `make run` computes."""
    study = (ROOT / "data/studies/punch.toml").read_text()
    coarse = (
        '[parameters]\naccuracy = "draft"\nsmallest_element = 0.1\ngrowth = 3.0\n'
        "load_step = 0.25\nunload_steps = 1"
    )
    study = study.replace("[parameters]", coarse)
    study = study.replace("[0.0, 0.1, 0.2, 0.3, 0.4]", "[0.0, 0.2]")
    study = study.replace('["none", "isotropic", "kinematic"]', '["isotropic", "kinematic"]')
    (tmp_path / "punch.toml").write_text(study)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "punch.toml", "--out", "out", "--workers", "0"]) == 0
    cells = json.loads(notebook.read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert not any(cell.get("outputs") for cell in cells), "a notebook is kept without its outputs"
    assert "assert" in "".join(code), "a notebook checks what it shows"
    (tmp_path / "cells.py").write_text("\n".join(code))
    run(tmp_path / "cells.py", tmp_path, programs)
    assert (tmp_path / "punch.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "punch.pdf").read_bytes().startswith(b"%PDF")
