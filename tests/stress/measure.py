"""What a scenario measures, and how it is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import psutil

from tests.service.servers import Server


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured number.

    Attributes
    ----------
    what, unit : what was measured
    value : the number
    most : the largest that is allowed; None for a number that is only told
    """

    what: str
    value: float
    unit: str = ""
    most: float | None = None

    @property
    def good(self) -> bool:
        """Whether the number is allowed; NaN is not."""
        return self.most is None or self.value <= self.most

    @property
    def measured(self) -> str:
        """The number and its unit."""
        number = f"{self.value:d}" if isinstance(self.value, int) else f"{self.value:.3g}"
        return f"{number} {self.unit}".strip()

    def __str__(self) -> str:
        bound = "" if self.most is None else f"   (at most {self.most:g})"
        return f"  {'ok  ' if self.good else 'FAIL'} {self.what}: {self.measured}{bound}"


def table(found: Mapping[str, Sequence[Figure]]) -> str:
    """Return the figures of all scenarios in aligned columns, those not allowed marked."""
    rows = [("scenario", "figure", "measured", "at most", "")]
    for name, figures in found.items():
        for each in figures:
            most = "" if each.most is None else f"{each.most:g}"
            rows.append((name, each.what, each.measured, most, "" if each.good else "FAIL"))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def quantile(values: Sequence[float], share: float) -> float:
    """Return the value that ``share`` of all values do not exceed; NaN for none."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else float("nan")


def process_of(server: Server) -> psutil.Process:
    """Return the service's own process."""
    assert server.process is not None
    return psutil.Process(server.process.pid)


def cpu_seconds(process: psutil.Process) -> float:
    """Return the CPU time a process has taken, without its children's."""
    times = process.cpu_times()
    return times.user + times.system


def megabytes(process: psutil.Process) -> float:
    """Return the memory of a process that holds no file [MB].

    Pages of libraries count for no process: they become those of one process alone when the last
    other one that has loaded the library ends.
    """
    memory = process.memory_info()
    return (memory.rss - memory.shared) / 1e6


def restarted(server: Server, **settings: str) -> None:
    """Start a service again with other settings."""
    server.stop()
    server.settings |= settings
    server.start()
