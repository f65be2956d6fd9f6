"""Access control: host name, origin of web pages, API key and scope."""

from __future__ import annotations

import re
from functools import partial
from http import HTTPStatus

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Send
from starlette.types import Scope as Connection

from service.errors import on_http_error
from service.keys import Keys, KeysError, Scope
from service.pages.rendering import COOKIE, is_page, told
from service.settings import Settings, address_of

ONLY_SHOWN = "these pages only show what is stored: start `residua serve` to compute"
"""Refusal of requests that change something, where nothing is computed."""

SAFE = ("GET", "HEAD", "OPTIONS")

NEEDED = [
    (re.compile(pattern, re.DOTALL), scope)
    for pattern, scope in (
        # A browser sends no key with the address of a page; these pages contain no secrets.
        (r"(GET|HEAD|OPTIONS) /(health|docs(/.*)?|openapi\.json)", None),
        (r"(GET|HEAD|OPTIONS) /(ui/(static/.*|sign-in))?", None),
        (r"POST /ui/sign-(in|out)", None),
        (r"(GET|HEAD|OPTIONS) .*", Scope.READ),
        (r"POST /(scenes|studies|studies/[^/?]+/retry|estimate)/?", Scope.SUBMIT),
        (r"POST /ui/(new|scenes|studies/[^/?]+/(retry|stop))", Scope.SUBMIT),
        (r"DELETE /studies/[^/?]+/?", Scope.SUBMIT),
        (r".*", Scope.ADMIN),
    )
]
"""The scope that a request needs: the first match; requests without a match need ``admin``."""

HOST = re.compile(r"(?:\[([\da-f:.]+)\]|([^\s:/@\[\]]+))(?::\d*)?", re.IGNORECASE)
FIELDS = re.compile(r"application/x-www-form-urlencoded\s*(?:;.*)?", re.IGNORECASE)
FORM = re.compile(r"multipart/form-data\s*;.*", re.IGNORECASE)
JSON = re.compile(r"application/(?:[\w.-]+\+)?json\s*(?:;.*)?", re.IGNORECASE)


def needed(request: Request) -> Scope | None:
    """Return the scope that a request needs; None if it needs no key."""
    path = request.scope["path"].removeprefix(request.scope.get("root_path", ""))
    deletes = "?purge" if "purge" in request.query_params else ""
    words = f"{request.method} {path}{deletes}"
    return next(scope for pattern, scope in NEEDED if pattern.fullmatch(words))


class Gate:
    """Middleware that refuses a request before its body is read.

    The caller's scope is stored in ``request.state.caller``: a `Scope`, or None without a key; in
    ``request.state.name`` the name of the key, or ``address …`` of a caller without one.

    Where the application ``only_shows``, everybody may read, and nobody anything else.
    """

    def __init__(
        self, app: ASGIApp, settings: Settings, keys: Keys, only_shows: bool = False
    ) -> None:
        self.app, self.only_shows = app, only_shows
        self.keys_needed = settings.keys_required
        self.keys = keys
        self.names = {
            name.lower() for name in ("localhost", settings.host, *settings.allowed_hosts)
        }

    async def __call__(self, connection: Connection, receive: Receive, send: Send) -> None:
        """Answer with a problem document, or pass the request on."""
        answer = self.app
        if connection["type"] == "http":
            request = Request(connection)
            try:
                self.check_host(request.headers.getlist("host"))
                check_page(request)
                request.state.caller = await self.caller(request)
                request.state.admitted = partial(self.admitted, request)
                check_content(request)
            except HTTPException as refusal:
                answer = on_http_error(request, refusal)
                if is_page(request):
                    answer = told(request, answer)
        await answer(connection, receive, send)

    def check_host(self, given: list[str]) -> None:
        """Refuse unknown host names: another site may let its own name point to this address.

        A numerical address is always accepted.
        """
        found = HOST.fullmatch(given[0]) if len(given) == 1 else None
        name = (found[1] or found[2]).lower().removesuffix(".") if found else ""
        if not (found and (address_of(name) or {name, "*"} & self.names)):
            raise HTTPException(
                HTTPStatus.MISDIRECTED_REQUEST,
                "the service has another host name than this; RESIDUA_ALLOWED_HOSTS adds names",
            )

    async def admitted(self, request: Request) -> bool:
        """Whether the caller of a request that is being answered still has its key."""
        try:
            await self.caller(request)
        except HTTPException as refusal:
            return refusal.status_code == HTTPStatus.SERVICE_UNAVAILABLE
        return True

    async def caller(self, request: Request) -> Scope | None:
        """Return the caller's scope, or raise `HTTPException` if it is not sufficient."""
        # No name of a key has a space.
        request.state.name = f"address {request.client.host if request.client else 'unknown'}"
        if self.only_shows:
            if not Scope.READ.covers(needed(request) or Scope.READ):
                raise HTTPException(HTTPStatus.FORBIDDEN, ONLY_SHOWN)
            return Scope.READ
        if not self.keys_needed:
            return Scope.ADMIN
        wanted, header = needed(request), request.headers.get("authorization", "")
        kept = request.cookies.get(COOKIE, "")
        if not (header or kept) and wanted is None:
            return None
        kind, _, text = header.partition(" ")
        given = text.strip() if kind.lower() == "bearer" else "" if header else kept
        try:
            owner = await self.keys.known(given)
        except KeysError as error:
            if wanted is None:
                return None
            raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, str(error)) from None
        challenge = 'Bearer realm="residua"'
        name, scope = owner or ("", None)
        if scope is None and wanted is None and not header:  # a cookie of a key that was removed
            return None
        if scope is None:
            status, detail = HTTPStatus.UNAUTHORIZED, "this needs authorization: Bearer <API key>"
            if header:
                detail = "the API key is not known"
                challenge += ', error="invalid_token"'
        elif wanted and not scope.covers(wanted):
            status = HTTPStatus.FORBIDDEN
            detail = f"this needs an API key of scope {wanted}; the scope of this one is {scope}"
            challenge += f', error="insufficient_scope", scope="{wanted}"'
        else:
            request.state.name = name
            return scope
        raise HTTPException(status, detail, {"www-authenticate": challenge})


def check_page(request: Request) -> None:
    """Refuse requests that change something from another site's page; browsers send its origin.

    References
    ----------
    The rule is that of ``CrossOriginProtection`` in Go's ``net/http``.
    """
    site, origin = request.headers.get("sec-fetch-site"), request.headers.get("origin")
    if site is not None:
        ours = site in ("same-origin", "none")
    else:
        own = request.headers["host"].lower()
        ours = origin is None or origin.lower().partition("://")[2] == own
    if not ours and request.method not in SAFE:
        raise HTTPException(HTTPStatus.FORBIDDEN, "a page of another site may only read")


def check_content(request: Request) -> None:
    """Refuse a body without the content type JSON, or, for a scene, a form with files."""
    headers = request.headers
    path = request.scope["path"].removeprefix(request.scope.get("root_path", ""))
    if path.rstrip("/") in ("/scenes", "/ui/scenes"):
        wanted, form = FORM, "multipart/form-data"
    elif is_page(request):
        wanted, form = FIELDS, "application/x-www-form-urlencoded"
    else:
        wanted, form = JSON, "application/json"
    body = "transfer-encoding" in headers or headers.get("content-length", "0") != "0"
    if (
        body
        and request.method not in SAFE
        and not wanted.fullmatch(headers.get("content-type", ""))
    ):
        raise HTTPException(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
            f"the body must be sent with the header content-type: {form}",
        )
