"""A short view of a study: how far it is, its axes, its audit, its failed runs.

As text, and as HTML in a notebook.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from studies.definition.sweep import labels
from studies.definition.vocabulary import MISSING, OK
from studies.views.columns import aligned, value_text
from studies.views.figures import Worst

WIDTH = 28
"""Number of characters of a bar."""

NAMED = 4
"""Largest number of values of an axis, and of runs of a kind, that are named."""

_LONGEST = 100
"""Largest number of characters of a message."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """A run that has no result: where it is on the axes, its status, and the reason."""

    place: str
    status: str
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A study in a few lines; a notebook shows it as HTML.

    Attributes
    ----------
    name, scene, status : of the study
    progress : completed fraction of the work, 0 to 1
    counts : number of runs by status
    axes : name of each axis, with its values in words
    audit : the figure of the audit nearest to its limit, with the place of its run; None if there
        is none
    failed : the first failed runs
    """

    name: str
    scene: str
    status: str
    progress: float
    counts: Mapping[str, int]
    axes: Mapping[str, str]
    audit: tuple[Worst, str] | None
    failed: Sequence[Failed]

    def __str__(self) -> str:
        """Return the view as text."""
        first = f"{self.name}: scene {self.scene}, {self.standing}"
        rows = aligned(self.rows) if self.rows else ""
        return f"{first}\n{bar(self.progress)}\n{rows}".rstrip()

    def _repr_html_(self) -> str:
        """Return the view as a notebook shows it."""
        from studies.views.html import templates  # loads jinja

        return templates("studies.views").get_template("summary.html").render(of=self)

    @property
    def standing(self) -> str:
        """The status, with the number of runs by status."""
        counted = ", ".join(f"{count} {status}" for status, count in self.counts.items())
        return f"{self.status} ({counted})" if counted else self.status

    @property
    def lost(self) -> int:
        """Number of failed runs."""
        waits = (OK, MISSING, "pending")
        return sum(count for status, count in self.counts.items() if status not in waits)

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Names and texts: the axes, the worst figure of the audit, failed runs."""
        rows = list(self.axes.items())
        if self.audit:
            figure, place = self.audit
            value, limit = value_text(figure.value), value_text(figure.limit)
            where = f" at {place}" if place else ""
            rows.append(("worst of the audit", f"{figure.name} = {value}, limit {limit}{where}"))
        for each in self.failed:
            rows.append((each.status, f"{each.place}: {each.message}"[:_LONGEST]))
        if (more := self.lost - len(self.failed)) > 0:
            rows.append(("", f"and {more} more failed runs"))
        return rows


def summary_of(
    detail: Mapping[str, Any], audit: tuple[Worst, str] | None, failed: Sequence[Failed]
) -> Summary:
    """Return the view of a study of a service, from what it tells: its ``GET /studies/{id}``."""
    return Summary(
        name=detail["name"],
        scene=_called(detail.get("scene_name", detail["scene"]), detail["scene"]),
        status=detail["status"],
        progress=detail["progress"] / 100.0,
        counts=detail["counts"],
        axes={name: values_text(labels(name, axis)) for name, axis in detail["sweep"].items()},
        audit=audit,
        failed=failed[:NAMED],
    )


def _called(name: str, known: str) -> str:
    """Return how a scene is called: its name, of a posted one with the beginning of its id."""
    return name if name == known else f"{name} ({known[:8]}…)".lstrip()


def bar(fraction: float) -> str:
    """Return a bar with its percentage."""
    filled = round(WIDTH * fraction)
    return f"{'█' * filled}{'·' * (WIDTH - filled)} {100 * fraction:3.0f} %"


def values_text(values: Sequence[Any], unit: str = "", most: int = NAMED) -> str:
    """Return the values of an axis, of more than ``most`` the ends and their number."""
    if len(values) > most:
        text = f"{value_text(values[0])} … {value_text(values[-1])} ({len(values)})"
    else:
        text = ", ".join(map(value_text, values))
    return f"{text} {unit}".rstrip()
