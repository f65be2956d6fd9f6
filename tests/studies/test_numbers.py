"""The numbers of a study's runs as CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math

import numpy as np
import pytest

from residua.cli import main
from studies import Store, Study, open_study
from studies.views.best import table_of
from studies.views.table import RunTable, column_of
from studies.views.written import FORMS


def printed(capsys: pytest.CaptureFixture[str], *given: str) -> str:
    capsys.readouterr()
    assert main(["table", *given]) == 0
    return capsys.readouterr().out


def test_all_numbers_of_all_runs_are_written_with_all_their_digits(
    computed: tuple[Study, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    study, store = computed
    lines = list(csv.DictReader(io.StringIO(printed(capsys, str(store.directory)))))
    with open_study(store.directory) as dataset:
        assert len(lines) == study.size == dataset["status"].size
        for line in lines:
            place = {name: float(line[name]) for name in ("load_ratio", "friction")}
            run = dataset.sel(place).squeeze()
            assert float(line["peak_contact_pressure"]) == run["peak_contact_pressure"].item()
            assert line["status"] == "ok"
        own = dataset["status"].dims
        numbers = {
            n for n, e in dataset.data_vars.items() if e.dims == own and e.dtype.kind in "fi"
        }
        assert numbers <= set(lines[0])


def test_what_is_asked_for_is_written_in_order(
    computed: tuple[Study, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    where = str(computed[1].directory)
    asked = [
        "--columns",
        "friction",
        "status",
        "peak_contact_pressure",
        "--where",
        "load_ratio<0.5",
    ]
    listed = json.loads(printed(capsys, where, *asked, "--json", "--sort=-friction"))["rows"]
    assert [list(each) for each in listed] == [["friction", "status", "peak_contact_pressure"]] * 2
    assert [each["friction"] for each in listed] == [0.4, 0.0]
    both = json.loads(printed(capsys, where, "--json", "--where", "status=ok", "friction!=0.4"))[
        "rows"
    ]
    assert [each["load_ratio"] for each in both] == [0.3, 0.9]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["--columns", "frictoin"], "did you mean friction"),
        (["--where", "friction"], "must be NAME<VALUE"),
        (["--where", "hardening<none"], "compare them by = or !="),
        (["--where", "friction<low"], "'low' must be a number"),
        (["--where", "hardening=non"], "'non' must be one of none; did you mean none?"),
        (["--where", "hardening!=non"], "did you mean none?"),
        (["--where", "status=okk"], "'okk' must be one of ok, "),
        (["--where", "status=error"], "no run meets this"),
        (["--where", "friction>=0", "friction<0"], "'friction>=0, friction<0': no run meets this"),
        (["--where", "residual_stress>3"], "residual_stress is over component, y, x: must be a"),
        (["--columns", "residual_stress"], "residual_stress is over component, y, x: must be a"),
        (["--sort", "size"], "sort = 'size'"),
    ],
)
def test_a_mistake_is_told(
    computed: tuple[Study, Store], capsys: pytest.CaptureFixture[str], given: list[str], told: str
) -> None:
    assert main(["table", str(computed[1].directory), *given]) == 2
    assert told in capsys.readouterr().err


def test_columns_are_named_apart_or_with_commas(
    computed: tuple[Study, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["table", str(computed[1].directory), "--columns"]
    assert main([*given, "friction,status"]) == main([*given, "friction", "status"]) == 0
    one, other = capsys.readouterr().out.split("friction,status\n")[1:]
    assert one == other


def test_a_state_is_written_as_its_word() -> None:
    """A shakedown state; it is stored as a number, whose name is in the flags."""
    column = column_of("shakedown_state", np.array([1.0, np.nan, 0.0]), "result")
    text = b"".join(FORMS["csv"].write([column], np.arange(3))).decode()
    assert text.split() == ["shakedown_state", "elastic_shakedown", '""', "elastic"]


def test_a_run_without_a_number_has_none(computed: tuple[Study, Store]) -> None:
    with open_study(computed[1].directory) as dataset:
        failed = dataset.load().copy()
    failed["peak_contact_pressure"][0, 0] = float("nan")
    column = table_of(failed).columns["peak_contact_pressure"]
    assert b"".join(FORMS["csv"].write([column], np.array([0]))) == b'peak_contact_pressure\n""\n'
    failed["peak_contact_pressure"][0, 0] = float("inf")  # as the condition of a fit
    column = table_of(failed).columns["peak_contact_pressure"]
    (row,) = json.loads(b"".join(FORMS["json"].write([column], np.array([0]))))["rows"]
    assert row == {"peak_contact_pressure": None}


@pytest.mark.parametrize(
    ("sign", "met"),
    [("=", [1]), ("!=", [0, 2]), ("<", [0]), ("<=", [0, 1]), (">", []), (">=", [1])],
)
def test_a_number_is_the_one_that_is_named_though_it_was_rounded(sign: str, met: list[int]) -> None:
    column = column_of("friction", np.array([0.1, 0.1 + 0.2, math.nan]), "sweep")
    assert column.values[1] != 0.3
    table = RunTable(axes={}, columns={"friction": column})
    assert np.flatnonzero(table.meeting(f"friction{sign}0.3")).tolist() == met
