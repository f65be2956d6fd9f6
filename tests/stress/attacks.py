"""Processes killed, stopped and ended at random, and files damaged in between."""

from __future__ import annotations

import contextlib
import random
import shutil
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil

from studies import open_netcdf
from tests.service.servers import Server, fake_study, wait_until
from tests.stress.measure import Figure, process_of, restarted

ATTACKS = 200
SIGNALS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM)
FRICTIONS, LOADS = 10, (0.25, 0.5, 0.75)
Damage = Callable[[Path, random.Random], object]


def flipped(path: Path, chance: random.Random) -> None:
    """Change some bytes of a file."""
    content = bytearray(path.read_bytes())
    for at in chance.sample(range(len(content)), min(len(content), 50)):
        content[at] ^= 1 << chance.randrange(8)
    path.write_bytes(content)


def cut_off(path: Path, chance: random.Random) -> None:
    """Leave the beginning of a file."""
    content = path.read_bytes()
    path.write_bytes(content[: chance.randrange(len(content) + 1)])


def deleted(path: Path, _: random.Random) -> None:
    """Delete a file."""
    path.unlink()


def swapped(path: Path, chance: random.Random) -> None:
    """Put another file of its kind in place of a file."""
    others = [*path.parents[1].rglob(f"*{path.suffix}")]
    other = chance.choice(others)
    if other != path:
        shutil.copyfile(other, path)


DAMAGES: tuple[Damage, ...] = (flipped, cut_off, deleted, swapped)


class Attacked:
    """A service under attack, its studies, and what it has told that is not true.

    A number is known beforehand: the fake scene gives stress and strain by the parameters.
    """

    def __init__(self, server: Server, seed: int) -> None:
        self.server, self.chance = server, random.Random(seed)
        self.studies: list[str] = []
        self.stopped: list[psutil.Process] = []
        self.damaged, self.wrong, self.untrue, self.checked = 0, 0, 0, 0

    def post(self) -> None:
        """Post a study of runs that no other has, again while the service cannot take it."""
        first = len(self.studies) * FRICTIONS
        study = fake_study(f"attacked-{len(self.studies)}", seconds=0.1)
        study["sweep"] = {
            "load_ratio": LOADS,
            "friction": [(first + k) / 10_000 for k in range(FRICTIONS)],
        }

        def posted() -> httpx.Response | None:
            answer = self.ask("POST", "/studies", json=study)
            again = answer is None or answer.status_code == 503  # queue or catalogue is made again
            return None if again else answer

        answer = wait_until(posted, 60.0)
        assert answer.status_code in (200, 201), answer.text
        self.studies.append(answer.json()["id"])

    def ask(self, method: str, path: str, **given: Any) -> httpx.Response | None:
        """Return an answer; None where the service was just ended."""
        try:
            return self.server.client.request(method, path, timeout=20.0, **given)
        except httpx.HTTPError:
            return None

    def runs(self) -> list[Path]:
        """Return the files of runs."""
        return sorted(self.server.data.glob("runs/*.nc"))

    def attack(self) -> None:
        """Send a signal to the service or one of its processes; those stopped before go on."""
        service = process_of(self.server)
        family = [service, *service.children(recursive=True)]
        victim, how = self.chance.choice(family), self.chance.choice(SIGNALS)
        if how is not signal.SIGSTOP or self.chance.random() < 0.5:
            self.go_on()
        with contextlib.suppress(psutil.NoSuchProcess):
            victim.send_signal(how)
        if victim != service:
            self.stopped += [victim] if how is signal.SIGSTOP else []
        elif how is signal.SIGSTOP:
            time.sleep(0.2)
            victim.send_signal(signal.SIGCONT)
        else:
            self.go_on()
            assert self.server.process is not None
            self.server.process.wait(timeout=60.0)
            if self.chance.random() < 0.5:
                self.damage()
            self.server.start()

    def go_on(self) -> None:
        """Let stopped processes go on."""
        for each in self.stopped:
            with contextlib.suppress(psutil.NoSuchProcess):
                each.send_signal(signal.SIGCONT)
        self.stopped.clear()

    def damage(self) -> None:
        """Damage a file of a run or a study, or the catalogue, or the queue."""
        data = self.server.data
        kinds = ("runs/*.nc", "studies/*/dataset.nc", "studies/*/made.json", "*.sqlite")
        files = sorted(data.glob(self.chance.choice(kinds)))
        if files:
            path = self.chance.choice(files)
            with contextlib.suppress(FileNotFoundError, shutil.SameFileError):
                self.chance.choice(DAMAGES)(path, self.chance)
                self.damaged += 1

    def look(self) -> None:
        """Compare what the service hands out with the truth."""
        listed = self.ask("GET", f"/runs?limit=50&offset={self.chance.randrange(300)}")
        if listed is not None and listed.status_code == 200:
            for run in listed.json()["items"]:
                if run["status"] == "ok":
                    self.checked += 1
                    told = run["scalars"]["max_plastic_strain"]
                    self.wrong += told != run["parameters"]["load_ratio"]
        study_id = self.chance.choice(self.studies)
        state = self.ask("GET", f"/studies/{study_id}")
        answer = self.ask("GET", f"/studies/{study_id}/dataset.nc")
        if answer is None:
            return
        whole = answer.status_code == 200 and self.true(answer.content)
        done = state is not None and state.status_code == 200
        if done and state is not None and state.json()["status"] == "successful":
            # 503: it was damaged, and is made again
            self.untrue += not (whole or answer.status_code == 503)

    def true(self, content: bytes) -> bool:
        """Count the wrong numbers of a data set; return whether it has all."""
        path = self.server.home / "sent.nc"
        path.write_bytes(content)
        with open_netcdf(path) as dataset:
            if "max_plastic_strain" not in dataset:  # no run is ok
                return False
            strain, stress = dataset["max_plastic_strain"], dataset["residual_stress"]
            there = strain.notnull()
            right = (strain == dataset["load_ratio"]) | ~there
            expected = dataset["load_ratio"] * (1 + dataset["friction"])
            close = np.isclose(stress, expected.broadcast_like(stress), rtol=1e-6) | stress.isnull()
            self.checked += int(there.sum())
            self.wrong += int((~right).sum()) + int((~close).sum())
            return bool(there.all())


