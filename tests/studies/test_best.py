"""The runs of a study in the order of a number."""

from __future__ import annotations

import numpy as np
import pytest

from residua.cli import main
from studies import Store, Study, StudyError, open_study
from studies.views.best import best_runs, table_of
from studies.views.written import as_csv
from tests.studies.conftest import compute_here, fake_study

OF = "peak_contact_pressure"
"""100 load_ratio (1 + friction) + half_width."""


def test_the_highest_or_lowest_come_first_and_failed_runs_do_not_count(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.6, 0.9], "friction": [0.0, 0.4]})
    compute_here(study, store)
    with open_study(store.directory) as dataset:
        assert best_runs(dataset, OF, count=2) == [
            {"load_ratio": 0.9, "friction": 0.4, OF: pytest.approx(176.0)},
            {"load_ratio": 0.9, "friction": 0.0, OF: pytest.approx(140.0)},
        ]
        lowest = best_runs(dataset, OF, ["friction>=0.1", "load_ratio != 0.3"], lowest=True)
        assert [each["load_ratio"] for each in lowest] == [0.6, 0.9]
        high = best_runs(dataset, OF, [f"{OF} < 100"])
        assert [each[OF] for each in high] == pytest.approx([92.0, 80.0])
    compute_here(fake_study("limited", trouble="limit"), store)
    with open_study(store.directory, "limited") as dataset:
        assert [each["load_ratio"] for each in best_runs(dataset, OF)] == [0.3, 0.3]


def test_points_and_words_are_told_and_compared(
    store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    points = [
        {"case": "A", "friction": 0.1, "hardening": "isotropic"},
        {"case": "B", "friction": 0.2},
        {"case": "C", "friction": 0.3},
    ]
    compute_here(Study.from_dict({"name": "p", "scene": "fake", "points": points}), store)
    command = ["best", str(store.directory), "--of", OF, "--where", "hardening=none"]
    assert main([*command, "case!=C"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[-1] == ["1", "B", "0.2", "none", "110"]
    assert len([line for line in lines if "none" in line]) == 1
    assert main([*command, "friction<0"]) == 2
    assert capsys.readouterr().err == (
        "residua: where = 'hardening=none, friction<0': no run that succeeded meets this\n"
    )


@pytest.mark.parametrize(
    ("of", "where", "told"),
    [
        ("peak_contact", [], "did you mean peak_contact_pressure"),
        ("status", [], "must be one of"),
        ("residual_stress", [], "over component, y, x: must be a variable with one number a run"),
        (OF, ["friction"], "must be NAME<VALUE"),
        (OF, ["frictoin<1"], "did you mean friction"),
        (OF, ["friction<low"], "'low' must be a number"),
        (OF, ["hardening<none"], "by = or !="),
    ],
)
def test_a_mistake_is_told_in_one_line(
    computed: tuple[Study, Store], of: str, where: list[str], told: str
) -> None:
    _, store = computed
    with open_study(store.directory) as dataset, pytest.raises(StudyError) as caught:
        best_runs(dataset, of, where)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_counts_are_whole_numbers_in_csv(store: Store) -> None:
    compute_here(fake_study(), store)
    with open_study(store.directory) as dataset:
        columns = [table_of(dataset).column(name) for name in ("increments", "load_ratio")]
    head, first, *_ = b"".join(as_csv(columns, np.arange(4))).decode().splitlines()
    assert head == "increments,load_ratio"
    count, load = first.split(",")
    assert count.isdecimal() and "." in load
