"""Where a store keeps its files, as named blobs: in a folder, or at an address that fsspec reaches.

A `Bucket` has a folder on this machine too. What is asked for is brought there, because netCDF
needs files; what is written appears there when it is at the address. A blob in the folder has the
time of change of that at the address. If this has a tag (of S3 one of its content), the time is in
whole seconds, as one of two ways to ask has no others, and a digest of the tag is the fraction. By
size and time `follow` finds what others have changed.
"""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
import time
import uuid
import zlib
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from fnmatch import fnmatch
from glob import glob
from hashlib import sha256
from pathlib import Path
from typing import Any

from solver.files import NoFile, appearing, read_file
from studies.errors import StoreBusy, StudyError, Unusable
from studies.storage.claims import Claims, Leases, lock

ORIGIN = "origin.json"
"""File of a folder that has the blobs of an address: this address, and an id of the folder."""
_BLOBS = ("runs/*.nc", "studies/*/*", "scenes/*/*")
_FEW = 20
"""Number of blobs up to which each is asked for; for more of them all are listed."""
_TIMES = ("mtime", "LastModified", "last_modified", "updated", "created")
_TAGS = ("ETag", "etag", "md5Hash")
"""What kinds of file systems call the time of change of a blob, and a digest of its content."""
_PASSWORD = re.compile(r"://[^/@]*(:(?!\d+/)[^@]*)@")
"""A password in an address, with its colon; a number before a slash is a port."""
_LOG = logging.getLogger("studies")

Stamp = tuple[int, int]
"""Length of a blob [bytes], and its time of change [ns]."""


class Folder:
    """Blobs with names such as ``runs/<id>.nc``, which are the files of a directory.

    Each is whole, or is not there.

    Attributes
    ----------
    directory : folder on this machine in which blobs are read, and indexes of them are kept
    address : what the user has called the store: a path, or an address
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.address: Path | str = directory

    def names(self, pattern: str) -> list[str]:
        """Return the names that match a pattern, in which ``*`` stands for no slash."""
        return glob(pattern, root_dir=self.directory)  # noqa: PTH207 - relative, and much faster

    def stamps(self, names: Iterable[str]) -> dict[str, Stamp]:
        """Return, by name, the stamps of those blobs that exist, in the order of the names."""
        found = {}
        for name in names:
            with suppress(FileNotFoundError):
                state = (self.directory / name).stat()
                found[name] = state.st_size, state.st_mtime_ns
        return found

    def path(self, name: str) -> Path:
        """Return the path at which a blob can be read; if there is none, there is no file."""
        return self.directory / name

    @contextmanager
    def appearing(self, name: str) -> Iterator[Path]:
        """Give a path to write to; at the end it is the blob of this name, or replaces it."""
        path = self.directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with appearing(path) as part:
            yield part

    def remove(self, name: str) -> None:
        """Delete a blob, or all under a name, if it is there."""
        path = self.directory / name
        with suppress(FileNotFoundError):
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    def move(self, name: str, target: str) -> None:
        """Give a damaged blob, or all under a name, another name."""
        (self.directory / name).rename(self.directory / target)

    @contextmanager
    def lock(self, busy: str, shared: bool) -> Iterator[None]:
        """Lock the store; raise `StoreBusy`, with what another process does, if it has the lock."""
        held = lock(self.directory / ".lock", busy, shared=shared)
        try:
            yield
        finally:
            os.close(held)

    def claims(self) -> Claims:
        """Return the claims of processes that share the store."""
        return Claims(self.directory / "claims")

    def follow(self) -> None:
        """See from now on what others have changed; files of a directory are those of all."""


class Bucket(Folder):
    """Blobs at an address, such as ``s3://bucket/results``; those in use are in a folder too.

    Raises `Unusable` if the address cannot be reached. The lock of a writer is a lease that its
    owner renews; one of this folder, which only one process locks, is free when that process has
    ended. Those who share the store have none: they respect it when they begin.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        origin = json.loads(read_file(directory / ORIGIN))
        address, self._own = str(origin["address"]), origin["id"]
        try:
            import fsspec  # a store in a folder does not need it

            folders = {"auto_mkdir": True} if address.startswith("file:") else {}
            found = fsspec.url_to_fs(address, use_listings_cache=False, **folders)
        except (ImportError, ValueError) as error:
            raise Unusable("directory", address, f"cannot be used: {error}") from None
        except Exception as error:  # of whichever library, such as one without credentials
            raise _unreachable(address, error) from None
        self.address, (self._fs, self._root) = address, found

    def names(self, pattern: str) -> list[str]:
        """See `Folder`."""
        found = self._listed(pattern.partition("*")[0].rpartition("/")[0])
        depth = pattern.count("/")
        return [each for each in found if fnmatch(each, pattern) and each.count("/") == depth]

    def stamps(self, names: Iterable[str]) -> dict[str, Stamp]:
        """See `Folder`."""
        wanted = list(dict.fromkeys(names))
        if len(wanted) > _FEW:
            found = self._listed(os.path.commonpath(wanted))
            return {name: found[name] for name in wanted if name in found}
        few = {name: self._stamp(name) for name in wanted}
        return {name: stamp for name, stamp in few.items() if stamp}

    def path(self, name: str) -> Path:
        """See `Folder`: the blob is brought, unless it is there."""
        path = super().path(name)
        if not path.exists() and (stamp := self._stamp(name)):
            with suppress(FileNotFoundError), super().appearing(name) as part:
                self._ask("get_file", self._at(name), str(part))
                os.utime(part, ns=(stamp[1], stamp[1]))
        return path

    @contextmanager
    def appearing(self, name: str) -> Iterator[Path]:
        """See `Folder`."""
        with super().appearing(name) as part:
            yield part
            self._ask("put_file", str(part), self._at(name))
            if stamp := self._stamp(name):
                os.utime(part, ns=(stamp[1], stamp[1]))

    def remove(self, name: str) -> None:
        """See `Folder`."""
        with suppress(FileNotFoundError):
            self._ask("rm", self._at(name), recursive=True)
        super().remove(name)

    def move(self, name: str, target: str) -> None:
        """See `Folder`: if a file here is not its blob, the blobs stay, and are brought again."""
        here = super().path(name)
        files = filter(Path.is_file, here.rglob("*")) if here.is_dir() else [here]
        with suppress(FileNotFoundError, NoFile):
            if all(map(self._same, files)):
                self._ask("mv", self._at(name), self._at(target), recursive=True)
        super().move(name, target)

    def _same(self, file: Path) -> bool:
        """Whether a file here has the content of its blob."""
        name = file.relative_to(self.directory).as_posix()
        return bool(self._ask("cat_file", self._at(name)) == read_file(file, 1 << 40))

    @contextmanager
    def lock(self, busy: str, shared: bool) -> Iterator[None]:
        """See `Folder`."""
        leases = Leases(self._ask, self._at("lock"), self._own)
        with super().lock(busy, shared), ExitStack() as held:
            taken = (
                leases.taken("writer") if shared else not held.enter_context(leases.held("writer"))
            )
            if taken:
                raise StoreBusy(f"{self.address}: a process on another machine {busy}")
            yield

    def claims(self) -> Claims:
        """See `Folder`."""
        return Leases(self._ask, self._at("claims"))

    def follow(self) -> None:
        """See `Folder`: files are deleted here that differ from their blobs, or have none."""
        began, there = time.time(), self._listed("")
        for pattern in _BLOBS:
            for name in super().names(pattern):
                with suppress(FileNotFoundError):
                    path = self.directory / name
                    state = path.stat()
                    same = there.get(name) == (state.st_size, state.st_mtime_ns)
                    if not (same or name.endswith(".part") or state.st_ctime > began):
                        path.unlink()

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}".rstrip("/")

    def _listed(self, folder: str) -> dict[str, Stamp]:
        """Return the stamps of all blobs in a folder, and below it."""
        found = self._ask("find", self._at(folder), detail=True)
        return {path.removeprefix(f"{self._root}/"): _stamp(info) for path, info in found.items()}

    def _stamp(self, name: str) -> Stamp | None:
        with suppress(FileNotFoundError):
            info = self._ask("info", self._at(name))
            return _stamp(info) if info["type"] == "file" else None
        return None

    def _ask(self, method: str, *arguments: Any, **options: Any) -> Any:
        """Call a method of the file system; raise `Unusable` for other errors than of names."""
        try:
            return getattr(self._fs, method)(*arguments, **options)
        except (FileNotFoundError, FileExistsError):
            raise
        except Exception as error:  # of whichever library
            raise _unreachable(str(self.address), error) from None


