"""The command: measure, draw, write, print."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tests.benchmarks import (
    accuracy,
    figures,
    growth,
    hertz,
    memory,
    prism,
    punch,
    rolling,
    skips,
    stages,
    steady,
    sweep,
    walls,
)
from tests.benchmarks.measure import REPEATS, Point
from tests.benchmarks.report import conditions, store, table
from tests.stress.measure import Figure

PUNCH_FIGURES = {
    "mesh": (
        ("mesh", "smallest_element", "growth"),
        "Punch: what the mesh costs and gives (quad8)",
    ),
    "element": (
        punch.ELEMENTS,
        "Punch: elements on the same meshes",
    ),
    "solver": (punch.SOLVERS, "Punch: linear solvers on the same meshes"),
}
ALONE = {f"{n} alone": text for n, text in punch.MEASURES.items() if n != "plateau"}


SLOW = ("prism", "accuracy", "growth", "memory", "pairs", "table", "sweep")
"""Measured where they are named alone."""
NAMES = ("hertz", "walls", "punch", "steady", "rolling", "stages", "skips", *SLOW)


def run(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark that the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse, once each: under a minute")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks"), help="folder to write")
    parser.add_argument("--only", nargs="+", choices=NAMES, help="problems to measure")
    given = parser.parse_args(arguments)
    if given.quick:
        meshes, plan, repeats = (4, 8), punch.quick_plan(), 1
    else:
        meshes, plan, repeats = (4, 8, 16, 24), punch.full_plan(), REPEATS
    problems = {
        "hertz": lambda: of_hertz(given.out, hertz.ELEMENTS, meshes, repeats),
        "walls": lambda: of_walls(given.out, quick=given.quick, repeats=repeats),
        "punch": lambda: of_punch(given.out, plan, repeats),
        "steady": lambda: of_steady(given.out, quick=given.quick, repeats=repeats),
        "rolling": lambda: of_rolling(given.out, quick=given.quick, repeats=repeats),
        "stages": lambda: of_stages(given.out, quick=given.quick),
        "skips": lambda: of_skips(repeats),
        "prism": lambda: of_prism(given.out, quick=given.quick, repeats=repeats),
        "accuracy": lambda: of_accuracy(given.out, quick=given.quick, repeats=repeats),
        "growth": lambda: of_growth(given.out, quick=given.quick, repeats=repeats),
        "memory": lambda: told("What a process keeps", memory.measure(given.quick)),
        "pairs": lambda: told("Two workers and one", sweep.pairs(given.quick)),
        "table": lambda: told("The published table", sweep.table(given.quick)),
        "sweep": lambda: told("A study around its runs", sweep.measure(given.quick)),
    }
    names = given.only or [name for name in NAMES if name not in SLOW]
    benchmark(given.out, [problems[name] for name in names])


def benchmark(out: Path, problems: Sequence[Callable[[], list[str]]]) -> None:
    """Measure problems, write results and pictures into ``out``, and print the tables."""
    out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    lines = conditions()
    for problem in problems:
        lines += ["", *problem()]
    lines += ["", f"{time.perf_counter() - started:.0f} s in all"]
    (out / "table.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


def of_hertz(out: Path, elements: Sequence[str], meshes: Sequence[int], repeats: int) -> list[str]:
    """Measure Hertz contact, draw it, and return its table."""
    # warms up, on bodies that do not come again: equal ones share their condensation
    hertz.measure(elements, (5,), 1)
    points = hertz.measure(elements, meshes, repeats)
    title = "Hertz line contact (elements)"
    figures.draw(points, hertz.MEASURES, elements, title, out / "hertz.png")
    store(points, out)
    title = "Hertz line contact, errors relative to the closed form"
    return [title, *table(points, tuple(hertz.MEASURES))]


def of_punch(out: Path, plan: punch.Plan, repeats: int) -> list[str]:
    """Measure the punch, draw it, and return its tables."""
    points = punch.measure(plan, repeats)
    for name, (series, title) in PUNCH_FIGURES.items():
        figures.draw(points, punch.MEASURES, series, title, out / f"punch-{name}.png")
    title = "Punch: what the increments add (on one mesh, against the limit of the series)"
    figures.draw(points, ALONE, ("load_step", "unload_steps"), title, out / "punch-increments.png")
    store(points, out)
    return [
        "Punch, errors against the finest run (plateau: against Re)",
        *table(points, tuple(punch.MEASURES)),
        "",
        "Punch, increments alone: errors against the limit of the series",
        *table([p for p in points if set(ALONE) & set(p.errors)], tuple(ALONE)),
        "",
        *verdict(points),
    ]


def of_walls(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure thick walls, draw them, and return their tables."""
    points = walls.measure(quick, repeats)
    store(points, out)
    lines = []
    for wall in walls.WALLS:
        title = f"Thick {wall} beyond yield: residual hoop stress against the closed form"
        own = [p for p in points if p.setting.endswith(wall)]
        figures.draw(own, walls.MEASURES, walls.ELEMENTS, title, out / f"walls-{wall}.png")
        lines += [title, *table(own, tuple(walls.MEASURES), (walls.EFFECTIVITY,)), ""]
    return lines


