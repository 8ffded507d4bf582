"""Windows round vehicles: what lies on faces of the grid."""

import numpy as np
import pytest

from exumob.flow import Grid
from exumob.flow.vehicle_window import vehicle_window
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car


def off_faces(faces, places):
    """Distance of places from the nearest face, over the least width."""
    return np.abs(faces[:, None] - places).min(axis=0) / np.diff(faces).min()


@pytest.mark.parametrize("vehicle", [amphibious_vehicle(), small_car(), light_4x4(), large_4x4()], ids=lambda v: v.name)
@pytest.mark.parametrize("part", [0.061, 0.09, 0.112, 0.23])
def test_hull_lies_on_faces_when_asked(vehicle, part):
    """Bow, stern and sides do, on cells near the size asked for, in a window no smaller than without."""
    size, water = part * vehicle.wheel.diameter, Water(0.5 * vehicle.wheel.diameter)
    low, high = (end - vehicle.hull_origin for end in vehicle.hull.extent)
    plain, fitted = (vehicle_window(vehicle, size, water, hull_on_faces=asked) for asked in (False, True))
    for axis, (faces, before) in enumerate(((fitted.x_faces, plain.x_faces), (fitted.y_faces, plain.y_faces))):
        assert off_faces(faces, np.array([low[axis], high[axis]])).max() < 1e-9
        assert abs(np.diff(faces).min() / size - 1.0) < 0.5 / round((high[axis] - low[axis]) / size) + 1e-9
        assert faces[0] < before[1]  # what was asked lies within the outermost cell
        assert faces[-1] > before[-2]
    assert np.abs(fitted.y_faces + fitted.y_faces[::-1]).max() < 1e-12, "mirrored runs need a mirrored grid"
    assert np.array_equal(fitted.z_faces, plain.z_faces)


def test_hull_need_not_lie_on_faces():
    """The shipped data were made where the hull lies anywhere: that stays the default, to the last bit."""
    vehicle = amphibious_vehicle()
    low, _ = (end - vehicle.hull_origin for end in vehicle.hull.extent)
    grid = Grid.around_vehicle(vehicle, 0.018)
    assert np.array_equal(grid.x_faces, Grid.around_vehicle(vehicle, 0.018, hull_on_faces=False).x_faces)
    assert off_faces(grid.x_faces, low[:1]) > 0.25


def test_hull_that_is_lost_in_a_cell_stays_there():
    """A cell larger than the hull is not made smaller for it."""
    vehicle = amphibious_vehicle()
    wide = Grid.around_vehicle(vehicle, 0.9, ahead=9.0, behind=9.0, aside=9.0, top=6.0, core_top=5.0)
    fitted = Grid.around_vehicle(
        vehicle, 0.9, ahead=9.0, behind=9.0, aside=9.0, top=6.0, core_top=5.0, hull_on_faces=True
    )
    assert np.array_equal(fitted.y_faces, wide.y_faces)
