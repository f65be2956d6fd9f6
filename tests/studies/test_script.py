"""A script that its workers would run anew is told so before any of them starts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT

pytestmark = pytest.mark.processes

STUDY = """
from studies import Store, run_study
from tests.studies import fakes

content = {"name": "fake", "scene": "fake", "sweep": {"load_ratio": [0.3]}}
"""
RUN = 'print(run_study(content, Store("out"), workers=1).ok)\n'
SWEEP = """
from studies import sweep


def twice(a):
    return {"b": 2 * a}


print(float(sweep(twice, {"a": [1, 2]}, workers=WORKERS).b.sum()))
"""


def started(
    text: str, folder: Path, *options: str, given: str = ""
) -> subprocess.CompletedProcess[str]:
    """Run a text as a script, in a folder."""
    script = folder / "own script.py"
    script.write_text(text)
    return subprocess.run(
        [sys.executable, *options, script.name],
        cwd=folder, input=given, capture_output=True, text=True, timeout=120, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "line"),
    [(STUDY + RUN, 6), (STUDY + f"def main():\n    {RUN}\n\nmain()\n", 10),
     (SWEEP.replace("WORKERS", "2"), 9)],
)  # fmt: skip
def test_a_script_without_the_guard_is_refused_before_workers_start(
    text: str, line: int, tmp_path: Path
) -> None:
    done = started(text, tmp_path)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("Traceback") == 1, "one process, one error"
    assert done.stderr.splitlines()[-1] == (
        f"studies.errors.StudyError: script = 'own script.py': line {line} must stand under "
        '`if __name__ == "__main__":`, since worker processes import the script'
    )


def test_a_script_with_the_guard_computes(tmp_path: Path) -> None:
    done = started(f'{STUDY}\nif __name__ == "__main__":\n    {RUN}', tmp_path)
    assert (done.returncode, done.stdout) == (0, "True\n"), done.stderr


def test_a_sweep_in_this_process_needs_no_guard(tmp_path: Path) -> None:
    done = started(SWEEP.replace("WORKERS", "1"), tmp_path)
    assert (done.returncode, done.stdout) == (0, "6.0\n"), done.stderr


ASK = "from studies.execution.script import check_script\n"


@pytest.mark.parametrize(
    "text",
    [
        'if "__main__" == __name__:\n    check_script()',
        'def main():\n    check_script()\n\n\nif __name__ == "__main__":\n    main()',
        'if __name__ != "__main__":\n    raise SystemExit\ncheck_script()',
    ],
)
def test_every_form_of_the_guard_is_known(text: str, tmp_path: Path) -> None:
    done = started(ASK + text, tmp_path)
    assert done.returncode == 0, done.stderr


def test_what_is_typed_has_no_file_that_workers_import(tmp_path: Path) -> None:
    for options in (["-c", f"{ASK}check_script()"], ["-"]):
        subprocess.run(
            [sys.executable, *options],
            cwd=tmp_path, input=f"{ASK}check_script()", text=True, timeout=60, check=True,
        )  # fmt: skip
    done = started("x = 1\n", tmp_path, "-i", given=f"{ASK}check_script()\nprint(x)\n")
    assert done.stdout == "1\n"
    assert "Error" not in done.stderr


def test_an_if_that_only_names_the_module_is_no_guard(tmp_path: Path) -> None:
    done = started(ASK + "if __name__:\n    pass\ncheck_script()", tmp_path)
    assert done.returncode == 1
    assert "must stand under" in done.stderr
