"""Turns of callers, their budgets, and processes with limits of time and memory."""

from __future__ import annotations

import asyncio
import base64
import errno
import os
import re
import resource
import signal
import socket
import struct
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute

from service import datasets, examiner, sandbox
from service import turns as turning
from service.app import create_app
from service.errors import Busy, TooMany
from service.examiner import Inspector
from service.keys import Keys, Scope
from service.pages import new
from service.pages import routes as pages
from service.routes import ROUTERS
from service.sandbox import BYTES, CRASHED, FAILED, Answer, call_shut_in, memory
from service.settings import Settings
from service.turns import Share, Turn, Turns
from studies import Study, StudyError
from studies.scenes.meshfile import MeshFile
from tests.service.test_access import asking
from tests.service.test_errors import problem

INCH, NEWTON = (
    {"scene": "punch", "name": "a", "parameters": {"half_width": each}} for each in ("2 in", "2 N")
)
FAILING: list[tuple[Callable[..., Any], object, float, type[Exception], str]] = [
    (Study.from_dict, INCH | {"scene": "no"}, 60.0, StudyError, "scene = 'no': must be one of"),
    (Study.from_dict, NEWTON, 60.0, StudyError, "parameters.half_width = '2 N': .* N is a force"),
    (bytes, 2 * BYTES, 60.0, StudyError, r"'a': must be read with [\d.]+ GiB of memory: less"),
    (time.sleep, 60, 0.5, Busy, r"a scene had [\d.e-]+ s of processor time in 0\.5 s: ask again"),
    (
        signal.raise_signal,
        signal.SIGKILL,
        60.0,
        Busy,
        "the process that reads a scene has ended: ask again",
    ),
]
"""What a process calls, with what and for how long, and the error.

The force is refused by a process that has converted an inch, with what pint loads of Dask.
"""


def test_what_fails_in_the_process_is_told_and_the_next_call_is_answered() -> None:
    async def calls() -> None:
        share = Share(Turns(1), "anna")
        for function, given, seconds, error, words in FAILING:
            limits = {"field": "scene", "name": "a", "seconds": seconds, "advice": ": less"}
            with pytest.raises(error, match=words):
                await share.apart(function, given, **limits)
            study = await share.apart(Study.from_dict, INCH, field="scene", name="a")
            assert study.name == "a"

    asyncio.run(calls())


