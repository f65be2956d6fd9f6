"""Imported last by the process whose forks are the workers: what the forks inherit.

The id of the solver is that of the sources which this process has loaded. A worker that is forked
after an update would find the new sources on the disk, and has the old code.

The environment of this process is as old as the code. It is forgotten: each worker gets that of the
process that starts it.

What is loaded stays: a worker that looks for memory to free does not look there.
"""

from __future__ import annotations

import gc
import os

from studies.definition.identity import solver_hash
from studies.execution.forking import FORK_SERVER

solver_hash()
if FORK_SERVER in os.environ:
    os.environ.clear()
    gc.freeze()
