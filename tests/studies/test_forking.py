"""The process whose forks are the workers: a fork of one of ours, or a new one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Self

import dask
import distributed
import pytest

from studies.execution import cluster
from studies.execution.cluster import own_workers
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


def test_workers_end_though_ctrl_c_comes_while_they_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their start ends after the caller has reacted; their folder is there until they have ended.

    The signal is noted by another thread, as if it had come just before the caller waits.
    """
    ended: list[bool] = []
    reacted = threading.Event()

    def interrupted(*_: object) -> None:
        reacted.set()
        raise KeyboardInterrupt

    class Starting:
        def __init__(self, **_: object) -> None:
            self.folder = Path(dask.config.get("temporary-directory"))
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
            signal.pthread_kill(threading.get_ident(), signal.SIGINT)
            self.reacted = reacted.wait(60.0)

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *error: object) -> None:
            ended.append(self.reacted and self.folder.is_dir())

    monkeypatch.setattr(distributed, "LocalCluster", Starting)
    monkeypatch.setattr(cluster, "prepare_workers", lambda: "spawn")
    before = signal.signal(signal.SIGINT, interrupted)
    try:
        with pytest.raises(KeyboardInterrupt), own_workers(1):
            pytest.fail("they had started")
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [True]
