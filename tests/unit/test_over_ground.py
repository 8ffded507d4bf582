"""Clearance under the whole hull, and what leaves the field of heights."""

import dataclasses
import logging

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

import exumob.simulation.run
from exumob.driving.maneuver import lane_change
from exumob.ground.terrain import Terrain
from exumob.simulation.over_ground import keel_clearance, outside_terrain, warn_of_ground
from exumob.simulation.run import simulate
from exumob.vehicle.motion import BODIES, BodyStates
from exumob.water.wetted_surface import hull_triangles


def standing(vehicle, places=((0.0, 0.0),), turned=(0.0, 0.0, 0.0), raised=0.0):
    """States at ride height at some places; yaw, pitch and roll [rad]."""
    n = len(places)
    rotation = np.tile(Rotation.from_euler("ZYX", turned).as_matrix(), (n, 5, 1, 1))
    position = np.zeros((n, 5, 3))
    position[:, 0] = vehicle.hull_origin
    position[:, 0, 2] += raised
    position[:, 1:] = vehicle.wheel_centers
    position[:, :, :2] += np.array(places)[:, None]
    rest = (np.zeros((n, 5, 3)) for _ in range(4))
    return BodyStates(0.01 * np.arange(n), position, rotation, *rest, np.zeros((n, 4)))


def field(height, spacing, low=-2.0, high=2.0, steepest=1000.0):
    """Field of heights over a square from a function of x and y."""
    ends = np.arange(round((high - low) / spacing) + 1) * spacing + low
    x, y = np.meshgrid(ends, ends)
    return Terrain(heights=height(x, y), origin=(low, low), spacing=spacing, steepest=steepest)


def ridge(x, y):
    """A ridge of 0.12 m between the wheels, which the corners of the hull do not meet."""
    return 0.12 * np.exp(-((x / 0.06) ** 2)) * (np.abs(y) < 0.15)


def by_points(vehicle, terrain, states, count=60):
    """Least height of points all over the hull, close together."""
    triangles = hull_triangles(vehicle)
    share = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
    points = np.concatenate([a + share @ np.stack([b - a, c - a]) for a, b, c in triangles])
    placed = points @ states.rotation[0, 0].T + states.position[0, 0]
    return min(z - terrain.height_and_normal(x, y)[0] for x, y, z in placed)


@pytest.mark.parametrize(
    ("terrain", "expected"),
    [
        (Terrain(), 0.078),
        (Terrain(height=0.02), 0.058),
        (Terrain(slope_x=0.1), 0.078 - 0.1 * 0.38),  # below the foremost point of the flat keel
        (field(ridge, 0.02), 0.078 - 0.12),
        (field(ridge, 0.005), 0.078 - 0.12),
        (field(lambda x, y: 0.12 * np.isclose(x, 0.1) * np.isclose(y, 0.0), 0.05), 0.078 - 0.12),  # a single point
        (field(lambda x, y: 0.1 - 0.2 * np.abs(x), 1.0), 0.078 - 0.1),  # points further apart than the hull is long
        (field(lambda x, y: -0.5 + 0.0 * x, 0.5), 0.578),
    ],
)
def test_clearance_of_the_box(vehicle, terrain, expected):
    assert keel_clearance(vehicle, terrain, standing(vehicle))[0] == pytest.approx(expected, abs=1e-12)


def test_follows_the_vehicle_over_the_ridge(vehicle):
    """On the ridge from before the bow to behind the stern: the rake of the bow clears it longer than the keel."""
    places = np.column_stack([np.linspace(-0.8, 0.8, 161), np.zeros(161)])
    found = keel_clearance(vehicle, field(ridge, 0.01), standing(vehicle, places))
    assert found[[0, -1]] == pytest.approx(0.078, abs=1e-6)
    assert found.min() == pytest.approx(0.078 - 0.12, abs=1e-12)
    bow, stern = vehicle.hull.length / 2.0, -vehicle.hull.length / 2.0
    under = (places[:, 0] + bow > 0.03) & (places[:, 0] + stern < -0.03)
    keel = places[:, 0] + bow - vehicle.hull.bow_length > 0.0
    assert found[under & keel] == pytest.approx(0.078 - 0.12, abs=1e-12)
    assert found[under & ~keel].max() > 0.078 - 0.12 + 0.01


