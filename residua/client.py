"""A client of the HTTP service, for the command line."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import httpx

from studies.appearing import appearing
from studies.definition.files import read_study
from studies.errors import StudyError

_WAIT = 60.0
"""Seconds to wait for an answer."""


class Refused(Exception):
    """The service answered with an error; the text says why, one line for each reason."""


class Service:
    """A running service.

    Parameters
    ----------
    url : its root, such as ``http://localhost:8000``
    key : API key, if the service requires one
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        headers = {"authorization": f"Bearer {key}"} if key else {}
        self._client = httpx.Client(base_url=url, timeout=_WAIT, headers=headers)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def submit(self, path: Path) -> dict[str, Any]:
        """Send a study file, and before it the scene file it names; the service checks both."""
        content = read_study(path)
        tables: Any = content
        while isinstance(tables, dict):
            scene = tables.get("scene")
            if isinstance(scene, str) and scene.endswith(".toml"):
                tables["scene"] = self.post_scene(path.parent / scene)["id"]
            tables = tables.get("extends")
        return self._ask("POST", "/studies", json=content).json()

    def post_scene(self, path: Path) -> dict[str, Any]:
        """Send a scene file and its meshes."""
        from studies.scenes.description import Description

        known = Description.read(path)
        files = [("scene", (path.name, path.read_bytes(), "application/toml"))]
        for name, mesh in (known.meshes or {}).items():
            files.append(("meshes", (name, mesh.data, "application/octet-stream")))
        return self._ask("POST", "/scenes", files=files).json()

    def status(self, study_id: str) -> dict[str, Any]:
        """Return the state of a study."""
        return self._ask("GET", f"/studies/{study_id}").json()

    def cancel(self, study_id: str) -> None:
        """Stop a study; its finished runs stay."""
        self._ask("DELETE", f"/studies/{study_id}")

    def fetch(self, study_id: str, target: Path) -> None:
        """Save the combined data set of a study."""
        with self._client.stream("GET", f"/studies/{study_id}/dataset.nc") as answer:
            _accept(answer)
            with appearing(target) as part, part.open("wb") as file:
                for piece in answer.iter_bytes():
                    file.write(piece)

    def _ask(self, method: str, path: str, **content: Any) -> httpx.Response:
        answer = self._client.request(method, path, **content)
        _accept(answer)
        return answer


def api_key(path: Path | None) -> str | None:
    """Return the key in the file ``path``, or in the environment; errors never show the key."""
    if path is None:
        return _plain("RESIDUA_API_KEY", os.environ.get("RESIDUA_API_KEY", "")) or None
    try:
        text = path.read_text(encoding="ascii", errors="replace")
    except OSError as error:  # the text may be the key itself, typed by mistake: do not show it
        allowed = f"must be a file that contains the key: {error.strerror}"
        raise StudyError("--api-key-file", "…", allowed) from None
    return _plain("--api-key-file", text)


def _plain(source: str, text: str) -> str:
    """Return the key, or raise `StudyError` if a header cannot contain it."""
    key = text.strip()
    if not re.fullmatch(r"[\w-]*", key, re.ASCII):
        raise StudyError(source, "…", "must hold one key: letters, digits, '-' and '_'")
    return key


def _accept(answer: httpx.Response) -> None:
    """Raise `Refused` with the text of the service's problem document, if it is one."""
    if answer.is_success:
        return
    answer.read()
    try:
        problem = answer.json()
    except ValueError:
        problem = {}
    reasons = [
        f"{each['field']} = {each['value']!r}: {each['allowed']}"
        for each in problem.get("errors", [])
    ]
    detail = problem.get("detail") or f"{answer.status_code} {answer.reason_phrase}"
    raise Refused("\n".join(reasons) or detail)
