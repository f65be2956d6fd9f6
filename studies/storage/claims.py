"""Claims of processes that compute in one directory, on whichever machines, without talking.

A claim is a file ``claims/<name>.<number>``. It appears at once, with its content, by a hard link,
which fails if there is one; so one process has it. Its owner holds a lock on it, and changes its
time now and then. A claim is dead if its lock is free, for processes of the same machine; for those
of another one, whose locks may not be seen, if its time is too far from now. The next number is
then claimed: that of a dead claim is never used again, so that two processes that find it dead
cannot both take it over. A claim that stays because all was done ends with a line that says so: its
owner did not die of it.
"""

from __future__ import annotations

import fcntl
import json
import os
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from solver.files import NoFile, opened, read_file

BEAT = 20.0
"""Seconds after which an owner changes the time of its claim."""
STALE = 300.0
"""Age of a claim of another machine at which it is dead [s]."""
_DONE = b"\ndone\n"
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
    """The claims in a directory.

    Parameters
    ----------
    directory : the directory; made if it is missing
    stale : age of a claim of another machine at which it is dead [s]
    """

    def __init__(self, directory: Path, stale: float = STALE) -> None:
        self._directory, self._stale = directory, stale
        directory.mkdir(parents=True, exist_ok=True)

    @contextmanager
    def held(self, name: str) -> Iterator[Claim | None]:
        """Claim a name, until the end of the context; None if another owner may be alive."""
        number, (own, descriptor) = 0, self._own()
        try:
            while self._path(name, number + 1).exists():
                number += 1
            while not self._linked(own, self._path(name, number)):
                if not self._dead(self._path(name, number), descriptor):
                    yield None
                    return
                number += 1
            before = [self._path(name, each) for each in range(number)]
            claim = Claim(sum(not _done(each) for each in before))
            try:
                with _beating(own):
                    yield claim
            finally:
                if claim.done:
                    with suppress(OSError):  # then it counts as a death
                        os.write(descriptor, _DONE)
                else:
                    for path in [*before, self._path(name, number)]:
                        with suppress(FileNotFoundError, IsADirectoryError):
                            path.unlink()
        finally:
            own.unlink(missing_ok=True)
            os.close(descriptor)

    def _own(self) -> tuple[Path, int]:
        """Make the file that will be the claim, and lock it; return it with its descriptor."""
        path = self._directory / f"{uuid.uuid4().hex}.own"
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        text = json.dumps({"machine": _machine(), "process": os.getpid()})
        os.write(descriptor, text.encode())
        return path, descriptor

    def _path(self, name: str, number: int) -> Path:
        return self._directory / f"{name}.{number}"

    @staticmethod
    def _linked(own: Path, claim: Path) -> bool:
        try:
            os.link(own, claim)
        except FileExistsError:
            return False
        return True

    def _dead(self, claim: Path, own: int) -> bool:
        """Whether the owner of a claim has died; a claim that is gone is none that died."""
        try:
            with opened(claim) as file:
                if json.loads(file.readline(_LONGEST))["machine"] == _machine():
                    return _free(file.fileno())
                age = self._now(own) - os.fstat(file.fileno()).st_mtime
                return abs(age) > self._stale  # an owner sets no time in the future
        except FileNotFoundError:
            return False
        except (NoFile, ValueError, LookupError, TypeError):  # no claim of ours
            return True

    @staticmethod
    def _now(own: int) -> float:
        """Return the time of the file system, which alone is that of all machines."""
        os.utime(own)
        return os.fstat(own).st_mtime


def _done(claim: Path) -> bool:
    """Whether the owner of a claim has ended with nothing left to do."""
    try:
        return read_file(claim, _LONGEST).endswith(_DONE)
    except NoFile:
        return False
    except FileNotFoundError:
        return True


def _free(descriptor: int) -> bool:
    """Whether nobody holds a lock on a file."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def _beating(path: Path) -> Iterator[None]:
    """Change the time of a file now and then."""
    ending = threading.Event()

    def beat() -> None:
        while not ending.wait(BEAT):
            with suppress(OSError):  # such as a file server that is away for a moment
                os.utime(path)

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
