"""Curves of points in studies: as lists, and from files that a study file names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray as xr

from solver.errors import ModelError
from solver.files import number_of
from solver.rolling.rail.profiles.points import read_points
from solver.shipped import SCENES
from studies import Study
from studies.definition.parameters import parameters_of
from studies.errors import StudyError
from studies.views.columns import value_text
from studies.views.plots.captions import setting

POINTS = [[float(z), z**2 / 600.0] for z in range(-40, 41, 4)]


def written(folder: Path, text: str, file: str = "wheel.csv") -> Path:
    """Write a study with one parameter from a file of points; return its path."""
    lines = [f"{z},{y!r}" if file.endswith(".csv") else f"{z}  {y!r}" for z, y in POINTS]
    (folder / file).write_text("z, y\n" + "\n".join(lines))
    path = folder / "study.toml"
    path.write_text(text)
    return path


def fixed(value: object) -> str:
    return f'name = "worn"\nscene = "wheel_rail"\n[parameters]\nwheel_profile = {value}\n'


@pytest.mark.parametrize("file", ["wheel.csv", "wheel.txt"])
def test_a_file_of_points_is_read_into_the_study(tmp_path: Path, file: str) -> None:
    """The study has the id of one with the same points, so that no other file counts."""
    from_file = Study.from_toml(written(tmp_path, fixed(f'"{file}"'), file))
    given = Study.from_toml(written(tmp_path, fixed(POINTS)))
    content = {
        "name": "worn", "scene": "wheel_rail", "parameters": {"wheel_profile": POINTS}
    }  # fmt: skip
    assert from_file.parameters["wheel_profile"] == POINTS
    assert from_file.id == given.id == Study.from_dict(content).id
    (case,) = from_file.expansion.cases()
    assert case.parameters.wheel_profile == tuple(map(tuple, POINTS))


def test_a_file_of_points_may_be_swept(tmp_path: Path) -> None:
    text = (
        'name = "worn"\nscene = "wheel_rail"\n[sweep.wheel]\nnew = { wheel_profile = "s1002" }\n'
        'worn = { wheel_profile = "wheel.csv", load = 8e4 }\n'
    )
    new, worn = Study.from_toml(written(tmp_path, text)).expansion.cases()
    assert new.parameters.wheel_profile == "s1002"
    assert worn.parameters.wheel_profile == tuple(map(tuple, POINTS))


def test_a_wheel_of_a_sequence_may_have_a_file_of_points(tmp_path: Path) -> None:
    text = (
        'name = "worn"\nscene = "wheel_rail"\n[[parameters.sequence]]\nload = 9e4\n'
        '[[parameters.sequence]]\nwheel_profile = "wheel.csv"\n'
    )
    from_file = Study.from_toml(written(tmp_path, text))
    given = [{"load": 9e4}, {"wheel_profile": POINTS}]
    content = {"name": "worn", "scene": "wheel_rail", "parameters": {"sequence": given}}
    assert from_file.id == Study.from_dict(content).id
    (case,) = from_file.expansion.cases()
    new, worn = case.parameters.block
    assert (new.wheel_profile, worn.wheel_profile) == ("s1002", tuple(map(tuple, POINTS)))


def test_a_file_that_cannot_be_read_is_named_with_its_place(tmp_path: Path) -> None:
    path = written(tmp_path, fixed('"other.csv"'))
    wrong = r"parameters\.wheel_profile = 'other\.csv': is read as a curve .*: file must be"
    with pytest.raises(StudyError, match=wrong):
        Study.from_toml(path)
    (tmp_path / "other.csv").write_text("0,0\n1,0\n1,1\n2,0\n")
    with pytest.raises(
        StudyError, match=r"other\.csv': .*: points must be points whose z increases"
    ):
        Study.from_toml(path)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("s1003", "must be one of s1002, conical, crowned or a list of"),
        ([[0.0, 1.0]], "must have at least 4 points"),
        ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 0.0]], "z increases; these are number 1 and 2"),
        ([1.0, 2.0], "must be one of s1002, conical, crowned or a list of"),
    ],
)
def test_what_is_no_profile_is_refused(value: object, told: str) -> None:
    content = {"name": "worn", "scene": "wheel_rail", "parameters": {"wheel_profile": value}}
    with pytest.raises(StudyError, match=rf"wheel_profile = .*{told}"):
        Study.from_dict(content)


def test_the_description_says_that_points_are_allowed() -> None:
    allowed = parameters_of(SCENES["wheel_rail"])["rail_profile"].allowed
    assert allowed == "60e1 or a list of [a finite number, a finite number] or a SectionMesh"


def test_tables_and_pictures_count_points_and_entries() -> None:
    entries = [{"load": 1e5}] * 300
    assert value_text(POINTS) == f"{len(POINTS)} points"
    assert value_text(json.dumps(entries)) == "300 tables"
    given = {"wheel_profile": POINTS, "sequence": entries}
    run = xr.Dataset(
        coords={"rail_profile": json.dumps(POINTS)},
        attrs={"scene": "wheel_rail", "parameters": json.dumps(given)},
    )
    assert setting(run).replace("\N{NO-BREAK SPACE}", " ") == (
        "wheel_rail · rail profile 21 points · wheel profile 21 points · sequence 300 tables"
    )


def test_an_error_at_a_profile_is_short() -> None:
    content = {
        "name": "worn", "scene": "wheel_rail", "parameters": {"friction": 0.0, "traction": 0.1},
        "sweep": {"wheel_profile": [POINTS]},
    }  # fmt: skip
    with pytest.raises(StudyError, match="must be 0 without friction") as caught:
        Study.from_dict(content)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("cell", ["\u0666.5", "1_000"])
def test_digits_of_files_are_those_of_toml_and_json(tmp_path: Path, cell: str) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        number_of(cell)
    (tmp_path / "p.csv").write_text(f"{cell},0\n" + "".join(f"{z},0\n" for z in range(9)))
    with pytest.raises(ModelError, match="line 1 is"):
        read_points(tmp_path / "p.csv")


def test_whole_numbers_of_tables_may_have_a_decimal_point(tmp_path: Path) -> None:
    for cell, told in (("2.0", None), ("2.5", r"passes = '2.5': must be an integer")):
        (tmp_path / "t.csv").write_text(f"passes,friction\n{cell},0.1\n")
        path = tmp_path / "study.toml"
        path.write_text('name = "p"\nscene = "rolling"\n[points]\nfile = "t.csv"\n')
        if told is None:
            (case,) = Study.from_toml(path).cases()
            assert case.values["passes"] == 2 and isinstance(case.values["passes"], int)
        else:
            with pytest.raises(StudyError, match=told):
                Study.from_toml(path)


def test_an_unknown_word_says_where_own_words_come_from() -> None:
    with pytest.raises(StudyError, match=r"a word of your own needs its file in .* RESIDUA_PARTS"):
        Study.from_dict({"name": "p", "scene": "punch", "parameters": {"hardening": "swift"}})
