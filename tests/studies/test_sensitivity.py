"""Indices of sensitivity from the runs of a study."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
import xarray as xr
from annotated_types import Interval, Unit

from residua.cli import main
from solver.results.record import Record, Status
from studies import Store, Study, StudyError, open_study, sensitivity
from studies.views.chaos import bears, candidates, fitted
from studies.views.plots.sensitivity import sensitivity_figure
from studies.views.sensitivity import sensitivity_table, told
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import Canned

A, B = 7.0, 0.1
"""Of Ishigami's function sin x + A sin² y + B z⁴ sin x."""
_ALONE = 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2, A**2 / 8.0, 0.0
_TOGETHER = B**2 * np.pi**8 * 8.0 / 225.0
_VARIANCE = sum(_ALONE) + _TOGETHER
FIRST = np.array(_ALONE) / _VARIANCE
TOTAL = (np.array(_ALONE) + np.array([_TOGETHER, 0.0, _TOGETHER])) / _VARIANCE
"""Ishigami, T. and Homma, T. (1990): .3139, .4424, 0 and .5576, .4424, .2437."""


def angle(name: str) -> Any:
    return field(default=0.0, metadata={"description": name})


@dataclass(frozen=True, slots=True, kw_only=True)
class Angles:
    """Parameters of Ishigami's function."""

    x: Annotated[float, Interval(ge=-4.0, le=4.0), Unit("1")] = angle("first")
    y: Annotated[float, Interval(ge=-4.0, le=4.0), Unit("1")] = angle("second")
    z: Annotated[float, Interval(ge=-4.0, le=4.0), Unit("1")] = angle("third")
    noise: Annotated[float, Interval(ge=0.0, le=10.0), Unit("1")] = angle("size of the noise")
    fails: Annotated[float, Interval(ge=-4.0, le=4.0), Unit("1")] = field(
        default=4.0, metadata={"description": "x above which a run fails"}
    )
    kind: Literal["sum", "product"] = field(default="sum", metadata={"description": "a word"})