@pytest.mark.parametrize("turned", [(0.3, 0.0, 0.0), (0.5, 0.1, 0.0), (-1.0, -0.08, 0.12), (2.0, 0.3, 1.0)])
@pytest.mark.parametrize("spacing", [0.03, 0.4])
def test_equals_points_all_over_a_tilted_hull(vehicle, spacing, turned):
    rng = np.random.default_rng(2)
    a, b, c, d = rng.uniform(2.0, 6.0, 4)
    bumps = field(lambda x, y: 0.04 * np.sin(a * x + b * y) + 0.03 * np.cos(c * x - d * y), spacing)
    states = standing(vehicle, [(0.137, -0.241)], turned, raised=0.05)
    found = keel_clearance(vehicle, bumps, states)[0]
    assert found == pytest.approx(by_points(vehicle, bumps, states), abs=2e-3)


@pytest.mark.parametrize("turned", [(0.0, 0.0, 0.0), (0.4, 0.15, 0.0), (1.2, -0.1, 0.2)])
@pytest.mark.parametrize("spacing", [(0.05, 1000.0), (0.3, 40.0), (1000.0, 0.05)])
def test_ground_that_is_alike_across_is_as_if_given_finely(vehicle, spacing, turned):
    """Points a kilometre apart one way, as of a cross-section: as by points all over the hull."""
    along = 0 if spacing[0] < spacing[1] else 1
    ends = [round(4.0 / step) if step < 1.0 else 1 for step in spacing]
    low = [-2.0 if step < 1.0 else -0.4 * step for step in spacing]
    places = [start + step * np.arange(count + 1) for start, step, count in zip(low, spacing, ends, strict=True)]
    rise = 0.08 * np.cos(3.0 * places[along])
    heights = np.tile(rise, (2, 1)) if along == 0 else np.tile(rise[:, None], (1, 2))
    ground = Terrain(heights=heights, origin=tuple(low), spacing=spacing)
    states = standing(vehicle, [(0.137, -0.241)], turned, raised=0.05)
    found = keel_clearance(vehicle, ground, states)[0]
    assert found == pytest.approx(by_points(vehicle, ground, states), abs=2e-3)


