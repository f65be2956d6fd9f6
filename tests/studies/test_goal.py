"""Studies with a goal: the search, its runs, and the data set of what it finds."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from residua.cli import main
from solver.derivatives.asked import named
from solver.errors import ModelError
from solver.results.quantities import Quantity
from solver.results.record import Record
from solver.scenes import Scene
from studies import Bounds, Store, Study, StudyError, StudyEvent, estimate, open_study, run_study
from studies.definition.identity import solver_hash
from studies.definition.neighbours import Neighbours
from studies.execution.asking import Asking
from studies.execution.executor import Limits
from studies.execution.result import answered
from studies.execution.run import _Work
from studies.execution.task import PathTask, walk
from studies.kinds import found_of
from studies.kinds.goal.search import Goal, Search
from studies.scenes.scene import read_scene
from tests.marks import HERE
from tests.studies.conftest import fake_study, results_of
from tests.studies.fakes import FAKE, FOLLOWED, Canned, FakeParameters, Followed, numbers
from tests.studies.killed import see_it_taken_up

PRESSURE = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
"""Of the fake scene the pressure is 100 load_ratio (1 + friction) + half_width."""
SWEEP = {"friction": [0.0, 0.4], "half_width": [20.0, 50.0]}


SCENES = ["numbers", "followed"]
"""Scenes of which each round is a path, and of which a path goes on to the end of the search."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gapped(FakeParameters):
    """Parameters of which some values between others are refused, at one friction."""

    def __post_init__(self) -> None:
        if self.friction > 0.0 and 1.0 < self.load_ratio < 3.0:
            raise ModelError("load_ratio", self.load_ratio, "not between 1 and 3")


@dataclass(frozen=True, slots=True, kw_only=True)
class Unmeshed(Followed):
    """A scene whose model cannot be built."""

    def follow(self, *_: Any) -> Iterator[Record]:
        raise ZeroDivisionError("no mesh")


