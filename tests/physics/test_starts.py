"""How runs start: laid on four contacts, standing, creeping, sliding, afloat and rolling, on any ground."""

import math
from dataclasses import replace

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.placing import standing_pose
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.support.errors import SimulationError
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

STAND = ConstantSteer(speed=0.0)
DRY = np.zeros((5, 6))
VEHICLES = {"amphibious": amphibious_vehicle(), "light 4x4": light_4x4()}


def ground(shape, spacing=0.05, half=3.0):
    """A field of heights from a function of x and y."""
    line = np.arange(-half, half + spacing, spacing)
    x, y = np.meshgrid(line, line)
    return Terrain(heights=shape(x, y), origin=(-half, -half), spacing=spacing, steepest=50.0)


def settled(vehicle, terrain, soil="LETE sand"):
    model = MultibodyVehicle(vehicle, Soil.published(soil), STAND, terrain, 5e-4, 0.5)
    start = model.settle(lambda states: DRY)
    return model, start


# -- laid on four contacts ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize(("angle", "direction"), [(0.0, 0.0), (0.2, 0.0), (0.3, 1.0), (-0.25, 2.5)])
def test_on_a_plane_all_four_wheels_touch(name, angle, direction):
    vehicle, plane = VEHICLES[name], replace(Terrain.slope(angle, direction), height=1.5)
    position, rotation = standing_pose(vehicle, plane)
    normal = plane.height_and_normal(0.0, 0.0)[1]
    distances = (position + vehicle.wheel_centers @ rotation.T - [0.0, 0.0, 1.5]) @ normal
    assert distances == pytest.approx(np.full(4, vehicle.wheel.radius), abs=1e-12)
    assert rotation[0, 0] > 0.8 and np.linalg.det(rotation) == pytest.approx(1.0)  # it heads along world x


UNEVEN = {
    "a ditch below the hull": lambda x, y: np.where(np.abs(x) < 0.15, -0.3, 0.0),
    "a ditch below the front axle": lambda x, y: np.where(np.abs(x - 0.357) < 0.15, -0.1, 0.0),
    "a step below one wheel": lambda x, y: np.where((x > 0.2) & (y > 0.1), 0.06, 0.0),
    "a crest along the path": lambda x, y: -0.3 * np.abs(y),
    "a bump between the wheels": lambda x, y: 0.3 * np.exp(-(x**2 + y**2) / 0.02),
    "waves": lambda x, y: 0.03 * np.sin(7.0 * x) * np.cos(5.0 * y),
}


@pytest.mark.parametrize("shape", UNEVEN)
def test_on_uneven_ground_no_tyre_begins_below_the_surface_and_it_settles(shape):
    vehicle, terrain = VEHICLES["amphibious"], ground(UNEVEN[shape])
    position, rotation = standing_pose(vehicle, terrain)
    for center in position + vehicle.wheel_centers @ rotation.T:
        height, normal = terrain.height_and_normal(*center[:2])
        assert center[2] - height - vehicle.wheel.radius / normal[2] > -1e-9
    model, start = settled(vehicle, terrain)
    assert start.kind == "at rest"
    assert model.loads[0]["soil_force"][:, 2].sum() == pytest.approx(9.81 * vehicle.mass, rel=2e-3)


def test_on_ground_that_no_pose_fits_no_tyre_begins_below_the_surface():
    """Heights drawn at random: the fit does not converge, and the vehicle is raised from where it ended."""
    vehicle = VEHICLES["amphibious"]
    for seed in range(40):
        heights = np.random.default_rng(seed).normal(0.0, 0.08, (41, 41))
        terrain = Terrain(heights=heights, origin=(-2.0, -2.0), spacing=0.1, steepest=50.0)
        position, rotation = standing_pose(vehicle, terrain)
        for center in position + vehicle.wheel_centers @ rotation.T:
            height, normal = terrain.height_and_normal(*center[:2])
            assert center[2] - height - vehicle.wheel.radius / normal[2] > -1e-9


# -- slopes ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "soil", "degrees", "direction"), [
    ("amphibious", "LETE sand", 14.0, 0.0), ("amphibious", "LETE sand", 15.0, 90.0),
    ("light 4x4", "LETE sand", -14.0, 0.0), ("amphibious", "North Gower clayey loam 46 %", 15.0, 0.0),
])  # fmt: skip
def test_slopes_that_the_soil_holds_are_stood_on(name, soil, degrees, direction):
    """A plane that rises by 14 degrees: the load has a component of a quarter of the weight along it."""
    vehicle = VEHICLES[name]
    model, start = settled(vehicle, Terrain.slope(math.radians(degrees), math.radians(direction)), soil)
    assert start.kind == "at rest"
    assert start.speed < vehicle.wheel.radius * 0.05  # creep, within the standstill band
    force = model.loads[0]["soil_force"].sum(axis=0)
    assert force == pytest.approx([0.0, 0.0, 9.81 * vehicle.mass], abs=2e-3 * 9.81 * vehicle.mass)


