"""Fits: measured lines, the runs that they ask for, and the data set of what is found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from annotated_types import Interval, Unit
from scipy.stats import chi2

from residua.cli import main
from solver.errors import ModelError
from solver.results.record import Record, Status
from studies import Store, Study, StudyError, estimate, fit, open_study
from studies.definition.identity import solver_hash
from studies.definition.quantity import Line, Read
from studies.definition.schema import Context, parsed
from studies.definition.sweep import standings
from studies.execution.asking import Asking
from studies.execution.result import answered
from studies.execution.task import PathTask, walk
from studies.kinds.fit.answer import certainty
from studies.kinds.fit.fitting import Fit, Fitted, Fitting
from studies.kinds.fit.measured import MeasuredLine, pieces
from studies.views.picking import run_file
from tests.studies.conftest import results_of, write_study
from tests.studies.fakes import FAKE, Canned
from tests.studies.killed import see_it_taken_up

X = np.linspace(0.0, 2.0, 21)
TRUTH = {"yield_stress": 380.0, "slope": 30.0}


def described(default: float, name: str) -> Any:
    return field(default=default, metadata={"description": name})


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """Parameters of a bar that is pulled: two terms that harden it, and saturate."""

    yield_stress: Annotated[float, Interval(gt=0.0, le=1e4), Unit("MPa")] = described(
        380.0, "yield"
    )
    slope: Annotated[float, Interval(ge=0.0, le=1e4), Unit("MPa")] = described(30.0, "slope")
    first: Annotated[float, Interval(ge=0.0, le=1e4), Unit("MPa")] = described(0.0, "first term")
    second: Annotated[float, Interval(ge=0.0, le=1e4), Unit("MPa")] = described(0.0, "second term")
    fails: Annotated[float, Interval(ge=0.0, le=1e4), Unit("MPa")] = described(
        1e4, "it fails above"
    )
    angle: Annotated[float, Interval(ge=0.0, le=90.0), Unit("1")] = described(0.0, "direction")

    def __post_init__(self) -> None:
        if self.slope > 190.0:
            raise ModelError("slope", self.slope, "at most 190")


def pulled(run: Any, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield the record of a run: force over approach, up and down again, and a line over s."""
    x = np.concatenate([X, X[-2::-2]])
    up = run.yield_stress * np.tanh(3.0 * X) + run.slope * X * (1.0 + run.angle / 90.0)
    up += run.first * (1.0 - np.exp(-2.0 * X)) + run.second * (1.0 - np.exp(-2.1 * X))
    force = np.concatenate([up, up[-1] * (X[-2::-2] / X[-1]) ** 3])
    yield Record(
        parameters=run,
        status=Status.LIMIT_LOAD if run.yield_stress > run.fails else Status.OK,
        message="flows" if run.yield_stress > run.fails else "",
        coordinates={"increment": np.arange(len(x)), "s": X, "stage": np.array(["loaded", "free"])},
        fields={
            "increment_force": (("increment",), force),
            "increment_approach": (("increment",), x),
            "surface_displacement": (("stage", "s"), np.array([up, -run.slope * X**2])),
        },
        scalars={"crater_depth": run.slope / run.yield_stress},
        symmetric=False,
    )  # fmt: skip


SCENE = Canned(name="bar", summary="a bar", parameters=Bar, branch="", records=pulled)
RANGES = {"yield_stress": [200.0, 600.0], "slope": [0.0, 100.0]}


def measured(noise: float = 0.0, seed: int = 0, **parameters: float) -> list[dict[str, Any]]:
    """Return force over approach, loading and unloading, and the surface that is left."""
    random = np.random.default_rng(seed)
    record = next(pulled(Bar(**(TRUTH | parameters)), [], None))
    x, force = (record.fields[f"increment_{name}"][1] for name in ("approach", "force"))
    left = record.fields["surface_displacement"][1][1]
    found = []
    for places, values, more in (
        (x, force, {"of": "increment_force", "over": "increment_approach"}),
        (X, left, {"of": "surface_displacement", "over": "s", "at": {"stage": "free"}}),
    ):
        sigma = max(noise, 1e-3) * float(abs(values).max())
        noisy = values + noise / max(noise, 1e-3) * sigma * random.normal(size=len(values))
        found.append(more | {"places": places.tolist(), "values": noisy.tolist(), "sigma": sigma})
    return found


