"""What happened to a study: its states, what it waited for, and the ends of its runs."""

from __future__ import annotations

from service.job import Job
from service.jobs import Jobs
from studies import Store


def log_of(job: Job, jobs: Jobs, store: Store) -> str:
    """Return a line for each thing that happened to a study, in the order of time.

    Runs that were there before it was accepted come first. Of a study that an earlier version
    accepted only the times of its row are known.
    """
    lines = jobs.told(job.id)
    if not lines:
        begun = [(job.submitted, "accepted"), (job.started, "running")]
        ended = [(job.finished, f"{job.state}: {job.message}".removesuffix(": "))]
        lines = [(at, words) for at, words in begun + ended if at]
    for run_id, row in store.catalogue.each(jobs.runs(job.id)):
        if row:
            seconds = "" if row["cpu_seconds"] is None else f", {row['cpu_seconds']:.3g} s of CPU"
            words = f"run {run_id}: {row['status']}{seconds}"
            said = f"{words}: {row['message']}" if row["message"] else words
            lines.append((str(row["created"]), said))
    told = ((at, " ".join(words.split())) for at, words in sorted(lines, key=lambda each: each[0]))
    return "".join(f"{at}  {words}\n" for at, words in told)
