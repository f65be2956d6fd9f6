"""The application and the command that serves it."""

from __future__ import annotations

import contextlib
import os
import shlex
import socket
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import NoReturn

import uvicorn
from fastapi import FastAPI, Security
from fastapi.security import HTTPBearer

import solver
from service import errors, logs, routes
from service.access import Gate
from service.connections import limited
from service.datasets import Datasets
from service.errors import QueueLost
from service.examiner import Inspector
from service.jobs import Jobs
from service.keys import Keys, KeysError
from service.maps import Pictures
from service.metrics import Metrics, Probe
from service.middleware import SecurityHeaders, body_limit, head_is_get
from service.overview import Details, Tables
from service.pages import new
from service.pages import routes as pages
from service.pool import Pool
from service.processes import Starter, find_modules_at_home, share_arenas
from service.recovery import Mender, open_queue
from service.retention import Keeper
from service.routes.itself import ASSETS
from service.runner import Runner
from service.sandbox import READERS
from service.settings import Settings, chosen
from service.turns import COMBINING, COMPUTING, READING, Turns
from studies.errors import CatalogueDamaged, StoreBusy, StoreFull, StudyError
from studies.scratch import remove_left
from studies.storage.claims import lock
from studies.storage.store import Store

BEARER = HTTPBearer(auto_error=False, description="An API key, made by `residua keys add`.")
"""How the description of the service announces that keys are required; `Gate` requires them."""

DESCRIPTION = """Elastic-plastic contact studies: post one, watch it, fetch its data set.

A study has a content id: the same study posted twice is the same study."""

IN_USE = "has a service in this directory; stop it or name another one"
"""What is told of a second service."""

OPEN_STREAMS_SECONDS = 2
"""Time that open event streams are given when the service stops."""

WAITING_CONNECTIONS = 256
"""Number of connections that the system queues before they are accepted and counted."""


def create_app(settings: Settings) -> FastAPI:
    """Return the application, which has the lock of the data directory until it is shut down.

    Raises
    ------
    StoreBusy
        If another service works in the data directory.
    KeysError
        If callers need a key and there is none.
    """
    if settings.keys_required and not Keys(settings.data).all():
        raise KeysError(
            f"{settings.host} is open to others, who need an API key; make "
            f"one: residua keys add NAME --scope admin --data {shlex.quote(str(settings.data))}"
        )
    settings.data.mkdir(parents=True, exist_ok=True)
    held = lock(settings.data / "service.lock", IN_USE, settings.lock_seconds)
    store = open_store(settings.data)
    jobs = open_queue(settings.data / "jobs.sqlite", store, settings.max_queue)
    return assembled(settings, store, jobs, held)


