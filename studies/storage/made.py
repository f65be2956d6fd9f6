"""Memo of derived files (``made.json``): data set, report, picture are kept while inputs last.

A result is one or several files, such as the data set. The memo has a digest of its inputs, and one
of each file. A result is made again if a file is missing or changed, if its inputs differ, and
after any change of this project's sources or of the libraries that write and draw.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from solver.files import read_file, special
from studies.definition.identity import canonical, sources
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK
from studies.errors import FileDamaged
from studies.storage.seal import content_of, digest, digest_of, sealed_json
from studies.storage.store import Store

_FILE = "made.json"
_LIBRARIES = ("h5netcdf", "matplotlib", "xarray")


class Made:
    """The results in the directory of a study."""

    def __init__(self, study: Study, store: Store) -> None:
        self._study, self._store = study, store
        self._name = f"made {study.id}"

    def kept(self, result: str, of: str) -> list[Path] | None:
        """Return the files of a result if it was made of the inputs ``of``, else None."""
        try:
            entry = self._entries()[result]
            files = {self._path(name): noted for name, noted in entry["files"].items()}
            same = entry["of"] == self._made_of(of)
        except (AttributeError, KeyError, TypeError):
            return None
        if same and all(digest(path) == noted for path, noted in files.items()):
            return list(files)
        return None

    def digest(self, name: str) -> str:
        """Return the digest of a file, as an input of other results; empty if it is missing."""
        return digest(self._path(name))

    def note(self, result: str, of: str, names: Iterable[str]) -> None:
        """Record the inputs of files, while no other process writes them."""
        self._note(result, of, {name: self.digest(name) for name in names})

    def write(self, result: str, of: str, contents: Mapping[str, bytes]) -> list[Path]:
        """Write files with these contents, record their inputs, and return their paths."""
        for name, content in contents.items():
            self._write(name, content)
        self._note(result, of, {name: digest_of(content) for name, content in contents.items()})
        return [self._path(name) for name in contents]

    def _note(self, result: str, of: str, files: Mapping[str, str]) -> None:
        entries = self._entries() | {result: {"of": self._made_of(of), "files": files}}
        self._write(_FILE, sealed_json(self._name, entries))

    def _entries(self) -> dict[str, Any]:
        try:
            return content_of(self._path(_FILE), self._name)
        except FileDamaged as error:
            self._store.set_aside(error, "what it tells of is made again")
            return {}

    def _path(self, name: str) -> Path:
        return self._store.study_path(self._study.id, name)

    def _write(self, name: str, content: bytes) -> None:
        path, store = self._path(name), self._store
        if kind := special(path, links=False):
            store.put_aside(path, f"it is {kind}", "a file takes its place")
        with store.appearing(self._study.id, name) as part:
            part.write_bytes(content)

    def _made_of(self, of: str) -> str:
        own = canonical(self._study.published)
        return digest_of("\n".join([of, own, *self._makers]).encode())

    @cached_property
    def _makers(self) -> list[str]:
        """Digests of the sources, and versions of libraries."""
        found = [digest_of(read_file(path)) for path in sources(self._study.problem)]
        return found + [importlib.metadata.version(name) for name in _LIBRARIES]


@dataclass(frozen=True, slots=True, kw_only=True)
class Combined:
    """The content of the data set of a study.

    Attributes
    ----------
    path : path of the data set
    counts, failed : as in `StudyOutcome`
    missing : ids of the runs that it lacks
    anew : whether it was written now, not kept
    """

    path: Path
    counts: Mapping[str, int]
    failed: Sequence[tuple[str, str, str]]
    missing: Sequence[str]
    anew: bool


def held(study: Study, store: Store) -> tuple[str, Combined]:
    """Return a digest of the runs of `study`, and the content of a data set made of them.

    The digest changes if a run is added or removed, or if its file has another length or time of
    change in the catalogue. Compare the catalogue with the files first (`Store.sound`).
    """
    digest = hashlib.sha256()
    counts: Counter[str] = Counter()
    failed, missing = [], []
    for run_id, found in store.catalogue.each(study.run_ids()):
        row = found or {"status": MISSING}
        digest.update(f"{run_id} {row.get('size')} {row.get('modified')}\n".encode())
        status = study.taken(row["status"])
        counts[status] += 1
        if status == MISSING:
            missing.append(run_id)
        elif status != OK:
            failed.append((run_id, status, row["message"]))
    path = store.dataset_path(study.id)
    ended = Combined(path=path, counts=dict(counts), failed=failed, missing=missing, anew=False)
    return digest.hexdigest(), ended
