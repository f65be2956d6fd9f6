"""Claims and the lock of processes that compute in one directory, on any machines, without talking.

A claim is a file ``claims/<name>.<number>``. It appears at once, with its content, by a hard link,
which fails if there is one; so one process has it. Its owner holds a lock on it, and changes its
time now and then. A claim is dead if its lock is free, for processes of the same machine; for those
of another one, whose locks may not be seen, if its time is too far from now. The next number is
then claimed: that of a dead claim is never used again, so that two processes that find it dead
cannot both take it over. A claim that stays because all was done ends with a line that says so: its
owner did not die of it.

In an object store a claim is a lease: a blob that is made only if there is none. Its owner writes
the time of its clock into it now and then, and it is dead if that is too far from the reader's.
"""

from __future__ import annotations

import fcntl
import json
import os
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from itertools import count
from pathlib import Path
from typing import Any

from solver.files import NoFile, descriptor_of, opened, read_file
from studies.errors import StoreBusy, Unusable

BEAT = 20.0
"""Seconds after which an owner changes the time of its claim."""
STALE = 300.0
"""Age of a claim of another machine at which it is dead [s]."""
_DONE = b"\ndone\n"
_HALF = 1.0
"""Seconds after which a lease that is half written is read again."""
_LONGEST = 1000
"""Largest size of a claim [bytes]."""


@dataclass(slots=True)
class Claim:
    """A claim that this process has.

    Attributes
    ----------
    deaths : number of owners that have died with it
    done : whether nothing is left to do: then the file stays, for machines that do not see yet what
        was done, as those that keep for a while what they know of a directory
    """

    deaths: int
    done: bool = False