class Clerk:
    """Notes whose call begins, and ends one when it is told to."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.go = asyncio.Semaphore(0)

    async def serve(self, turns: Turns, caller: str) -> None:
        async with turns.turn(caller):
            self.begun.append(caller)
            await self.go.acquire()


async def settled() -> None:
    """Let all tasks go on until they wait."""
    for _ in range(20):
        await asyncio.sleep(0)


def test_callers_take_turns_and_each_has_one_call_at_a_time() -> None:
    async def calls() -> None:
        turns, clerk = Turns(2, 60.0), Clerk()
        wanted = ["anna"] * 25 + ["bert"] * 2 + ["cora"]
        tasks = [asyncio.create_task(clerk.serve(turns, each)) for each in wanted]
        await settled()
        assert clerk.begun == ["anna", "bert"], "one slot is not for who has the other"
        for begun in (["cora"], ["anna"], ["bert"], ["anna"], []):  # at last only anna waits
            before = len(clerk.begun)
            clerk.go.release()
            await settled()
            assert clerk.begun[before:] == begun
        for _ in wanted:
            clerk.go.release()
        await asyncio.gather(*tasks)
        assert sorted(clerk.begun) == wanted and not turns.waiting

    asyncio.run(calls())


def test_who_has_many_calls_waiting_may_not_have_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turning, "WAITING", 3)

    async def calls() -> None:
        turns, clerk = Turns(1, 60.0), Clerk()
        tasks = [asyncio.create_task(clerk.serve(turns, "anna")) for _ in range(5)]
        tasks.append(asyncio.create_task(clerk.serve(turns, "bert")))
        await settled()
        for _ in tasks:
            clerk.go.release()
        ends = await asyncio.gather(*tasks, return_exceptions=True)
        assert [type(each) for each in ends] == [type(None)] * 3 + [TooMany] * 2 + [type(None)]

    asyncio.run(calls())


def test_a_caller_has_its_budget_again_within_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(turning.time, "monotonic", lambda: now)
    turns = Turns(1, 10.0)
    for seconds, left in ((4.0, 10.0), (4.0, 6.0)):
        assert turns.remaining("anna") == pytest.approx(left)
        turns.charge("anna", seconds)
    assert turns.remaining("anna") == pytest.approx(2.0)
    turns.charge("anna", 11.0)
    with pytest.raises(
        TooMany, match="10 s of processor time in a minute are used: ask later"
    ) as told:
        turns.remaining("anna")
    assert told.value.later == {"retry-after": "60"}, "until 1 s of 10 is left again"
    assert turns.remaining("bert") == 10.0
    now += 60.0 + 24.0
    assert turns.remaining("anna") == pytest.approx(5.0)


def spent(seconds: float) -> int:
    """Take processor time."""
    until, count = time.process_time() + seconds, 0
    while time.process_time() < until:
        count += 1
    return count


def test_a_call_is_charged_the_time_that_it_takes_wherever_it_runs() -> None:
    async def calls() -> None:
        for way in ("here", "apart"):
            turns = Turns(1, 60.0)
            limits = {} if way == "here" else {"field": "study", "name": "a"}
            await getattr(Share(turns, "anna"), way)(spent, 0.3, **limits)
            assert 50.0 < turns.remaining("anna") < 59.8
            assert turns.remaining("bert") == 60.0

    asyncio.run(calls())


def told_by(path: Path) -> int:
    """Return what another process writes into a file."""
    while not path.exists() or not path.read_text():
        time.sleep(0.01)
    return int(path.read_text())


def test_a_call_does_not_wait_for_the_end_of_another(tmp_path: Path) -> None:
    async def calls() -> None:
        limits = {"field": "file", "name": "a", "seconds": 30.0}
        path, turns = tmp_path / "word", Turns(2, 60.0)
        first = asyncio.create_task(Share(turns, "anna").apart(told_by, path, **limits))
        while not turns.slots.borrowed_tokens:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)  # it has begun
        await Share(turns, "bert").apart(path.write_text, "7", **limits)
        assert await first == 7

    asyncio.run(calls())


def urgency() -> tuple[int, int]:
    """Return the niceness of this process, and its session."""
    return os.nice(0), os.getsid(0)


def test_who_has_used_much_time_waits_for_who_has_not() -> None:
    """Of processes of several sessions, Linux would not ask how nice they are."""

    async def calls() -> None:
        own = os.nice(0)
        for used, more in ((0.5, 0), (3.5, 3), (20.0, 5)):
            turns = Turns(1, 60.0)
            turns.charge("anna", used)
            for caller, nice in (("anna", own + more), ("bert", own)):
                told = await Share(turns, caller).apart(urgency, field="file", name="a")
                assert told == (min(nice, 19), os.getsid(0))

    asyncio.run(calls())


def test_simultaneous_posts_of_a_caller_share_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[float] = []
    inspector, turns = Inspector(10.0), Turns(2, 10.0)

    async def shut_in(self: Turn, *_: object, cpu: float, **limits: Any) -> Answer:
        given.append(cpu)
        await asyncio.sleep(0.0)
        self.spent = min(cpu, 4.0)
        return Answer("", errno.ETIME if cpu < 4.0 else errno.EFAULT, "")

    async def post(caller: str) -> str:
        try:
            await inspector.inspect(b"", {}, Share(turns, caller))
        except (StudyError, Busy) as error:
            return str(error)
        return ""

    async def posts() -> list[str]:
        return await asyncio.gather(*map(post, ("anna",) * 5 + ("bert",)))

    monkeypatch.setattr(Turn, "shut_in", shut_in)
    *anna, bert = asyncio.run(posts())
    assert sorted(map(round, given)) == [2, 6, 10, 10], "4 s of 10 each, the rest, another one"
    assert ["library" in each for each in (*anna, bert)] == [True, True, False, False, False, True]
    assert all("10 s of processor time in a minute are used" in each for each in anna[2:])


@pytest.mark.parametrize(
    ("lines", "files", "limit"),
    [
        (
            "0::/a/b\n",
            {"memory.max": "max", "a/memory.max": "1000", "a/b/memory.max": "2000"},
            1000,
        ),
        ("0::/of/the/host\n", {"memory.max": "4096"}, 4096),
        ("9:cpu:/\n4:memory:/a\n0::/\n", {"memory/a/memory.limit_in_bytes": "77"}, 77),
        ("0::/\n", {"memory.max": "max"}, None),
        ("", {}, None),
    ],
    ids=["2", "container", "1", "no limit", "none"],
)
def test_the_memory_is_that_of_the_control_group(
    tmp_path: Path, lines: str, files: dict[str, str], limit: int | None
) -> None:
    (tmp_path / "cgroup").write_text(lines)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    everything = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert memory(tmp_path / "cgroup", tmp_path) == (limit or everything)
    assert 2**30 <= BYTES <= max(min(memory() / 3, 8 * 2**30), 2**30)


def trying(elsewhere: str, own: str) -> str:
    """Return what a process that reads may do."""
    may = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.connect(("192.0.2.1", 9))
            may.append("network")
        except OSError:
            pass
    for name in (f"{elsewhere}/new", f"{elsewhere}/old", f"{own}/new"):
        try:
            with Path(name).open("a") as file:
                file.write("x")
            may.append(name)
        except OSError:
            pass
    try:
        Path(f"{elsewhere}/old").unlink()
    except OSError:
        may.append("keep")
    return " ".join([*may, tempfile.gettempdir()])


def alone(function: Callable[..., str], *given: object, folder: Path, seconds: float) -> Answer:
    """Return what a function gives that is shut in."""
    call = call_shut_in(function, *given, folder=folder, cpu=seconds, seconds=60.0, nice=0)
    return asyncio.run(call)


def test_a_process_that_reads_has_no_network_and_writes_in_its_own_folder(tmp_path: Path) -> None:
    elsewhere, own = tmp_path / "elsewhere", tmp_path / "own"
    for each in (elsewhere, own):
        each.mkdir()
    (elsewhere / "old").write_text("")
    answer = alone(trying, str(elsewhere), str(own), folder=own, seconds=5.0)
    assert answer.failed == 0
    if answer.open:
        pytest.skip(f"this system does not take from a process: {answer.open}")
    assert answer.text.split() == [f"{own}/new", "keep", str(own)]
    assert (own / "new").read_text() == "x"


def spinning() -> str:
    while True:
        pass


def crashing() -> str:
    os.kill(os.getpid(), signal.SIGSEGV)
    return ""


def failing() -> str:
    raise ValueError("a fault of this project")


def speaking() -> str:
    """Speak to whoever reads the standard output of the process that was copied."""
    os.write(1, b"a pickle")
    return " ".join(str(Path(f"/proc/self/fd/{each}").readlink()) for each in (0, 1))


def no_room() -> str:
    raise OSError(errno.ENOSPC, "no room")


def unpacked(path: str) -> str:
    """Read a mesh that is a thousand times as large as its file."""
    now = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (now + 2**27, now + 2**27))
    MeshFile("mesh.vtu", Path(path).read_bytes()).mesh(None)
    return "read"


def bomb(size: int) -> bytes:
    """Return a mesh of ParaView with packed points, which are all zero."""
    data = zlib.compress(bytes(size), 9)
    head = base64.b64encode(struct.pack("4I", 1, size, 0, len(data)))
    return b"""<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="UInt32"
 compressor="vtkZLibDataCompressor"><UnstructuredGrid>
