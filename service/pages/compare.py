"""What differs between runs: their parameters, and their numbers with the difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from service.pages.run import numbers_shown, parameters_shown
from solver.scenes import Scene

MOST = 6
"""Largest number of runs that are compared."""


def compared(rows: Sequence[Mapping[str, Any]], scene: Scene | None) -> dict[str, Any]:
    """Return parameters and numbers that are not the same in all runs, with the values of each."""
    return {
        "parameters": _different([parameters_shown(each, scene) for each in rows]),
        "numbers": _different([numbers_shown(each, scene) for each in rows]),
    }


def _different(runs: Sequence[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    every: dict[str, Mapping[str, Any]] = {each["name"]: each for run in runs for each in run}
    values = [{each["name"]: each["value"] for each in run} for run in runs]
    found = []
    for name, each in every.items():
        own = [run.get(name) for run in values]
        if any(value != own[0] for value in own):
            found.append({**each, "values": own})
    return found
