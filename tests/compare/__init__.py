"""``python -m tests.compare OLD NEW``: whether two checkouts compute the same numbers.

OLD and NEW are folders of checkouts, each with its own ``.venv``. Both compute the shipped studies
(of a large one a seeded choice of its runs), seeded scenes of all families of `tests.stability`,
and the runs of `tests.compare.runs`. The command compares all numbers that these store. For each
study or family it prints the largest change over the level of its variable, and the ratios of
processor time and memory. It returns 1 if a change is above `tests.compare.changes.LIMIT`, if a
status differs, or if only one side has a run or a variable.
"""
