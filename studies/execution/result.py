"""The data set of a study: of its runs or of answers, or kept if it was made of the same."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from studies.definition.identity import canonical
from studies.definition.points import POINT
from studies.definition.study import Study
from studies.definition.vocabulary import OK, SYMMETRIC
from studies.errors import FileDamaged
from studies.execution.asking import Asking
from studies.kinds.kind import Answers
from studies.storage import ran, runfile, seal
from studies.storage.dataset import RunContent
from studies.storage.estimated import WITHOUT, described, numbers_in, with_errors, without
from studies.storage.made import Combined, Made, held
from studies.storage.origin import origin
from studies.storage.provenance import provenance
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


def answered(study: Study, store: Store, asking: Asking, anew: bool) -> Combined:
    """Write what a study found that chooses its runs, unless there is a data set of the same."""
    found: Answers = study.kind.answers(study, [place.program for place in asking.places])
    entry = {study.kind.name: canonical(study.kind.content)}
    if found.points is not None:
        chosen = study.with_points(found.points)
        ids = [case.id for case in chosen.cases()]
        own = {"run": runfile.described(POINT, ids, "id of the run"), **found.content()}
        beside = RunContent(own, entry)
        return result(chosen, store, complete=not anew, stopped=not asking.ended, beside=beside)
    path, made = store.dataset_path(study.id), Made(study, store)
    written = made.kept(_NAME, found.of) is None
    if written:
        packed = runfile.packed(_content(study, store, asking, found, entry))
        with store.appearing(study.id) as part:
            part.write_bytes(seal.sealed(f"dataset {study.id}", packed))
        made.note(_NAME, found.of, [path.name])
    counts = dict(Counter(status for _, status, _ in found.outcomes))
    failed = [outcome for outcome in found.outcomes if outcome[1] != OK]
    return Combined(path=path, counts=counts, failed=failed, missing=(), anew=written)


def _content(
    study: Study, store: Store, asking: Asking, found: Answers, entry: Mapping[str, Any]
) -> RunContent:
    """Return the content of a data set of answers, and how its runs were computed."""
    variables = dict(found.content())
    runs, known = sorted(asking.asked), {}
    for k, run_id in enumerate(runs):
        with suppress(FileDamaged), runfile.opened(store.run_path(run_id)) as run:
            known[k] = runfile.global_attributes(run)
    variables["run_id"] = runfile.described("run_number", runs, "id of the run")
    said, machines = ran.of_runs(["run_number"], [len(runs)], known)
    attrs = provenance(study.name, study.problem, study.fixed) | origin(study)
    attrs |= {**machines, **entry, "id": study.id, SYMMETRIC: 0}
    every = described(variables := variables | said)
    attrs[WITHOUT] = without(every, numbers_in(variables))
    return RunContent(with_errors(variables, every), attrs)
