"""What the project says of itself agrees with itself."""

from __future__ import annotations

import importlib
import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import solver
from residua.cli import main
from tests.architecture.sources import PROJECT, ROOT, tracked

CODE = re.compile(r"```.*?```|`[^`\n]+`", re.DOTALL)
TARGET = re.compile(r"^([a-z-]+):", re.MULTILINE)


def test_changelog_knows_the_version() -> None:
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[:2] == ["Unreleased", solver.__version__]


def test_the_distribution_takes_its_version_from_the_solver() -> None:
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {
        "attr": "solver.version.__version__"
    }


def test_the_command_exists() -> None:
    module, _, function = PROJECT["project"]["scripts"]["residua"].partition(":")
    assert callable(getattr(importlib.import_module(module), function))


def pins() -> dict[str, Version]:
    """Name of each distribution -> the version that the tests run with."""
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    given = [line.split("==") for line in lines if not line.startswith("#")]
    return {canonicalize_name(name): Version(version) for name, version in given}


def required() -> list[Requirement]:
    """Return what the distribution and its extras require."""
    extras = PROJECT["project"]["optional-dependencies"].values()
    named = [*PROJECT["project"]["dependencies"], *(name for extra in extras for name in extra)]
    return [Requirement(each) for each in named]


def test_constraints_pin_every_dependency() -> None:
    assert {canonicalize_name(each.name) for each in required()} <= pins().keys()


@pytest.mark.parametrize("each", required(), ids=lambda each: each.name)
def test_a_lower_bound_is_a_version_that_the_tests_run_with(each: Requirement) -> None:
    (bound,) = each.specifier
    pinned = pins()[canonicalize_name(each.name)]
    assert bound.operator == ">="
    assert pinned >= Version(bound.version)
    assert pinned.release[:2] == Version(bound.version).release[:2]


def locked(name: str) -> dict[str, tuple[Version, list[str]]]:
    """Name of each distribution of a lock -> its version and the digests of its files."""
    found = {}
    for line in (ROOT / name).read_text().splitlines():
        if not line.startswith("#"):
            pin, *options = line.split()
            package, version = pin.split("==")
            digests = [re.fullmatch(r"--hash=sha256:([0-9a-f]{64})", each)[1] for each in options]
            found[canonicalize_name(package)] = (Version(version), digests)
    return found


def closure(given: list[str]) -> set[str]:
    """Names of the distributions that requirements need, as the installed ones say."""
    found: set[str] = set()
    todo = [Requirement(each) for each in given]
    while todo:
        one = todo.pop()
        name = canonicalize_name(one.name)
        if name in found or (one.marker and not one.marker.evaluate({"extra": ""})):
            continue
        found.add(name)
        extras = one.extras or {""}
        for each in map(Requirement, distribution(name).requires or ()):
            if not each.marker or any(each.marker.evaluate({"extra": e}) for e in extras):
                each.marker = None
                todo.append(each)
    return found


def test_the_locks_have_all_that_the_image_needs_at_the_versions_of_the_tests() -> None:
    (build,) = map(Requirement, PROJECT["build-system"]["requires"])
    (pin,) = build.specifier
    assert pin.operator == "==", "the build tool is pinned"
    lock, mkl = locked("requirements.lock"), locked("mkl.lock")
    assert lock.pop(canonicalize_name(build.name))[0] == Version(pin.version) == pins()[build.name]
    assert lock.pop("pip")[0] == pins()["pip"]
    free = closure(PROJECT["project"]["dependencies"])
    extra = closure(PROJECT["project"]["optional-dependencies"]["mkl"])
    assert (set(lock), set(mkl)) == (free, extra)
    for name, (version, digests) in (lock | mkl).items():
        assert version == pins()[name], name
        assert digests, name
    assert "mkl" not in lock, "its licence is not free"


@pytest.mark.parametrize("tool", ["pip", "setuptools"])
def test_the_environment_has_the_tools_that_are_pinned(tool: str) -> None:
    assert Version(distribution(tool).version) == pins()[tool]