def assembled(settings: Settings, store: Store, jobs: Jobs, held: int | None) -> FastAPI:
    """Return the application on a store and a queue.

    Parameters
    ----------
    held : the lock of their directory, which is left at the end; None for pages that only show:
        nothing is computed, and requests that change something are refused
    """
    keys = Keys(settings.data)
    starter = Starter(-1 if held is None else held)
    runner = Runner(settings, jobs, Pool(settings, starter), starter, Mender(jobs, store).look)
    kept = settings.keep_days, settings.keep_bytes
    scenes = settings.max_scenes_bytes, settings.max_key_scenes_bytes
    keeper = Keeper(jobs, store, runner.computes, *kept, *scenes)
    metrics = Metrics(jobs, store, runner)
    datasets = Datasets(jobs, store, computes=held is not None)
    budget = settings.reader_seconds if settings.keys_required else None

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        try:
            async with contextlib.AsyncExitStack() as stack:
                if held is not None:
                    await stack.enter_async_context(runner.working())
                    await stack.enter_async_context(keeper.working())
                yield
        finally:
            datasets.close()
            if held is not None:
                os.close(held)

    app = FastAPI(
        title="Residua",
        version=solver.__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        responses=errors.ANSWERS,
        docs_url=None,
        redoc_url=None,
    )
    parts = {
        "settings": settings, "store": store, "jobs": jobs, "runner": runner, "keeper": keeper,
        "keys": keys, "metrics": metrics, "datasets": datasets, "probe": Probe(),
        "inspector": Inspector(settings.reader_seconds),
        "details": Details(jobs, store), "tables": Tables(jobs, store),
        "pictures": Pictures(settings.map_bytes),
        "reading": Turns(READING, budget), "computing": Turns(COMPUTING, budget),
        "combining": Turns(COMBINING, budget),
    }  # fmt: skip
    app.state.only_shows, app.state.closing = held is None, False
    for name, part in parts.items():
        setattr(app.state, name, part)
    # Each is outside of the previous ones, so that refused requests are measured and logged too.
    longest = dict.fromkeys(("/scenes", "/ui/scenes"), settings.max_scene_bytes)
    app.add_middleware(body_limit, limit=settings.max_body_bytes, longest=longest)
    app.add_middleware(Gate, settings=settings, keys=keys, only_shows=held is None)
    app.add_middleware(head_is_get)
    app.add_middleware(SecurityHeaders)
    app.add_middleware(logs.RequestLog, observe=metrics.observe)
    errors.install(app)
    for router in routes.ROUTERS:
        needs_key = settings.keys_required and "health" not in router.tags
        app.include_router(router, dependencies=[Security(BEARER)] if needs_key else [])
    app.include_router(pages.home)
    app.include_router(new.router)
    app.include_router(pages.router)  # its last route is for all other paths
    app.mount("/docs", ASSETS, name="docs")
    return app


def open_store(directory: Path) -> Store:
    """Return the store in ``directory``, with its catalogue updated to the files of the runs."""
    store = Store(directory)
    # A process that computes here without the service has just done this; the pool does it too.
    with contextlib.suppress(StoreBusy, StoreFull), store.writing():
        pass
    return store


def serve(
    host: str | None = None,
    port: int | None = None,
    data: Path | str | None = None,
    scheduler: str | None = None,
) -> None:
    """Serve until a signal comes; a running study resumes at the next start.

    Arguments that are None come from the environment, see `Settings`.

    Parameters
    ----------
    host, port : where to listen
    data : directory of runs, studies and the queue
    scheduler : address of a dask scheduler; without one each study starts its own workers
    """
    try:
        settings = chosen(host=host, port=port, data=data, scheduler=scheduler)
    except StudyError as error:
        refuse(str(error))
    find_modules_at_home()
    share_arenas()
    remove_left()
    logs.configure(settings.log_format)
    try:
        app = create_app(settings)
    except (CatalogueDamaged, KeysError, QueueLost, StoreBusy, StoreFull, StudyError) as error:
        refuse(str(error))
    except OSError as error:
        refuse(f"data = {str(settings.data)!r}: must be a directory to write in ({error.strerror})")
    check_port(settings.host, settings.port)
    READERS.prepare()  # loads while this process begins to listen
    uvicorn.run(
        app,
        host=settings.host,
        port=settings.port,
        root_path=settings.root_path,
        http=limited(settings),
        ws="none",
        backlog=WAITING_CONNECTIONS,
        timeout_graceful_shutdown=OPEN_STREAMS_SECONDS,
        server_header=False,
        log_config=None,
        access_log=False,
        # Without a known proxy, anybody on this machine could put other addresses in the log.
        proxy_headers=settings.forwarded_allow_ips is not None,
        forwarded_allow_ips=settings.forwarded_allow_ips,
    )


def check_port(host: str, port: int) -> None:
    """End with one line if nobody can listen there, as when another program does."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            refuse(f"port = {port}: cannot listen on {host}, {reason}; give another by --port")


def refuse(reason: str) -> NoReturn:
    """End with one line on the error output and the exit status of bad input."""
    print(f"residua serve: {reason}", file=sys.stderr)
    raise SystemExit(2)
