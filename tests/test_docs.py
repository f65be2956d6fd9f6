"""What the pages show works, as a reader would try it.

The blocks of a page run from top to bottom in one empty directory that holds a copy of the studies
and scene files of `data`; so do those of every page that has any. Studies are on coarse meshes, in
few increments, and with the values that the pages look at; only those of the first page, which
shows numbers, are as they are. What an earlier page has computed by the same command is there
already. ``python`` blocks are programs, each in a file and a process of its own, as workers import
it; in ``console`` blocks each line ``$ residua …`` runs in this process, studies too, and must
succeed. A ``text`` block after one of these shows what it prints: its lines are printed in this
order, among others, with equal words, and with numbers that differ by at most `SHOWN`. The ``sh``
block of the first page is sent to a service. A ``toml`` block after ``<!-- file NAME.toml -->`` is
written to that file. A block after ``<!-- no-test -->`` is left out, which only those may be that
need a server or compute for minutes. A block after ``<!-- from examples/NAME.py -->`` is not run:
its lines stand in that script, which is. Links lead to files and headings that exist, and so do the
files a page names.
"""

from __future__ import annotations

import json
import math
import os
import re
import runpy
import shlex
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from residua.cli import main
from solver.results.quantities import QUANTITIES
from solver.shipped import SCENES
from studies import open_netcdf
from tests.architecture.sources import ROOT, tracked
from tests.architecture.test_layers import LAYERS
from tests.marks import undivided
from tests.programs import Programs
from tests.service.servers import Server

TEXTS = [path for path in tracked() if path.suffix == ".md"]
BLOCK = re.compile(
    r"(?P<skip><!-- no-test -->\n+)?"
    r"(?:<!-- from (?P<script>examples/\w+\.py) -->\n+)?"
    r"(?:<!-- file (?P<file>[\w-]+\.toml) -->\n+)?"
    r"^```(?P<language>(?(file)toml|(?:python|console|sh)))\n(?P<text>.*?)^```\n"
    r"(?:\n```text\n(?P<shown>.*?)^```)?",
    re.DOTALL | re.MULTILINE,
)
COSTLY = re.compile(
    r"https?://|residua (?:run|serve|view|submit|status|cancel|fetch)|measured(?:\.py|\n)"
)
SNIPPET = "snippet.py"
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[[^\]]*\]\((?P<target>[^)\s]+)\)")
NAMED = re.compile(r"`((?:solver|studies|service|residua|tests|data|docs|examples)/[a-z0-9_./-]*)`")
PLACE = re.compile(r"`((?:\w+/)*\w+\.py)`: ((?:`[\w.]+`(?:, )?)+)")
"""A file and what it holds, as in "`file.py`: `function`, `Class.method`"."""
TICS = re.compile(r"\b(?:tells?|told|foreseen?|foresees?|in the place of|lets? expect)\b", re.I)
"""Words for report, show, state; predicted; instead of; predict."""
RUN = re.compile(r"run \S+ --out (?P<out>\S+)")
FIRST = Path("README.md")
LESS = {
    "tour.toml": {"smallest_element": 0.05, "growth": 3.0},
    "tour-finer.toml": {"smallest_element": 0.04, "growth": 3.0},
    "ball.toml": {"load_ratio": [1.5, 6.0], "hardening": ["none", "kinematic"]},
    "ball-fit.toml": {"ranges": "{ yield_stress = [340, 420] }"},
    "elastic-punch.toml": {"friction": [0.0, 0.4]},
    "first-yield.toml": {
        "    { friction = 0.2": None,
        "    { friction = 0.4": None,
        "between": [1.7, 1.9],
    },
    "least-pressure.toml": {"starts": 1, "most": 9},
    "punch-tests.toml": {"smallest_element": 0.05, "growth": 3.0},
    "refined-punch.toml": {"load_ratio": [0.6, 0.7], "friction": [0.2, 0.25]},
    "wheel-rail.toml": {"passes": [1]},
    "wheel-rail-lateral.toml": {"lateral_position": [-7.5, -3.0], "traction": [-0.75, 0.75]},
    "shaft-hub.toml": {"friction": [0.0, 0.2], "loading": ["interference"]},
}
"""Entries of studies with those of their values that the pages look at, and one more, or other
ones for less work, a table as its text; None for lines that are left out."""
COARSE = {
    "punch": "load_step = 0.25\nunload_steps = 1\n",
    "ball": "element_size = 0.2\ngrowth = 2.0\nload_step = 0.2\n",
}
"""Parameters of scenes besides the coarsest accuracy, where a study does not choose one."""
TWO_SCREENS = 110
"""Lines of Markdown that the first page may have."""

