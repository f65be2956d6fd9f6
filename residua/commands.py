"""The subcommands of ``residua``: one function for each, which returns an exit status."""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

from residua.status import BAD_INPUT, FAILED, INTERRUPTED, OK, complain
from studies.errors import StudyError


def run(options: argparse.Namespace) -> int:
    """Compute a study, print its runs and draw one of them."""
    from residua.progress import ALONE, Foreseen, Progress, dry_run
    from studies.execution.access import Access
    from studies.execution.executor import Limits
    from studies.execution.run import StudyEvent, run_study
    from studies.kinds.fit.fitting import NO_FIT, Fit
    from studies.storage.store import Store
    from studies.views.report import prepare
    from studies.views.report import report as report_of

    limits = Limits(
        stall_seconds=options.stall_seconds, path_seconds=options.path_seconds,
        memory=options.memory, patience=options.patience,
    )  # fmt: skip
    store = Store(options.out)
    study, crate = _study(options, store)
    if options.command is fit and study.kind.name != Fit.name:
        raise StudyError("fit", None, NO_FIT)
    if options.dry_run:
        print(dry_run(study, store))
        return OK
    if options.part:
        return _part(study, options)
    if options.workers is not None and (options.scheduler or options.scheduler_file):
        allowed = "must be left out with a scheduler: its workers compute"
        raise StudyError("--workers", options.workers, allowed)
    certificates = options.tls_ca, options.tls_cert, options.tls_key
    access = options.scheduler and Access(options.scheduler, *certificates)
    if options.scheduler_file:
        access = Access.of_file(options.scheduler_file, *certificates)
    foreseen = Foreseen.of(study, store)
    if foreseen.text:
        print(foreseen.text, file=sys.stderr, flush=True)
    alone = 0.0
    if options.workers is None and foreseen.short and limits == Limits():
        alone = ALONE
        gc.freeze()  # what is loaded stays: who looks for memory to free need not look there
    progress, preparing = Progress(study), Thread(target=prepare)

    def hear(event: StudyEvent) -> None:
        # The processor time of runs is that of their process, with all of its threads.
        if not (alone or options.workers == 0) and preparing.ident is None:
            preparing.start()
        progress(event)

    with _interruption() as interrupted:
        outcome = run_study(
            study,
            store,
            workers=options.workers,
            alone=alone,
            scheduler=access,
            resume=options.resume,
            limits=limits,
            on_event=hear,
            should_stop=lambda: bool(interrupted),
        )
    progress.close()
    printed = report_of(study, store, outcome)
    computed = f"{len(outcome.computed)} computed in {outcome.wall_seconds:.0f} s"
    print(f"{printed.text.rstrip()}, {computed}")
    written = {outcome.dataset: outcome.anew} | dict.fromkeys(printed.files, printed.anew)
    for path, anew in written.items():
        print(f"{'wrote' if anew else 'kept'} {path}")
    if outcome.stopped:
        return INTERRUPTED
    if crate:
        again = crate.compared(store, outcome)
        print(again.text)
        return OK if again.same else FAILED
    return OK if outcome.ok else FAILED


def _study(options: argparse.Namespace, store: Any) -> tuple[Any, Any]:
    """Return the study of a file, or that of a crate with the crate itself, else None."""
    from studies.definition.study import Study

    path: Path = options.study
    measured: Sequence[Path] = getattr(options, "measured", ())  # of `residua fit`
    if not path.is_dir():
        return Study.from_toml(path, measured, store.definition, store.scene), None
    from studies.views.crate import METADATA, Crate

    if not (path / METADATA).is_file():
        raise StudyError("file", str(path), f"must be a study file, or a crate with {METADATA}")
    if store.directory.resolve() == path.resolve():
        raise StudyError("--out", str(path), "must be a new folder, not the crate")
    if measured:
        allowed = "must be left out: the crate has what was measured"
        raise StudyError("--measured", str(measured[0]), allowed)
    crate = Crate.read(path)
    if crate.other:
        print(f"residua: {crate.other}", file=sys.stderr, flush=True)
    return crate.study, crate


