"""A scene that the comparison has never heard of is compared by what it declares."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from annotated_types import Interval, Unit

from residua.cli import main
from solver.results.record import Record, Status
from solver.scenes import SCENES, Monitor
from solver.scenes.parameters import check, described
from studies import Store, Study, StudyError
from studies.storage.combine import combine
from studies.views.comparison.profiles import read_profiles
from tests.studies.fakes import Canned

DEPTH = np.linspace(0.0, 10.0, 11)


@dataclass(frozen=True, slots=True, kw_only=True)
class LayerParameters:
    heat: Annotated[float, Interval(gt=0.0), Unit("K")] = described(100.0, "rise of temperature")
    cell: Annotated[float, Interval(gt=0.0), Unit("mm")] = described(1.0, "side of a cell")
    ratio: Annotated[float, Interval(ge=1.0), Unit("1")] = described(1.2, "ratio of cells in depth")
    coat: Annotated[float, Interval(gt=0.0), Unit("mm")] = described(2.0, "thickness of the coat")

    def __post_init__(self) -> None:
        check(self)


def path(
    parameters: LayerParameters, values: Sequence[float], monitor: Monitor
) -> Iterator[Record]:
    """Yield nothing: the records of these tests are given."""
    yield from ()


LAYER = Canned(
    name="layer",
    summary="a layer cooled on a body",
    parameters=LayerParameters,
    branch="heat",
    records=path,
    refining=frozenset({"cell", "ratio"}),
)


def record(parameters: LayerParameters) -> Record:
    """A surface stress of heat plus the cell's side squared, falling with depth."""
    surface = parameters.heat + parameters.cell**2
    stress = surface * np.exp(-DEPTH) * np.ones((1, 1, 1))
    return Record(
        parameters=parameters,
        status=Status.OK,
        coordinates={"station": np.array([0.0]), "component": np.array(["xx"]), "depth": DEPTH},
        fields={"residual_profile": (("station", "component", "depth"), stress)},
    )


@pytest.fixture(autouse=True)
def layer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SCENES, LAYER.name, LAYER)


def stored(directory: Path, sweep: dict[str, Any]) -> Store:
    content = {"name": "layers", "scene": "layer", "sweep": {"case": {"A": {"coat": 3}}} | sweep}
    study, store = Study.from_dict(content), Store(directory)
    for case in study.cases():
        store.write_run(case, record(case.parameters))
    store.save_study(study)
    combine(study, store, list(study.cases()))
    return store


def test_its_sizes_are_levels_and_what_else_refines_is_none(tmp_path: Path) -> None:
    store = stored(tmp_path / "out", {"cell": [2, 1, 0.5]})
    computed = read_profiles([store.directory], {})
    assert (computed.scene, computed.axes) == ("layer", ("cell",))
    assert computed.levels == [(2.0,), (1.0,), (0.5,)]
    other = stored(tmp_path / "other", {"cell": [0.25], "ratio": [1.1]})
    assert read_profiles([store.directory, other.directory], {}).levels[-1] == (0.25,)


def test_what_does_not_refine_is_another_problem(tmp_path: Path) -> None:
    store = stored(tmp_path / "out", {"heat": [100, 200]})
    with pytest.raises(StudyError, match=r"heat 200, not 100; --select heat=VALUE$"):
        read_profiles([store.directory], {})


def test_the_command_compares_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = stored(tmp_path / "out", {"cell": [2, 1, 0.5]})
    mine, rows = tmp_path / "mine.csv", tmp_path / "rows.csv"
    mine.write_text("case,quantity,component,value,unit,source\nA,surface,xx,99,MPa,my rig")
    options = ["--reference", str(mine), "--csv", str(rows)]
    assert main(["compare", str(store.directory), *options]) == 0
    told = capsys.readouterr().out
    assert "the run with the smallest cell;" in told
    assert "1 of 1 within 50 MPa" in told
    (row,) = csv.DictReader(rows.read_text().splitlines())
    assert float(row["difference"]) == pytest.approx(100.25 - 99.0)
    assert float(row["change_cell"]) == pytest.approx(0.25 - 1.0)
    assert float(row["order_cell"]) == pytest.approx(2.0)


def test_a_scene_without_published_numbers_asks_for_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = stored(tmp_path / "out", {"cell": [1]})
    assert main(["compare", str(store.directory)]) == 2
    assert "--reference = None: must name a table" in capsys.readouterr().err
