"""What operators watch: metrics for Prometheus, and a check of the data directory."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from http import HTTPMethod
from typing import Any

from anyio import CapacityLimiter, move_on_after
from anyio.to_thread import run_sync
from prometheus_client import CollectorRegistry, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.errors import QueueLost
from service.job import StudyState
from service.jobs import Jobs
from service.runner import Runner
from service.search import OUTCOMES
from studies.errors import CatalogueDamaged, StoreBusy, StoreFull
from studies.storage.store import Store

OTHER = "other"
"""Label of methods and paths without a route, so that clients cannot create labels without end."""


class Metrics(Collector):
    """The metrics of one service, read from its queue and its catalogue at each request."""

    def __init__(self, jobs: Jobs, store: Store, runner: Runner) -> None:
        self.jobs = jobs
        self.store = store
        self.runner = runner
        self.registry = CollectorRegistry()
        self.seconds = Histogram(
            "residua_request_seconds",
            "Time from a request to the end of its answer",
            ("method", "route", "status"),
            registry=self.registry,
        )
        ProcessCollector(registry=self.registry)
        self.registry.register(self)

    def observe(self, scope: Mapping[str, Any], status: int, seconds: float) -> None:
        """Count a request that has been answered."""
        method = scope["method"] if scope["method"] in HTTPMethod.__members__ else OTHER
        route = getattr(scope.get("route"), "path", OTHER)
        self.seconds.labels(method, route, status).observe(seconds)

    def collect(self) -> Iterable[Metric]:
        """Yield the metrics of queue, catalogue and disk, without those that cannot be read."""
        for name, meaning, kinds, count in (
            ("residua_studies", "Studies by status", StudyState, self.jobs.states),
            (
                "residua_runs",
                "Runs by status",
                OUTCOMES,
                self.store.catalogue.counts,
            ),
        ):
            family = GaugeMetricFamily(name, meaning, labels=("status",))
            with suppress(QueueLost, CatalogueDamaged, StoreBusy, StoreFull, OSError):
                counts = count()
                for kind in kinds:
                    family.add_metric([kind], counts.get(kind, 0))
                yield family
        with suppress(OSError):
            free = shutil.disk_usage(self.store.directory).free
            yield GaugeMetricFamily("residua_data_free_bytes", "Free space for data", float(free))
        alive = float(self.runner.alive)
        yield GaugeMetricFamily("residua_runner_up", "Whether studies are being computed", alive)


SECONDS = 5.0
"""Time within which the check must end [s]."""


class Probe:
    """Checks the data directory; simultaneous requests share one check."""

    def __init__(self) -> None:
        self.limiter = CapacityLimiter(1)
        self.underway: asyncio.Task[dict[str, Any]] | None = None

    async def check(self, store: Store, jobs: Jobs) -> dict[str, Any]:
        """Return what `look` finds; nothing if that takes too long."""
        if self.underway is None or self.underway.done():
            looking = run_sync(look, store, jobs, limiter=self.limiter)
            self.underway = asyncio.create_task(looking)
        with move_on_after(SECONDS):
            return await asyncio.shield(self.underway)
        return {}


def look(store: Store, jobs: Jobs) -> dict[str, Any]:
    """Return how a data directory and its files are, as entries of `Health` that are not false."""
    found: dict[str, Any] = {}
    with suppress(OSError), tempfile.TemporaryFile(dir=store.directory) as probe:
        probe.write(b"1")
        probe.flush()  # a full disk is told here
        found["data_writable"] = True
    with suppress(QueueLost, StoreFull, OSError):
        found["waiting"] = jobs.waiting()
        found["queue_readable"] = not jobs.damaged
    with suppress(CatalogueDamaged, StoreBusy, StoreFull, OSError):
        store.catalogue.runs(limit=1)
        found["catalogue_readable"] = not store.catalogue.damaged
    return found
