"""Opening studies by name."""

from __future__ import annotations

import os

import pytest

from studies import Store, StudyError, open_study
from tests.studies.conftest import compute_here, fake_study


def test_a_study_is_opened_by_its_name_the_last_one_of_several(store: Store) -> None:
    first, second = fake_study("tour"), fake_study("tour", {"friction": [0.1]})
    other = fake_study("other", {"friction": [0.2]})
    for age, study in ((30, first), (10, second), (20, other)):
        compute_here(study, store)
        path = store.dataset_path(study.id)
        stamp = path.stat().st_mtime - age
        os.utime(path, (stamp, stamp))
    with open_study(store.directory, "tour") as dataset:
        assert dataset["friction"].values.tolist() == [0.1]
    with open_study(store.directory, "other") as dataset:
        assert dataset["friction"].values.tolist() == [0.2]
    with pytest.raises(StudyError, match=r"name = 'tuor': must be one of other, tour"):
        open_study(store.directory, "tuor")
    with pytest.raises(StudyError, match=r"give the directory of one, or its name \(other, tour\)"):
        open_study(store.directory)


def test_without_a_name_the_last_one_of_a_single_name_is_opened(store: Store) -> None:
    for age, friction in ((10, 0.3), (20, 0.1)):
        study = fake_study("tour", {"friction": [friction]})
        compute_here(study, store)
        path = store.dataset_path(study.id)
        os.utime(path, (path.stat().st_mtime - age,) * 2)
    with open_study(store.directory) as dataset:
        assert dataset["friction"].values.tolist() == [0.3]
