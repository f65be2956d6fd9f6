"""Compute a small study in Python on two workers, open it with xarray, draw it.

Run it with ``python examples/sweep_and_xarray.py``; it writes the runs and their data set to the
directory ``sweep``, and ``sweep.png``. A second run finds these runs and computes nothing.
"""

from matplotlib.figure import Figure

from studies import Store, Study, open_study, run_study

# The content of a study file as a dictionary. The scene is a punch pressed on a half-plane;
# parameters that are not given have the scene's default (`residua scenes punch` lists them). Mesh
# and increments are coarse, so that the example takes seconds.
STUDY = Study.from_dict(
    {
        "name": "friction-and-load",
        "scene": "punch",
        "parameters": {
            "accuracy": "draft",
            "smallest_element": 0.05,
            "growth": 3.0,
            "hardening": "isotropic",
        },
        "sweep": {"load_ratio": [0.5, 0.7, 0.9], "friction": [0.0, 0.3]},
    }
)


def compute() -> None:
    """Compute the runs that are not in the store yet."""
    outcome = run_study(STUDY, Store("sweep"), workers=2)
    print(f"{len(outcome.computed)} of {STUDY.size} runs computed: {dict(outcome.counts)}")
    assert outcome.ok, outcome.failed


def look() -> None:
    """Read the data set, print a table and draw a line for each load."""
    with open_study("sweep") as dataset:
        # Every axis of the sweep is a dimension. An axis that is not swept, such as hardening here,
        # has one value; squeeze removes it.
        runs = dataset.squeeze("hardening")
        assert runs.sizes["load_ratio"] == 3
        assert runs.sizes["friction"] == 2

        # A variable with one value per run is a table over the sweep. Its attributes have the unit.
        tension = runs["peak_residual_tension"]
        print(tension.to_pandas().round(1).to_string())
        assert (tension > 0.0).all(), "every load leaves tension somewhere"
        assert (runs["plastic_work"].diff("load_ratio") > 0.0).all(), "more load, more plastic work"

        # A field has its own dimensions after those of the sweep. sel selects by value or label.
        surface = runs["surface_residual"].sel(body="half_plane", component="xx", friction=0.3)
        figure = Figure(figsize=(6, 3.5), layout="constrained")
        axes = figure.add_subplot()
        for ratio in runs["load_ratio"].values:
            line = surface.sel(load_ratio=ratio).dropna("s")
            axes.plot(line["s"], line, label=f"{ratio:g} of the yield stress")
        unit = surface.attrs["units"]
        axes.set(
            xlabel="distance from the middle of the contact [mm]",
            ylabel=f"residual stress xx [{unit}]",
        )
        axes.legend(title="mean pressure, friction 0.3", fontsize=8)
        figure.savefig("sweep.png", dpi=150)


# Worker processes import this script again. Without this line each of them would start the study.
if __name__ == "__main__":
    compute()
    look()
