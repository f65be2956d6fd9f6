"""A client of the service.

>>> with Client("http://localhost:8000") as service:  # doctest: +SKIP
...     study = service.submit("study.toml").wait()
...     dataset = study.open()
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TextIO

import httpx

from solver.files import appearing, read_file
from studies.definition.files import read_study
from studies.definition.identity import is_id
from studies.definition.study import Study
from studies.definition.sweep import labels
from studies.definition.vocabulary import OK
from studies.errors import MOST_NAMES, StudyError
from studies.scenes.file_scene import FileScene
from studies.toml import toml_file
from studies.views.columns import placed
from studies.views.figures import Worst
from studies.views.summary import Failed, Summary, bar, summary_of

if TYPE_CHECKING:
    import xarray as xr

    from studies.scenes.description import Description

_WAIT = 60.0
"""Time to wait for an answer, and for one that is put off [s]."""
_SOON, _LATE = 0.2, 2.0
"""Shortest and longest time between two looks at a study [s]."""
_ENDED = ("successful", "failed", "dismissed")


class Refused(Exception):
    """The service answered with an error; the text says why, one line for each reason."""


class NoAnswer(Exception):
    """No service answers; the text has its URL and the reason."""


class Client:
    """A running service.

    Parameters
    ----------
    url : its root, such as ``http://localhost:8000``
    key : API key, if the service requires one

    Raises
    ------
    StudyError
        for a URL that is none
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        _check_url(url)
        self.url = url.rstrip("/")
        self.headers = {"authorization": f"Bearer {key}"} if key else {}
        self._client = httpx.Client(base_url=self.url, timeout=_WAIT, headers=self.headers)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def submit(self, study: Study | Mapping[str, Any] | Path | str) -> RemoteStudy:
        """Send a study, and before it the scene file it names; return it as the service has it.

        Raises
        ------
        Refused
            with the fields, their values and what is allowed
        """
        if isinstance(study, Path | str):
            return self._submit(read_study(Path(study)), Path(study).parent)
        if isinstance(study, Study):
            content, scene = study.to_dict(files=True), study.problem
            if isinstance(scene, FileScene) and scene.posted:
                content["scene"] = self._post(scene.description)["id"]
            return self._submit(content, Path())
        return self._submit(study, Path())

    def _submit(self, study: Mapping[str, Any], folder: Path) -> RemoteStudy:
        tables: Any = (content := deepcopy(dict(study)))
        while isinstance(tables, dict):
            scene = tables.get("scene")
            if isinstance(scene, str) and scene.endswith(".toml"):
                tables["scene"] = self.post_scene(folder / scene)["id"]
            tables = tables.get("extends")
        return RemoteStudy(self, self.told("POST", "/studies", json=content)["id"])

    def study(self, study_id: str) -> RemoteStudy:
        """Return a study that the service has; that it does is found when it is used."""
        return RemoteStudy(self, study_id)

    def find(self, named: str) -> RemoteStudy:
        """Return the study with an id, or the one that has a name.

        Raises
        ------
        StudyError
            if no study has the name, or several have it
        """
        if is_id(named):
            return self.study(named)
        found = self.studies(name=named, limit=MOST_NAMES)
        if len(found) == 1:
            return found[0]
        allowed = "must be the id of a study, 32 hexadecimal digits, or the name of one"
        if found:
            ids = ", ".join(each.id for each in found)
            allowed = f"several studies have this name: give an id, such as {ids}"
        raise StudyError("id", named, allowed)

    def studies(self, **which: str | int) -> list[RemoteStudy]:
        """Return studies, the latest first: of a ``status``, ``tag``, ``scene`` or ``text``."""
        found = self.told("GET", "/studies", params=which)["items"]
        return [RemoteStudy(self, each["id"]) for each in found]

    def post_scene(self, path: Path | str) -> dict[str, Any]:
        """Send a scene file and its meshes; return its ``id``, ``name`` and ``summary``."""
        from studies.scenes.description import Description  # loads scipy

        return self._post(Description.read(Path(path)), read_file(path))

    def _post(self, known: Description, text: bytes | None = None) -> dict[str, Any]:
        files = [
            ("scene", (known.file, text or toml_file(known.content).encode(), "application/toml"))
        ]
        for name, mesh in (known.meshes or {}).items():
            files.append(("meshes", (name, mesh.data, "application/octet-stream")))
        return self.told("POST", "/scenes", files=files)

    def ask(self, method: str, path: str, **content: Any) -> httpx.Response:
        """Return the answer to a request; what is put off is asked again, for a minute.

        Raises
        ------
        Refused
            if the service answers with an error
        NoAnswer
            if none answers
        """
        with self.read(path, method, **content) as answer:
            answer.read()
            return answer

    def told(self, method: str, path: str, **content: Any) -> Any:
        """Return what the answer to a request tells; errors as `ask`."""
        answer = self.ask(method, path, **content)
        try:
            return answer.json()
        except ValueError:
            raise Refused(f"{answer.url} does not answer as a service of studies does") from None

    @contextlib.contextmanager
    def read(self, path: str, method: str = "GET", **content: Any) -> Iterator[httpx.Response]:
        """Give an answer that is read piece by piece; errors as `ask`."""
        until = time.monotonic() + _WAIT
        while True:
            with self._answering(), self._client.stream(method, path, **content) as answer:
                if method != "GET" or not _later(answer, until):
                    yield _accepted(answer)
                    return

    @contextlib.contextmanager
    def _answering(self) -> Iterator[None]:
        """Raise `NoAnswer`, which tells the URL, if the connection fails."""
        try:
            yield
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            raise NoAnswer(f"{self.url} does not answer: {error}") from error


