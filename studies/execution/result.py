"""The data set of a study: combined, or kept if it was made of the same runs."""

from __future__ import annotations

from dataclasses import replace

from studies.definition.study import Study
from studies.definition.vocabulary import OK
from studies.storage.dataset import RunContent
from studies.storage.held import Combined, held
from studies.storage.made import Made
from studies.storage.store import Store

_NAME = "data set"


def result(
    study: Study,
    store: Store,
    *,
    complete: bool,
    stopped: bool,
    beside: RunContent | None = None,
) -> Combined:
    """Combine the runs of a study, unless its data set was made of the same runs.

    Parameters
    ----------
    study, store : the study, and the store of its runs
    complete : whether nothing was computed, and the files of all runs have just been verified
    stopped : whether runs were left out; an existing data set with more runs is then kept
    beside : further variables and attributes, which depend on nothing but the runs
    """
    made = Made(study, store)
    if complete:
        of, known = held(study, store)
        if made.kept(_NAME, of):
            return known
    elif stopped:
        before = store.outcomes(study.id)
        _, known = held(study, store)
        if before[OK] > known.counts.get(OK, 0):
            return replace(known, counts=dict(before), failed=(), missing=())
    from studies.storage.combine import combine  # h5netcdf: a complete study does not wait for it

    combined = combine(study, store, study.cases(), beside)
    store.catalogue.remove(combined.missing)
    of, _ = held(study, store)
    made.note(_NAME, of, [combined.path.name])
    return combined
