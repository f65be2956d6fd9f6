"""The process that computes one study.

A study runs in a process of its own, so that whatever happens to it leaves the service and the
other studies alive. The workers and the lock of the store are those of `service.pool`.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from service.processes import Outlet, beat, claim_stdout, watch_stdin
from studies.definition.study import Study
from studies.errors import CatalogueDamaged, GridLost, StoreBusy, StoreFull, StudyError, Unusable
from studies.execution.run import StudyEvent, run_study
from studies.storage.store import Store

log = logging.getLogger("service.child")

OUTDATED = "the solver has changed since the study was accepted: post it again"


def compute(order: Mapping[str, Any], outlet: Outlet, stop: threading.Event) -> None:
    """Compute the missing runs of the study in the order, and report its progress."""
    store = Store(order["data"], held=True)
    # The store has what `residua run` may have added since then, such as a DOI.
    study = Study.known(store.definition(order["id"]) or order["study"], store.scene)
    if study.id != order["id"]:
        outlet.send("refused", {"reason": OUTDATED})
        return
    outcome = run_study(
        study,
        store,
        scheduler=order["access"],
        limits=order["limits"],
        priority=order["priority"],
        resume=True,
        since=order["since"],
        on_event=lambda event: tell(event, outlet),
        should_stop=stop.is_set,
    )
    outlet.send("outcome", {
        "counts": outcome.counts, "counted": study.kind.counted, "asked": outcome.asked,
        "stage": outcome.stage,
    })  # fmt: skip


def tell(event: StudyEvent, outlet: Outlet) -> None:
    """Send an event, and write in the log how a run ended."""
    outlet.send("event", asdict(event))
    if event.run:
        log.info("run: %s %s", event.status, event.message, extra={"run": event.run})


def main(order: Mapping[str, Any]) -> None:
    """Compute the study of the order."""
    outlet = claim_stdout()
    beat(outlet)
    try:
        compute(order, outlet, watch_stdin(order["grace"]))
    except (CatalogueDamaged, GridLost, StoreBusy, StoreFull, Unusable) as error:
        outlet.send("wait", {"reason": str(error)})
    except StudyError as error:
        outlet.send("refused", {"reason": str(error)})
    except Exception as error:
        outlet.send("error", {"reason": f"{type(error).__name__}: {error}"})
        raise