class RemoteStudy:
    """A study of a service; a notebook shows it as HTML."""

    def __init__(self, client: Client, study_id: str) -> None:
        self.client, self.id = client, study_id
        self._path = f"/studies/{study_id}"

    @property
    def url(self) -> str:
        """Its address."""
        return f"{self.client.url}{self._path}"

    @property
    def page(self) -> str:
        """Address of its page in the browser."""
        return f"{self.client.url}/ui{self._path}"

    def detail(self) -> dict[str, Any]:
        """Return where it stands: ``status``, ``progress``, ``counts``, ``sweep`` and so on."""
        return self.client.told("GET", self._path, params={"limit": 1})

    def wait(self, seconds: float | None = None, show: bool = True) -> Self:
        """Return when the work has ended, whatever came of it.

        Parameters
        ----------
        seconds : longest time to wait; None for any
        show : draw a bar in a terminal, and this study in a notebook

        Raises
        ------
        TimeoutError
            if it has not ended by then
        """
        until = None if seconds is None else time.monotonic() + seconds
        pause, screen = _SOON, _Screen() if show else None
        try:
            while True:
                detail = self.detail()
                if screen:
                    screen.draw(self, detail)
                if detail["status"] in _ENDED:
                    return self
                if until is not None and time.monotonic() > until:
                    raise TimeoutError(f"{detail['name']} is {detail['status']} still")
                time.sleep(pause)
                pause = min(1.2 * pause, _LATE)
        finally:
            if screen:
                screen.close()

    def cancel(self) -> None:
        """Stop the work; finished runs stay."""
        self.client.ask("DELETE", self._path)

    def retry(self) -> None:
        """Have failed and missing runs computed again."""
        self.client.ask("POST", f"{self._path}/retry")

    def open(self, lazy: bool = True) -> xr.Dataset:
        """Return the data set, as `open_study` does; while the study runs, of the runs there are.

        Parameters
        ----------
        lazy : read values when they are used, if zarr is installed here (the extra ``zarr``). The
            service checks the seal of its file; the parts that arrive have none. Otherwise the
            whole data set is fetched, and its seal is checked here
        """
        import xarray as xr

        from studies.views.reading import indexed, loaded

        if lazy and _has_zarr():
            self.client.ask("GET", f"{self._path}/zarr/zarr.json")  # reports the service's error
            options = {"headers": self.client.headers}
            return indexed(xr.open_zarr(f"{self.url}/zarr", chunks=None, storage_options=options))
        content = self.client.ask("GET", f"{self._path}/dataset.nc").content
        return loaded(content, self.url)

    def fetch(self, target: Path | str) -> Path:
        """Save the data set as a netCDF file."""
        with (
            self.client.read(f"{self._path}/dataset.nc") as answer,
            appearing(Path(target)) as part,
            part.open("wb") as file,
        ):
            for piece in answer.iter_bytes():
                file.write(piece)
        return Path(target)

    def table(self, **which: str) -> list[dict[str, Any]]:
        """Return the numbers of the runs, an entry each: ``friction="0.1..0.4"``, ``sort=``."""
        return self.client.told("GET", f"{self._path}/table.json", params=which)["rows"]

    def log(self) -> str:
        """Return what happened to the study, a line each."""
        return self.client.ask("GET", f"{self._path}/log").text

    def summary(self) -> Summary:
        """Return a short view of the study."""
        return self._summary(self.detail())

    def _summary(self, detail: Mapping[str, Any]) -> Summary:
        found = self.client.told("GET", f"{self._path}/audit")
        first = found[0] if found else None
        audit = first and (
            Worst(first["name"], first["value"], first["limit"], 0), placed(first["at"])
        )  # fmt: skip
        lost = [word for word in detail["counts"] if word not in (OK, "pending")]
        failed = []
        if lost:
            axes = [name for name, axis in detail["sweep"].items() if len(labels(name, axis)) > 1]
            names = ",".join([*axes, "status", "message"])
            for row in self.table(status=",".join(lost), columns=names):
                place = placed({name: row[name] for name in axes})
                failed.append(Failed(place=place, status=row["status"], message=row["message"]))
        return summary_of(detail, audit or None, failed)

    def __repr__(self) -> str:
        return f"RemoteStudy({self.url!r})"

    def __str__(self) -> str:
        return str(self.summary())

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()