def attacks(server: Server, count: int = ATTACKS, seed: int = 7) -> list[Figure]:
    """200 signals to the service and its processes, files damaged in between."""
    restarted(server, RESIDUA_ATTEMPTS="100000", RESIDUA_GRACE_SECONDS="2")
    attacked = Attacked(server, seed)
    attacked.post()
    server.finished(attacked.studies[0])
    for number in range(count):
        if number % 10 == 0:  # workers need some seconds to start
            attacked.go_on()
            attacked.post()
            stored = len(attacked.runs())
            wait_until(lambda: len(attacked.runs()) > stored, 300.0)  # noqa: B023, called at once
        attacked.attack()
        time.sleep(attacked.chance.uniform(0.2, 1.2))
        if number % 2:
            attacked.damage()
        attacked.look()
    attacked.go_on()
    left = ended(server, attacked.studies)
    for study_id in attacked.studies:  # a worker that dies with it three times fails a run
        content = wait_until(partial(fetched, server, study_id), 120.0)
        attacked.untrue += not attacked.true(content)
    return [
        Figure("attacks", count),
        Figure("files damaged", attacked.damaged),
        Figure("studies, each of 30 runs", len(attacked.studies)),
        Figure("studies lost or not successful at the end", left, most=0),
        Figure("studies falsely successful", attacked.untrue, most=0),
        Figure("numbers handed out and compared", attacked.checked),
        Figure("of these wrong", attacked.wrong, most=0),
    ]


def ended(server: Server, studies: list[str]) -> int:
    """Wait for the end of all studies, with retries of those that failed; count the others."""
    for _ in range(5):
        states = [wait_until(partial(end, server, each), 300.0) for each in studies]
        failed = [each for each, state in zip(studies, states, strict=True) if state == "failed"]
        for each in failed:
            server.client.post(f"/studies/{each}/retry")
        if not failed:
            break
    return sum(state != "successful" for state in states)


def end(server: Server, study_id: str) -> str:
    """Return the last state of a study; empty while it is computed, or the queue is made again."""
    answer = server.client.get(f"/studies/{study_id}")
    state = "lost" if answer.status_code == 404 else ""
    if answer.status_code == 200:
        state = answer.json()["status"]
    return state if state not in ("accepted", "running") else ""


def fetched(server: Server, study_id: str) -> bytes | None:
    """Return a data set; None while it is made again."""
    answer = server.client.get(f"/studies/{study_id}/dataset.nc")
    return answer.content if answer.status_code == 200 else None
