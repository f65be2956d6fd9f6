"""``python -m tests.compare.ids OLD NEW``: whether two checkouts give studies the same ids.

Both read the shipped studies, and some hundred that are generated with a seed: of all kinds, with
units, points, samples, and extended ones. Compared are the id of each study, the ids of its runs or
of the first runs that it asks for, their largest number, and the content that a store keeps; of a
study that is refused only this. The solver's sources must be equal: they count in all ids.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from itertools import islice, takewhile
from pathlib import Path
from typing import Any

COUNT, MOST = 800, 5000
"""Number of generated studies; largest number of runs of one whose ids are compared."""

NUMBERS: Mapping[str, tuple[str, float, float]] = {
    "load_ratio": ("", 0.2, 0.9),
    "friction": ("", 0.0, 0.6),
    "youngs_modulus": ("MPa", 1.5e5, 2.2e5),
    "yield_stress": ("MPa", 200.0, 600.0),
    "half_width": ("mm", 20.0, 80.0),
    "punch_height": ("", 1.0, 4.0),
    "load_step": ("", 0.05, 0.2),
}
"""Parameters of the punch that are drawn: their unit and range."""
OTHER = {"MPa": ("GPa", 1e-3), "mm": ("m", 1e-3)}


def value(draw: random.Random, name: str) -> Any:
    """Return a value of a parameter, sometimes as a text with a unit."""
    unit, low, high = NUMBERS[name]
    number = round(draw.uniform(low, high), draw.choice((1, 2, 3)))
    if not unit or draw.random() < 0.6:
        return number
    unit, factor = draw.choice(((unit, 1.0), OTHER[unit]))
    return f"{number * factor:.6g} {unit}"


def study(draw: random.Random, number: int, before: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the content of a study; it may extend one of those before."""
    names = draw.sample(list(NUMBERS), 6)
    content: dict[str, Any] = {"name": f"drawn-{number}", "scene": "punch"}
    content["parameters"] = {name: value(draw, name) for name in names[: draw.randint(0, 2)]}
    if draw.random() < 0.3:
        content["parameters"] |= {"hardening": "isotropic", "hardening_ratio": 0.05}
    content |= draw.choice(
        ({}, {"note": "a note"}, {"tags": ["a", "b"]}, {"keep": "fields"},
         {"allow": ["large_strain"]})
    )  # fmt: skip
    axes = names[2 : 2 + draw.randint(0, 2)]
    sweep: dict[str, Any] = {
        name: sorted({value(draw, name) for _ in range(draw.randint(1, 4))}, key=str)
        for name in axes
    }
    if draw.random() < 0.2:
        low, high = NUMBERS[names[4]][1:]
        sweep[names[4]] = {"start": low, "stop": high, "num": draw.randint(2, 5)}
    if draw.random() < 0.15:
        sweep["steel"] = {
            label: {name: value(draw, name) for name in names[5:]} for label in ("soft", "hard")
        }
    content["sweep"] = sweep
    form = draw.choice(
        ("grid", "points", "sample", "extends", "goal", "refine", "fit", "both", "minimise")
    )
    low, high = NUMBERS[names[3]][1:]
    if form == "points":
        content["points"] = [{name: value(draw, name) for name in names[3:5]} for _ in range(4)]
    elif form == "sample":
        method = draw.choice(("sobol", "lhs", "halton"))
        content["sample"] = {"ranges": {names[3]: [low, high]}, "num": 8, "method": method}
    elif form == "extends" and before:
        content["extends"] = draw.choice(before)
        content["sweep"] = {names[3]: [value(draw, names[3])]}
        del content["parameters"]
    if form == "goal" or (form == "fit" and draw.random() < 0.8):
        content["sweep"] = (
            {} if form == "fit" else {k: v for k, v in sweep.items() if k != names[3]}
        )
    if form in ("goal", "both"):
        content["goal"] = {"parameter": names[3], "between": [max(low, 0.01), high]} | draw.choice(
            ({}, {"find": "first_yield"}, {"of": "max_plastic_strain", "first_above": 1e-3},
             {"of": "peak_contact_pressure", "at": 400.0, "within": 0.05})
        )  # fmt: skip
    if form in ("refine", "both"):
        content["sweep"] |= {names[3]: [low, high]}
        content["refine"] = {"of": "peak_contact_pressure"} | draw.choice(
            ({}, {"until": 0.1, "most": 90}, {"halvings": 2}, {"of": ["max_plastic_strain"]})
        )
    if form == "minimise":
        content["sweep"].pop(names[3], None)
        content["minimise"] = {
            "of": "peak_contact_pressure",
            "ranges": {names[3]: draw.choice(([low, high], {"start": low, "stop": high}))},
        } | draw.choice(
            ({}, {"where": "max_plastic_strain < 0.02"}, {"starts": 2, "most": 90},
             {"where": ["peak_residual_tension <= 0.1 GPa"], "first": {names[3]: high}})
        )  # fmt: skip
    if form == "fit":
        content["fit"] = {
            "measured": [{"rows": [{"peak_contact_pressure": "500"}]}],
            "ranges": {
                names[3]: draw.choice(
                    ([low, high], {"start": max(low, 0.01), "stop": high, "spacing": "log"})
                )
            },
        } | draw.choice(({}, {"most": 50}, {"step": 0.02}))
    return content


