"""The estimated cost of a study, as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from studies.definition.study import Study
from studies.execution.estimate import Estimate, estimate
from studies.storage.store import Store

_LONG = 3600.0
"""Seconds of processor time above which `residua run` prints the estimate before it begins."""

_SHORT = 8.0
"""Likely seconds of processor time up to which `residua run` starts no workers: to start them takes
more than a second, and two would save no more than half of the time."""

ALONE = 60.0
"""Seconds of processor time after which a study that seemed to be short gets workers after all."""

_UNITS = ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (1.0, "seconds"))


def dry_run(study: Study, store: Store) -> str:
    """Return the estimated cost of computing `study` into `store`."""
    found = estimate(study, store)
    unknown = "not known"
    lines = {
        "runs": f"at most {found.runs}, of which some may be there"
        if study.kind.chooses
        else f"{found.runs} in all, {found.to_compute} to compute",
        "loading paths": f"{found.paths} to walk",
        "unknowns": unknown if found.unknowns is None else f"at most {found.unknowns} a run",
        "increments": unknown
        if found.increments is None
        else f"{found.increments} in all, at most {found.longest} on a path",
        "processor time": _time(found) or unknown,
        "memory": unknown if found.memory is None else f"about {_size(found.memory)} a worker",
        "disk": f"about {_size(found.bytes)}",
        "estimated from": found.basis,
    }
    table = (f"{name:<16}{text}" for name, text in lines.items())
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
        text = f"{study.name}: {_time(found)} of processor time; --dry-run shows more"
        return cls(text if likely >= _LONG else "", likely <= _SHORT)


def _time(found: Estimate) -> str:
    if found.cpu_seconds is None:
        return ""
    low, likely, high = found.cpu_seconds
    size, unit = next((each for each in _UNITS if likely >= 2 * each[0]), _UNITS[-1])
    return f"about {_short(likely / size)} {unit} ({_short(low / size)} to {_short(high / size)})"


def _short(number: float) -> str:
    """Return a number with two significant digits."""
    return f"{number:.0f}" if number >= 10 else f"{number:.1f}"


def _size(count: int) -> str:
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.0f} MB"
