"""Check studies and scene files before they are accepted, in processes of their own.

To check every run of a large study and to make its id takes seconds, and memory. A scene is read in
a process without a network, which writes in one folder; nothing in it is executed.
"""

from __future__ import annotations

import errno
import json
import logging
from base64 import b64decode
from collections.abc import Mapping
from math import ceil
from typing import Any

from service.errors import TooMany
from service.examined import Examined, examined
from service.sandbox import CRASHED, FAILED, Answer
from service.schemas import KeptScene
from service.settings import Settings
from service.turns import MINUTE, Share, beyond
from solver.late import Late
from studies.errors import SceneError, StudyError
from studies.scenes.formats import FORMATS
from studies.scenes.table import FILE_NAME
from studies.scratch import scratch

SECONDS = 120
"""Longest time of the check of a study [s]."""


async def examine(content: Mapping[str, Any], settings: Settings, share: Share) -> Examined:
    """Return the study that ``content`` describes.

    Raises
    ------
    StudyError
        If it has a mistake, or its cost exceeds the settings.
    Busy
        If the process was killed.
    """
    what = dict(content), settings.data, settings.bounds
    return await share.apart(
        examined, *what, field="study", name=content.get("name"), seconds=SECONDS,
        advice=": sweep less",
    )  # fmt: skip


log = logging.getLogger(__name__)

SLOW = 10.0
"""Longest time of reading a scene, as a multiple of its processor time: others compute too."""
LONGEST = 1_000_000
"""Largest size of a scene file, without its meshes [bytes]."""
_FILE = "scene.toml"
CHECKED = Late("service.posted:checked")


class Inspector:
    """Checks scenes.

    Parameters
    ----------
    seconds : longest processor time of one [s]
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self.reported = ""

    async def inspect(
        self, text: bytes, meshes: Mapping[str, bytes], share: Share
    ) -> tuple[KeptScene, Any]:
        """Return the scene of a file and its meshes, and their content.

        Raises
        ------
        StudyError
            with all its mistakes
        Busy
            if the budget of the caller is used, or the process was killed
        """
        from studies.scenes.description import Description  # loads scipy
        from studies.scenes.meshfile import TABLE, MeshFile

        if len(text) > LONGEST:
            raise StudyError("scene", f"{len(text)} bytes", f"must have at most {LONGEST} bytes")
        known = (*FORMATS, TABLE)
        for name in meshes:
            if not (FILE_NAME.fullmatch(name) and name.lower().endswith(known)):
                allowed = f"must be the name of a file and end in one of {', '.join(known)}"
                raise StudyError("meshes", name, allowed)
        slow = SLOW * self.seconds
        async with share.turn() as turn:
            most = min(turn.remaining, self.seconds)
            with scratch() as folder:
                for name, data in {**meshes, _FILE: text}.items():
                    (folder / name).write_bytes(data)
                answer = await turn.shut_in(CHECKED, folder, folder=folder, cpu=most, seconds=slow)
        if answer.failed == errno.ETIME and most < self.seconds:
            share.turns.remaining(share.caller)
            raise TooMany("too little processor time remained: ask later", ceil(MINUTE))
        found = self._read(answer)
        if mistakes := found.get("mistakes"):
            raise SceneError(_FILE, [StudyError(*each) for each in mistakes], found["count"])
        arrays = {name: b64decode(text) for name, text in found["arrays"].items()}
        given = {name: MeshFile(name, data, arrays[name]) for name, data in meshes.items()}
        return KeptScene(**found["scene"]), Description(_FILE, found["content"], given)

    def _read(self, answer: Answer) -> dict[str, Any]:
        if answer.open != self.reported:
            self.reported = answer.open
            log.warning("this system does not take from a process that reads: %s", answer.open)
        if answer.failed == errno.ENOSPC:
            raise OSError(errno.ENOSPC, "no room is left for temporary files")
        if answer.failed == FAILED:
            raise RuntimeError("a scene could not be read")
        if answer.failed == CRASHED:
            allowed = "cannot be read: a library that reads its meshes fails with them"
            raise StudyError("scene", _FILE, allowed)
        if answer.failed:
            raise beyond("scene", _FILE, self.seconds if answer.failed == errno.ETIME else None)
        found: dict[str, Any] = json.loads(answer.text)
        return found
