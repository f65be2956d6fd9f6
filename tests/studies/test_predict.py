"""Predictions between runs: their values, their errors, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.stats import qmc
from xarray.backends import BackendArray
from xarray.core.indexing import LazilyIndexedArray

from studies import Store, Study, StudyError, open_study, predict, sensitivity
from studies.views.fits import share_predicted, tenths
from studies.views.gaussian import Gaussian, in_hull
from studies.views.predict import answer
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import SWITCHED
from tests.studies.test_goal import search_here
from tests.studies.test_refine import AXES, OF, WHOLE, bitten, refined_by, study

SAMPLED = Path(__file__).with_name("sampled")
"""Runs of Sobol sequences, by an earlier version: three parameters and three numbers of each."""


def smooth(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.exp(-2.0 * x) * np.cos(3.0 * y)


def rough(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.maximum(0.0, x + 0.5 * y - 0.6) + 0.05 * np.sin(25.0 * x)


def wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sin(6.0 * x) * np.cos(5.0 * y)


def noise(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).normal(size=len(x)) + 0.0 * y


def sampled(number: Any, count: int = 64) -> xr.Dataset:
    """Return a data set of points, with a number and a line over depth."""
    x, y = qmc.Sobol(2, rng=1).random(count).T
    depth = np.linspace(0.0, 2.0, 5)
    values = number(x, y)
    return xr.Dataset(
        {
            "status": ("point", np.full(count, "ok", dtype=object)),
            "number": ("point", values, {"units": "MPa"}),
            "line": (("point", "depth"), values[:, None] * np.exp(-depth)),
        },
        coords={
            "point": ("point", np.arange(count), {"sets": "x y"}),
            "x": ("point", x),
            "y": ("point", y),
            "depth": depth,
        },
    )


def test_the_runs_of_a_tenth_are_missed_as_a_process_without_them_misses_them() -> None:
    places = qmc.Sobol(2, rng=2).random(32)
    values = wavy(*places.T)[:, None]
    whole = Gaussian(places, values)
    for out in tenths(32):
        others = Gaussian(places[~out], values[~out])
        weights = [others.at(place)[0] for place in places[out]]
        missed = values[out] - np.array(weights) @ values[~out]
        assert missed == pytest.approx(whole.misses[out], rel=1e-2, abs=1e-4)


STUDIES = {"punch": 16, "ball": 24, "rolling": 30, "pin": 48, "shaft_hub": 64}
"""Studies of `sampled`, and how many of their runs are fitted: the first ones of the sequence."""


@pytest.mark.parametrize("counts", [STUDIES, {"shaft_hub": 30}])
def test_nine_of_ten_runs_are_within_two_of_the_deviations_that_are_stated(
    counts: dict[str, int],
) -> None:
    """At 40 other runs of each study inside the hull, and of each of three numbers."""
    within: dict[str, list[bool]] = {}
    for name, count in counts.items():
        table = np.loadtxt(SAMPLED / f"{name}.csv", delimiter=",", skiprows=1)
        places = (table[:, :3] - table[:, :3].min(axis=0)) / np.ptp(table[:, :3], axis=0)
        inside = [k for k in range(count, 128) if in_hull(places[:count], places[k])][:40]
        assert len(inside) >= 39
        for values in table[:, 3:].T[:, :, None]:
            process = Gaussian(places[:count], values[:count])
            if share_predicted(values[:count], process.misses) < 0.8:
                continue  # it is refused
            for k in inside:
                weights, deviation = process.at(places[k])
                off = abs(values[k] - weights @ values[:count])
                within.setdefault(name, []).append(bool(off <= 2.0 * deviation))
    shares = {name: np.mean(each) for name, each in within.items()}
    assert min(shares.values()) >= 0.9, shares
    assert sum(map(len, within.values())) >= 80 * len(counts), "nearly all are predicted"


def test_a_line_of_few_runs_and_numbers_that_are_mostly_zero_have_wide_errors() -> None:
    """Where lengths that are too long would state errors that are too small."""
    places = qmc.Sobol(3, rng=5).random(128)
    x, y, z = places.T
    for values in (
        np.maximum(0.0, x - 0.6) ** 2 * (1.0 + 2.0 * y),
        np.maximum(0.0, x + y - 0.8) * (1.0 + z),
        x**2 * (1.0 + y) / (0.3 + z),
    ):
        process = Gaussian(places[:24], values[:24, None])
        inside = [k for k in range(24, 128) if in_hull(places[:24], places[k])]
        each = [process.at(places[k]) for k in inside]
        off = np.array(
            [values[k] - w @ values[:24] for k, (w, _) in zip(inside, each, strict=True)]
        )
        told = np.array([deviation[0] for _, deviation in each])
        assert np.mean(np.abs(off) <= 2.0 * told) >= 0.9
        assert np.sqrt(np.mean(told**2)) < 4.0 * np.sqrt(np.mean(off**2)), "not wide for safety"


def test_a_number_of_which_too_little_is_predicted_is_refused_as_for_sensitivity() -> None:
    dataset, few = sampled(noise), r"Q2 = .*: is the share of the variance of number"
    with pytest.raises(StudyError, match=few):
        predict(dataset, "number", x=0.5, y=0.5)
    with pytest.raises(StudyError, match=few):
        sensitivity(dataset, "number")
    dataset["known"] = dataset["x"] ** 2
    assert set(predict(dataset, x=0.5, y=0.5).data_vars) == {"known", "known_error"}
    with pytest.raises(StudyError, match="is the share of the variance"):
        predict(dataset[["status", "number"]], x=0.5, y=0.5)


@pytest.mark.parametrize("number", [rough, wavy])
def test_the_error_beside_is_that_at_unseen_places(number: Any) -> None:
    dataset = sampled(number)
    off, told = [], []
    for x, y in np.random.default_rng(3).uniform(0.15, 0.85, (12, 2)):
        found = predict(dataset, "number", x=x, y=y)
        off.append(found["number"].item() - number(x, y))
        told.append(found["number_error"].item())
    true = np.sqrt(np.mean(np.square(off)))
    assert 0.4 < np.sqrt(np.mean(np.square(told))) / true < 2.5
    attrs = found["number_error"].attrs
    assert attrs["long_name"] == "standard deviation of the predicted number"
    assert attrs["left_out"] > true / 1.5
    spread = dataset["number"].std().item()
    assert attrs["q2"] == pytest.approx(1.0 - (attrs["left_out"] / spread) ** 2)


def test_at_a_run_its_own_number_is_predicted_and_lines_are_too() -> None:
    dataset = sampled(smooth)
    run = dataset.isel(point=7)
    found = predict(dataset, ["number", "line"], x=run.x.item(), y=run.y.item())
    assert found["number"].item() == pytest.approx(run["number"].item(), abs=1e-3)
    assert found["line"].dims == ("depth",)
    assert np.allclose(found["line"], run["line"], atol=1e-3)
    assert found["number"].attrs["units"] == found["number_error"].attrs["units"] == "MPa"
    assert found["number_error"].item() < 1e-2
    between = predict(dataset, "line", x=0.5, y=0.5)
    assert np.allclose(between["line"], smooth(0.5, 0.5) * np.exp(-dataset["depth"]), atol=1e-2)


class Unread(BackendArray):
    """Values of a file that nobody may read."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape, self.dtype = shape, np.dtype(float)

    def __getitem__(self, key: Any) -> Any:
        raise AssertionError("maps are not needed, and may be larger than the memory")


