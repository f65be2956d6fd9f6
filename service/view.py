"""Pages on a folder of results or on one data set: nothing is computed, nothing is written there.

Catalogue, queue and the files of single runs, which the pages need, are in a folder for temporary
files.
"""

from __future__ import annotations

import logging
import shutil
import signal
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

import uvicorn
from fastapi import FastAPI

from service.app import assembled
from service.connections import limited
from service.errors import NotFound
from service.job import Job, StudyState, verdict
from service.jobs import Jobs, forget, put
from service.processes import share_arenas
from service.recovery import add
from service.sandbox import READERS
from service.settings import Settings
from solver.files import NoFile, opened
from studies.definition.study import Study
from studies.errors import StudyError
from studies.scratch import scratch
from studies.storage.blobs import blobs_at
from studies.storage.seal import state_of
from studies.storage.store import Store

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
LOOK = 5.0
"""Time between two looks for new results [s]."""

FRESH = 600.0
"""Age of its newest run up to which a study that has not ended is taken as running [s]."""

ELSEWHERE = "it has not ended, and no run was added lately"
"""What is told of a study that was begun."""


class ViewedFolder:
    """A folder of results, as a store and a queue in which nothing waits; these lists are aside."""

    def __init__(self, directory: Path, aside: Path) -> None:
        self.store = Store(directory.resolve(), held=True, aside=aside)
        with (
            suppress(FileNotFoundError, NoFile),  # a torn copy is found damaged, and made again
            opened(directory / "catalogue.sqlite") as found,
            self.store.catalogue.path.open("wb") as copy,
        ):
            shutil.copyfileobj(found, copy)
        self.jobs = Jobs(aside / "jobs.sqlite")
        self._seen: dict[str, object] = {}

    def look(self) -> None:
        """Bring catalogue and queue to what is in the folder now."""
        self.store.reconcile()
        there = self.store.study_ids()
        for study_id in self._seen.keys() - there:
            with self.jobs.transaction() as connection:
                forget(connection, study_id)
            del self._seen[study_id]
        for study_id in there:
            state = state_of(self.store.dataset_path(study_id))
            if self._seen.get(study_id, 0) != state:
                self._take(study_id)
                self._seen[study_id] = state
            if state is None:
                self._follow(study_id)

    def _take(self, study_id: str) -> None:
        """Take a study, or its end, into the queue."""
        try:
            job = self.jobs.get(study_id)
        except NotFound:
            add(study_id, self.jobs, self.store, begun=False)
            add(study_id, self.jobs, self.store)
            return
        if not (counts := self.store.outcomes(study_id)):  # it was deleted or damaged
            return
        study = Study.known(self.jobs.study(study_id), self.store.scene)
        if study.kind.chooses:
            asked = self.store.asked(study) or ()
            self.jobs.asked(study_id, sorted(asked), study.stage(study.expansion.size))
            job = self.jobs.get(study_id)
        end, message = verdict(counts, study.kind.counted)
        self._put(job, state=end, message=message, progress=100.0)

    def _follow(self, study_id: str) -> None:
        """Write how far a study is that has no data set yet."""
        with suppress(NotFound):
            job, runs = self.jobs.get(study_id), self.jobs.runs(study_id)
            times = self.store.modified(runs).values()
            fresh = max(times, default=0) / 1e9 > time.time() - FRESH
            state = StudyState.RUNNING if fresh else StudyState.DISMISSED
            progress = 100.0 * len(times) / max(job.size, 1)
            self._put(job, state=state, message="" if fresh else ELSEWHERE, progress=progress)

    def _put(self, job: Job, **changes: object) -> None:
        if any(getattr(job, name) != value for name, value in changes.items()):
            with self.jobs.transaction() as connection:
                put(connection, job, **changes)


@contextmanager
def application(path: Path) -> Iterator[tuple[FastAPI, str]]:
    """Give the pages on a folder or a data set, and the path of the first one.

    Parameters
    ----------
    path : an output directory, or what `studies.open_study` opens: a study in it, a data set

    Raises
    ------
    StudyError
        if there is neither
    """
    with scratch() as folder:
        settings = Settings(data=folder, host=HOST, root_path="", require_keys=False)
        from studies.views.reading import begun_in, find_study, present_datasets

        directory = path if _is_folder(path) else None
        if directory is None and not present_datasets(path):
            directory = begun_in(path)  # of a study that is being computed
        if directory is not None:
            shown = ViewedFolder(directory, folder)
            shown.look()
            _tell_others(directory, shown)
            ended = threading.Event()
            watch = threading.Thread(target=_watch, args=(shown, ended))
            watch.start()
            try:
                yield assembled(settings, shown.store, shown.jobs, None), "/ui"
            finally:
                ended.set()
                watch.join()
            return
        from studies.views.unpacked import Unpacked

        store = Unpacked(find_study(path), folder)
        jobs = Jobs(folder / "jobs.sqlite")
        jobs.accept(store.study_id, store.content, store.run_ids)
        jobs.finish(store.study_id, *verdict(store.counts), standing=StudyState.ACCEPTED)
        yield assembled(settings, store, jobs, None), f"/ui/studies/{store.study_id}"


def _is_folder(path: Path) -> bool:
    return (path / "studies").is_dir() or bool(blobs_at(path).names("studies/*/study.json"))


def _watch(shown: ViewedFolder, ended: threading.Event) -> None:
    while not ended.wait(LOOK):
        try:
            shown.look()
        except Exception:
            log.exception("the folder cannot be read now")


def _tell_others(path: Path, shown: ViewedFolder) -> None:
    """Tell which studies are not shown: those of another version of the solver."""
    known = {job.id for job in shown.jobs.page(limit=-1, offset=0)[0]}
    for study_id in shown.store.study_ids():
        if study_id not in known:
            dataset = path / "studies" / study_id / "dataset.nc"
            told = f"residua view {dataset}" if dataset.is_file() else "it has no data set"
            reason = "is of another version of the solver"
            print(f"studies/{study_id} {reason}: {told}", file=sys.stderr)


def view(path: Path, port: int = 0, browser: bool = True) -> None:
    """Show pages on a folder or a data set until Ctrl-C, to this machine alone.

    Raises
    ------
    StudyError
        if there is nothing to show, or the port is in use
    """
    try:
        listening = socket.create_server((HOST, port))
    except OSError as error:
        allowed = f"must be free, or left out for any free one ({error.strerror})"
        raise StudyError("--port", port, allowed) from None
    share_arenas()
    READERS.prepare()  # loads while the folder is looked at
    with listening, application(path) as (app, first):
        url = f"http://{HOST}:{listening.getsockname()[1]}{first}"
        print(f"{url}  (Ctrl-C ends it)", flush=True)
        if browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
        _Server(
            uvicorn.Config(
                app, http=limited(app.state.settings), ws="none", log_level="warning",
                access_log=False, timeout_graceful_shutdown=1, server_header=False,
            ),
            app,
        ).run(sockets=[listening])  # fmt: skip


class _Server(uvicorn.Server):
    """A server for which Ctrl-C is the usual end: it does not send itself the signal again."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self.app = app

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End at a signal, and with it the streams of events."""
        self.app.state.closing = True
        super().handle_exit(sig, frame)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """End at a signal."""
        ends = signal.SIGINT, signal.SIGTERM
        before = {each: signal.signal(each, self.handle_exit) for each in ends}
        try:
            yield
        finally:
            for each, handler in before.items():
                signal.signal(each, handler)
