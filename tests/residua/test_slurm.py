"""Scripts for sbatch."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from residua.cli import main
from tests.studies.conftest import write_study


@pytest.mark.processes
def test_a_script_has_the_tasks_and_is_one_for_the_shell(tmp_path: Path) -> None:
    study, out, file = write_study(tmp_path), tmp_path / "o ut", tmp_path / "job.sbatch"
    command = ["slurm", str(study), "--out", str(out), "--script", str(file), "--tasks", "8"]
    for more, words in (
        (
            [],
            [
                "--array=1-8",
                f"--out '{out}' --part \"$SLURM_ARRAY_TASK_ID/8\"",
                "OMP_NUM_THREADS=1",
            ],
        ),
        (["--with-scheduler"], ["--ntasks=8", "--scheduler-file", "DASK_DISTRIBUTED__COMM__TLS__"]),
    ):
        assert main([*command, *more]) == 0
        text = file.read_text()
        assert text.startswith("#!/bin/sh\n#SBATCH --job-name=fake\n")
        assert all(word in text for word in words)
        subprocess.run(["sh", "-n", str(file)], check=True)
    assert not out.exists()


@pytest.mark.parametrize("option", [["--time", "soon"], ["--memory", "2 GB"]])
def test_what_sbatch_does_not_take_is_refused(
    tmp_path: Path, option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    study, file = write_study(tmp_path), tmp_path / "job.sbatch"
    assert main(["slurm", str(study), "--script", str(file), *option]) == 2
    assert f"{option[0]} = {option[1]!r}: must be" in capsys.readouterr().err
    assert not file.exists()


def test_a_study_that_chooses_its_runs_is_computed_by_parts_or_by_a_scheduler(
    tmp_path: Path,
) -> None:
    refine = '[refine]\nof = ["peak_contact_pressure"]\n'
    study = write_study(tmp_path)
    study.write_text(study.read_text() + refine)
    file = tmp_path / "job.sbatch"
    command = ["slurm", str(study), "--script", str(file)]
    assert main(command) == 0
    assert "--part" in file.read_text()
    assert main([*command, "--with-scheduler"]) == 0
    assert "--part" not in file.read_text()