class Claims:
    """The claims in a directory: marks ``<name>.<number>`` of which one process can make each."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        directory.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def held(self, name: str) -> Iterator[Claim | None]:
        """Claim a name, until the end of the context; None if another owner may be alive."""
        with self._own() as own:
            number = self._last(name)
            while not self._made(own, f"{name}.{number}"):
                if not self._dead(own, f"{name}.{number}"):
                    yield None
                    return
                number += 1
            every = [f"{name}.{each}" for each in range(number + 1)]
            claim = Claim(sum(not self._done(each) for each in every[:-1]))
            try:
                with _beating(partial(self._renew, own, every[-1])):
                    yield claim
            finally:
                if claim.done:
                    with suppress(OSError, Unusable):  # then it counts as a death
                        self._end(own, every[-1])
                else:
                    for each in every:
                        with suppress(FileNotFoundError, IsADirectoryError, Unusable):
                            self._remove(each)

    def _last(self, name: str) -> int:
        """Return the number of the last claim of a name; 0 also if there is none."""
        return next(each for each in count() if not self._there(f"{name}.{each + 1}"))

    @contextmanager
    def _own(self) -> Iterator[Any]:
        """Make the file that will be the claim, and lock it; give it with its descriptor."""
        path = self._directory / f"{uuid.uuid4().hex}.own"
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            text = json.dumps({"machine": _machine(), "process": os.getpid()})
            os.write(descriptor, text.encode())
            yield path, descriptor
        finally:
            path.unlink(missing_ok=True)
            os.close(descriptor)

    def _there(self, claim: str) -> bool:
        return (self._directory / claim).exists()

    def _made(self, own: Any, claim: str) -> bool:
        """Make a claim, with its content and at once; return False if there is one."""
        try:
            os.link(own[0], self._directory / claim)
        except FileExistsError:
            return False
        return True

    def _dead(self, own: Any, claim: str) -> bool:
        """Whether the owner of a claim has died; a claim that is gone is none that died."""
        try:
            with opened(self._directory / claim) as file:
                if json.loads(file.readline(_LONGEST))["machine"] == _machine():
                    return _free(file.fileno())
                os.utime(own[0])  # the time of the file system alone is that of all machines
                age = os.fstat(own[1]).st_mtime - os.fstat(file.fileno()).st_mtime
                return abs(age) > STALE  # an owner sets no time in the future
        except FileNotFoundError:
            return False
        except (NoFile, ValueError, LookupError, TypeError):  # no claim of ours
            return True

    def _done(self, claim: str) -> bool:
        """Whether the owner of a claim has ended with nothing left to do."""
        try:
            return read_file(self._directory / claim, _LONGEST).endswith(_DONE)
        except NoFile:
            return False
        except FileNotFoundError:
            return True

    def _renew(self, own: Any, claim: str) -> None:
        os.utime(own[0])

    def _end(self, own: Any, claim: str) -> None:
        os.write(own[1], _DONE)

    def _remove(self, claim: str) -> None:
        (self._directory / claim).unlink()


class Leases(Claims):
    """The claims in a folder of an object store.

    Parameters
    ----------
    ask : calls a method of a file system of fsspec for a name
    folder : the folder
    owner : whose claims these are; those of the same owner on this machine are dead. Empty if
        others may have it
    """

    def __init__(self, ask: Callable[..., Any], folder: str, owner: str = "") -> None:
        self._ask, self._folder = ask, folder
        self._owner = f"{owner} {_machine()}" if owner else ""

    def taken(self, name: str) -> bool:
        """Whether another owner that may be alive has claimed a name."""
        last = f"{name}.{self._last(name)}"
        return self._there(last) and not self._dead(None, last)

    @contextmanager
    def _own(self) -> Iterator[Any]:
        yield

    def _there(self, claim: str) -> bool:
        return bool(self._ask("exists", f"{self._folder}/{claim}"))

    def _made(self, own: Any, claim: str) -> bool:
        try:
            self._write(claim, mode="create")
        except FileExistsError:
            return False
        except Unusable:  # as some stores answer if two make it at the same time
            if self._there(claim):
                return False
            raise
        return True

    def _dead(self, own: Any, claim: str) -> bool:
        known = self._read(claim)
        mine = bool(self._owner) and known["owner"] == self._owner
        return mine or abs(time.time() - known["at"]) > STALE

    def _done(self, claim: str) -> bool:
        return bool(self._read(claim)["done"])

    def _renew(self, own: Any, claim: str) -> None:
        self._write(claim)

    def _end(self, own: Any, claim: str) -> None:
        self._write(claim, done=True)

    def _remove(self, claim: str) -> None:
        self._ask("rm_file", f"{self._folder}/{claim}")

    def _write(self, claim: str, mode: str = "overwrite", done: bool = False) -> None:
        text = json.dumps({"owner": self._owner, "at": time.time(), "done": done})
        self._ask("pipe_file", f"{self._folder}/{claim}", text.encode(), mode=mode)

    def _read(self, claim: str) -> dict[str, Any]:
        """Return the content of a claim; one that is gone has ended, and is none that died.

        One that stays half written is that of an owner that has died.
        """
        for pause in (_HALF, 0.0):
            try:
                text = self._ask("cat_file", f"{self._folder}/{claim}")
            except FileNotFoundError:
                return {"owner": None, "at": time.time(), "done": True}
            try:
                known = json.loads(text)
                return {"owner": known["owner"], "at": float(known["at"]), "done": known["done"]}
            except (ValueError, LookupError, TypeError):
                time.sleep(pause)
        return {"owner": None, "at": 0.0, "done": False}


def _free(descriptor: int) -> bool:
    """Whether nobody holds a lock on a file."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def _beating(renew: Callable[[], None]) -> Iterator[None]:
    """Renew a claim now and then."""
    ending = threading.Event()

    def beat() -> None:
        while not ending.wait(BEAT):
            with suppress(OSError, Unusable):  # such as a server that is away for a moment
                renew()

    thread = threading.Thread(target=beat, name="claim", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ending.set()
        thread.join()


@cache
def _machine() -> str:
    """Return what tells this machine from others: its name alone may be that of all."""
    with suppress(OSError):
        return read_file("/proc/sys/kernel/random/boot_id").decode("ascii").strip()
    return f"{os.uname().nodename}-{os.getpid()}"  # its locks are not trusted


def lock(path: Path, busy: str, patience: float = 0.0, shared: bool = False) -> int:
    """Return the descriptor of a lock, valid until its last copy is closed.

    Parameters
    ----------
    path : the lock file, which contains the id of the process
    busy : what another one does in the directory, and what helps, for the error
    patience : how long to wait for another owner of the lock [s]
    shared : whether others may have it at the same time, if they share it too

    Raises
    ------
    StoreBusy
        if the lock is not released; with the id of the process
    NoFile
        if it is no regular file
    """
    descriptor = descriptor_of(path, os.O_RDWR | os.O_CREAT)
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() < deadline:
                time.sleep(0.1)
                continue
            number = os.read(descriptor, 20).decode(errors="replace").strip()
            os.close(descriptor)
            who = f"another process (id {number})" if number.isdecimal() else "another process"
            raise StoreBusy(f"{path.parent}: {who} {busy}") from None
        with suppress(OSError):  # a full disk is reported when results are written
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
        return descriptor
