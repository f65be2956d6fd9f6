"""What a user asks for: derivatives of numbers of runs by parameters of a scene."""

from __future__ import annotations

import typing
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from annotated_types import Unit

from solver.errors import ModelError
from solver.parameters import is_number
from solver.results.quantities import Quantity

STEP = -1e-6
"""Difference of a parameter of a neighbouring run over its value. It is negative: a load slightly
above a whole number of increments would need one more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivatives:
    """Derivatives of numbers by parameters.

    Attributes
    ----------
    by : names of parameters
    of : names of numbers; empty for all
    """

    by: tuple[str, ...]
    of: tuple[str, ...] = ()

    def steps(self, parameters: Any) -> dict[str, float]:
        """Return the difference of each parameter.

        Raises
        ------
        ModelError
            for a parameter that is unknown, a whole number, or zero
        """
        hints = typing.get_type_hints(type(parameters), include_extras=True)
        found = {}
        for name in self.by:
            if name not in hints or float not in (hints[name], *_marks(hints[name])):
                known = [each for each, hint in hints.items() if float in (hint, *_marks(hint))]
                raise ModelError("derivatives.by", name, f"must be among {', '.join(known)}")
            value = getattr(parameters, name)
            if not is_number(value) or value == 0:
                raise ModelError(name, value, "must differ from 0: derivatives are taken by it")
            try:
                replace(parameters, **{name: value * (1 + STEP)})
                found[name] = value * STEP
            except ModelError:  # at the lower end of its range
                found[name] = -value * STEP
        return found

    def wants(self, name: str) -> bool:
        """Whether derivatives of a number are asked for."""
        return not self.of or name in self.of

    def quantity(self, of: Quantity, by: str, kind: Any) -> Quantity:
        """Return the declaration of the derivative of a number by a parameter of a class."""
        hint = typing.get_type_hints(kind, include_extras=True)[by]
        below = next((mark.unit for mark in _marks(hint) if isinstance(mark, Unit)), "1")
        return replace(
            of,
            name=f"d_{of.name}_d_{by}",
            long_name=f"derivative of {of.long_name} by {by}",
            units=_over(of.units, below),
            standard_name="",
        )


def _marks(hint: Any) -> Iterator[Any]:
    """Yield the marks of an annotation."""
    for part in typing.get_args(hint):
        yield part
        yield from _marks(part)


def _over(above: str, below: str) -> str:
    """Return the quotient of two units, in the notation of the CF conventions."""
    if below in ("", "1"):
        return above
    inverse = f"({below})-1" if " " in below or below[-1].isdigit() else f"{below}-1"
    return inverse if above == "1" else f"{above} {inverse}"
