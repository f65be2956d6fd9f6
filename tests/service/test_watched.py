"""What keeps a container from living on when it answers no more."""

from __future__ import annotations

import runpy
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from tests.architecture.sources import ROOT
from tests.service.servers import PATIENCE, free_port, wait_until

PORT = free_port()
# Answers 503 to everything: a sign of life.
SERVER = f"""
from http.server import BaseHTTPRequestHandler, HTTPServer
class Answer(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_error(503)
HTTPServer(("127.0.0.1", {PORT}), Answer).serve_forever()
"""


def watched(*command: str, failures: int = 100) -> subprocess.Popen[bytes]:
    """Start a command under the watch."""
    watch = [str(ROOT / "docker" / "watched.py"), "--every", "0.1", "--failures", str(failures)]
    return subprocess.Popen(
        [sys.executable, *watch, f"http://127.0.0.1:{PORT}/", sys.executable, "-c", *command],
        stderr=subprocess.PIPE,
    )


@pytest.fixture
def server() -> Iterator[tuple[subprocess.Popen[bytes], psutil.Process]]:
    """A watch over a server that answers, and the server."""
    watch = watched(SERVER)
    with watch:
        inner = wait_until(lambda: psutil.Process(watch.pid).children())[0]
        wait_until(inner.net_connections)
        yield watch, inner
        if inner.is_running():
            inner.kill()


def test_what_answers_lives_and_is_ended_in_order(
    server: tuple[subprocess.Popen[bytes], psutil.Process],
) -> None:
    watch, inner = server
    with pytest.raises(subprocess.TimeoutExpired):
        watch.wait(timeout=1.0)
    watch.send_signal(signal.SIGTERM)  # as the engine does to stop a container
    assert watch.wait(timeout=PATIENCE) == 128 + signal.SIGTERM
    assert not inner.is_running()


def test_what_answers_no_more_is_ended() -> None:
    with watched("import time; time.sleep(600)", failures=3) as watch:
        inner = wait_until(lambda: psutil.Process(watch.pid).children())[0]
        assert watch.wait(timeout=PATIENCE) == 1
        assert not inner.is_running()
        assert watch.stderr is not None
        assert b"no answer 3 times in a row" in watch.stderr.read()


def test_the_exit_status_is_that_of_the_command() -> None:
    with watched("raise SystemExit(2)") as watch:
        assert watch.wait(timeout=PATIENCE) == 2


def test_kernels_of_the_image_are_copied_to_where_the_compiler_looks_for_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = runpy.run_path(str(ROOT / "docker" / "watched.py"))
    kernels, cache = tmp_path / "kernels", tmp_path / "cache"
    copy = module["copy_kernels"]
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    monkeypatch.setitem(copy.__globals__, "KERNELS", kernels)
    copy()
    assert not cache.exists()
    (kernels / "sweep").mkdir(parents=True)
    (kernels / "sweep" / "flow.nbi").write_bytes(b"compiled")
    for _ in range(2):  # a container that starts again
        copy()
        assert (cache / "sweep" / "flow.nbi").read_bytes() == b"compiled"


def test_a_file_system_that_takes_no_kernels_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = runpy.run_path(str(ROOT / "docker" / "watched.py"))["copy_kernels"]
    monkeypatch.setitem(copy.__globals__, "KERNELS", tmp_path)
    (tmp_path / "flow.nbi").write_bytes(b"compiled")
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/proc/kernels")
    copy()
    told = capsys.readouterr().err
    assert told.startswith("/proc/kernels: no compiled kernels: ")
    assert told.count("\n") == 1
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "flow.nbi").symlink_to("/proc/none/flow.nbi")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setitem(copy.__globals__, "KERNELS", tmp_path / "kernels")
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels" / "flow.nbi").write_bytes(b"compiled")
    copy()
    assert "cache: no compiled kernels: 1 files cannot be written" in capsys.readouterr().err
