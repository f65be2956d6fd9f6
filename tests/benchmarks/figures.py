"""Work-precision plots: CPU time against error, both logarithmic; down and left is better."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from tests.benchmarks.measure import Point

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
MARKERS = "osD^vP*"
FLOOR = 1e-7
"""Errors below are drawn here: rounding and tolerances of the iteration."""


def draw(
    points: Sequence[Point],
    measures: Mapping[str, str],
    series: Sequence[str],
    title: str,
    path: Path,
) -> None:
    """Write a PNG with a panel for every measure and a line for every series."""
    columns = min(2, len(measures)) if len(measures) != 3 else 3
    rows = -(-len(measures) // columns)
    figure = Figure(figsize=(5.2 * columns, 3.9 * rows + 0.9), dpi=110, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, (measure, text) in zip(panels, measures.items(), strict=False):
        for k, name in enumerate(series):
            _line(panel, [p for p in points if p.series == name], measure, k)
        for p in points:
            if p.series == "default" and measure in p.errors:
                panel.plot(
                    p.cpu,
                    max(p.errors[measure], FLOOR),
                    "o",
                    markersize=15,
                    markerfacecolor="none",
                    markeredgecolor="black",
                    label="default",
                )
        panel.set(xscale="log", yscale="log", xlabel="CPU time [s]", ylabel="error")
        panel.set_title(text, fontsize=10)
        panel.grid(which="major", alpha=0.35)
        _ticks(panel.xaxis, *panel.get_xlim())
        _ticks(panel.yaxis, *panel.get_ylim())
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 8))
    figure.suptitle(title)
    figure.savefig(path)


def draw_levels(points: Sequence[Point], measure: str, text: str, path: Path) -> None:
    """Write a PNG with a line for every series, its points named by their settings."""
    figure = Figure(figsize=(6.4, 4.4), dpi=130, layout="constrained")
    panel = figure.subplots()
    names = list(dict.fromkeys(p.series for p in points))
    for k, name in enumerate(names):
        _line(panel, [p for p in points if p.series == name], measure, k)
    for p in points:
        panel.annotate(
            p.setting,
            (p.cpu, p.errors[measure]),
            xytext=(6, 6),
            textcoords="offset points",
            fontsize=9,
            color=COLOURS[names.index(p.series) % len(COLOURS)],
        )
    panel.set(xscale="log", yscale="log", xlabel="processor time of a run [s]", ylabel=text)
    panel.margins(x=0.15, y=0.12)
    panel.grid(which="major", alpha=0.35)
    _ticks(panel.xaxis, *panel.get_xlim())
    _ticks(panel.yaxis, *panel.get_ylim())
    panel.legend()
    figure.savefig(path)


def _line(panel: Axes, points: Sequence[Point], measure: str, k: int) -> None:
    points = [p for p in points if measure in p.errors]
    if points:
        panel.plot(
            [p.cpu for p in points],
            [max(p.errors[measure], FLOOR) for p in points],
            color=COLOURS[k % len(COLOURS)],
            marker=MARKERS[k % len(MARKERS)],
            markersize=6,
            linewidth=1.4,
            label=points[0].series,
        )


def _ticks(axis: Axis, low: float, high: float) -> None:
    """Label decades, and 2 and 5 between them where there are few."""
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 300 * low else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    axis.set_minor_locator(NullLocator())