def contents() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the studies that are generated, by name."""
    draw, before = random.Random(0), list[dict[str, Any]]()
    for number in range(COUNT):
        content = study(draw, number, before)
        yield content["name"], content
        if "extends" not in content:
            before = [*before[-19:], content]


def described(found: Any) -> list[Any]:
    """Return what must not change of a study."""
    from studies import Store
    from studies.execution.asking import Asking

    with tempfile.TemporaryDirectory() as folder:
        ids = list(islice(found.run_ids(), MOST))
        if not ids:
            asked = Asking(found, Store(Path(folder))).paths()
            paths = islice(takewhile(lambda each: each is not None, asked), MOST)
            ids = [
                ":".join([each.path.id, each.whole, *(case.id for case in each.path.cases)])
                for each in paths
                if each
            ]
    digest = hashlib.sha256(json.dumps(ids).encode()).hexdigest()
    content = json.dumps(found.to_dict(), sort_keys=True)
    return [found.id, found.size, found.stage(), len(ids), digest, content]


def of_this_checkout() -> dict[str, Any]:
    """Return what must not change of every study, or that it is refused."""
    from studies import Study
    from studies.definition.identity import solver_hash
    from studies.errors import StudyError

    found: dict[str, Any] = {"": solver_hash()}
    shipped = [(path.stem, path) for path in sorted(Path("data/studies").glob("*.toml"))]
    every: list[tuple[str, Path | dict[str, Any]]] = [*shipped, *contents()]
    for name, given in every:
        try:
            own = Study.from_toml(given) if isinstance(given, Path) else Study.from_dict(given)
            found[name] = described(own)
        except StudyError:
            found[name] = "refused"
    return found


def of_checkout(folder: str) -> dict[str, Any]:
    """Return the same, of another checkout with its own interpreter."""
    path = Path(folder).resolve()
    own = {**os.environ, "PYTHONPATH": str(path), "PYTHONSAFEPATH": "1"}
    python = path / ".venv/bin/python"
    text = subprocess.run([python, __file__], cwd=path, env=own, stdout=subprocess.PIPE, check=True)
    return dict(json.loads(text.stdout))


def main(old: str, new: str) -> int:
    """Print what differs, and how many studies are equal; return 1 if some are not."""
    before, after = of_checkout(old), of_checkout(new)
    if before.pop("") != after.pop(""):
        print(
            "the sources that count in all ids differ (studies/definition/identity.py: solver_hash)"
        )
        return 1
    both = before.keys() & after.keys()  # one of them may ship more
    differing = sorted(name for name in both if before[name] != after[name])
    for name in differing:
        print(f"{name}:\n  {before[name]}\n  {after[name]}")
    accepted = sum(isinstance(after[name], list) for name in both)
    print(f"{len(both)} studies, {accepted} accepted: {len(differing)} differ")
    return bool(differing)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        sys.exit(main(*sys.argv[1:]))
    json.dump(of_this_checkout(), sys.stdout)
