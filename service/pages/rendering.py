"""Templates to answers: links, addresses of static files, errors as pages."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from http import HTTPStatus
from typing import Any

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, RedirectResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from service.errors import STATUS, answer_to
from service.keys import Scope
from service.middleware import CHARTS as POLICY
from service.pages import assets
from studies.views import rules
from studies.views.html import templates

ROOT = "/ui"
"""Path of the pages."""


def page(
    request: Request, template: str, status: int = HTTPStatus.OK, **content: Any
) -> HTMLResponse:
    """Return a page made from a template."""

    def link(route: str, **values: Any) -> str:
        return request.url_for(route, **values).path

    caller: Scope | None = getattr(request.state, "caller", None)
    text = (
        templates("service.pages")
        .get_template(f"{template}.html")
        .render(
            link=link,
            rules=rules.PAGES,
            asset=lambda file: link("get_asset", version=assets.version(), name=file),
            here=request.url.path,
            query=request.query_params,
            origin=f"{request.url.scheme}://{request.url.netloc}",
            only_shows=request.app.state.only_shows,
            may_submit=caller is not None and caller.covers(Scope.SUBMIT),
            signed_in=COOKIE in request.cookies,
            **content,
        )
    )
    headers = {"content-security-policy": POLICY, "cache-control": "no-cache"}
    return HTMLResponse(text, status, headers)


def to_study(request: Request, study_id: str) -> Response:
    """Lead to the page of a study."""
    where = request.url_for("study_page", study_id=study_id).path
    return RedirectResponse(where, HTTPStatus.SEE_OTHER)


COOKIE = "residua_key"
"""Name of the cookie that has the key of a caller who has signed in."""


def is_page(request: Request) -> bool:
    """Whether a request is for a page."""
    path: str = request.scope["path"].removeprefix(request.scope.get("root_path", ""))
    return path == ROOT or path.startswith(f"{ROOT}/")


def told(request: Request, answer: Response) -> Response:
    """Return the answer to a refused request as a page, or the way to the page for signing in."""
    if answer.status_code == HTTPStatus.UNAUTHORIZED:
        wanted = f"{request.url.path}?{request.url.query}".removesuffix("?")
        where = request.url_for("sign_in").include_query_params(then=wanted)
        return RedirectResponse(f"{where.path}?{where.query}", HTTPStatus.SEE_OTHER)
    said = json.loads(bytes(answer.body))
    found = page(request, "problem", answer.status_code, problem=said)
    for name in ("retry-after", "allow"):
        if name in answer.headers:
            found.headers[name] = answer.headers[name]
    return found


REFUSALS: tuple[type[Exception], ...] = (HTTPException, RequestValidationError, *STATUS)
"""Errors that have a page; any other is answered as everywhere."""


class PageRoute(APIRoute):
    """A route whose errors are pages."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler."""
        handle = super().get_route_handler()

        async def shown(request: Request) -> Response:
            try:
                return await handle(request)
            except REFUSALS as error:
                return told(request, answer_to(request, error))

        return shown
