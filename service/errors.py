"""Errors as problem documents (RFC 9457); one table maps exceptions to statuses."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from service.keys import KeysError
from service.logs import REQUEST
from service.middleware import HEADERS, offered
from studies.errors import (
    LONGEST_FIELD,
    LONGEST_TEXT,
    MOST_MISTAKES,
    CatalogueDamaged,
    FileDamaged,
    StoreBusy,
    StoreFull,
    StudyError,
    Unusable,
    cut,
    worded,
)
from studies.scenes.refusals import dotted
from studies.storage.room import FULL

log = logging.getLogger(__name__)

LATER = {"retry-after": "10"}
"""Header with the time after which a repeated request may succeed [s]."""


class NotFound(LookupError):
    """Nothing is stored under this id, or not yet."""


class Conflict(RuntimeError):
    """The resource is in a state that does not allow this."""


class Busy(RuntimeError):
    """Not now: too many requests of this kind wait, or what is asked for is being made again.

    Parameters
    ----------
    seconds : time after which a repeated request may succeed [s]
    """

    def __init__(self, reason: str, seconds: int = 10) -> None:
        super().__init__(reason)
        self.seconds, self.later = seconds, {"retry-after": str(seconds)}


class TooMany(Busy):
    """Not now: requests of this caller wait, or have taken the time that a caller may have."""


class NoRoom(RuntimeError):
    """What is asked for takes more room than the disk has."""


class QueueLost(RuntimeError):
    """The file of the queue is missing or damaged; the service makes it again from the studies."""


STATUS: dict[type[Exception], HTTPStatus] = {
    StudyError: HTTPStatus.UNPROCESSABLE_ENTITY,
    RequestValidationError: HTTPStatus.UNPROCESSABLE_ENTITY,
    NotFound: HTTPStatus.NOT_FOUND,
    Conflict: HTTPStatus.CONFLICT,
    Busy: HTTPStatus.SERVICE_UNAVAILABLE,
    TooMany: HTTPStatus.TOO_MANY_REQUESTS,
    QueueLost: HTTPStatus.SERVICE_UNAVAILABLE,
    KeysError: HTTPStatus.SERVICE_UNAVAILABLE,
    NoRoom: HTTPStatus.INSUFFICIENT_STORAGE,
    StoreFull: HTTPStatus.INSUFFICIENT_STORAGE,
    CatalogueDamaged: HTTPStatus.SERVICE_UNAVAILABLE,
    FileDamaged: HTTPStatus.NOT_FOUND,
    StoreBusy: HTTPStatus.SERVICE_UNAVAILABLE,
    Unusable: HTTPStatus.SERVICE_UNAVAILABLE,
    OSError: HTTPStatus.SERVICE_UNAVAILABLE,
}

NO_ROOM = "no room is left on the disk of the data directory"
NO_ROOM_NOW = "no room is left for temporary files"

LONGEST_DETAIL = 20_000
"""Number of characters of a detail; with the mistakes an answer has less than 1 MB."""

MEDIA_TYPE = "application/problem+json"


class ProblemDocument(BaseModel):
    """An error, in the form of RFC 9457."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    instance: str
    errors: list[dict[str, Any]] = Field(description="for each bad input: field, value, allowed")


CONTENT = {MEDIA_TYPE: {"schema": ProblemDocument.model_json_schema()}}
ANSWERS: dict[int | str, dict[str, Any]] = {
    code: {"description": "Problem", "content": CONTENT} for code in ("4XX", "5XX")
}
"""Errors in the OpenAPI description of the service."""

REFUSED: dict[int | str, dict[str, Any]] = {
    422: {
        "description": "Of the right form, but the scene or the run has no such parameter, value "
        "or field; or of the wrong form. The answer tells field, value and what is allowed.",
        "content": CONTENT,
    }
}
"""Errors in this description for requests of the right form with values that are not allowed."""


class Problem(Response):
    """A response that carries a problem document."""

    media_type = MEDIA_TYPE

    def render(self, content: ProblemDocument) -> bytes:
        """Encode in ASCII, because a client's text may contain lone surrogates."""
        return json.dumps(content.model_dump(), allow_nan=False).encode("ascii")


def problem(
    request: Request | None,
    status: HTTPStatus,
    detail: str,
    errors: Sequence[dict[str, Any]] = (),
    headers: dict[str, str] | None = None,
) -> Problem:
    """Return the problem document for a failed request; None is one that did not arrive whole."""
    document = ProblemDocument(
        title=status.phrase,
        status=status.value,
        detail=cut(detail, LONGEST_DETAIL),
        instance=request.url.path if request else "",
        errors=list(errors),
    )
    return Problem(document, status_code=status.value, headers=headers)


def status_of(exc: Exception) -> HTTPStatus:
    """Return the HTTP status of an exception: that of its nearest ancestor in the table."""
    return next(STATUS[kind] for kind in type(exc).__mro__ if kind in STATUS)


