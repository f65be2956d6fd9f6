"""Write ``requirements.lock`` and ``mkl.lock``: what the image installs, with digests of all files.

``python docker/lock.py`` asks the package index, and installs nothing. The versions are those of
``constraints.txt``. A package has the digest of its wheel for each machine: Linux, Python 3.11.
pip decides by the Python that runs it which packages a system needs, so that this must be the same.
"""

from __future__ import annotations

import json
import platform
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
MACHINES = ("x86_64", "aarch64")
HEAD = "# Made by `make lock`: {}; Python 3.11, Linux {}.\n"

SYSTEM = ("3.11", "Linux", "x86_64")
"""Version of Python, system and machine where pip finds what the image needs."""

Lock = dict[str, set[str]]
"""Pinned package -> digests."""


def check_system() -> None:
    """End with an error where pip would find what another system needs."""
    here = (platform.python_version().rpartition(".")[0], platform.system(), platform.machine())
    if here != SYSTEM:
        text = "docker/lock.py: Python {} on {} {}: must be Python {} on {} {}, as in the image"
        raise SystemExit(text.format(*here, *SYSTEM))


def resolved(requirements: list[str], machine: str) -> dict[str, str]:
    """Return the digest of the wheel of each package that the requirements need on a machine."""
    tags = [f"manylinux_2_{minor}_{machine}" for minor in range(34, 4, -1)]
    tags += [f"manylinux{year}_{machine}" for year in ("2014", "2010", "1")]
    with tempfile.TemporaryDirectory() as target:
        report = subprocess.run(
            [
                *(sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--report", "-"),
                *("--ignore-installed", "--only-binary", ":all:", "--python-version", "3.11"),
                *("--constraint", str(ROOT / "constraints.txt"), "--target", target),
                *(word for tag in tags for word in ("--platform", tag)),
                *requirements,
            ],
            check=True,
            stdout=subprocess.PIPE,
        ).stdout
    return {
        f"{each['metadata']['name']}=={each['metadata']['version']}": each["download_info"][
            "archive_info"
        ]["hashes"]["sha256"]
        for each in json.loads(report)["install"]
    }


def written(lock: Lock, path: Path, what: str, machines: tuple[str, ...]) -> None:
    """Write a lock: a package a line, in alphabetical order; an empty one is an error."""
    if not lock:
        raise SystemExit(f"docker/lock.py: pip found no package for {path.name}: it is kept")
    lines = [
        " ".join((pin, *(f"--hash=sha256:{digest}" for digest in sorted(lock[pin]))))
        for pin in sorted(lock, key=str.lower)
    ]
    head = HEAD.format(what, " and ".join(machines))
    path.write_text(head + "\n".join(lines) + "\n", encoding="ascii")


def main() -> None:
    """Write both files."""
    check_system()
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())
    own = ["pip", *given["build-system"]["requires"], *given["project"]["dependencies"]]
    lock: Lock = defaultdict(set)
    for machine in MACHINES:
        for pin, digest in resolved(own, machine).items():
            lock[pin].add(digest)
    extra = given["project"]["optional-dependencies"]["mkl"]
    mkl = {pin: {digest} for pin, digest in resolved(extra, "x86_64").items()}
    written(lock, ROOT / "requirements.lock", "the image, without MKL", MACHINES)
    written(mkl, ROOT / "mkl.lock", "MKL, for who accepts its licence", ("x86_64",))


if __name__ == "__main__":
    main()
