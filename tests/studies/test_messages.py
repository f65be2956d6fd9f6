"""Messages of runs and studies, which go to others, show no folder of this machine."""

from __future__ import annotations

import pytest

from studies.errors import StudyError, one_of, without_folders
from studies.execution.task import _reason


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("[Errno 13] No permission: '/srv/data/ab.nc'", "[Errno 13] No permission: 'ab.nc'"),
        ('cannot open "/srv/my data/ab.nc": no', 'cannot open "ab.nc": no'),
        ("the file /srv/data/ab.nc, and (/tmp/x/y) too: /etc", "the file ab.nc, and (y) too: etc"),
        ("path=/opt/own/own.py: line 3", "path=own.py: line 3"),
    ],
)
def test_of_a_path_the_last_part_is_shown(text: str, plain: str) -> None:
    assert without_folders(text) == plain


@pytest.mark.parametrize(
    "text",
    [
        "no scheduler answers at tls://scheduler:8786",
        "slope 3 N/mm, 1 / 2, and/or, +/-0.3",
        "see http://127.0.0.1:8000/studies/ab",
        "meshes/pin.msh cannot be read",
    ],
)
def test_what_is_no_path_stays(text: str) -> None:
    assert without_folders(text) == text


def test_the_message_of_a_run_that_failed_shows_no_folder() -> None:
    error = FileNotFoundError(2, "No such file", "/srv/data/own.csv")
    assert _reason(error) == "FileNotFoundError: [Errno 2] No such file: 'own.csv'"


def test_each_of_several_mistakes_is_told_once() -> None:
    mistake = StudyError("friction", 2, "at most 1", [StudyError("load", -1, "positive")])
    assert mistake.listed == ["friction = 2: at most 1", "load = -1: positive"]
    assert str(mistake).splitlines() == mistake.listed


def test_a_list_that_is_cut_tells_what_lists_all() -> None:
    names = [f"n{k}" for k in range(12)]
    assert one_of("x", names, "residua table lists all").endswith(
        "n9 and 2 more (residua table lists all)"
    )
    assert "residua table" not in one_of("x", names[:9], "residua table lists all")
