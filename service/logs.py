"""The log: one form for every line, with the ids of study, run and request."""

from __future__ import annotations

import logging
import logging.config
import re
import sys
import time
import uuid
from collections.abc import Callable
from contextvars import ContextVar
from urllib.parse import quote

from pythonjsonlogger.core import RESERVED_ATTRS
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studies.definition.identity import is_id

PLAIN_ID = re.compile(rb"[A-Za-z0-9._-]{1,64}")

REQUEST: ContextVar[str] = ContextVar("request", default="")
"""Id of the request that is being answered.

It is not reset: each request has a separate context, and the traceback of a failed request is
logged at its very end.
"""

access = logging.getLogger("service.access")

LINE = "%(client)s %(method)s %(path)s %(status)s %(milliseconds)s ms"


CONNECTIONS = ("distributed", "tornado")
"""Libraries by which processes speak; their errors tell that another one has ended."""


class About(logging.Filter):
    """Adds ids to every log record: its own, or those of the process.

    Of errors of connections the traceback is left out: it shows code of libraries alone.
    """

    def __init__(self, ids: dict[str, str]) -> None:
        super().__init__()
        self.ids = ids

    def filter(self, record: logging.LogRecord) -> bool:
        """Add the ids."""
        error = record.exc_info[1] if record.exc_info else None
        of = {each.split(".")[0] for each in (record.name, type(error).__module__)}
        if error and of & {*CONNECTIONS}:
            said = f"{record.getMessage()} {type(error).__name__}: {error}"
            record.msg, record.args, record.exc_info = " ".join(said.split()), (), None
        known = {"request": REQUEST.get(), **self.ids, **vars(record)}
        entry = {name: known[name] for name in ("request", "study", "run") if known.get(name)}
        about = "".join(f" {name}={value}" for name, value in entry.items())
        vars(record).update(entry, about=about)
        return True


def configure(form: str, **ids: str) -> None:
    """Send the log of this process, with warnings and its last error, to the error output.

    Parameters
    ----------
    form : ``"plain"``, or ``"json"`` for an object on each line
    **ids : ids of this process, such as ``study``
    """
    json = {
        "()": "pythonjsonlogger.json.JsonFormatter",
        "format": "%(levelname)s %(name)s %(message)s",
        "rename_fields": {"levelname": "level", "name": "logger"},
        "reserved_attrs": [*RESERVED_ATTRS, "about", "color_message"],
        "timestamp": "time",
    }
    plain = {"format": "%(asctime)s %(levelname)s %(name)s: %(message)s%(about)s"}
    stream = {"class": "logging.StreamHandler", "formatter": form, "filters": ["about"]}
    described = {
        "version": 1,
        "disable_existing_loggers": False,
        "filters": {"about": {"()": About, "ids": ids}},
        "formatters": {"plain": plain, "json": json},
        "handlers": {"stderr": stream},
        "root": {"handlers": ["stderr"], "level": "INFO"},
    }
    logging.config.dictConfig(described)
    for name in logging.root.manager.loggerDict:
        if name.split(".")[0] in CONNECTIONS:  # they have handlers of their own
            logging.getLogger(name).handlers.clear()
            logging.getLogger(name).propagate = True
    logging.captureWarnings(True)
    sys.excepthook = lambda *error: logging.critical("the process ended", exc_info=error)


class RequestLog:
    """Outermost middleware: gives each request an id, measures it, and logs it.

    Neither headers nor the query are logged, because they may contain secrets. ``observe`` is
    called with scope, status and seconds of each request; a request that fails without an answer
    counts as 500.
    """

    def __init__(self, app: ASGIApp, observe: Callable[[Scope, int, float], None]) -> None:
        self.app = app
        self.observe = observe

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = dict(scope["headers"]).get(b"x-request-id", b"")
        request = given if PLAIN_ID.fullmatch(given) else uuid.uuid4().hex.encode()
        REQUEST.set(request.decode())
        status, start = 500, time.perf_counter()

        async def named(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message.get("headers", ()), (b"x-request-id", request)]
            await send(message)

        try:
            await self.app(scope, receive, named)
        finally:
            seconds = time.perf_counter() - start
            self.observe(scope, status, seconds)
            entry = {
                "client": (scope.get("client") or ("-",))[0],
                "method": scope["method"],
                "path": quote(scope["path"])[:200],
                "status": status,
                "milliseconds": round(1000 * seconds, 1),
            }
            for name, value in scope.get("path_params", {}).items():
                if name in ("study_id", "run_id") and is_id(value):  # not any text of a path
                    entry[name.removesuffix("_id")] = value
            access.info(LINE, entry, extra=entry)
