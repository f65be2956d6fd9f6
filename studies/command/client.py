"""The command line's side of the HTTP service."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import httpx

from studies.errors import StudyError
from studies.storage.store import appearing

_WAIT = 60.0
"""Seconds to wait for an answer."""


class Refused(Exception):
    """The service answered with an error; the text says why, one line for each reason."""


class Service:
    """A running service.

    Parameters
    ----------
    url : its root, such as ``http://localhost:8000``
    """

    def __init__(self, url: str) -> None:
        self._client = httpx.Client(base_url=url, timeout=_WAIT)

    def submit(self, path: Path) -> dict[str, Any]:
        """Send a study file; the service checks it."""
        try:
            content = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise StudyError("file", str(path), f"cannot be read: {error.strerror}") from None
        except ValueError as error:
            raise StudyError("file", str(path), f"must be valid TOML: {error}") from None
        return self._ask("POST", "/studies", json=content).json()

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


def _accept(answer: httpx.Response) -> None:
    """Raise `Refused` with the words of the service's problem document, if it is one."""
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
