"""A ford, wherever it lies on the map: banks of 15 %, a bottom 0.12 m under water and 0.8 m wide.

The current flows to the left of the path, in proportion to the depth to the power 2/3.
"""

import math

import numpy as np

from exumob.ground.terrain import Terrain
from exumob.vehicle.start_pose import StartPose
from exumob.water.conditions import Water
from exumob.water.water_field import WaterField

DEPTH = 0.12
X = np.arange(-3.0, 9.01, 0.1)
BANK = (DEPTH + 0.045) / 0.15  # [m], long
BED = np.interp(X, [0.9, 0.9 + BANK, 1.7 + BANK, 1.7 + 2.0 * BANK], [0.045, -DEPTH, -DEPTH, 0.045])


def ford(x=0.0, y=0.0, z=0.0, heading=0.0, speed=0.3, **options):
    """Terrain, water and start of the ford, moved and turned about the start."""
    start = StartPose(x, y, heading)
    origin = tuple(start.to_world([X[0], -4.0]).tolist())
    depth = np.maximum(-BED, 0.0)
    across = np.tile(speed * (depth / DEPTH) ** (2.0 / 3.0), (9, 1))
    field = WaterField(
        np.full(across.shape, z), -math.sin(heading) * across, math.cos(heading) * across, origin, (0.1, 1.0), heading,
        **options,
    )  # fmt: skip
    terrain = Terrain(z, heights=np.tile(BED, (9, 1)), origin=origin, spacing=(0.1, 1.0), direction=heading)
    return {"terrain": terrain, "water": Water(field=field), "start": start}


def seen_from_start(run, x=0.0, y=0.0, z=0.0, heading=0.0):
    """Positions in axes that begin at the start and head as it does."""
    c, s = math.cos(heading), math.sin(heading)
    return (run["position"].values - [x, y, z]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
