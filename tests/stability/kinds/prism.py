"""Seeded passes in three dimensions: wheels on rails, balls and rollers on raceways, coarse."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from solver import NotConverged, Status
from solver.rolling.scenes.raceway import RACEWAY, RacewayParameters
from solver.rolling.scenes.wheel_rail import WHEEL_RAIL, WheelRailParameters
from tests.stability.kinds.draws import POISSON, RATIOS
from tests.stability.kinds.looked_at import looked_at
from tests.stability.kinds.prism_oracle import Rolled, judge
from tests.stability.trial import Scene, tells

Given = dict[str, Any]
Parameters = WheelRailParameters | RacewayParameters

COUNT = 5
SEED = 1985
RULES = ("none", "isotropic", "kinematic", "mixed", "voce", "table", "chaboche", "layered")
GROWING = ("none", "isotropic", "voce", "table")
"""Rules that go with any yield condition."""
FRICTION = (0.0, 0.05, 0.17, 0.3, 0.6, 1.0)
TRACTIONS = (-0.99, -0.75, -0.3, 0.0, 0.0, 0.0, 0.3, 0.75, 0.95, 0.99, 1.0)
PASSES = (1, 1, 1, 1, 1, 2, 2, 2, 3, 5, 10, 20)
RAIL_LOADS = ((1e3, 3e4), (3e4, 1.1e5), (1.1e5, 2e5), (2e5, 1e6))
RATIO_LOADS = ((0.2, 1.0), (1.0, 2.0), (2.0, 3.5), (3.5, 6.0))
PLACES = ((-12.0, -2.0), (-2.0, 6.0), (-30.0, -12.0), (6.0, 30.0))
"""Lateral positions: on the head, towards the flange, to the outside, and beyond the flange."""
USUAL = 0.25
"""Share of scenes of everyday traffic."""
QUICK = (0, 5)
"""Scenes of the test suite that are such, to be quick."""
UNUSUAL = (
    "youngs_modulus", "yaw", "spin", "lateral_creepage", "lateral_control", "given_lateral_force",
    "wheel_stiffness", "wheel_poisson_ratio", "initial_stress", "straightening_stress",
    "stress_over_height", "temperature_change", "rail_profile", "wheel_profile", "wheel_slope",
    "crown_radius", "wheel_radius", "lateral_spread", "load_spread", "seed", "sequence", "control",
    "given_creepage",
)  # fmt: skip
OTHERS = 6
"""One scene in so many is computed again as another that must come to the same."""
LENGTHS, STRESSES = 10.0, 7.0

given_up = tells(
    "no steady pass|the prescribed shear|window is too small|contact forces|reaches the outermost"
    "|grows without bound"
    "|^audit: audit_(contact_resolution|residual|yield) "
)
_GEOMETRY = tells(
    "^(sequence.*)?(lateral_position|lateral_spread|wheel_profile|rail_profile|crown_radius"
    "|groove_radius|load_ratio|force|straightening_stress|stress_over_height|temperature_change"
    "|traction_spread) = "
)


def given_of(number: int, rng: np.random.Generator) -> Given:
    """Return the parameters of a scene; rules take turns, three of five scenes are rails."""
    rail = number % 5 in (0, 2, 3)
    given = _material(number, rng, (502.0, 502.0, 300.0, 900.0) if rail else (1500.0, 502.0))
    given |= {
        "accuracy": "draft",
        "friction": float(rng.choice(FRICTION)),
        "passes": int(rng.choice(PASSES)),
    }
    given |= _rail(rng, given) if rail else _raceway(rng)
    given |= _motion(rng, given, rail=rail)
    share, traction = rng.uniform(0.02, 1), rng.uniform(-0.95, 0.95)
    usual = rng.random() < USUAL or number in QUICK
    return _usual(given, float(share), float(traction)) if usual else given


def _usual(given: Given, share: float, traction: float) -> Given:
    """Return everyday traffic, which certainly has an answer; its material is kept."""
    own = {name: value for name, value in given.items() if name not in UNUSUAL}
    own |= {"friction": min(given["friction"], 0.17)}
    own |= {"poisson_ratio": min(given["poisson_ratio"], 0.45)}
    if own["friction"]:
        own["traction"] = traction
    if "cant" in own:
        place = -3 - 8 * abs(given["lateral_position"]) / 30
        if given["yield_stress"] < 500:
            own = _restrengthened(own, 502.0 / given["yield_stress"])
        return own | {"load": 1.1e5 * share, "lateral_position": place, "cant": 0.025,
                      "foundation": min(given["foundation"], 900.0)}  # fmt: skip
    own.pop("load_by", None)
    own.pop("force", None)
    if "groove_radius" in own:
        own["groove_radius"] = 1.3 * own["radius"]
    return own | {"load_ratio": 2 * share}


def _restrengthened(given: Given, factor: float) -> Given:
    """Return the same with all strengths times a factor."""
    own = given | {"yield_stress": given["yield_stress"] * factor}
    if "curve" in own:
        own["curve"] = tuple((e, s * factor) for e, s in own["curve"])
    return own


def _material(number: int, rng: np.random.Generator, strengths: tuple[float, ...]) -> Given:
    rule, strength = RULES[number % len(RULES)], float(rng.choice(strengths))
    given: Given = {
        "hardening": rule,
        "yield_stress": strength,
        "poisson_ratio": float(rng.choice(POISSON)),
    }
    if rng.random() < 0.15:
        given["youngs_modulus"] = float(rng.choice([7e4, 4e5]))
    ratio, part, growth, rate = rng.choice(RATIOS), rng.random(), rng.random(), rng.uniform(0.5, 3)
    strain = np.append(0.0, np.cumsum(10 ** rng.uniform(-4, -1.5, 3)))
    stress = strength * (1 + np.append(0.0, np.cumsum(rng.uniform(0.02, 0.2, 3))))
    # layers need a curve that grows flatter
    stress[1:] = strength + np.cumsum(np.diff(strain) * 1e4 * 0.4 ** np.arange(3))
    if rule in ("isotropic", "kinematic", "mixed"):
        given["hardening_ratio"] = float(ratio)
    if rule == "mixed":
        given["isotropic_fraction"] = float(part)
    if rule == "voce" or (rule == "chaboche" and part < 0.5):
        given |= {"saturation": float(strength * growth), "saturation_rate": float(10**rate)}
    if rule in ("table", "layered"):
        given["curve"] = tuple(zip(strain.tolist(), stress.tolist(), strict=True))
    if rule == "chaboche":
        given["back_stresses"] = ((float(10 ** (3 + growth)), float(10**rate)), (500.0, 0.0))
    if rule in GROWING and rng.random() < 0.25:
        given["yield_condition"] = "tresca"
    return given


def _rail(rng: np.random.Generator, given: Given) -> Given:
    low, high = RAIL_LOADS[rng.choice(4, p=[0.2, 0.4, 0.3, 0.1])]
    right, left = PLACES[rng.choice(4, p=[0.7, 0.14, 0.08, 0.08])]
    own: Given = {
        "load": float(np.exp(rng.uniform(np.log(low), np.log(high)))),
        "lateral_position": float(rng.uniform(right, left)),
        "cant": float(rng.choice([0.025, 0.025, 0.05, 0.0, -0.05, 0.1])),
        "foundation": float(rng.choice([21.0, 21.0, 10 ** rng.uniform(-1, 4)])),
    }
    if rng.random() < 0.25:
        own["wheel_radius"] = float(np.exp(rng.uniform(np.log(100), np.log(2000))))
    own |= _profiles(rng)
    if rng.random() < 0.2:
        own |= {"initial_stress": "roller_straightened",
                "straightening_stress": float(rng.uniform(-250, 250))}  # fmt: skip
    elif rng.random() < 0.1:
        stress = rng.uniform(-150, 150, 3)
        own |= {"initial_stress": "over_height",
                "stress_over_height": tuple(zip((-172.0, -80.0, 0.0), stress.tolist(),
                                                strict=True))}  # fmt: skip
    if rng.random() < 0.2:
        own["temperature_change"] = float(rng.uniform(-60, 60))
    kind = rng.random()
    if kind < 0.15:
        own["sequence"] = tuple(
            {"load": own["load"] * float(rng.uniform(0.3, 1)), "times": int(rng.choice([1, 2])),
             "lateral_position": own["lateral_position"] + float(rng.uniform(-1, 1))}
            for _ in range(2)
        )  # fmt: skip
    if 0.1 < kind < 0.25 and given["passes"] > 1:
        own |= {"load_spread": float(rng.uniform(0, 0.3)), "seed": int(rng.integers(1000)),
                "lateral_spread": float(rng.choice([0.0, 0.3, 1.0]))}  # fmt: skip
    return own


def _profiles(rng: np.random.Generator) -> Given:
    own: Given = {}
    kind, slope, crown = rng.random(), rng.uniform(-0.1, 0.15), rng.uniform(2, 3.7)
    z = np.linspace(-70, 70, 57)
    if kind < 0.2:
        own |= {"wheel_profile": "conical", "wheel_slope": float(slope)}
    elif kind < 0.35:
        own |= {"wheel_profile": "crowned", "crown_radius": float(10**crown)}
    elif kind < 0.45:
        y = slope / 2 * z + z**2 / (2 * 10**crown)
        own["wheel_profile"] = tuple(zip(z.tolist(), y.tolist(), strict=True))
    if rng.random() < 0.1:  # a head that is round, its sides steep
        z = np.linspace(-34, 34, 69)
        y = -(z**2) / (2 * rng.uniform(150, 400)) - np.clip(abs(z) - 22, 0, None) ** 2 / 40
        own["rail_profile"] = tuple(zip(z.tolist(), y.tolist(), strict=True))
    return own


def _raceway(rng: np.random.Generator) -> Given:
    low, high = RATIO_LOADS[rng.choice(4, p=[0.2, 0.3, 0.35, 0.15])]
    radius, across = float(np.exp(rng.uniform(0, np.log(100)))), float(rng.uniform(-1.1, 1.1))
    own: Given = {"load": str(rng.choice(["contact", "hertz"])), "radius": radius}
    ratio = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    # of a ball of steel: p0^3 = 6 F E*^2 / (pi^3 R^2)
    force = (ratio * 1500.0) ** 3 * math.pi**3 * radius**2 / (6 * 1.1e5**2)
    own |= {"load_ratio": ratio} if rng.random() < 0.7 else {"load_by": "force", "force": force}
    shape = rng.random()
    if shape < 0.5:
        own["crown_radius"] = radius * math.exp(across)
    if shape > 0.7 or shape < 0.15:
        more = float(rng.choice([1.04, 1.3, 3.0]))
        own["groove_radius"] = own.get("crown_radius", radius) * more
    return own


def _motion(rng: np.random.Generator, given: Given, *, rail: bool) -> Given:
    """Return traction, creepages, spin and stiffness."""
    own: Given = {}
    friction, prescribed = given["friction"], given["load"] == "hertz"
    traction, kind, size = rng.choice(TRACTIONS), rng.random(), rng.uniform(-4, -1.2)
    sign = float(rng.choice([-1.0, 1.0]))
    if friction and (prescribed or kind > 0.15):
        own["traction"] = float(traction)
    elif friction:
        own |= {"control": "creepage", "given_creepage": sign * float(10**size)}
    sizes, drawn = 10 ** rng.uniform(-4, -1.3, 3), rng.random(4)
    if rail and drawn[0] < 0.15:
        own["yaw"] = sign * float(sizes[0])
    if rail and drawn[1] < 0.1:
        own["spin"] = sign * float(sizes[1])
    if rail and friction and drawn[2] < 0.15:
        share = float(rng.uniform(-0.8, 0.8))
        own |= {"lateral_control": "force", "given_lateral_force": share * friction * given["load"]}
    elif not prescribed and drawn[2] > 0.85:
        own["lateral_creepage"] = -sign * float(sizes[2])
    if drawn[3] < 0.2:
        own["wheel_stiffness"] = float(10 ** rng.uniform(-1, 3))
        own["wheel_poisson_ratio"] = float(rng.choice(POISSON))
    return own


# -- scenes that must come to the same -------------------------------------------------------------


def _scaled(given: Given) -> Given:
    """Return the same raceway in other units of length and stress."""
    lengths = {n: given[n] * LENGTHS for n in ("radius", "crown_radius", "groove_radius")
               if n in given}  # fmt: skip
    usual = RacewayParameters()
    stresses = {n: given.get(n, getattr(usual, n)) * STRESSES
                for n in ("yield_stress", "youngs_modulus", "saturation")
                if getattr(usual, n) is not None}  # fmt: skip
    own = given | lengths | stresses
    if "force" in given:
        own["force"] = given["force"] * STRESSES * LENGTHS**2
    if "curve" in given:
        own["curve"] = tuple((e, s * STRESSES) for e, s in given["curve"])
    if "back_stresses" in given:
        own["back_stresses"] = tuple((c * STRESSES, g) for c, g in given["back_stresses"])
    return own


def _mirrored(given: Given) -> Given:
    """Return the mirror image of a raceway in z."""
    return given | {"lateral_creepage": -given["lateral_creepage"]}


def _untouched(given: Given) -> Given:
    """Return the same prescribed ellipse, without friction instead of without traction."""
    return given | {"friction": 0.0 if given["friction"] else 0.3, "traction": 0.0}


def _in_turns(given: Given) -> Given:
    """Return the same passes as a sequence of equal ones."""
    return given | {"sequence": ({"load": given["load"]}, {"times": 2})}


OTHER: dict[str, Callable[[Given], Given]] = {
    "scaled": _scaled, "mirrored": _mirrored, "untouched": _untouched, "in turns": _in_turns,
}  # fmt: skip


def other_of(number: int, given: Given) -> str | None:
    """Return which other scene a scene is compared with."""
    if "cant" in given:
        plain = not given.get("sequence") and "load_spread" not in given
        return "in turns" if plain and number % OTHERS == 0 else None
    if "lateral_creepage" in given:
        return "mirrored"
    if given["load"] == "hertz" and not given.get("traction"):
        return "untouched"
    return "scaled" if number % (OTHERS // 2) == 0 else None


# -- the runs --------------------------------------------------------------------------------------


def run(given: Given, other: str | None) -> Rolled:
    """Compute a scene, and the one with which it is compared."""
    rolled = _run(given)
    if other is None:
        return rolled
    beside = _run(OTHER[other](given))
    scale = STRESSES if other == "scaled" else 1.0
    return replace(rolled, other=beside.record, mirrored=other == "mirrored", stresses=scale)


def parameters_of(given: Given) -> Parameters:
    """Return the parameters of the scene that has such ones."""
    return WheelRailParameters(**given) if "cant" in given else RacewayParameters(**given)


def _run(given: Given) -> Rolled:
    p = parameters_of(given)
    finished, record = looked_at(WHEEL_RAIL if "cant" in given else RACEWAY, p)
    if finished.outcome.error is not None:
        raise finished.outcome.error
    if record.status is Status.AUDIT_FAILED:
        raise NotConverged(f"audit: {record.message}")
    return Rolled(parameters=p, record=record, run=finished)


def certain(given: Given) -> bool:
    """Whether there is certainly an answer, which the coarsest mesh finds.

    Loads of everyday traffic on the head, of usual steel, with the usual profile; or ellipses below
    what a surface without hardening bears, with a friction that leaves it at rest.
    """
    forced = given.get("traction", 1.0) if given["friction"] else 0.0
    usual = not given.keys() & set(UNUSUAL)
    usual &= given["friction"] * abs(forced) <= 0.2 and abs(forced) <= 0.95
    usual &= given["poisson_ratio"] <= 0.45 and given.get("control") != "creepage"
    if "cant" in given:
        place, load, most = given["lateral_position"], given["load"], given["yield_stress"]
        on_head = -11 <= place <= -3 and 0 <= given["cant"] <= 0.05
        return usual and on_head and load <= 1.1e5 and most >= 500 and given["foundation"] < 1e3
    # p0 of the limit load of a ball is above 4 times the yield stress
    return usual and given.get("load_ratio", 9.0) <= 2.0


def changed(given: Given) -> str:
    """Return the parameters that differ from the defaults of their scene."""
    kind = WheelRailParameters if "cant" in given else RacewayParameters
    usual = {f.name: f.default for f in fields(kind)}
    told = []
    for name, value in given.items():
        if value != usual[name]:
            long = isinstance(value, tuple) and len(value) > 5
            told.append(f"{name}={f'{len(value)} points' if long else repr(value)}")
    return ("rail: " if "cant" in given else "raceway: ") + ", ".join(told)


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the passes."""
    rng = np.random.default_rng(SEED)
    made = [given_of(number, rng) for number in range(count)]
    return [
        Scene(
            what=changed(given),
            run=partial(run, given, other_of(number, given)),
            judge=judge,
            refusal=None if certain(given) else _GEOMETRY,
            safe=math.inf if certain(given) else 0.0,
            honest=None if certain(given) else given_up,
            in_loads=False,
        )
        for number, given in enumerate(made)
    ]
