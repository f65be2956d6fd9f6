"""What the pages show works, as a reader would try it.

The blocks of a page run from top to bottom in one empty directory that holds a copy of the
studies ready to run. ``python`` blocks are programs; in ``console`` blocks each line
``$ residua …`` runs and must succeed. A block after ``<!-- no-test -->`` is left out, which only
those may be that need a server or compute for minutes.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from solver.results.quantities import QUANTITIES
from tests.architecture.sources import PACKAGES, ROOT

PAGES = [
    page
    for page in (ROOT / "README.md", *(ROOT / package / "README.md" for package in PACKAGES))
    if page.is_file()
]
BLOCK = re.compile(
    r"(?P<skip><!-- no-test -->\n+)?^```(?P<language>python|console)\n(?P<text>.*?)^```",
    re.DOTALL | re.MULTILINE,
)
COSTLY = re.compile(r"https?://|residua (?:run|serve|submit|status|cancel|fetch)")
COMMAND = "import sys; from studies.command.cli import main; sys.exit(main())"


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One fenced block of a page."""

    language: str
    text: str
    line: int
    skipped: bool

    def programs(self) -> list[list[str]]:
        """Arguments for the interpreter, one list a program."""
        if self.language == "python":
            # Empty lines in front: a traceback then names the line of the page.
            return [["-c", "\n" * self.line + self.text]]
        commands = re.findall(r"^\$ residua (.*)$", self.text, re.MULTILINE)
        return [["-c", COMMAND, *shlex.split(command)] for command in commands]


def blocks(text: str) -> list[Block]:
    """Return the python and console blocks of a page, in order."""
    return [
        Block(
            language=match["language"],
            text=match["text"],
            line=text.count("\n", 0, match.start("text")),
            skipped=match["skip"] is not None,
        )
        for match in BLOCK.finditer(text)
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_blocks_of_a_page_run(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "data" / "studies", tmp_path / "data" / "studies")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for block in blocks(page.read_text()):
        for program in [] if block.skipped else block.programs():
            done = subprocess.run(
                [sys.executable, *program],
                cwd=tmp_path,
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=300,
                check=False,
            )
            assert done.returncode == 0, f"{page}:{block.line}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_only_costly_blocks_are_left_out(page: Path) -> None:
    left_out = [block for block in blocks(page.read_text()) if block.skipped]
    assert not [block.line for block in left_out if not COSTLY.search(block.text)]


def test_every_kind_of_block_is_found() -> None:
    page = (
        "A\n\n```python\nx = 1\n```\n\n"
        "<!-- no-test -->\n```console\n$ residua serve\n```\n"
        "```console\n$ residua scenes punch\nthe answer\n```\n"
    )
    program, server, command = blocks(page)
    assert (program.language, program.text, program.line) == ("python", "x = 1\n", 3)
    assert (server.skipped, command.skipped) == (True, False)
    assert command.programs() == [["-c", COMMAND, "scenes", "punch"]]


def test_the_page_of_the_audit_names_every_figure_and_no_other():
    named = set(re.findall(r"`(audit_\w+)`", (ROOT / "docs/audit.md").read_text()))
    stored = {name for name in QUANTITIES if name.startswith("audit_")}
    assert named - {"audit_failed"} == stored
