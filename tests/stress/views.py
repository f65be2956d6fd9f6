"""Pages that are looked at again and again."""

from __future__ import annotations

import time
from collections import Counter

from tests.service.servers import Server, fake_study
from tests.stress.measure import Figure, megabytes, process_of, quantile

VIEWS, RUNS = 1000, 200


def page_views(server: Server, count: int = VIEWS, runs: int = RUNS) -> list[Figure]:
    """1000 views of pages and their data, and the memory of the service."""
    study = fake_study("seen")
    study["sweep"] = {"friction": [k / runs for k in range(runs)]}
    own = server.finished(server.post(study))["id"]
    first, second = (run["id"] for run in server.client.get("/runs?limit=2").json()["items"])
    at = f"/ui/studies/{own}"
    paths = [
        "/ui", "/ui?text=seen", at, f"{at}?page=3&sort=-friction", f"{at}?run={first}",
        f"{at}?where.friction=0.1..0.4", f"/ui/runs/{first}", "/ui/new?scene=punch", "/ui/health",
        f"/ui/compare?run={first}&run={second}", f"/studies/{own}/table.csv",
        f"/studies/{own}/numbers?name=friction&name=max_plastic_strain", f"/studies/{own}/audit",
        f"/runs/{first}/fields", f"/runs/{second}/values?field=residual_stress",
    ]  # fmt: skip
    process, statuses, times = process_of(server), Counter[int](), list[float]()

    def look(views: int) -> float:
        """Look at the pages in turn; return the memory of the service after it."""
        for number in range(views):
            began = time.monotonic()
            statuses[server.client.get(paths[number % len(paths)]).status_code] += 1
            times.append(time.monotonic() - began)
        return megabytes(process)

    before, after = look(count // 5), look(count)
    return [
        Figure("views", len(times)),
        Figure("views of another status than 200", len(times) - statuses[200], most=0),
        Figure("99 % of the views within", quantile(times, 0.99), "s", most=1.0),
        Figure("memory of the service after a fifth", before, "MB"),
        Figure("growth of its memory", 100 * (after - before) / before, "%", most=5.0),
    ]
