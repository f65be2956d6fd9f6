"""The process whose forks are the workers: a fork of one of ours, or a new one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT

pytestmark = pytest.mark.processes

REPORT = """
import os, sys
from pathlib import Path

LOADED = []

def report(pipe):
    files = [os.readlink(each) for each in Path("/proc/self/fd").iterdir() if each.exists()]
    pipe.send({
        "inherited": LOADED,
        "secret": any("secret" in file for file in files),
        "parent": Path(f"/proc/{os.getppid()}/cmdline").read_text().split("\\0")[1],
        "cwd of the server": os.readlink(f"/proc/{os.getppid()}/cwd"),
    })
"""

PROGRAM = """
import json, multiprocessing, os, sys, threading
import report
from studies.execution import forking

if __name__ == "__main__":
    forking.NEEDED = ("json", "studies.execution.loaded")
    report.LOADED.append("here")
    secret = open("secret", "w")
    end = threading.Event()
    if "threads" in sys.argv:
        threading.Thread(target=end.wait).start()
    setting = {forking.FORK_HERE: "1"} if "ours" in sys.argv else {}
    with forking.variables(setting):
        method = forking.prepare({"OMP_NUM_THREADS": 1})
    context = multiprocessing.get_context(method)
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=report.report, args=(sender,))
    process.start()
    told = receiver.recv()
    process.join()
    end.set()
    print(json.dumps({"method": method, "end": process.exitcode, **told}))
"""


@pytest.mark.parametrize("words", [["ours"], ["ours", "threads"], []], ids=" and ".join)
def test_a_process_of_ours_with_one_thread_is_forked_without_its_files(
    words: list[str], tmp_path: Path
) -> None:
    (tmp_path / "report.py").write_text(REPORT)
    (tmp_path / "program.py").write_text(PROGRAM)
    outside = {key: each for key, each in os.environ.items() if key != "OMP_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "program.py", *words],
        env=outside | {"PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    forked = words == ["ours"]
    assert json.loads(done.stdout) == {
        "method": "forkserver",
        "end": 0,
        "inherited": ["here"] if forked else [],
        "secret": False,
        "parent": "program.py" if forked else "-c",
        "cwd of the server": "/",
    }