<Piece NumberOfPoints="%d" NumberOfCells="0"><Points><DataArray type="Float64" format="binary"
 NumberOfComponents="3">%s%s</DataArray></Points><Cells></Cells></Piece></UnstructuredGrid></VTKFile>
""" % (size // 24, head, base64.b64encode(data))


def test_time_memory_and_room_of_a_process_that_reads_are_limited(tmp_path: Path) -> None:
    (tmp_path / "bomb.vtu").write_bytes(bomb(24 * 2**24))
    assert (tmp_path / "bomb.vtu").stat().st_size < 1_000_000
    cases: list[tuple[Callable[..., str], tuple[str, ...], int]] = [
        (spinning, (), errno.ETIME),
        (unpacked, (str(tmp_path / "bomb.vtu"),), errno.ENOMEM),
        (no_room, (), errno.ENOSPC),
        (crashing, (), CRASHED),
        (failing, (), FAILED),
    ]
    for function, given, failed in cases:
        answer = alone(function, *given, folder=tmp_path, seconds=1.0)
        assert (answer.failed, answer.text) == (failed, "")


def test_a_process_that_reads_has_no_way_to_the_service(tmp_path: Path) -> None:
    answer = alone(speaking, folder=tmp_path, seconds=5.0)
    assert answer.text == f"{os.devnull} {os.devnull}"


def test_a_process_that_gives_no_answer_is_charged_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sandbox, "_processor_time", lambda pid: 0.9)

    async def call() -> None:
        turns = Turns(1, 10.0)
        with pytest.raises(StudyError, match=r"must be read within 1 s$"):
            await Share(turns, "anna").apart(time.sleep, 60, field="scene", name="a", seconds=1.0)
        assert turns.remaining("anna") <= 9.0

    asyncio.run(call())


def test_a_scene_that_takes_too_long_is_told_and_charged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of keys that are as deep as is allowed take time to read."""
    monkeypatch.setattr(examiner, "SLOW", 100.0)
    key = ".".join("a" * 45)
    text = "\n".join(f"[{key}.b{k}]" for k in range(8000)).encode()

    async def post(reader: Inspector) -> None:
        share = Share(Turns(1, 20.0), "anna")
        with pytest.raises(StudyError, match=r"must be read within 1 s$"):
            await reader.inspect(text, {}, share)
        assert share.turns.remaining("anna") < 19.1

    asyncio.run(post(Inspector(1.0)))


