"""A process with limits of time and memory: what it cannot read is refused, and it is replaced."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Callable

import pytest

from service.errors import Busy
from service.guarded import BYTES, Guarded
from studies import StudyError


def doubled(number: int) -> int:
    return 2 * number


def too_long(_: int) -> None:
    time.sleep(60)


def too_large(_: int) -> None:
    bytes(2 * BYTES)


def killed(_: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def wrong(number: int) -> None:
    raise StudyError("scene", number, "must be even")


@pytest.mark.parametrize(
    ("function", "seconds", "error", "words"),
    [
        (too_long, 0.5, StudyError, r"scene = 'a': must be read within 0\.5 s and 8 GiB.*: less"),
        (too_large, 60.0, StudyError, r"scene = 'a': must be read within 60 s"),
        (killed, 60.0, Busy, "the process that reads a scene has ended: ask again"),
        (wrong, 60.0, StudyError, "scene = 3: must be even"),
    ],
)
def test_what_fails_in_the_process_is_told_and_the_next_call_is_answered(
    function: Callable[[int], None], seconds: float, error: type[Exception], words: str
) -> None:
    async def calls() -> int:
        with pytest.raises(error, match=words):
            await Guarded("scene", 1, seconds).call(function, 3, name="a", advice=": less")
        return await Guarded("scene", 1, 60.0).call(doubled, 3, name="a")

    assert asyncio.run(calls()) == 6


def test_a_queue_that_is_full_takes_no_more() -> None:
    process = Guarded("study", 1, 60.0)

    async def one(number: int) -> int:
        async with process.turn():
            return await process.call(doubled, number, name="a")

    async def calls() -> list[object]:
        return await asyncio.gather(*map(one, range(4)), return_exceptions=True)

    found = asyncio.run(calls())
    assert found[:2] == [0, 2]
    assert {type(each) for each in found[2:]} == {Busy}
