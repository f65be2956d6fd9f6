"""The timetable of passes."""

from __future__ import annotations

import numpy as np
import pytest

from solver.rolling.scenes.schedule import Schedule


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


def test_a_refined_program_has_more_increments_over_the_same_track_and_as_many_elsewhere():
    plain = schedule(step=0.9).program
    fine = plain.refined(2)
    assert schedule(step=0.9).half_steps == 28
    assert len(fine.targets) - len(plain.targets) == 2 * 2 * 28
    times = [{target.time for target in program.targets} for program in (plain, fine)]
    assert times[0] < times[1]


def test_every_pass_keeps_the_same_states_and_begins_where_it_must():
    timetable = schedule()
    first, second = timetable.program.laps
    names = ["set_down", "driven", "mid_track", "loaded", "unloaded"]
    assert [stage.name for stage in first.stages] == names
    assert [stage.name for stage in second.stages] == names
    assert (first.start, second.start) == (0.0, timetable.duration)
    assert timetable.position.at(second.start) == 25.0
    assert timetable.travel(second.start + 2.0 + 7.5) == 7.5


def test_loads_and_ways_are_amplitudes_over_the_same_time():
    timetable = schedule()
    back = timetable.duration + 20.0
    assert [a.at(20.0) for a in (timetable.load, timetable.drive, timetable.way)] == [1, 1, 1]
    assert [a.at(back) for a in (timetable.load, timetable.drive, timetable.way)] == [1, -1, -1]
    assert schedule(driven=False).drive.value.any() == np.False_
