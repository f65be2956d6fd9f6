"""The command: measure, draw, write, print."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tests.benchmarks import figures, hertz, punch, skips, steady
from tests.benchmarks.measure import REPEATS, Point
from tests.benchmarks.report import conditions, table, write_csv

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


def run(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark that the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarse, once each: under a minute")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks"), help="folder to write")
    parser.add_argument(
        "--only",
        nargs="+",
        choices=("hertz", "punch", "steady", "skips"),
        help="problems to measure",
    )
    given = parser.parse_args(arguments)
    if given.quick:
        meshes, plan, repeats = (4, 8), punch.quick_plan(), 1
    else:
        meshes, plan, repeats = (4, 8, 16, 24), punch.full_plan(), REPEATS
    problems = {
        "hertz": lambda: of_hertz(given.out, hertz.ELEMENTS, meshes, repeats),
        "punch": lambda: of_punch(given.out, plan, repeats),
        "steady": lambda: of_steady(given.out, quick=given.quick, repeats=repeats),
        "skips": lambda: of_skips(repeats),
    }
    benchmark(given.out, [problems[name] for name in given.only or problems])


def benchmark(out: Path, problems: Sequence[Callable[[], list[str]]]) -> None:
    """Measure problems, write CSV and PNG files into ``out``, and print the tables."""
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
    write_csv(points, out / "hertz.csv")
    title = "Hertz line contact, errors relative to the closed form"
    return [title, *table(points, tuple(hertz.MEASURES))]


def of_punch(out: Path, plan: punch.Plan, repeats: int) -> list[str]:
    """Measure the punch, draw it, and return its tables."""
    points = punch.measure(plan, repeats)
    for name, (series, title) in PUNCH_FIGURES.items():
        figures.draw(points, punch.MEASURES, series, title, out / f"punch-{name}.png")
    title = "Punch: what the increments add (on one mesh, against the limit of the series)"
    figures.draw(points, ALONE, ("load_step", "unload_steps"), title, out / "punch-increments.png")
    write_csv(points, out / "punch.csv")
    return [
        "Punch, errors against the finest run (plateau: against Re)",
        *table(points, tuple(punch.MEASURES)),
        "",
        "Punch, increments alone: errors against the limit of the series",
        *table([p for p in points if set(ALONE) & set(p.errors)], tuple(ALONE)),
        "",
        *verdict(points),
    ]


def of_steady(out: Path, *, quick: bool, repeats: int) -> list[str]:
    """Measure steady passes, draw them, and return their tables."""
    points = steady.measure(quick, repeats)
    write_csv(points, out / "steady.csv")
    lines = []
    for load, measures in steady.MEASURES.items():
        own = [p for p in points if p.setting.endswith(load)]
        title = f"A steady pass, {load}: what mesh and sub-steps cost and give"
        figures.draw(own, measures, steady.SERIES, title, out / f"steady-{load}.png")
        lines += [f"Steady pass, {load}: errors of residual sigma_x / Re against the finest run"]
        lines += [*table(own, tuple(measures)), ""]
    return lines


def of_skips(repeats: int) -> list[str]:
    """Measure what leaving out saves, and return its table."""
    lines = [f"{'left out':<22}{'with it [s]':>12}{'without [s]':>12}{'ratio':>8}{'apart':>10}"]
    for what, whole, short, miss in skips.measure(repeats):
        lines.append(f"{what:<22}{whole:>12.2f}{short:>12.2f}{whole / short:>8.1f}{miss:>10.1e}")
    return lines


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
