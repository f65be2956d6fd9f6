"""Names of axes and tensor components, their scaling, and invariants of symmetric tensors.

Inside the solver strain and stress are Mandel vectors, components first, points last:
``(xx, yy, zz, sqrt(2) xy)`` in two dimensions, followed by ``(sqrt(2) yz, sqrt(2) zx)`` in three.
The dot product of two vectors is the double contraction of the tensors, the norm is the tensor
norm, and a tangent that has a potential is a symmetric matrix. Results leave the solver as tensor
components (``xy`` without the factor): `to_tensor`.

Results store tensor components only; `component` computes an invariant when it is requested.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from solver.typing import Array

AXES = ("x", "y", "z")
"""Names of coordinates: two in the plane, three in space."""
_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")
SQRT2 = float(np.sqrt(2.0))
_PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Row and column of each Mandel component; in two dimensions the first four."""
PAIRS = ((0, 1), (0, 2), (1, 2))
"""Pairs of principal directions."""


def components(count: int) -> tuple[str, ...]:
    """Return the names of the 4 components of a tensor in two dimensions, or of the 6 in three.

    Raises `ValueError` for any other count.
    """
    if count not in (4, 6):
        raise ValueError(f"{count} components: must be 4 or 6")
    return _COMPONENTS[:count]


def to_tensor(mandel: Array) -> Array:
    """Return tensor components ``(n_components, ...)`` from Mandel components of that shape."""
    tensor = np.array(mandel, dtype=float)
    tensor[3:] /= SQRT2
    return tensor


def to_mandel(tensor: Array) -> Array:
    """Return Mandel components ``(n_components, ...)`` from tensor components of that shape."""
    mandel = np.array(tensor, dtype=float)
    mandel[3:] *= SQRT2
    return mandel


def identity(n_components: int) -> Array:
    """Return the Mandel components (n_components,) of the unit tensor."""
    one = np.zeros(n_components)
    one[:3] = 1.0
    return one


@cache
def projections(n_components: int) -> tuple[Array, Array]:
    """Return the matrices that give the trace times the identity, and the deviator; read-only.

    Both have the shape (n_components, n_components), on Mandel components.
    """
    one = identity(n_components)
    trace = np.outer(one, one)
    deviatoric = np.eye(n_components) - trace / 3.0
    for each in (trace, deviatoric):
        each.flags.writeable = False
    return trace, deviatoric


def deviator(mandel: Array) -> Array:
    """Return the deviator (n_components, ...) of Mandel components of that shape."""
    out = np.array(mandel)
    out[:3] -= np.add.reduce(mandel[:3]) / 3  # for few points in half the time of `mean`
    return out


def von_mises(mandel: Array) -> Array:
    """Return the von Mises stress (...) from Mandel components (n_components, ...) [MPa]."""
    return np.asarray(np.sqrt(1.5 * np.add.reduce(deviator(mandel) ** 2)))


def principal(mandel: Array) -> tuple[Array, Array]:
    """Return the principal values (3, n), the largest first, and their directions.

    In the directions (3, 3, n) the first axis is the component of the unit vector, the second its
    number. Values of a tensor that is not finite are NaN.

    Parameters
    ----------
    mandel : (n_components, n)
    """
    full = np.zeros((mandel.shape[1], 3, 3))
    for value, (i, j) in zip(mandel, _PLACES, strict=False):
        full[:, i, j] = full[:, j, i] = value if i == j else value / SQRT2
    unknown = ~np.isfinite(full).all(axis=(1, 2))
    full[unknown] = 0.0
    values, directions = np.linalg.eigh(full)
    values[unknown] = np.nan
    return values.T[::-1], directions.transpose(1, 2, 0)[:, ::-1]


def dyad(directions: Array, i: int, j: int, n_components: int) -> Array:
    """Return the unit tensor (n_components, n), Mandel, of two principal directions.

    It is e_i e_i, or (e_i e_j + e_j e_i) / sqrt(2); these tensors are an orthonormal basis.
    """
    a, b = directions[:, i], directions[:, j]
    rows = [
        a[k] * b[k] if k == m else (a[k] * b[m] + a[m] * b[k]) / SQRT2
        for k, m in _PLACES[:n_components]
    ]
    return np.stack(rows) * (1.0 if i == j else SQRT2)


def not_below_zero(values: Array) -> Array:
    """Return values without negative ones, which interpolation may cause, replaced by zero."""
    return np.maximum(values, 0.0)


def stress_difference(stress: Array, plane: tuple[str, str] = ("x", "y")) -> Array:
    """Return sigma1 - sigma2 (...) in a plane, from tensor components (n_components, ...) [MPa].

    Parameters
    ----------
    plane : names of its two axes
    """
    names = components(len(stress))

    def component(*axes: str) -> Array:
        return stress[next(k for k, name in enumerate(names) if set(name) == set(axes))]

    a, b = plane
    return np.hypot(component(a, a) - component(b, b), 2 * component(a, b))


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
