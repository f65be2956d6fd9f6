"""Elasticities: by how many percent a number of a run changes if a parameter is 1 % larger.

They follow from the derivatives of the runs (`solver.derivatives`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from solver.derivatives.asked import named
from solver.typing import Array


def derived(names: Collection[str], parameters: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each number and each parameter of which there is a derivative among the names."""
    known = sorted(names)
    for by in parameters:
        yield from ((of, by) for of in known if named(of, by) in names)


def elasticities(
    values: Mapping[str, Any], parameters: Mapping[str, Any]
) -> dict[str, dict[str, Array]]:
    """Return the elasticities of the numbers of runs that are known: by number, by parameter.

    Parameters
    ----------
    values : numbers and derivatives by name, of a run or of several; None where one is not known
    parameters : of the runs
    """
    found: dict[str, dict[str, Array]] = {}
    for of, by in derived(values, parameters):
        if values[of] is not None and values[named(of, by)] is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                each = np.ravel(np.divide(values[named(of, by)] * parameters[by], values[of]))
            if (known := each[np.isfinite(each)]).size:
                found.setdefault(of, {})[by] = known
    return found
