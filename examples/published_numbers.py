"""Compare computed with published numbers: the rolling cases of P. Marek (Warsaw 1995).

``python examples/published_numbers.py`` computes the cases on a coarse mesh and writes
``published.md``. To use the mesh of the study, compute the study first and give its directory:
``residua run data/studies/rolling-table.toml --out table``, then
``python examples/published_numbers.py table``.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import find_peaks

from studies import Store, Study, open_study, run_study

DATA = Path(__file__).parents[1] / "data"
COARSE = {
    "element_size": 3.0, "advance_step": 3.0, "growth": 1.5, "track": 18.0,
    # how the wheel is set down and lifted hardly matters at mid-track
    "press_steps": 6, "unload_steps": 1,
}  # fmt: skip
NAMES = {"xx": "sigma_x", "yy": "sigma_y", "zz": "sigma_z", "xy": "tau_xy"}
NAMES["plastic_strain"] = "plastic strain"


def feature(profile, quantity, top, bottom):
    """Return value and depth of a feature of a profile between two depths."""
    line = profile.dropna("depth").sel(depth=slice(top, bottom))
    values = line.to_numpy()
    if quantity == "local_maximum":  # the most prominent one
        peaks, details = find_peaks(values, prominence=0.0)
        if not peaks.size:
            return np.nan, np.nan
        at = peaks[details["prominences"].argmax()]
    else:
        at = {"surface": 0, "minimum": values.argmin(), "maximum": values.argmax()}[quantity]
    return values[at], float(line["depth"][at])


def found(runs, row, case, number):
    """Return value and depth of the feature of a row, after a pass of a case."""
    after = runs.sel({"case": case, "pass": number}).sel(station=0.0, method="nearest")
    if row.component == "plastic_strain":
        profile = after["profile_plastic_strain"]
    else:
        profile = after["residual_profile"].sel(component=row.component)
    return feature(profile, row.quantity, row.top, row.bottom)


def compared(runs, published):
    """Return a row for each published value and each published depth that was computed."""
    rows = []
    for row in published.itertuples():
        if row.case not in runs["case"]:
            continue
        value, depth = found(runs, row, row.case, row.number)
        unit = row.unit
        if isinstance(row.against, str):  # a change [%] against another case and pass
            case, number = row.against.split("/")
            value = 100.0 * (value / found(runs, row, case, int(number))[0] - 1.0)
        what = f"{NAMES[row.component]}, {row.quantity.replace('_', ' ')}"
        rows.append([row.case, row.number, what, unit, row.value, value, row.source])
        rows.append([row.case, row.number, f"{what}: depth", "mm", row.depth, depth, row.source])
    table = pd.DataFrame(
        rows, columns=["case", "pass", "feature", "unit", "published", "computed", "source"]
    )
    return table.dropna(subset="published").assign(
        difference=lambda each: each["computed"] - each["published"]
    )


def write(table, path):
    """Write the table as Markdown."""
    columns = ["case", "pass", "feature", "unit", "published", "computed", "difference", "source"]
    lines = [columns, ["---"] * len(columns)]
    for row in table[columns].itertuples(index=False):
        lines.append([f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in row])
    path.write_text("".join(f"| {' | '.join(line)} |\n" for line in lines))


def main():
    """Compare the runs of the directory given on the command line, or compute coarse runs."""
    directory = sys.argv[1] if len(sys.argv) > 1 else "published"
    if len(sys.argv) == 1:
        study = tomllib.loads((DATA / "studies/rolling-table.toml").read_text())
        study["parameters"] = COARSE
        cases = ("T1", "T3", "T6", "T7", "T8")  # there are no published numbers for the others
        study["sweep"]["case"] = {case: study["sweep"]["case"][case] for case in cases}
        assert run_study(Study.from_dict(study), Store(directory), workers=0).ok
    published = pd.read_csv(DATA / "measured/rolling.csv")
    published = published.rename(columns={"pass": "number", "from": "top", "to": "bottom"})
    published = published.fillna({"top": 0.0, "bottom": np.inf})
    with open_study(directory) as dataset:
        table = compared(dataset.squeeze(drop=True), published)
    write(table, Path("published.md"))
    print(table.drop(columns="source").round(3).to_string(index=False))
    lowest = table[(table["unit"] == "MPa") & table["feature"].str.endswith("minimum")]
    assert (lowest[["published", "computed"]] < -100.0).all(axis=None), lowest


if __name__ == "__main__":
    main()