SHOWN = 1e-3
"""Relative difference between a number that is printed and the one that a page shows."""

TOUR = "run data/studies/tour.toml --out tour"
"""The study of the first page."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One fenced block of a page."""

    language: str
    text: str
    line: int
    skipped: bool
    script: str = ""
    file: str = ""
    shown: str = ""

    @property
    def runs(self) -> bool:
        """Whether it is run here."""
        return not self.skipped and not self.script and self.language != "sh"

    @property
    def commands(self) -> list[str]:
        """The lines of its commands, each without its name."""
        return re.findall(r"^\$ residua (.*)$", self.text, re.MULTILINE)


def steps(page: list[Block], folder: Path) -> Iterator[tuple[Block, list[str] | Path]]:
    """Yield what a page runs, in order, and its commands or a file of Python.

    Files are written to a folder, before it is yielded.
    """
    for block in page:
        if not block.runs:
            continue
        if block.language == "toml":
            (folder / block.file).write_text(block.text)
        elif block.language == "python":
            # Empty lines in front: a traceback then names the line of the page.
            (folder / SNIPPET).write_text("\n" * block.line + block.text)
            yield block, folder / SNIPPET
        elif block.commands:
            yield block, block.commands


def carry_out(commands: list[str], divided: bool = False) -> None:
    """Run commands and their studies in this process: others would import for seconds."""
    for command in commands:
        computes = command.startswith(("run ", "fit ")) and "--part" not in command
        alone = ["--workers", "0"] if computes else []
        with pytest.MonkeyPatch.context() as patch:
            if not divided:
                undivided(patch)
            assert main([*shlex.split(command), *alone]) == 0, f"$ residua {command}"


def alike(shown: str, printed: str) -> bool:
    """Whether two words are equal, or two numbers nearly."""
    try:
        return math.isclose(float(shown), float(printed), rel_tol=SHOWN, abs_tol=1e-9)
    except ValueError:
        return shown == printed


def not_printed(shown: str, printed: str) -> list[str]:
    """Return the lines of a block that are not among those printed, in this order."""

    def same(one: str, other: str) -> bool:
        ours, theirs = (re.findall(r"[^\s,]+", line) for line in (one, other))
        return len(ours) == len(theirs) and all(map(alike, ours, theirs))

    rest = iter(printed.splitlines())
    return [line for line in shown.splitlines() if not any(same(line, each) for each in rest)]


