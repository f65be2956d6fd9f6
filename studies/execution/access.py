"""How a scheduler is set up, and reached: its settings, its address, and certificates."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from solver.files import read_file
from studies.errors import GridLost, StudyError
from studies.execution.forks import FROM_THE_START

_APPEARS = 60.0
"""Seconds within which a scheduler must write its file."""

_LATE = 3.0
"""Seconds after which it is reported that a scheduler has not answered."""

CONFIGURATION: Mapping[str, Any] = {
    # A task whose worker died is tried once more; after a second death the task is blamed.
    "distributed.scheduler.allowed-failures": 1,
    # A task waits at the scheduler until a worker is free, so that cancelling reaches it.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.nanny.pre-spawn-environ": FROM_THE_START,
    # Every study has its own topic of events, and dask keeps the messages of each topic.
    "distributed.admin.low-level-log-length": 1,
    # dask's pages are closed. Without the statistics for them processes that wait take a tenth of
    # the time: by default each looks at itself 50 times a second, a worker at its stack 100 times
    # and at its memory 10.
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.profile.enabled": False,
}
"""Settings of the scheduler and the workers started here."""

_LOG = logging.getLogger("studies")


@dataclass(frozen=True, slots=True)
class Access:
    """The address of a scheduler, and the certificates to reach it.

    Attributes
    ----------
    address : address of the scheduler, such as ``"tls://10.0.0.5:8786"``
    ca, cert, key : certificate of the authority that scheduler and workers trust, certificate of
        this client, and its private key; each a PEM text or the name of a file. The key may be left
        out if the file of the certificate contains it

    Raises
    ------
    StudyError
        if the address needs certificates and there are none
    """

    address: str
    ca: str | None = None
    cert: str | None = None
    key: str | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.address.startswith("tls://") and not (self.ca and self.cert):
            allowed = (
                "needs certificates: name the file of the authority (--tls-ca) and those of "
                "your own certificate and key (--tls-cert, --tls-key)"
            )
            raise StudyError("scheduler", self.address, allowed)
        if not self.address.startswith("tls://") and (self.ca or self.cert or self.key):
            allowed = "must begin with tls:// if certificates are given"
            raise StudyError("scheduler", self.address, allowed)

    @classmethod
    def of_file(cls, path: Path, ca: str | None, cert: str | None, key: str | None) -> Self:
        """Return the access to the scheduler that has written its address to a file.

        Parameters
        ----------
        path : the file, which ``dask scheduler --scheduler-file`` writes; it is waited for
        ca, cert, key : as the attributes

        Raises
        ------
        GridLost
            if the file does not appear within a minute
        StudyError
            if it tells no address
        """
        deadline = time.monotonic() + _APPEARS
        with reported_if_late(f"no scheduler has written the file {path} yet: waiting"):
            while not (path.exists() and path.stat().st_size):  # it is written after it appears
                if time.monotonic() > deadline:
                    raise GridLost(f"no scheduler has written the file {path} in {_APPEARS:g} s")
                time.sleep(0.2)
        try:
            address = json.loads(read_file(path))["address"]
        except (OSError, ValueError, LookupError, TypeError):
            allowed = "must be a file that `dask scheduler --scheduler-file` has written"
            raise StudyError("scheduler-file", str(path), allowed) from None
        return cls(str(address), ca, cert, key)


@contextmanager
def reported_if_late(message: str) -> Iterator[None]:
    """Log a message once if the context lasts for some seconds."""
    late = threading.Timer(_LATE, _LOG.warning, [message])
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()
