"""The scene files of `data/scenes`, solved, and the closed forms that they are held against."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from solver import Record
from studies.scenes.scene import read_scene
from tests.reference.cattaneo import SlidingCylinders
from tests.reference.persson import DiscInHole
from tests.verification.closed_forms import plane_strain_modulus

FOLDER = Path(__file__).parents[2] / "data/scenes"
E, NU = 2e5, 0.3


def changed(name: str, old: str, new: str, folder: Path) -> Path:
    """Return a folder with the scene files, of which one is changed."""
    for file in FOLDER.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    text = (FOLDER / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new))
    return folder


# -- fretting.toml: pressed, then a tangential force forth, back and forth again ----------------

# the pad is 160 mm wide and high: one of 20 mm bends, and its pressure is not quite even
PAD = {"width": 160.0, "radius": 200.0, "pressed_in": 0.012}
FRICTION, PUSH, BACK = 0.3, 80.0, -0.5
STAGES = ("pressed", "pushed", "back", "again")


def fretting(element: float, folder: Path = FOLDER) -> Record:
    """Return the record of the pad, with elements of this side [mm] in the contact."""
    scene = read_scene(folder / "fretting.toml")
    parameters = scene.parameters(tangential_force=PUSH, turned_to=BACK, element=element, **PAD)
    (record,) = scene.path(parameters, [None], lambda share: None)
    return record


def forces(record: Record, stage: str) -> tuple[float, float]:
    """Return normal force, and tangential force on the half-plane, at the end of a stage [N]."""
    at = np.argmin(np.abs(record.fields["increment_time"][1] - STAGES.index(stage) - 1))
    normal, tangential = (
        float(record.fields[f"contact_{kind}_force"][1][0, at]) for kind in ("normal", "tangential")
    )
    return normal, tangential


def cattaneo(record: Record, stage: str) -> SlidingCylinders:
    """Return the closed form for the normal force of a stage."""
    force, _ = forces(record, stage)
    modulus = plane_strain_modulus(E, NU) / 2
    return SlidingCylinders(force=force, radius=PAD["radius"], modulus=modulus, friction=FRICTION)


def shear(record: Record, stage: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return places, and the shear on the half-plane there: that found, that of the closed form."""
    x = record.fields["contact_x"][1][0]
    found = record.fields["contact_shear"][1][0, STAGES.index(stage)]
    (_, push), (_, now) = forces(record, "pushed"), forces(record, stage)
    curve = cattaneo(record, stage)
    return x, found, curve.reversed_shear(x, now, push) if stage == "back" else curve.shear(x, now)


# -- pin.toml ----------------------------------------------------------------------------------

RADIUS, YIELD = 10.0, 350.0


def pin(clearance: float, load_ratio: float, folder: Path = FOLDER) -> tuple[Record, DiscInHole]:
    """Return the record of the pin, and Persson's contact for it."""
    scene = read_scene(folder / "pin.toml")
    parameters = scene.parameters(clearance=clearance, load_ratio=load_ratio)
    (record,) = scene.path(parameters, [load_ratio], lambda share: None)
    exact = DiscInHole(
        force=load_ratio * YIELD * 2 * RADIUS,
        radius=RADIUS,
        clearance=clearance,
        modulus=plane_strain_modulus(E, NU),
    )
    return record, exact
