"""The runs of a study in the catalogue: their statuses, and a digest of them."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK
from studies.storage.store import Store


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
