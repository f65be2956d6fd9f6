"""What a study costs is told before anything is computed, and may be bounded."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from residua.cli import main
from residua.progress import Foreseen, dry_run
from studies import Store, Study, StudyError
from studies.execution.estimate import Bounds, Estimate, estimate, memory_needed
from tests.counted import counted
from tests.stability.estimates import drawn, timed
from tests.studies.conftest import fake_study
from tests.studies.test_study import many

ROOT = Path(__file__).parents[2]
STUDIES = ROOT / "data" / "studies"
PUNCH = {"name": "small", "scene": "punch", "sweep": {"load_ratio": [0.3, 0.6]}}
LAW = 2e-6, 1.3
"""Rate and exponent of the seconds of made-up runs."""


def remember(
    store: Store, ids: list[str], figures: list[tuple[int, int, float]], keep: str = ""
) -> None:
    """Put runs of the punch into the catalogue: unknowns, increments, seconds."""
    names = ("degrees_of_freedom", "increments", "cpu_seconds")
    rows = [
        {
            "id": run_id, "scene": "punch", "status": "ok", "message": "", "parameters": {},
            "scalars": dict(zip(names, each, strict=True)), "path": f"runs/{run_id}.nc",
            "created": "2026-01-01T00:00:00+00:00", "cpu_seconds": each[2], "solver_source": "",
            "keep": keep,
        }
        for run_id, each in zip(ids, figures, strict=True)
    ]  # fmt: skip
    store.directory.mkdir(parents=True, exist_ok=True)
    store.catalogue.put(rows)


def made_up(unknowns: list[int], rate: float, exponent: float) -> list[tuple[int, int, float]]:
    """Runs of these sizes, whose seconds scatter by a third."""
    scatter = np.exp(0.3 * np.random.default_rng(7).standard_normal(len(unknowns)))
    steps = [10 + k % 13 for k in range(len(unknowns))]
    return [
        (n, increments, float(rate * n**exponent * increments * factor))
        for n, increments, factor in zip(unknowns, steps, scatter, strict=True)
    ]


def ids(count: int) -> list[str]:
    return [f"{k:032x}" for k in range(count)]


def test_a_study_is_counted_and_nothing_is_written(store: Store) -> None:
    study = Study.from_toml(STUDIES / "punch.toml")
    found = estimate(study, store)
    assert (found.runs, found.to_compute, found.paths) == (45, 45, 15)
    assert (found.unknowns, found.longest, found.increments) == (14833, 35, 15 * 35)
    assert found.cpu_seconds is not None
    low, likely, high = found.cpu_seconds
    assert low < likely < high
    assert 4 < high / low < 30, "wide where no runs are known"
    assert "fewer than 8 runs of punch" in found.basis
    assert not store.directory.exists()


def test_runs_that_are_there_cost_nothing(store: Store) -> None:
    study = Study.from_dict(PUNCH | {"sweep": {"friction": [0.0, 0.2], "load_ratio": [0.3, 0.6]}})
    whole = estimate(study, store)
    low, high, *_ = study.run_ids()
    remember(store, [low], [(14833, 11, 1.0)])
    part = estimate(study, store)
    assert (part.runs, part.to_compute, part.paths) == (4, 3, 2)
    remember(store, [high], [(14833, 17, 2.0)])
    half = estimate(study, store)
    assert (half.runs, half.to_compute, half.paths) == (4, 2, 1)
    assert whole.increments is not None and part.increments is not None
    assert half.increments == whole.increments / 2
    assert half.increments < part.increments < whole.increments


@pytest.mark.parametrize("outliers", [0, 2])
def test_the_pace_is_that_of_past_runs(store: Store, outliers: int) -> None:
    rate, exponent = LAW
    figures = made_up([3_000, 5_000, 9_000, 16_000, 30_000] * 12, rate, exponent)
    figures[:outliers] = [(n, increments, 1e4 * t) for n, increments, t in figures[:outliers]]
    remember(store, ids(len(figures)), figures)
    study = Study.from_dict(PUNCH)
    found = estimate(study, store)
    assert found.cpu_seconds is not None and found.increments is not None
    low, likely, high = found.cpu_seconds
    exact = rate * 14833**exponent * found.increments + 0.4
    # 60 runs that scatter by 0.3: their mean is known to 4 %, that of the exponential is 5 % higher
    assert likely == pytest.approx(exact, rel=0.2)
    assert 1.5 < high / low < 3.5, "one sixth of them is outside on either side"
    assert f"{len(figures)} runs of punch" in found.basis


@pytest.mark.long
@pytest.mark.solves
@pytest.mark.divides
def test_own_scenes_take_as_long_as_estimated(tmp_path: Path) -> None:
    """18 of 20, and a bar of large strain, whose increments cost more and are divided.

    A slow machine, or one with other work, is slow for all: `make stress` has the seconds.
    """
    neck = tomllib.loads((ROOT / "data/scenes/neck.toml").read_text())
    scenes = [("neck", neck), *drawn(20)]
    found = [timed(*each, tmp_path / str(k)) for k, each in enumerate(scenes)]
    pace = max(1.0, float(np.median([each.took / each.likely for each in found])))
    inside = [each.low <= each.took / pace <= each.high for each in found]
    assert inside[0] and sum(inside) >= 19, (pace, found)


def test_a_goal_is_estimated_by_the_search_that_is_expected(store: Store) -> None:
    """Computed, it takes 42 runs and 23 s; the most that it may ask for are 132."""
    study = Study.from_toml(STUDIES / "shakedown-limit.toml")
    found = estimate(study, store)
    assert (found.runs, found.usual_runs) == (132, 48)
    assert found.cpu_seconds is not None and found.most_cpu_seconds is not None
    low, likely, high = found.cpu_seconds
    assert low < 23 < high and likely == pytest.approx(23, rel=0.4)
    assert found.most_cpu_seconds == pytest.approx(132 / 48 * high)
    assert "runs            about 48, at most 132" in (text := dry_run(study, store))
    assert f"; at most {found.most_cpu_seconds:.0f})" in text


def test_a_mesh_larger_than_any_known_is_told_with_more_doubt(store: Store) -> None:
    remember(store, ids(20), made_up([3_000] * 20, *LAW))
    spread = []
    for size in (5e-3, 5e-4, 1e-4):
        study = Study.from_dict(
            PUNCH | {"parameters": {"smallest_element": size, "growth": 1.2, "element": "quad9"}}
        )
        found = estimate(study, store)
        assert found.cpu_seconds is not None
        spread.append(found.cpu_seconds[2] / found.cpu_seconds[0])
    assert spread == sorted(spread)
    assert spread[-1] > 1.4 * spread[0]


def test_a_scene_that_does_not_tell_its_work_is_told_by_its_runs(store: Store) -> None:
    found = estimate(fake_study(), store)
    assert (found.runs, found.to_compute, found.paths) == (4, 4, 2)
    assert found.unknowns is found.increments is found.cpu_seconds is None
    assert found.bytes > 0
    assert found.basis == "fake does not estimate the work of its paths"
    Bounds(unknowns=1, increments=1, cpu_seconds=1.0).check(found)


def test_runs_that_the_scene_refuses_cost_no_work_and_hide_no_others(store: Store) -> None:
    """At 10 mm the flange of the wheel would be inside the rail."""

    def of(*places: float) -> Estimate:
        content = {"name": "aside", "scene": "wheel_rail", "parameters": {"accuracy": "draft"}}
        axis = {"lateral_position": list(places)}
        return estimate(Study.from_dict(content | {"sweep": axis}), store)

    one, both = of(-4.0), of(-4.0, 10.0)
    assert (both.to_compute, both.increments) == (2, one.increments)
    assert one.cpu_seconds is not None and both.cpu_seconds is not None
    assert one.cpu_seconds[1] < both.cpu_seconds[1] < one.cpu_seconds[1] + 2.0


def test_kept_fields_count_on_the_disk(store: Store) -> None:
    plain = estimate(Study.from_dict(PUNCH), store)
    kept = estimate(Study.from_dict(PUNCH | {"keep": "fields"}), store)
    assert plain.unknowns and plain.to_compute == kept.to_compute == 2
    each = (kept.bytes - plain.bytes) / (kept.to_compute * plain.unknowns)
    assert 50 < each < 400


def test_files_are_as_large_as_those_that_keep_as_much(store: Store) -> None:
    remember(store, ids(20), [(9_000, 10, 1.0)] * 20, keep="fields")
    path = store.run_path(ids(20)[3])
    path.parent.mkdir()
    path.write_bytes(bytes(5_000_000))
    plain = estimate(Study.from_dict(PUNCH), store)
    kept = estimate(Study.from_dict(PUNCH | {"keep": "fields"}), store)
    assert plain.bytes < kept.bytes
    assert kept.bytes == pytest.approx(2 * 1.8 * 5e6)


MEASURED = """
import importlib, sys
from solver import SCENES
from solver.memory import peak_memory
from studies.execution.forks import NEEDED
for name in NEEDED:
    importlib.import_module(name)
