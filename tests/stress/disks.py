"""A disk that is full: nothing lost, nothing untrue."""

from __future__ import annotations

import contextlib
import subprocess
import time

from tests.service.servers import Server, fake_study, wait_until
from tests.stress.measure import Figure


def full_disk(server: Server) -> list[Figure]:
    """A small disk that fills up in the middle of a study, and is given room again."""
    server.stop()
    server.data.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", "size=40m", "tmpfs", str(server.data)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        return [Figure("not allowed to mount a small disk here: seen by the tests only", 1)]
    try:
        server.start()
        server.finished(server.post(fake_study("small")))  # so that the size of a run is known
        study = fake_study("full", seconds=0.1)
        study["sweep"] = {"friction": [i / 200 for i in range(60)]}
        study_id = server.post(study)
        wait_until(lambda: server.study(study_id)["counts"].get("ok", 0) >= 5)
        ballast = server.data / "ballast"
        with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(4096))
        began = time.monotonic()
        health = wait_until(lambda: not_ready(server), 60.0)
        told = time.monotonic() - began
        refused = server.client.post("/studies", json=fake_study("refused")).status_code
        ballast.unlink()
        end = server.finished(study_id)
    finally:
        server.close()
        subprocess.run(["umount", "-l", str(server.data)], check=False)
    log = (server.home / "service.log").read_text()
    return [
        Figure("health is not 503 while the disk is full", health != 503, most=0),
        Figure("the health tells of it after", told, "s", most=30.0),
        Figure("status of a study posted meanwhile is not 507", refused != 507, most=0),
        Figure("runs not ok at the end", 60 - end["counts"].get("ok", 0), most=0),
        Figure("tracebacks in the log", log.count("Traceback"), most=0),
    ]


def not_ready(server: Server) -> int:
    """Return the status of the health when it is not 200."""
    status = server.client.get("/health").status_code
    return status if status != 200 else 0
