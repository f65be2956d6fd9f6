"""The timetable of passes."""

from __future__ import annotations

import pytest

from solver.errors import ModelError
from solver.loading.passes import Schedule


def schedule(**fields):
    known = {"n": 2, "track": 50.0, "step": 1.0, "directions": (1, -1), "driven": True}
    return Schedule(**(known | fields))


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (0.25, "pass 1, set down by 25%"),
        (1.5, "pass 1, driven by 50%"),
        (14.5, "pass 1, rolled 12.5 mm"),
        (52.0, "pass 1, rolled 50 mm"),
        (52.75, "pass 1, released by 75%"),
        (54.5, "pass 2, set down by 50%"),
    ],
)
def test_a_time_is_told_in_words(time, words):
    assert schedule().place(time) == words


@pytest.mark.parametrize("track", [20.7, 82.9])
def test_every_mark_of_many_passes_has_words(track):
    timetable = schedule(track=track, n=20, directions=(1,) * 20)
    for number in range(20):
        for mark in timetable.marks[:-1]:
            words = timetable.place(number * timetable.duration + mark)
            assert words.startswith(f"pass {number + 1}, ")


def test_there_and_back_is_a_cycle_of_two_passes():
    assert schedule().cycle == 2
    assert schedule(directions=(1, 1)).cycle == 1


def test_a_refined_timetable_has_more_increments_over_the_same_track():
    plain = schedule(step=0.9)
    fine = plain.refined(2)
    assert plain.half_steps == 28
    assert fine.half_steps == 2 * plain.half_steps
    assert fine.advance == pytest.approx(plain.advance / 2)
    assert fine.marks == plain.marks


def test_an_advance_beyond_half_the_track_is_refused():
    with pytest.raises(ModelError, match="step"):
        schedule(step=60.0)
