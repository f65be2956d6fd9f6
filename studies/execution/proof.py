"""A worker proves that it sees the directory of the study before it computes anything."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from studies.errors import Unusable
from studies.storage.store import Store

_PATIENCE = 2.0
"""Seconds that a worker looks for the token. Meanwhile other workers get the paths."""
_POLL = 0.2
"""Seconds between two checks."""


class Unfit(Exception):
    """A worker cannot do the task; another one can, or the same one later."""


@dataclass(frozen=True, slots=True)
class Proof:
    """A token that only a worker with access to the directory can read.

    Attributes
    ----------
    store : the directory of the store, or its address
    study : id of the study
    token : name of the file of the token, new each time the study is computed
    directory : directory of the store, as the user gave it
    """

    store: Path | str
    study: str
    token: str
    directory: str

    def check(self, should_stop: Callable[[], bool]) -> None:
        """Look for the token, for a short while.

        Raises
        ------
        Unfit
            if it is not found
        """
        deadline = time.monotonic() + _PATIENCE
        while not self._seen():
            if should_stop() or time.monotonic() > deadline:
                raise Unfit(
                    f"does not see the directory {self.directory}; mount it there under the same "
                    "path"
                )
            time.sleep(_POLL)

    def _seen(self) -> bool:
        try:
            return Store(self.store).study_path(self.study, self.token).is_file()
        except (OSError, Unusable):
            return False


@contextmanager
def proof_of(store: Store, study_id: str) -> Iterator[Proof]:
    """Keep a token in the directory of a study while its paths are computed."""
    token = f"token-{uuid.uuid4().hex}"
    with store.appearing(study_id, token) as part:
        part.touch()
    try:
        yield Proof(store.address, study_id, token, str(store.blobs.address))
    finally:
        store.discard_study(study_id, "token-*")  # with those of processes that were killed
