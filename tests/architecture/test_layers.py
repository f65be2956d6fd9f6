"""Inside the packages imports run one way, and in no circle."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT, modules

LAYERS = {
    # from the ground up; a module may import from its own layer and from those before it
    "solver": (
        "version", "late", "typing", "errors", "files", "parameters", "parts", "memory",
        "tensors", "fatigue", "linear", "mesh", "materials", "model", "fem", "contact",
        "fracture", "loading",
        "results.quantities", "audit", "results", "derivatives", "scenes", "rolling",
        "shipped",
    ),
    "studies": (
        "units", "numbers", "errors", "toml", "materials", "scratch", "scenes", "definition",
        "kinds",
        "definition.study", "storage", "kinds.*.answer", "execution", "views", "kinds.*.shown",
        "client",
    ),
    "residua": (
        "status", "progress", "keys", "slurm", "commands",
        "arguments", "cli", "__main__",
    ),
}  # fmt: skip


def name_of(path: Path) -> str:
    """Dotted name of the module a file holds."""
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def layer_of(module: str) -> str:
    """First part of a module's name below its package; nothing for the package itself.

    The declarations of quantities are a layer of their own, below the audit, which reads them and
    no other code of results. A study and its files know the kinds of study, which name what writes
    and shows their results as text.
    """
    below = module.partition(".")[2]
    return next((PARTS[own] for own in PARTS if fnmatch(below, own)), below.partition(".")[0])


PARTS = {
    "results.quantities": "results.quantities",
    "definition.study": "definition.study", "definition.files": "definition.study",
    "kinds.*.answer": "kinds.*.answer", "kinds.*.shown": "kinds.*.shown",
    "kinds.*.figure": "kinds.*.shown",
}  # fmt: skip
"""Modules that are in a layer of their own; of kinds of study in every folder."""


def targets(source: str, known: set[str]) -> set[str]:
    """Modules of ``known`` that a text imports, wherever and for whatever purpose."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "imports are absolute"
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.add(whole if whole in known else str(node.module))
        elif isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
    return found & known


def graph(package: str) -> dict[str, set[str]]:
    """Module -> modules of the same package it imports."""
    paths = {name_of(path): path for path in modules(package)}
    known = set(paths)
    return {
        name: targets((ROOT / path).read_text(), known) - {name} for name, path in paths.items()
    }


def against(imports: dict[str, set[str]], layers: tuple[str, ...]) -> Iterator[str]:
    """Yield every import of a later layer."""
    for module, used in imports.items():
        for other in used:
            mine, its = layer_of(module), layer_of(other)
            if mine and (not its or layers.index(its) > layers.index(mine)):
                yield f"{module} imports {other}"


@pytest.mark.parametrize("package", LAYERS)
def test_every_module_has_its_layer(package: str) -> None:
    assert {layer_of(module) for module in graph(package)} == {"", *LAYERS[package]}


@pytest.mark.parametrize("package", LAYERS)
def test_no_module_imports_from_a_later_layer(package: str) -> None:
    assert not list(against(graph(package), LAYERS[package]))


@pytest.mark.parametrize("package", LAYERS)
def test_no_imports_go_in_a_circle(package: str) -> None:
    """Imports for typing only count: what knows each other is one thing in two files."""
    graphlib.TopologicalSorter(graph(package)).prepare()


ALPHABET = {"SQRT2", "NORMAL", "TANGENTS", "TYPE_CHECKING"}
"""Constants that say no accuracy: a factor of Mandel vectors, and the numbers of directions."""


def test_the_audit_takes_no_constant_of_what_it_audits() -> None:
    """A limit that the solver converges to proves nothing of it: the audit has its own."""
    for path in modules("solver/audit"):
        for node in ast.walk(ast.parse((ROOT / path).read_text())):
            if isinstance(node, ast.ImportFrom) and not str(node.module).startswith("solver.audit"):
                constants = {alias.name for alias in node.names if alias.name.isupper()}
                assert constants <= ALPHABET, f"{path}: {constants - ALPHABET}"


def test_a_breach_is_found() -> None:
    known = {"solver.fem", "solver.fem.part", "solver.scenes"}
    text = "def later():\n    from solver import scenes\nfrom solver.fem import part"
    assert targets(text, known) == {"solver.scenes", "solver.fem.part"}
    assert list(against({"solver.fem.part": {"solver.scenes"}}, LAYERS["solver"]))
    assert list(against({"solver.audit.report": {"solver.results.fields"}}, LAYERS["solver"]))
    assert not list(
        against({"solver.audit.report": {"solver.results.quantities"}}, LAYERS["solver"])
    )
    assert not list(against({"solver.scenes": {"solver.fem.part"}}, LAYERS["solver"]))
