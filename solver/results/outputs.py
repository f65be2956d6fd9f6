"""Outputs that scene files ask for by a word.

An output says its word where it is defined, and what a scene must have for it. It is a function of
a run, or a frozen dataclass that is called with a run and whose fields are its parameters; a field
``body`` is the name of a body. Such a class may have ``watch(system, converged)``, which gives
numbers of every increment (quantities over the dimension ``increment``), and ``warnings(run)``,
which gives texts for the user.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple, TypeVar

from solver.errors import ModelError
from solver.parts import load_own_parts, run_again

Need = Literal["map", "profile", "s", "surfaces", "contact", "release"]
"""A grid, depth profiles, positions along a surface, a contact surface of every body, a contact
pair, a last stage that releases the bodies."""
T = TypeVar("T", bound=Callable[..., Any])


class NamedOutput(NamedTuple):
    """What makes an output, and what a scene must have for it."""

    make: Callable[..., Any]
    needs: tuple[Need, ...]

    @property
    def parametric(self) -> bool:
        """Whether it is made of parameters."""
        return dataclasses.is_dataclass(self.make)


_OUTPUTS: dict[str, NamedOutput] = {}


def output(word: str, *needs: Need) -> Callable[[T], T]:
    """Return the decorator that gives an output its word.

    Raises
    ------
    ModelError
        when another one has the word
    """

    def named(make: T) -> T:
        before = _OUTPUTS.get(word)
        if before is not None and not run_again(before.make, make):
            raise ModelError("output", word, f"is the word of {before.make.__qualname__} already")
        _OUTPUTS[word] = NamedOutput(make, needs)
        return make

    return named


def outputs() -> Mapping[str, NamedOutput]:
    """Return word -> output, those of files of one's own too.

    Those of the package are complete when `solver.scenes` has been imported.
    """
    load_own_parts()
    return _OUTPUTS
