"""What a user asks for: derivatives of results of runs by parameters of a scene."""

from __future__ import annotations

import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from annotated_types import Unit

from solver.errors import ModelError
from solver.parameters import is_number
from solver.results.quantities import Quantity

STEP = -1e-6
"""Difference of a parameter of a neighbouring run over its value. It is negative: a load slightly
above a whole number of increments would need one more."""

WIDER = 10.0
"""The same where more is known up to rounding only, over `STEP`: of a parameter that moves nodes,
since gaps of a contact are small differences of their positions, and of passes over a prism."""

_SHARE = 0.3
"""Time of a neighbouring run over that of the run: .15 to .3 on a punch, and .7 on a ball, where
surfaces slide far."""


_AT_A_SWITCH = 3e-5
"""Relative change of a parameter, as the widest difference: derivatives that hold for less may
differ on both sides of it."""
_DOUBTED = 1e-3
"""Largest `audit_derivatives` without a warning; usual are 1e-9 to 1e-5, and more where a result is
near zero and known up to rounding."""


AUDITED = Quantity(
    name="audit_derivatives",
    long_name="ratio of the error of derivatives by one parameter in one increment to their level",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivatives:
    """Derivatives of results by parameters.

    Attributes
    ----------
    by : names of parameters
    of : names of numbers, lines, maps or coordinates
    """

    by: tuple[str, ...]
    of: tuple[str, ...]

    def cost(self, share: float = 0.0) -> float:
        """Return the time of a run with them over that of a run without.

        ``share`` is that of a neighbouring run, if it is not followed linearly.
        """
        return 1 + (share or _SHARE) * (1 + len(self.by))

    @property
    def names(self) -> list[str]:
        """The names of the derivatives."""
        return [named(of, by) for by in self.by for of in self.of]

    def quantities(self, kind: Any, known: Mapping[str, Quantity]) -> list[Quantity]:
        """Return the declarations of ``d_<result>_d_<parameter>`` and of their ranges.

        Parameters
        ----------
        kind : class of the parameters
        known : quantities of the runs, by name

        Raises
        ------
        ModelError
            for a parameter or a result that has no derivative
        """
        hints = typing.get_type_hints(kind, include_extras=True)
        marks = {name: (hint, *_marks(hint)) for name, hint in hints.items()}
        results = [
            name
            for name, each in known.items()
            if not (each.count or each.flags or name.startswith("audit_"))
            and not (each.coordinate and each.units == "1")
        ]
        real = [name for name, each in marks.items() if float in each]
        for field, given, allowed in (("by", self.by, real), ("of", self.of, results)):
            for k, name in enumerate(given):
                if name not in allowed:
                    what = "a parameter" if field == "by" else "a result"
                    raise ModelError(f"{field}[{k}]", name, f"must be {what} with decimals")
                if name in given[:k]:
                    raise ModelError(f"{field}[{k}]", name, "is there already")
        derived = [
            replace(
                known[of],
                name=named(of, by),
                long_name=f"derivative of {known[of].long_name} by {by}",
                units=_over(known[of].units, next(_units(marks[by]), "1")),
                standard_name="",
            )
            for by in self.by
            for of in self.of
        ]
        holds = "relative change of {} up to which its derivatives hold, at most 1"
        ranges = [Quantity(name=reach(by), long_name=holds.format(by)) for by in self.by]
        return [*derived, *ranges, AUDITED]

    def notes(self, values: Mapping[Quantity, Any]) -> list[str]:
        """Return what a user must know of the values of a run."""
        there = {q.name: value for q, value in values.items() if not np.isnan(value).all()}
        lacks = [name for name in self.names if name not in there]
        notes = [f"no derivative was found for {', '.join(lacks)}"] if lacks else []
        notes += at_switches({by: there[reach(by)] for by in self.by if reach(by) in there})
        return notes + doubted({q.name: value for q, value in values.items()})

    def steps(self, parameters: Any, wider: Mapping[str, float]) -> dict[str, float]:
        """Return the difference of each parameter that is not zero.

        It is wider for some of them, by the factors ``wider``.
        """
        found = {}
        for name in self.by:
            value = getattr(parameters, name)
            if not is_number(value):
                raise ModelError(name, value, "must be a number: it is derived by")
            if value == 0:
                continue
            found[name] = value * STEP * wider.get(name, 1.0)
            try:
                replace(parameters, **{name: value + found[name]})
            except ModelError:  # at the lower end of its range
                found[name] *= -1
        return found


def named(of: str, by: str) -> str:
    """Return the name of the derivative of a result by a parameter."""
    return f"d_{of}_d_{by}"


def reach(by: str) -> str:
    """Return the name of the range in which the derivatives by a parameter hold."""
    return f"derivative_range_{by}"


def at_switches(ranges: Mapping[str, float]) -> list[str]:
    """Return warnings of parameters whose derivatives hold in such a small range only."""
    return [
        f"derivatives by {by} may be one-sided: a relative change of {least:.1e} decides "
        "whether a point yields, touches, sticks or slides"
        for by, least in ranges.items()
        if least < _AT_A_SWITCH
    ]


def doubted(values: Mapping[str, Any]) -> list[str]:
    """Return a warning where the audit of derivatives found them doubtful, or could not be made."""
    off = values.get(AUDITED.name, 0.0)
    if off <= _DOUBTED:
        return []
    if np.isnan(off):
        return ["derivatives were not audited: an increment could not be solved again"]
    return [
        f"audit_derivatives = {off:.1e}: derivatives by one parameter differ by so much when one "
        "increment is solved again; compare them with runs"
    ]


def _marks(hint: Any) -> Iterator[Any]:
    """Yield the parts of an annotation, and their parts."""
    for part in typing.get_args(hint):
        yield part
        yield from _marks(part)


def _units(marks: tuple[Any, ...]) -> Iterator[str]:
    return (mark.unit for mark in marks if isinstance(mark, Unit))


def _over(above: str, below: str) -> str:
    """Return the quotient of two units, in the notation of the CF conventions."""
    if below in ("", "1"):
        return above
    if above == below:
        return "1"
    inverse = f"({below})-1" if " " in below or below[-1].isdigit() else f"{below}-1"
    return inverse if above == "1" else f"{above} {inverse}"
