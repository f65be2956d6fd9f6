"""A process with limits of time and memory: what it cannot read is refused, and it is replaced."""

from __future__ import annotations

import asyncio
import base64
import errno
import os
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

import pytest

from service import guarded
from service.alone import CRASHED, FAILED, Answer, alone
from service.app import create_app
from service.errors import Busy
from service.guarded import BYTES, Budget, Guarded, memory
from service.inspector import Inspector
from service.keys import Keys, Scope
from service.settings import Settings
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
    (bytes, 2 * BYTES, 60.0, StudyError, r"scene = 'a': must be read within 60 s"),
    (time.sleep, 60, 0.5, StudyError, r"'a': must be read within 0\.5 s and [\d.]+ GiB.*: less"),
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
        for function, given, seconds, error, words in FAILING:
            with pytest.raises(error, match=words):
                await Guarded("scene", 1, seconds).call(function, given, name="a", advice=": less")
            study = await Guarded("scene", 1, 60.0).call(Study.from_dict, INCH, name="a")
            assert study.name == "a"

    asyncio.run(calls())


def test_a_queue_that_is_full_takes_no_more() -> None:
    process = Guarded("study", 1, 60.0)

    async def one(number: int) -> int:
        async with process.turn():
            return await process.call(abs, -number, name="a")

    async def calls() -> list[object]:
        return await asyncio.gather(*map(one, range(5)), return_exceptions=True)

    found = asyncio.run(calls())
    assert found[:3] == [0, 1, 2], "two are read, one waits"
    assert {type(each) for each in found[3:]} == {Busy}


def test_a_caller_has_its_budget_again_within_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(guarded.time, "monotonic", lambda: now)
    budget = Budget(10.0)
    for seconds, left in ((4.0, 10.0), (4.0, 6.0)):
        assert budget.left("anna") == pytest.approx(left)
        budget.charge("anna", seconds)
    assert budget.left("anna") == pytest.approx(2.0)
    budget.charge("anna", 11.0)
    with pytest.raises(
        Busy, match="10 s of processor time in a minute are used: ask later"
    ) as told:
        budget.left("anna")
    assert told.value.later == {"retry-after": "60"}, "until 1 s of 10 is left again"
    assert budget.left("bert") == 10.0
    now += 60.0 + 24.0
    assert budget.left("anna") == pytest.approx(5.0)


def test_simultaneous_posts_of_a_caller_share_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[float] = []
    inspector = Inspector(10.0)

    async def spent(_: object, files: object, seconds: float, name: str) -> Answer:
        given.append(seconds)
        await asyncio.sleep(0.0)
        return Answer("", errno.ETIME if seconds < 4.0 else errno.EFAULT, min(seconds, 4.0), "")

    async def post(caller: str) -> str:
        try:
            await inspector.inspect(b"", {}, caller)
        except (StudyError, Busy) as error:
            return str(error)
        return ""

    async def posts() -> list[str]:
        return await asyncio.gather(*map(post, ("anna",) * 5 + ("bert",)))

    monkeypatch.setattr(inspector.process, "call", spent)
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


def test_a_process_that_reads_has_no_network_and_writes_in_its_own_folder(tmp_path: Path) -> None:
    elsewhere, own = tmp_path / "elsewhere", tmp_path / "own"
    for each in (elsewhere, own):
        each.mkdir()
    (elsewhere / "old").write_text("")
    answer = alone(trying, str(elsewhere), str(own), folder=own, seconds=5.0)
    assert (answer.failed, answer.seconds < 5.0) == (0, True)
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
        assert answer.seconds < 2.5


def test_a_process_that_reads_has_no_way_to_the_service(tmp_path: Path) -> None:
    """Its parent answers the service on its standard output."""
    out, into = os.pipe()
    before = os.dup(1)
    os.dup2(into, 1)
    try:
        answer = alone(speaking, folder=tmp_path, seconds=5.0)
    finally:
        os.dup2(before, 1)
    for each in (into, before):
        os.close(each)
    assert os.read(out, 10) == b""
    os.close(out)
    assert answer.text == f"{os.devnull} {os.devnull}"


def test_a_reader_that_gives_no_answer_is_charged(monkeypatch: pytest.MonkeyPatch) -> None:
    async def lost(*_: object, **__: object) -> None:
        raise Busy("the process that reads a scene has ended: ask again")

    async def post(inspector: Inspector) -> None:
        monkeypatch.setattr(inspector.process, "call", lost)
        for words in ("has ended", "has ended|are used", "are used"):
            with pytest.raises(Busy, match=words):
                await inspector.inspect(b"", {}, "anna")

    asyncio.run(post(Inspector(1.0)))


def test_a_scene_that_takes_too_long_is_told_and_charged(tmp_path: Path) -> None:
    """Tables of keys that are as deep as is allowed take time to read."""
    key = ".".join("a" * 45)
    text = "\n".join(f"[{key}.b{k}]" for k in range(8000)).encode()

    async def post(inspector: Inspector) -> None:
        with pytest.raises(StudyError, match=r"within 10? s and [\d.]+ GiB of memory"):
            await inspector.inspect(text, {}, "anna")
        with pytest.raises(Busy, match="1 s of processor time in a minute are used"):
            for _ in range(3):
                inspector.budget.charge("anna", 0.3)
                await inspector.inspect(b"", {}, "anna")

    asyncio.run(post(Inspector(1.0)))


def test_a_picture_for_the_form_of_a_study_is_charged(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is asked for by GET, also by those who may not submit."""
    inspector = Inspector(10.0)

    async def drawn(*_: object, **__: object) -> tuple[str, float]:
        return "<svg/>", 5.0

    async def ask(caller: str) -> str:
        return await inspector.picture(Path(), {"name": "a"}, caller)

    async def several() -> None:
        assert [await ask("anna") for _ in range(2)] == ["<svg/>"] * 2
        with pytest.raises(Busy, match="processor time in a minute are used"):
            await ask("anna")
        assert await ask("bert") == "<svg/>"

    monkeypatch.setattr(inspector.process, "call", drawn)
    asyncio.run(several())


def test_each_key_has_a_budget_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def read(*_: object, **__: object) -> None:
        raise StudyError("scene", "a.toml", "was read")

    keys = Keys(tmp_path)
    texts = {name: keys.add(name, Scope.SUBMIT) for name in ("anna", "bert")}
    app = create_app(Settings(data=tmp_path, require_keys=True, reader_seconds=20.0))
    monkeypatch.setattr(app.state.inspector.process, "call", read)
    app.state.inspector.budget.charge("anna", 30.0)
    answers = {
        name: asking(app)(
            "POST",
            "/scenes",
            files=[("scene", ("a.toml", b""))],
            headers={"authorization": f"Bearer {text}"},
        )
        for name, text in texts.items()
    }
    found = problem(answers["anna"], 503)
    assert found["detail"] == "20 s of processor time in a minute are used: ask later"
    assert 28 <= int(answers["anna"].headers["retry-after"]) <= 33, "until 1 s of 20 is left again"
    assert problem(answers["bert"], 422)["detail"] == "scene: was read"


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
    left = app.state.inspector.budget.left("address 127.0.0.1")
    assert left == pytest.approx(10.0), "it is not charged for that"
