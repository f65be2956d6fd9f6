"""Imports stand at the top of a module, for types as for values; only doors import later.

No type is ignored.
"""

from __future__ import annotations

from dataclasses import fields
from importlib import import_module
from inspect import getsource
from pkgutil import resolve_name

import pytest

from solver.late import Late
from solver.results.outputs import MODULES
from solver.results.quantities import DECLARING
from solver.rolling.scenes.wheel_rail import _checked
from solver.shipped import SCENES
from tests.architecture.sources import ROOT, importing, modules

DOORS = {
    "solver": {
        "solver/late.py: front",  # of packages
        "solver/late.py: Late.__call__",  # a scene names what computes it
        "solver/results/quantities.py: Quantities._all",  # what is declared, once it is asked for
        "solver/results/outputs.py: outputs",
        "solver/results/mesh_fields.py: to_meshio",  # a library that nothing else needs
    },
}
"""The functions of a package that import; a package that is not here may import in others too."""


def texts(package: str) -> dict[str, str]:
    return {path.as_posix(): (ROOT / path).read_text() for path in modules(package)}


@pytest.mark.parametrize("package", DOORS)
def test_no_type_is_ignored(package: str) -> None:
    assert not [path for path, text in texts(package).items() if "type: ignore" in text]


@pytest.mark.parametrize("package", DOORS)
def test_no_import_is_for_types_alone(package: str) -> None:
    assert not [path for path, text in texts(package).items() if "TYPE_CHECKING" in text]


@pytest.mark.parametrize("package", DOORS)
def test_functions_import_at_doors_alone(package: str) -> None:
    found = texts(package).items()
    assert {f"{path}: {name}" for path, text in found for name in importing(text)} == DOORS[package]


@pytest.mark.parametrize("package", DOORS)
def test_types_of_arrays_are_named_once(package: str) -> None:
    """Others than these four, such as ``NDArray[Any]``, are written out."""
    typed = f"{package}/typing.py"
    ours = getsource(import_module(f"{package}.typing"))
    kinds = [f"NDArray[np.{kind}]" for kind in ("float64", "int64", "bool_", "complex128")]
    assert all(kind in ours for kind in kinds)
    found = texts(package).items()
    assert not [p for p, text in found if p != typed and any(kind in text for kind in kinds)]


def test_every_text_of_a_scene_names_a_function() -> None:
    given = [getattr(scene, item.name) for scene in SCENES.values() for item in fields(scene)]
    flat = [each for one in given for each in (one if isinstance(one, tuple) else (one,))]
    named = [each for each in (*flat, _checked) if isinstance(each, Late)]
    assert len(named) > 10
    for each in named:
        function = resolve_name(each.name)
        assert (function.__module__, function.__qualname__) == (each.__module__, each.__qualname__)


def test_every_module_that_is_named_exists() -> None:
    list(DECLARING)  # those that no test has needed yet
    for module in (*DECLARING, *MODULES):
        import_module(module)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("def f():\n    import numpy", {"f"}),
        ("def f():\n    if x:\n        from a import b", {"f"}),
        ("class A:\n    def g(self):\n        return import_module(x)", {"A.g"}),
        ("class A:\n    def g(self):\n        def h():\n            import b", {"A.g"}),
        ("import numpy\nx = import_module('a')", set()),
    ],
)
def test_an_import_in_a_function_is_found(text: str, found: set[str]) -> None:
    assert importing(text) == found
