"""Compute the studies of ``data/measured``, compare them with what was measured, and draw both.

``python docs/pictures/measured.py [NAME...]``; without names all but those of `LONG`. It writes the
pictures, ``data/measured/compared.csv`` and the tables of ``docs/measured.md``.
"""

from __future__ import annotations

import re
import sys
from itertools import cycle
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from PIL import Image

from residua.cli import main as residua
from studies import open_study
from studies.units import under

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
DATA = ROOT / "data/measured"
STORED = DATA / "compared.csv"
PAGE = ROOT / "docs/measured.md"
LONG = ("cones",)
"""Studies of several minutes, which are computed only by name."""
HEADING = re.compile(r"(?P<name>\w+)(?: \[(?P<unit>[^]]+)\])?")
TABLE = r"(<!-- compared {} -->\n)(?:\|.*\n)*"
MOST = 18
"""Largest number of lines of a table; sources with more values have none."""
LONGEST = 40
"""Numbers of values from which a picture has them in the order of the file, without a line."""
LINES = "-", "--", ":", "-."
LABELLED = len(LINES)
"""Largest number of curves of a panel that have their places in a legend."""
OURS, THEIRS = "#D55E00", "0.35"


def there(array: xr.DataArray, places: dict[str, object]) -> float:
    """Return the value of a variable at labels and numbers; between numbers it is linear."""
    for name, value in places.items():
        known = array[name]
        same = known == value if isinstance(value, str) else np.isclose(known, value)
        if not known.dims and not same:
            raise ValueError(f"{name} is {known.item()}, not {value}")
        if known.dims and not same.any():
            array = array.swap_dims({known.dims[0]: name}).interp({name: value})
        elif known.dims:
            array = array.isel({known.dims[0]: np.flatnonzero(same)})
    if np.isnan(array.item()):
        raise ValueError(f"nothing was computed at {places}")
    return array.item()


def compared(source: str, dataset: xr.Dataset) -> pd.DataFrame:
    """Return a row for each row of the file of a source, with what was computed there."""
    rows = pd.read_csv(DATA / f"{source}.csv", comment="#", skipinitialspace=True)
    headings = [HEADING.fullmatch(each).groups() for each in rows.columns.to_list()]
    headings = headings[: rows.columns.get_loc("quantity")]
    dataset, found = dataset.squeeze(), []
    for row in rows.itertuples(index=False):
        places = {
            name: under(unit, value, dataset[name].units) if unit else value
            for (name, unit), value in zip(headings, row, strict=False)
            if not pd.isna(value)
        }
        of = dataset[row.quantity]
        value = there(of, places) / under(row.unit, 1.0, of.attrs.get("units", "1"))
        found.append(
            [source, [*places.items()], row.quantity, row.unit, row.value, row.sigma, value]
        )
    columns = ["source", "at", "quantity", "unit", "value", "sigma", "computed"]
    table = pd.DataFrame(found, columns=columns)
    parts = [different(rows) for _, rows in table.groupby(["quantity", "unit"], sort=False)]
    return pd.concat(parts).sort_index()


def different(rows: pd.DataFrame) -> pd.DataFrame:
    """Add the differences of a quantity: over sigma, or of stresses > 0 in %, or in its unit."""
    off, unit = rows["computed"] - rows["value"], rows["unit"].iloc[0]
    if rows["sigma"].notna().all():
        off, unit = off / rows["sigma"], "sigma"
    elif unit.endswith("Pa") and (rows["value"] > 0).all():
        off, unit = 100 * off / rows["value"], "%"
    return rows.assign(difference=off, per=unit)


def text(number: float, unit: str = "1", digits: str = ".4g") -> str:
    """Return a number with its unit; nothing for NaN."""
    return "" if np.isnan(number) else f"{number:{digits}} {unit}".removesuffix(" 1")


def place(at: list[tuple[str, object]]) -> str:
    """Return a place as text."""
    return ", ".join(of if isinstance(of, str) else f"{name} {of:g}" for name, of in at)


def whole(table: pd.DataFrame) -> str:
    """Return a table of all sources: a line for each quantity that was measured or published."""
    found = "| source | quantity | values | root mean square of the differences | largest |\n"
    found += "|---|---|---|---|---|\n"
    for (source, quantity), rows in table.dropna(subset="value").groupby(
        ["source", "quantity"], sort=False
    ):
        off, per = rows["difference"], rows["per"].iloc[0]
        size = text(np.sqrt((off**2).mean()), per, ".3g"), text(off.abs().max(), per, ".3g")
        cells = [f"[{source}](#{source})", f"`{quantity}`", str(len(rows)), *size]
        found += f"| {' | '.join(cells)} |\n"
    return found


def single(table: pd.DataFrame) -> str:
    """Return a table of a source: a line for each value, or for each curve if none is published."""
    if table["value"].isna().all():
        return curves(table)
    found = "| where | quantity | published | sigma | computed | difference |\n"
    found += "|---|---|---|---|---|---|\n"
    for row in table.itertuples():
        numbers = [text(each, row.unit) for each in (row.value, row.sigma, row.computed)]
        cells = [
            row.at,
            f"`{row.quantity}`",
            *numbers,
            text(row.difference, row.per, "+.1f"),
        ]
        found += f"| {' | '.join(cells)} |\n"
    return found


