"""Find what matters with a few sampled points, then search the load that reaches a limit.

Run it with ``python examples/sample_and_goal.py``; it writes the runs and two data sets to the
directory ``sample``. A second run finds them and computes nothing.
"""

import numpy as np

from studies import Store, open_study, run_study

COARSE = {
    "accuracy": "draft", "smallest_element": 0.05, "growth": 3.0, "load_step": 0.25,
    "unload_steps": 1, "hardening": "isotropic",
}  # fmt: skip

# Eight points fill three ranges. With num = 16 the first eight would be the same, and be kept.
SAMPLE = {
    "name": "which-matters",
    "scene": "punch",
    "parameters": COARSE,
    "sample": {
        "method": "sobol",
        "num": 8,
        "ranges": {
            "load_ratio": [0.4, 0.9],
            "friction": [0.0, 0.4],
            "hardening_ratio": {"start": 0.01, "stop": 0.1, "spacing": "log"},
        },
    },
}

# At two frictions: the load that leaves a tension of 100 MPa. The load is the branch parameter of
# the punch, so that loading goes on from the lower end of the bracket.
GOAL = {
    "name": "load-of-100-MPa",
    "scene": "punch",
    "parameters": COARSE,
    "sweep": {"friction": [0.2, 0.3]},
    "goal": {"of": "peak_residual_tension", "at": 100.0, "between": [0.3, 1.2], "within": 0.05},
}


def sample() -> None:
    """Compute the sample, and print how each parameter goes with the tension."""
    assert run_study(SAMPLE, Store("sample"), workers=0).ok
    with open_study("sample", SAMPLE["name"]) as dataset:
        runs = dataset.squeeze()
        assert runs.sizes["point"] == 8
        for name in SAMPLE["sample"]["ranges"]:
            together = np.corrcoef(runs[name], runs.peak_residual_tension)[0, 1]
            print(f"{name}: correlation {together:.2f} with the residual tension")


def search() -> None:
    """Search the load, and check the brackets."""
    outcome = run_study(GOAL, Store("sample"), workers=0)
    assert outcome.ok, outcome.failed
    with open_study("sample", GOAL["name"]) as dataset:
        found = dataset.squeeze()
        print(found[["load_ratio", "load_ratio_low", "load_ratio_high", "runs"]].to_dataframe())
        assert (found.load_ratio_high / found.load_ratio_low < 1.053).all()
        assert (found.load_ratio.diff("friction") < 0.0).all(), "friction leaves more tension"


# Worker processes, where a study has any, import this script again: without this line each of them
# would start the study.
if __name__ == "__main__":
    sample()
    search()