def study(lines: Any = None, ranges: Any = None, sweep: Any = None, **more: Any) -> Study:
    own = {"measured": measured() if lines is None else lines, "ranges": ranges or RANGES}
    fixed = more.pop("parameters", {})
    content = {"name": "bar", "parameters": fixed, "sweep": sweep or {}, "fit": own | more}
    return Study.from_dict(content, SCENE)


def fit_here(study: Study, store: Store, most: int = 10**6) -> list[str]:
    """Fit in this process, until there are so many runs; return their ids."""
    asking, computed = Asking(study, store), []

    def hear(message: dict[str, Any]) -> None:
        if "row" in message:
            computed.append(message["row"]["id"])
            asking.heard(message["path"], message["row"])

    for asked in asking.paths():
        if asked is None:
            break
        task = PathTask(study.problem, (asked.path,), store.directory, solver_hash(), study.keep)
        walk(task, hear, lambda: False)
        asking.closed(asked.path.id)
        if len(computed) >= most:
            break
    store.reconcile()
    store.save_study(study)
    answered(study, store, asking, anew=True)
    return computed


def test_exact_lines_give_the_parameters(store: Store) -> None:
    ranges = {
        "slope": [0.0, 100.0],
        "yield_stress": {"start": 200, "stop": 600, "spacing": "log"},
    }
    computed = fit_here(study(ranges=ranges), store)
    assert len(computed) == len(set(computed)) < 40
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == "ok"
        assert dataset["message"].item() == ""
        assert dataset["runs"].item() == len(computed)
        for name, value in TRUTH.items():
            assert dataset[name].item() == pytest.approx(value, rel=2e-3)
        assert dataset["yield_stress"].attrs["units"] == "MPa"
        assert dataset["condition"].item() < 10.0
        fitted, values = (dataset[name].to_numpy() for name in ("fitted", "measured"))
        assert fitted == pytest.approx(values, abs=1.0)
        assert dataset["tried_run"].to_numpy().tolist() == computed
        assert set(dataset["tried_status"].to_numpy()) == {"ok"}


def test_deviations_are_those_of_many_noisy_measurements() -> None:
    """The squared distances from the truth, by the covariance that is told, are chi-squared."""
    distance, count = 0.0, 8
    for seed in range(count):
        asked = Fit.read({"measured": measured(0.02, seed), "ranges": RANGES}, SCENE, {})
        seen: dict[str, Line] = {}
        program = Fitting(asked, standings({}), lambda row, seen=seen: seen.get)
        while wanted := program.wants:
            record = next(pulled(Bar(**program.sets(wanted[0])), [], None))
            seen |= {name: Line(*each) for name, each in record.fields.items()}
            seen |= {name: Line((name,), each) for name, each in record.coordinates.items()}
            program.tell(wanted[0], {"status": "ok", "id": "", "message": ""})
        assert program.answer is not None
        off = program.answer.values - np.array([TRUTH[name] for name in asked.ranges])
        distance += off @ np.linalg.solve(certainty(asked, program.answer).covariance, off)
    low, high = chi2.interval(0.99, 2 * count)
    assert low < distance < high


def test_two_terms_that_saturate_alike_cannot_be_told_apart(store: Store) -> None:
    ranges = {"first": [0.0, 100.0], "second": [0.0, 100.0], "yield_stress": [200.0, 600.0]}
    lines = measured(0.01, first=60.0, second=20.0)[:1]
    fit_here(study(lines, ranges, parameters={"slope": 30.0}), store)
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == "ok"
        told = dataset["message"].item()
        assert "first and second cannot be told apart by what was measured" in told
        assert dataset["condition"].item() > 30.0
        pair = {"parameter": 1, "parameter_2": 2}
        assert dataset["correlation"].isel(pair).item() < -0.99
        assert dataset["first_sigma"].item() > 20.0


def test_a_parameter_that_changes_nothing_is_named(store: Store) -> None:
    fit_here(study(measured()[1:], {"slope": [0.0, 100.0], "yield_stress": [200.0, 600.0]}), store)
    with open_study(store.directory) as dataset:
        assert "yield_stress changes nothing in what was measured" in dataset["message"].item()
        assert dataset["slope"].item() == pytest.approx(30.0, rel=2e-3)
        assert np.isnan(dataset["yield_stress_sigma"].item())


