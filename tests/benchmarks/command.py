"""The command: measure, draw, write, print."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks import figures, hertz, punch
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
    given = parser.parse_args(arguments)
    if given.quick:
        meshes, plan, repeats = (4, 8), punch.quick_plan(), 1
    else:
        meshes, plan, repeats = (4, 8, 16, 24), punch.full_plan(), REPEATS
    benchmark(given.out, elements=hertz.ELEMENTS, meshes=meshes, plan=plan, repeats=repeats)


def benchmark(
    out: Path, *, elements: Sequence[str], meshes: Sequence[int], plan: punch.Plan, repeats: int
) -> None:
    """Measure both problems, write CSV and PNG files into ``out``, and print the tables."""
    out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    lines = conditions()
    # warms up, on bodies that do not come again: equal ones share their condensation
    hertz.measure(elements, (5,), 1)

    points = hertz.measure(elements, meshes, repeats)
    title = "Hertz line contact (elements)"
    figures.draw(points, hertz.MEASURES, elements, title, out / "hertz.png")
    write_csv(points, out / "hertz.csv")
    lines += ["", "Hertz line contact, errors relative to the closed form"]
    lines += table(points, tuple(hertz.MEASURES))

    points = punch.measure(plan, repeats)
    for name, (series, title) in PUNCH_FIGURES.items():
        figures.draw(points, punch.MEASURES, series, title, out / f"punch-{name}.png")
    title = "Punch: what the increments add (on one mesh, against the limit of the series)"
    figures.draw(points, ALONE, ("load_step", "unload_steps"), title, out / "punch-increments.png")
    write_csv(points, out / "punch.csv")
    lines += ["", "Punch, errors against the finest run (plateau: against Re)"]
    lines += table(points, tuple(punch.MEASURES))
    lines += ["", "Punch, increments alone: errors against the limit of the series"]
    lines += table([p for p in points if set(ALONE) & set(p.errors)], tuple(ALONE))
    lines += ["", *verdict(points), "", f"{time.perf_counter() - started:.0f} s in all"]
    (out / "table.txt").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


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
