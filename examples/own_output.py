"""Add an output to a scene of the package: the depth to which the half-plane has yielded.

Run it with ``python examples/own_output.py``. Name, meaning and unit of the result are declared
once. Data sets and pictures read this declaration.
"""

from dataclasses import replace

import numpy as np

from solver import SCENES, Status
from solver.results.quantities import QUANTITIES, declare
from solver.results.run import FinishedRun, Values

PUNCH = SCENES["punch"]

YIELDED_DEPTH = declare(
    "yielded_depth", "depth to which the half-plane has yielded below the middle of the punch", "mm"
)


def yielded_depth(run: FinishedRun) -> Values:
    """Return the largest depth [mm] with plastic strain at the first station, x = 0."""
    strain = run.samples.profile("plastic_strain", run.unloaded)  # over station and depth
    yielded = run.view.depth[strain[0] > 1e-6]
    return {YIELDED_DEPTH: float(yielded.max(initial=0.0))}


# A scene with a new name; studies can use it once it is in SCENES.
scene = replace(PUNCH, name="punch_depth", outputs=(*PUNCH.outputs, yielded_depth))
SCENES[scene.name] = scene

# A scene computes several values of its branch parameter, here the load, on one path.
coarse = scene.parameters(smallest_element=0.05, growth=2.5, load_step=0.15, hardening="isotropic")
records = list(scene.path(coarse, values=[0.6, 1.2, 1.4], monitor=lambda fraction: None))

known = QUANTITIES["yielded_depth"]
print(f"{known.long_name} [{known.units}]")
for record in records:
    assert record.status is Status.OK, record.message
    print(f"load ratio {record.parameters.load_ratio}: {record.scalars['yielded_depth']:.1f}")

depths = np.array([record.scalars["yielded_depth"] for record in records])
assert depths[0] == 0.0, "at this load only the corner yields"
assert (np.diff(depths) > 0).all(), "the more load, the deeper"
assert depths[-1] < coarse.half_plane_size * coarse.half_width
