"""A solution that was saved and loaded gives the same answers."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from solver import Body, InitialStress, Material, Model, ModelError, Solution, solve
from solver.mesh import grid
from solver.results import saved
from tests.solver.test_export import pressed


@pytest.mark.solves
def test_a_loaded_solution_answers_as_the_saved_one(tmp_path: Path) -> None:
    before = pressed("quad8")
    before.save(tmp_path / "pressed.solution")
    after = Solution.load(tmp_path / "pressed.solution")
    assert list(after.stages) == ["loaded", "unloaded"]
    for stage in after.stages:
        for body in ("upper", "lower"):
            np.testing.assert_array_equal(after.stress(body, stage), before.stress(body, stage))
        ours, theirs = after.contact(stage=stage), before.contact(stage=stage)
        for name in (each.name for each in fields(ours)):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
    at = [[0.5, 1.0], [-0.5, 0.5]]
    for name, values in after.at("lower", at).items():
        np.testing.assert_array_equal(values, before.at("lower", at)[name])
    assert after.audit().figures == pytest.approx(before.audit().figures, rel=1e-9, abs=1e-12)
    assert [f.name for f in fields(after)] == [f.name for f in fields(before)]
    assert repr(after.history) == repr(before.history)


def test_other_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.solution"
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        Solution.load(path)
    path.write_bytes(b"something else")
    with pytest.raises(ModelError, match=r"must be a file that Solution\.save has written"):
        Solution.load(path)
    saved.write(path, {"model": None})
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(ModelError, match="is damaged"):
        Solution.load(path)
    saved.write(path, {"model": Material(youngs_modulus=2e5, poisson_ratio=0.3)})
    path.write_bytes(path.read_bytes().replace(b"solver.materials", b"solver.mbterials"))
    with pytest.raises(ModelError, match=r"this version .* lack: No module named"):
        Solution.load(path)
    monkeypatch.setattr(saved, "__version__", "9.9")
    with pytest.raises(ModelError, match=r"is of version .* of the solver, and this is 9\.9"):
        Solution.load(path)


@pytest.mark.solves
def test_a_model_that_cannot_be_stored_says_why_and_writes_nothing(tmp_path: Path) -> None:
    x = np.linspace(0.0, 1.0, 2)
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    made = InitialStress(stress=lambda X: np.zeros((4, X.shape[1])))
    body = Body(name="block", mesh=grid(x, x), material=steel, loads=(made,),
                supports={"bottom": "y", "left": "x"}, pressure={"top": 1.0})  # fmt: skip
    found = solve(Model(bodies=(body,)))
    with pytest.raises(ModelError, match="must hold no lambda"):
        found.save(tmp_path / "a.solution")
    assert not list(tmp_path.iterdir())


def test_what_was_saved_before_stays_until_the_new_file_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.solution"
    saved.write(path, {"model": 1})

    def full(self: Path, data: bytes) -> int:
        with self.open("wb") as file:
            file.write(data[:5])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ModelError, match="cannot be written: No space left"):
        saved.write(path, {"model": 2})
    assert saved.read(path) == {"model": 1}
    assert [each.name for each in tmp_path.iterdir()] == ["a.solution"]
    with pytest.raises(ModelError, match="cannot be written"):
        saved.write(tmp_path / "nowhere" / "a.solution", {})
