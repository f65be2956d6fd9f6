"""Elasticities: by how many percent a number of a run changes if a parameter is 1 % larger.

They follow from the derivatives of the runs (`solver.derivatives`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from solver.derivatives.asked import named


def derived(names: Collection[str], parameters: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each number and each parameter of which there is a derivative among the names."""
    known = sorted(names)
    for by in parameters:
        yield from ((of, by) for of in known if named(of, by) in names)


def elasticities(
    scalars: Mapping[str, Any], parameters: Mapping[str, Any]
) -> dict[str, dict[str, float]]:
    """Return the elasticities of the numbers of a run: by number, by parameter.

    Parameters
    ----------
    scalars : numbers and derivatives by name; None where one is not known
    parameters : of the run
    """
    found: dict[str, dict[str, float]] = {}
    for of, by in derived(scalars, parameters):
        value, slope = scalars[of], scalars[named(of, by)]
        if value and slope is not None:
            found.setdefault(of, {})[by] = slope * parameters[by] / value
    return found
