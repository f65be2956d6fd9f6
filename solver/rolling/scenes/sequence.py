"""Passes with different loads: a sequence, or random traffic about the parameters of a run.

In random traffic the loads have a normal distribution that is cut off at three standard deviations,
as dynamic wheel loads have: J. Eisenmann, Germans gain a better understanding of track structure,
Railway Gazette International 128 (1972) 305-308. Their standard deviation is 0.1 (track in very
good condition) to 0.3 (poor condition) of the load, more above 60 km/h.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np

from solver.errors import ModelError
from solver.parameters import is_number
from solver.typing import Array

_TIMES = "times"
_MOST = 1000
"""Largest number of passes of a sequence, as of a run."""


def block_of(
    parameters: Any, sequence: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[Any, ...]:
    """Return the parameters of each pass of a sequence; passes of one entry share an object.

    Parameters
    ----------
    parameters : of the run; they are those of a pass unless its entry gives others
    sequence : a table for each entry
    names : parameters that may differ from pass to pass

    Raises
    ------
    ModelError
        naming the entry and its field, if a parameter is wrong or cannot differ between passes
    """
    block: list[Any] = []
    for number, entry in enumerate(sequence):
        own: dict[str, Any] = dict(entry)
        try:
            times = _times(own.pop(_TIMES, 1))
            for name, value in own.items():
                if name not in names:
                    raise ModelError(name, value, f"must be one of {', '.join(names)}, {_TIMES}")
            block += [replace(parameters, sequence=(), **own)] * times
            if len(block) > _MOST:
                raise ModelError(_TIMES, times, f"must make at most {_MOST} passes in all")
        except ModelError as error:
            field = f"sequence[{number}].{error.field}"
            raise ModelError(field, error.value, error.allowed) from None
    return tuple(block)


def as_given(parameters: Any, error: ModelError) -> ModelError:
    """Return an error of a pass that names what gives it its value: its entry, or the spread.

    Parameters
    ----------
    parameters : of the run
    error : it names a parameter of a pass, and its value
    """
    name, value = error.field, error.value
    each = {id(own): own for own in parameters.block}.values()  # one for each entry
    for number, (entry, own) in enumerate(zip(parameters.sequence, each, strict=False)):
        if name in entry and getattr(own, name) == value:
            return ModelError(f"sequence[{number}].{name}", value, error.allowed)
    spread = getattr(parameters, "lateral_spread", 0.0)
    if not spread or name != "lateral_position" or value == parameters.lateral_position:
        return error
    return ModelError(
        "lateral_spread", spread, f"takes passes to {name} = {value}: {error.allowed}"
    )


def _times(value: Any) -> int:
    """Return the number of passes of an entry."""
    if not is_number(value) or not 1 <= value <= _MOST or value != int(value):
        raise ModelError(_TIMES, value, f"must be an integer from 1 to {_MOST}")
    return int(value)


CUT = 3.0
"""Largest deviation from the mean, in standard deviations."""


def deviations(seed: int, passes: int, count: int) -> Array:
    """Return deviations (passes, count) from the mean, in standard deviations.

    The deviations of a pass do not depend on the number of later passes.
    """
    normal = NormalDist()
    least, most = normal.cdf(-CUT), normal.cdf(CUT)
    share = least + (most - least) * np.random.default_rng(seed).random((passes, count))
    return np.array([normal.inv_cdf(each) for each in share.ravel()]).reshape(share.shape)


def check_spreads(parameters: Any, spreads: Sequence[str]) -> None:
    """Raise `ModelError` for a spread that moves a parameter beyond its limits.

    Parameters
    ----------
    spreads : names of the standard deviations, in the order of ``parameters.deviating``
    """
    for number, name in enumerate(spreads):
        for way in (-CUT, CUT):
            deviation = [way if other == number else 0.0 for other in range(len(spreads))]
            try:
                parameters.deviating(deviation)
            except ModelError as error:
                reached = f"makes {error.field} = {error.value:g} at {CUT:g} standard deviations"
                allowed = f"{reached}, which {error.allowed}"
                raise ModelError(name, getattr(parameters, name), allowed) from None