scene = SCENES[sys.argv[1]]
parameters = scene.parameters(accuracy="draft")
value = getattr(parameters, scene.branch)
for _ in scene.path(parameters, [value], lambda share: None):
    pass
print(peak_memory())
"""


@pytest.mark.processes
@pytest.mark.parametrize(
    "scene",
    ["punch", *(pytest.param(each, marks=pytest.mark.long) for each in ("rolling", "raceway"))],
)
def test_the_memory_told_is_that_of_a_worker(
    scene: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Libraries are counted whole also for a scene that needs few of them."""
    monkeypatch.setenv("RESIDUA_KEPT_MEMORY", "0B")
    content = {"name": "one", "scene": scene, "parameters": {"accuracy": "draft"}}
    told = estimate(Study.from_dict(content), store).memory
    command = [sys.executable, "-c", MEASURED, scene]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert told is not None
    assert 0.8 < told / int(done.stdout) < 1.7


def test_a_worker_is_told_to_need_what_it_keeps_beside_its_path(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = Study.from_dict(PUNCH)
    needed = []
    for kept in ("0B", "10MB", "10GB"):
        monkeypatch.setenv("RESIDUA_KEPT_MEMORY", kept)
        needed.append(memory_needed(study))
        assert needed[-1] == estimate(study, store).memory
    none, some, all_of_it = needed
    assert some == none + 10_000_000 < all_of_it < 2 * none


def test_20_000_runs_are_estimated_with_150_calls_each(store: Store) -> None:
    remember(store, ids(1000), made_up([9_000] * 1000, *LAW))
    study = Study.known(many(20_000))
    with counted() as calls:
        found = estimate(study, store)
    assert calls < 3_000_000
    assert (found.to_compute, found.paths) == (20_000, 5_000)


@pytest.mark.parametrize(
    ("bounds", "field"),
    [
        (Bounds(runs=1), "runs"),
        (Bounds(unknowns=14_000), "unknowns"),
        (Bounds(increments=20), "increments"),
        (Bounds(cpu_seconds=1.0), "cpu_seconds"),
        (Bounds(bytes=1_000_000), "bytes"),
    ],
)
def test_a_bound_names_itself_and_its_setting(store: Store, bounds: Bounds, field: str) -> None:
    found = estimate(Study.from_dict(PUNCH), store)
    with pytest.raises(StudyError) as caught:
        bounds.check(found)
    assert caught.value.field == f"estimate.{field}"
    assert f"(setting max_{field})" in caught.value.allowed
    assert f"at most {getattr(bounds, field):g}" in caught.value.allowed
    Bounds().check(found)
    Bounds(runs=2, unknowns=14_833, increments=30, cpu_seconds=1e6, bytes=10**9).check(found)


def test_millions_of_elements_and_ten_thousands_of_increments_are_refused(store: Store) -> None:
    """The scene allows them: it is the operator who has no time for them."""
    study = Study.from_dict(
        {
            "name": "huge",
            "scene": "rolling",
            "parameters": {
                "element_size": 0.03, "growth": 1.0, "track": 1.0, "advance_step": 0.001,
                "passes": 49,
            },
        }
    )  # fmt: skip
    with counted() as calls:
        found = estimate(study, store)
    assert calls < 15_000
    assert found.unknowns is not None and found.unknowns > 3e6
    assert found.longest is not None and found.longest > 49_000
    for bounds in (Bounds(unknowns=500_000), Bounds(increments=20_000), Bounds(cpu_seconds=1e6)):
        with pytest.raises(StudyError, match="at most"):
            bounds.check(found)


def test_too_many_runs_are_refused_before_they_are_gone_through() -> None:
    study = Study.known(many(80_000))
    with counted() as calls, pytest.raises(StudyError, match=r"estimate\.runs = 80000: at most"):
        Bounds(runs=20_000).refuse(runs=study.size)
    assert calls < 300_000


def test_dry_run_tells_the_cost_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = STUDIES / "punch.toml"
    assert main(["run", str(path), "--dry-run", "--out", str(tmp_path / "none")]) == 0
    told = capsys.readouterr().out
    for words in ("nothing is computed or written", "45 in all, 45 to compute", "15 to walk",
                  "at most 14833 a run", "525 in all", "seconds (", " MB"):  # fmt: skip
        assert words in told
    assert not list(tmp_path.iterdir())


def test_dry_run_and_draw_name_a_wrong_unit_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "soft.toml"
    path.write_text('name = "soft"\nscene = "punch"\n[parameters]\nyoungs_modulus = 210\n')
    warning = "warning: punch.youngs_modulus = 210: 210000 MPa was probably meant"
    assert main(["run", str(path), "--dry-run", "--out", str(tmp_path / "none")]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith(warning)
    assert main(["draw", str(path), "--out", str(tmp_path / "soft.png")]) == 0
    assert capsys.readouterr().err.startswith(warning)


def test_dry_run_tells_what_is_not_known(
    study_file: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["run", str(study_file()), "--dry-run", "--out", str(tmp_path / "none")]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:])
    assert lines["unknowns"] == lines["increments"] == "not known"


def test_run_says_at_once_how_many_runs_it_will_compute(store: Store) -> None:
    usual, tour = Study.from_dict(many(40)), Study.from_toml(STUDIES / "tour.toml")
    search = Study.from_toml(STUDIES / "first-yield.toml")
    short = Foreseen.of(tour, store)
    assert short.short and short.text.startswith("tour: 4 runs to compute, about ")
    assert not Foreseen.of(usual, store).short
    assert Foreseen.of(search, store).text.startswith("first-yield: about 24 runs to compute, ")
    assert Foreseen.of(fake_study(), store) == Foreseen("fake: 4 runs to compute")
    remember(store, list(tour.run_ids()), [(5_000, 11, 1.0)] * 4, keep="fields")
    assert Foreseen.of(tour, store).text == ""
    remember(store, list(fake_study().run_ids()), [(5_000, 11, 1.0)] * 4)
    assert Foreseen.of(fake_study(), store) == Foreseen()


def test_dry_run_counts_where_the_first_run_is_refused(store: Store) -> None:
    content = {"name": "aside", "scene": "wheel_rail", "parameters": {"accuracy": "draft"}}
    study = Study.from_dict(content | {"sweep": {"lateral_position": [5.0, -4.0]}})
    lines = dry_run(study, store).splitlines()
    assert lines[1].startswith("warning: the first run cannot be computed: lateral_position = 5")
    assert lines[2].split() == ["runs", "2", "in", "all,", "2", "to", "compute"]


@pytest.mark.processes
def test_make_run_computes_first_what_takes_seconds(store: Store) -> None:
    command = ["make", "--dry-run", "--assume-old", "setup", "run"]
    asked = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    first, *_ = re.findall(r"residua run (\S+\.toml)", asked)
    told = estimate(Study.from_toml(ROOT / first), store).cpu_seconds
    assert told is not None and told[1] < 10


def test_runs_that_cannot_be_set_up_cost_nothing_and_are_refused_if_all_are(store: Store) -> None:
    """Where the wheel cannot touch is known only with both profiles; `run` computes the others."""

    def positions(*z: float) -> Study:
        content = {"scene": "wheel_rail", "parameters": {"accuracy": "draft"}}
        return Study.from_dict(
            {"name": "places", **content, "sweep": {"lateral_position": list(z)}}
        )

    one, both = (estimate(positions(*z), store) for z in ((-4.0,), (-4.0, 5.0)))
    assert one.cpu_seconds is not None and both.cpu_seconds is not None
    assert one.cpu_seconds < both.cpu_seconds < tuple(1.0 + each for each in one.cpu_seconds)
    with pytest.raises(StudyError, match="must leave the flange beside the rail") as caught:
        estimate(positions(5.0), store)
    assert caught.value.field == "sweep.lateral_position[0]"
    tiny = {"name": "tiny", "scene": "raceway", "parameters": {"radius": 1e-300}}
    with pytest.raises(StudyError, match=r"^mesh = .*is flat"):
        estimate(Study.from_dict(tiny), store)
