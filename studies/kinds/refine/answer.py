"""The data set of a refinement: its runs over ``point``, and its cells with the error left."""

from __future__ import annotations

from typing import Any

import numpy as np

from studies.definition.study import Study
from studies.definition.sweep import owners
from studies.kinds.kind import Answers
from studies.kinds.refine.cells import ERROR
from studies.kinds.refine.refinement import Refinement, Wanted
from studies.storage import dataset as layout
from studies.storage.dataset import Variable
from studies.storage.runfile import described


def answers(study: Study, programs: list[Refinement]) -> Answers:
    """Return the runs of a refinement over ``point``, and its cells with the errors left."""
    (program,) = programs
    ran = [each for each in program.asked if not isinstance(program.rows.get(each), str)]
    order = sorted(ran, key=lambda each: (program.asked[each], each))
    return Answers(
        content=lambda: _beside(study, program, order),
        points=[program.sets(each) for each in order],
    )


def _beside(study: Study, program: Refinement, order: list[Wanted]) -> dict[str, Variable]:
    """Return what the data set has beside the runs."""
    scene, refine, cells = study.problem, program.refine, program.cells
    variables: dict[str, Variable] = {}

    def add(name: str, dims: str | list[str], values: Any, words: str, unit: str = "") -> None:
        variables[name] = described(dims, values, words, unit)

    rounds = np.array([program.asked[each] + 1 for each in order], dtype=np.int32)
    add("round", "point", rounds, "round in which the run was asked for")
    for axis, name in enumerate(refine.axes):
        unit = layout.axis_attributes(scene, name).get("units", "")
        for end in ("low", "high"):
            values = [float(getattr(each.cell, end)[axis]) for each in cells]
            add(f"cell_{name}_{end}", "cell", values, f"{end} end of {name} of the cell", unit)
    for name in owners(study.sweep).keys() - refine.axes.keys():
        values = [program.branches[each.cell.branch][name] for each in cells]
        add(f"cell_{name}", "cell", layout.axis_array(values), f"{name} of the cell")
    states = np.array([each.state for each in cells], dtype=object)
    add("cell_state", "cell", states, "what became of the cell")
    swept = owners(study.sweep)
    over = [each for each in layout.usual_dimensions(scene) if each not in swept] + ["point"]
    for k, number in enumerate(refine.of):
        name = number.name
        left = np.array([each.left[k] if each.left else np.nan for each in cells])
        left[np.isinf(left)] = np.nan  # no runs around the cell tell it
        unit = layout.attributes_of(number.of, scene).get("units", "")
        if not number.whole:
            numbers = [np.nan if each is None else each[k] for each in map(program.number, order)]
            add(name, over, numbers, f"what is refined of {number.of}", unit)
        add(f"{ERROR}{name}", "cell", left, f"error of {name} that is left in the cell", unit)
    return variables