def _part(study: Any, options: argparse.Namespace) -> int:
    """Compute as one of several processes."""
    from residua.progress import Progress
    from studies.execution.part import run_part

    if options.workers not in (None, 1):
        raise StudyError("--workers", options.workers, "a part is one process: leave it out")
    progress = Progress(study)
    with _interruption(signal.SIGTERM) as interrupted:
        found = run_part(
            study, options.out, options.part,
            on_event=progress, should_stop=lambda: bool(interrupted),
        )  # fmt: skip
    progress.close()
    number, count = options.part
    others = f", {found.left} loading paths are left to others" if found.left else ""
    print(f"{study.name}: part {number} of {count}: {len(found.computed)} runs computed{others}")
    return INTERRUPTED if found.stopped else OK


def slurm(options: argparse.Namespace) -> int:
    """Write a script for sbatch, which computes a study on a cluster."""
    from residua.slurm import script
    from studies.definition.study import Study
    from studies.storage.store import Store

    store = Store(options.out)
    study = Study.from_toml(options.study, (), store.definition, store.scene)
    text = script(
        study.name, options.study, store.blobs.address, options.script,
        tasks=options.tasks, time=options.time, memory=options.memory,
        scheduler=options.with_scheduler,
    )  # fmt: skip
    with _written("--script", options.script) as part:
        part.write_text(text, encoding="utf-8")
    print(f"wrote {options.script}; its head tells how to submit it")
    return OK


def fit(options: argparse.Namespace) -> int:
    """Find the parameters with which runs come closest to what was measured."""
    return run(options)


def scenes(options: argparse.Namespace) -> int:
    """List the scenes, or the parameters of one."""
    from studies.views.scene_tables import scene_table, scenes_table

    print(scene_table(options.name) if options.name else scenes_table())
    return OK


def draw(options: argparse.Namespace) -> int:
    """Draw a scene before anything is computed: meshes, boundaries, supports, loads, contacts."""
    from studies.views.plots.setup import setup_figure
    from studies.views.plots.sheets import resolved
    from studies.views.scene_tables import described_scene, doubts_of

    scene, values = described_scene(options.what, _selection(options.set, "--set"))
    for doubt in doubts_of(scene, values):
        print(f"warning: {doubt}", file=sys.stderr)
    sheet = setup_figure(scene, values, options.zoom, options.window)
    _save(resolved(sheet, options.resolution), options.out)
    return OK


def show(options: argparse.Namespace) -> int:
    """Print the results of a run, a study or all studies of a directory."""
    from studies.views.reading import begun_studies, find_datasets, open_netcdf, present_datasets
    from studies.views.tables import messages, run_details, runs_table

    begun = begun_studies(options.path)
    for path in (present_datasets if begun else find_datasets)(options.path):
        with open_netcdf(path) as dataset:
            words = [dataset.attrs[name] for name in ("note", "tags") if name in dataset.attrs]
            print(f"{dataset.attrs['title']}  ({path})", *words, "", sep="\n")
            if dataset["status"].size == 1:
                print(run_details(dataset), end="\n\n")
            else:
                print(runs_table(dataset), messages(dataset), sep="\n")
    for line in begun:
        print(line)
    return OK


def plot(options: argparse.Namespace) -> int:
    """Draw a field of one run, or one value per run over the sweep."""
    from studies.views.plots.picture import drawn_from, picture
    from studies.views.reading import open_study

    selection = _selection(options.select)
    with (
        open_study(options.path) as dataset,
        drawn_from(options.path, dataset, options.field, selection) as (found, left),
    ):
        drawn = picture(
            found, options.field, options.component, options.zoom, left,
            window=options.window, over=options.over, against=options.against,
            deformed=options.deformed,
            resolution=options.resolution,
        )  # fmt: skip
        _save(drawn, options.out)
    return OK


def best(options: argparse.Namespace) -> int:
    """List the runs of a study with the highest, or the lowest, values of a number."""
    from studies.views.best import best_runs, best_table
    from studies.views.reading import open_study

    with open_study(options.path) as dataset:
        runs = best_runs(
            dataset, options.of, options.where, lowest=options.lowest, count=options.count
        )
        print(best_table(dataset, options.of, runs))
    return OK


def table(options: argparse.Namespace) -> int:
    """Write the numbers of the runs of a study as CSV or JSON."""
    from studies.views.best import table_of
    from studies.views.reading import open_study
    from studies.views.written import FORMS

    with open_study(options.path) as dataset:
        found = table_of(dataset)
    at = found.chosen(options.sort)
    for condition in options.where:
        at = at[found.meeting(condition)[at]]
    if options.where and not at.size:
        raise StudyError("where", ", ".join(options.where), "no run meets this")
    names = [each for given in options.columns or () for each in given.split(",") if each]
    columns = [found.column(name) for name in dict.fromkeys(names or found.columns)]
    pieces = FORMS["json" if options.json else "csv"].write(columns, at)
    if options.out is None:
        for piece in pieces:
            sys.stdout.write(piece.decode())
        return OK
    with _written("--out", options.out) as part, part.open("wb") as file:
        file.writelines(pieces)
    print(f"wrote {options.out}")
    return OK


