"""Tables of published numbers: what they hold, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.errors import StudyError
from studies.views.comparison.reference import read_reference, reference_of


def table(path: Path, *rows: str) -> Path:
    path.write_text(
        "\n".join(("case,pass,quantity,component,depth,value,low,high,unit,source", *rows))
    )
    return path


def test_the_published_numbers_of_rolling_are_those_of_its_table() -> None:
    rows = read_reference(reference_of("rolling"))
    assert {row.case for row in rows} <= {f"T{number}" for number in range(1, 11)}
    free = [row for row in rows if (row.key, row.quantity) == (("T1", 1), "surface")]
    assert {row.component: row.value for row in free[:2]} == {"xx": 250.0, "zz": 90.0}
    assert all("p. " in row.source or "pp. " in row.source for row in rows)


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("A,1,lowest,xx,,1,,,MPa,p", "r.csv:2: quantity = 'lowest': must be 'surface', "),
        ("A,0,minimum,xx,,1,,,MPa,p", "r.csv:2: pass = '0': must be greater than or equal to 1"),
        ("A,1,minimum,xx,,much,,,MPa,p", "r.csv:2: value = 'much': must be a valid number"),
        ("A,1,minimum,xx,,nan,,,MPa,p", "r.csv:2: value = 'nan': must be a finite number"),
        ("A,1,minimum,xx,,1,,,mm,p", "r.csv:2: unit = 'mm': must be 'MPa'"),
        ("A,1,minimum,xx,,1,,,1,p", "r.csv:2: unit = '1': must be MPa here"),
        ("A,1,minimum,xx,,,,,MPa,p", "r.csv:2: value = '': must be given, or low, high or depth"),
        ("A,1,minimum,xx,,1,0,,MPa,p", "r.csv:2: value = '1': must be empty where low or high"),
        ("A,1,minimum,xx,,,2,1,MPa,p", "r.csv:2: high = '1': must be larger than low"),
        ("A,1,surface,xx,2,1,,,MPa,p", "r.csv:2: depth = '2': must be empty at the surface"),
        ("A,1,minimum,xx,,1,,,MPa,", "r.csv:2: source = '': must be given"),
        ("A,1,minimum,xx,,1,,,MPa,p,q", "beyond the last column = ['q']: is no column of"),
    ],
)
def test_a_wrong_row_is_told_by_line_column_and_value(tmp_path: Path, row: str, told: str) -> None:
    with pytest.raises(StudyError) as caught:
        read_reference(table(tmp_path / "r.csv", row))
    assert told in str(caught.value)


HEADING = b"case,quantity,component,value,unit,source\n"


def test_a_scene_without_published_numbers_asks_for_a_table() -> None:
    with pytest.raises(StudyError, match="--reference = None: must name a table"):
        reference_of("punch")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "must hold a heading and published numbers"),
        (HEADING, "must hold a heading and published numbers"),
        (HEADING + b"\xff", "must be a table in UTF-8"),
        (HEADING + b'"A', "must be comma-separated"),
        (b"case,valu\nA,1", r"^r.csv:1: column = 'valu': must be one of .*did you mean value\?$"),
        (b"case,case\nA,1", "^r.csv:1: column = 'case': occurs twice: keep one$"),
        (b"case,value\nA,1", "^r.csv:1: heading = 'case,value': must name quantity, component, "),
        (b"\ncase,value\nA,1", "^r.csv:1: heading = '': must name case, quantity, "),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "r.csv"
    path.write_bytes(content)
    with pytest.raises(StudyError, match=told):
        read_reference(path)
