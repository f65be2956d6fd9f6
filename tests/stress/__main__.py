"""The service under stress: ``python -m tests.stress [SCENARIO ...]``.

Every scenario prints what it measured beside what is allowed; a table of all is at the end. The
exit status is 1 when a number is not allowed, or a scenario fails.
"""

from __future__ import annotations

import contextlib
import math
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path

from tests.service.servers import Server
from tests.stress.attacks import attacks
from tests.stress.crowds import description, half_open, pictures
from tests.stress.disks import full_disk
from tests.stress.fairness import fairness
from tests.stress.measure import Figure, table
from tests.stress.mixtures import mixed, scenes
from tests.stress.polling import pollers
from tests.stress.sizes import large_study, last_page
from tests.stress.times import clock, retention
from tests.stress.views import page_views

SCENARIOS: Mapping[str, Callable[[Server], list[Figure]]] = {
    "large-study": large_study,
    "last-page": last_page,
    "half-open": half_open,
    "pictures": pictures,
    "fairness": fairness,
    "attacks": attacks,
    "full-disk": full_disk,
    "scenes": scenes,
    "mixed": mixed,
    "clock": clock,
    "retention": retention,
    "page-views": page_views,
    "description": description,
    "pollers": pollers,
}


ALLOWED = 900.0
"""Seconds that all scenarios may take together on an idle machine of two cores."""


def main(names: list[str]) -> int:
    """Run the scenarios, each on a service of its own, one after the other."""
    unknown = set(names) - set(SCENARIOS)
    if unknown:
        print(f"no scenario {', '.join(unknown)}; there are {', '.join(SCENARIOS)}")
        return 2
    found: dict[str, list[Figure]] = {}
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="residua-stress-") as home:
        for name in names or SCENARIOS:
            print(f"{name}: {(SCENARIOS[name].__doc__ or '').splitlines()[0]}", flush=True)
            found[name] = figures_of(SCENARIOS[name], Path(home) / name)
            print(*found[name], sep="\n", flush=True)
    most = None if names else ALLOWED
    found["all"] = [Figure("time taken", time.monotonic() - began, "s", most)]
    print("\n" + table(found), flush=True)
    bad = sum(not figure.good for figures in found.values() for figure in figures)
    print(f"\n{bad} bad")
    return 1 if bad else 0


def figures_of(scenario: Callable[[Server], list[Figure]], home: Path) -> list[Figure]:
    """Return what a scenario measures on a service in a folder, and its time."""
    server, began = Server(home, workers=2), time.monotonic()
    try:
        with contextlib.closing(server):
            server.start()
            figures = scenario(server)
    except Exception as error:
        traceback.print_exc()
        if server.process is not None:
            server.process.kill()
        figures = [Figure(f"ended by {type(error).__name__}", math.nan, most=0)]
    return [*figures, Figure("time taken", time.monotonic() - began, "s")]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
