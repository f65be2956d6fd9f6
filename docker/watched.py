"""Run a command, and end it when it answers no more: the engine starts again what has ended.

``python watched.py [--every SECONDS] [--failures NUMBER] URL COMMAND …``

An engine marks a container as unhealthy, and leaves it as it is. Any answer is a sign of life, also
503: the service then says what it lacks, still hands out results, and a restart brings no room on a
disk. The exit status is that of the command, or 1 when it was ended.

First the compiled kernels of the image are copied to where numba looks for them, and may write:
without them the first run would wait for the compiler.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

ANSWER_SECONDS = 5.0
GRACE_SECONDS = 20.0
KERNELS = Path("/app/kernels")
DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def copy_kernels() -> None:
    """Copy the compiled kernels of the image, if it has any and there is room for them."""
    if KERNELS.is_dir() and (target := os.environ.get("NUMBA_CACHE_DIR")):
        try:
            shutil.copytree(KERNELS, target, dirs_exist_ok=True)
        except OSError as error:  # copytree's own error lists every file
            reason = error.strerror or f"{len(error.args[0])} files cannot be written"
            print(f"{target}: no compiled kernels: {reason}", file=sys.stderr)


def answers(url: str) -> bool:
    """Tell whether anything comes back from ``url``."""
    try:
        DIRECT.open(url, timeout=ANSWER_SECONDS).close()
    except urllib.error.HTTPError as error:
        error.close()
    except OSError:
        return False
    return True


def watch(command: list[str], url: str, every: float, failures: int) -> int:
    """Run ``command`` until it ends, or has left ``failures`` questions in a row unanswered."""
    process = subprocess.Popen(command)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda received, _: process.send_signal(received))
    silent = 0
    while silent < failures:
        with contextlib.suppress(subprocess.TimeoutExpired):
            status = process.wait(timeout=every)
            return status if status >= 0 else 128 - status
        silent = 0 if answers(url) else silent + 1
    print(f"{url}: no answer {failures} times in a row; ending the process", file=sys.stderr)
    process.terminate()
    try:
        process.wait(timeout=GRACE_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    return 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Run a command as long as it answers.")
    parser.add_argument("--every", type=float, default=15.0, help="seconds")
    parser.add_argument("--failures", type=int, default=20, help="five minutes, start included")
    parser.add_argument("url")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    given = parser.parse_args()
    copy_kernels()
    sys.exit(watch(given.command, given.url, given.every, given.failures))
