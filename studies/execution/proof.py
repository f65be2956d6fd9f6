"""A worker proves that it sees the directory of the study before it computes anything."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from solver.files import appearing, read_file
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
    path : file of the token
    token : its content, new each time the study is computed
    directory : directory of the store, as the user gave it
    """

    path: Path
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
            return read_file(self.path).decode() == self.token
        except (OSError, ValueError):
            return False


@contextmanager
def proof_of(store: Store, study_id: str) -> Iterator[Proof]:
    """Keep a token in the directory of a study while its paths are computed."""
    path = store.study_directory(study_id).resolve() / "token"
    proof = Proof(path, uuid.uuid4().hex, str(store.directory))
    with appearing(path) as part:
        part.write_text(proof.token, encoding="ascii")
    try:
        yield proof
    finally:
        path.unlink(missing_ok=True)