def blobs_at(place: Path | str) -> Folder:
    """Return the blobs in a folder, or at an address."""
    directory = directory_of(place)
    return Bucket(directory) if (directory / ORIGIN).is_file() else Folder(directory)


def directory_of(place: Path | str) -> Path:
    """Return the path of a folder; of an address that of the folder to which blobs are brought.

    The latter is in ``RESIDUA_CACHE``, by default ``~/.cache/residua``.
    """
    if not is_address(place):
        if re.match(r"\w\w+:/(?!/)", str(place)):
            raise StudyError(
                "directory", str(place), "is an address: give it as a text, not a Path"
            )
        return Path(place)
    address = str(place).rstrip("/")
    if found := _PASSWORD.search(address):
        shown = address.replace(found[1], "***", 1)
        allowed = "must have no password, which logs and scripts would show: give it to fsspec"
        raise StudyError("directory", shown, f"{allowed}, in the files of ~/.config/fsspec")
    cache = os.environ.get("RESIDUA_CACHE") or Path.home() / ".cache" / "residua"
    own = re.sub(r"\W+", "-", address)[-40:] + sha256(address.encode()).hexdigest()[:8]
    directory = Path(cache) / own.strip("-")
    if not (directory / ORIGIN).exists():
        directory.mkdir(parents=True, exist_ok=True)
        identity = uuid.uuid4().hex
        part = directory / f"{identity}.own"
        part.write_text(json.dumps({"address": address, "id": identity}))
        with suppress(FileExistsError):  # another process was first: its id is that of the folder
            os.link(part, directory / ORIGIN)
        part.unlink()
    return directory


def is_address(place: Path | str) -> bool:
    """Whether a text is an address, such as ``s3://bucket/results``, of no service."""
    return isinstance(place, str) and bool(re.match(r"(?!https?:)[\w+.-]+://", place))


def _unreachable(address: str, error: Exception) -> Unusable:
    """Return the error for users; what the library says is for the log, not for callers of HTTP."""
    _LOG.warning("%s cannot be reached: %s: %s", address, type(error).__name__, error)
    allowed = "must be an address that can be reached; the log has the reason"
    return Unusable("directory", address, allowed)


def _stamp(info: dict[str, Any]) -> Stamp:
    at: Any = next((info[name] for name in _TIMES if info.get(name)), 0.0)
    tag = next((str(info[name]) for name in _TAGS if info.get(name)), "")
    seconds = at.timestamp() if hasattr(at, "timestamp") else float(at)
    time_ns = (
        int(seconds) * 10**9 + zlib.crc32(tag.encode()) % 10**9
        if tag
        else int(seconds * 1e6) * 1000
    )
    return int(info["size"] or 0), time_ns
