"""The application and the command that serves it."""

from __future__ import annotations

import contextlib
import os
import sqlite3
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, NoReturn

import uvicorn
from anyio import CapacityLimiter
from fastapi import FastAPI
from pydantic import ValidationError

import solver
from service import errors, routes
from service.connections import limited
from service.jobs import Jobs
from service.limits import body_limit
from service.lock import DirectoryInUse, lock_directory
from service.maps import Pictures
from service.methods import head_is_get
from service.routes.manual import ASSETS
from service.runner import Runner
from service.settings import Settings
from studies import Store, StoreBusy, StudyError

DESCRIPTION = """Elastic-plastic contact studies: post one, watch it, fetch its data set.

A study has a content id: the same study posted twice is the same study."""

OPEN_STREAMS_SECONDS = 2
"""Time that open event streams are given when the service stops."""

WAITING_CONNECTIONS = 256
"""Connections that are taken in one go, before their number is looked at."""


def create_app(settings: Settings) -> FastAPI:
    """Return the application, owner of the data directory until it has been shut down.

    Raises
    ------
    DirectoryInUse
        If another service works in the data directory.
    """
    lock = lock_directory(settings.data, settings.lock_seconds)

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        try:
            async with app.state.runner.working():
                yield
        finally:
            os.close(lock)

    app = FastAPI(
        title="Residua",
        version=solver.__version__,
        description=DESCRIPTION,
        lifespan=lifespan,
        responses=errors.ANSWERS,
        docs_url=None,
        redoc_url=None,
    )
    app.state.settings = settings
    app.state.store = open_store(settings.data)
    app.state.jobs = Jobs(settings.data / "jobs.sqlite")
    app.state.runner = Runner(settings, app.state.jobs, lock)
    app.state.pictures = Pictures(settings.map_queue, settings.map_bytes)
    app.state.probe = CapacityLimiter(1)
    app.add_middleware(body_limit, limit=settings.max_body_bytes)
    app.add_middleware(head_is_get)
    errors.install(app)
    for router in routes.ROUTERS:
        app.include_router(router)
    app.mount("/docs", ASSETS, name="docs")
    return app


def open_store(directory: Path) -> Store:
    """Return the store in ``directory``, its catalogue in line with the runs that are there."""
    store = Store(directory)
    # Whoever computes here without the service has just done the same.
    with contextlib.suppress(StoreBusy), store.writing():
        pass
    return store


def serve(host: str, port: int, data: Path | str, scheduler: str | None = None) -> None:
    """Serve until a signal comes; a study that is running then resumes at the next start.

    Parameters
    ----------
    host, port : where to listen
    data : directory of runs, studies and the queue
    scheduler : address of a dask scheduler; without one each study starts its own workers
    """
    given: dict[str, Any] = {} if scheduler is None else {"scheduler": scheduler}
    try:
        app = create_app(Settings(data=Path(data), **given))
    except ValidationError as error:
        first = error.errors()[0]
        name = f"RESIDUA_{first['loc'][0]}".upper()
        refuse(f"{name} = {first['input']!r}: {first['msg']}")
    except (DirectoryInUse, StudyError) as error:
        refuse(str(error))
    except sqlite3.DatabaseError as error:
        refuse(f"data = {str(data)!r}: its jobs.sqlite cannot be used ({error})")
    except OSError as error:
        refuse(f"data = {str(data)!r}: must be a directory to write in ({error.strerror})")
    uvicorn.run(
        app,
        host=host,
        port=port,
        http=limited(app.state.settings),
        ws="none",
        backlog=WAITING_CONNECTIONS,
        timeout_graceful_shutdown=OPEN_STREAMS_SECONDS,
        server_header=False,
    )


def refuse(reason: str) -> NoReturn:
    """End with one line on the error output and the exit status of bad input."""
    print(f"residua serve: {reason}", file=sys.stderr)
    raise SystemExit(2)
