"""One name, one thing: no two classes of the product share a name."""

from __future__ import annotations

import ast
from collections import defaultdict

from tests.architecture.sources import PACKAGES, ROOT, modules


def test_no_class_name_has_two_meanings() -> None:
    homes: dict[str, list[str]] = defaultdict(list)
    for package in PACKAGES:
        for module in modules(package):
            for node in ast.walk(ast.parse((ROOT / module).read_text())):
                if isinstance(node, ast.ClassDef):
                    homes[node.name.lstrip("_")].append(str(module))
    assert len(homes) > 100
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}