def test_a_value_at_its_bound_is_told(store: Store) -> None:
    fit_here(study(ranges={"yield_stress": [200.0, 370.0], "slope": [0.0, 100.0]}), store)
    with open_study(store.directory) as dataset:
        assert "yield_stress is at its highest value" in dataset["message"].item()


def test_runs_that_fail_or_are_refused_turn_the_way_and_do_not_end_it(store: Store) -> None:
    """From 220 MPa a first step would go beyond 450; slopes above 190 are refused."""
    first = {"yield_stress": 220.0, "slope": 187.0}
    ranges = {"yield_stress": [200.0, 600.0], "slope": [0.0, 200.0]}
    one = study(ranges=ranges, first=first, parameters={"fails": 385.0})
    fit_here(one, store)
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == "ok", dataset["message"].item()
        assert dataset["yield_stress"].item() == pytest.approx(380.0, rel=5e-3)


@pytest.mark.parametrize(
    ("more", "status", "message"),
    [
        (
            {"parameters": {"fails": 300.0}},
            "missing",
            "of the first values has no line: limit_load",
        ),
        ({"most": 5}, "not_converged", "needs more than 5 runs: this is the best so far"),
    ],
)
def test_a_fit_without_an_answer_says_why(
    store: Store, more: dict[str, Any], status: str, message: str
) -> None:
    fit_here(study(**more), store)
    with open_study(store.directory) as dataset:
        assert dataset["status"].item() == status
        assert message in dataset["message"].item()
        assert dataset["runs"].item() <= 5


def test_a_fit_is_found_where_no_runs_are_left_for_its_deviations(tmp_path: Path) -> None:
    whole = fit_here(study(), Store(tmp_path / "whole"))
    fit_here(study(most=len(whole) - 1), Store(tmp_path / "part"))
    with open_study(tmp_path / "whole") as one, open_study(tmp_path / "part") as other:
        assert other["runs"].item() == len(whole) - 2, "those of the central differences lack"
        assert other["status"].item() == "ok"
        for name in TRUTH:
            assert other[name].item() == one[name].item()
            assert other[f"{name}_sigma"].item() == pytest.approx(one[f"{name}_sigma"].item(), 0.2)


def test_a_study_without_a_fit_is_not_fitted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", str(write_study(tmp_path)), "--out", str(tmp_path / "out")]) == 2
    assert "fit: is missing" in capsys.readouterr().err


def test_an_interrupted_fit_goes_on_and_asks_for_the_same_runs(tmp_path: Path) -> None:
    one = study(measured(0.02))
    at_once = fit_here(one, Store(tmp_path / "a"))
    store, parts = Store(tmp_path / "b"), []
    while some := fit_here(one, store, most=8):
        parts += some
    assert sorted(parts) == sorted(at_once), "the same runs, and none twice"
    with open_study(tmp_path / "a") as a, open_study(tmp_path / "b") as b:
        assert results_of(a).equals(results_of(b))


def test_lines_of_several_runs_are_fitted_together(store: Store) -> None:
    """The angles are on an axis: each evaluation is two runs."""
    lines = [
        line | {"at": line.get("at", {}) | {"angle": angle}}
        for angle in (0.0, 90.0)
        for line in measured(angle=angle)[:1]
    ]
    one = study(lines, sweep={"angle": [0.0, 90.0]}, most=60)
    computed = fit_here(one, store)
    assert len(computed) % 2 == 0
    with open_study(store.directory) as dataset:
        assert dataset["slope"].item() == pytest.approx(30.0, rel=5e-3)
        assert dataset["line_at"].values.tolist() == ["angle = 0.0", "angle = 90.0"]
    with pytest.raises(
        StudyError, match=r"measured\[0\].at = \{\}: must identify exactly one run; it matches 2"
    ):
        study(measured()[:1], sweep={"angle": [0.0, 90.0]})


def test_pieces_of_a_curve_end_where_it_turns() -> None:
    x = np.array([0.0, 1.0, 2.0, 1.99, 3.0, 2.0, 1.0, 1.5, 4.0])
    assert [(each.start, each.stop) for each in pieces(x)] == [(0, 5), (4, 7), (6, 9)]
    assert pieces(np.array([1.0, 1.0])) == [slice(0, 2)]


