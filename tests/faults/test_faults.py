"""The list of faults fits the product and the tests of today, and the documentation shows it."""

from __future__ import annotations

import ast
from collections import Counter

import pytest

from tests.faults import ROOT, Fault, faults

FAULTS = faults()


def names_in(file: str) -> set[str]:
    """Return the names of the tests of a file."""
    tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_fits_into_its_file_and_its_test_exists(fault: Fault) -> None:
    text = fault.in_place(ROOT)
    assert text != (ROOT / fault.file).read_text(encoding="utf-8")
    ast.parse(text)
    file, test = fault.test.split("::")
    assert test in names_in(file)


def test_there_are_faults_of_every_kind() -> None:
    kinds = Counter(fault.name.partition(".")[0] for fault in FAULTS)
    assert kinds.keys() == {"read", "state", "prism", "output"}
    assert kinds.total() > 50


def test_a_text_that_is_not_there_once_is_refused() -> None:
    fault = FAULTS[0]
    away = Fault(name="x", file=fault.file, old="not there", new="", means="", test=fault.test)
    with pytest.raises(ValueError, match=r"x: 'not there' must be in .* once"):
        away.in_place(ROOT)


def test_the_documentation_has_the_table() -> None:
    page = (ROOT / "docs/explanation/faults.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in page if line.startswith("| `")] == [fault.row for fault in FAULTS]
