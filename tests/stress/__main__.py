"""The service under stress: ``python -m tests.stress [SCENARIO ...]``.

Every scenario prints what it measured beside what is allowed. The exit status is 1 when a number
is not allowed, or a scenario fails.
"""

from __future__ import annotations

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
from tests.stress.measure import Figure
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


def main(names: list[str]) -> int:
    """Run the scenarios on one service, one after the other."""
    unknown = set(names) - set(SCENARIOS)
    if unknown:
        print(f"no scenario {', '.join(unknown)}; there are {', '.join(SCENARIOS)}")
        return 2
    bad = 0
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="residua-stress-") as home:
        for name in names or SCENARIOS:
            print(f"{name}: {(SCENARIOS[name].__doc__ or '').splitlines()[0]}", flush=True)
            server = Server(Path(home) / name, workers=2)
            try:
                server.start()
                figures = SCENARIOS[name](server)
                bad += sum(not figure.good for figure in figures)
                print(*figures, sep="\n", flush=True)
            except Exception:
                bad += 1
                traceback.print_exc()
            finally:
                server.close()
    print(f"\n{bad} bad in {time.monotonic() - began:.0f} s")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