def test_a_line_is_compared_with_its_own_piece_and_a_little_beyond() -> None:
    curve = {
        "increment_approach": np.array([0.0, 1.0, 2.0, 1.0]),
        "increment_force": np.array([0.0, 2.0, 4.0, 1.0]),
    }
    given = {n: Line(("increment",), v) for n, v in curve.items()}
    content = {"of": "increment_force", "over": "increment_approach", "values": [1.0] * 4}
    line = parsed(MeasuredLine, content | {"places": [0.5, 2.2, 1.5, 0.8]}, Context(FAKE, {}))
    assert line.seen(given.get) == pytest.approx([1.0, 4.6, 2.5, 0.4])
    assert not line.sigma
    far = parsed(MeasuredLine, content | {"places": [0.5, 3.2, 1.5, 0.8]}, Context(FAKE, {}))
    with pytest.raises(ValueError, match=r"from 0\.5 to 3\.2, and the run has it from 0 to 2"):
        far.seen(given.get)


@pytest.mark.parametrize(
    ("change", "field", "allowed"),
    [
        ({"ranges": {"slop": [0, 1]}}, "fit.ranges.slop", "did you mean slope?"),
        ({"ranges": {"slope": [1, 0]}}, "fit.ranges.slope", "lowest value"),
        ({"ranges": {"slope": [-1, 1]}}, "fit.ranges.slope[0]", ">= 0"),
        ({"ranges": {"slope": {"start": 0, "stop": 1, "spacing": "log"}}}, "fit.ranges.slope.start",
         "> 0"),
        ({"ranges": {}}, "fit.ranges", "bounds of each parameter"),
        ({"first": {"slope": 200.0}}, "fit.first.slope", "<= 100"),
        (
            {"ranges": {"slope": [0, 200]}, "first": {"slope": 195}},
            "fit.first.slope", "at most 190",
        ),
        ({"first": {"angle": 1.0}}, "fit.first.angle", "must be one of"),
        ({"step": 0.0}, "fit.step", "at least 0.0001"),
        ({"most": 2}, "fit.most", "must be at least 3, the runs of the first round"),
        ({"mesured": []}, "fit.mesured", "did you mean measured?"),
        ({"measured": []}, "fit.measured", "must have 1 or more"),
        ({"measured": ["a.csv"]}, "fit.measured[0]", "only a study file can"),
        ({"measured": [{"of": "forc", "values": [1, 2]}]}, "fit.measured[0].of", "of the runs"),
        ({"measured": [{"rows": 5}]}, "fit.measured[0].rows", "the rows of a file"),
        ({"measured": [{"rows": ["ab"]}]}, "fit.measured[0].rows", "the rows of a file"),
        ({"measured": [{"of": "crater_depth", "over": [], "values": [1, 2]}]},
         "fit.measured[0].over", "of the runs"),
        ({"measured": [{"of": "crater_depth", "values": [10**400, 2]}]},
         "fit.measured[0].values", "finite numbers"),
        ({"measured": [{"of": "crater_depth", "values": [1]}]}, "fit.measured", "2 at least"),
        (
            {"measured": [{"of": "crater_depth", "values": [1, 2], "places": [1, 2]}]},
            "fit.measured[0].places", "needs over",
        ),
        (
            {"measured": [{"of": "surface_displacement", "over": "s", "values": [1, 2],
                           "places": [1, 2], "at": {"stag": "free"}}]},
            "fit.measured[0].at.stag", "did you mean stage?",
        ),
        (
            {"measured": [{"of": "crater_depth", "values": [1, 2], "sigma": [1, 0]}]},
            "fit.measured[0].sigma", "a number > 0",
        ),
        *(
            (
                {"measured": [{"of": "crater_depth", "values": [1, 2], "sigma": wrong}]},
                "fit.measured[0].sigma", allowed,
            )
            for wrong, allowed in {"some": "a number > 0", "2 N": "a number in mm"}.items()
        ),
    ],
)  # fmt: skip
def test_a_wrong_fit_is_refused_in_one_line(
    change: dict[str, Any], field: str, allowed: str
) -> None:
    content = {"measured": measured(), "ranges": RANGES} | change
    with pytest.raises(StudyError) as caught:
        Study.from_dict({"name": "bar", "fit": content}, SCENE)
    assert caught.value.field == field
    assert allowed in caught.value.allowed
    assert "\n" not in str(caught.value)


