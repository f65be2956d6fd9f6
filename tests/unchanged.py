"""``python -m tests.unchanged``: see that a change of the code moves no number.

``record FILE`` computes some eighty runs, of every scene, law, element, kind of load and kind of
track, and of scene files, and keeps all that their records hold. ``compare FILE`` computes them
again and prints the largest changes of each run, over the largest value of the same variable. It
fails where a change is above the limit.
"""

from __future__ import annotations

import argparse
import os
import pickle
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
LIMIT = 1e-9
"""Change over the largest value, where sums may be ordered anew."""

COSTS = ("cpu_seconds", "wall_seconds", "seconds")
"""Variables that differ from run to run."""

ROUNDING = {"mm": 1e-9, "MPa": 1e-8, "N": 1e-6, "1": 1e-9}
"""Changes that rounding causes, by unit, where lengths of 1 m, stress of 1000 MPa and forces of
100 kN cancel; of ratios only those of the audit. Smaller changes do not count."""

Numbers = dict[str, Any]

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
    add("rolling", "finite, periodic", accuracy="draft", track=60.0, periodic=True, load="hertz")
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


def computed(name: str) -> Numbers:
    """Return all numbers of a run: coordinates, fields, scalars, and its status."""
    from studies.scenes.registry import scene_named
    from studies.scenes.scene import read_scene

    given, parameters = runs()[name]
    scene = read_scene(ROOT / given) if given.endswith(".toml") else scene_named(given)
    asked = scene.parameters(**parameters)
    value = getattr(asked, scene.branch) if scene.branch else None
    (record,) = scene.path(asked, [value], lambda share: None)
    values = {**record.coordinates, **record.scalars}
    values |= {key: field for key, (_, field) in record.fields.items()}
    kept = {key: np.asarray(value) for key, value in values.items() if key not in COSTS}
    return {"status": np.array(record.status.name), **kept}


def changes(before: Numbers, after: Numbers) -> Iterator[tuple[str, float]]:
    """Yield each variable that differs, and its change over its largest value."""
    for key in sorted(before.keys() | after.keys()):
        old, new = before.get(key), after.get(key)
        if old is None or new is None or old.shape != new.shape:
            yield f"{key} is {'new' if old is None else 'gone or reshaped'}", np.inf
        elif old.dtype.kind in "fc":
            if not np.array_equal(np.isnan(old), np.isnan(new)):
                yield f"{key} has NaN elsewhere", np.inf
                continue
            largest = np.nanmax(np.abs(old), initial=0.0)
            change = np.nanmax(np.abs(new - old), initial=0.0) if largest < np.inf else 0.0
            if change > _rounding(key):
                yield key, float(change / largest) if largest else np.inf
        elif not np.array_equal(old, new):
            yield key, np.inf


def _rounding(name: str) -> float:
    """Return the change of a variable that rounding causes, in its unit."""
    import solver.scenes  # noqa: F401  (declares all quantities)
    from solver.results.quantities import QUANTITIES

    units = QUANTITIES[name].units if name in QUANTITIES else ""
    return 0.0 if units == "1" and not name.startswith("audit_") else ROUNDING.get(units, 0.0)


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.unchanged", description=__doc__)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--limit", type=float, default=LIMIT, help="largest change allowed")
    parser.add_argument("--only", default="", help="runs whose names hold this text")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    given = parser.parse_args()
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    names = [name for name in runs() if given.only in name]
    if not names:
        parser.error(f"no run has {given.only!r} in its name")
    with ProcessPoolExecutor(given.jobs) as pool:
        if given.what == "record":
            found = dict(zip(names, pool.map(computed, names), strict=True))
            given.file.write_bytes(pickle.dumps(found))
            print(f"{len(found)} runs recorded")
            return 0
        recorded = pickle.loads(given.file.read_bytes())
        moved = 0
        for name, after in zip(names, pool.map(computed, names), strict=True):
            told = sorted(changes(recorded[name], after), key=lambda each: -each[1])
            worst = told[0][1] if told else 0.0
            moved += worst > given.limit
            own = ", ".join(f"{key} {change:.1e}" for key, change in told[:4])
            print(f"{'MOVED' if worst > given.limit else 'same':<6} {name}: {own}", flush=True)
    print(f"{len(names)} runs, {moved} with numbers that moved by more than {given.limit:g}")
    return 1 if moved else 0


if __name__ == "__main__":
    sys.exit(main())