def test_only_what_is_asked_for_is_read() -> None:
    dataset = sampled(smooth)
    lazy = LazilyIndexedArray(Unread((64, 9)))
    dataset["map"] = xr.Variable(("point", "z"), lazy)
    found = predict(dataset, "number", x=0.5, y=0.5)
    assert found["number"].item() == pytest.approx(smooth(0.5, 0.5), abs=1e-2)
    with pytest.raises(AssertionError, match="are not needed"):
        predict(dataset, "map", x=0.5, y=0.5)


def test_a_place_outside_the_hull_or_across_failed_runs_is_refused() -> None:
    dataset = sampled(smooth)
    with pytest.raises(StudyError, match="outside the hull of the runs"):
        predict(dataset, "number", x=dataset.x.min().item(), y=dataset.y.max().item())
    with pytest.raises(StudyError, match=r"x = 2\.0: must be between"):
        predict(dataset, "number", x=2.0, y=0.5)
    near = int(np.hypot(dataset["x"] - 0.5, dataset["y"] - 0.5).to_numpy().argmin())
    dataset["status"][near] = "limit_load"
    with pytest.raises(StudyError, match="is across a failed run: limit_load"):
        predict(dataset, "number", x=0.5, y=0.5)
    for wrong, told in [
        ({"x": 0.5}, "y = '': must be given, because it varies"),
        ({"x": 0.5, "z": 0.5}, "z = 0.5: must be one of"),
        ({"x": "a", "y": 0.5}, "x = 'a': must be a number"),
    ]:
        with pytest.raises(StudyError, match=told):
            predict(dataset, "number", **wrong)
    with pytest.raises(StudyError, match="did you mean number"):
        predict(dataset, "numbr", x=0.5, y=0.5)
    with pytest.raises(StudyError, match="by = 'cells': must be one of gaussian"):
        predict(dataset, "number", by="cells", x=0.5, y=0.5)