def test_a_parameter_is_searched_or_given_and_one_thing_chooses_the_runs() -> None:
    with pytest.raises(StudyError, match="what the fit searches: take it out of parameters"):
        study(parameters={"slope": 3.0})
    with pytest.raises(StudyError, match=r"take it out of sweep\.slope"):
        lines = [measured()[0] | {"at": {"slope": 3.0}}]
        study(lines, sweep={"slope": [3.0, 4.0]})
    goal = {"parameter": "angle", "find": "limit_load", "between": [1.0, 2.0]}
    content = {"name": "bar", "goal": goal, "fit": study().choice["fit"]}
    with pytest.raises(StudyError, match="chooses the runs, and so does the goal: keep one"):
        Study.from_dict(content, SCENE)


def test_a_study_with_a_fit_is_read_again_and_tells_its_cost(store: Store) -> None:
    one = study(most=40)
    again = Study.from_dict(one.to_dict(), SCENE)
    assert (again, again.id) == (one, one.id)
    assert study(most=41).id != one.id
    assert "slope" not in one.fixed
    assert estimate(one, store).runs == 40


def test_the_content_of_a_fit_is_what_is_read() -> None:
    asked = Fit.read({"measured": measured(0.01), "ranges": RANGES}, SCENE, {})
    assert Fit.read(asked.content, SCENE, {}).content == asked.content


def test_deviations_that_are_not_told_are_those_of_the_differences() -> None:
    lines = [{key: each[key] for key in each if key != "sigma"} for each in measured(0.05)]
    told, free = (
        Fit.read({"measured": each, "ranges": RANGES}, SCENE, {})
        for each in (measured(0.05), lines)
    )
    jacobian = np.random.default_rng(0).normal(size=(len(told.values), 2))
    covariances = []
    for one in (told, free):
        off = 5.0 * one.sigma * np.where(np.arange(len(one.sigma)) % 2, 1.0, -1.0)
        answer = Fitted(np.array([380.0, 30.0]), np.array([0.5, 0.3]), one.values + off, jacobian)
        covariances.append(certainty(one, answer).covariance)
    count = len(told.values)
    assert covariances[1] == pytest.approx(covariances[0] * 25.0 * count / (count - 2))


FAKE_FIT = """name = "fit"
scene = "fake"
[parameters]
seconds = {seconds}
mark = "{mark}"
[fit]
most = 60
ranges = {{ friction = [0.0, 1.0], load_ratio = [0.1, 0.7] }}
"""
PRESSURE = "s [mm], contact_pressure [MPa]\n" + "\n".join(f"{s}, {70 + s}" for s in range(0, 50, 5))
LINES = '[[fit.measured]]\nfile = "p.csv"\nat = { stage = "loaded" }\n'
"""Of the fake scene the pressure is 100 load_ratio (1 + friction) + s: only the product is told."""


@pytest.mark.processes
@pytest.mark.usefixtures("one_worker")
def test_the_command_fits_prints_draws_and_keeps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "study.toml", tmp_path / "out"
    (tmp_path / "p.csv").write_text(PRESSURE)
    file.write_text(FAKE_FIT.format(seconds=0.0, mark="") + LINES)
    run = ["fit", str(file), "--out", str(out), "--workers", "1"]
    assert main([*run, "--dry-run"]) == 0
    assert "at most 60" in capsys.readouterr().out
    assert main(run) == 0
    told = capsys.readouterr()
    assert "load_ratio = 0.4, friction = 0.5 (run 1 of at most 60)" in told.err
    assert "load_ratio and friction cannot be told apart" in told.out
    assert next(out.glob("studies/*/fit.png")).stat().st_size > 10_000
    assert main(run) == 0
    assert "0 computed" in capsys.readouterr().out
    assert main(["show", str(out)]) == 0
    with fit(Study.from_toml(file), Store(out), workers=1) as dataset:
        product = dataset["load_ratio"].item() * (1.0 + dataset["friction"].item())
        assert product == pytest.approx(0.7, rel=1e-3)
    with pytest.raises(StudyError, match=r"a search found: .* such as that of tried_run"):
        run_file(out, {})
    assert main([*run, "--measured", str(tmp_path / "none.csv")]) == 2
    assert "--measured" in capsys.readouterr().err


