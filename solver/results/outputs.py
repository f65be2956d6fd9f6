"""Outputs that scene files request by a word.

The definition of an output states its word and its requirements on a scene. An output is a
function of a run, or a frozen dataclass that is called with a run: its fields are parameters, and a
field ``body`` is the name of a body. Such a class may have ``watch(system, converged)``, which
returns numbers of every increment (quantities over the dimension ``increment``), and
``warnings(run)``, which returns texts for the user.

An output of a scene may refuse (`ModelError`) what runs cannot have: ``fits(parameters, view)``
when a study is read, where ``view()`` makes the `View`, and ``before(parameters, system, view)``
before the first increment of a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Literal, NamedTuple, TypeVar

from solver.errors import ModelError
from solver.parts import load_own_parts, run_again

Need = Literal["map", "profile", "s", "surfaces", "contact", "release", "crack"]
"""Requirements of an output: a map grid, depth profiles, positions s along a surface, a contact
surface of every body, a contact pair, a last stage that releases the bodies, a body with cracks."""
T = TypeVar("T", bound=Callable[..., Any])


class NamedOutput(NamedTuple):
    """The function or class of an output, and its requirements on a scene."""

    make: Callable[..., Any]
    needs: tuple[Need, ...]

    @property
    def parametric(self) -> bool:
        """Whether it has parameters."""
        return dataclasses.is_dataclass(self.make)


_OUTPUTS: dict[str, NamedOutput] = {}
MODULES = tuple(
    f"solver.results.{module}"
    for module in (
        "contact", "cracks", "fatigue", "figures", "increments", "indentation", "maps", "places",
        "singularity", "surface_crack", "wear",
    )
)  # fmt: skip
"""Modules that define outputs of scene files, or quantities of these."""


def output(word: str, *needs: Need) -> Callable[[T], T]:
    """Return the decorator that registers an output under a word.

    Raises
    ------
    ModelError
        if another output has the word
    """

    def named(make: T) -> T:
        before = _OUTPUTS.get(word)
        if before is not None and not run_again(before.make, make):
            raise ModelError("output", word, f"is the word of {before.make.__qualname__} already")
        _OUTPUTS[word] = NamedOutput(make, needs)
        return make

    return named


def outputs() -> Mapping[str, NamedOutput]:
    """Return the outputs by word, including those of the user's files."""
    for module in MODULES:
        import_module(module)
    load_own_parts()
    return _OUTPUTS
