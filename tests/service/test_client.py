"""The client in Python, and what a notebook shows of a study."""

from __future__ import annotations

import io
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
import xarray as xr

from service.pages.form import as_python
from solver.audit.figures import LIMITS
from studies import Client, Study, StudyError, open_study, summary
from studies.client import NoAnswer, Refused, RemoteStudy, _Screen
from studies.scenes.scene import read_scene
from tests.architecture.sources import ROOT
from tests.service.servers import Server, fake_study
from tests.studies.fakes import FAKE

PIN = ROOT / "data/scenes/pin.toml"


@pytest.fixture(scope="module")
def client(service: Server) -> Iterator[Client]:
    with Client(str(service.client.base_url)) as found:
        yield found


@pytest.fixture(scope="module")
def done(client: Client) -> RemoteStudy:
    return client.submit(fake_study("by-client")).wait(90.0, show=False)


def test_a_study_is_submitted_watched_and_opened(
    client: Client, done: RemoteStudy, service: Server, tmp_path: Path
) -> None:
    assert done.detail()["status"] == "successful"
    assert done.id in {each.id for each in client.studies(text="by-client", limit=9)}
    assert client.find("by-client").id == client.find(done.id).id == done.id
    stored = open_study(service.data / "studies" / done.id / "dataset.nc")
    xr.testing.assert_equal(done.open(lazy=False), stored)
    xr.testing.assert_equal(done.open().load(), stored)
    xr.testing.assert_equal(open_study(done.fetch(tmp_path / "a.nc")), stored)
    rows = done.table(friction="0.2..0.4", sort="-load_ratio", columns="load_ratio,status")
    assert rows == [{"load_ratio": at, "status": "ok"} for at in (0.5, 0.25)]
    content = fake_study("by-client")
    assert client.submit(Study.from_dict(content, scene=FAKE)).id == done.id


def test_the_program_of_the_form_opens_the_data_set(
    client: Client, done: RemoteStudy, tmp_path: Path
) -> None:
    (tmp_path / "copied.py").write_text(as_python(fake_study("by-client"), client.url))
    found = runpy.run_path(str(tmp_path / "copied.py"))
    assert found["dataset"].attrs["id"] == done.id


def test_a_study_is_cancelled_and_what_it_has_is_read(client: Client) -> None:
    study = client.submit(fake_study("long", seconds=3.0))
    study.cancel()
    assert study.wait(30.0, show=False).detail()["status"] == "dismissed"
    assert {*study.open()["status"].to_numpy().ravel()} <= {"ok", "missing"}
    with pytest.raises(TimeoutError, match="long is"):
        study.retry()
        study.wait(0.0, show=False)
    study.cancel()


def test_a_refused_study_is_told_by_field(client: Client) -> None:
    with pytest.raises(Refused, match=r"friction.* = -1\.0: must be"):
        client.submit({"name": "x", "scene": "punch", "sweep": {"friction": [-1.0]}})
    with pytest.raises(Refused, match="no study has the id"):
        client.study("0" * 32).open()


def test_a_scene_is_sent_with_its_meshes_alone_or_by_a_study_that_has_it(client: Client) -> None:
    pin = read_scene(PIN)
    assert client.post_scene(PIN)["id"] == pin.id
    study = Study.from_dict({"name": "pin", "sweep": {"friction": [0.1]}}, scene=pin)
    posted = client.submit(study)
    posted.cancel()
    assert posted.detail()["scene"] == pin.id


def test_the_content_that_is_submitted_stays_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[dict[str, Any]] = []

    def told(method: str, path: str, json: dict[str, Any]) -> Any:
        sent.append(json)
        return {"id": "b" * 32}

    client = Client("http://localhost:1")
    monkeypatch.setattr(client, "told", told)
    monkeypatch.setattr(client, "post_scene", lambda path: {"id": "a" * 32})
    content = {"name": "x", "extends": {"name": "y", "scene": "pin.toml"}}
    client.submit(content)
    assert sent[0]["extends"]["scene"] == "a" * 32
    assert content["extends"] == {"name": "y", "scene": "pin.toml"}


def test_what_is_no_service_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client("http://localhost:1")
    page = httpx.Response(200, text="<html>", request=httpx.Request("GET", "http://localhost:1/x"))
    monkeypatch.setattr(client, "ask", lambda *_, **__: page)
    with pytest.raises(Refused, match="localhost:1/x does not answer as a service"):
        client.study("0" * 32).detail()