QUERIES = {
    "/studies/{study_id}/numbers": "?name=friction",
    "/studies/{study_id}/predict": "?of=a",
    "/studies/{study_id}/sensitivity": "?of=a",
    "/studies/{study_id}/plot.png": "?field=a",
    "/runs/{run_id}/values": "?field=a",
    "/runs/{run_id}/values.csv": "?field=a",
    "/runs/{run_id}/map.png": "?field=a",
    "/runs/{run_id}/line.png": "?field=a",
    "/ui/scene.png": "?scene=punch",
}
FREE = re.compile(
    r"/(health|docs.*|studies/{study_id}/(events|zarr/.*))|/ui/(static.*|sign-in|{.*)"
)
"""What needs no key, what is sent as it changes, and parts of a data set, which wait."""
READ = [
    (route.path + QUERIES.get(route.path, ""))
    for router in (*ROUTERS, new.router, pages.router)
    for route in router.routes
    if isinstance(route, APIRoute) and "GET" in route.methods and not FREE.fullmatch(route.path)
]


@pytest.mark.parametrize(
    ("method", "path", "request_"),
    [
        ("POST", "/scenes", {"files": [("scene", ("a.toml", b""))]}),
        ("POST", "/estimate", {"json": {"name": "a", "scene": "punch"}}),
        ("POST", "/studies", {"json": {"name": "a", "scene": "punch"}}),
        ("POST", "/ui/new", {"data": {"scene": "punch"}}),
        *(("GET", path, {}) for path in READ),
    ],
)
def test_whatever_is_read_or_computed_takes_the_budget_of_the_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str, path: str, request_: Any
) -> None:
    keys = Keys(tmp_path)
    texts = {name: keys.add(name, Scope.SUBMIT) for name in ("anna", "bert")}
    app = create_app(Settings(data=tmp_path, require_keys=True, reader_seconds=20.0))
    study = Study.from_dict({"name": "a", "scene": "punch"})
    app.state.jobs.accept(study.id, study.to_dict(), study.run_ids())

    async def called(*_: object, **__: object) -> None:
        raise StudyError("study", "a", "was read")

    for way in ("here", "apart", "shut_in"):
        monkeypatch.setattr(Turn, way, called)
    for turns in (app.state.reading, app.state.computing, app.state.combining):
        turns.charge("anna", 30.0)
    given = {"study_id": study.id, "run_id": "0" * 32, "run_id:stem": "0" * 32, "name": "punch"}
    for name, value in given.items():
        path = path.replace(f"{{{name}}}", value)
    answers = {
        name: asking(app)(
            method,
            path,
            headers={"authorization": f"Bearer {text}"},
            **request_,
        )
        for name, text in texts.items()
    }
    if not path.startswith("/ui"):  # whose errors are pages
        found = problem(answers["anna"], 429)
        assert found["detail"] == "20 s of processor time in a minute are used: ask later"
        assert problem(answers["bert"], 422)["detail"] == "study: was read"
    assert [each.status_code for each in answers.values()] == [429, 422]
    assert 28 <= int(answers["anna"].headers["retry-after"]) <= 33, "until 1 s of 20 is left again"


