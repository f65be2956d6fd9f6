"""The command ``residua``: what it prints, writes and returns."""

from __future__ import annotations

import io
import json
import math
import os
import shutil
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
import xarray as xr

from residua.cli import main
from residua.progress import Progress
from residua.status import complain
from solver.results.shakedown import ShakedownState
from studies import Store, Study, StudyEvent, open_netcdf
from studies.storage.dataset import attributes_of
from studies.storage.seal import seal
from tests.studies.conftest import compute_here, fake_study

pytestmark = pytest.mark.usefixtures("one_worker")

StudyFile = Callable[..., Path]
PNG = b"\x89PNG\r\n"
EMPTY = "'': must be the name of a file or a folder"


@pytest.mark.processes
def test_run_prints_a_table_and_writes_data_and_picture(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["run", str(study_file()), "--out", str(out), "--workers", "1"]) == 0
    printed = capsys.readouterr()
    lines = printed.out.splitlines()
    assert lines[0].split() == ["peak"]
    assert lines[1].split() == ["load", "contact"]
    assert lines[2].split() == ["ratio", "friction", "status", "pressure", "increments", "cpu"]
    assert lines[3].split() == ["[MPa]", "[s]"]
    assert [line.split()[:3] for line in lines[4:8]] == [
        ["0.3", "0", "ok"], ["0.3", "0.4", "ok"], ["0.9", "0", "ok"], ["0.9", "0.4", "ok"],
    ]  # fmt: skip
    written = [Path(line.split()[1]) for line in lines if line.startswith("wrote")]
    assert [path.suffix for path in written] == [".nc", ".txt", ".png"]
    assert written[2].read_bytes().startswith(PNG)
    assert "\r" not in printed.err, "no bar where nobody watches"
    begun, *each = printed.err.splitlines()  # on a busy machine with lines without a run
    assert begun == "fake: 4 runs to compute" and sum("ok  " in line for line in each) == 4


@pytest.mark.processes
def test_run_with_failed_runs_tells_which_and_why_and_returns_1(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", str(study_file(trouble="limit")), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--workers", "1"]) == 1
    printed = capsys.readouterr()
    assert printed.err.count("flows at 0.75") == 2, "as it happens"
    which = "2 runs: load_ratio = 0.9, friction = 0; load_ratio = 0.9, friction = 0.4"
    assert f"\n\nlimit_load: flows at 0.75\n    {which}\n\nfake: 4 runs" in printed.out
    assert "2 ok, 2 limit_load" in printed.out
    assert main([*arguments, "--resume"]) == 1
    assert "0 computed" in capsys.readouterr().out


