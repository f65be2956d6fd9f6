"""The oracles of heat, fits, rigid bodies and static scenes notice what is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.stability.kinds import fits, heat, rigid, static
from tests.stability.tamper import with_state
from tests.stability.trial import Figures


def wrong(figures: Figures) -> set[str]:
    return {name for name, figure in figures.items() if not figure.right}


def drawn(kind: Any, number: int) -> Any:
    rng = np.random.default_rng(kind.SEED)
    return [kind.draw(k, rng) for k in range(number + 1)][number]


def pressed_more(solution: Any, stage: str, factor: float) -> Any:
    """Multiply the contact forces of a stage."""
    at = solution.stages[stage]
    contacts = tuple(
        replace(c, normal=factor * c.normal, tangential=factor * c.tangential)
        for c in at.state.contacts
    )
    return with_state(solution, stage, replace(at, state=replace(at.state, contacts=contacts)))


def test_a_bar_with_another_stress_is_noticed() -> None:
    bar = drawn(heat, 0)
    found = bar.solve()
    assert not wrong(heat.judge(bar, found))
    at = found.stages["0"]
    (response,) = at.responses
    changed = replace(at, responses=(response._replace(stress=response.stress + 0.01),))
    assert wrong(heat.judge(bar, with_state(found, "0", changed))) == {"stress 0"}


@pytest.mark.parametrize("changes", [{"rule": "isotropic"}, {"drops": (0.0, 0.0)}])
def test_a_bar_of_another_law_has_another_answer(changes: dict[str, Any]) -> None:
    bar = heat.Bar(
        rule="kinematic", ratio=0.1, poisson_ratio=0.3, element="quad4", size=1.0,
        strains=(0.01, -0.01), rises=(0.0, 400.0), steps=5, first=0.0, drops=(5e-4, 1e-3),
    )  # fmt: skip
    assert "stress 1" in wrong(heat.judge(replace(bar, **changes), bar.solve()))


@pytest.mark.parametrize(("number", "noticed"), [(0, "force"), (1, "push")])
def test_a_fit_with_more_force_is_noticed(number: int, noticed: str) -> None:
    fit = drawn(fits, number)
    found = fit.solve()
    assert not wrong(fits.judge(fit, found))
    stage = list(found.stages)[-1]
    assert noticed in wrong(fits.judge(fit, pressed_more(found, stage, 1.01)))


@pytest.mark.parametrize("number", [0, 1])
def test_a_rigid_body_with_more_contact_force_is_noticed(number: int) -> None:
    pressed = drawn(rigid, number)
    pushed, moved = pressed.solve()
    assert not wrong(rigid.judge(pressed, (pushed, moved)))
    more = pressed_more(pushed, "loaded", 1.1)
    assert "contact" in wrong(rigid.judge(pressed, (more, moved)))
    other = replace(pressed, off=pressed.off + 0.01, force=1.01 * pressed.force)
    noticed = {"moment", "turning"} if pressed.kind == "plate" else set()
    assert {"force"} | noticed <= wrong(rigid.judge(other, (pushed, moved)))


@pytest.mark.parametrize("number", [0, 3])
def test_a_scene_that_depends_on_its_units_is_noticed(number: int) -> None:
    scene = drawn(static, number)
    one, other = scene.runs()
    assert not wrong(static.judge(scene, (one, other)))
    dims, pressure = other.fields["contact_pressure"]
    changed = replace(other, fields=other.fields | {"contact_pressure": (dims, 1.001 * pressure)})
    assert wrong(static.judge(scene, (one, changed))) == {"pressure in other units"}
    wide = other.scalars | {"contact_half_width": 1.001 * other.scalars["contact_half_width"]}
    changed = replace(other, scalars=wide)
    assert wrong(static.judge(scene, (one, changed))) == {"width in other units"}
