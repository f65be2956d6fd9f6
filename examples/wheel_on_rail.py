"""A wheel rolls once over a rail: contact, plastic strain and residual stress in three dimensions.

Run it with ``python examples/wheel_on_rail.py``. The wheel S1002 and the rail 60E1 are those of the
thesis, on elements of 2 mm; with ``size = spacing = 1.0`` its figures settle.
"""

import numpy as np

from solver import Coulomb, Material
from solver.rolling.load import RollingLoad
from solver.rolling.passing import passing
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.wheel_profile import s1002
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack

size = spacing = 2.0
steel = Material(
    youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=502.0,
    hardening="kinematic", hardening_ratio=0.0196,
)  # fmt: skip

# The rail is canted by 1:40 and stands on springs of 21 N/mm for each mm along it.
zone = Zone(at=-2.0, half_width=14.0, depth=12.0, size=size)
mesh = rail_mesh(rail_60e1().canted(1 / 40), zone)
foundation = (21 / 150, 21 / 150, 21 / 150)
section = Section(mesh, steel.elasticity, springs={"foot": foundation})
middle = section.points.mean(axis=2)
yields = (section.weights.sum(axis=1) < 1.5 * size**2) & (middle[1] > -zone.depth - 2.0)
track = PrismTrack(
    section, yields, "running", length=64.0, spacing=spacing, ahead=20.0, behind=24.0, reach=9.0,
    levels=3,
)  # fmt: skip

# The running circle of the wheel is 4 mm beside the axis of the rail; it rolls freely.
wheel = ProfiledWheel(
    profile=lambda z: s1002().height(z + 4.0), radius=460.0, elasticity=steel.elasticity
)
load = RollingPatch(
    grid=track.grid, compliance=track.compliance, wheel=wheel, friction=Coulomb(friction=0.17),
    load=RollingLoad(force=150e3, drive=0.0),
)  # fmt: skip
found = passing(track, steel, load, track.virgin(steel))

contact, left = found.loading.contact, found.after
strain = left.strain - left.plastic_strain
residual = steel.stiffness(6) @ strain.T
z, y = track.points
deepest = y[residual[0].argmin()]
print(f"largest pressure {contact.pressure.max():.0f} MPa, creepage {contact.creepage:.5f}")
print(f"plastic strain {left.accumulated.max():.5f}")
print(f"lowest residual stress along the rail {residual[0].min():.0f} MPa, {-deepest:.1f} mm deep")
assert np.isclose(contact.force[1], -150e3)
assert 900 < contact.pressure.max() < 1100
assert -60 < residual[0].min() < -20 and -6 < deepest < -3
