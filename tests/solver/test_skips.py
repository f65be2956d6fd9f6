"""What a scene does not need is left out, and its answer is the same."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from tests.architecture.sources import ROOT
from tests.benchmarks.skips import SKIPS, Skip, apart

pytestmark = pytest.mark.solves


@pytest.mark.parametrize("skip", SKIPS, ids=lambda skip: skip.what.replace(" ", "_"))
def test_what_is_left_out_changes_no_number(skip: Skip) -> None:
    short, whole = skip.short(), skip.whole()
    assert np.isfinite(short).all()
    assert np.ptp(short) > 0
    assert apart(short, whole) <= skip.apart


@pytest.mark.processes
def test_a_run_by_increments_does_not_wait_for_the_compiler_of_steady_passes() -> None:
    """Importing it takes as long as a small run."""
    program = (
        "import sys\n"
        "from solver.shipped import SCENES\n"
        "punch = SCENES['punch']\n"
        "(run,) = punch.path(punch.parameters(accuracy='draft'), [0.3], lambda share: None)\n"
        "print(run.status.name, 'numba' in sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "OK False\n"
