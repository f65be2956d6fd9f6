"""Combine the runs of a study in one data set, which is written run by run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np

from solver.files import appearing
from solver.scenes import Scene
from studies.definition.cases import Case
from studies.definition.study import Study
from studies.definition.vocabulary import MISSING, OK, SYMMETRIC
from studies.errors import FileDamaged
from studies.storage import dataset as layout
from studies.storage import ran, seal
from studies.storage.frame import Frame, write_beside
from studies.storage.made import Combined
from studies.storage.origin import origin
from studies.storage.provenance import provenance, together, what_ran
from studies.storage.room import Reservoir, needs_room
from studies.storage.runfile import global_attributes, opened
from studies.storage.store import Store


def combine(
    study: Study,
    store: Store,
    cases: Iterable[Case],
    beside: layout.RunContent | None = None,
    target: Path | None = None,
) -> Combined:
    """Write the combined data set of `study`, with what is ``beside``; return what it holds.

    It gets its place in the store, unless there is another ``target``.

    Sweep dimensions come first: the usual ones, then the other axes. A parameter set by a linked
    axis is a coordinate over its labels. Runs are matched by *label* along labelled dimensions
    (``component``, ``stage``, ``body``), which get the union of the labels. Along numeric ones
    (``x``, ``depth``) they are matched by value if all runs have the same grid, or the beginning of
    the longest. If grids differ, as when a length is swept, runs are matched by index, and ``x``
    becomes a variable over the sweep; if they differ only in scale, ``x_fraction`` is the index,
    the position as a fraction of the run's largest one. Shorter grids are filled up with NaN. Runs
    without a record are NaN.
    """
    places = {case.id: case.index for case in cases}
    damaged: set[str] = set()
    while True:
        left = {key: at for key, at in places.items() if key not in damaged}
        found = {key: left[key] for key in store.modified(left)}
        try:
            missing = [key for key in places if key not in found]
            return _combined(study, store, found, missing, beside, target)
        except FileDamaged as error:  # the data set has parts of it: begin again
            store.set_aside(error, "the run will be computed again")
            damaged.add(error.path.stem)  # it may be there still, if it cannot be moved


def _combined(
    study: Study,
    store: Store,
    found: Mapping[str, tuple[int, ...]],
    missing: Sequence[str],
    beside: layout.RunContent | None,
    elsewhere: Path | None,
) -> Combined:
    scene = study.problem
    usual = layout.usual_dimensions(scene)
    frame = Frame(scene=scene, axes=_axes(study, scene), usual=usual, linked=study.linked)
    software: set[tuple[str, str]] = set()
    computed: dict[int, dict[str, Any]] = {}
    halves: set[int] = set()
    outcomes: dict[str, tuple[str, str]] = {}
    places: dict[str, tuple[int, ...]] = {}
    for run_id, index in found.items():
        own = dict(zip(study.axes, index, strict=True))
        at = places[run_id] = tuple(own.get(name, 0) for name in frame.axes)
        with opened(store.run_path(run_id)) as run:
            frame.learn(run, at)
            status, message = (frame.small[name][0][at] for name in ("status", "message"))
            outcomes[run_id] = study.taken(str(status)), str(message)
            frame.small["status"][0][at] = outcomes[run_id][0]
            known = global_attributes(run)
            software.add(what_ran(known))
            number = int(np.ravel_multi_index(at, frame.shape))
            computed[number] = {name: known[name] for name in ran.MEANINGS if name in known}
            if SYMMETRIC in run.attrs:  # a run without a record lacks it
                halves.add(int(run.attrs[SYMMETRIC].item()))
    said, machines = ran.of_runs(tuple(frame.axes), frame.shape, computed)
    frame.small |= {name: (each.values, dict(each.attrs)) for name, each in said.items()}
    attrs = provenance(study.name, scene, study.fixed) | together(software) | origin(study)
    attrs |= (
        machines
        | seal.SEALED
        | frame.name_errors(beside.variables if beside else {})
        | (dict(beside.attrs) if beside else {})
    )
    if elsewhere is None:
        with suppress(FileDamaged):
            store.dataset(study.id)  # a damaged or foreign one is set aside, not lost
    placed = appearing(elsewhere) if elsewhere else store.appearing(study.id)
    with needs_room(elsewhere.parent if elsewhere else store.directory), placed as part:
        with Reservoir(part) as disk:
            with h5netcdf.File(disk, "w") as file:
                file.attrs.update(attrs | {"id": study.id, SYMMETRIC: int(halves == {1})})
                frame.create_axes(file)
            disk.check()
            with h5py.File(disk, "r+") as file:
                frame.create_fields(file)
                frame.write_small(file)
                disk.check()
                for run_id, at in places.items():
                    with opened(store.run_path(run_id)) as run:
                        frame.fill(file, run, at)
                    disk.check()
            if beside:
                with h5netcdf.File(disk, "r+") as file:
                    write_beside(file, beside.variables)
            disk.check()
        seal.seal(part, f"dataset {study.id}")
    counts = Counter([status for status, _ in outcomes.values()] + [MISSING] * len(missing))
    return Combined(
        path=elsewhere or store.dataset_path(study.id),
        counts=dict(counts),
        failed=[(run_id, *each) for run_id, each in outcomes.items() if each[0] != OK],
        missing=missing,
        anew=True,
    )


def _axes(study: Study, scene: Scene) -> dict[str, list[Any]]:
    """Return all sweep dimensions; a usual one that is not swept has its single value."""
    values = next(study.cases()).values
    usual = [name for name in layout.usual_dimensions(scene) if name not in study.linked]
    return {name: [values[name]] for name in usual} | study.axes
