"""Mistakes of a study: its content, the field that is named, and words of what is allowed there."""

from __future__ import annotations

import math
from typing import Any

GOOD: dict[str, Any] = {
    "name": "bad",
    "scene": "punch",
    "parameters": {"half_width": 20},
    "sweep": {"friction": [0.0, 0.1], "load_ratio": [0.5, 0.3]},
}


def with_(**changes: Any) -> dict[str, Any]:
    return GOOD | changes


MISTAKES: list[tuple[Any, str, str]] = [
    (with_(scene="punc"), "scene", "did you mean punch?"),
    (with_(scene=None), "scene", "one of"),
    (with_(scene=["punch"]), "scene", "one of"),
    (with_(swep={}), "swep", "did you mean sweep?"),
    (with_(name=".hidden"), "name", "not beginning with a dot"),
    (with_(name="a/b"), "name", "1 to 80"),
    (with_(name="a" * 81), "name", "1 to 80"),
    (with_(name="a\n"), "name", "1 to 80"),
    (with_(name=3), "name", "1 to 80"),
    (with_(parameters={"frictoin": 0.1}), "parameters.frictoin", "did you mean friction?"),
    (with_(sweep={"frictoin": [0.1]}), "sweep.frictoin", "did you mean friction?"),
    (with_(parameters={"half_width": -1}), "parameters.half_width", "> 0 and <= 1e+06 [mm]"),
    (with_(parameters={"half_width": math.inf}), "parameters.half_width", "finite"),
    (with_(parameters={"half_width": 10**400}), "parameters.half_width", "finite"),
    (with_(parameters={"half_width": "20"}), "parameters.half_width", "a finite number"),
    (with_(parameters={"half_width": True}), "parameters.half_width", "a finite number"),
    (with_(parameters={"half_width": None}), "parameters.half_width", "a finite number"),
    (with_(parameters={"half_width": {}}), "parameters.half_width", "a finite number"),
    (with_(parameters={"unload_steps": 2.5}), "parameters.unload_steps", "an integer >= 1"),
    (with_(parameters={"hardening": "soft"}), "parameters.hardening", "none, isotropic"),
    (
        with_(parameters={"curve": [[0.0, 350.0], [0.002]]}),
        "parameters.curve",
        "a list of [a finite number, a finite number]",
    ),
    (with_(parameters={"friction": 0.1}), "parameters.friction", "swept too"),
    (with_(parameters=[1]), "parameters", "a table"),
    (with_(sweep={"friction": [0.1, -0.1]}), "sweep.friction[1]", ">= 0 and <= 10"),
    (with_(sweep={"friction": [0.1, math.nan]}), "sweep.friction[1]", "finite"),
    (with_(sweep={"friction": [0, 0.1, 0.0]}), "sweep.friction[2]", "already at position 0"),
    (with_(sweep={"friction": [0, -0.0]}), "sweep.friction[1]", "already at position 0"),
    (with_(sweep={"friction": []}), "sweep.friction", "one value or more"),
    (with_(sweep={"friction": 0.1}), "sweep.friction", "one value or more"),
    (with_(sweep={"friction": "0.1"}), "sweep.friction", "one value or more"),
    (with_(sweep="friction"), "sweep", "a table"),
    (["punch"], "study", "a table"),
    (with_(sweep=[1]), "sweep", "a table"),
    (with_(parameters=3), "parameters", "a table"),
    (with_(sweep={"friction": ["much"]}), "sweep.friction[0]", "a finite number"),
    (with_(sweep={"friction": [True]}), "sweep.friction[0]", "a finite number"),
    (with_(sweep={"friction": [None]}), "sweep.friction[0]", "a finite number"),
    (with_(sweep={"hardening": ["soft"]}), "sweep.hardening[0]", "none, isotropic"),
    (with_(sweep={"friction": {"A": {}}}), "sweep.friction", ""),
    (with_(sweep={"status": {"A": {}}}), "sweep.status", ""),
    (with_(sweep={"case": {"A": {"friction": -1}}}), "sweep.case.A.friction", ">= 0 and <= 10"),
    (with_(name="../../etc/passwd"), "name", "1 to 80"),
    (with_(name="\ud800"), "name", "1 to 80"),
    (with_(colour="red"), "colour", ""),
    (with_(sweep={"case": {"\ud800": {}}}), "sweep.case", ""),
    (with_(sweep={"\ud800": {"A": {}}}), "sweep.\\ud800", ""),
    (with_(sweep={"\ud800": [1]}), "sweep.\\ud800", ""),
    (with_(parameters={"\ud800": 1}), "parameters.\\ud800", ""),
    (with_(**{"\ud800": 1}), "\\ud800", ""),
]
