"""Limits on connections, in number and time, so that slow clients cannot block the service."""

from __future__ import annotations

import asyncio
import contextlib
import math
import resource
from http import HTTPStatus
from typing import ClassVar

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from service.errors import LATER, problem
from service.middleware import HEADERS
from service.settings import Settings

MACOS_FILES = 10_240
"""Largest number of file descriptors of a process on macOS, whatever its limit says."""

OTHER_FILES = 256
"""Number of file descriptors reserved for uses other than connections and the files they send."""


class Connection(H11Protocol):
    """A connection of uvicorn with deadlines for the client.

    A request, head and body, must arrive within ``arrival_seconds``; a late one is answered 408. A
    client that does not read its answer for ``answer_seconds`` is disconnected. If all
    ``connections`` are in use, a new one replaces the one that has waited longest without a whole
    request, or else one that is being answered. So neither half-open connections nor streams of
    events block other clients.
    """

    settings: ClassVar[Settings]
    arrival: asyncio.TimerHandle | None = None
    answer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept the connection, if necessary in place of another, and wait for its request."""
        super().connection_made(transport)
        if len(self.connections) > self.settings.connections:
            self._make_room()
        self._watch()

    def data_received(self, data: bytes) -> None:
        """Process data of the client, and check whether its request is complete."""
        super().data_received(data)
        self._watch()

    def pause_writing(self) -> None:
        """Wait for the client to read the answer."""
        super().pause_writing()
        self.answer = self.loop.call_later(self.settings.answer_seconds, self.transport.abort)

    def resume_writing(self) -> None:
        """Continue to send."""
        super().resume_writing()
        if self.answer is not None:
            self.answer.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the deadlines."""
        for deadline in (self.arrival, self.answer):
            if deadline is not None:
                deadline.cancel()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        """Answer data that is not HTTP."""
        self.refuse(HTTPStatus.BAD_REQUEST, msg)

    def refuse(self, status: HTTPStatus, detail: str) -> None:
        """Answer with a problem document, unless an answer has begun, and close the connection."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            later = LATER if status is HTTPStatus.SERVICE_UNAVAILABLE else {}
            answer = problem(
                None, status, detail, headers={**HEADERS, "connection": "close", **later}
            )
            headers = [*self.server_state.default_headers, *answer.raw_headers]
            start = h11.Response(status_code=status, reason=status.phrase.encode(), headers=headers)
            events = (start, h11.Data(data=bytes(answer.body)), h11.EndOfMessage())
            self.transport.write(b"".join(self.conn.send(event) or b"" for event in events))
        if self.cycle is not None:
            self.cycle.disconnected = True
        self.transport.close()

    def _watch(self) -> None:
        """Set the deadline when a request begins to arrive, and cancel it when it is complete."""
        arriving = self.conn.their_state in (h11.IDLE, h11.SEND_BODY)
        if arriving and self.arrival is None and not self.transport.is_closing():
            self.arrival = self.loop.call_later(self.settings.arrival_seconds, self._late)
        elif not arriving and self.arrival is not None:
            self.arrival.cancel()
            self.arrival = None

    def _late(self) -> None:
        if self.conn.their_state is h11.IDLE and not self.conn.trailing_data[0]:
            self.transport.close()  # it has not sent anything
        else:
            seconds = self.settings.arrival_seconds
            self.refuse(HTTPStatus.REQUEST_TIMEOUT, f"the request took more than {seconds} s")

    def _make_room(self) -> None:
        """Close the connection that matters least, or else this one."""
        spare = {
            each: ends
            for each in self.connections - {self}
            if isinstance(each, Connection) and (ends := each._ends()) is not None
        }
        if spare:
            first = min(spare, key=spare.__getitem__)
            self.connections.discard(first)
            first.transport.abort()
        else:
            self.refuse(HTTPStatus.SERVICE_UNAVAILABLE, "too many requests at a time")

    def _ends(self) -> float | None:
        """Time at which this connection ends; None while the service computes its answer."""
        if self.transport.is_closing():  # but its answer has not been read to the end
            return 0.0
        if deadline := self.arrival or self.timeout_keep_alive_task:
            return deadline.when()
        # A client of events can reconnect, and files can be fetched in parts.
        return math.inf if self.cycle.response_started else None


def limited(settings: Settings) -> type[Connection]:
    """Return the class of the connections, and raise this process's limit of open files.

    Each connection may send a file, so the number of connections is limited by that of open files.
    """
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    for wanted in (most, MACOS_FILES):  # macOS refuses its own limit if that is "unlimited"
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
            files = wanted
            break
    if files != resource.RLIM_INFINITY:
        room = max(1, min(settings.connections, (files - OTHER_FILES) // 2))
        settings = settings.model_copy(update={"connections": room})
    return type("Connection", (Connection,), {"settings": settings})
