"""Studies and stores as for the tests of studies."""

from tests.studies.conftest import computed, store, study_file

__all__ = ["computed", "store", "study_file"]
