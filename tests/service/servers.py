"""A service as its users meet it: a process of its own, and HTTP."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from tests.architecture.sources import ROOT

STARTUP = Path(__file__).with_name("startup")
PROGRAM = (
    "import sys; from service.app import serve; serve('127.0.0.1', int(sys.argv[1]), sys.argv[2])"
)

PATIENCE = 240.0
"""Seconds after which a test no longer waits for what must happen: many times what it takes, since
other work may have the cores."""
NOWHERE = {
    "RESIDUA_SCHEDULER": "tcp://127.0.0.1:1",
    "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "1s",
}
"""Settings of a service that computes nothing: it loads nothing for workers either."""

COARSE_PUNCH = {"smallest_element": 0.05, "growth": 2.5, "half_plane_size": 4}
"""Parameters that make a run of the punch a matter of a second."""


def environment(log: Path) -> dict[str, str]:
    """Return the environment in which processes know the fake scene and write to ``log``."""
    return os.environ | {
        "PYTHONPATH": os.pathsep.join([str(ROOT), str(STARTUP)]),
        "FAKE_SCENE_LOG": str(log),
        "RESIDUA_POLL_SECONDS": "0.3",  # a service that waits takes half of that at 0.1 s
        "RESIDUA_ATTEMPTS": "2",
        # Processes of dask that wait for minutes, as those of the package.
        "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
        "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "5s",
        "DASK_DISTRIBUTED__WORKER__MEMORY__MONITOR_INTERVAL": "1s",
        "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    }


def free_port() -> int:
    """Return a port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_until(condition: Callable[[], Any], seconds: float = PATIENCE, pause: float = 0.1) -> Any:
    """Return the first true answer of ``condition``, which is asked at intervals."""
    deadline = time.monotonic() + seconds
    while not (answer := condition()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(pause)
    return answer


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process that may have ended."""
    process.terminate()
    process.wait(timeout=PATIENCE)


@contextmanager
def worker_elsewhere(home: Path) -> Iterator[str]:
    """Run a scheduler with one worker in ``home``, and give its address."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = ["scheduler", "--host", "127.0.0.1", "--port", str(port)]
    worker = ["worker", address, "--nthreads", "1", "--local-directory", str(home)]
    worker += ["--no-nanny"]  # nothing kills it
    with ExitStack() as stack:
        log = stack.enter_context((home / "dask.log").open("ab"))
        for words in (scheduler, worker):
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *words, "--dashboard-address", "127.0.0.1:0"],
                cwd=home,
                env=environment(home / "computed.log"),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )
            stack.callback(end, process)
        yield address


@dataclass
class Server:
    """A service on the directory ``home``; may be stopped, killed and started again."""

    home: Path
    workers: int = 1
    settings: dict[str, str] = field(default_factory=dict)
    command: list[str] | None = None
    port: int = field(default_factory=free_port)
    process: subprocess.Popen[bytes] | None = None

    def __post_init__(self) -> None:
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=PATIENCE)

    @property
    def log(self) -> Path:
        """File with a line for each record the fake scene computed."""
        return self.home / "computed.log"

    @property
    def data(self) -> Path:
        """The data directory."""
        return self.home / "data"

    def start(self) -> Server:
        """Start the process, and wait until it answers."""
        self.home.mkdir(exist_ok=True)
        command = [sys.executable, "-c", PROGRAM, str(self.port), str(self.data)]
        if self.command:
            command = [*self.command, "--port", str(self.port), "--data", str(self.data)]
        with (self.home / "service.log").open("ab") as output:
            self.process = subprocess.Popen(
                command,
                cwd=self.home,
                env=environment(self.log) | {"RESIDUA_WORKERS": str(self.workers)} | self.settings,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )
        wait_until(self._answers)
        return self

    def kill(self) -> None:
        """End the process as a power cut would."""
        assert self.process is not None
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """Ask the process to end, and see that it ends in order."""
        assert self.process is not None
        self.process.send_signal(signal.SIGTERM)
        # The server ends its work, and then itself by the signal it was sent.
        assert self.process.wait(timeout=PATIENCE) == -signal.SIGTERM
        assert "Application shutdown complete" in (self.home / "service.log").read_text()

    def close(self) -> None:
        """Leave nothing running, and nothing open."""
        self.client.close()
        if self.process is not None and self.process.poll() is None:
            self.stop()

    def post(self, study: dict[str, Any]) -> str:
        """Submit a study, and return its id."""
        answer = self.client.post("/studies", json=study)
        assert answer.status_code in (200, 201), answer.text
        study_id: str = answer.json()["id"]
        return study_id

    def study(self, study_id: str) -> dict[str, Any]:
        """Return where a study stands."""
        answer = self.client.get(f"/studies/{study_id}")
        assert answer.status_code == 200, answer.text
        content: dict[str, Any] = answer.json()
        return content

    def finished(self, study_id: str) -> dict[str, Any]:
        """Wait for the end of a study, and return where it stands."""

        def ended() -> dict[str, Any] | None:
            study = self.study(study_id)
            return study if study["status"] not in ("accepted", "running") else None

        study: dict[str, Any] = wait_until(ended, pause=0.25)
        return study

    def computed(self) -> list[str]:
        """Return a line for each record that was computed."""
        return self.log.read_text().splitlines() if self.log.exists() else []

    def _answers(self) -> bool:
        assert self.process is not None
        assert self.process.poll() is None, (self.home / "service.log").read_text()
        try:
            return self.client.get("/health").status_code == 200
        except httpx.TransportError:
            return False


def fake_study(name: str, **parameters: Any) -> dict[str, Any]:
    """Return a study of the fake scene: two frictions, two loads, four runs in two paths."""
    return {
        "name": name,
        "scene": "fake",
        "parameters": parameters,
        "sweep": {"load_ratio": [0.25, 0.5], "friction": [0.0, 0.3]},
    }
