"""The process that computes one study: ``python -m service.child``.

A study runs in a process of its own, so that whatever happens to it leaves the service alive.
The two talk through pipes. The first line of the standard input is the order; its end means
"stop", whether the service asked for it or died. Events go out as lines of JSON on the standard
output. The process inherits the lock of the data directory and holds it until it ends: a service
that starts after a crash waits for it.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, TextIO

from studies import GridLost, Store, StoreBusy, Study, StudyError, run_study

STDIN = 0

OUTDATED = "the solver has changed since the study was accepted: post it again"


class Outlet:
    """Sends events to the service, one JSON text a line."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def send(self, kind: str, content: Mapping[str, Any]) -> None:
        """Write one event; when the service no longer reads, the work goes on."""
        with contextlib.suppress(BrokenPipeError):
            self.stream.write(json.dumps({"kind": kind, "content": content}) + "\n")
            self.stream.flush()


def claim_stdout() -> Outlet:
    """Keep the standard output for events: what libraries print goes to the error output."""
    stream = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    return Outlet(stream)


def read_order() -> dict[str, Any]:
    """Return the order, the first line of the standard input."""
    text = b""
    while not text.endswith(b"\n"):
        piece = os.read(STDIN, 65536)
        if not piece:
            raise SystemExit("the service ended before it sent the order")
        text += piece
    order: dict[str, Any] = json.loads(text)
    return order


def watch_stdin(grace: float) -> threading.Event:
    """Return an event that is set when the other end of the standard input closes.

    A process that has not ended ``grace`` seconds later ends itself: a service that died cannot
    kill it, and the next one waits for its lock.
    """
    stop = threading.Event()

    def watch() -> None:
        # Not through sys.stdin: at exit the interpreter would wait for its buffer's lock.
        os.read(STDIN, 1)
        stop.set()
        time.sleep(grace)
        os._exit(1)

    threading.Thread(target=watch, name="stop-watch", daemon=True).start()
    return stop


def compute(order: Mapping[str, Any], outlet: Outlet, stop: threading.Event) -> None:
    """Compute what is missing of the study in the order, and tell how it goes."""
    study = Study.from_dict(order["study"])
    if study.id != order["id"]:
        outlet.send("refused", {"reason": OUTDATED})
        return
    outcome = run_study(
        study,
        Store(order["data"]),
        workers=order["workers"],
        scheduler=order["scheduler"],
        resume=not order["again"],
        on_event=lambda event: outlet.send("event", asdict(event)),
        should_stop=stop.is_set,
    )
    outlet.send("outcome", outcome.counts)


def main() -> None:
    """Read the order and carry it out."""
    outlet = claim_stdout()
    order = read_order()
    try:
        compute(order, outlet, watch_stdin(order["grace"]))
    except StudyError as error:
        outlet.send("refused", {"reason": str(error)})
    except (GridLost, StoreBusy) as error:
        outlet.send("wait", {"reason": str(error)})
    except Exception as error:
        outlet.send("error", {"reason": f"{type(error).__name__}: {error}"})
        raise


if __name__ == "__main__":
    main()