def test_a_refinement_is_predicted_in_its_cells_and_the_run_of_a_place_is_exact(
    store: Store,
) -> None:
    words = AXES | {"hardening": ["none", "isotropic"]}
    asked = study({"halvings": 1}, words, scene=WHOLE, trouble="limit")
    search_here(asked, store)
    at = {"load_ratio": 0.77, "friction": 0.11, "hardening": "none"}
    with open_study(store.directory) as dataset:
        found = predict(dataset, **at)
        exact = 2.0 * (0.77 - 0.4 - 0.11)
        assert abs(found[OF].item() - exact) <= found[f"{OF}_error"].item() + 1e-9
        half = predict(dataset, **at | {"hardening": "isotropic"})[OF].item()
        assert half == pytest.approx(found[OF].item() / 2.0, abs=0.05)
        whole = predict(dataset, "residual_stress", **at)["residual_stress"]
        assert whole.dims == ("component", "y", "x")
        assert np.isfinite(whole.isel(y=0)).all()
        with pytest.raises(StudyError, match="is across failed runs: its cell is"):
            predict(dataset, **at | {"load_ratio": 0.98, "friction": 0.39})
        told = answer(dataset, asked, store, OF, at, within=0.0)
        assert (told.by, told.enough) == ("cells", told.error == 0.0)
        compute_here(told.run, store, asked.problem)
        again = answer(dataset, asked, store, OF, at, within=0.0)
        assert (again.by, again.error, again.enough) == ("run", 0.0, True)
        assert again.value == pytest.approx(exact)
        with pytest.raises(StudyError, match="residual_stress is over component, y, x: must"):
            answer(dataset, asked, store, "residual_stress", at)