def curves(table: pd.DataFrame) -> str:
    """Return a table of computed values: a column for each last place."""
    rows = table.assign(
        computed=[text(each.computed, each.unit) for each in table.itertuples()],
        where=table["at"].str.rpartition(", ")[0],
        last=table["at"].str.rpartition(" ")[2].astype(int),
    )
    wide = rows.pivot(index=["quantity", "where"], columns="last", values="computed")
    found = f"| where | quantity | {' | '.join(map(str, wide))} |\n"
    found += f"{'|---' * (2 + wide.shape[1])}|\n"
    for quantity, where in dict.fromkeys(zip(rows["quantity"], rows["where"], strict=True)):
        found += f"| {where} | `{quantity}` | {' | '.join(wide.loc[quantity, where])} |\n"
    return found


def written(page: str, table: pd.DataFrame) -> str:
    """Return the page with the tables of what was compared."""
    made = {"all": whole(table)}
    made |= {
        name: lines
        for name, rows in table.fillna({"at": ""}).groupby("source")
        if (lines := single(rows)).count("\n") <= MOST
    }
    for name, lines in made.items():
        page = re.sub(TABLE.format(name), rf"\g<1>{lines}", page)
    return page


def drawn(table: pd.DataFrame) -> Figure:
    """Return a panel of values for each quantity, and one of differences where there are any."""
    parts = [rows for _, rows in table.groupby("quantity", sort=False)]
    heights = (3, 1) if table["difference"].notna().any() else (3,)
    size = 3.2 * len(parts), 0.6 + 0.75 * sum(heights)
    sheet = Figure(figsize=size, dpi=85, layout="constrained")
    grid = sheet.subplots(
        len(heights), len(parts), sharex="col", squeeze=False, height_ratios=heights
    )
    for (above, *below), rows in zip(grid.T, parts, strict=True):
        last = [at[-1] if at else ("", "") for at in rows["at"]]
        words = [of for _, of in last if isinstance(of, str)]
        curve = not words and len(rows) < LONGEST
        x = np.array([of for _, of in last] if curve else range(len(rows)), dtype=float)
        above.errorbar(x, rows["value"], rows["sigma"], fmt="o", color=THEIRS, ms=4, zorder=3)
        same = set.intersection(*(set(at[:-1]) for at in rows["at"]))
        names = [place([of for of in at[:-1] if of not in same]) for at in rows["at"]]
        groups = rows.assign(x=x).groupby(names, sort=False)
        for (label, own), line in zip(groups, cycle(LINES), strict=False):
            style = f".{line}" if curve else "_"
            size = 6 if curve else 14
            above.plot(own["x"], own["computed"], style, color=OURS, ms=size, mew=2, label=label)
        if 1 < len(groups) <= LABELLED:
            above.legend(fontsize=6, frameon=False)
        for axes in below:
            axes.plot(x, rows["difference"], "o", color=THEIRS, ms=3)
            axes.axhline(0.0, color="0.2", linewidth=0.8)
            per = rows["per"].iloc[0]
            axes.set_ylabel(f"difference\n[{per}]".removesuffix("\n[1]"), fontsize=7)
        name, unit = rows["quantity"].iloc[0].replace("_", " "), rows["unit"].iloc[0]
        above.set_title(f"{name} [{unit}]".removesuffix(" [1]"), fontsize=9)
        lowest = [above, *below][-1]
        lowest.margins(x=0.1)
        if words:
            lowest.set_xticks(x, words, fontsize=7)
        else:
            lowest.set_xlabel(last[0][0].replace("_", " ") if curve else "number", fontsize=8)
    sheet.suptitle("orange: computed; dots: measured or published", fontsize=8, color="0.3")
    return sheet


def main(names: list[str]) -> None:
    """Compute, compare and draw the sources of these names."""
    known = sorted(path.stem for path in DATA.glob("*.toml") if path.with_suffix(".csv").exists())
    if unknown := set(names) - set(known):
        sys.exit(f"{', '.join(sorted(unknown))}: must be of {', '.join(known)}")
    table = pd.read_csv(STORED)
    for name in names or [each for each in known if each not in LONG]:
        folder = str(ROOT / "build/measured" / name)
        residua(["run", str(DATA / f"{name}.toml"), "--out", folder])
        with open_study(folder) as dataset:
            own = compared(name, dataset)
        to = HERE / f"measured-{name}.png"
        drawn(own).savefig(to)
        with Image.open(to) as picture:
            picture.convert("RGB").quantize(32).save(to, optimize=True)
        own["at"] = own["at"].map(place)
        table = pd.concat([table[table["source"] != name], own]).infer_objects()
    table.sort_values("source", kind="stable").to_csv(STORED, index=False, float_format="%.6g")
    PAGE.write_text(written(PAGE.read_text(), pd.read_csv(STORED)))
    print(whole(pd.read_csv(STORED)))


if __name__ == "__main__":
    main(sys.argv[1:])