def test_measured_lines_of_the_command_replace_those_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(FAKE_FIT.format(seconds=0.0, mark=""))
    (tmp_path / "b.csv").write_text("contact_half_width [mm]; sigma\n50,5; 0,5\n51; 0,5\n")
    one = Study.from_toml(file, [tmp_path / "b.csv"])
    assert one.choice["fit"]["measured"] == [
        {"of": "contact_half_width", "values": [50.5, 51.0], "sigma": [0.5, 0.5]}
    ]
    (tmp_path / "b.csv").write_text("contact_half_width [cm]; sigma [um]\n5,05; 500\n5.1; 500\n")
    assert Study.from_toml(file, [tmp_path / "b.csv"]).choice["fit"] == one.choice["fit"]
    (tmp_path / "p.csv").write_text(PRESSURE)
    two = Study.from_toml(file, [tmp_path / "b.csv", tmp_path / "p.csv@stage=loaded"])
    assert [line.get("at") for line in two.choice["fit"]["measured"]] == [None, {"stage": "loaded"}]
    named = file.with_name("named.toml")
    named.write_text(f'points = [{{ case = "007", half_width = 40.0 }}]\n{file.read_text()}')
    tested = Study.from_toml(named, [tmp_path / "p.csv@stage=loaded,case=007"])
    assert tested.choice["fit"]["measured"][0]["at"] == {"stage": "loaded", "case": "007"}
    (folder := tmp_path / "a@b=1").mkdir()
    (folder / "p.csv").write_text(PRESSURE)
    for place, at in (("", None), ("@stage=loaded", {"stage": "loaded"})):
        inside = Study.from_toml(file, [folder / f"p.csv{place}"])
        assert inside.choice["fit"]["measured"][0].get("at") == at
    with pytest.raises(StudyError, match="must be FILE, or FILE@NAME=VALUE"):
        Study.from_toml(file, [tmp_path / "p.csv@stage=loaded,pass"])
    with pytest.raises(StudyError, match=r"fit\.measured\[0\]\.at\.longest"):
        Study.from_toml(file, [tmp_path / f"p.csv@longest={'x' * 300}"])  # no name of a file
    with pytest.raises(StudyError, match=r"fit\.measured: must be given"):
        Study.from_toml(file)
    for text, allowed in (
        ("contact_half_width [N]\n1\n2\n", "in mm; N is a force"),
        ("contact_half_width\nx\n2\n", "must be a number in every row"),
        ("s, contact_pressure, peak_contact_pressure\n1, 2, 3\n", "the columns PLACE and VALUE"),
    ):
        (tmp_path / "b.csv").write_text(text)
        with pytest.raises(StudyError, match=allowed):
            Study.from_toml(file, [tmp_path / "b.csv"])


@pytest.mark.processes
def test_a_killed_fit_is_taken_up_and_computes_no_run_twice(tmp_path: Path) -> None:
    marks, out, file = tmp_path / "marks", tmp_path / "out", tmp_path / "study.toml"
    marks.mkdir()
    (tmp_path / "p.csv").write_text(PRESSURE)
    file.write_text(FAKE_FIT.format(seconds=0.1, mark=marks) + LINES)
    asked = Study.from_toml(file)
    see_it_taken_up(asked, out, 4)


def test_derivatives_of_a_line_count_where_its_places_move_and_only_if_they_are_known() -> None:
    x = np.linspace(0.0, 1.0, 11)
    line = parsed(
        MeasuredLine,
        {"of": "surface_displacement", "over": "s", "places": [0.25, 0.5], "values": [0.0, 0.0],
         "at": {"stage": "free"}},
        Context(FAKE, {}),
    )  # fmt: skip
    given = {
        "s": Line(("s",), x),
        "stage": Line(("stage",), np.array(["loaded", "free"])),
        "surface_displacement": Line(("stage", "s"), np.stack([x, 3.0 * x])),
        "d_s_d_slope": Line(("s",), 0.1 * x),
        "d_surface_displacement_d_slope": Line(("stage", "s"), np.stack([x, 2.0 * x])),
    }
    # u = (3 + 2 h) X at s = (1 + 0.1 h) X

    def slopes(read: Read) -> np.ndarray:
        seen, found = line.with_slopes(read, {"slope": 10.0}).T
        assert np.array_equal(seen, line.seen(read))
        return np.asarray(found)

    assert slopes(given.get) == pytest.approx(
        10.0 * np.array([0.25, 0.5]) * (2.0 - 3.0 * 0.1), rel=1e-4
    )
    assert np.isnan(slopes({**given, "d_s_d_slope": None}.get)).all()
    gap = np.stack([x, np.where(x == x[3], np.nan, 2.0 * x)])
    given["d_surface_displacement_d_slope"] = Line(("stage", "s"), gap)
    assert np.isnan(slopes(given.get)).all()
