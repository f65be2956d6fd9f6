"""``python -m tests.stability.slopes [COUNT]``: derivatives of seeded runs against differences.

Each run has the derivatives of all its numbers by three of its parameters. They are compared with
central differences of runs, which are solved to tighter tolerances. A derivative that differs must
be of a parameter whose range is smaller than the difference, as the run itself says.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

from solver.derivatives.asked import Derivatives, named, reach
from solver.errors import ModelError
from solver.loading.program import Control, Tolerances
from solver.scenes import Scene
from solver.shipped import SCENES
from studies.scenes.registry import scene_named
from studies.scenes.scene import read_scene
from tests.architecture.sources import ROOT

SEED = 1994
SHARE = 1e-5
"""Difference of a parameter over its value."""
TOLERANCE, MOVED = 1e-5, 1e-4
"""Error of a relative change over that of the parameter; by a size, which moves the nodes, and of a
ball or a cone. The contact of these grows vertex by vertex: derivatives change so fast that a
difference of 1e-6 has an error of 2e-5 (measured; ten times as large with ten times the step)."""
GROWING = ("ball", "cone")
SIZES = ("radius", "width", "height", "length", "diameter", "depth", "pressed_in", "ream", "hole")
CURVED, CURVED_BY_SIZE = 0.1, 0.5
"""Share of the difference between both sides by which a derivative may differ besides. Where a
number is curved, a neighbour with a step of a tenth of theirs is off by half of a tenth of it; by a
size, which moves the nodes, its step is theirs, and it is off by half of it."""
TIGHT = partial(Control, tolerances=Tolerances(residual=1e-11, contact=1e-10))
MESH = ("accuracy", "size", "element", "growth", "step", "hosford", "exponent")
"""Words in the names of parameters that are not derived by: they shape meshes, or are exponents."""
OWN = ("threshold", "swift", "saturating", "hosford") if os.environ.get("RESIDUA_PARTS") else ()
"""Words of the parts of `examples`."""
FILES = {
    "bending": {}, "bolt": {}, "bree": {"times": 4}, "crack": {}, "expansion": {}, "fretting": {},
    "peened": {}, "pin": {}, "roller": {},
}  # fmt: skip


class Drawn(NamedTuple):
    """A run that was drawn: its name, scene, parameters, and by which of them (all if empty)."""

    name: str
    scene: Scene
    parameters: Any
    by: Sequence[str] = ()


def punch(rng: np.random.Generator) -> Drawn:
    """Return a punch of any law, friction law, element and strain."""
    hardening = str(
        rng.choice(["none", "isotropic", "kinematic", "voce", "chaboche", "mixed", *OWN[:2]])
    )
    given: dict[str, Any] = {
        "hardening": hardening, "friction": float(rng.uniform(0.05, 0.5)),
        "load_ratio": float(rng.uniform(0.3, 0.7)),
        "state": str(rng.choice(["plane_stress", "plane_strain", "axisymmetric"])),
        "element": str(rng.choice(["quad8", "quad4", "tri6"])),
        "saturation": 150.0, "saturation_rate": 12.0, "elastic_punch": bool(rng.integers(2)),
    }  # fmt: skip
    if hardening == "chaboche":
        given["back_stresses"] = ((4e4, 300.0), (5e3, 0.0))
    if OWN and rng.integers(3) == 0:
        given |= {"friction_law": "saturating", "tau_max": 60.0}
    elif rng.integers(3) == 0:
        given["shear_limit"] = float(rng.uniform(0.2, 0.8))
    if hardening in ("none", "isotropic") and given["state"] != "plane_stress":
        given["yield_condition"] = str(rng.choice(["mises", "tresca", *OWN[3:]]))
    elif rng.integers(3) == 0 and given["state"] != "plane_stress":
        given |= {"strain": "large", "element": "quad4"}
    made = SCENES["punch"].parameters(accuracy="draft", smallest_element=0.05, growth=2.0, **given)
    by = ["friction", "yield_stress", "load_ratio", "youngs_modulus", "half_width", "punch_height"]
    by += [name for name in ("shear_limit", "tau_max") if name in given]
    by += ["hardening_ratio"] * (hardening in ("isotropic", "kinematic", "mixed"))
    words = "-".join(str(each) for each in given.values() if isinstance(each, str))
    return Drawn(f"punch {words}", SCENES["punch"], made, by)


def shipped(name: str, rng: np.random.Generator, **given: Any) -> Drawn:
    """Return a run of a scene file whose real parameters are up to a tenth off their defaults."""
    path = ROOT / f"data/scenes/{name}.toml"
    scene = read_scene(path) if path.exists() else scene_named(name)
    usual = scene.parameters(**given)
    for name_of, value in _numbers(usual).items():
        if name_of not in given and not any(word in name_of for word in MESH):
            try:
                usual = replace(usual, **{name_of: value * (1 + float(rng.uniform(-0.1, 0.1)))})
            except ModelError:
                continue
    return Drawn(name, scene, usual)


def drawn(count: int) -> Iterator[Drawn]:
    """Yield so many runs."""
    rng = np.random.default_rng(SEED)
    for k in range(count):
        others = [
            *(partial(shipped, name, **given) for name, given in FILES.items()),
            partial(shipped, "ball", accuracy="draft", load_ratio=3.0, friction=0.1),
            partial(shipped, "cone", accuracy="draft", friction=0.1),
            partial(shipped, "shaft_hub", smallest_element=0.02, growth=2.0, friction=0.2),
            partial(shipped, "elastic_punch", smallest_element=0.02, growth=2.0, friction=0.2),
        ]
        yield punch(rng) if k % 2 else others[k // 2 % len(others)](rng)


def compared(one: Drawn, rng: np.random.Generator) -> Iterator[tuple[str, str, str]]:
    """Yield what is found by each of three parameters: parameter, verdict, and where it differs."""
    scene, parameters = one.scene, one.parameters
    base = _run(scene, parameters)
    if not base.status.solved:
        yield "", base.status.name.lower(), base.message
        return
    results = [name for name, value in base.scalars.items() if isinstance(value, float)]
    results = [name for name in results if name[-2:] not in ("_x", "_y")]  # places jump
    by = [name for name in one.by or _numbers(parameters) if not any(map(name.__contains__, MESH))]
    chosen = rng.permutation(by)[:3].tolist()
    of = tuple(name for name in results if chosen and _derived(scene, chosen[0], name))
    while chosen:
        try:
            own = _run(replace(scene, derivatives=Derivatives(by=tuple(chosen), of=of)), parameters)
            break
        except ModelError as error:
            if error.field not in chosen:
                raise
            chosen.remove(error.field)
            yield error.field, "refused", str(error)
    for name in chosen:
        value = getattr(parameters, name)
        ends = [
            _run(scene, replace(parameters, **{name: value * (1 + side * SHARE)}))
            for side in (1, -1)
        ]
        counts = [each.scalars["increments"] for each in (own, *ends)]
        if len({*counts}) > 1:
            yield name, "other increments", str(counts)
        else:
            sized = any(word in name for word in SIZES)
            tolerance = MOVED if sized or one.name in GROWING else TOLERANCE
            curved = CURVED_BY_SIZE if sized else CURVED
            yield name, *_judged(name, own, ends, of, tolerance, curved)


def _judged(
    name: str, own: Any, ends: Sequence[Any], of: Sequence[str], tolerance: float, curved: float
) -> tuple[str, str]:
    """Return the verdict on the derivatives by a parameter, and the worst of them."""
    value, worst, lacks = getattr(own.parameters, name), ("", 0.0), 0
    for each in of:
        found = own.scalars[named(each, name)] * value
        if np.isnan(found):
            lacks += 1
            continue
        more, less = (end.scalars[each] for end in ends)
        expected = (more - less) / (2 * SHARE)
        bent = curved * abs(more + less - 2 * own.scalars[each]) / SHARE
        off = max(abs(found - expected) - bent, 0.0)
        error = off / max(abs(own.scalars[each]), abs(expected), 1e-9)
        if not error <= worst[1]:  # also one that is not a number
            worst = each, error
    share = own.scalars[reach(name)]
    text = f"{worst[0]} {worst[1]:.1e}, range {share:.1e}, {len(of) - lacks} of {len(of)}"
    if lacks == len(of):
        return "nothing compared", text
    if worst[1] <= tolerance:
        return "right", text
    return ("at a switch" if share < 2 * SHARE else "wrong"), text


def _derived(scene: Scene, by: str, of: str) -> bool:
    try:
        Derivatives(by=(by,), of=(of,)).quantities(scene.parameters, scene.known_quantities)
    except ModelError:
        return False
    return of not in ("cpu_seconds",)


def _numbers(parameters: Any) -> dict[str, float]:
    """Return the real parameters that are not zero."""
    each = {field.name: getattr(parameters, field.name) for field in fields(parameters)}
    return {name: value for name, value in each.items() if isinstance(value, float) and value}


def _run(scene: Scene, parameters: Any) -> Any:
    values = [getattr(parameters, scene.branch)] if scene.branch else [0.0]
    with mock.patch("solver.scenes.driver.Control", TIGHT):
        (record,) = scene.path(parameters, values, lambda share: None)
    return record


def main(arguments: Sequence[str]) -> int:
    """Print a line for each run and parameter, then a table.

    Return 1 if one is wrong, or if too many have no derivative.
    """
    verdicts: Counter[str] = Counter()
    rng = np.random.default_rng(SEED + 1)
    for k, one in enumerate(drawn(int(arguments[0]) if arguments else 60)):
        for name, verdict, text in compared(one, rng):
            verdicts[verdict] += 1
            print(f"{k:3} {one.name:50} {name:22} {verdict:16} {text}", flush=True)
    print(*(f"{number:5} {verdict}" for verdict, number in verdicts.most_common()), sep="\n")
    return int(verdicts["wrong"] > 0 or 4 * verdicts["nothing compared"] > verdicts["right"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