def test_beside_failed_runs_a_cell_tells_a_number_or_no_error() -> None:
    """Also one without runs in the middles of its edges."""
    found = refined_by(bitten, halvings=4)
    x, y = np.array([each.point for each in found.asked]).T
    numbers = [found.number(each) for each in found.asked]
    status = np.array(["ok" if each else "limit_load" for each in numbers], dtype=object)
    dataset = xr.Dataset(
        {
            "status": ("point", status),
            OF: ("point", np.array([each[0] if each else np.nan for each in numbers])),
            "other": ("point", np.where(status == "ok", 2.0 * x, np.nan)),
            f"cell_error_{OF}": (
                "cell", [each.left[0] if each.left else np.nan for each in found.cells],
            ),
            "cell_state": ("cell", np.array([each.state for each in found.cells], dtype=object)),
        }
        | {
            f"cell_{name}_{end}": ("cell", [getattr(each.cell, end)[k] for each in found.cells])
            for k, name in enumerate("xy")
            for end in ("low", "high")
        },
        coords={
            "point": ("point", np.arange(len(x)), {"sets": "x y"}),
            "x": ("point", x),
            "y": ("point", y),
        },
    )  # fmt: skip
    bare = 0
    for cell, _, left in found.cells:
        at = {n: 0.7 * a + 0.3 * b for n, a, b in zip("xy", cell.low, cell.high, strict=True)}
        if not left:
            with pytest.raises(StudyError, match="is across failed runs"):
                predict(dataset, OF, **at)
            continue
        told = predict(dataset, [OF, "other"], **at)
        assert told["other"].item() == pytest.approx(2.0 * at["x"])
        assert told[f"{OF}_error"].item() == left[0]
        exact = bitten(**at)
        assert exact is not None
        assert told[OF].item() == pytest.approx(exact, abs=0.025)
        if cell.bare == (0, 1):
            bare += 1
            assert told["other_error"].item() == pytest.approx(2.0 * (cell.high[0] - cell.low[0]))
    assert bare > 4


def test_a_grid_is_predicted_by_a_process(store: Store) -> None:
    grid = fake_study(sweep={"load_ratio": [0.2, 0.4, 0.6, 0.8], "friction": [0.0, 0.2, 0.4]})
    compute_here(grid, store)
    with open_study(store.directory) as dataset:
        found = predict(dataset, load_ratio=0.5, friction=0.1, hardening="none")
        assert found["peak_contact_pressure"].item() == pytest.approx(50.0 + 50.0 * 1.1, rel=1e-3)
        with pytest.raises(StudyError, match="must be one of none"):
            predict(dataset, load_ratio=0.5, friction=0.1, hardening="isotropic")


def test_a_number_that_was_not_refined_tells_a_branch(store: Store) -> None:
    pads = {"wide": {"half_width": 50.0}, "narrow": {"half_width": 20.0}}
    search_here(study({"halvings": 1}, AXES | {"pad": pads}), store)
    at = {"load_ratio": 0.9, "friction": 0.05}
    with open_study(store.directory) as dataset:
        found = predict(dataset, **at, half_width=20.0)
        assert found[OF].item() == pytest.approx(0.9, abs=0.05)
        with pytest.raises(StudyError, match=r"half_width = 30\.0: must be one of 50\.0, 20\.0"):
            predict(dataset, **at, half_width=30.0)
        with pytest.raises(StudyError, match="only numbers the runs: give what it sets"):
            predict(dataset, **at, half_width=20.0, point=3)


def test_a_switch_tells_a_branch_and_is_one_of_the_run_to_add(store: Store) -> None:
    refine = {"of": ["peak_contact_pressure"], "halvings": 1}
    content = {"name": "hot", "sweep": AXES | {"hot": [False, True]}, "refine": refine}
    asked = Study.from_dict(content, SWITCHED)
    search_here(asked, store)
    with open_study(store.directory) as dataset:
        at = {"load_ratio": 0.5, "friction": 0.1, "hot": "true"}
        told = answer(dataset, asked, store, "peak_contact_pressure", at, within=0.0)
    assert told.value == pytest.approx(105.0)
    assert told.run.parameters["hot"] is True


def test_what_a_search_found_is_no_number_of_runs(store: Store) -> None:
    goal = {"find": "limit_load", "between": [0.1, 2.0]}
    asked = Study.from_dict({"name": "goal", "scene": "fake", "goal": goal})
    with pytest.raises(StudyError, match="study = 'goal': has what a search found"):
        answer(xr.Dataset(), asked, store, "load_ratio", {})
