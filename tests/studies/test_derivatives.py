"""The table ``[derivatives]`` of studies and scene files."""

from __future__ import annotations

from typing import Any

import pytest

from studies import Store, Study, StudyError, open_study
from studies.execution.estimate import estimate
from studies.scenes.scene import read_scene
from tests.marks import HERE
from tests.studies.conftest import compute_here

BENDING = HERE.parent / "data/scenes/bending.toml"
ASKED = {"by": ["ratio"], "of": ["residual"]}


def bent(**more: Any) -> Study:
    """Return a study of a beam that is bent beyond yield."""
    content = {"name": "bent", "sweep": {"ratio": [1.1, 1.3]}, **more}
    return Study.from_dict(content, read_scene(BENDING))


def punched(**more: Any) -> Study:
    """Return a study of one run of the punch."""
    return Study.from_dict({"name": "punched", "scene": "punch", "parameters": {}, **more})


@pytest.mark.solves
def test_the_data_set_has_them_with_their_units(store: Store) -> None:
    """The residual stress of a perfectly plastic beam is 300 MPa (ratio - 1) at its face."""
    study = bent(derivatives=ASKED)
    compute_here(study, store, study.problem)
    data = open_study(store.dataset_path(study.id))
    assert data["d_residual_d_ratio"].values == pytest.approx([300.0, 300.0], rel=1e-5)
    assert data["d_residual_d_ratio"].attrs["units"] == "MPa"
    assert "derivative of" in data["d_residual_d_ratio"].attrs["long_name"]


def test_they_change_the_ids_of_runs_and_are_extended_with_them() -> None:
    with_them, without = bent(derivatives=ASKED), bent()
    assert not {*with_them.run_ids()} & {*without.run_ids()}
    own = {"name": "bent", "scene": "bending", "sweep": {"ratio": [1.1, 1.3]}, "derivatives": ASKED}
    more = Study.from_dict(
        {"name": "more", "extends": own, "sweep": {"ratio": [1.4]}},
        scenes=lambda name: read_scene(BENDING),
    )
    assert {*with_them.run_ids()} <= {*more.run_ids()}


@pytest.mark.parametrize(
    ("derivatives", "field", "allowed"),
    [
        (3, "derivatives", "must be a table"),
        ({"by": ["friction"]}, "derivatives.of", "must be given"),
        ({"by": ["elemnt"], "of": ["plastic_work"]}, "derivatives.by[0]", "with decimals"),
        ({"by": ["element"], "of": ["plastic_work"]}, "derivatives.by[0]", "with decimals"),
        ({"by": ["friction"], "of": ["map_mises"]}, "derivatives.of[0]", "one number a run"),
        ({"by": ["friction"], "of": []}, "derivatives.of", "1 or more"),
    ],
)
def test_mistakes_name_their_entry(derivatives: Any, field: str, allowed: str) -> None:
    with pytest.raises(StudyError) as caught:
        punched(derivatives=derivatives)
    assert caught.value.field == field
    assert allowed in caught.value.allowed


def test_a_scene_of_steady_passes_refuses_them() -> None:
    with pytest.raises(StudyError, match="must be left out: runs of wheel_rail"):
        punched(scene="wheel_rail", derivatives={"by": ["friction"], "of": ["residual_max"]})


def test_an_estimate_counts_them(store: Store) -> None:
    both = [
        estimate(punched(**more), store).cpu_seconds
        for more in ({"derivatives": {"by": ["friction"], "of": ["plastic_work"]}}, {})
    ]
    assert both[0] and both[1] and both[0][1] > 1.2 * both[1][1]