def shown(value: object) -> str | int | float | bool | None:
    """Return an offending value as a JSON value, cut to a readable length."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int | float) and abs(value) < 2**53:
        return value
    text = value if isinstance(value, str) else repr(value)
    return cut(text, LONGEST_FIELD)


def mistake(field: str, value: object, allowed: str) -> dict[str, Any]:
    """Return one of the ``errors`` of a problem document."""
    return {"field": shown(field), "value": shown(value), "allowed": cut(allowed, LONGEST_TEXT)}


def validation_errors(exc: RequestValidationError) -> list[dict[str, Any]]:
    """Return field, value and what is allowed for each error FastAPI found."""
    errors = []
    for error in exc.errors()[:MOST_MISTAKES]:
        # without ``body`` or ``query``
        field, value, allowed = (
            dotted(error["loc"][1:] or error["loc"]),
            error.get("input"),
            worded(error),
        )
        if error["type"] == "json_invalid":
            reason = f"{error['ctx']['error']} at character {error['loc'][-1]}"
            field, value, allowed = "body", None, f"valid JSON ({reason})"
        elif field == "body":
            allowed = "a JSON object, sent with the header content-type: application/json"
        errors.append(mistake(field, value, allowed))
    return errors


def on_field_error(request: Request, exc: StudyError) -> Problem:
    """Answer an error that names its field, or several."""
    errors = [mistake(each.field, each.value, each.allowed) for each in exc.each]
    texts = [f"{error['field']}: {error['allowed']}" for error in errors]
    texts += exc.listed[len(errors) :]
    return problem(request, status_of(exc), "; ".join(texts), errors)


def on_validation_error(request: Request, exc: RequestValidationError) -> Problem:
    """Answer a request whose path, query or body has the wrong form."""
    errors = validation_errors(exc)
    broken = any(error["type"] == "json_invalid" for error in exc.errors())
    status = HTTPStatus.BAD_REQUEST if broken else STATUS[RequestValidationError]
    detail = "; ".join(f"{error['field']}: {error['allowed']}" for error in errors)
    return problem(request, status, detail, errors)


def on_plain_error(request: Request, exc: Exception) -> Problem:
    """Answer with an error of one sentence."""
    status = status_of(exc)
    usual = LATER if status >= HTTPStatus.INTERNAL_SERVER_ERROR else None
    later = getattr(exc, "later", usual)
    texts = {StoreFull: NO_ROOM, StoreBusy: "the data directory is held by another process"}
    said = texts.get(type(exc), str(exc))
    return problem(request, status, said, headers=later)


def on_unusable(request: Request, exc: Unusable) -> Problem:
    """Answer an error that only the operator can correct, without the path."""
    log.error("%s", exc)
    return problem(request, status_of(exc), f"{exc.field}: {exc.allowed}", headers=LATER)


def on_system_error(request: Request, exc: OSError) -> Problem:
    """Answer an error of the operating system, without the path."""
    log.error("%s", exc)
    if exc.errno in FULL:  # of the data directory `StoreFull` is raised
        return problem(request, STATUS[StoreFull], NO_ROOM_NOW, headers=LATER)
    detail = f"the data directory cannot be used: {exc.strerror or 'see the log of the service'}"
    return problem(request, status_of(exc), detail, headers=LATER)


def on_http_error(request: Request, exc: HTTPException) -> Response:
    """Answer errors of the framework: unknown paths, methods, large bodies."""
    if isinstance(exc.__cause__, StudyError):  # raised while the framework reads the body
        return on_field_error(request, exc.__cause__)
    if isinstance(exc.__cause__, OSError):
        return on_system_error(request, exc.__cause__)
    headers = dict(exc.headers or {})
    status, detail, errors = HTTPStatus(exc.status_code), exc.detail, []
    if status is HTTPStatus.METHOD_NOT_ALLOWED:
        headers["allow"] = offered(request, headers.pop("Allow"))
        if request.method == "OPTIONS":
            return Response(status_code=HTTPStatus.NO_CONTENT, headers=headers)
    if status is HTTPStatus.BAD_REQUEST:  # a body that is not valid JSON
        form = request.headers.get("content-type", "").lower().startswith("multipart")
        kind = "a form of files" if form else "JSON"
        allowed = f"{kind} that can be read ({exc.__cause__ or exc.detail})"
        detail, errors = f"body: {allowed}", [mistake("body", None, allowed)]
    return problem(request, status, detail, errors, headers)


def on_unexpected(request: Request, exc: Exception) -> Problem:
    """Answer an unexpected error without its details; the traceback goes to the log."""
    # This answer does not pass through the middleware.
    known = {**HEADERS, "x-request-id": REQUEST.get()}
    status, detail = HTTPStatus.INTERNAL_SERVER_ERROR, "the service failed; see its log"
    return problem(request, status, detail, headers=known)


HANDLERS: dict[type[Exception], Callable[[Request, Any], Response]] = {
    **dict.fromkeys(STATUS, on_plain_error),
    StudyError: on_field_error,
    Unusable: on_unusable,
    RequestValidationError: on_validation_error,
    OSError: on_system_error,
    HTTPException: on_http_error,
    Exception: on_unexpected,
}


def answer_to(request: Request, exc: Exception) -> Response:
    """Return the answer to an exception: that of its nearest ancestor in the table."""
    return next(HANDLERS[kind] for kind in type(exc).__mro__ if kind in HANDLERS)(request, exc)


def install(app: FastAPI) -> None:
    """Register the handlers on ``app``."""
    for kind, handler in HANDLERS.items():
        app.add_exception_handler(kind, handler)
