"""API keys: made by a command, kept as hashes in a file of the data directory.

A key is 256 random bits, so a plain SHA-256 is enough: trying all keys is impossible. Salts and
slow hashes are needed only for passwords that people choose.
"""

from __future__ import annotations

import fcntl
import hashlib
import hmac
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from anyio import CapacityLimiter, fail_after
from anyio.to_thread import run_sync
from pydantic import BaseModel, TypeAdapter

from solver.files import appearing
from studies.errors import FileDamaged, StudyError
from studies.storage.seal import State, content_of, sealed_json, state_of
from studies.storage.store import Store


class Scope(StrEnum):
    """The permission of a caller; each includes those before it."""

    READ = "read"
    SUBMIT = "submit"
    ADMIN = "admin"

    def covers(self, other: Scope) -> bool:
        """Whether this scope includes another one."""
        order = list(Scope)
        return order.index(self) >= order.index(other)


class KeysError(RuntimeError):
    """There are no keys, or their file cannot be read; no caller is accepted until there are."""


class Key(BaseModel):
    """One key as it is stored."""

    scope: Scope
    sha256: str
    created: datetime


FILE = TypeAdapter(dict[str, Key])
"""Content of the file: the keys by name, oldest first."""

LARGEST = 1_000_000
"""Largest size of the file [bytes]."""

SECONDS = 2.0
"""Longest time of reading the keys for a request [s]."""

_NAME = "keys service"


class Keys:
    """The keys of a data directory; a change of their file takes effect at the next request."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / "keys.json"
        self._read: tuple[State | None, dict[str, Key]] = None, {}
        self._one = CapacityLimiter(1)

    def all(self) -> dict[str, Key]:
        """Return the keys by name; raise `KeysError` if the file exists and is not readable."""
        try:
            return self._kept()
        except (FileDamaged, OSError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is damaged"
            raise KeysError(f"{self.path.name} cannot be read: {reason}") from None

    def _kept(self) -> dict[str, Key]:
        """Return the keys, read when the file has changed; raise `FileDamaged`."""
        state = state_of(self.path)
        if state != self._read[0]:
            try:
                content = content_of(self.path, _NAME, LARGEST) if state else {}
                self._read = state, FILE.validate_python(content)
            except ValueError as error:
                raise FileDamaged(self.path, _NAME, type(error).__name__, state) from None
        return dict(self._read[1])

    def owner(self, text: str) -> tuple[str, Scope] | None:
        """Return the name and the scope of the key ``text``; None if it is unknown.

        Every hash is compared, in a time that does not depend on the position of a difference.
        """
        given, known = _digest(text).encode(), self.all().items()
        fits = [own for own in known if hmac.compare_digest(own[1].sha256.encode(), given)]
        return (fits[0][0], fits[0][1].scope) if fits else None

    async def known(self, text: str) -> tuple[str, Scope] | None:
        """Return what `owner` does; raise `KeysError` also if that takes more than `SECONDS`."""
        try:
            with fail_after(SECONDS):  # in a thread, which is left alone if the disk hangs
                return await run_sync(self.owner, text, limiter=self._one, abandon_on_cancel=True)
        except TimeoutError:
            raise KeysError(f"the keys cannot be read within {SECONDS:g} s") from None

    def add(self, name: str, scope: Scope) -> str:
        """Make a key and return its text, which is not stored; the name must be new.

        A damaged file is set aside; raise `KeysError` if the system cannot read the file.
        """
        if not re.fullmatch(r"(?!seal$)[\w.-]{1,64}", name, re.ASCII):
            allowed = "must be 1 to 64 letters, digits, '.', '_' or '-', and not 'seal'"
            raise StudyError("name", name, allowed)
        text = f"residua_{secrets.token_urlsafe(32)}"  # no dash first; a leaked key is recognised
        with self._changing(anew=True) as keys:
            if name in keys:
                raise StudyError("name", name, "must be new: there is a key of this name")
            keys[name] = Key(scope=scope, sha256=_digest(text), created=datetime.now(UTC))
        return text

    def remove(self, name: str) -> None:
        """Delete the key of this name; raise `KeysError` if the keys cannot be read."""
        with self._changing() as keys:
            if keys.pop(name, None) is None:
                names = ", ".join(keys) or "none"
                raise StudyError("name", name, f"must be the name of a key; there are: {names}")

    @contextmanager
    def _changing(self, anew: bool = False) -> Iterator[dict[str, Key]]:
        """Give the keys for a change, then replace the file, which only its owner may read.

        With `anew`, a damaged file is set aside first.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        lock = os.open(self.path.parent, os.O_RDONLY)  # simultaneous commands wait for each other
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if anew:
                self._set_damaged_aside()
            keys = self.all()
            yield keys
            with appearing(self.path) as part:
                part.touch(mode=0o600)
                part.write_bytes(sealed_json(_NAME, FILE.dump_python(keys, mode="json")))
                if os.geteuid() == 0:  # the service may be another user: the owner of the directory
                    owner = self.path.parent.stat()
                    os.chown(part, owner.st_uid, owner.st_gid)
        finally:
            os.close(lock)

    def _set_damaged_aside(self) -> None:
        """Set the file aside if what it holds is damaged, not if the system cannot read it."""
        try:
            self._kept()
        except FileDamaged as error:
            Store(self.path.parent).set_aside(error, "make all keys again")
        except OSError:
            pass  # told when the keys are used


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()