def ishigami(run: Any, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield the record of a run."""
    number = np.sin(run.x) * (1.0 + B * run.z**4) + A * np.sin(run.y) ** 2
    number += run.noise * np.random.default_rng(int(1e6 * (run.x + 4.0))).normal()
    one = Record(
        parameters=run, status=Status.OK, message="", coordinates={}, fields={}, symmetric=False,
        scalars={"peak_contact_pressure": float(number), "increments": 3.0},
    )  # fmt: skip
    if run.x > run.fails:
        yield replace(one, status=Status.LIMIT_LOAD, message="flows", scalars={})
    else:
        yield one


SCENE = Canned(
    name="ishigami", summary="Ishigami's function", parameters=Angles, branch="", records=ishigami
)
OF = "peak_contact_pressure"
CUBE = {name: [-3.141592653589793, 3.141592653589793] for name in ("x", "y", "z")}


def sample(num: int, method: str = "sobol", seed: int = 0, **more: Any) -> Study:
    points = {"method": method, "num": num, "seed": seed, "ranges": CUBE}
    return Study.from_dict({"name": "ishigami", "sample": points} | more, SCENE)


def runs_of(study: Study) -> xr.Dataset:
    """Return the runs of a study as its data set has them, without files."""
    shape = tuple(map(len, study.axes.values()))
    records = [next(ishigami(Angles(**case.values), [], None)) for case in study.cases()]
    numbers = [record.scalars.get(OF, np.nan) for record in records]
    status = np.array([record.status.name.lower() for record in records], dtype=object)
    fields = {"status": status, OF: np.array(numbers), "increments": np.full(len(records), 3)}
    sets = {"sets": " ".join(study.linked)}
    axes = {n: xr.Variable(n, v, sets if n == "point" else None) for n, v in study.axes.items()}
    return xr.Dataset(
        {name: (tuple(axes), values.reshape(shape)) for name, values in fields.items()},
        coords=axes | study.linked,
    )


@pytest.fixture(scope="module")
def doubled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, list[int]]:
    """A store in which a sample was computed, then one of twice the runs; and files at each."""
    store, counts = Store(tmp_path_factory.mktemp("ishigami")), []
    for num in (64, 128):
        compute_here(sample(num), store, SCENE)
        counts.append(len(list(store.directory.glob("runs/*.nc"))))
    return store, counts


def test_a_longer_sample_keeps_the_runs(doubled: tuple[Store, list[int]]) -> None:
    assert doubled[1] == [64, 128]
    assert list(sample(128).run_ids())[:64] == list(sample(64).run_ids())
    for method in ("sobol", "lhs"):
        points = [sample(num, method).sweep["point"] for num in (64, 128, 128)]
        assert points[1] == points[2], "to the bit"
        assert points[1][:64] == points[0]


@pytest.mark.parametrize(
    ("method", "seed", "num"),
    [("sobol", 0, 64), ("lhs", 0, 64), ("sobol", 1, 128), ("lhs", 1, 128)],
)
def test_indices_of_ishigami_are_within_their_confidence(method: str, seed: int, num: int) -> None:
    found = sensitivity(runs_of(sample(num, method, seed)), OF)
    assert found["parameter"].values.tolist() == ["x", "y", "z"]
    assert (abs(found["first"] - FIRST) <= found["first_error"]).all()
    assert (abs(found["total"] - TOTAL) <= found["total_error"]).all()
    if num == 128:
        assert (found["total_error"] < 0.03).all()
        assert found.attrs["q2"] > 0.99


def test_a_confidence_grows_with_noise_and_contains_the_indices() -> None:
    """Where a fit is refused it would not."""
    random = np.random.default_rng(1)
    places = 2.0 * random.random((96, 3)) - 1.0
    values = places[:, 0] + 0.5 * places[:, 1] ** 2
    smooth, rough = (values + size * random.normal(size=96) for size in (1e-4, 0.1))
    exact = np.array([1 / 3, 0.25 * (1 / 5 - 1 / 9), 0.0])
    errors = []
    for each in (smooth, rough):
        found = sensitivity(as_dataset(places, each), OF)
        assert (abs(found["first"] - exact / exact.sum()) <= found["first_error"] + 1e-6).all()
        errors.append(float(found["first_error"].max()))
    assert errors[1] > 1.2 * errors[0]


def as_dataset(places: np.ndarray, values: np.ndarray) -> xr.Dataset:
    """Return a data set as a study of points has it."""
    columns = {f"p{k}": ("point", column) for k, column in enumerate(places.T)}
    axis = xr.Variable("point", np.arange(len(places)), {"sets": " ".join(columns)})
    status = np.full(len(places), "ok", dtype=object)
    fields = {"status": ("point", status), OF: ("point", values)}
    return xr.Dataset(fields, coords={"point": axis, **columns})


def test_a_logarithmic_range_is_taken_as_one() -> None:
    random = np.random.default_rng(2)
    shares = random.random((64, 2))
    places = np.column_stack([10.0 ** (3.0 * shares[:, 0]), shares[:, 1]])
    found = sensitivity(as_dataset(places, 3.0 * shares[:, 0] + 3.0 * shares[:, 1]), OF)
    assert found["total"].values == pytest.approx([0.5, 0.5], abs=0.05)
    ratios = np.diff(np.log(found["place"].to_numpy()[0]))
    assert ratios == pytest.approx(ratios[0])


def test_a_grid_has_indices_too(tmp_path: Path) -> None:
    axes = {"load_ratio": [0.2, 0.4, 0.6, 0.8], "friction": [0.0, 0.1, 0.2, 0.3]}
    store = Store(tmp_path)
    compute_here(fake_study(sweep=axes), store)
    with open_study(store.directory) as dataset:
        found = sensitivity(dataset, OF)
    # of 100 l (1 + f): l = .5 + .3 u, 1 + f = 1.15 + .15 v, with u, v uniform in [-1, 1]
    parts = np.array([(0.3 * 1.15) ** 2 / 3, (0.5 * 0.15) ** 2 / 3])
    assert found["first"].values == pytest.approx(
        parts / (parts.sum() + (0.3 * 0.15) ** 2 / 9), abs=1e-6
    )


def test_the_sum_of_polynomials_is_exact_for_a_polynomial() -> None:
    random = np.random.default_rng(0)
    places, unseen = 2.0 * random.random((2, 40, 2)) - 1.0

    def number(at: np.ndarray) -> np.ndarray:
        return np.asarray(2.0 + at[:, 0] ** 3 - at[:, 0] * at[:, 1])

    found = fitted(places, number(places), 4)
    assert found(unseen) == pytest.approx(number(unseen), abs=1e-10)
    assert found.variance == pytest.approx(1 / 7 + 1 / 9, rel=1e-10)
    line = np.linspace(-1.0, 1.0, 5)
    assert found.alone(0, line) == pytest.approx(2.0 + line**3, abs=1e-10)


@pytest.mark.parametrize(
    ("change", "of", "field", "allowed"),
    [
        ({"num": 12}, OF, "runs", "too few for 3 parameters: at least 16"),
        ({"noise": 5.0}, OF, "Q2", "at least 0.8 is needed: double the sample"),
        ({"fails": 2.0}, OF, "runs", "have no peak_contact_pressure, which is a share of"),
        ({}, "increments", "of", "is the same in all runs"),
        ({}, "status", "of", "must be one of"),
        ({}, "peak_contact_presure", "of", "did you mean peak_contact_pressure?"),
        ({"kind": ["sum", "product"]}, OF, "parameters", "has words: select one of them"),
        ({"fails": [3.5, 4.0]}, OF, "parameters", "has 2 values: 3 at least"),
    ],
)
def test_a_sample_that_does_not_bear_it_is_refused(
    change: dict[str, Any], of: str, field: str, allowed: str
) -> None:
    axes = {name: values for name, values in change.items() if isinstance(values, list)}
    fixed = {name: value for name, value in change.items() if name not in {*axes, "num"}}
    study = sample(change.get("num", 32), parameters=fixed, sweep=axes)
    with pytest.raises(StudyError) as caught:
        sensitivity(runs_of(study), of)
    assert caught.value.field == field
    assert allowed in caught.value.allowed


def test_one_value_of_words_may_be_selected() -> None:
    dataset = runs_of(sample(64, sweep={"kind": ["sum", "product"]}))
    found = sensitivity(dataset, OF, {"kind": "product"})
    assert found.attrs["runs"] == 64


@pytest.mark.parametrize("method", ["delta", "pawn", "rbd_fast"])
def test_methods_of_the_library_order_the_parameters_too(method: str) -> None:
    pytest.importorskip("SALib", reason="the extra `sensitivity` is not installed")
    dataset = runs_of(sample(256))
    before = np.random.get_state()[2]  # noqa: NPY002
    found = sensitivity(dataset, OF, method=method)
    assert np.random.get_state()[2] == before  # noqa: NPY002
    name = {"delta": "delta_balanced", "pawn": "median", "rbd_fast": "S1"}[method]
    few = dataset.isel(point=slice(64))
    assert sensitivity(few, OF, method=method).equals(sensitivity(few, OF, method=method))
    x, y, z = found[name].values
    assert min(x, y) > z
    if method == "rbd_fast":
        assert found["S1"].values == pytest.approx(FIRST, abs=0.15)
    assert sensitivity_table(found).splitlines()[3].split()[0] == "z"
    sensitivity_figure(dataset, found)


def test_a_method_that_is_not_there_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "SALib", None)
    monkeypatch.setitem(__import__("sys").modules, "SALib.analyze", None)
    dataset = as_dataset(np.random.default_rng(0).random((32, 2)), np.arange(32.0))
    with pytest.raises(StudyError, match=r"pip install residua-contact\[sensitivity\]"):
        sensitivity(dataset, OF, method="pawn")
    with pytest.raises(StudyError, match="must be one of chaos, delta"):
        sensitivity(dataset, OF, method="anova")


def test_the_command_prints_and_draws(
    doubled: tuple[Store, list[int]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = doubled[0].study_path(sample(128).id)
    asked = ["sensitivity", str(out), "--of", OF]
    assert main([*asked, "--out", str(tmp_path / "a.png")]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [line[0] for line in lines[1:4]] == ["x", "y", "z"]
    assert float(lines[1][1]) == pytest.approx(FIRST[0], abs=0.01)
    assert (tmp_path / "a.png").stat().st_size > 20_000
    assert main([*asked, "--select", "x=17"]) == 2
    with open_study(out) as dataset:
        words = json.loads(json.dumps(told(sensitivity(dataset, OF))))
    assert words["parameters"]["y"]["total"] == pytest.approx(TOTAL[1], abs=0.01)


def test_many_parameters_take_little_memory() -> None:
    assert not bears(1000, 40, 14)
    assert len(candidates(40, 14, most=100)) < 2000