def test_the_list_of_what_the_image_installs_is_made_of_the_lock() -> None:
    """`make sbom` needs a registry: the test reads its commands, and its list if it was made."""
    lines = (ROOT / "Makefile").read_text().partition("\nsbom:")[2].partition("\n\n")[0]
    assert re.search(r"pip install .*cyclonedx-bom==\d", lines), "the tool is pinned"
    assert re.search(
        r"cyclonedx-py requirements requirements\.lock .*\s.*-o build/sbom\.json", lines
    )
    made = ROOT / "build" / "sbom.json"
    if made.exists() and made.stat().st_mtime > (ROOT / "requirements.lock").stat().st_mtime:
        listed = json.loads(made.read_text())
        parts = {
            (canonicalize_name(p["name"]), Version(p["version"])) for p in listed["components"]
        }
        assert listed["bomFormat"] == "CycloneDX"
        assert listed["metadata"]["component"]["name"] == PROJECT["project"]["name"]
        lock = locked("requirements.lock")
        assert parts == {(name, version) for name, (version, _) in lock.items()}


@pytest.mark.parametrize("page", [p for p in tracked() if p.suffix == ".md"], ids=str)
def test_make_targets_named_in_a_page_exist(page: Path) -> None:
    targets = set(TARGET.findall((ROOT / "Makefile").read_text()))
    code = "\n".join(CODE.findall((ROOT / page).read_text()))
    named = set(re.findall(r"\bmake ([a-z-]+)", code))
    assert named <= targets


def test_readme_starts_with_run_and_test() -> None:
    assert {"run", "test"} <= set(re.findall(r"`make ([a-z]+)`", (ROOT / "README.md").read_text()))


def test_a_lock_is_made_where_the_image_is_at_home_and_never_empty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = runpy.run_path(str(ROOT / "docker" / "lock.py"))
    monkeypatch.setattr("platform.machine", lambda: "arm64")
    with pytest.raises(SystemExit, match=r" arm64: must be Python 3\.11 on Linux x86_64"):
        module["main"]()
    with pytest.raises(SystemExit, match=r"no package for a\.lock"):
        module["written"]({}, tmp_path / "a.lock", "", ())
    assert not list(tmp_path.iterdir())


def test_the_command_prints_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=r"^0$"):
        main(["--version"])
    assert capsys.readouterr().out == f"residua {solver.__version__}\n"


def test_the_citation_has_what_the_format_requires_and_agrees_with_the_project() -> None:
    """`CITATION.cff` is Citation File Format 1.2.0."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["cff-version"] == "1.2.0" and cited["message"] and cited["title"]
    assert cited["version"] == solver.__version__
    assert cited["license"] == PROJECT["project"]["license"]
    (holder,) = re.findall(r"^Copyright \(c\) \d+ (.+)$", (ROOT / "LICENSE").read_text(), re.M)
    assert cited["authors"] == [{"name": holder}]


@pytest.mark.processes
def test_the_reference_of_public_names_is_written_without_a_warning(tmp_path: Path) -> None:
    script = ROOT / "docs" / "reference" / "api.py"
    done = subprocess.run(
        [sys.executable, "-W", "error", script, tmp_path],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("solver", "studies"):
        page = (tmp_path / f"{name}.html").read_text()
        shown = set(re.findall(r'<section id="(\w+)">', page))
        assert shown == set(importlib.import_module(name).__all__)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("command", "mistake", "reason"),
    [
        ("check", 'import { keep } from "./page.js";\nkeep(no);\n', "Cannot find name 'no'"),
        ("lint", "let spare = 1;\n", "`spare` is never used"),
    ],
)
def test_a_mistake_in_a_script_of_the_pages_is_found(
    command: str, mistake: str, reason: str, tmp_path: Path
) -> None:
    lint = (ROOT / "Makefile").read_text().partition("\nlint:")[2].partition("\n\n")[0]
    assert f"$(DENO) {command} --quiet --config tests/architecture/deno.json" in lint
    static = tmp_path / "static"
    shutil.copytree(ROOT / "service" / "pages" / "static", static)
    (static / "wrong.js").write_text(mistake)
    deno = [Path(sys.executable).parent / "deno", command]
    config = Path(__file__).with_name("deno.json")
    done = subprocess.run(
        [*deno, "--config", config, static / "wrong.js"],
        cwd=tmp_path, env=os.environ | {"DENO_DIR": str(tmp_path / "deno"), "NO_COLOR": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert reason in done.stderr
