"""Opening studies by name."""

from __future__ import annotations

import os

import pytest

from studies import Store, StudyError, open_study
from studies.views.reading import find_study
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
    with pytest.raises(StudyError, match=r"give one, such as \S+, or its name \(other, tour\)"):
        open_study(store.directory)


def test_without_a_name_the_last_one_of_a_single_name_is_opened(store: Store) -> None:
    for age, friction in ((10, 0.3), (20, 0.1)):
        study = fake_study("tour", {"friction": [friction]})
        compute_here(study, store)
        path = store.dataset_path(study.id)
        os.utime(path, (path.stat().st_mtime - age,) * 2)
    with open_study(store.directory) as dataset:
        assert dataset["friction"].values.tolist() == [0.3]


def test_two_of_one_name_are_told_with_what_differs(
    store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    studies = [fake_study("tour", {"friction": [friction]}) for friction in (0.3, 0.1)]
    for study in studies:
        compute_here(study, store)
    open_study(store.directory, "tour").close()
    (told,) = [text for text in caplog.messages if "of this name" in text]
    first, *lines = told.splitlines()
    assert first.endswith("holds 2 studies of this name, the first is taken:")
    assert len(lines) == 2
    for study, friction in zip(studies, ("[0.3]", "[0.1]"), strict=True):
        (line,) = [each for each in lines if study.id in each]
        assert f"sweep.friction = {friction}" in line
        assert "hardening" not in line and "seal" not in line


def test_of_long_entries_the_part_that_differs_is_told(
    store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    loads = [0.1 + k / 30 for k in range(12)]
    for last in (0.7, 0.8):
        compute_here(fake_study("tour", {"load_ratio": [*loads, last]}), store)
    open_study(store.directory, "tour").close()
    (told,) = [text for text in caplog.messages if "of this name" in text]
    assert [line.rpartition(" ")[2] for line in told.splitlines()[1:]] == ["0.8]", "0.7]"]


def test_an_entry_of_one_study_alone_is_shown_from_its_beginning(
    store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    compute_here(fake_study("tour", {"load_ratio": [0.5]}), store)
    frictions = [k / 30 for k in range(12)]
    compute_here(fake_study("tour", {"load_ratio": [0.5], "friction": frictions}), store)
    open_study(store.directory, "tour").close()
    (told,) = [text for text in caplog.messages if "of this name" in text]
    assert "friction = [0.0, 0.0333" in told


def test_a_study_in_a_directory_is_named_in_its_path(store: Store) -> None:
    tour, other = fake_study("tour"), fake_study("other", {"friction": [0.2]})
    for age, study in ((30, tour), (10, other)):
        compute_here(study, store)
        path = store.dataset_path(study.id)
        os.utime(path, (path.stat().st_mtime - age,) * 2)
    for name, study in (("tour", tour), (tour.id[:6], tour), ("latest", other), ("other", other)):
        assert find_study(store.directory / name) == store.dataset_path(study.id)
    with pytest.raises(StudyError, match="must be a data set, a study or an output directory"):
        find_study(store.directory / "tuor")
