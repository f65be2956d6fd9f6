"""What a scene does not need is left out, and its answer is the same."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.skips import SKIPS, STEADY, Skip, apart


@pytest.mark.parametrize("skip", SKIPS, ids=lambda skip: skip.what.replace(" ", "_"))
def test_what_is_left_out_changes_no_number(skip: Skip) -> None:
    short, whole = skip.short(), skip.whole()
    assert np.isfinite(short).all()
    assert np.ptp(short) > 0
    assert apart(short, whole) <= skip.apart


def test_a_steady_pass_strains_as_one_by_increments() -> None:
    """Increments of an eighth of the half-width err by some hundredths."""
    short, whole = STEADY.short(), STEADY.whole()
    assert short > 1e-4
    assert apart(short, whole) <= STEADY.apart
