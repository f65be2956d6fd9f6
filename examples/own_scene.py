"""Define a scene: a block pressed in a die and released.

The die keeps the width of the block constant. Under pressure the block yields; after unloading the
die still presses on its sides. Without hardening this stress is known in closed form, and the sweep
is compared with it.

Run it with ``python examples/own_scene.py``; it writes runs and data set to the directory ``die``.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver import SCENES, Body, Model, Program, Scene, Status
from solver.loading.program import load_and_release
from solver.mesh import grid
from solver.parameters import Length, Ratio, described
from solver.results.figures import cost, extremes
from solver.results.maps import maps, profiles
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.view import View
from solver.scenes.material_parameters import MaterialParameters
from studies import Store, Study, open_study, run_study


@dataclass(frozen=True, slots=True, kw_only=True)
class DieParameters(MaterialParameters):
    """Parameters of the block (N, mm, MPa); the parameters of its material are inherited."""

    load_ratio: Ratio = described(2.0, "ratio of the pressure on the block to the yield stress")
    width: Length = described(20.0, "width of the block")
    height: Length = described(10.0, "height of the block")
    element_size: Length = described(2.5, "side of an element")
    load_step: Annotated[float, Interval(ge=1e-4, le=1.0), Unit("1")] = described(
        0.25, "largest increment of load_ratio"
    )
    # to check combinations of fields write __post_init__: first call
    # MaterialParameters.__post_init__(self), then raise ModelError(field, value, allowed)


def model(parameters: DieParameters) -> Model:
    """Return one half of the block: the die holds its right side, symmetry its left side."""
    half, size = parameters.width / 2, parameters.element_size
    across = np.linspace(0.0, half, 1 + max(1, round(half / size)))
    down = np.linspace(-parameters.height, 0.0, 1 + max(1, round(parameters.height / size)))
    block = Body(
        name="block",
        mesh=grid(across, down),
        material=parameters.material(),
        supports={"left": "x", "right": "x", "bottom": "y"},
        pressure={
            "top": parameters.yield_stress
        },  # times the load factor, which increases to load_ratio
    )
    return Model(bodies=(block,))


def program(parameters: DieParameters) -> Program:
    """Return the history: stage ``loaded``, then stage ``unloaded`` in five increments."""
    return load_and_release(parameters.load_ratio, parameters.load_step, unload_steps=5)


def view(parameters: DieParameters) -> View:
    """Return the positions of results: they depend on the size of the block, not on its mesh."""
    return View(
        x=parameters.width / 2 * (np.arange(20) + 0.5) / 20,
        y=-parameters.height * (np.arange(20) + 0.5) / 20,
        depth=parameters.height * np.linspace(0.0, 1.0, 11),
        station=np.array([0.0]),
        s=parameters.width / 2 * np.linspace(0.0, 1.0, 11),
        profile_body="block",
        surfaces={"block": "top"},
        symmetric=True,  # pictures add the other half
    )


SIDE_PRESSURE = declare("side_pressure", "pressure of the die on the sides after unloading", "MPa")


def side_pressure(run: FinishedRun) -> Values:
    """Return the mean pressure on the side that the die holds [MPa]."""
    side = run.system.full("block").boundary_nodes("right")
    return {
        SIDE_PRESSURE: -float(
            run.samples.fields.at_nodes(run.unloaded, "block").stress[0, side].mean()
        )
    }


SCENES["die"] = Scene(
    name="die",
    summary="a block pressed in a die, and released",
    parameters=DieParameters,
    branch="load_ratio",
    model=model,
    program=program,
    view=view,
    outputs=(maps, profiles, extremes, side_pressure),
    costs=(cost,),
    advice={Status.NOT_CONVERGED: "reduce load_step"},
)

# Worker processes import this script to get the scene. Without this line each of them would start
# the study.
if __name__ == "__main__":
    study = Study.from_dict(
        {"name": "die", "scene": "die", "sweep": {"load_ratio": [1.0, 2.0, 3.0], "width": [20, 40]}}
    )
    outcome = run_study(study, Store("die"), workers=1)
    assert outcome.ok, outcome.failed
    with open_study("die") as dataset:
        found = dataset["side_pressure"].squeeze("hardening")
        print(found.to_pandas().round(2).to_string())
        assert found.attrs["units"] == "MPa"
        # Below first yield the side carries nu / (1 - nu) of the pressure p; beyond it, p - Y.
        # Unloading is elastic: the difference remains.
        p, Y, nu = 350.0 * found["load_ratio"], 350.0, 0.3
        elastic = nu / (1 - nu) * p
        np.testing.assert_allclose(
            found, (np.maximum(p - Y, elastic) - elastic).broadcast_like(found), atol=1e-6 * Y
        )