@pytest.mark.processes
def test_warnings_are_counted_and_told_once_with_their_runs(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["run", str(study_file(trouble="warn")), "--out", str(out), "--workers", "1"]
    assert main(arguments) == 0
    printed = capsys.readouterr()
    assert "strains are large" not in printed.err
    assert printed.out.count("\nwarning: strains are large\n    2 runs: load_ratio = 0.9, ") == 1
    assert "4 runs (4 ok; 2 with a warning)" in printed.out
    assert main(["show", str(out)]) == 0
    assert capsys.readouterr().out.count("\nwarning: strains are large\n    2 runs: ") == 1
    for run in (out / "runs").iterdir():
        main(["show", str(run)])
    assert capsys.readouterr().out.count("strains are large") == 2


def test_of_many_runs_with_one_message_some_are_named(
    store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    loads = [0.8, 0.81, 0.82, 0.83, 0.84, 0.85]
    compute_here(fake_study(sweep={"load_ratio": loads}, trouble="limit"), store)
    assert main(["show", str(store.directory)]) == 0
    told = capsys.readouterr().out
    assert "    6 runs: load_ratio = 0.8; " in told and "load_ratio = 0.83; and 2 more\n" in told


def test_show_tells_how_far_a_study_without_a_data_set_is(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, later = fake_study("first"), fake_study("later", sweep={"friction": [0.9]})
    compute_here(study, store)
    store.dataset_path(study.id).unlink()
    store.discard([next(study.cases()).id])
    store.save_study(later)
    named = [store.directory / study.name, store.directory / study.id[:8]]
    for path in (store.directory, store.study_path(study.id), *named):
        assert main(["show", str(path)]) == 0
        told = capsys.readouterr().out
        assert "first: 3 of 4 runs finished; no data set yet" in told
        assert ("later: 0 of 1 runs finished" in told) is (path == store.directory)
    assert main(["plot", str(store.directory), "--out", str(tmp_path / "a.png")]) == 2
    told = capsys.readouterr().err
    assert "first: 3 of 4 runs finished; no data set yet" in told
    assert f"residua view {store.directory} shows the runs" in told and "open_zarr" in told
    compute_here(later, store)
    assert main(["show", str(store.directory)]) == 0
    told = capsys.readouterr().out
    assert "later: 0" not in told and "max_plastic_strain" not in told and "0.9" in told


@pytest.mark.parametrize("content", ["nonsense", "{}", "[]"])
def test_a_broken_study_hides_no_other(
    content: str, store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    study = fake_study("first")
    store.save_study(study)
    (store.study_path(study.id, "study.json")).write_text(content)
    store.save_study(fake_study("second"))
    assert main(["show", str(store.directory)]) == 0
    told = capsys.readouterr().out
    assert f"{study.id}: its study.json cannot be read" in told
    assert "second: 0 of" in told


def test_a_study_of_another_solver_is_told_as_such(
    store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    study = fake_study("first")
    store.save_study(study)
    other = store.save_definition("0" * 32, study.to_dict())
    shutil.rmtree(store.study_path(study.id))
    assert main(["show", str(store.directory)]) == 0
    told = "first: begun with another version of the solver; no data set yet"
    assert told in capsys.readouterr().out
    shutil.rmtree(other)
    store.save_definition("0" * 32, study.to_dict() | {"parameters": {"gone": 1}})
    assert main(["show", str(store.directory)]) == 0
    assert told in capsys.readouterr().out


def test_show_of_a_run_tells_flags_in_words_and_no_negative_zero(
    computed: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, store = computed
    with open_netcdf(store.run_path(next(study.cases()).id)) as run:
        changed = run.load()
    for name, value in (("shakedown_state", ShakedownState.UNDECIDED), ("creepage", -0.0)):
        changed[name] = xr.full_like(changed["peak_residual_tension"], float(value))
        changed[name].attrs = attributes_of(name)
    changed.to_netcdf(tmp_path / "run.nc")
    seal(tmp_path / "run.nc", "run changed")
    assert main(["show", str(tmp_path / "run.nc")]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["shakedown_state", "undecided"] in lines
    assert ["creepage", "0"] in lines
    assert ["status", "ok"] in lines


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            'name = "a"\nscene = "fake"\n[sweep]\nfriction = [0.1, -0.2]',
            "residua: sweep.friction[1] = -0.2: must be a finite number >= 0 and <= 1",
        ),
        ('name = "a"\nscene = "bal"', "residua: scene = 'bal': must be one of "),
        ("name = ", "residua: file = "),
    ],
)
def test_bad_input_is_one_line_and_returns_2(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, line: str
) -> None:
    assert main(["run", str(study_file(text)), "--out", str(tmp_path / "out")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(line)
    assert printed.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "are required: COMMAND"),
        (["fly"], "invalid choice: 'fly'"),
        (["run"], "are required: STUDY.toml"),
        (["run", "a.toml", "--workers", "-1"], "argument --workers"),
        (["serve", "--port", "99999"], "argument --port"),
        (["run", "study.toml", "--out", ""], EMPTY),
        (["run", ""], EMPTY),
        (["show", ""], EMPTY),
        (["serve", "--data", ""], EMPTY),
        (["certificates", "--out", ""], EMPTY),
    ],
)
def test_a_wrong_command_line_returns_2_with_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith("residua: ") and told.count("\n") == 1
    assert words in told


@pytest.mark.parametrize("device", ["/dev/null", "/dev/zero", "pipe"])
def test_a_study_that_is_no_file_is_told_in_one_line(
    device: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (Path(device), tmp_path / device):
        assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 2
        told = capsys.readouterr().err
        assert told.startswith("residua: file = ") and told.count("\n") == 1
    assert "must be a file" in told


@pytest.mark.parametrize("inside", ["", "deeper"])
def test_a_directory_that_cannot_be_written_to_is_one_line_and_returns_2(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str], inside: str
) -> None:
    (tmp_path / "file").touch()
    out = tmp_path / "file" / inside
    assert main(["run", str(study_file()), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert "must be a directory to write in (" in printed.err
    assert printed.err.count("\n") == 1


def test_a_busy_directory_is_one_line_and_returns_1(
    study_file: StudyFile, store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    with store.writing():
        assert main(["run", str(study_file()), "--out", str(store.directory)]) == 1
    begun, printed = capsys.readouterr().err.splitlines()
    assert begun == "fake: 4 runs to compute"
    assert f"another process (id {os.getpid()}) computes here" in printed


def test_scenes_tells_ranges_units_and_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == 0
    assert "fake" in capsys.readouterr().out
    assert main(["scenes", "fake"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (half_width,) = [line for line in lines if line.startswith("half_width")]
    assert half_width.split() == [
        "half_width", "50", "a", "finite", "number", ">", "0", "[mm]", "half-width",
    ]  # fmt: skip
    assert main(["scenes", "fak"]) == 2
    assert "did you mean fake?" in capsys.readouterr().err


def test_show_takes_a_run_a_study_or_a_directory(
    computed: tuple[Study, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    study, store = computed
    case = next(study.cases())
    assert main(["show", str(store.run_path(case.id))]) == 0
    details = capsys.readouterr().out
    assert "friction" in details
    assert "peak_residual_tension" in details
    for path in (store.directory, store.dataset_path(study.id)):
        assert main(["show", str(path)]) == 0
        assert capsys.readouterr().out.count(" ok ") == study.size
    assert main(["show", str(store.directory / "nowhere")]) == 2
    for name in (study.name, study.id[:6], "latest"):
        assert main(["show", str(store.directory), "--study", name]) == 0
        assert capsys.readouterr().out.count(" ok ") == study.size
    assert main(["show", str(store.directory), "--study", "nowhere"]) == 2
    assert main(["table", "http://localhost:1/studies/a", "--study", study.name]) == 2
    assert "a URL is that of one study" in capsys.readouterr().err


@pytest.mark.processes
def test_the_note_and_the_tags_of_a_study_are_printed_with_it(
    study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = study_file(), str(tmp_path / "out")
    path.write_text('note = "loads of the drawing"\ntags = ["first", "rail"]\n' + path.read_text())
    assert main(["run", str(path), "--out", out, "--workers", "1"]) == 0
    assert "\nnote: loads of the drawing\n" in capsys.readouterr().out
    assert main(["show", out]) == 0
    assert "\nloads of the drawing\nfirst rail\n\n" in capsys.readouterr().out


def test_plot_draws_any_field_of_any_run(
    computed: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, store = computed
    picture = tmp_path / "a.png"
    select = ["--select", "friction=0.4", "--select", "load_ratio=0.3"]
    arguments = ["plot", str(store.directory), "--out", str(picture)]
    assert main([*arguments, *select, "--component", "yy", "--zoom", "30"]) == 0
    assert picture.read_bytes().startswith(PNG)
    single = ["plot", str(store.run_path(next(study.cases()).id)), "--out", str(picture)]
    assert main([*single, "--field", "contact_pressure"]) == 0
    capsys.readouterr()
    for wrong, named in [
        (["--select", "friction=0.3"], "friction = '0.3': must be one of 0.0, 0.4"),
        (["--select", "friction=0", "friction=0.4"], "friction is given already, as 0"),
        (["--select", "friction"], "must be NAME=VALUE"),
        (["--field", "colour"], "must be one of residual_stress, plastic_strain"),
        (["--component", "zz"], "must be one of xx, yy, xy"),
        (["--field", "plastic_strain", "--component", "xx"], "leave it out"),
        (["--zoom", "0.1"], "must be a length"),
        (["--zoom", "-1"], "must be a length"),
        (["--zoom", "nan"], "must be a length"),
        (["--out", "a.xyz"], "--out = 'a.xyz': must end in one of"),
        (["--out", str(tmp_path / "nowhere" / "a.png")], "cannot be written: No such file"),
    ]:
        assert main([*arguments, *wrong]) == 2
        assert named in capsys.readouterr().err


def test_plot_of_a_study_without_success_says_why(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    compute_here(fake_study(sweep={"load_ratio": [0.9]}, trouble="limit"), store)
    assert main(["plot", str(store.directory), "--out", str(tmp_path / "a.png")]) == 2
    assert "flows at 0.75" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_bar_stays_on_one_line_and_counts_failures() -> None:
    study, screen = fake_study(), Terminal()
    bar = Progress(study, screen)
    for number, case in enumerate(study.cases(), start=1):
        status = "ok" if number < 4 else "limit_load"
        bar(StudyEvent(kind="run", progress=number / 4, path="", run=case.id, status=status))
    bar.close()
    drawn = screen.getvalue()
    assert drawn.count("\n") == 1
    assert "100 %  4 of 4 runs, 1 failed" in drawn.split("\r")[-1]


@pytest.mark.parametrize("screen", [Terminal(), io.StringIO()])
def test_the_time_left_is_told_at_the_pace_so_far(
    screen: io.StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, clock = fake_study(), iter((0.0, 0.0, 3600.0, 5400.0, 7290.0))
    # not the clock of other threads: a cluster that tests share would end
    monkeypatch.setattr("residua.progress.time", SimpleNamespace(monotonic=lambda: next(clock)))
    monkeypatch.setattr("residua.progress._REDRAW", -1.0)
    first = next(study.cases())
    bar = Progress(study, screen)
    bar(StudyEvent(kind="path", progress=0.0, path="a"))
    bar(StudyEvent(kind="run", progress=0.5, path="a", run=first.id, status="ok"))
    assert screen.getvalue().rstrip("\x1b[K\n").endswith("left")
    left = screen.getvalue().split()[-2:]
    assert left[0] in ("1:00:00", "1:30:00")


def test_a_log_gets_a_line_while_a_long_run_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    study, screen, clock = fake_study(), io.StringIO(), [0.0]
    monkeypatch.setattr("residua.progress.time", SimpleNamespace(monotonic=lambda: clock[0]))
    progress = Progress(study, screen)
    for clock[0], done in ((4.0, 0.0), (12.0, 0.01), (15.0, 0.1), (24.0, 0.2)):
        progress(StudyEvent(kind="path", progress=done, path="a"))
    assert screen.getvalue().splitlines() == ["  1 %  computing", " 20 %  computing  1:36 left"]


@pytest.mark.parametrize("screen", [Terminal(), io.StringIO()])
def test_runs_that_were_there_are_told(screen: io.StringIO) -> None:
    study = fake_study()
    bar = Progress(study, screen)
    bar(StudyEvent(kind="path", progress=0.5, path="a"))
    for number, case in enumerate(list(study.cases())[2:], start=3):
        bar(StudyEvent(kind="run", progress=number / 4, path="a", run=case.id, status="ok"))
    bar.close()
    told = "4 of 4 runs (2 were there)" if screen.isatty() else "2 of 4 runs exist already"
    assert told in screen.getvalue()


@pytest.mark.parametrize("screen", [Terminal(), io.StringIO()])
def test_what_a_study_waits_for_is_said_once(screen: io.StringIO) -> None:
    progress = Progress(fake_study(), screen)
    for message in ("no worker", "", "no worker", "", "no directory"):
        progress(StudyEvent(kind="waiting", progress=0.0, message=message))
    lines = [line for line in screen.getvalue().splitlines() if line.startswith("waiting")]
    assert lines == ["waiting: no worker", "waiting: no directory"]


class FakeService(BaseHTTPRequestHandler):
    """Answers as the service does."""

    def do_POST(self) -> None:
        study = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if study["scene"] == "fake":
            self.answer(201, {"id": "1" * 32, **study})
        else:
            errors = [{"field": "scene", "value": study["scene"], "allowed": "must be fake"}]
            self.answer(422, {"title": "Bad study", "detail": "scene", "errors": errors})

    def do_GET(self) -> None:
        if self.path.endswith("/dataset.nc"):
            self.answer(200, b"data")
        elif self.path.startswith("/studies?"):
            ids = {"one": "1", "two": "12"}.get(parse_qs(urlsplit(self.path).query)["name"][0], "")
            self.answer(200, {"items": [{"id": each * 32} for each in ids]})
        elif self.path.partition("?")[0].endswith("1" * 32):
            self.answer(200, {"status": "running", "progress": 40})
        else:
            self.answer(404, {"detail": "no such study"})

    def do_DELETE(self) -> None:
        self.answer(200, {"status": "dismissed"})

    def answer(self, status: int, content: Any) -> None:
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *arguments: Any) -> None:
        pass


@pytest.fixture
def url() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), FakeService) as server:
        threading.Thread(target=server.serve_forever).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_the_client_submits_watches_fetches_and_cancels(
    url: str, study_file: StudyFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["submit", str(study_file()), "--url", url]) == 0
    study_id = capsys.readouterr().out.strip()
    assert study_id == "1" * 32
    assert main(["status", study_id, "--url", url]) == 0
    assert capsys.readouterr().out.split() == ["running", "40", "%"]
    target = tmp_path / "got.nc"
    assert main(["fetch", study_id, "--url", url, "--out", str(target)]) == 0
    assert target.read_bytes() == b"data" and [*tmp_path.glob("got*")] == [target]
    capsys.readouterr()
    target = tmp_path / "absent" / "got.nc"
    assert main(["fetch", study_id, "--url", url, "--out", str(target)]) == 2
    assert "cannot be written: No such file" in capsys.readouterr().err
    assert main(["cancel", study_id, "--url", url]) == 0
    capsys.readouterr()
    assert main(["cancel", "one", "--url", url]) == 0
    assert capsys.readouterr().out == f"cancelled {study_id}\n"
    assert main(["status", "two", "--url", url]) == 2
    assert f"several studies have this name: give an id, such as {study_id}, 2" in (
        capsys.readouterr().err
    )
    assert main(["fetch", "11111", "--url", url]) == 2
    assert "id = '11111': must be the id of a study, 32 hex" in capsys.readouterr().err


def test_the_client_says_what_the_service_refused(
    url: str, study_file: StudyFile, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = study_file('name = "a"\nscene = "bal"')
    assert main(["submit", str(wrong), "--url", url]) == 2
    assert capsys.readouterr().err == "residua: scene = 'bal': must be fake\n"
    assert main(["status", "2" * 32, "--url", url]) == 2
    assert capsys.readouterr().err == "residua: no such study\n"
    assert main(["status", "2" * 32, "--url", "http://127.0.0.1:1"]) == 1
    assert "residua: http://127.0.0.1:1 does not answer: " in capsys.readouterr().err
    for wrong_url in ("localhost:8765", "http://", "ftp://localhost"):
        assert main(["status", "2" * 32, "--url", wrong_url]) == 2
        told = f"residua: --url = {wrong_url!r}: must begin with http:// or https://"
        assert told in capsys.readouterr().err
    assert main(["status", "2" * 32, "--url", "http://localhost:x"]) == 2
    assert "--url = 'http://localhost:x': must be a URL" in capsys.readouterr().err
    assert main(["submit", "absent.toml", "--url", url]) == 2


def test_no_number_in_a_table_is_nan(store: Store, capsys: pytest.CaptureFixture[str]) -> None:
    compute_here(fake_study(trouble="limit"), store)
    assert main(["show", str(store.directory)]) == 0
    assert str(math.nan) not in capsys.readouterr().out


def test_a_message_of_the_command_has_an_end(capsys: pytest.CaptureFixture[str]) -> None:
    assert complain("x" * 2_000_000, 2) == 2
    told = capsys.readouterr().err
    assert told.startswith("residua: xxx") and len(told) < 101_000


def test_a_scene_and_a_study_in_each_others_place_are_told_by_what_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, study = tmp_path / "pin.toml", tmp_path / "pins.toml"
    scene.write_text('name = "pin"\n[bodies.pin]\n')
    study.write_text('name = "pins"\nscene = "pin.toml"\n')
    assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert (
        'is a scene file, not a study: a study has the line scene = "pin.toml"'
        in capsys.readouterr().err
    )
    assert main(["scenes", str(study)]) == 2
    assert "is a study file, not a scene: its scene is pin.toml" in capsys.readouterr().err


def test_an_interrupt_while_libraries_are_loaded_ends_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("residua.arguments.parser", interrupted)
    assert main(["scenes"]) == 130
    assert capsys.readouterr().err == ""
