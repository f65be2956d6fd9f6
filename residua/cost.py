"""The estimated cost of a study, as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from studies.definition.study import Study
from studies.execution.estimate import estimate
from studies.storage.store import Store

_LONG = 3600.0
"""Seconds of processor time above which `residua run` prints the estimate before it begins."""

_SHORT = 8.0
"""Likely seconds of processor time up to which `residua run` starts no workers: to start them takes
more than a second, and two would save no more than half of the time."""

ALONE = 60.0
"""Seconds of processor time after which a study that seemed to be short gets workers after all."""


def dry_run(study: Study, store: Store) -> str:
    """Return the estimated cost of computing `study` into `store`."""
    found = estimate(study, store)
    table = (f"{name:<16}{text}" for name, text in found.costs(study.kind.chooses).items())
    return "\n".join([f"{study.name}: nothing is computed or written", *table])


@dataclass(frozen=True, slots=True)
class Foreseen:
    """What `residua run` tells and does because of the time that a study is likely to take.

    Attributes
    ----------
    warning : one line if it takes more than an hour of processor time; else empty
    short : whether it takes less than workers need to start
    """

    warning: str = ""
    short: bool = False

    @classmethod
    def of(cls, study: Study, store: Store) -> Self:
        """Return it for the runs of a study that the store lacks."""
        try:
            found = estimate(study, store)
        except Exception:  # a damaged catalogue must not prevent computing, which makes it again
            return cls()
        if found.cpu_seconds is None:
            return cls()
        likely = found.cpu_seconds[1]
        text = f"{study.name}: {found.time} of processor time; --dry-run shows more"
        return cls(text if likely >= _LONG else "", likely <= _SHORT)
