"""Some eighty runs of every scene, law, element, kind of load and track, and of scene files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_CURVE = ((0.0, 400.0), (0.01, 450.0), (0.1, 520.0))
_LAWS: Mapping[str, dict[str, Any]] = {
    "perfect": {},
    "tresca": {"yield_condition": "tresca"},
    "isotropic": {"hardening": "isotropic"},
    "kinematic": {"hardening": "kinematic"},
    "mixed": {"hardening": "mixed", "isotropic_fraction": 0.3},
    "voce": {"hardening": "voce", "saturation": 150.0, "saturation_rate": 20.0},
    "table": {"hardening": "table", "curve": _CURVE, "yield_stress": 400.0},
    "chaboche": {"hardening": "chaboche", "back_stresses": ((5e4, 400.0), (3e3, 0.0))},
    "layered": {"hardening": "layered", "curve": _CURVE, "yield_stress": 400.0},
}

_TRACK = {"accuracy": "draft", "track": 24.0, "half_space_size": 60.0, "load_ratio": 4.0}


def runs() -> dict[str, tuple[str, dict[str, Any]]]:
    """Return the runs by name: the scene, and its parameters."""
    draft = {"accuracy": "draft"}
    found: dict[str, tuple[str, dict[str, Any]]] = {}

    def add(scene: str, name: str, **parameters: Any) -> None:
        found[f"{scene} {name}"] = (scene, parameters)

    for law, given in _LAWS.items():
        add("punch", law, **draft, state="plane_strain", load_ratio=1.5, friction=0.2, **given)
        add("ball", law, **draft, **given)
        if law in ("perfect", "isotropic", "kinematic", "mixed"):
            add("rolling", law, **draft, load_ratio=4.0, friction=0.2, traction=0.5, **given)
            add("rolling", f"{law}, Hertz", **draft, load_ratio=4.0, load="hertz", **given)
        add("rolling", f"finite, {law}", **_TRACK, load="hertz", **given)
    for element in ("quad9", "quad4", "tri6", "tri3"):
        add("punch", element, **draft, element=element)
    for state in ("plane_stress", "axisymmetric"):
        add("punch", state, **draft, state=state, hardening="kinematic", friction=0.4)
    add("punch", "cohesion", **draft, friction=0.1, cohesion=20.0)
    add("punch", "shear limit", **draft, friction=0.5, shear_limit=0.3)
    add("punch", "elastic punch", **draft, elastic_punch=True, punch_stiffness=3.0)
    add("punch", "limit load", **draft, load_ratio=4.0)
    add("ball", "yielding ball", **draft, yielding="ball", hardening="isotropic")
    add("ball", "friction", **draft, friction=0.3)
    add("ball", "cycles", **draft, cycles=3, hardening="chaboche", back_stresses=((5e4, 400.0),))
    add("rolling", "finite, wheel", **_TRACK)
    add("rolling", "finite, quad4", **_TRACK, element="quad4")
    add("rolling", "finite, slip", **_TRACK, traction=1.0, hardening="kinematic")
    add("rolling", "finite, two passes", **_TRACK, load="hertz", passes=2)
    add("rolling", "creepage", **draft, control="creepage", given_creepage=2e-3)
    add("rolling", "Hertz", **draft, load="hertz", friction=0.3, traction=1.0, load_ratio=5.0)
    add("rolling", "five passes", **draft, passes=5, hardening="kinematic", load_ratio=5.0)
    add("rolling", "back and forth", **draft, passes=4, direction="back_and_forth", traction=0.6)
    add("rolling", "backward", **draft, heading="backward", traction=0.6)
    add("rolling", "stiff wheel", **draft, wheel_stiffness=5.0, wheel_poisson_ratio=0.2)
    add("rolling", "decided", **draft, until="decided", passes=30, hardening="kinematic")
    add("rolling", "elastic", **draft, load_ratio=1.0)
    add("rolling", "locked", **draft, traction=-0.9, friction=0.5)
    for friction in (0.0, 0.3):
        add("elastic_punch", f"friction {friction}", **draft, friction=friction)
        add("rigid_punch", f"friction {friction}", **draft, friction=friction)
        for loading in ("pressure", "interference"):
            add("shaft_hub", f"{loading}, {friction}", **draft, friction=friction, loading=loading)
    add("elastic_punch", "grooves", **draft, punch_groove=0.2, half_plane_groove=0.2, friction=0.2)
    add("shaft_hub", "grooves", **draft, hub_groove=0.1, shaft_groove=0.1, friction=0.2)
    for law in ("none", "isotropic", "kinematic"):
        own = {"hardening": law}
        add("data/scenes/fretting.toml", law, element=0.1, yield_stress=500.0, **own)
        add("data/scenes/pin.toml", law, load_ratio=1.0, friction=0.2, clearance=0.05, **own)
    add("tests/studies/scenes/punch.toml", "punch")
    for turn in (0.001, 0.01):
        add("tests/studies/scenes/everything.toml", f"turn {turn}", turn=turn)
    return found
