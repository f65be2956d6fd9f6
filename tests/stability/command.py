"""The command: run many scenes, print what they came to, and say whether that may be."""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence

from tests.stability.families import EVERY, FAMILIES, NAMES
from tests.stability.pool import trials
from tests.stability.table import COUNTED, counts, describe, summary
from tests.stability.trial import Trial, Verdict

UNEXPLAINED = 0.003
"""Share of the scenes that may end without an answer, a right limit, a clear refusal or a declared
reason."""


PATIENCE = 300.0
"""Seconds of CPU after which a scene counts as hanging: several passes by increments, where no
steady ones are found, take more than a minute."""


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the scenes that the command line names; return 1 when they came to what may not be."""
    parser = argparse.ArgumentParser(prog="python -m tests.stability", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="family, or family-number; all by default"
    )
    parser.add_argument("--short", action="store_true", help="only those of the test suite")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    given = parser.parse_args(arguments)
    try:
        names = chosen(given.names, NAMES if given.short else EVERY)
    except KeyError as unknown:
        parser.error(f"no scene or family {unknown.args[0]}; families: {', '.join(FAMILIES)}")
    return report(names, max(given.jobs, 1))


def chosen(asked: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return the names asked for, a family standing for all of its scenes; all where none is.

    Raises
    ------
    KeyError
        for what there is not
    """
    if not asked:
        return list(known)
    names = []
    for each in asked:
        own = [n for n in known if n.rpartition("-")[0] == each] or [n for n in EVERY if n == each]
        if not own:
            raise KeyError(each)
        names += own
    return names


def report(names: Sequence[str], jobs: int, patience: float = PATIENCE) -> int:
    """Run scenes, print a line for each family when it is complete and a table at the end."""
    began = time.monotonic()
    print(f"{'family':<12}{''.join(f'{c:>13}' for c in COUNTED)}{'CPU [s]':>9}", flush=True)
    expected = {f: sum(n.rpartition("-")[0] == f for n in names) for f in FAMILIES}
    ended: list[Trial] = []
    for trial in trials(names, jobs, patience):
        ended.append(trial)
        if not trial.right:
            print(describe(trial), flush=True)
        family = trial.name.rpartition("-")[0]
        own = [t for t in ended if t.name.rpartition("-")[0] == family]
        if len(own) == expected[family]:
            print(counts(family, own), flush=True)
    print(counts("all", ended), "", *summary(ended), sep="\n")
    told = [t for t in ended if not t.right or t.verdict is Verdict.HONEST or len(names) < 4]
    print(*(describe(t) for t in told), sep="\n")
    status = verdict(ended)
    print(f"\n{'bad' if status else 'good'}, in {time.monotonic() - began:.0f} s")
    return status


def verdict(ended: Sequence[Trial]) -> int:
    """Return 1 where an answer is wrong, a scene hangs, or too many are not explained."""
    column = {c: sum(t.verdict in v for t in ended) for c, v in COUNTED.items()}
    unexplained = column["unexplained"] > UNEXPLAINED * len(ended)
    return int(bool(column["wrong"] or column["hung"] or unexplained))