def test_the_url_that_does_not_answer_is_told(tmp_path: Path) -> None:
    client = Client("http://localhost:1")
    with pytest.raises(NoAnswer, match="localhost:1 does not answer"):
        client.submit(fake_study("x"))
    with pytest.raises(NoAnswer, match="localhost:1 does not answer"):
        client.study("0" * 32).fetch(tmp_path / "a.nc")
    with pytest.raises(StudyError, match="url = 'localhost:1': must begin with http://"):
        Client("localhost:1")


def test_the_view_of_a_study_is_short_and_the_same_here_and_there(
    done: RemoteStudy, service: Server
) -> None:
    there, here = done.summary(), summary(service.data / "studies" / done.id)
    for view in (there, here):
        text = str(view)
        assert "by-client: scene fake" in text and "100 %" in text and "4 ok" in text
        assert "friction" in text and "0, 0.3" in text
        assert len(text.splitlines()) < 10
        html = view._repr_html_()
        assert "<script" not in html and "by-client" in html and "width: 100.0%" in html
    assert there.audit == here.audit
    assert done._repr_html_() == there._repr_html_()


def test_the_log_of_a_study_tells_its_states_and_runs(done: RemoteStudy) -> None:
    times, words = zip(*(line.split("  ", 1) for line in done.log().splitlines()), strict=True)
    assert {"accepted", "running", "successful"} <= {*words}
    assert sum(": ok" in each for each in words) == 4
    assert list(times) == sorted(times)


class Watched(RemoteStudy):
    """A study that goes on at each look."""

    def __init__(self) -> None:
        super().__init__(Client("http://localhost:1"), "0" * 32)
        self.states = [("running", 25.0), ("running", 25.0), ("running", 75.0), ("failed", 75.0)]

    def detail(self) -> dict[str, Any]:
        status, progress = self.states.pop(0)
        axes = {"friction": [0.1 * k for k in range(9)]}
        counts = {"ok": 5, "limit_load": 2, "pending": 2}
        return {
            "name": "<watched>", "scene": "fake", "status": status, "progress": progress,
            "message": "", "counts": counts, "sweep": axes,
        }  # fmt: skip

    def _summary(self, detail: Any) -> Any:
        from studies.views.figures import Worst
        from studies.views.summary import Failed, summary_of

        name = next(iter(LIMITS))
        lost = [Failed(place="friction = 0.8", status="limit_load", message="no more <load>")]
        return summary_of(detail, (Worst(name, 0.5 * LIMITS[name], LIMITS[name], 0), ""), lost)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_bar_is_drawn_when_something_has_changed(
    monkeypatch: pytest.MonkeyPatch, terminal: bool
) -> None:
    monkeypatch.setattr("studies.client._SOON", 0.0)
    stream = io.StringIO()
    stream.isatty = lambda: terminal
    monkeypatch.setattr(sys, "stderr", stream)
    Watched().wait()
    drawn = [each for each in stream.getvalue().replace("\r", "\n").split("\n") if each]
    told = [each.removesuffix("\x1b[K")[-13:].strip() for each in drawn]
    assert told == ["25 %  running", "75 %  running", "75 %  failed"]
    assert ("\r" in stream.getvalue()) == terminal


def test_a_notebook_shows_the_study_and_brings_it_up_to_date(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("studies.client._SOON", 0.0)
    shown: list[str] = []
    cell = SimpleNamespace(update=lambda view: shown.append(view._repr_html_()))

    def display(view: Any, display_id: bool) -> Any:
        cell.update(view)
        return cell

    shell = SimpleNamespace(kernel=object())
    python = SimpleNamespace(get_ipython=lambda: shell)
    monkeypatch.setitem(sys.modules, "IPython", python)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    Watched().wait()
    assert len(shown) == 3
    for each in ("&lt;watched&gt;", "width: 75.0%", "no more &lt;load&gt;", "and 1 more failed"):
        assert each in shown[-1]
    assert "0 … 0.8 (9)" in shown[-1]


def test_without_a_kernel_there_is_no_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    python = SimpleNamespace(get_ipython=lambda: None)
    monkeypatch.setitem(sys.modules, "IPython", python)
    assert _Screen(io.StringIO())._show is None
