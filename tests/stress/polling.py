"""Many pollers ask for a study while it is computed."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import Counter
from dataclasses import dataclass, field

from tests.service.servers import Server, fake_study
from tests.stress.measure import Figure, cpu_seconds, megabytes, process_of, quantile

POLLERS = 300
PAUSE = 1.0
"""Seconds a poller rests between two questions."""


@dataclass(slots=True)
class Answers:
    """Times and statuses of all answers."""

    seconds: list[float] = field(default_factory=list)
    statuses: Counter[int] = field(default_factory=Counter)


async def ask(path: str, port: int, answers: Answers, until: float) -> None:
    """Ask for ``path`` over one connection, again and again.

    Plain sockets: an HTTP library would take more of the two cores than the service does.
    """
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    with contextlib.closing(writer):
        while time.monotonic() < until:
            began = time.monotonic()
            writer.write(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            head = (await reader.readuntil(b"\r\n\r\n")).decode()
            fields = dict(line.lower().split(": ", 1) for line in head.splitlines()[1:] if line)
            await reader.readexactly(int(fields["content-length"]))
            answers.seconds.append(time.monotonic() - began)
            answers.statuses[int(head.split()[1])] += 1
            await asyncio.sleep(PAUSE)


async def crowd(paths: list[str], port: int, answers: Answers, seconds: float) -> None:
    """Let all pollers ask, their starts spread over one pause."""
    until = time.monotonic() + seconds
    async with asyncio.TaskGroup() as group:
        for number in range(POLLERS):
            group.create_task(ask(paths[number % len(paths)], port, answers, until))
            await asyncio.sleep(PAUSE / POLLERS)


def pollers(server: Server, seconds: float = 90.0) -> list[Figure]:
    """300 pollers ask for a study and its like while it is computed; memory is watched.

    It is compared over the second half: in the first one the threads of the service start, and each
    makes its largest answer. What grows with requests grows in both.
    """
    study = fake_study("polled", seconds=0.2)
    study["sweep"] = {
        "load_ratio": [0.1 * i for i in range(1, 11)],
        "friction": [i / 2000 for i in range(int(seconds))],
    }
    study_id = server.post(study)
    process, first, answers = process_of(server), Answers(), Answers()
    paths = [f"/studies/{study_id}", "/studies", "/health", f"/studies/{study_id}"]
    asyncio.run(crowd(paths, server.port, first, seconds / 2))
    before, cpu, began = megabytes(process), cpu_seconds(process), time.monotonic()
    asyncio.run(crowd(paths, server.port, answers, seconds / 2))
    after, taken = megabytes(process), cpu_seconds(process) - cpu
    wall = time.monotonic() - began
    status = server.study(study_id)["status"]
    server.client.delete(f"/studies/{study_id}")
    statuses = first.statuses + answers.statuses
    return [
        Figure("answers", statuses.total()),
        Figure("answers other than 200", statuses.total() - statuses[200], most=0),
        Figure("median time of an answer", quantile(answers.seconds, 0.5), "s"),
        Figure("99 % of the answers within", quantile(answers.seconds, 0.99), "s", most=1.0),
        Figure("CPU of the service", 100 * taken / wall, "% of a core"),
        Figure("memory of the service after half of them", before, "MB"),
        Figure("growth of its memory", 100 * (after - before) / before, "%", most=5.0),
        Figure("the study had ended meanwhile", status != "running", most=0),
    ]
