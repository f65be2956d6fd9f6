"""What every test takes for granted."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator

import pytest

# Workers of the test run share the cores: threads of BLAS would wait for each other. Set before
# any test loads the library, and inherited by the processes that tests start.
os.environ["OMP_NUM_THREADS"] = "1"


@pytest.fixture(autouse=True, scope="module")
def nothing_solved_outlives_its_module() -> Iterator[None]:
    """Forget solved problems, which hold factors of hundreds of megabytes."""
    yield
    for name, module in list(sys.modules.items()):
        if name.startswith(("tests.verification", "tests.solver")):
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear") and value.__module__.startswith("tests."):
                    value.cache_clear()
    gc.collect()


@pytest.fixture(autouse=True, scope="session")
def no_settings_from_outside() -> Iterator[None]:
    """Keep the ``RESIDUA_`` settings of whoever runs the tests out of them."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith("RESIDUA_")]:
            patch.delenv(name)
        yield
