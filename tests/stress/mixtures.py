"""A thousand scenes, and five thousand requests of all kinds."""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import httpx

from tests.service.servers import Server, fake_study
from tests.stress.measure import Figure, megabytes, process_of, quantile, restarted
from tests.studies.scenes.conftest import BLOCKS

SCENES, REQUESTS, CALLERS = 1000, 5000, 8

Ask = Callable[[httpx.Client, random.Random], httpx.Response]


def scene_file(number: int) -> list[tuple[str, tuple[str, str]]]:
    """Return the form of a scene that no other has."""
    text = BLOCKS.replace("value = 150.0", f"value = {150 + number / 1000}")
    return [("scene", ("scene.toml", text))]


def scenes(server: Server, count: int = SCENES) -> list[Figure]:
    """1000 scenes posted, then listed."""
    restarted(server, RESIDUA_READER_SECONDS="10000")
    process, statuses = process_of(server), Counter[int]()

    def post(number: int) -> None:
        statuses[server.client.post("/scenes", files=scene_file(number)).status_code] += 1

    def listed(path: str) -> float:
        began = time.monotonic()
        assert server.client.get(path).status_code == 200
        return time.monotonic() - began

    began = time.monotonic()
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(post, range(count // 5)))
        listed("/scenes?limit=1000")
        before = megabytes(process)
        list(pool.map(post, range(count // 5, count)))
    posted = time.monotonic() - began
    listed("/scenes?limit=1000")  # reads the new ones, once
    after = megabytes(process)
    return [
        Figure("scenes posted", statuses[201]),
        Figure("not kept", count - statuses[201], most=0),
        Figure("seconds for each", posted / count, "s"),
        Figure("all of them listed", min(listed("/scenes?limit=1000") for _ in range(5)), "s", 0.2),
        Figure("runs listed", min(listed("/runs") for _ in range(5)), "s", 0.2),
        Figure("memory that the service gains by four fifths", after - before, "MB", most=30.0),
    ]


def mixed(server: Server, count: int = REQUESTS) -> list[Figure]:
    """5000 requests of all kinds, right and wrong, of eight callers."""
    restarted(server, RESIDUA_READER_SECONDS="10000", RESIDUA_MAX_QUEUE="50")
    study = server.finished(server.post(fake_study("mixed")))
    own, run = study["id"], study["runs"][0]["id"]
    statuses, times = Counter[int](), list[float]()

    def some_study(chance: random.Random) -> dict[str, object]:
        friction = chance.randrange(10_000) / 10_000
        return fake_study("some") | {"sweep": {"friction": [friction]}}

    paths = [
        "/studies", f"/studies/{own}", f"/studies/{own}/dataset.nc", "/runs", "/runs?friction=0.3",
        "/runs?frictoin=1", f"/runs/{run}", f"/runs/{run}.nc", f"/runs/{run}/map.png?zoom=1",
        "/scenes?limit=1000", "/scenes/punch", "/scenes/none", "/health", "/metrics",
        "/openapi.json", "/nowhere", f"/studies/{'0' * 32}", "/studies/%2e%2e", "/runs?limit=0",
    ]  # fmt: skip
    kinds: list[tuple[int, Ask]] = [
        (70, lambda client, chance: client.get(chance.choice(paths))),
        (8, lambda client, chance: client.post("/estimate", json=some_study(chance))),
        (4, lambda client, chance: client.post("/studies", json=some_study(chance))),
        (4, lambda client, _: client.post("/studies", json=fake_study("bad", friction=-1))),
        (4, lambda client, _: client.post("/studies", content=b"[" * 100_000)),
        (2, lambda client, chance: client.post("/scenes", files=scene_file(chance.randrange(200)))),
        (2, lambda client, _: client.post("/scenes", files=[("scene", ("a.toml", "a = [["))])),
        (2, lambda client, _: client.post(f"/studies/{own}/retry")),
        (2, lambda client, _: client.delete(f"/runs/{'0' * 32}")),
        (1, lambda client, _: client.put("/studies", content=b"x" * 2_000_000)),
        (1, lambda client, _: client.delete(f"/scenes/{'0' * 32}")),
    ]
    weights, asks = zip(*kinds, strict=True)

    def caller(number: int) -> None:
        chance = random.Random(number)
        with httpx.Client(base_url=server.client.base_url, timeout=60.0) as client:
            for ask in chance.choices(asks, weights, k=count // CALLERS):
                began = time.monotonic()
                try:
                    status = ask(client, chance).status_code
                except httpx.HTTPError:  # a large body may meet the end of the connection
                    status = 0
                times.append(time.monotonic() - began)
                statuses[status] += 1

    for path in paths:  # what is loaded once
        server.client.get(path)
    process = process_of(server)
    before, began = megabytes(process), time.monotonic()
    with ThreadPoolExecutor(CALLERS) as pool:
        list(pool.map(caller, range(CALLERS)))
    taken = time.monotonic() - began
    failed = sum(many for status, many in statuses.items() if status >= 500 and status != 503)
    log = (server.home / "service.log").read_text()
    return [
        Figure("requests", len(times)),
        Figure("in a second", len(times) / taken),
        Figure("99 % of the answers within", quantile(times, 0.99), "s"),
        Figure("put off (503)", statuses[503]),
        Figure("no answer", statuses[0], most=count // 100),
        Figure("answers 500 and above, without 503", failed, most=0),
        Figure("tracebacks in the log", log.count("Traceback"), most=0),
        Figure("memory that the service gains", megabytes(process) - before, "MB", most=60.0),
    ]
