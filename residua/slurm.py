"""Scripts for sbatch, which compute a study on a cluster."""

from __future__ import annotations

import re
from pathlib import Path
from shlex import quote

from studies.errors import StudyError
from studies.execution.access import CONFIGURATION
from studies.execution.forks import FROM_THE_START

_TIME = re.compile(r"(\d+-)?\d+(:\d\d){0,2}")
_MEMORY = re.compile(r"\d+[KMGT]?")

_HEAD = """#!/bin/sh
#SBATCH --job-name={name}
#SBATCH --{many}
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu={memory}
#SBATCH --time={time}
"""

_PARTS = """#SBATCH --signal=B:TERM@60
#
# Each task computes what it can claim in the directory; no task talks to another one. Submit:
#   job=$(sbatch --parsable {file})
#   sbatch --dependency=afterany:$job --wrap {join}
# The second line combines the runs. To go on after a limit of time, submit both lines again.
{settings}
exec residua run {study} --out {out} --part "$SLURM_ARRAY_TASK_ID/{tasks}"
"""

_SCHEDULER = """#
# A scheduler, and its workers: one for each task. Submit:
#   sbatch {file}
# To go on after a limit of time, submit it again.
{settings}
umask 077
keys={out}/certificates
address={out}/scheduler-$SLURM_JOB_ID.json
residua certificates --out "$keys"
export DASK_DISTRIBUTED__COMM__TLS__CA_FILE="$keys/scheduler/ca.pem"
export DASK_DISTRIBUTED__COMM__TLS__SCHEDULER__CERT="$keys/scheduler/cert.pem"
export DASK_DISTRIBUTED__COMM__TLS__SCHEDULER__KEY="$keys/scheduler/key.pem"
export DASK_DISTRIBUTED__COMM__TLS__WORKER__CERT="$keys/worker/cert.pem"
export DASK_DISTRIBUTED__COMM__TLS__WORKER__KEY="$keys/worker/key.pem"
dask scheduler --scheduler-file "$address" --protocol tls --port 0 \\
    --dashboard-address 127.0.0.1:0 &
scheduler=$!
srun dask worker --scheduler-file "$address" --protocol tls --nworkers 1 --nthreads 1 \\
    --dashboard-address 127.0.0.1:0 --death-timeout 120 --local-directory "${{TMPDIR:-/tmp}}" &
workers=$!
residua run {study} --out {out} --scheduler-file "$address" --tls-ca "$keys/service/ca.pem" \\
    --tls-cert "$keys/service/cert.pem" --tls-key "$keys/service/key.pem"
status=$?
kill $workers $scheduler
wait
rm -f "$address"
exit $status
"""


def script(
    name: str,
    study: Path,
    out: Path | str,
    file: Path,
    *,
    tasks: int,
    time: str,
    memory: str,
    scheduler: bool = False,
) -> str:
    """Return a script for sbatch.

    Parameters
    ----------
    name : of the job
    study, out, file : the study file, the output directory or its address, and the script itself
    tasks : number of tasks, of one core each
    time, memory : limits of a task, as sbatch takes them: ``04:00:00``, ``2G``
    scheduler : whether the tasks are workers of a scheduler, in place of parts

    Raises
    ------
    StudyError
        if time or memory is not what sbatch takes
    """
    for option, text, form, allowed in (
        ("--time", time, _TIME, "must be minutes, or [days-]hours:minutes:seconds"),
        ("--memory", memory, _MEMORY, "must be a whole number with K, M, G or T, such as 2G"),
    ):
        if not form.fullmatch(text):
            raise StudyError(option, text, allowed)
    if scheduler and isinstance(out, str):
        raise StudyError("--out", out, "must be a directory, in which the scheduler is found")
    many = f"ntasks={tasks}" if scheduler else f"array=1-{tasks}"
    head = _HEAD.format(name=name, many=many, memory=memory, time=time)
    settings: dict[str, object] = {**FROM_THE_START, "PYTHONSAFEPATH": 1}
    if scheduler:
        settings |= {
            "DASK_" + key.upper().replace(".", "__").replace("-", "_"): value
            for key, value in CONFIGURATION.items()
            if not isinstance(value, dict)
        }
    join = quote(f"residua run {quote(str(study))} --out {quote(str(out))} --resume")
    return head + (_SCHEDULER if scheduler else _PARTS).format(
        settings="\n".join(f"export {key}={value}" for key, value in settings.items()),
        study=quote(str(study)), out=quote(str(out)), file=quote(str(file)), tasks=tasks, join=join,
    )  # fmt: skip
