"""What the process of a worker loads: nothing that a run does not need, and all of it once."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from studies.execution.forks import NEEDED
from tests.architecture.sources import ROOT

NEVER = {"dask.array", "dask.dataframe", "matplotlib", "meshio", "numba", "pandas", "xarray"}
"""Each takes a tenth of a second to load, or much more, and memory of each worker."""
UNASKED = (
    "solver.fatigue",
    "solver.results.fatigue",
    "solver.rolling.passing",
    "solver.rolling.rail.track",
    "solver.rolling.scenes.rolling_setup",
)

PROGRAM = f"""
import importlib, json, sys
from pathlib import Path
for name in {NEEDED!r}:
    importlib.import_module(name)
before = set(sys.modules)
from studies import Store, Study
from studies.definition.identity import solver_hash
from studies.execution.task import PathTask, walk
study = Study.from_dict({{
    "name": "coarse", "scene": "punch",
    "parameters": {{"smallest_element": 0.05, "growth": 3.0, "load_ratio": 0.3}},
    "sweep": {{"friction": [0.2]}},
}})
out = Path(sys.argv[1])
Store(out).save_study(study)
walk(PathTask(study.problem, tuple(study.paths()), out, solver_hash()), print, lambda: False)
(row,) = Store(out).sound(study.run_ids()).values()
print(json.dumps([row["status"], sorted(before), sorted(sys.modules)]))
"""


AGAIN = """
import sys
from pathlib import Path
import service.app
from studies import Store
store = Store(Path(sys.argv[1]))
store.catalogue.remove([row["id"] for row in store.catalogue.runs()[0]])
store.reconcile()
assert [row["status"] for row in store.catalogue.runs()[0]] == ["ok"]
print(*{name.partition(".")[0] for name in sys.modules})
"""


@pytest.mark.processes
@pytest.mark.solves
def test_a_worker_loads_what_a_run_needs_before_it_is_forked_and_nothing_else(
    tmp_path: Path,
) -> None:
    command = [sys.executable, "-c", PROGRAM, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    status, before, after = json.loads(done.stdout.splitlines()[-1])
    assert status == "ok"
    assert not NEVER & set(after)
    assert not [name for name in after if name.startswith(UNASKED)]
    first, last = ({name.partition(".")[0] for name in names} for names in (before, after))
    assert last - first <= sys.stdlib_module_names
    command = [sys.executable, "-c", AGAIN, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    loaded = set(done.stdout.split())
    assert "h5py" in loaded
    assert not {"netCDF4", "scipy", "skfem", "xarray"} & loaded, "the service finds runs again"


@pytest.mark.processes
def test_what_knows_all_quantities_has_loaded_no_compiled_loops() -> None:
    program = (
        "import sys, solver.shipped; from solver.results.quantities import QUANTITIES; "
        "print('cycle' in QUANTITIES, 'moving_load' in QUANTITIES, 'numba' in sys.modules)"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.split() == ["True", "False", "False"]