def alone(parameters: Any, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield the record of a scene without a branch."""
    return numbers(parameters, [parameters.load_ratio], monitor)


def study(goal: dict[str, Any], sweep: Any = None, scene: str = "numbers", **fixed: Any) -> Study:
    content = {"name": "goal", "scene": scene, "parameters": fixed, "goal": goal}
    return Study.from_dict(content | {"sweep": SWEEP if sweep is None else sweep})


def search_here(study: Study, store: Store, most: int = 10**6) -> list[str]:
    """Search, or refine, in this process, until there are so many runs; return their ids."""
    goals, computed = Asking(study, store), []

    def hear(message: dict[str, Any]) -> None:
        if "row" in message:
            computed.append(message["row"]["id"])
            goals.heard(message["path"], message["row"])

    for asked in goals.paths():
        if asked is None:
            break
        task = PathTask(
            study.problem, (asked.path,), store.directory, solver_hash(), study.keep,
            limit=asked.limit, place=asked.place,
        )  # fmt: skip
        walk(task, hear, lambda: len(computed) >= most)
        if len(computed) >= most:
            break
        goals.closed(asked.path.id)
    store.reconcile()
    store.save_study(study)
    answered(study, store, goals, anew=True)
    return computed


def searched(
    goal: Goal,
    number: Callable[[float], float | None],
    expected: float | None = None,
    slope: Callable[[float], float] | None = None,
) -> Search:
    """Search with a function of the parameter; None stands for a limit load."""
    search = Search(goal, expected)
    while wanted := search.wants:
        value = random.choice(wanted)
        known = number(value)
        status = "limit_load" if known is None else "ok"
        scalars = {"peak_contact_pressure": known}
        scalars |= {goal.slope("peak_contact_pressure"): slope(value)} if slope else {}
        search.tell(value, {"id": str(value), "status": status, "scalars": scalars, "message": ""})
    return search


@pytest.mark.parametrize("kind", ["at", "first_above", "first_below"])
@pytest.mark.parametrize("parameter", ["load_ratio", "friction"])
def test_a_search_finds_its_value_with_no_more_runs_than_it_says(parameter: str, kind: str) -> None:
    random.seed(1)
    sign, taken = -1.0 if kind == "first_below" else 1.0, []
    asked = {"parameter": parameter, "of": "peak_contact_pressure", kind: 0.0}
    goal = Goal.read(asked | {"within": 1e-3, "between": [0.1, 1.0]}, FAKE, {})
    for _ in range(60):
        root, power = math.exp(random.uniform(math.log(0.1), 0.0)), random.choice([0.5, 1.0, 3.0])

        def number(value: float, root: float = root, power: float = power) -> float:
            return sign * math.copysign(abs(value - root) ** power, value - root)

        found = searched(goal, number)
        assert found.reason == "passed"
        assert found.low <= root <= found.high <= found.low / (1.0 - 1.001e-3)
        assert found.found == pytest.approx(root, rel=1e-3)
        assert found.rounds <= goal.most[0]
        assert len(found.rows) <= goal.most[1]
        taken.append(len(found.rows))
    if (kind, parameter) == ("at", "friction"):
        assert np.mean(taken) < goal.most[1] - 2, "interpolation takes fewer runs than bisection"


@pytest.mark.parametrize("kind", ["at", "first_above"])
@pytest.mark.parametrize("scene", [FAKE, FOLLOWED])
@pytest.mark.parametrize("parameter", ["load_ratio", "friction"])
def test_slopes_save_runs_and_stay_within_the_most(parameter: str, scene: Scene, kind: str) -> None:
    """A number that bends, and is flat below the goal for ``first_above``."""
    random.seed(1)
    asked = {"parameter": parameter, "of": "peak_contact_pressure", kind: 0.0}
    asked |= {"within": 1e-3, "between": [0.1, 1.0]}
    derivative = Quantity(name=named("peak_contact_pressure", parameter), long_name="")
    goals = [
        Goal.read(asked, each, {}) for each in (scene, replace(scene, quantities=(derivative,)))
    ]
    taken = np.zeros(2)
    for _ in range(60):
        root, bend = math.exp(random.uniform(math.log(0.1), 0.0)), random.uniform(-0.5, 0.5)

        def flat(value: float, root: float = root) -> bool:
            return kind == "first_above" and value < root

        def number(value: float, root: float = root, bend: float = bend) -> float:
            return 0.0 if flat(value) else (value - root) * (1.0 + bend * (value - root))

        def slope(value: float, root: float = root, bend: float = bend) -> float:
            return 0.0 if flat(value) else 1.0 + 2.0 * bend * (value - root)

        for k, goal in enumerate(goals):
            found = searched(goal, number, slope=slope if k else None)
            assert found.reason == "passed"
            assert found.low <= root <= found.high <= found.low / (1.0 - 1.001e-3)
            assert len(found.rows) <= goal.most[1] and found.rounds <= goal.most[0]
            taken[k] += len(found.rows)
    if parameter == "friction":  # a run each, not several along a path
        assert taken[1] < (3 / 4 if kind == "at" else 2 / 3) * taken[0]
    else:
        assert taken[1] <= taken[0]


@pytest.mark.solves
def test_slopes_of_the_steady_strain_lead_to_the_shakedown_limit(store: Store) -> None:
    """Bree's wall ratchets above a thermal stress of 4 (1 - 0.8); bisection takes 8 runs."""
    content = {
        "name": "shaken", "parameters": {"steady": 0.8},
        "goal": {"parameter": "thermal", "find": "shakedown_limit", "between": [0.5, 4.5]},
        "derivatives": {
            "by": ["thermal"], "of": ["steady_plastic_increment", "steady_net_increment"],
        },
    }  # fmt: skip
    limit = Study.from_dict(content, read_scene(HERE.parent / "data/scenes/bree.toml"))
    run_study(limit, store, workers=0)
    found = open_study(store.dataset_path(limit.id))
    assert found["thermal"].item() == pytest.approx(0.8, rel=0.01)
    assert found["runs"].item() <= 5


def test_a_search_of_whole_numbers_ends_at_neighbours() -> None:
    asked = {"parameter": "passes", "of": "peak_contact_pressure", "first_above": 0.0}
    found = searched(Goal.read(asked | {"between": [1, 10]}, FAKE, {}), lambda value: value - 6.5)
    assert (found.low, found.high) == (6, 7)
    assert all(isinstance(value, int) for value in found.rows)


def test_a_range_about_zero_is_divided_in_equal_steps() -> None:
    asked = {"parameter": "friction", "of": "peak_contact_pressure", "at": 0.0}
    goal = Goal.read(asked | {"between": [0.0, 0.5], "within": 0.01}, FAKE, {})
    found = searched(goal, lambda value: value - 1e-3)
    assert found.high - found.low <= 0.005 * 1.0001
    assert found.found == pytest.approx(1e-3, abs=1e-9)


def test_no_equilibrium_is_beyond_and_told_apart() -> None:
    goal = Goal.read(PRESSURE, FAKE, {})
    found = searched(goal, lambda value: None if value > 0.8 else 100.0 * value)
    assert found.reason == "limit_load"
    assert found.low <= 0.8 <= found.high
    assert searched(goal, lambda value: 100.0 * value).reason == "passed"
    assert searched(goal, lambda value: 1.0).reason == "never"
    assert searched(goal, lambda value: None).reason == "already"


def test_a_bracket_that_is_halved_has_its_ends_on_trust_until_the_search_comes_to_one() -> None:
    asked = {"parameter": "friction", "of": "peak_contact_pressure", "first_above": 0.0}
    goal = Goal.read(asked | {"between": [0.1, 0.4]}, FAKE, {})
    inside = searched(goal, lambda value: value - 0.25)
    assert (inside.reason, {0.1, 0.4} & inside.rows.keys()) == ("passed", set())
    for root, reason in ((0.05, "already"), (0.5, "never"), (0.1001, "passed")):
        found = searched(goal, lambda value, root=root: value - root)
        assert found.reason == reason
        assert (0.4 if root > 0.4 else 0.1) in found.rows
        assert math.isnan(found.found) == (reason != "passed")


@pytest.mark.parametrize("off", [-8.0, -1.2, 0.0, 0.4, 3.0, 30.0])
def test_a_search_begins_where_its_goal_is_expected(off: float) -> None:
    """Runs by the distance, in widths of the last bracket: two if it is less than half of one."""
    asked = {"parameter": "friction", "of": "peak_contact_pressure", "first_above": 0.0}
    goal = Goal.read(asked | {"between": [0.1, 0.4]}, FAKE, {})
    found = searched(goal, lambda value: value - 0.2, 0.2 * 0.99**off)
    assert found.low <= 0.2 <= found.high <= found.low / (1.0 - 0.01001)
    most = {0.0: 2, 0.4: 2, -1.2: 2, 3.0: 6}
    assert len(found.rows) <= most.get(off, goal.most[1])


def test_searches_wait_for_those_by_which_their_goal_is_expected(tmp_path: Path) -> None:
    """The goal is friction = (120 - half_width) / 80 - 1; places between take few runs."""
    goal = {"parameter": "friction", "of": "peak_contact_pressure", "first_above": 120.0}
    widths = [20.0 + 1.5 * k for k in range(9)]
    asked = study(goal | {"between": [0.05, 0.9]}, {"half_width": widths}, load_ratio=0.8)
    at_once = search_here(asked, Store(tmp_path / "a"))
    store, parts = Store(tmp_path / "b"), []
    while some := search_here(asked, store, most=9):
        parts += some
    assert sorted(parts) == sorted(at_once), "the same runs, and none twice"
    with open_study(tmp_path / "a") as dataset:
        found, runs = (dataset[name].to_numpy().ravel() for name in ("friction", "runs"))
    assert found == pytest.approx((120.0 - np.array(widths)) / 80.0 - 1.0, rel=0.006)
    assert runs[[0, -1]].tolist() == [9, 9]
    assert runs[1:-1].mean() <= 3.0


def test_words_part_the_places_that_foresee_each_other() -> None:
    sets = [{"x": x, "word": word} for word in "ab" for x in (0.0, 1.0, 2.0, 3.0)]
    near = Neighbours(sets)
    assert [set(each) for each in near.before] == [
        set(), {0, 3}, {0, 3}, set(), set(), {4, 7}, {4, 7}, set()
    ]  # fmt: skip
    assert near.foreseen(1, [1.0, 7.0]) == pytest.approx(3.0)
    assert near.foreseen(1, [math.nan, 7.0]) == pytest.approx(7.0)
    assert near.foreseen(1, [math.nan, math.nan]) is None
    path = Neighbours([{"x": x, "traction": float(x > 0)} for x in range(5)])
    assert path.before[1] == [0, 2, 4], "a number of two values does not count beside another"
    grid = Neighbours([{"x": x, "y": y} for x in range(5) for y in range(5)])
    smooth = [3.0 + 0.3 * (k // 5) - 0.05 * (k % 5) ** 2 for k in range(25)]
    last = max(range(25), key=lambda k: len(grid.before[k]))
    values = [smooth[k] for k in grid.before[last]]
    assert grid.foreseen(last, values) == pytest.approx(smooth[last], abs=0.03)


def test_the_farthest_place_comes_next_and_waits_for_the_nearest_of_lower_levels() -> None:
    """The same by all distances, with ties, as places of a grid have them."""
    sets = [{"x": x, "y": y / 3.0} for x in range(12) for y in range(11)]
    at = np.array([[each["x"] / 11.0, each["y"] * 0.3] for each in sets])
    apart = np.linalg.norm(at[:, None] - at[None], axis=2)
    level, order = np.zeros(len(at), dtype=int), [0, int(apart[0].argmax())]
    while (away := apart[order].min(axis=0)).max() > 0.0:
        order.append(int(away.argmax()))
        level[order[-1]] = 1 + int(math.log2(apart[0].max() / away.max()) + 1e-9)
    for k, before in enumerate(Neighbours(sets).before):
        lower = np.flatnonzero(level < level[k])
        nearest = lower[np.argsort(apart[k, lower], kind="stable")]
        assert before == (nearest[:12].tolist() if level[k] else [])


def test_a_run_that_fails_its_audit_is_before_the_limit_load_and_has_no_number() -> None:
    limit = Goal.read({"find": "limit_load", "between": [0.1, 4.0]}, FAKE, {})
    row = {"id": "a", "status": "audit_failed", "scalars": {"peak_contact_pressure": 1.0}}
    assert limit.seen(row, None).beyond is False
    assert Goal.read(PRESSURE, FAKE, {}).seen(row, True).beyond is None
    assert limit.seen(row | {"status": "error"}, None).beyond is None


@pytest.mark.parametrize("scene", SCENES)
def test_the_data_set_has_what_was_found_over_the_axes(store: Store, scene: str) -> None:
    asked = study(PRESSURE, scene=scene, trouble="limit")
    computed = search_here(asked, store)
    with open_study(store.directory) as dataset:
        assert dataset["load_ratio"].dims == ("friction", "hardening", "half_width")
        assert dataset["load_ratio"].attrs["units"] == "1"
        assert dataset["tried_peak_contact_pressure"].attrs["units"] == "MPa"
        (about,) = found_of(dataset).about
        assert "at which peak contact pressure is 120 MPa;" in about
        for friction in SWEEP["friction"]:
            for width in SWEEP["half_width"]:
                one = dataset.sel(friction=friction, half_width=width).squeeze()
                exact = (120.0 - width) / 100.0 / (1.0 + friction)
                limit = exact > 0.8
                assert one["status"].item() == ("limit_load" if limit else "ok")
                assert one["load_ratio"].item() == pytest.approx(0.8 if limit else exact, rel=0.01)
                low, high = one["load_ratio_low"].item(), one["load_ratio_high"].item()
                assert low <= min(exact, 0.8) <= high <= low / (1.0 - 0.01001)
                tried = one["tried_load_ratio"].to_numpy()
                tried = tried[np.isfinite(tried)]
                assert len(tried) == one["runs"].item()
                assert (np.diff(tried) > 0.0).all()
                assert {one["run_low"].item(), one["run_high"].item()} <= set(computed)
                assert ("flows at 0.75" in one["message"].item()) == limit
    assert len(computed) == len(set(computed))


def test_a_path_ends_with_the_first_run_beyond(store: Store) -> None:
    """Behind it no run is needed: of the first round, which has 5 values, that is the third."""
    asked = study(PRESSURE | {"between": [0.2, 3.2]}, {}, half_width=20.0)
    goals = Asking(asked, store)
    path = next(filter(None, goals.paths())).path
    assert [case.values["load_ratio"] for case in path.cases] == [0.2, 0.4, 0.8, 1.6, 3.2]
    computed = search_here(asked, store)
    assert computed[:4] == [case.id for case in path.cases[:4]]
    assert path.cases[4].id not in computed


@pytest.mark.parametrize("scene", SCENES)
def test_an_interrupted_search_goes_on_and_asks_for_the_same_runs(
    tmp_path: Path, scene: str
) -> None:
    asked = study(PRESSURE, {"friction": [0.0, 0.4]}, scene=scene, trouble="limit")
    at_once = search_here(asked, Store(tmp_path / "a"))
    store, parts = Store(tmp_path / "b"), []
    while some := search_here(asked, store, most=7):
        parts += some
    assert sorted(parts) == sorted(at_once), "the same runs, and none twice"
    with open_study(tmp_path / "a") as one, open_study(tmp_path / "b") as other:
        assert results_of(one).equals(results_of(other))


def test_runs_are_those_of_any_other_study(store: Store) -> None:
    search_here(study(PRESSURE, {}, "fake"), store)
    same = fake_study(sweep={"load_ratio": [0.1]})
    assert store.run_path(next(same.run_ids())).exists()


def test_a_goal_may_be_the_limit_load_or_multiply_with_points(store: Store) -> None:
    points = [{"friction": 0.1, "case": "A"}, {"friction": 0.3, "case": "B"}]
    content = {"name": "goal", "scene": "numbers", "parameters": {"trouble": "limit"}}
    goal = {"find": "limit_load", "between": [0.1, 4.0], "within": 0.02}
    asked = Study.from_dict(content | {"points": points, "goal": goal})
    search_here(asked, store)
    with open_study(store.directory) as dataset:
        assert dataset["case"].values.tolist() == ["A", "B"]
        assert dataset["status"].values.ravel().tolist() == ["ok", "ok"]
        assert dataset["load_ratio"].to_numpy() == pytest.approx(0.8, rel=0.02)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(
    ("fixed", "goal", "status", "message"),
    [
        ({"trouble": "raise"}, PRESSURE, "error", "the stiffness is gone"),
        ({"trouble": "bare"}, PRESSURE, "not_converged", "it comes before the goal: increment 3"),
        (
            {},
            PRESSURE | {"first_above": 1e4},
            "missing",
            "is not reached: peak_contact_pressure = 420",
        ),
        (
            {},
            PRESSURE | {"at": 1e4},
            "missing",
            "420 at load_ratio = 4: it does not reach 10000 in between",
        ),
        (
            {},
            PRESSURE | {"at": 1.0},
            "missing",
            "420 at load_ratio = 4: it does not reach 1 in between",
        ),
        ({}, PRESSURE | {"first_above": 1.0}, "missing", "has been passed"),
        (
            {"trouble": "limit"},
            PRESSURE | {"between": [0.8, 4.0]},
            "missing",
            "at load_ratio = 0.8 there is no equilibrium: limit_load: flows at 0.75",
        ),
        ({}, PRESSURE | {"of": "plastic_work"}, "error", "its run has no plastic_work"),
    ],
)
def test_a_search_without_an_answer_says_why(
    store: Store, fixed: dict[str, Any], goal: dict[str, Any], status: str, message: str, scene: str
) -> None:
    kind = "first_above" if "first_above" in goal else "at"
    goal = {key: goal[key] for key in ("of", kind, "between")}
    search_here(study(goal, {}, scene, half_width=20.0, **fixed), store)
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == status
        assert message in dataset["message"].item()


@pytest.mark.parametrize(("beyond", "doubtful"), [(4, True), (3, False)])
def test_a_shakedown_limit_below_an_undecided_run_has_a_warning(
    store: Store, beyond: int, doubtful: bool
) -> None:
    goal = {"find": "shakedown_limit", "parameter": "load_ratio", "between": [1.0, 3.0]}
    asked = Study.from_dict({"name": "limit", "scene": "raceway", "goal": goal})
    assert isinstance(asked.kind, Goal)
    search = Search(asked.kind)
    while wanted := search.wants:
        scalars = {"shakedown_state": beyond if wanted[0] > 2.0 else 1}
        row = {"id": str(wanted[0]), "status": "ok", "scalars": scalars, "message": ""}
        search.tell(wanted[0], row)
    store.save_study(asked)
    asking = SimpleNamespace(places=[SimpleNamespace(program=search)], asked=[])
    found = answered(asked, store, cast("Asking", asking), anew=True)
    with open_study(found.path) as dataset:
        assert dataset["status"].item() == "ok"
        assert ("undecided: the limit may be higher" in dataset["message"].item()) == doubtful


def test_a_path_that_fails_before_its_first_value_ends_its_search(store: Store) -> None:
    scene = Unmeshed(
        name="unmeshed", summary="a scene without a mesh", parameters=FakeParameters,
        branch="load_ratio",
    )  # fmt: skip
    content = {"name": "goal", "goal": PRESSURE}
    computed = search_here(Study.from_dict(content, scene), store)
    assert len(computed) == 1
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == "error"
        assert "at load_ratio = 0.1: ZeroDivisionError: no mesh" in dataset["message"].item()


@pytest.mark.parametrize(
    ("kind", "branch"),
    [(Canned, "load_ratio"), (Followed, "load_ratio"), (Canned, "")],
)
def test_a_value_that_the_scene_refuses_ends_its_search_alone(
    store: Store, kind: type[Canned], branch: str
) -> None:
    scene = kind(
        name="gapped", summary="a scene that refuses", parameters=Gapped, branch=branch,
        records=numbers if branch else alone,
    )  # fmt: skip
    goal = PRESSURE | {"at": 250.0, "parameter": "load_ratio"}
    sweep = {"friction": [0.0, 0.1]}
    asked = Study.from_dict({"name": "goal", "goal": goal, "sweep": sweep}, scene)
    search_here(asked, store)
    with open_study(store.directory) as dataset:
        assert dataset["status"].to_numpy().ravel().tolist() == ["ok", "error"]
        assert "not between 1 and 3" in dataset["message"].to_numpy().ravel()[1]


def test_a_run_that_a_dead_worker_wrote_and_did_not_tell_is_kept(store: Store) -> None:
    """The death is the fault of the run after it."""
    asked = study(PRESSURE, {}, "followed")
    goals = Asking(asked, store)
    first = next(filter(None, goals.paths()))
    begun = PathTask(
        asked.problem, (first.path,), store.directory, solver_hash(), place=first.place
    )
    silent: list[Any] = []
    before = time.time_ns() - 10**9
    walk(begun, silent.append, lambda: sum("row" in each for each in silent) > 0)
    low, *others = (each["row"] for each in silent if "row" in each)
    assert all(("follows" in each) == ("row" in each) for each in silent)
    assert (low["parameters"]["load_ratio"], others) == (0.1, [])
    work = _Work(asked, store, set(), Limits(), 0, lambda event: None, goals, before)
    work._walking[first.path.id] = 0, 0.0
    work._close(begun, RuntimeError("the worker died"))
    assert store.run(low["id"]) == low
    assert low["id"] in work.computed
    assert len(work.computed) == 2
    (search,) = (place.program for place in goals.places)
    assert [row["status"] for row in search.rows.values()] == ["ok", "error"]
    assert search.reason == "failed"


@pytest.mark.parametrize("scene", SCENES)
def test_a_run_of_which_a_path_told_nothing_is_asked_for_again(store: Store, scene: str) -> None:
    goals = Asking(study(PRESSURE, {}, scene), store)
    paths = goals.paths()
    lost = next(filter(None, paths)).path
    assert next(paths) is None
    goals.closed(lost.id)
    again = next(paths)
    assert again is not None
    assert again.path == lost


def test_a_stored_run_above_the_first_one_beyond_is_none_of_the_search(tmp_path: Path) -> None:
    """The answer and its number of runs do not depend on what other studies have stored."""
    asked = study(PRESSURE | {"between": [0.2, 3.2]}, {}, half_width=20.0)
    alone, other = Store(tmp_path / "a"), Store(tmp_path / "b")
    path = next(filter(None, Asking(asked, other).paths())).path
    last = (replace(path, cases=path.cases[-1:]),)
    task = PathTask(asked.problem, last, other.directory, solver_hash())
    walk(task, lambda row: None, lambda: False)
    assert len(search_here(asked, alone)) == len(search_here(asked, other))
    with open_study(tmp_path / "a") as one, open_study(tmp_path / "b") as two:
        assert results_of(one).equals(results_of(two))


def test_a_stored_run_beyond_ends_its_path(store: Store) -> None:
    """So does the first stored run tell whether the number of ``at`` rises."""
    asked = study(PRESSURE | {"between": [0.2, 3.2]}, {}, half_width=20.0)
    first = next(filter(None, Asking(asked, store).paths()))
    cases, whole = first.path.cases, (first.path,)
    task = PathTask(asked.problem, whole, store.directory, solver_hash(), limit=first.limit)
    for stored, computed in [({0, 3}, [1, 2]), ({0, 1}, [2, 3]), ({3}, [0, 1, 2])]:
        for number in stored:
            some = replace(first.path, cases=(cases[number],))
            walk(replace(task, paths=(some,), limit=None), lambda row: None, lambda: False)
        heard: list[Any] = []
        walk(replace(task, limit=copy(first.limit)), heard.append, lambda: False)
        rows = [each["row"]["id"] for each in heard if "row" in each]
        assert rows == [cases[number].id for number in [*sorted(stored), *computed]]
        for file in store.directory.glob("runs/*.nc"):
            file.unlink()


def test_a_study_with_a_goal_has_an_id_and_is_read_again() -> None:
    one = study(PRESSURE)
    assert Study.from_dict(one.to_dict()) == one
    assert Study.from_dict(one.to_dict()).id == one.id
    assert study(PRESSURE | {"within": 0.02}).id != one.id
    assert study(PRESSURE | {"within": 0.01, "parameter": "load_ratio"}).id == one.id
    assert "load_ratio" not in one.fixed


@pytest.mark.parametrize("scene", SCENES)
def test_the_estimate_is_the_most_that_the_search_may_take(store: Store, scene: str) -> None:
    asked = study(PRESSURE, scene=scene)
    assert isinstance(asked.kind, Goal)
    found = estimate(asked, store)
    assert found.runs == found.to_compute == 4 * asked.kind.most[1]
    assert found.paths == 4 * asked.kind.most[0]
    assert len(search_here(asked, store)) <= found.runs
    with pytest.raises(StudyError, match="at most 10: use fewer values"):
        Bounds(runs=10).refuse(runs=asked.size)


@pytest.mark.parametrize(
    ("change", "field", "allowed"),
    [
        ({"parameter": "load_ration"}, "goal.parameter", "did you mean load_ratio?"),
        ({"parameter": "hardening"}, "goal.between[0]", "must be one of none"),
        ({"parameter": "half_width"}, "goal.parameter", "take it out of sweep.half_width"),
        ({"parameter": "passes"}, "goal.between[0]", "an integer"),
        ({"between": [0.0, 1.0]}, "goal.between[0]", "> 0 and <= 10, of load_ratio, which varies"),
        ({"between": [1.0, 0.1]}, "goal.between", "its lowest value"),
        ({"between": [0.1]}, "goal.between", "[lowest, highest]"),
        ({"between": [0.1, 11.0]}, "goal.between[1]", "<= 10"),
        ({"within": 0.0}, "goal.within", "at least 1e-06"),
        ({"witin": 0.1}, "goal.witin", "did you mean within?"),
        ({"of": "peak_contact_presure"}, "goal.of", "did you mean peak_contact_pressure?"),
        ({"of": "contact_pressure"}, "goal.of", "is over stage, s"),
        ({"of": ["status"]}, "goal.of", "one number a run"),
        ({"at": "high"}, "goal.at", "a finite number"),
        ({"at": 10**400}, "goal.at", "a finite number"),
        ({"first_above": 1.0}, "goal", "one of at, first_above, first_below"),
        ({"find": "first_yield"}, "goal", "is what find = first_yield says"),
        ({"find": "yield"}, "goal.find", "did you mean first_yield?"),
        ({"find": []}, "goal.find", "must be one of first_yield"),
        ({"parameter": []}, "goal.parameter", "must be one of load_ratio"),
    ],
)
def test_a_wrong_goal_is_refused_in_one_line(
    change: dict[str, Any], field: str, allowed: str
) -> None:
    with pytest.raises(StudyError) as caught:
        study(PRESSURE | change)
    assert caught.value.field.startswith(field)
    assert allowed in caught.value.allowed
    assert "\n" not in str(caught.value)


def test_an_empty_goal_is_refused() -> None:
    with pytest.raises(StudyError, match=r"goal = \{\}: is empty: needs between"):
        study({})


def test_an_axis_may_not_have_the_name_of_an_answer(store: Store) -> None:
    asked = study(PRESSURE, {"friction": [0.0]})
    search_here(asked, store)
    with open_study(store.directory) as dataset:
        names = set(map(str, dataset.variables))
    assert {"load_ratio_low", "run_high", "tried", "tried_status", "runs"} < names
    axis = {"a": {"friction": 0.0}, "b": {"friction": 0.1}}
    for name in names - {"load_ratio", "friction", "hardening", "half_width"}:
        with pytest.raises(StudyError, match=rf"sweep\.{name} = .* give the axis another one"):
            study(PRESSURE, {name: axis})
    study(PRESSURE, {"tribe": axis})


def test_what_the_scene_refuses_at_an_end_is_told_before_anything_runs() -> None:
    goal = {"parameter": "friction", "find": "limit_load", "between": [0.1, 1.0]}
    with pytest.raises(StudyError, match=r"goal\.between\[1\] = 1\.0: at most 0\.9 in plane"):
        study(goal, {}, state="plane_strain")


@pytest.mark.processes
@pytest.mark.usefixtures("one_worker")
def test_the_command_searches_prints_draws_and_keeps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(
        'name = "goal"\nscene = "fake"\n[sweep]\nfriction = [0.0, 0.4]\n'
        '[goal]\nof = "peak_contact_pressure"\nat = 120\nbetween = [0.1, 4.0]\n'
    )
    run = ["run", str(file), "--out", str(out), "--workers", "1"]
    assert main([*run, "--dry-run"]) == 0
    assert "at most 34" in capsys.readouterr().out
    assert main(run) == 0
    told = capsys.readouterr()
    assert "friction = 0.4, load_ratio = 0.1 (round 1 of at most 5)" in told.err
    assert "goal: 2 answers (2 ok)" in told.out
    lines = [line.split() for line in told.out.splitlines()]
    assert ["0.4", "ok", "0.5"] in [line[:3] for line in lines]
    assert (next(out.glob("studies/*/load_ratio.png"))).stat().st_size > 10_000
    assert main(run) == 0
    told = capsys.readouterr()
    assert "0 computed" in told.out and "to compute" not in told.err
    assert main(["show", str(out)]) == 0
    plot = ["plot", str(out), "--field", "load_ratio", "--out", str(tmp_path / "a.png")]
    assert main(plot) == 0
    assert main(["export", str(out), "--vtu", str(tmp_path / "vtu")]) == 2
    assert "give the file of a run, such as that of run_high" in capsys.readouterr().err


def test_a_new_round_begins_while_other_searches_wait(store: Store) -> None:
    """The runs of the second place are not known when the first has two rounds."""
    goals = Asking(study(PRESSURE, {"friction": [0.0, 0.1]}), store)
    asked = goals.paths()
    paths = [each.path for each in filter(None, (next(asked), next(asked)))]
    assert next(asked) is None
    for case in paths[0].cases[:4]:
        load_ratio = case.values["load_ratio"]
        scalars = {"peak_contact_pressure": 100.0 * load_ratio + 50.0}
        row = {"id": case.id, "status": "ok", "scalars": scalars, "parameters": case.values}
        goals.heard(paths[0].id, row)
    again = next(asked)
    assert again is not None
    assert again.path.cases[0].values["friction"] == 0.0
    assert 0.632 < again.path.cases[0].values["load_ratio"] < 1.591
    assert next(asked) is None


@pytest.mark.processes
@pytest.mark.usefixtures("one_worker")
def test_progress_grows_to_the_end_and_a_stopped_search_says_so(store: Store) -> None:
    asked = study(PRESSURE, {"friction": [0.0, 0.1, 0.2]})
    heard: list[StudyEvent] = []
    outcome = run_study(asked, store, workers=1, on_event=heard.append)
    assert outcome.ok
    shares = [event.progress for event in heard]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    stopped = run_study(study(PRESSURE | {"at": 110.0}), store, workers=1, should_stop=lambda: True)
    assert stopped.stopped
    assert set(stopped.counts) == {"missing"}


@pytest.mark.processes
@pytest.mark.parametrize("scene", SCENES)
def test_a_killed_search_is_taken_up_and_computes_no_run_twice(tmp_path: Path, scene: str) -> None:
    marks, out = tmp_path / "marks", tmp_path / "out"
    marks.mkdir()
    file = tmp_path / "study.toml"
    file.write_text(
        f'name = "goal"\nscene = "{scene}"\n[parameters]\nseconds = 0.1\nmark = "{marks}"\n'
        "[sweep]\nfriction = [0.0, 0.1]\n"
        '[goal]\nof = "peak_contact_pressure"\nat = 120\nbetween = [0.1, 4.0]\n'
    )
    asked = Study.from_toml(file)
    see_it_taken_up(asked, out, 6)