class _Screen:
    """Shows how far a study is: in a notebook, on a terminal, or by lines in a log."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream, self._shown, self._show = stream or sys.stderr, "", _notebook()
        self._cell: Any = None

    def draw(self, study: RemoteStudy, detail: Mapping[str, Any]) -> None:
        """Show a study where it stands, if that has changed."""
        now = f"{bar(detail['progress'] / 100.0)}  {detail['status']}"
        now += f", {detail['message']}" if detail["message"] else ""
        if now == self._shown:
            return
        self._shown = now
        if self._show:
            view = study._summary(detail)
            if self._cell is None:
                self._cell = self._show(view, display_id=True)
            else:
                self._cell.update(view)
        elif self._stream.isatty():
            print(f"\r{now}\x1b[K", end="", file=self._stream, flush=True)
        else:
            print(now, file=self._stream, flush=True)

    def close(self) -> None:
        """Leave the line."""
        if not self._show and self._shown and self._stream.isatty():
            print(file=self._stream)


def _check_url(url: str) -> None:
    try:
        given = httpx.URL(url)
    except httpx.InvalidURL as error:
        raise StudyError("url", url, f"must be a URL: {error}") from None
    if given.scheme not in ("http", "https") or not given.host:
        allowed = "must begin with http:// or https://, and name a host"
        raise StudyError("url", url, allowed)


def _notebook() -> Any:
    """Return the function that shows an object in a notebook; None outside of one."""
    python = sys.modules.get("IPython")
    shell = python.get_ipython() if python else None
    if getattr(shell, "kernel", None) is None:
        return None
    from IPython.display import display

    return display


def _has_zarr() -> bool:
    from importlib.util import find_spec

    return find_spec("zarr") is not None and find_spec("aiohttp") is not None


def _later(answer: httpx.Response, until: float) -> bool:
    """Wait if an answer is put off; return whether to ask again."""
    after = answer.headers.get("retry-after", "")
    later = httpx.codes.SERVICE_UNAVAILABLE, httpx.codes.TOO_MANY_REQUESTS
    if answer.status_code not in later or not after.isdecimal():
        return False
    if time.monotonic() + float(after) > until:
        return False
    time.sleep(float(after))
    return True


def _accepted(answer: httpx.Response) -> httpx.Response:
    """Return an answer; raise `Refused` with the text of the service's problem document."""
    if answer.is_success:
        return answer
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
