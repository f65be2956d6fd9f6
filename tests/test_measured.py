"""The page of measured and published numbers has what its program computes."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from residua.cli import main
from studies import open_study
from tests.architecture.sources import ROOT

PROGRAM = runpy.run_path(str(ROOT / "docs/pictures/measured.py"))
DATA = ROOT / "data/measured"
SOURCES = sorted(path.stem for path in DATA.glob("*.toml") if path.with_suffix(".csv").exists())


def stored() -> pd.DataFrame:
    return pd.read_csv(DATA / "compared.csv")


def test_the_page_has_the_stored_numbers_and_every_source() -> None:
    page = (ROOT / "docs/measured.md").read_text()
    assert PROGRAM["written"](page, stored()) == page
    assert PROGRAM["written"](page, stored().assign(difference=99.0)) != page
    assert sorted(stored()["source"].unique()) == SOURCES
    for name in SOURCES:
        assert f"\n## {name}\n" in page and f"](pictures/measured-{name}.png)" in page


@pytest.mark.parametrize("name", SOURCES)
def test_a_file_states_its_source_and_stands_in_what_was_compared(name: str) -> None:
    text = (DATA / f"{name}.csv").read_text()
    comments = "".join(line for line in text.splitlines() if line.startswith("#"))
    assert "Closed form" in comments or ("icence" in comments and "Read:" in comments)
    rows = pd.read_csv(DATA / f"{name}.csv", comment="#", skipinitialspace=True)
    own = stored().query("source == @name")
    for each in ("value", "sigma"):
        given = np.sort(rows[each].astype(float).dropna())
        np.testing.assert_allclose(np.sort(own[each].dropna()), given, rtol=1e-5)


def test_values_are_taken_at_labels_parameters_and_places_in_the_unit_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = xr.Dataset(
        {"stress": (("component", "run", "s"), np.arange(12.0).reshape(2, 3, 2), {"units": "MPa"})},
        {
            "component": ["xx", "zz"],
            "load": ("run", [1.0, 2.0, 3.0], {"units": "N"}),
            "s": ("s", [0.0, 1.0], {"units": "mm"}),
        },
    )
    (tmp_path / "own.csv").write_text(
        "component, load [kN], s [mm], quantity, value, sigma, unit\n"
        "zz, 0.003, 0.25, stress, 10, 0.5, MPa\n"
        "zz, 0.003, 1, stress, 0.01, 0.0005, GPa\n"
        "xx, 0.001, 0, stress, , , MPa\n"
    )
    monkeypatch.setitem(PROGRAM["compared"].__globals__, "DATA", tmp_path)
    found = PROGRAM["compared"]("own", dataset)
    np.testing.assert_allclose(found["computed"], [10.25, 0.011, 0.0])
    np.testing.assert_allclose(found["difference"][:2], [0.25, 2.0])
    assert found["per"].to_list() == ["MPa", "sigma", "MPa"], "rows of one unit have one measure"
    with pytest.raises(ValueError, match="load is 3"):
        PROGRAM["compared"]("own", dataset.isel(run=2))


def test_a_source_of_which_nothing_is_published_has_a_line_for_each_curve() -> None:
    rows = [(f"d {d}, passes {k}", "strain", d + k) for d in (30, 60) for k in (1, 10)]
    table = pd.DataFrame(rows, columns=["at", "quantity", "computed"]).assign(
        value=np.nan, unit="1"
    )
    head, _, *lines = PROGRAM["single"](table).splitlines()
    assert head == "| where | quantity | 1 | 10 |"
    assert lines == ["| d 30 | `strain` | 31 | 40 |", "| d 60 | `strain` | 61 | 70 |"]


@pytest.mark.pages
def test_the_cheapest_source_computes_what_is_stored(tmp_path: Path) -> None:
    study = str(DATA / "bent-beam.toml")
    assert main(["run", study, "--out", str(tmp_path / "out"), "--workers", "0"]) == 0
    with open_study(str(tmp_path / "out")) as dataset:
        found = PROGRAM["compared"]("bent-beam", dataset)
    own = stored().query("source == 'bent-beam'")
    np.testing.assert_allclose(found["computed"], own["computed"], rtol=1e-5, atol=1e-6)
    assert found["difference"].abs().max() < 1.0, "an element of 40 over the height"
    PROGRAM["drawn"](found).savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 1000
