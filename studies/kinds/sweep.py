"""The usual kind of study, a sweep: it has the runs of its axes."""

from __future__ import annotations

from studies.kinds.kind import Kind


class SweepStudy(Kind):
    """A study without an entry of another kind."""

    name = "sweep"
    chooses = False
    everywhere = True
    of_runs = True

    def most_runs(self, places: int) -> int:
        """Return the number of places."""
        return places

    def stage(self, places: int, ended: int, told: str) -> str:
        """Return nothing: its progress says all."""
        return ""
