"""A program that the interpreter of a checkout runs: it computes, and writes what came out.

It is passed as text, so that it need not be in the checkout, and uses only public names of
`studies` and `solver` and the scenes of `tests.stability`. It reads a job (what, arguments) from
standard input, and writes a file with user time [s], memory [kB], and the numbers of each run.
"""

from __future__ import annotations

import json
import pickle
import random
import resource
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

Run = dict[str, Any]
Computed = tuple[float, int, dict[str, Run]]


def spent() -> tuple[float, int]:
    """Return the user time of this process and the largest memory that it had."""
    lines = Path("/proc/self/status").read_text().splitlines()  # getrusage has that of the parent
    most = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime, most


def of_study(file: str, most: int) -> Computed:
    """Compute a study; of one with more runs than `most` a choice of them."""
    from studies import Store, Study, run_study

    study = sampled(Study.from_toml(file), most)
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_study(study, Store(Path(folder)), workers=0)
        cost = spent()
        runs = named([stored_in(f"{folder}/runs/{run}.nc") for run in outcome.computed])
        return *cost, runs | {"data set": stored_in(str(outcome.dataset))[1]}


def sampled(study: Any, most: int) -> Any:
    """Return a study with a seeded choice of its runs, unless it is small or chooses them."""
    if study.size <= most or not next(study.run_ids(), None):
        return study
    cases: list[Mapping[str, Any]] = [case.values for case in study.cases()]
    swept = [name for name in cases[0] if any(case[name] != cases[0][name] for case in cases)]
    chosen = sorted(random.Random(0).sample(range(len(cases)), most))
    content = study.to_dict()
    points = [{name: cases[k][name] for name in swept} for k in chosen]
    content["sweep"] = {"choice": points}  # a scene may have a dimension ``point``
    return type(study).from_dict(content, scenes=lambda name: study.problem)


def named(stored: Sequence[tuple[str, Run]]) -> dict[str, Run]:
    """Name runs by their place in the order of their parameters: their ids depend on the code."""
    ranked = sorted(stored, key=lambda run: json.dumps(json.loads(run[0]), sort_keys=True))
    return {f"run {k}": values for k, (_, values) in enumerate(ranked)}


def stored_in(path: str) -> tuple[str, Run]:
    """Return the parameters of a netCDF file as text, and its variables."""
    import netCDF4

    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return file.parameters, {name: each[...] for name, each in file.variables.items()}


def of_family(names: Sequence[str], patience: float) -> Computed:
    """Compute scenes of a family of stability, each in at most so many seconds."""
    from tests.stability.families import scene
    from tests.stability.trial import Hung, deadline

    runs: dict[str, Run] = {}
    for name in names:
        try:
            with deadline(patience):
                runs[name] = {"status": "answer", **dict(numbers(scene(name).run()))}
        except Hung:
            runs[name] = {"status": "hung"}
        except Exception as error:  # how a scene ends is compared, whatever it is
            loads = {n: getattr(error, n) for n in ("reached", "attempted") if hasattr(error, n)}
            runs[name] = {"status": type(error).__name__, **loads}
    return *spent(), runs


def of_runs(given: Mapping[str, tuple[str, Mapping[str, Any]]]) -> Computed:
    """Compute runs of scenes, by name: the scene, and its parameters."""
    from studies.scenes.registry import scene_named
    from studies.scenes.scene import read_scene

    runs: dict[str, Run] = {}
    for name, (which, parameters) in given.items():
        try:
            scene = read_scene(Path(which)) if which.endswith(".toml") else scene_named(which)
            asked = scene.parameters(**parameters)
            value = getattr(asked, scene.branch) if scene.branch else None
            (record,) = scene.path(asked, [value], lambda share: None)
            runs[name] = dict(numbers(record))
        except Exception as error:  # as above
            runs[name] = {"status": type(error).__name__}
    return *spent(), runs


def numbers(answer: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers of the records, solutions and states in an answer, by name."""
    from solver import Record, Solution
    from studies import to_xarray

    if isinstance(answer, Record):
        yield f"{at}status", answer.status.name
        yield from ((f"{at}{n}", v) for n, v in {**answer.coordinates, **answer.scalars}.items())
        yield from ((f"{at}{name}", values) for name, (_, values) in answer.fields.items())
    elif isinstance(answer, Solution):
        yield from ((f"{at}{n}", v.to_numpy()) for n, v in to_xarray(answer).variables.items())
    elif hasattr(answer, "state") and hasattr(answer.state, "u"):  # a state without its model
        yield from numbers(answer.state.u, f"{at}u.")
    elif isinstance(answer, list | tuple):
        for k, each in enumerate(answer):
            yield from numbers(each, f"{at}{k}.")
    elif is_dataclass(answer) and not type(answer).__module__.startswith("solver"):
        for each in fields(answer):
            yield from numbers(getattr(answer, each.name), f"{at}{each.name}.")
    elif isinstance(answer, np.ndarray | float | int):
        yield at.rstrip("."), answer


if __name__ == "__main__":
    what, arguments = pickle.load(sys.stdin.buffer)
    kinds: dict[str, Callable[..., Computed]]
    kinds = {"study": of_study, "family": of_family, "runs": of_runs}
    Path(sys.argv[1]).write_bytes(pickle.dumps(kinds[what](*arguments)))
