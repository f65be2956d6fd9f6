"""Refinement: the runs that it asks for, the errors that it states, and its data set."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.results.record import Record, Status
from studies import (
    Bounds,
    Store,
    Study,
    StudyError,
    estimate,
    open_study,
    predict,
)
from studies.execution.asking import Asking
from studies.kinds.refine.cells import between, weights
from studies.kinds.refine.refinement import Refine, Refinement, Wanted
from tests.studies.conftest import results_of
from tests.studies.fakes import FAKE, Canned, FakeParameters, bare, record
from tests.studies.killed import see_it_taken_up
from tests.studies.test_goal import search_here

OF = "peak_residual_tension"
AXES = {"load_ratio": [0.1, 1.0], "friction": [0.0, 0.4]}
PRESSURE = {"of": "contact_pressure", "at": {"stage": "loaded"}, "take": "largest"}
Number = Callable[[float, float], float | None]


def kinked(x: float, y: float) -> float:
    """Return a number that is 0 up to a curve, and rises from it."""
    return max(0.0, x * x + y * y - 0.6)


def bounded(x: float, y: float) -> float | None:
    """Return a smooth number, which is not known beyond a slanting line."""
    return None if x + 0.3 * y > 0.81 else math.exp(-3.0 * x) + 0.2 * y


def bitten(x: float, y: float) -> float | None:
    """Return a smooth number, which is not known in a disk."""
    return None if math.hypot(x - 0.7, y - 0.6) < 0.33 else math.exp(-3.0 * x) + 0.2 * y


def split(x: float, y: float) -> float | None:
    """Return a smooth number, which is not known in a band that ends."""
    return None if abs(y - 0.45 - 0.1 * x) < 0.06 and x > 0.3 else x * x + y


def forked(x: float, y: float) -> float | None:
    """Return a wavy number, which is not known in a disk, except in a slit, and beyond in a band.

    Slit and band are narrower than many cells whose own runs do not tell them.
    """
    disk, band = math.hypot(x - 0.2, y - 0.3) < 0.15, abs(y - 0.18 - 0.6 * x) < 0.02
    return None if disk != (band and x > 0.2) else max(0.0, math.sin(6 * x) * math.cos(6 * y)) + x


def power(x: float, y: float) -> float:
    """Return a number that changes in one corner only."""
    return float(x**6 * (1.0 + y))


def steep(x: float, y: float) -> float:
    """Return a number that jumps at a slanting line."""
    return 1.0 if x + 0.31 * y > 0.7 else 0.3 * x


def slanting(x: float, y: float) -> float:
    """Return a number with a kink through opposite corners of cells."""
    return max(0.0, x + y - 0.75)


def refined_by(number: Number, seed: int = 0, **asked: Any) -> Refinement:
    """Refine a function over the unit square; its runs end in random order."""
    entries = {"until": 0.02, "most": 1000, "halvings": 5} | asked
    axes: Any = {"load_ratio": [0.0, 1.0], "friction": [0.0, 1.0]}
    found = Refinement(Refine.read({"of": OF, **entries}, FAKE, axes), [{}])
    order = random.Random(seed)
    while wants := found.wants:
        wanted = order.choice(wants)
        value = number(*wanted.point)
        status = "limit_load" if value is None else "ok"
        found.tell(wanted, {"status": status, "scalars": {OF: value}})
        assert len(found.asked) <= entries["most"]
    assert found.reason
    return found


def errors(found: Refinement, number: Number, points: int) -> tuple[float, int]:
    """Return the largest error in the unit square, and how many of these places are refused."""
    largest, refused = 0.0, 0
    for point in np.random.default_rng(1).random((points, 2)).tolist():
        exact = number(*point)
        cell = next(each for each in found.settled if each.cell.holds(0, tuple(point)))
        if exact is None:
            continue
        if not cell.left:
            refused += 1
            continue
        runs = {each.point for each in found.asked}
        parts = weights(cell.cell.low, cell.cell.high, tuple(point), runs)
        assert sum(parts.values()) == pytest.approx(1.0)
        numbers = {at: found.number(Wanted(0, at)) for at in parts}
        value = sum(parts[at] * each[0] for at, each in numbers.items() if each)
        largest = max(largest, abs(value - exact))
    return largest, refused


def of_a_grid(number: Callable[[float, float], float], intervals: int) -> float:
    """Return the largest error between the runs of a uniform grid, linear in its cells."""
    at = np.linspace(0.0, 1.0, intervals + 1)
    values = np.array([[number(x, y) for y in at] for x in at])
    largest = 0.0
    for x, y in np.random.default_rng(1).random((300, 2)):
        i, j = int(x * intervals), int(y * intervals)
        s, t = x * intervals - i, y * intervals - j
        own = values[i : i + 2, j : j + 2]
        largest = max(largest, abs(np.array([1 - s, s]) @ own @ [1 - t, t] - number(x, y)))
    return largest


@pytest.mark.parametrize(("number", "until", "times"), [(power, 0.02, 4.0), (kinked, 0.01, 1.5)])
def test_few_runs_reach_the_error_of_a_large_grid(
    number: Callable[[float, float], float], until: float, times: float
) -> None:
    found = refined_by(number, until=until, halvings=6)
    largest, _ = errors(found, number, 300)
    intervals = next(k for k in range(3, 200, 2) if of_a_grid(number, k) <= largest)
    assert (intervals + 1) ** 2 >= times * len(found.asked)


@pytest.mark.parametrize("number", [power, kinked, bounded])
def test_the_stated_error_is_that_between_the_runs_within_a_factor_of_two(number: Number) -> None:
    found = refined_by(number)
    stated = max(each.left[0] for each in found.settled if each.left)
    largest, _ = errors(found, number, 400)
    assert 0.5 <= stated / largest <= 2.0


def test_a_kink_through_corners_of_cells_is_found() -> None:
    """No edge of a small cell misses its middle."""
    found = refined_by(slanting)
    largest, _ = errors(found, slanting, 400)
    assert largest < 0.02 * 1.25
    stated = max(each.left[0] for each in found.settled)
    assert 0.5 <= stated / largest <= 2.0


def test_between_two_runs_a_kink_and_a_parabola_leave_what_they_leave() -> None:
    """The largest distance of a function from the line between its values at two places."""
    for kink in (0.1, 0.5, 0.7):
        assert between(1.0, 1.0 - kink, kink, 0.0) == pytest.approx(kink * (1.0 - kink))
    assert between(2.0, 4.0, 4.0, 4.0) == pytest.approx(1.0), "of x^2, whose slope changes by 4"


@pytest.mark.parametrize("number", [kinked, bounded, steep, slanting, forked])
def test_the_runs_do_not_depend_on_the_order_in_which_they_end(number: Number) -> None:
    for most in (1000, 60, 31):
        first = refined_by(number, most=most)
        for seed in (1, 2):
            other = refined_by(number, seed, most=most)
            assert other.asked == first.asked
            assert other.cells == first.cells


def test_jumps_and_failed_regions_are_resolved_to_the_smallest_cell_and_no_further() -> None:
    for number in (steep, bounded):
        found = refined_by(number, halvings=3)
        states = Counter(each.state for each in found.settled)
        assert states["smallest"] >= 8
        for each in found.settled:
            assert max(each.cell.halved) <= 3
        assert sum(0.5 ** sum(each.cell.halved) for each in found.settled) == 1.0
    _, refused = errors(found, bounded, 400)
    assert 0 < refused < 400 * 0.125 * 2.0, "only along the edge of the failed region"
    assert states["failed"] > 0


@pytest.mark.parametrize(("number", "times"), [(bitten, 3.0), (split, 4.0), (bounded, 4.0)])
def test_a_failed_region_is_refused_as_in_a_grid_that_takes_many_times_the_runs(
    number: Number, times: float
) -> None:
    found = refined_by(number)
    _, refused = errors(found, number, 400)
    intervals = 2**5
    assert (intervals + 1) ** 2 > times * len(found.asked)
    at = np.linspace(0.0, 1.0, intervals + 1)
    failed = np.array([[number(x, y) is None for y in at] for x in at])
    of_the_grid = 0
    for x, y in np.random.default_rng(1).random((400, 2)).tolist():
        i, j = int(x * intervals), int(y * intervals)
        of_the_grid += number(x, y) is not None and failed[i : i + 2, j : j + 2].any()
    assert refused <= of_the_grid + 1


@pytest.mark.parametrize(
    ("number", "halvings"), [(bitten, 2), (bitten, 4), (split, 3), (bounded, 3), (forked, 5)]
)
def test_no_cell_with_an_error_has_a_failed_run(number: Number, halvings: int) -> None:
    """Neither of its own, nor one that a cell beside it asked for."""
    found = refined_by(number, halvings=halvings)
    for each in found.settled:
        inside = [wanted for wanted in found.asked if each.cell.holds(*wanted)]
        known = sum(found.number(wanted) is not None for wanted in inside)
        assert bool(each.left) == (known == len(inside))
        assert (each.state == "failed") == (known == 0)
        assert all(map(math.isfinite, each.left))


def test_the_largest_number_of_runs_ends_it_where_it_missed_most() -> None:
    found = refined_by(power, most=20)
    assert found.reason == "most"
    assert len(found.asked) <= 20
    left = [each.cell for each in found.settled if each.state == "most"]
    assert left
    assert min(cell.low[0] for cell in left) >= 0.5, "where the number changes most"


def test_what_one_cell_of_the_first_round_hides_is_found_at_its_centre() -> None:
    def hidden(x: float, y: float) -> float:
        return 16.0 * x * (1.0 - x) * y * (1.0 - y)

    found = refined_by(hidden, until={OF: 0.02})
    assert len(found.asked) > 30
    assert errors(found, hidden, 500)[0] < 0.03


def test_a_smooth_number_ends_with_the_first_round() -> None:
    found = refined_by(lambda x, y: 2.0 * x - 3.0 * y + x * y)
    assert len(found.asked) == 9
    assert [each.state for each in found.settled] == ["settled"]
    flat = refined_by(lambda x, y: 1.0)
    assert len(flat.asked) == 9
    assert refined_by(lambda x, y: None).cells[0].state == "failed"


def test_parts_are_asked_for_before_their_round_has_ended() -> None:
    """Except where the largest number of runs might not allow it."""
    for most, early in [(1000, True), (40, False)]:
        axes: Any = {"load_ratio": [0.0, 0.5, 1.0], "friction": [0.0, 1.0]}
        asked = Refine.read({"of": OF, "until": 0.001, "most": most}, FAKE, axes)
        found = Refinement(asked, [{}])
        first = len(found.asked)

        def tell(some: Callable[[Wanted], bool], found: Refinement = found) -> None:
            for wanted in filter(some, found.wants):
                scalars = {OF: math.sin(7.0 * wanted.point[0]) + wanted.point[1] ** 2}
                found.tell(wanted, {"status": "ok", "scalars": scalars})

        tell(lambda wanted: True)
        assert len(found.asked) > first
        second = len(found.asked)
        tell(lambda wanted: wanted.point[0] < 0.5)
        assert found.wants
        assert (len(found.asked) > second) == early


def test_whole_numbers_are_divided_down_to_neighbours() -> None:
    asked = Refine.read(
        {"of": OF, "until": 0.001, "most": 100, "halvings": 9}, FAKE, {"passes": [1, 12]}
    )
    found = Refinement(asked, [{}])
    while wants := found.wants:
        n = wants[0].point[0]
        found.tell(wants[0], {"status": "ok", "scalars": {OF: float(n**3)}})
    assert all(isinstance(wanted.point[0], int) for wanted in found.asked)
    assert {each.cell.high[0] - each.cell.low[0] for each in found.settled} <= {1, 2}


def bent(parameters: FakeParameters, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield records with a number that has a kink, and above a load no equilibrium."""
    monitor(1.0)
    for load_ratio in values:
        run = replace(parameters, load_ratio=load_ratio)
        made = record(run)
        if load_ratio + run.friction > 1.2 and run.trouble == "limit":
            bare = {"x": made.coordinates["x"]}
            yield Record(
                parameters=run, status=Status.LIMIT_LOAD, message="flows", coordinates=bare,
                symmetric=True,
            )  # fmt: skip
            continue
        number = max(0.0, load_ratio - 0.4 - run.friction) * (2.0 if run.hardening == "none" else 1)
        yield replace(made, scalars=dict(made.scalars) | {OF: number})