def test_reading_does_not_wait_for_computing(tmp_path: Path) -> None:
    """Of the same caller, and of all others, every turn to compute is taken."""
    app = create_app(Settings(data=tmp_path))
    study = Study.from_dict({"name": "a", "scene": "punch", "sweep": {"friction": [0.1, 0.2]}})
    app.state.jobs.accept(study.id, study.to_dict(), study.run_ids())
    transport = httpx.ASGITransport(app, client=("anna", 1))

    async def read() -> list[int]:
        clerk, waiting = Clerk(), list[asyncio.Task[Any]]()
        for caller in ("address anna", "bert", "cora"):
            waiting.append(asyncio.create_task(clerk.serve(app.state.computing, caller)))
        await settled()
        assert len(clerk.begun) == turning.COMPUTING
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as one:
            paths = ("/ui/studies/{}", "/studies/{}", "/studies/{}/table.csv", "/studies/{}/audit")
            answers = [await one.get(each.format(study.id)) for each in paths]
            waiting.append(asyncio.create_task(one.get("/scenes/punch/draw.png")))
            await settled()
            assert not waiting[-1].done()
            for each in waiting:
                each.cancel()
            await asyncio.gather(*waiting, return_exceptions=True)
        return [each.status_code for each in answers]

    assert asyncio.run(asyncio.wait_for(read(), 60.0)) == [200] * 4


def running(app: FastAPI, names: str) -> dict[str, str]:
    """Accept studies, and return their ids by name."""
    studies = [Study.from_dict({"name": name, "scene": "punch"}) for name in names]
    for each in studies:
        app.state.jobs.accept(each.id, each.to_dict(), each.run_ids())
    return {each.name: each.id for each in studies}


def test_combining_has_turns_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else that is computed waits for it; each waits for its own turn, not another's."""
    monkeypatch.setattr(datasets, "PATIENCE", 0.05)
    keys = Keys(tmp_path)
    texts = {name: keys.add(name, Scope.READ) for name in ("anna", "bert")}
    app = create_app(Settings(data=tmp_path, require_keys=True))
    ids, go = running(app, "abcd"), asyncio.Semaphore(0)
    names, made = {study: name for name, study in ids.items()}, list[str]()

    async def apart(self: Turn, function: object, *given: Any, **limits: Any) -> bytes:
        if function is datasets.COMBINED:
            await go.acquire()
            made.append(names[limits["name"]])
            given[-1].write_bytes(b"")
        return b"png"

    async def asked() -> tuple[list[int], list[list[str]]]:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as one:

            async def status(caller: str, path: str) -> int:
                head = {"authorization": f"Bearer {texts[caller]}"}
                return (await one.get(path, headers=head)).status_code

            combined = "/studies/{}/dataset.nc".format
            wanted = [("anna", each) for each in "abcd"] + [("bert", "d")]
            found = [await status(caller, combined(ids[each])) for caller, each in wanted]
            found.append(await status("anna", "/scenes/punch/draw.png"))
            order = []
            for _ in range(4):
                go.release()
                await settled()
                order.append([*made])
            found.append(await status("bert", combined(ids["d"])))
            return found, order

    monkeypatch.setattr(Turn, "apart", apart)
    found, order = asyncio.run(asyncio.wait_for(asked(), 30.0))
    assert found == [503] * 5 + [200, 200]
    assert order == [["a"], ["a", "d"], ["a", "d", "b"], ["a", "d", "b", "c"]]
    app.state.datasets.close()


def test_an_answer_that_has_begun_waits_for_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turning, "MINUTE", 0.2)

    async def calls() -> list[int]:
        share = Share(Turns(1, 10.0), "anna")
        share.turns.charge("anna", 20.0)
        with pytest.raises(TooMany):
            await share.here(spent, 0.0)
        return [each async for each in share.each(iter([1, 2, 3]))]

    assert asyncio.run(calls()) == [1, 2, 3]


def test_without_keys_nobody_has_a_budget(tmp_path: Path) -> None:
    for require_keys, seconds in ((False, None), (True, 30.0)):
        data = tmp_path / str(require_keys)
        Keys(data).add("anna", Scope.READ)
        app = create_app(Settings(data=data, require_keys=require_keys))
        for name in ("reading", "computing", "combining"):
            assert getattr(app.state, name).seconds == seconds


def test_a_full_folder_for_temporary_files_is_507(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryFile", full)  # of the form, from 1 MB on
    app = create_app(Settings(data=tmp_path))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, hard))  # of the process that reads, too
    try:
        for size in (100_000, 1_100_000):
            files = [("scene", ("scene.toml", b"")), ("meshes", ("a.msh", b"\n" * size))]
            found = problem(asking(app)("POST", "/scenes", files=files), 507)
            assert found["detail"] == "no room is left for temporary files"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