@pytest.mark.parametrize(("soil", "degrees"), [("LETE sand", 20.0), ("Upland sandy loam 51 %", 15.0)])
def test_slopes_that_are_held_by_creep_alone_start_as_they_creep(soil, degrees):
    model, start = settled(VEHICLES["amphibious"], Terrain.slope(math.radians(degrees)), soil)
    assert start.kind == "creeping"
    begin = model.present().position[0, 0]
    model.advance(0.5, DRY)
    way = begin - model.present().position[0, 0]
    assert way[0] > 0.0 and way[2] > 0.0  # down the slope
    assert np.linalg.norm(way) < 0.005  # at the speed of creep, not in free fall (0.4 m)


def test_a_slope_beyond_friction_is_slid_down(caplog):
    """Without cohesion the strength is the load times tan(20 deg): 30 degrees are not held."""
    slippery = replace(
        Soil.published("Heavy clay 25 %"), cohesion=0.0, friction_angle=math.radians(8.0), c1=0.4, c2=0.2, n=0.5
    )
    run = simulate(
        VEHICLES["amphibious"], slippery, None, STAND, terrain=Terrain.slope(math.radians(30.0)), duration=0.5
    )
    assert run.attrs["start"] == "sliding" and "moves off at once" in caplog.text
    along = run["velocity"].sel(body="hull", axis="x").values
    assert abs(along[0]) < 1e-9 and along[-1] < -0.5  # at rest first; 0.5 s at about g (sin 30 - cos 30 tan 8) = 3.7


# -- water -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("depth", "speed", "direction"), [
    (0.30, 1.0, 90.0), (0.20, 2.0, 90.0), (0.45, 1.5, 180.0), (1.5, 0.5, 30.0),
])  # fmt: skip
def test_any_water_can_be_started_in(vehicle, sand, depth, speed, direction):
    """Afloat, swept from the side, submerged: the run begins, at rest, and goes where the water takes it."""
    water = Water(depth, speed, math.radians(direction))
    run = simulate(vehicle, sand, water, STAND, CoefficientHydrodynamics(), duration=0.3)
    hull = run["position"].sel(body="hull")
    assert np.abs(run["velocity"].sel(body="hull").isel(time=0)).max() < 5e-3
    assert np.isfinite(hull).all() and run.attrs["status"] == "completed"
    flow = [math.cos(math.radians(direction)), math.sin(math.radians(direction))]
    if speed and run.attrs["start"] == "sliding":
        way = (hull.isel(time=-1) - hull.isel(time=0)).sel(axis=["x", "y"]).values @ flow
        assert 0.0 < way < speed * 0.3


def test_afloat_the_vehicle_starts_at_its_draught(vehicle, sand):
    """Archimedes: the water bears the weight, the wheels nothing."""
    run = simulate(vehicle, sand, Water(0.35), STAND, CoefficientHydrodynamics(), duration=0.1)
    lift = float(run["water_load"].isel(time=0).sel(axis="z").sum())
    assert lift == pytest.approx(9.81 * vehicle.mass, rel=2e-3)


# -- in motion ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("maneuver", [ConstantSteer, LaneChange])
def test_a_rolling_start_goes_on_as_it_began(name, maneuver, sand):
    """Wheels that turn at 10 rad/s from the beginning: no jolt but the rolling resistance, no slip to speak of."""
    vehicle = VEHICLES[name]
    run = simulate(vehicle, sand, None, maneuver(speed=10.0, start_speed=10.0), duration=0.2)
    speed = run["forward_velocity"].values
    assert speed[0] == pytest.approx(10.0 * vehicle.wheel.radius, rel=1e-3)
    assert speed[-1] == pytest.approx(speed[0], rel=0.15)
    assert run["wheel_speed"].values == pytest.approx(np.full((21, 4), 10.0), abs=1e-6)
    assert float(run["constraint_error"].max()) < 1e-6


