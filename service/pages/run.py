"""What pages of runs show: parameters, numbers, the audit in words, and what differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from service.pages.study import rank
from solver.audit.figures import LIMITS
from solver.results.quantities import QUANTITIES
from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.numbers import rounding
from studies.storage.dataset import attributes_of
from studies.views.columns import COMPUTED, computed_text, unit_text
from studies.views.rules import PRODUCTS, group_of, meter


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of the audit.

    Attributes
    ----------
    name, words, unit, value : what it is
    limit : above it the run fails; None if there is none, or it depends on the run
    share : how far the figure is on the way to the limit, in decades, from 0 to 1
    """

    name: str
    words: str
    unit: str
    value: float | None
    limit: float | None

    @property
    def share(self) -> float:
        """Return the length of its `meter`."""
        return meter(self.value or 0.0, self.limit or 0.0)

    @property
    def kept(self) -> bool:
        """Whether the value keeps its limit."""
        return self.limit is None or (self.value is not None and self.value <= self.limit)


def audited(run: Mapping[str, Any], scene: Scene | None) -> dict[str, list[Figure]]:
    """Return the figures of the audit of a run: those with a limit of their own, and the others."""
    found = [
        Figure(
            name=name,
            words=words_of(name, scene),
            unit=unit_of(name, scene),
            value=value,
            limit=LIMITS.get(name),
        )
        for name, value in run["scalars"].items()
        if group_of(name) == "audit"
    ]
    return {
        "limited": [each for each in found if each.limit is not None],
        "others": [each for each in found if each.limit is None],
    }


def numbers_shown(run: Mapping[str, Any], scene: Scene | None) -> list[dict[str, Any]]:
    """Return name, meaning, unit and value of the numbers of a run that are not of the audit.

    As in tables, a number is zero where it is rounding of the largest one of its unit.
    """
    found = []
    for name, value in run["scalars"].items():
        if group_of(name) == "audit":
            continue
        each = {"name": name, "words": words_of(name, scene), "unit": unit_of(name, scene)}
        found.append(each | {"value": _in_words(name, value)})
    levels: dict[str, float] = {}
    sized = [each for each in found if each["unit"] and isinstance(each["value"], float)]
    for each in sized:
        levels[each["unit"]] = max(levels.get(each["unit"], 0.0), abs(each["value"]))
    for each in sized:
        floor = rounding(each["unit"], levels[each["unit"]])
        if abs(each["value"]) < floor and each["name"] not in PRODUCTS:
            each["value"] = 0.0
    return sorted(found, key=lambda each: rank(each["name"]))


def parameters_shown(run: Mapping[str, Any], scene: Scene | None) -> list[dict[str, Any]]:
    """Return name, meaning, unit and value of each parameter; whether it is the scene's default."""
    known = parameters_of(scene) if scene else {}
    return [
        {
            "name": name,
            "words": known[name].description if name in known else "",
            "unit": unit if (unit := known[name].unit if name in known else "") != "1" else "",
            "value": computed_text(value, _computed(run, name)),
            "usual": name in known and known[name].default == value,
        }
        for name, value in run["parameters"].items()
    ]


def _computed(run: Mapping[str, Any], parameter: str) -> str:
    """Return the word of the parameter with which a run was computed; empty if it has none."""
    value = run["scalars"].get(name := f"{COMPUTED}{parameter}")
    return "" if value is None else str(_in_words(name, value))


def _in_words(name: str, value: Any) -> Any:
    """Return a flag as its word, and any other value as it is."""
    meanings = QUANTITIES[name].flags if name in QUANTITIES else None
    return meanings(int(value)).name.lower() if meanings and value is not None else value


def words_of(name: str, scene: Scene | None) -> str:
    """Return the meaning of a number."""
    return str(attributes_of(name, scene).get("long_name", name))


def unit_of(name: str, scene: Scene | None) -> str:
    """Return the unit of a number; empty for a ratio."""
    return unit_text(attributes_of(name, scene).get("units"))


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