def run_python(file: Path, programs: Programs) -> str:
    """Run a file in its directory, and return what it prints."""
    done = programs.run(file, file.parent, os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout


def blocks(text: str) -> list[Block]:
    """Return the python and console blocks of a page, in order."""
    return [
        Block(
            language=match["language"],
            text=match["text"],
            line=text.count("\n", 0, match.start("text")),
            skipped=match["skip"] is not None,
            script=match["script"] or "",
            file=match["file"] or "",
            shown=match["shown"] or "",
        )
        for match in BLOCK.finditer(text)
    ]


PAGES = [page for page in TEXTS if blocks((ROOT / page).read_text())]


def test_the_first_page_is_run_and_fits_two_screens() -> None:
    assert FIRST in PAGES
    text = (ROOT / FIRST).read_text()
    assert len(text.splitlines()) <= TWO_SCREENS
    assert len(LINK.findall(re.sub(r"!\[[^]]*\]\([^)]*\)", "", text))) <= 10


def test_every_page_has_its_place_in_the_order_of_reading() -> None:
    index = (ROOT / "docs/README.md").read_text()
    linked = {Path("docs", target.partition("#")[0]) for target in LINK.findall(index)}
    assert {page for page in TEXTS if page.parts[0] == "docs"} - linked == {Path("docs/README.md")}


def test_the_gallery_has_every_picture_with_what_makes_it() -> None:
    pictures = [path for path in tracked() if path.suffix in (".png", ".svg")]
    assert sum((ROOT / path).stat().st_size for path in pictures) < 1.5e6
    make = runpy.run_path(str(ROOT / "docs/pictures/make.py"))
    sections = make["sections"]((ROOT / "docs/gallery.md").read_text())
    made = [name for text in sections.values() for name in make["PICTURE"].findall(text)]
    assert sorted(Path("docs/pictures", name) for name in made) == sorted(
        path for path in pictures if path.parts[0] == "docs"
    )
    for name, text in sections.items():
        page = text if make["BLOCK"].search(text) else (ROOT / f"docs/{name}.md").read_text()
        written = "\n".join(block["text"] for block in make["BLOCK"].finditer(page))
        for script in re.findall(r"examples/\w+\.py", written):
            written += (ROOT / script).read_text()
        assert all(picture in written for picture in make["PICTURE"].findall(text)), name


def coarse(study: str) -> str:
    """Return a study file with the coarsest accuracy, where it does not choose one."""
    if "accuracy" in study:
        return study
    scene = re.search(r'^scene = "(\w+)"', study, re.MULTILINE)
    own = COARSE.get(scene[1], "") if scene else ""
    lines = ['accuracy = "draft"', *own.splitlines()]
    given = "".join(f"{line}\n" for line in lines if f"\n{line.partition(' ')[0]} =" not in study)
    head, table, rest = study.partition("[parameters]\n")
    if not table:
        head, table, rest = study.partition("[sweep]\n")
        rest = f"{table}{rest}"
    return f"{head}[parameters]\n{given}{rest}"


def shortened(study: str, entries: Mapping[str, Any]) -> str:
    """Return a study file with other values of some entries, without the lines of some."""
    for name, value in entries.items():
        given = value if isinstance(value, str) else json.dumps(value)
        line = "" if value is None else f"{name} = {given}\n"
        rest = ".*" if value is None else " = .*"
        study, times = re.subn(rf"^{re.escape(name)}{rest}\n", line, study, flags=re.MULTILINE)
        assert times == 1, name
    return study


def results(page: list[Block]) -> dict[str, str]:
    """Return the commands of a page that compute a study, and the directories they write."""
    commands = [command for block in page if block.runs for command in block.commands]
    return {command: found["out"] for command in commands if (found := RUN.fullmatch(command))}


@pytest.fixture(scope="module")
def computed() -> dict[tuple[bool, str], Path]:
    """Directories that commands have written, by whether of the first page, and the command."""
    return {}


@pytest.mark.pages
@pytest.mark.parametrize("page", PAGES, ids=str)
def test_blocks_of_a_page_run(
    page: Path,
    tmp_path: Path,
    computed: dict[tuple[bool, str], Path],
    programs: Programs,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("studies", "scenes"):
        shutil.copytree(ROOT / "data" / folder, tmp_path / "data" / folder)
    first = page == FIRST
    assert all((tmp_path / "data" / "studies" / name).exists() for name in LESS if "/" not in name)
    for study in () if first else (tmp_path / "data" / "studies").glob("*.toml"):
        changed = shortened(study.read_text(), LESS.get(study.name, {}))
        study.write_text(coarse(changed))
    found = blocks((ROOT / page).read_text())
    for command, out in results(found).items():
        if (first, command) in computed:
            shutil.copytree(computed[first, command], tmp_path / out)
    for block, program in steps(found, tmp_path):
        capsys.readouterr()
        print(f"{page}:{block.line}")  # shown where it fails
        if isinstance(program, Path):
            print(run_python(program, programs))
        else:
            carry_out(program, divided=first)
        printed = capsys.readouterr().out
        assert not not_printed(block.shown, printed), printed
    computed |= {(first, command): tmp_path / out for command, out in results(found).items()}


@pytest.mark.pages
def test_the_requests_of_the_first_page_are_answered_as_it_shows(
    tmp_path: Path, computed: dict[tuple[bool, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    if (True, TOUR) not in computed:
        monkeypatch.chdir(ROOT)
        carry_out([TOUR.replace("--out tour", f"--out {tmp_path / 'tour'}")], divided=True)
        computed[True, TOUR] = tmp_path / "tour"
    (sent,) = (b for b in blocks((ROOT / "README.md").read_text()) if b.language == "sh")
    shutil.copytree(computed[True, TOUR], tmp_path / "service" / "data")
    server = Server(tmp_path / "service").start()
    try:
        requests = sent.text.replace("localhost:8000", f"localhost:{server.port}")
        command = ["bash", "-euo", "pipefail", "-c", requests]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    finally:
        server.close()
    assert not not_printed(sent.shown, done.stdout), done.stdout
    with open_netcdf(tmp_path / "tour.nc") as dataset:
        assert dataset.sizes["friction"] == 2


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_only_costly_blocks_are_left_out(page: Path) -> None:
    left_out = [block for block in blocks((ROOT / page).read_text()) if block.skipped]
    assert not [block.line for block in left_out if not COSTLY.search(block.text)]


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_quoted_lines_stand_in_the_script(page: Path) -> None:
    quoted = [block for block in blocks((ROOT / page).read_text()) if block.script]
    assert not [block.line for block in quoted if missing(block, ROOT)]


def missing(block: Block, root: Path) -> bool:
    """Whether the lines of a block do not stand together in the script they are from."""
    return f"\n{block.text}" not in f"\n{(root / block.script).read_text()}"


def test_a_line_that_is_not_in_the_script_is_found(tmp_path: Path) -> None:
    (tmp_path / "examples").mkdir()
    (tmp_path / "examples" / "a.py").write_text("x = 1\ny = 2\nz = 3\n")
    head = "<!-- from examples/a.py -->\n```python\n"
    page = f"{head}y = 2\nz = 3\n```\n{head}y = 2\nz = 4\n```\n{head}= 2\n```\n"
    assert [missing(block, tmp_path) for block in blocks(page)] == [False, True, True]
    assert not list(steps(blocks(page), tmp_path))


def test_every_kind_of_block_is_found(tmp_path: Path) -> None:
    page = (
        "A\n\n```python\nx = 1\n```\n\n"
        "<!-- no-test -->\n```console\n$ residua serve\n```\n"
        "```console\n$ residua scenes punch\nthe answer\n```\n"
        "```console\n$ make run\n$ residua scenes 'a b'\n```\n```python\ny = 2\n```\n"
    )
    program, server, command, make, last = found = blocks(page)
    assert (program.language, program.text, program.line) == ("python", "x = 1\n", 3)
    assert (server.skipped, command.skipped) == (True, False)
    made = steps(found, tmp_path)
    assert next(made) == (program, tmp_path / SNIPPET)
    assert (tmp_path / SNIPPET).read_text() == "\n\n\nx = 1\n"
    assert next(made) == (command, ["scenes punch"])
    assert next(made) == (make, ["scenes 'a b'"])
    assert list(made) == [(last, tmp_path / SNIPPET)]


def test_a_file_of_a_page_is_written_and_an_output_is_known(tmp_path: Path) -> None:
    page = (
        "<!-- file a.toml -->\n```toml\nb = 1\n```\n```toml\nnone = 1\n```\n"
        "```python\nprint(1)\n```\n\n```text\n1\n```\n\nB\n\n```text\n2\n```\n"
    )
    file, program = blocks(page)
    assert (program.shown, file.shown) == ("1\n", "")
    assert [block for block, _ in steps([file, program], tmp_path)] == [program]
    assert (tmp_path / "a.toml").read_text() == "b = 1\n"


@pytest.mark.parametrize(
    ("shown", "missing"),
    [
        ("a 1.000\nc -2,x\n", []),
        ("a 1.0009\n", []),
        ("a 1.002\n", ["a 1.002"]),
        ("a 1\nd\n", ["d"]),
        ("c -2,x\na 1\n", ["a 1"]),
        ("a\n", ["a"]),
    ],
)
def test_an_output_that_differs_from_what_is_shown_is_found(shown: str, missing: list[str]) -> None:
    assert not_printed(shown, "a 1\nb\nc -2, x\n") == missing


def test_the_results_of_a_page_are_known_by_the_command() -> None:
    page = (
        "```console\n$ residua run a.toml --out b\n$ residua run a.toml --out b --dry-run\n```\n"
        "<!-- no-test -->\n```console\n$ residua run long.toml --out long\n```\n"
    )
    assert results(blocks(page)) == {"run a.toml --out b": "b"}


def test_the_first_command_that_fails_ends_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = "```console\n$ residua scenes\n$ residua scenes no\n$ residua scenes punch\n```\n"
    ((_, commands),) = steps(blocks(page), tmp_path)
    assert isinstance(commands, list)
    with pytest.raises(AssertionError, match=r"\$ residua scenes no"):
        carry_out(commands)
    printed = capsys.readouterr()
    assert "shaft_hub" in printed.out and "load_ratio" not in printed.out


def test_the_page_of_the_audit_names_every_figure_and_no_other():
    named = set(re.findall(r"`(audit_\w+)`", (ROOT / "docs/explanation/audit.md").read_text()))
    assert SCENES  # their modules declare the figures
    stored = {name for name in QUANTITIES if name.startswith("audit_")}
    assert named - {"audit_failed"} == stored


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    found: list[str] = []
    for heading in re.findall(
        r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), re.M
    ):
        plain = re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")
        times = sum(re.fullmatch(rf"{re.escape(plain)}(-\d+)?", each) is not None for each in found)
        found.append(f"{plain}-{times}" if times else plain)
    return set(found)


def broken_links(page: Path, root: Path) -> list[str]:
    """Return the links of a page to files or headings that do not exist below ``root``."""
    broken = []
    for match in LINK.finditer(CODE.sub("", (root / page).read_text())):
        name, _, anchor = match["target"].partition("#")
        if ":" in name:
            continue
        target = (root / page.parent / name).resolve() if name else root / page
        inside = target.is_relative_to(root.resolve()) and target.exists()
        if not inside or (anchor and anchor not in anchors(target.read_text())):
            broken.append(match["target"])
    return broken


@pytest.mark.parametrize("page", TEXTS, ids=str)
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    assert not broken_links(page, ROOT)


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "other.md").write_text("# One `name`, twice\n\n## A\n\n## A\n")
    page = Path("docs/page.md")
    (tmp_path / page).write_text(
        "[a](../other.md) [b](../other.md#one-name-twice) [c](../other.md#a-1) [d](https://x.y/z)\n"
        "## Here\n[e](#here) `[code](nowhere)` [f](gone.md) [g](../other.md#a-2) [h](#there)\n"
        "[i](../../outside.md) [two\nlines](also-gone.md)\n```\n[j](nowhere.md)\n```\n"
    )
    wrong = ["gone.md", "../other.md#a-2", "#there", "../../outside.md", "also-gone.md"]
    assert broken_links(page, tmp_path) == wrong


@pytest.mark.parametrize("page", [p for p in TEXTS if p.name != "CHANGELOG.md"], ids=str)
def test_a_page_uses_plain_words(page: Path) -> None:
    assert not TICS.findall(CODE.sub("", (ROOT / page).read_text()))


@pytest.mark.parametrize("page", [p for p in TEXTS if p.name != "CHANGELOG.md"], ids=str)
def test_files_named_in_a_page_exist(page: Path) -> None:
    named = NAMED.findall((ROOT / page).read_text())
    assert not [name for name in named if not (ROOT / name).exists()]


@pytest.mark.parametrize(
    "page", [p for p in TEXTS if PLACE.search((ROOT / p).read_text())], ids=str
)
def test_functions_named_in_a_page_stand_in_the_files_named_with_them(page: Path) -> None:
    files = tracked()
    for file, names in PLACE.findall((ROOT / page).read_text()):
        sources = [(ROOT / path).read_text() for path in files if f"/{path}".endswith(f"/{file}")]
        assert sources, file
        for name in re.findall(r"\w+", names):
            stands = re.compile(rf"(?:def|class) {name}\b|^ *{name}(?:: [^=]+)? =", re.MULTILINE)
            assert any(map(stands.search, sources)), f"{file}: {name}"


def test_the_page_of_the_architecture_has_every_layer_in_its_place() -> None:
    rows = re.findall(
        r"^\| `(\w+)/([\w/*]+?)(?:/|\.py)` \|",
        (ROOT / "docs/explanation/architecture.md").read_text(),
        re.MULTILINE,
    )
    parts = [(name, layer.replace("/", ".")) for name, layer in dict.fromkeys(rows)]
    found = {
        package: tuple(
            layer
            for name, layer in parts
            if name == package and ("." not in layer or layer in LAYERS[package])
        )
        for package in LAYERS
    }
    assert found == LAYERS


def test_the_glossary_is_in_order_and_has_each_word_once() -> None:
    text = (ROOT / "docs/reference/glossary.md").read_text()
    words = [word.lower() for word in re.findall(r"^\*\*(.+?)\*\*", text, re.MULTILINE)]
    assert len(words) > 50
    assert words == sorted(set(words))
