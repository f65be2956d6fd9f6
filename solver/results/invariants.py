"""Components of stored tensors, and the invariants derived from them.

Results store tensor components only; `component` computes an invariant when it is requested.
"""

from __future__ import annotations

import numpy as np

from solver.tensors import components, principal, to_mandel
from solver.typing import Array

PRINCIPAL = ("principal_1", "principal_2", "principal_3")
"""Principal values, the largest first."""
INVARIANTS = (*PRINCIPAL, "tresca", "hydrostatic")
"""Principal values, largest minus smallest principal value, and their mean."""


def known_components(count: int) -> tuple[str, ...]:
    """Return the names of the ``count`` components of a tensor, and of its invariants."""
    return (*components(count), *INVARIANTS)


def component(tensor: Array, name: str) -> Array:
    """Return a component or an invariant (...) of a tensor (n_components, ...).

    Parameters
    ----------
    tensor : components xx, yy, zz, xy (, yz, zx)
    name : one of `known_components`
    """
    tensor = np.asarray(tensor, dtype=float)
    names = components(len(tensor))
    if name in names:
        return np.asarray(tensor[names.index(name)])
    if name == "hydrostatic":
        return np.asarray(tensor[:3].mean(axis=0))
    values, _ = principal_of(tensor)
    if name == "tresca":
        return np.asarray(values[0] - values[2])
    return np.asarray(values[PRINCIPAL.index(name)])


def principal_of(tensor: Array) -> tuple[Array, Array]:
    """Return principal values (3, ...), the largest first, and their directions (3, 3, ...).

    The first axis of the directions is the component of the unit vector, the second the number of
    the principal value.

    Parameters
    ----------
    tensor : tensor components (n_components, ...)
    """
    shape = tensor.shape[1:]
    values, directions = principal(to_mandel(tensor).reshape(len(tensor), -1))
    return values.reshape(3, *shape), directions.reshape(3, 3, *shape)
