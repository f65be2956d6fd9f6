"""Records that a module keeps for several of its tests."""

from __future__ import annotations

from dataclasses import replace

from solver import Record


def kept(record: Record) -> Record:
    """Return a record without the way to its fields at the nodes.

    That way holds the whole run, with its meshes, states and factors: up to 100 MB each.
    """
    return replace(record, mesh=None)