def test_clearance_of_a_mesh(vehicle, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    bowl = trimesh.creation.icosphere(3)
    bowl.apply_scale((0.5, 0.22, 0.1))
    bowl.apply_translation((0.0, 0.0, 0.178))
    bowl.export(tmp_path / "hull.stl")
    round_hull = dataclasses.replace(vehicle, hull=dataclasses.replace(vehicle.hull, mesh=tmp_path / "hull.stl"))
    states = standing(round_hull)
    lowest = float(bowl.vertices[:, 2].min())
    assert keel_clearance(round_hull, Terrain(), states)[0] == pytest.approx(lowest, abs=1e-7)
    assert keel_clearance(round_hull, field(ridge, 0.01), states)[0] == pytest.approx(lowest - 0.12, abs=1e-3)
    off_middle = field(lambda x, y: ridge(x - 0.3, y), 0.01)
    found = keel_clearance(round_hull, off_middle, states)[0]
    assert found == pytest.approx(by_points(round_hull, off_middle, states, 8), abs=1e-3)
    assert found > keel_clearance(vehicle, off_middle, states)[0] + 0.01


def test_a_hull_that_is_nowhere_has_no_clearance(vehicle):
    states = standing(vehicle, [(0.0, 0.0), (np.nan, 0.0), (np.inf, 0.0), (1e9, -1e9)])
    found = keel_clearance(vehicle, field(ridge, 0.02), states)
    assert found == pytest.approx([0.078 - 0.12, np.nan, np.nan, 0.078], nan_ok=True)


def test_marks_what_is_outside(vehicle):
    ground = field(lambda x, y: 0.0 * x, 0.5)
    found = outside_terrain(vehicle, ground, standing(vehicle, [(0.0, 0.0), (1.6, 0.0), (1.7, 0.0), (0.0, -3.0)]))
    outside = {name: found[:, BODIES.index(name)].tolist() for name in ("hull", "front_left", "rear_right")}
    assert outside == {
        "hull": [False, True, True, True], "front_left": [False, False, True, True],
        "rear_right": [False, False, False, True],
    }  # fmt: skip
    assert not outside_terrain(vehicle, Terrain(slope_x=0.1), standing(vehicle, [(1e6, 0.0)])).any()


def test_warns_with_depth_time_and_body(vehicle, caplog):
    states = standing(vehicle, [(-1.0, 0.0), (0.0, 0.0), (1.7, 0.0)])
    ground = field(ridge, 0.02)
    run = xr.Dataset(
        {
            "keel_clearance": ("time", keel_clearance(vehicle, ground, states)),
            "hull_load_share": ("time", [0.0, 0.37, 0.0]),
            "outside_terrain": (("time", "body"), outside_terrain(vehicle, ground, states).astype(np.int8)),
        },
        {"time": states.time},
    )
    with caplog.at_level(logging.WARNING):
        warn_of_ground(vehicle, run)
    keel, edge = (record.message for record in caplog.records)
    assert "first at 0.01 s; it bore up to 37 % of the weight, and sank in by up to 42.0 mm" in keel
    assert "left the field of heights at 0.02 s (hull, front left, front right)" in edge
    caplog.clear()
    warn_of_ground(vehicle, run.isel(time=slice(0, 1)))
    warn_of_ground(vehicle, run.isel(time=slice(0, 0)))
    assert not caplog.records


@pytest.mark.parametrize(
    ("origin", "message"),
    [
        ((456_789.0, 5_432_101.0), "subtract the place of the start from map coordinates"),
        ((0.0, -2.0), "from x = 0 to 4 m .* does not hold the vehicle at its start, x = -0.5 to 0.5 m"),
        ((-0.4, -2.0), "pad it"),
        ((-2.0, -0.3), "from y = -0.3 to 3.7 m"),
    ],
)
def test_a_field_that_does_not_hold_the_start_is_refused(vehicle, sand, origin, message, monkeypatch):
    monkeypatch.delattr(exumob.simulation.run, "MultibodyVehicle")  # nothing may run
    ground = Terrain(heights=np.zeros((41, 41)), origin=origin, spacing=0.1)
    with pytest.raises(ValueError, match=message):
        simulate(vehicle, sand, None, lane_change(), duration=0.1, terrain=ground)


def test_a_run_says_what_is_below_it(vehicle, sand, caplog):
    """The ridge lies under the rolling vehicle; the field ends 10 mm before it."""
    ahead = field(lambda x, y: ridge(x - 0.2, y), 0.02)
    ground = Terrain(heights=ahead.heights[:, :127], origin=(-2.01, -2.0), spacing=0.02, steepest=9.0)
    with caplog.at_level(logging.WARNING):
        run = simulate(
            vehicle, sand, None, lane_change(), duration=0.4, micro_step=5e-4, macro_step=20e-3, terrain=ground,
            initial_speed=0.6,
        )  # fmt: skip
    assert -0.02 < float(run["keel_clearance"][0]) < 0.0  # the hull stands on the ridge
    assert 0.2 < float(run["hull_load_share"][0]) < 0.95
    assert "the hull touched the ground, first at 0.00 s" in caplog.text
    outside = run["outside_terrain"].sel(body="hull").values
    moved = run["position"].sel(body="hull", axis="x").values + 0.5 > 0.51
    assert (outside == 1).any()
    assert (outside == moved).mean() > 0.9
    assert f"left the field of heights at {float(run['time'][np.argmax(outside)]):.2f} s (hull)" in caplog.text


def test_clearance_over_a_field_that_is_turned(vehicle):
    """Hull and field turned together, on a plane that is turned back: the same clearance and the same ends, 1e-9 m."""
    angle, place = 0.8, np.array([40.0, -30.0])
    straight = dataclasses.replace(field(ridge, 0.02), slope_x=0.03, height=0.1)
    states = standing(vehicle, [(0.1, 0.05)], (0.3, 0.02, -0.01))
    about = Rotation.from_euler("z", angle).as_matrix()
    turned = dataclasses.replace(
        straight, direction=angle, origin=tuple(place + about[:2, :2] @ np.array(straight.origin)),
        slope_x=0.03 * np.cos(angle), slope_y=0.03 * np.sin(angle),
        height=0.1 - 0.03 * float(place @ about[:2, 0]),
    )  # fmt: skip
    moved = dataclasses.replace(
        states, position=states.position @ about.T + [*place, 0.0], rotation=about @ states.rotation
    )
    expected = keel_clearance(vehicle, straight, states)
    assert expected[0] < 0.03
    np.testing.assert_allclose(keel_clearance(vehicle, turned, moved), expected, atol=1e-9)
    far = dataclasses.replace(moved, position=moved.position + about @ [1.7, 0.0, 0.0])
    np.testing.assert_array_equal(outside_terrain(vehicle, turned, far)[0], [True, True, True, False, False])