def test_a_rolling_start_follows_the_slope(vehicle, sand):
    run = simulate(vehicle, sand, None, ConstantSteer(start_speed=10.0), terrain=Terrain.slope(0.15), duration=0.06)
    velocity = run["velocity"].sel(body="hull").isel(time=0).values
    assert velocity[2] / velocity[0] == pytest.approx(math.tan(0.15), abs=0.01)


@pytest.mark.parametrize("name", VEHICLES)
def test_an_initial_speed_turns_the_wheels_to_roll(name, sand):
    """Whatever the maneuver's wheels do later: here they brake to a stop within a second."""
    vehicle = VEHICLES[name]
    run = simulate(vehicle, sand, None, STAND, initial_speed=1.0, duration=0.1)
    assert run["forward_velocity"].values[0] == pytest.approx(1.0, abs=1e-3)
    assert run["wheel_speed"].values[0] == pytest.approx(np.full(4, 1.0 / vehicle.wheel.radius), rel=1e-9)
    assert (np.diff(run["wheel_speed"].values[:, 0]) < 0.0).all()


def test_a_maneuver_that_does_not_fit_the_initial_speed_is_refused(vehicle, sand):
    with pytest.raises(ValueError, match=r"turn at 5 rad/s at time 0 .* 0\.5 m/s, .*initial_speed = 1 m/s"):
        simulate(vehicle, sand, None, ConstantSteer(start_speed=5.0), initial_speed=1.0)


def test_what_nothing_holds_is_held_in_its_place_until_the_release(vehicle, sand):
    """Afloat in a current from the side, and on a slope beyond friction: within millimetres of where it was laid."""
    run = simulate(vehicle, sand, Water(0.24, 1.0, math.pi / 2), STAND, CoefficientHydrodynamics(), duration=0.1)
    hull = run["position"].sel(body="hull").isel(time=0).values
    assert run.attrs["start"] == "afloat" and np.abs(hull[:2]).max() < 2e-3
    model, start = settled(vehicle, Terrain.slope(math.radians(45.0)))
    down = np.array([math.cos(math.radians(45.0)), 0.0, math.sin(math.radians(45.0))])
    laid = MultibodyVehicle(vehicle, sand, STAND, Terrain.slope(math.radians(45.0)), 5e-4, 0.5).present()
    assert start.kind == "sliding" and abs((model.present().position - laid.position)[0, 0] @ down) < 2e-3


def test_a_start_in_motion_resumes_with_the_same_bits(vehicle, sand, tmp_path):
    arguments = dict(duration=0.2, hydrodynamics=CoefficientHydrodynamics(), initial_speed=0.8)
    water, maneuver = Water(0.12, 0.5), ConstantSteer()

    def stop(time):
        if time > 0.09:
            raise KeyboardInterrupt

    whole = simulate(vehicle, sand, water, maneuver, **arguments)
    file = tmp_path / "run.npz"
    with pytest.raises(KeyboardInterrupt):
        simulate(vehicle, sand, water, maneuver, **arguments, checkpoint=file, progress=stop)
    resumed = simulate(vehicle, sand, water, maneuver, **arguments, checkpoint=file, resume=True)
    assert (resumed["position"] == whole["position"]).all() and resumed.attrs["start"] == whole.attrs["start"]
    with pytest.raises(ValueError, match="initial_speed differ"):
        simulate(vehicle, sand, water, maneuver, **(arguments | {"initial_speed": 0.5}), checkpoint=file, resume=True)


def test_a_soil_that_is_too_soft_is_still_said(vehicle):
    with pytest.raises(SimulationError, match="while settling, a wheel has sunk to its centre"):
        settled(vehicle, Terrain(), "Snow (US)")


@pytest.mark.parametrize(("angle", "slides"), [(5.0, False), (20.0, True)])
def test_a_vehicle_that_slides_while_it_settles_says_how_far(angle, slides, caplog):
    """Across a slope: its path begins where it came to rest."""
    vehicle, terrain = VEHICLES["amphibious"], Terrain.slope(math.radians(angle), 0.5 * math.pi)
    run = simulate(vehicle, Soil.published("LETE sand"), None, STAND, duration=0.1, terrain=terrain)
    place, turn = standing_pose(vehicle, terrain)
    laid = (place + vehicle.wheel_centers @ turn.T).mean(axis=0)
    slid = float(np.hypot(*(run["position"].values[0, 1:].mean(axis=0) - laid)[:2]))
    assert (f"while it settled it slid by {slid:.2g} m" in caplog.text) == slides
    assert (slid > 0.02 * vehicle.wheelbase) == slides
