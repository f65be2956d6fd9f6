"""Files of tests that take long start first, and those that share services go to one process."""

from __future__ import annotations

from tests.marks import HERE
from tests.order import FIRST, TOGETHER, place, turned, unit


def test_files_that_start_first_exist_and_are_named_once() -> None:
    assert not [path for path in FIRST if not path.exists()]
    assert len(set(FIRST)) == len(FIRST)


def test_files_that_share_services_are_one_unit_which_starts_first() -> None:
    shared = TOGETHER / "test_http.py"
    assert (unit(shared), place(shared)) == (TOGETHER, 0)


def test_a_file_that_is_named_starts_in_its_place_and_any_other_after_all_of_these() -> None:
    alone = HERE / "service" / "test_durability.py"
    assert (unit(alone), FIRST[place(alone)]) == (alone, alone)
    other = HERE / "architecture" / "test_order.py"
    assert (unit(other), place(other)) == (other, len(FIRST))


def test_processes_begin_to_collect_at_other_files_and_have_them_all() -> None:
    begun = [turned(number / 3) for number in range(3)]
    assert len({each[0] for each in begun}) == 3
    tests = {*HERE.rglob("test_*.py")}
    for each in begun:
        assert len(each) == len(set(each))
        assert {file for file in tests if {file, *file.parents} & {*each}} == tests
