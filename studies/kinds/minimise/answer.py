"""The data set of a minimum: its runs over ``point``."""

from __future__ import annotations

from studies.definition.study import Study
from studies.kinds.kind import Answers
from studies.kinds.minimise.search import Minimising
from studies.storage.runfile import described


def answers(study: Study, programs: list[Minimising]) -> Answers:
    """Return the runs in the order in which they were asked for, and how the search ended."""
    (program,) = programs
    state = program.reason or study.kind.ends[1]
    return Answers(
        content=lambda: {"search_state": described((), state, "how the search ended")},
        points=[program.sets(key) for key in program.rows if key not in program.refusals],
    )
