"""Names that parameters, outputs and axes of labels must not have."""

from __future__ import annotations

from collections.abc import Collection

from solver.results.quantities import IN_SPACE, QUANTITIES

RESERVED = frozenset({
    "status", "message", "id", "scene", "name", "title", "created",  # every data set
    "of", "by", "within",  # queries
    "case", "cell", "run", "round", "tried", "runs",  # points, refinements and goals
    "time", "mesh",  # fields that are kept
    "parameter", "parameter_2", "covariance", "correlation", "condition", "misfit", "row", "lines",
    "place", "line_of", "line_over", "line_at", "line_unit", "measured", "fitted",  # fits
})  # fmt: skip
"""Names that data sets and queries use for something else than parameters and results."""
_BEGINNINGS = ("cell_", "mesh_", "run_", "tried_")
_ENDS = ("_low", "_high", "_sigma", "_error", "_fraction")
"""Ends of names that are made from those of parameters and results."""


def in_use(name: str, others: Collection[str]) -> bool:
    """Whether a data set or a query may have this name for something else than a parameter.

    Parameters
    ----------
    others : names of all parameters; a name made from one of them is in use
    """
    made = {name.removesuffix(end) for end in _ENDS} - {name}
    if name in RESERVED or name.startswith(_BEGINNINGS):
        return True
    return any(each in names for names in (others, QUANTITIES, IN_SPACE) for each in made)