def diff(options: argparse.Namespace) -> int:
    """Show what differs between two studies, also of two versions of the solver."""
    from studies.views.differing import diff, difference_table
    from studies.views.reading import open_study

    with open_study(options.first) as first, open_study(options.second) as second:
        found = diff(first, second, options.ignore)
    print(difference_table(found))
    if options.out is not None:
        from studies.views.plots.differing import difference_figure

        _save(difference_figure(found, options.field), options.out)
    return OK


def predict(options: argparse.Namespace) -> int:
    """Predict a number between the runs of a study, with its error."""
    from studies.execution.task import compute_here
    from studies.numbers import number_text
    from studies.views.picking import study_of
    from studies.views.predict import ERROR_IS, answer
    from studies.views.reading import find_study, open_netcdf

    at, path = _selection(options.at, "NAME=VALUE"), find_study(options.path)
    study, store = study_of(path)
    asked: dict[str, Any] = {"of": options.of, "at": at, "by": options.by, "within": options.within}
    with open_netcdf(path) as dataset:
        found = answer(dataset, study, store, **asked)
        if not found.enough and options.compute:
            compute_here(found.run, store)
            found = answer(dataset, study, store, **asked)
    unit = f" {found.unit}" if found.unit not in {"", "1"} else ""
    what, error = ERROR_IS.get(found.by, "error"), number_text(found.error, 2)
    print(f"{found.of} = {number_text(found.value, 6)}{unit}, {what} {error}{unit} (by {found.by})")
    if found.enough:
        return OK
    place = ", ".join(f"{name} = {value}" for name, value in found.at.items())
    failed = store.run(next(found.run.run_ids())) if options.compute else None
    told = f"its run ended as {failed['status']}" if failed else "--compute adds this run"
    print(f"the error is above {options.within:g} at {place}: {told}")
    return FAILED


def sensitivity(options: argparse.Namespace) -> int:
    """Rank the parameters of a sample by their effect on a number of its runs, and draw it."""
    from studies.views import sensitivity as indices
    from studies.views.reading import open_study

    selection = _selection(options.select)
    with open_study(options.path) as dataset:
        found = indices.sensitivity(dataset, options.of, selection, method=options.method)
        print(indices.sensitivity_table(found))
        if options.out:
            from studies.views.plots.sensitivity import sensitivity_figure

            _save(sensitivity_figure(dataset, found, selection), options.out)
    return OK


def export(options: argparse.Namespace) -> int:
    """Write a map or lines of a run as CSV, its fields for ParaView, or a study as RO-Crate."""
    from studies.views.picking import run_file, sweep_axes
    from studies.views.reading import open_netcdf

    forms = options.csv, options.vtu, options.crate
    if sum(each is not None for each in forms) != 1:
        raise StudyError("--csv, --vtu, --crate", None, "give one of them, with where it goes")
    if options.crate is not None:
        from studies.views.crate import export as write_crate

        for name in ("select", "field", "component", "stage"):
            if given := getattr(options, name):
                raise StudyError(f"--{name}", given, "must be left out: a crate has all")
        write_crate(options.path, options.crate)
        print(f"wrote {options.crate}")
        return OK
    with open_netcdf(run_file(options.path, _selection(options.select))) as run:
        if options.vtu is not None:
            print(f"wrote {_written_nodes(run, options.vtu)}")
            return OK
        from studies.views.shown import shown

        one = run.isel(dict.fromkeys(sweep_axes(run), 0))
        found = shown(one, options.field, options.component, options.stage)
        with _written("--csv", options.csv) as part, part.open("wb") as file:
            file.writelines(found.as_csv())
    print(f"wrote {options.csv}")
    return OK


def _written_nodes(run: Any, folder: Path) -> Path:
    """Write the fields at the nodes of a run (a data set), and return the file that lists them."""
    from solver.errors import ModelError
    from solver.results.mesh_fields import write_vtu
    from studies.views.solution import read

    try:
        with _writable("--vtu", folder):
            return write_vtu(read(run), folder)
    except ModelError as error:
        raise StudyError("--vtu", str(folder), error.allowed) from None


