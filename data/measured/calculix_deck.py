"""Write the deck ``roller.inp`` of CalculiX whose results are in ``calculix.csv``, and read them.

``python calculix_deck.py``, ``ccx -i roller`` (version 2.20), ``python calculix_deck.py read``.
"""

import sys
from itertools import product
from pathlib import Path

import numpy as np

RADIUS, HALF_WIDTH, DEPTH = 10.0, 0.3404, 0.035
"""Of the roller; of the contact if nothing yielded, for the mesh; to which it is pressed [mm]."""
END = 50 * HALF_WIDTH
"""Width and depth of the half-plane [mm]."""
CORNERS = ((0, 2), (2, 2), (2, 0), (0, 0), (1, 2), (2, 1), (1, 0), (0, 1))


def graded(fine: int) -> np.ndarray:
    """Return lines that are equal for so many elements and then grow to the end, with midpoints."""
    sizes = np.r_[np.full(fine, HALF_WIDTH / 10), HALF_WIDTH / 10 * 1.2 ** np.arange(1, 60)]
    lines = np.r_[0.0, np.cumsum(sizes)]
    lines = lines[: np.searchsorted(lines, END) + 1]
    start, rest = lines[fine], lines[fine:] - lines[fine]
    lines[fine:] = start + rest * (END - start) / rest[-1]
    return np.interp(np.arange(2 * len(lines) - 1) / 2, np.arange(len(lines)), lines)


def numbered(across: int, down: int, first: int) -> dict[tuple[int, int], int]:
    """Return numbers of the nodes of a grid of elements with 8 nodes."""
    places = [(i, j) for i, j in product(range(across), range(down)) if not (i % 2 and j % 2)]
    return dict(zip(places, range(first, first + len(places)), strict=True))


def body() -> tuple[list[str], dict[str, list[int]]]:
    """Return the lines of nodes and elements, and sets of numbers."""
    x, y, angles = graded(15), -graded(10), np.linspace(0.0, 0.08, 113)
    half = numbered(len(x), len(y), 1)
    roller = numbered(len(angles), 3, len(half) + 1)
    nodes = {n: (x[i], y[j]) for (i, j), n in half.items()}
    for (i, j), n in roller.items():
        radius = RADIUS - j / 2
        nodes[n] = radius * np.sin(angles[i]), RADIUS - radius * np.cos(angles[i])
    lines = ["*NODE", *(f"{n}, {at[0]:.10g}, {at[1]:.10g}, 0" for n, at in nodes.items())]
    sets, element = {"TOP": [], "RIM": []}, 0
    for name, numbers in (("HALF", half), ("ROLLER", roller)):
        lines.append(f"*ELEMENT, TYPE=CPE8R, ELSET={name}")
        ends = max(i for i, _ in numbers), max(j for _, j in numbers)
        for j, i in product(range(0, ends[1], 2), range(0, ends[0], 2)):
            element += 1
            # downwards in the half-plane, inwards in the roller: its elements begin at the rim
            order = CORNERS if name == "HALF" else [(a, 2 - b) for a, b in CORNERS]
            lines.append(", ".join(map(str, (element, *(numbers[i + a, j + b] for a, b in order)))))
            if j == 0 and (name == "ROLLER" or x[i] < 3 * HALF_WIDTH):
                sets["TOP" if name == "HALF" else "RIM"].append(element)
    sets["LEFT"] = [n for (i, _), n in half.items() if i == 0]
    sets["BOTTOM"] = [n for (_, j), n in half.items() if j == len(y) - 1]
    sets["ALL"] = list(roller.values())
    return lines, sets


def write() -> None:
    """Write the deck."""
    lines, sets = body()
    for name in ("LEFT", "BOTTOM", "ALL"):
        lines += [f"*NSET, NSET={name}", *(f"{n}," for n in sets[name])]
    for name, side in (("TOP", "S3"), ("RIM", "S1")):
        lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *(f"{n}, {side}" for n in sets[name])]
    lines.append(
        f"""*MATERIAL, NAME=STEEL
*ELASTIC
2e5, .3
*PLASTIC
1000., 0.
{1000 + 2 * 4e3 / 0.98:.8g}, 2.
*MATERIAL, NAME=RIGID
*ELASTIC
2e8, .3
*SOLID SECTION, ELSET=HALF, MATERIAL=STEEL
1.
*SOLID SECTION, ELSET=ROLLER, MATERIAL=RIGID
1.
*SURFACE INTERACTION, NAME=I
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e8
*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE
TOP, RIM
*BOUNDARY
LEFT, 1, 1
BOTTOM, 2, 2
ALL, 1, 1
*TIME POINTS, NAME=T
1., 2.
*AMPLITUDE, NAME=A
0., 0., 1., 1., 1.1, .97, 2., -.3
*STEP, INC=1000
*STATIC
.05, 2., 1e-5, .05
*BOUNDARY, AMPLITUDE=A
ALL, 2, 2, {-DEPTH}
*NODE PRINT, NSET=ALL, TOTALS=ONLY
RF
*EL FILE, OUTPUT=2D, TIME POINTS=T
S
*CONTACT FILE, TIME POINTS=T
CSTR
*END STEP"""
    )
    Path("roller.inp").write_text("\n".join(lines) + "\n")


def read() -> None:
    """Print the force, the peak pressure, and the residual stress at x = 0."""
    nodes, time, blocks, here = {}, 0.0, {}, None
    for line in Path("roller.frd").read_text().splitlines():
        if line.startswith(("    2C", "    3C")):
            here = nodes if line[4] == "2" else None  # 3C: elements
        elif line.startswith("  100CL"):
            time = float(line[12:24])
        elif line.startswith(" -4"):
            here = blocks.setdefault((time, line.split()[1]), {})
        elif line.startswith(" -1") and here is not None:
            here[int(line[3:13])] = [float(line[k : k + 12]) for k in range(13, len(line), 12)]
    force = [each.split() for each in Path("roller.dat").read_text().splitlines() if "E" in each]
    print("force", -2 * float(next(each[1] for each in force if len(each) == 3)))
    print("peak_pressure", max(each[3] for each in blocks[1.0, "CONTACT"].values()))
    for n, (x, y, _) in nodes.items():
        if x > 0.0:  # those of the half-plane at x = 0 come first
            break
        xx, _, zz, *_ = blocks[2.0, "STRESS"][n]
        print(f"{y:.4f} {xx:.1f} {zz:.1f}")


if __name__ == "__main__":
    read() if sys.argv[1:] else write()