def numbers(parameters: FakeParameters, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield the same records without fields."""
    yield from map(bare, bent(parameters, values, monitor))


BENT = Canned(
    name="bent", summary="a scene with a kink", parameters=FakeParameters, branch="load_ratio",
    records=numbers,
)  # fmt: skip
WHOLE = replace(BENT, name="whole", records=bent)


def test_rounding_of_a_number_that_does_not_vary_is_not_refined() -> None:
    found = refined_by(lambda x, y: 5.0 + 1e-15 * ((37.0 * x + 91.0 * y) % 1.0))
    assert len(found.asked) == 9
    assert {each.state for each in found.settled} == {"settled"}


def study(
    asked: dict[str, Any] | None = None, sweep: Any = None, scene: Canned = BENT, **fixed: Any
) -> Study:
    refine = {"of": [OF], "until": 0.05, "halvings": 2} | (asked or {})
    content = {"name": "refined", "parameters": fixed, "sweep": sweep or AXES, "refine": refine}
    return Study.from_dict(content, scene)


def test_the_data_set_has_the_runs_as_points_and_the_error_of_each_cell(store: Store) -> None:
    words = AXES | {"hardening": ["none", "isotropic"]}
    asked = study(sweep=words, trouble="limit")
    computed = search_here(asked, store)
    assert len(computed) == len(set(computed))
    with open_study(store.directory) as dataset:
        assert dataset.sizes["point"] == len(computed)
        assert set(dataset["run"].to_numpy()) == set(computed)
        assert dataset["round"].to_numpy().tolist() == sorted(dataset["round"].to_numpy())
        assert set(dataset["hardening"].to_numpy()) == {"none", "isotropic"}
        assert (dataset["status"] == "limit_load").any()
        ok = dataset["status"] == "ok"
        for name, factor in (("none", 2.0), ("isotropic", 1.0)):
            own = dataset.isel(point=ok & (dataset["hardening"] == name))
            exact = factor * np.maximum(0.0, own["load_ratio"] - 0.4 - own["friction"])
            assert np.allclose(own[OF], exact)
        cells = dataset["cell_state"].to_numpy().tolist()
        left = dataset[f"cell_error_{OF}"].to_numpy()
        assert {"settled", "smallest"} <= set(cells)
        assert np.isfinite(left[[each == "settled" for each in cells]]).all()
        area = 1.0
        for axis in AXES:
            area = area * (dataset[f"cell_{axis}_high"] - dataset[f"cell_{axis}_low"])
        assert area.sum().item() == pytest.approx(2 * 0.9 * 0.4)


def test_one_value_of_a_variable_with_dimensions_is_refined(store: Store) -> None:
    asked = study({"of": [PRESSURE]}, scene=WHOLE, half_width=2.0)
    search_here(asked, store)
    name = "contact_pressure_loaded_largest"
    with open_study(store.directory) as dataset:
        assert dataset[name].attrs["units"] == "MPa"
        assert np.allclose(dataset[name], dataset["peak_contact_pressure"])
        found = predict(dataset, load_ratio=0.3, friction=0.1)
        assert found[name].item() == pytest.approx(100.0 * 0.3 * 1.1 + 2.0)
    nowhere = PRESSURE | {"at": {"stage": "cold"}}
    with pytest.raises(StudyError, match="has no stage = cold; it has loaded, unloaded"):
        search_here(study({"of": [nowhere]}, scene=WHOLE, half_width=2.0), store)


def test_an_interrupted_refinement_goes_on_and_asks_for_the_same_runs(tmp_path: Path) -> None:
    asked = study({"of": [OF, PRESSURE], "halvings": 1}, scene=WHOLE, trouble="limit")
    at_once = search_here(asked, Store(tmp_path / "a"))
    store, parts = Store(tmp_path / "b"), []
    while some := search_here(asked, store, most=14):
        parts += some
    assert sorted(parts) == sorted(at_once), "the same runs, and none twice"
    with open_study(tmp_path / "a") as one, open_study(tmp_path / "b") as other:
        assert results_of(one).equals(results_of(other))
    assert store.runs_of(asked) == set(at_once)


def test_runs_that_the_scene_refuses_count_as_failed(store: Store) -> None:
    sweep = {"load_ratio": [0.1, 1.0], "friction": [0.0, 0.9]}
    asked = study({"until": {OF: 0.01}}, sweep, state="plane_strain")
    program = Asking(asked, store).places[0].program
    wide = Refinement(Refine.read(program.refine.content, FAKE, {"friction": [0.0, 1.0]}), [{}])
    assert wide.refuse(wide.wants[0], "at most 0.9 in plane strain")
    assert wide.number(Wanted(0, (0.0,))) is None


def test_a_study_with_a_refinement_has_an_id_and_is_read_again() -> None:
    one = study()
    assert Study.from_dict(one.to_dict(), BENT).id == one.id
    assert study({"until": 0.04}).id != one.id
    assert study({"most": 200}).id == one.id
    whole = {key: value for key, value in one.to_dict().items() if key != "refine"}
    assert Study.from_dict(whole, BENT).id != one.id


def test_the_estimate_is_the_most_that_it_may_take(store: Store) -> None:
    found = estimate(study({"most": 50}), store)
    assert found.runs == found.to_compute == 50
    with pytest.raises(StudyError, match="at most 10: use fewer values"):
        Bounds(runs=10).refuse(runs=study().size)


@pytest.mark.parametrize(
    ("change", "field", "allowed"),
    [
        ({"off": 1}, "refine.off", "did you mean of?"),
        ({"of": []}, "refine.of", "1 or more"),
        (
            {"of": ["contact_pressure"]},
            "refine.of[0]",
            'is over stage, s: give at = {stage = …, s = …}, or take = "largest"',
        ),
        ({"of": ["peak_residual_tensio"]}, "refine.of[0]", "did you mean peak_residual_tension?"),
        ({"of": PRESSURE | {"take": "mean"}}, "refine.of.take", "largest"),
        ({"of": PRESSURE | {"at": {"stag": "loaded"}}}, "refine.of.at.stag", "did you mean stage?"),
        ({"of": {"of": OF, "take": "largest"}}, "refine.of.take", "leave it out"),
        ({"of": [7]}, "refine.of[0]", "must be a table"),
        ({"until": 0.0}, "refine.until", "a share of the range"),
        ({"until": {"other": 1.0}}, "refine.until", "for each of `of`"),
        ({"until": {OF: 10**400}}, "refine.until", "for each of `of`"),
        ({"most": 5}, "refine.most", "at least 9, the runs of the first round"),
        ({"most": True}, "refine.most", "an integer"),
        ({"halvings": 0}, "refine.halvings", "at least 1"),
    ],
)
def test_a_wrong_refinement_is_refused_in_one_line(
    change: dict[str, Any], field: str, allowed: str
) -> None:
    with pytest.raises(StudyError) as caught:
        study(change)
    assert caught.value.field == field
    assert allowed in caught.value.allowed
    assert "\n" not in str(caught.value)


def test_a_refinement_needs_axes_of_numbers_and_no_goal() -> None:
    for sweep in ({"load_ratio": [0.5]}, {"hardening": ["none", "isotropic"]}):
        with pytest.raises(StudyError, match="needs 1 to 4 axes of two numbers or more"):
            study(sweep=sweep)
    content = study().to_dict() | {"goal": {"find": "limit_load", "between": [0.1, 1.0]}}
    with pytest.raises(StudyError, match=r"keep one|take it out"):
        Study.from_dict(content, FAKE)


@pytest.mark.processes
def test_a_killed_refinement_is_taken_up_and_computes_no_run_twice(tmp_path: Path) -> None:
    out, file = tmp_path / "out", tmp_path / "study.toml"
    file.write_text(
        'name = "refined"\nscene = "fake"\n[parameters]\nseconds = 0.2\n'
        "[sweep]\nload_ratio = [0.1, 0.9]\nfriction = [0.0, 0.4]\n"
        '[refine]\nof = ["peak_contact_pressure"]\n'
    )
    asked = Study.from_toml(file)
    see_it_taken_up(asked, out, 4, "run")
    with open_study(out) as dataset:
        assert dataset.sizes["point"] == 9
