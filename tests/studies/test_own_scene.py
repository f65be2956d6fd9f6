"""Runs of a scene of the user's own are known by what the scene's module computes."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import pytest

from solver.shipped import SCENES
from studies import Store, Study
from studies.definition.identity import solver_hash, written
from studies.execution.task import PathTask, Unfit, walk

SCRIPT = '''"""A scene."""

from dataclasses import replace

from solver.scenes.punch import PUNCH

FACTOR = 2.0


def double(look):
    """Return twice the load."""
    return {}


OWN = replace(PUNCH, name="own", outputs=(*PUNCH.outputs, double))

if __name__ == "__main__":
    print("a study")
'''

Load = Callable[[str], ModuleType]


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Load:
    """Return what writes a script and imports it, each time as a module of its own."""

    def make(text: str) -> ModuleType:
        name = f"own_scene_{len(list(tmp_path.iterdir()))}"
        path = tmp_path / f"{name}.py"
        path.write_text(text)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    return make


def ids(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str, str]:
    """Return the ids of a study of the module's scene, of its run and of its path."""
    monkeypatch.setitem(SCENES, "own", module.OWN)
    study = Study.from_dict({"name": "own", "scene": "own", "sweep": {"friction": [0.1]}})
    return study.id, next(study.cases()).id, next(study.paths()).id


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("FACTOR = 2.0", "FACTOR = 3.0", False),
        ("(*PUNCH.outputs, double)", "(double,)", False),
        ("return {}", "return {}  # nothing", True),
        ("twice the load", "two times the load", True),
        ('print("a study")', 'print("another study")', True),
    ],
)
def test_a_change_of_what_a_script_computes_gives_new_ids(
    old: str, new: str, same: bool, load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert SCRIPT.count(old) == 1
    before = ids(load(SCRIPT), monkeypatch)
    after = ids(load(SCRIPT.replace(old, new)), monkeypatch)
    assert [a == b for a, b in zip(before, after, strict=True)] == [same] * 3


def test_ids_are_those_of_the_code_that_is_loaded(
    load: Load, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A notebook goes on with the code it has, also when its file is another one."""
    monkeypatch.syspath_prepend(tmp_path)
    own = load(SCRIPT)
    before = ids(own, monkeypatch)
    Path(str(own.__file__)).write_text(SCRIPT.replace("FACTOR = 2.0", "FACTOR = 3.25"))
    assert ids(own, monkeypatch) == before, "though the file has changed"
    after = ids(importlib.reload(own), monkeypatch)
    assert own.FACTOR == 3.25
    assert not {*after} & {*before}


def test_a_worker_that_has_loaded_another_scene_of_the_name_refuses(
    load: Load, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = load(SCRIPT)
    monkeypatch.setitem(SCENES, "own", own.OWN)
    study = Study.from_dict({"name": "own", "scene": "own", "parameters": {}})
    task = PathTask(own.OWN, tuple(study.paths()), store.directory, solver_hash())
    other = ModuleSpec(own.__name__, None)  # as where another process has loaded it
    monkeypatch.setattr(own, "__spec__", other)
    Path(str(own.__file__)).write_text(SCRIPT.replace("FACTOR = 2.0", "FACTOR = 3.25"))
    with pytest.raises(Unfit, match=f"another version of {own.__name__}"):
        walk(task, lambda content: None, lambda: False)
    assert not list(store.directory.glob("runs/*"))


def test_an_output_taken_from_a_scene_of_the_solver_is_seen() -> None:
    punch = SCENES["punch"]
    assert not any(digest for _, digest in written(punch)), "the solver has a digest of its own"
    assert written(replace(punch, outputs=punch.outputs[1:])) != written(punch)