def serve(options: argparse.Namespace) -> int:
    """Start the HTTP service."""
    from service.app import serve as start

    start(options.host, options.port, options.data, options.scheduler)
    return OK


def view(options: argparse.Namespace) -> int:
    """Open pages on a folder of results, or on a data set, in the browser; nothing is computed."""
    from service.view import view as show_pages

    show_pages(options.path, options.port, not options.no_browser)
    return OK


def report(options: argparse.Namespace) -> int:
    """Write a study as one HTML file that needs no server: pictures, table, audit, versions."""
    from studies.views.archive import archive
    from studies.views.reading import find_study, open_study

    path = find_study(options.path) if isinstance(options.path, Path) else options.path
    with open_study(path) as dataset, _written("--out", options.out) as part:
        part.write_text(archive(dataset, path), encoding="utf-8")
    print(f"wrote {options.out}")
    return OK


def remote(options: argparse.Namespace) -> int:
    """Talk to a running service."""
    from residua.keys import api_key
    from studies.client import Client, NoAnswer, Refused

    key = api_key(options.api_key_file)
    try:
        client = Client(options.url, key)
    except StudyError as error:
        raise error.renamed(lambda name: f"--{name}") from None
    try:
        with client as service:
            print(options.talk(service, options))
    except Refused as error:
        return complain(error, BAD_INPUT)
    except NoAnswer as error:
        return complain(error, FAILED)
    return OK


def submit(service: Any, options: argparse.Namespace) -> str:
    """Send a study to a running service and print its id."""
    return str(service.submit(options.study).id)


def status(service: Any, options: argparse.Namespace) -> str:
    """Print the state of a study on a running service."""
    state = service.find(options.id).detail()
    stage = f"  {state['stage']}" if state.get("stage") else ""
    return f"{state['status']}  {state['progress']:g} %{stage}"


def cancel(service: Any, options: argparse.Namespace) -> str:
    """Stop a study on a running service."""
    study = service.find(options.id)
    study.cancel()
    return f"cancelled {study.id}"


def fetch(service: Any, options: argparse.Namespace) -> str:
    """Save the data set of a study on a running service."""
    study = service.find(options.id)
    path = options.out or Path(f"{study.id}.nc")
    with _written("--out", path) as part:
        study.fetch(part)
    return f"wrote {path}"


@contextmanager
def _interruption(*others: signal.Signals) -> Iterator[list[int]]:
    """Give a list that is empty until Ctrl-C, or another signal; a second one stops at once."""
    received: list[int] = []

    def receive(number: int, frame: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)
        os.write(2, b"\nstopping; finished runs are kept\n")  # `print` may be what it interrupts

    before = {each: signal.signal(each, receive) for each in (signal.SIGINT, *others)}
    try:
        yield received
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


def _save(drawn: Any, path: Path) -> None:
    """Write a figure in the format given by the ending of the file name, and say so."""
    from studies.views.plots.sheets import save

    kinds = drawn.canvas.get_supported_filetypes()
    kind = path.suffix.removeprefix(".").lower() or "png"
    if kind not in kinds:
        raise StudyError("--out", str(path), f"must end in one of {', '.join(sorted(kinds))}")
    with _written("--out", path) as part:
        save(drawn, part, kind)
    print(f"wrote {path}")


@contextmanager
def _written(option: str, path: Path) -> Iterator[Path]:
    """Give a path to write to, for the file that an option names."""
    from solver.files import appearing
    from studies.storage.room import needs_room

    with _writable(option, path), needs_room(path.parent), appearing(path) as part:
        yield part


@contextmanager
def _writable(option: str, path: Path) -> Iterator[None]:
    """Name the option if what it names cannot be written."""
    try:
        yield
    except OSError as error:
        raise StudyError(option, str(path), f"cannot be written: {error.strerror}") from None


def _selection(texts: Sequence[str], option: str = "--select") -> dict[str, str]:
    """Return the names and values of an option, each name once."""
    chosen: dict[str, str] = {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign:
            raise StudyError(option, text, "must be NAME=VALUE")
        if name in chosen:
            raise StudyError(option, text, f"{name} is given already, as {chosen[name]}")
        chosen[name] = value
    return chosen
