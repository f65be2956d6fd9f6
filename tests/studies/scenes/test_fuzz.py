"""Scene files with anything in place of anything: a scene, or mistakes told by their entry."""

from __future__ import annotations

import random
from typing import Any

import pytest

from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.studies.scenes.conftest import blocks

ANYTHING: list[Any] = [
    None, True, 0, -1, 1e308, float("nan"), 10**400,
    "", "x", "$mu", "$", "2*$wide", "$nothing", "a.b", "é\x00",
    [], [1], [1, 2], [[1, 2]],
    {}, {"a": 1}, {"kind": "ring"}, {"kind": []}, {"default": {}},
]  # fmt: skip


def places(tree: Any) -> list[tuple[Any, Any]]:
    """Return every container and key of a tree."""
    found: list[tuple[Any, Any]] = []
    keys = list(tree) if isinstance(tree, dict) else range(len(tree))
    for key in keys:
        found.append((tree, key))
        if isinstance(tree[key], dict | list):
            found += places(tree[key])
    return found


@pytest.mark.parametrize("seed", range(8))
def test_a_wrong_entry_of_any_kind_is_a_mistake_and_nothing_else(seed: int) -> None:
    rng = random.Random(seed)
    refused = 0
    for _ in range(60):
        tables = blocks()
        for _ in range(rng.randint(1, 3)):
            container, key = rng.choice(places(tables))
            what = rng.random()
            if what < 0.6:
                container[key] = rng.choice(ANYTHING)
            elif what < 0.8:
                del container[key]
            elif isinstance(container, dict):
                container[rng.choice(["extra", "description", "friction", "$mu", ""])] = 1
        try:
            file_scene(Description("fuzz.toml", tables, {})).parameters()
        except SceneError as error:
            refused += 1
            assert error.mistakes
            for each in error.mistakes:
                assert each.allowed and isinstance(each.field, str), each
            assert len({(each.field, each.allowed) for each in error.mistakes}) == len(
                error.mistakes
            )
    assert refused > 30
