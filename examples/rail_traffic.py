"""Equal and mixed wheels over a rail: stress and strain pass by pass, and the section at last.

Run it with ``python examples/rail_traffic.py OUT``, where OUT holds the results of the study
`data/studies/wheel-rail-traffic.toml`; without OUT a coarse and short form of it is computed. It
writes ``wheel-rail-traffic.png``.
"""

import sys
from pathlib import Path
from tempfile import mkdtemp

from matplotlib.figure import Figure

from studies import Store, Study, open_study, run_study

MIXED = {
    "sequence": [{"traction": -0.5}, {"times": 2}, {"load": 35e3}],
    "load_spread": 0.1, "lateral_spread": 1.0, "traction_spread": 0.05, "seed": 1,
}  # fmt: skip
COARSE = {
    "name": "traffic",
    "scene": "wheel_rail",
    "parameters": {
        "accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196, "friction": 0.3,
        "load": 110e3,
    },
    "sweep": {"passes": [4], "traffic": {"equal": {}, "mixed": MIXED}},
}  # fmt: skip


def computed():
    """Return the directory of a coarse study."""
    directory = Path(mkdtemp())
    outcome = run_study(Study.from_dict(COARSE), Store(directory), workers=0)
    assert outcome.ok, outcome.failed
    return directory


def drawn(data):
    """Return the picture of a study, and its largest number of passes."""
    last = data.isel(passes=-1)
    count = last["pass"].values
    figure = Figure(figsize=(9, 4.6), layout="constrained", dpi=110)
    above, below = figure.subfigures(2, 1, height_ratios=(3, 1.7))
    stress, strain = above.subplots(1, 2)
    maps = below.subplots(1, 2, sharey=True)
    most = float(abs(last["residual_stress"].sel(component="xx")).max())
    for traffic, axes in zip(data["traffic"].values, maps, strict=True):
        own = last.sel(traffic=traffic)
        lowest = own["pass_residual_min"].sel(component="xx")
        stress.semilogx(count, lowest, drawstyle="steps-post", label=traffic)
        strain.semilogx(count, own["pass_max_plastic_strain"], drawstyle="steps-post")
        section = own["residual_stress"].sel(component="xx").transpose("y", "z")
        image = axes.pcolormesh(
            section["z"], section["y"], section, cmap="RdBu_r", vmin=-most, vmax=most,
            rasterized=True,
        )  # fmt: skip
        axes.set_title(f"{traffic}, {count[-1]} passes", loc="left", fontsize=9, weight="bold")
        axes.set(xlabel="$z$ [mm]", xlim=(-25, 25))
        axes.set(aspect="equal", facecolor="0.86", ylim=(-12, 0.4))
    maps[0].set_ylabel("$y$ [mm]")
    bar = below.colorbar(image, ax=maps, shrink=0.9)
    bar.set_label("residual stress\n" r"$\sigma_{xx}$ [MPa]", fontsize=8)
    for axes in (stress, strain):
        axes.xaxis.set_major_formatter("{x:g}")
    stress.set(xlabel="passes", ylabel=r"lowest residual stress $\sigma_{xx}$ [MPa]")
    strain.set(xlabel="passes", ylabel="largest plastic strain", ylim=(0, None))
    stress.legend(frameon=False)
    return figure


if __name__ == "__main__":
    directory = sys.argv[1] if len(sys.argv) > 1 else computed()
    study = open_study(directory).squeeze(["friction", "hardening"])
    last = study.isel(passes=-1)
    lowest = last["pass_residual_min"].sel(component="xx").isel({"pass": -1})
    print(lowest.to_series())
    assert lowest.sel(traffic="mixed") < 1.5 * lowest.sel(traffic="equal") < 0
    drawn(study).savefig("wheel-rail-traffic.png")
