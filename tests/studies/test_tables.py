"""Messages of runs: each kind once, with its range and the runs that have it."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from studies.views.tables import messages, runs_table


def told(texts: list[str], statuses: list[str]) -> str:
    return messages(
        xr.Dataset(
            {
                "status": ("load_ratio", np.array(statuses, dtype=object)),
                "message": ("load_ratio", np.array(texts, dtype=object)),
            },
            coords={"load_ratio": np.linspace(0.1, 0.1 * len(texts), len(texts))},
        )
    )


def test_messages_that_differ_in_numbers_are_one_kind_with_its_range() -> None:
    texts = ["strain reaches 12%: reduce T1", "", "strain reaches 9.5%: reduce T1"]
    told_of = told([*texts, "strain reaches 12%: reduce T2"], ["ok"] * 4)
    assert (
        "\nwarning: strain reaches 9.5 to 12%: reduce T1\n    2 runs: load_ratio = 0.1; " in told_of
    )
    assert "\nwarning: strain reaches 12%: reduce T2\n    1 run: load_ratio = 0.4\n" in told_of


def test_outcomes_are_kinds_of_their_own() -> None:
    text = "between x = -1e-3 and 2 of body 'pin2'"
    told_of = told([text, text.replace("-1e-3", "0.5")], ["ok", "limit_load"])
    assert f"\nwarning: {text}\n" in told_of
    assert "\nlimit_load: between x = 0.5 and 2 of body 'pin2'\n" in told_of


def test_rounding_beside_numbers_of_its_unit_is_zero() -> None:
    """Not small numbers alone."""

    def study(**numbers: list[float]) -> str:
        own = {name: ("a", values, {"units": "mm"}) for name, values in numbers.items()}
        status = ("a", np.array(["ok", "ok"], dtype=object))
        return runs_table(xr.Dataset({"status": status, **own}, {"a": [1, 2]}))

    assert "4.6e-11" not in study(moved=[350.0, 4.6e-11])
    assert "4.6e-11" not in study(moved=[350.0, 350.0], other=[4.6e-11, 2.0])
    assert "4.6e-11" in study(moved=[4.6e-11, 1e-11])


def test_wear_has_its_columns() -> None:
    """Wear is no rounding, however small it is beside other lengths."""
    numbers = {"wear_depth": (1e-11, "mm"), "slip_length": (0.02, "mm")}
    held: dict[str, Any] = {
        name: ("load_ratio", [each], {"units": unit}) for name, (each, unit) in numbers.items()
    }
    told = runs_table(xr.Dataset({"status": ("load_ratio", ["ok"]), **held}, {"load_ratio": [1.0]}))
    assert told.split()[-3:] == ["ok", "1e-11", "0.02"] and "wear" in told and "slip" in told


def test_a_shakedown_state_is_told_by_its_word() -> None:
    known = {"flag_values": [0, 3], "flag_meanings": "elastic plastic_shakedown"}
    status = ("a", np.array(["ok", "ok", "limit_load"], dtype=object))
    state = ("a", [3.0, 0.0, np.nan], known)
    *_, first, second, third = runs_table(
        xr.Dataset({"status": status, "shakedown_state": state}, {"a": [1, 2, 3]})
    ).splitlines()
    assert first.split() == ["1", "ok", "plastic", "shakedown"]
    assert second.split() == ["2", "ok", "elastic"]
    assert third.split() == ["3", "limit_load", "-"]