def of_steady(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure steady passes, draw them, and return their tables."""
    points = steady.measure(quick, repeats)
    lines = []
    for load in steady.loads(quick):
        lines += of_load(out, "steady", load, points, steady.MEASURES[load], steady.SERIES)
    return lines


def of_rolling(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure rolling by increments, draw it, and return its tables."""
    points = rolling.measure(quick, repeats)
    lines = []
    for load in steady.loads(quick):
        lines += of_load(out, "rolling", load, points, rolling.MEASURES, rolling.SERIES)
    return lines


def of_load(
    out: Path,
    name: str,
    load: str,
    points: Sequence[Point],
    measures: Mapping[str, str],
    series: Sequence[str],
) -> list[str]:
    """Write and draw the points, and return the table of those of one load."""
    store(points, out)
    own = [p for p in points if p.setting.endswith(load)]
    title = f"{own[0].problem.capitalize()}, {load}: what accuracy costs"
    figures.draw(own, measures, series, title, out / f"{name}-{load}.png")
    text = f"{own[0].problem.capitalize()}, {load}: errors of residual sigma_x / Re"
    return [f"{text} against the finest run", *table(own, tuple(measures)), ""]


def of_prism(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure passes over a prism, draw them, and return their tables."""
    points = prism.measure(quick, repeats)
    store(points, out)
    lines = []
    for load in prism.loads(quick):
        own = [p for p in points if p.setting.endswith(load)]
        title = f"Pass over a prism, {load}: residual stress against the finest of each series"
        figures.draw(own, prism.MEASURES, prism.SERIES, title, out / f"prism-{load}.png")
        lines += [title, *table(own, tuple(prism.MEASURES), prism.VALUES), ""]
    return lines


def of_stages(out: Path, *, quick: bool) -> list[str]:
    """Measure the stages of first runs, and return their table."""
    points = stages.measure(quick)
    store(points, out)
    title = "Stages of a first run, processor time [s], and peak memory [MB]"
    return [title, *table(points, (), stages.STAGES)]


def of_skips(repeats: int) -> list[str]:
    """Measure what leaving out saves, and return its table."""
    lines = [f"{'left out':<22}{'with it [s]':>12}{'without [s]':>12}{'ratio':>8}{'apart':>10}"]
    for what, whole, short, miss in skips.measure(repeats):
        lines.append(f"{what:<22}{whole:>12.2f}{short:>12.2f}{whole / short:>8.1f}{miss:>10.1e}")
    return lines


def of_accuracy(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure the levels of `accuracy`, draw them, and return their table."""
    points = accuracy.measure(quick, repeats)
    store(points, out)
    ((measure, text),) = accuracy.MEASURES.items()
    figures.draw_levels(points, measure, text, out / "accuracy.png")
    return [text[0].upper() + text[1:], *table(points, (measure,))]


def of_growth(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure how cost grows with the mesh, and return its table."""
    points, exponents = growth.measure(quick, repeats)
    store(points, out)
    title = "Processor time over unknowns"
    return [title, *table(points, (), ("iterations",)), *map(str, exponents)]


def told(title: str, found: Sequence[Figure]) -> list[str]:
    """Return lines that tell what was measured."""
    return [title, *map(str, found)]


def verdict(points: Sequence[Point]) -> list[str]:
    """Return what the default parameters are, and the error they carry."""
    default = next((p for p in points if p.series == "default"), None)
    if default is None:
        return ["The quick benchmark has no reference fine enough to judge the defaults."]
    base, next_finest = punch.BASE, [p for p in points if p.series == "mesh"][-1]
    lines = [
        f"Default: {base.element}, smallest_element {base.smallest_element:g}, growth "
        f"{base.growth:g}, load_step {base.load_step:g}, unload_steps {base.unload_steps}: "
        f"{default.cpu:.2f} CPU s, {default.unknowns} unknowns.",
        "It carries these errors (beside them, for what the reference itself may lack, "
        f"those of {next_finest.setting}):",
    ]
    for name, text in punch.MEASURES.items():
        lines.append(f"  {default.errors[name]:8.2%} {next_finest.errors[name]:8.2%}  {text}")
    return lines
