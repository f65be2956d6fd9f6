"""An output is declared once, by the module of the solver that computes it."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter

import pytest

import solver.shipped  # noqa: F401  (declares all)
from solver.results.quantities import IN_SPACE, QUANTITIES, declare
from tests.architecture.sources import ROOT, modules
from tests.recomputed.record import FORMULAS, RULES

DECLARING = {"declare", "Quantity"}
"""What makes a variable of a data set."""
HOME = "solver/results/quantities.py"


def used(source: str) -> set[str]:
    """What a text uses to declare, by whatever name it is imported."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
    return found & DECLARING


def declared(source: str) -> list[str]:
    """Names declared in a text, as often as they are."""
    calls = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call))
    return [
        str(call.args[0].value)
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id == "declare"
        if call.args and isinstance(call.args[0], ast.Constant)
    ]


def inside_functions(source: str) -> list[str]:
    """Names declared where a function runs, so perhaps twice or never."""
    functions = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef))
    return [name for function in functions for name in declared(ast.unparse(function))]


@pytest.mark.parametrize("package", ["studies", "service", "residua"])
def test_nobody_outside_the_solver_declares(package: str) -> None:
    assert not {str(m): names for m in modules(package) if (names := used((ROOT / m).read_text()))}


def declared_by_scenes() -> set[str]:
    """Names that are declared when the scenes have been imported, and nothing else."""
    code = "import solver.shipped as s, solver.results.quantities as q; print(*q.QUANTITIES)"
    command = [sys.executable, "-c", code]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return set(told.stdout.split())


@pytest.mark.processes
def test_every_output_is_declared_once_where_its_module_is_read() -> None:
    sources = [(ROOT / m).read_text() for m in modules("solver") if str(m) != HOME]
    names = Counter(name for source in sources for name in declared(source))
    assert not [name for name, times in names.items() if times > 1]
    assert names.keys() <= declared_by_scenes(), "each one is declared when the scenes are imported"
    assert len(names) > 50
    assert not [name for source in sources for name in inside_functions(source)]


def test_every_quantity_is_recomputed_or_known_as_a_formula() -> None:
    """The figures of the audit are computed a second time by what they are."""
    declared = {name for name in (*QUANTITIES, *IN_SPACE) if not name.startswith("audit_")}
    assert not RULES.keys() & set(FORMULAS)
    assert declared - set(FORMULAS) <= RULES.keys()
    assert RULES.keys() | set(FORMULAS) <= declared


def test_a_second_declaration_is_refused() -> None:
    before = QUANTITIES["residual_stress"]
    with pytest.raises(
        ValueError, match="residual_stress is declared already, as 'residual stress'"
    ):
        declare("residual_stress", "stress that stays", "Pa")
    assert QUANTITIES["residual_stress"] is before


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("from solver.results.quantities import declare as d", {"declare"}),
        ("import solver.results.quantities as q\nq.declare('a', 'b')", {"declare"}),
        ("from solver.results.quantities import QUANTITIES, Quantity", {"Quantity"}),
        ("from solver.results.quantities import QUANTITIES", set()),
    ],
)
def test_a_breach_is_found(text: str, found: set[str]) -> None:
    assert used(text) == found


def test_a_declaration_is_found_wherever_it_stands() -> None:
    text = "A = {'x': declare('a', 'of x')}\ndef f():\n    return declare('b', 'of y')"
    assert declared(text) == ["a", "b"]
    assert inside_functions(text) == ["b"]
