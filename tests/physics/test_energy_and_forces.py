"""What a run must conserve: energy, forces and moments body by body, symmetry, and the sense of driving."""

import math

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer, LaneChange, lane_change
from exumob.ground.terrain import Terrain
from exumob.multibody.system import MultibodyVehicle
from exumob.simulation.run import simulate
from exumob.simulation.summary import energy_residual, force_residual
from exumob.support.constants import GRAVITY
from vehicle_models.light_4x4 import light_4x4

WEIGHT = 57.0 * GRAVITY
RUNS = ["dry_run", "wet_run", "mirrored_wet_run"]


@pytest.mark.parametrize("run", RUNS)
def test_energy_balance_closes(run, request):
    """Spec: to 1 % of the spin work, at every instant."""
    dataset = request.getfixturevalue(run)
    spin = float(dataset["work"].sel(work_kind="spin")[-1])
    assert spin > 100.0
    assert float(np.abs(energy_residual(dataset)).max()) < 0.01 * spin


def test_energy_residual_is_what_it_says(wet_run):
    """By hand: the energy balance of the spec with each term taken from the motion or integrated from forces.

    Kinetic energy from masses and velocities, height from positions; soil and water from force times velocity by
    Simpson's rule every 10 ms: 1 % of the spin work.
    """
    time, velocity = wet_run["time"].values, wet_run["velocity"].values
    spin_work = float(wet_run["work"].sel(work_kind="spin")[-1])

    def work(power):
        return 0.01 * (power.sum() - 0.5 * (power[0] + power[-1]))

    assert len(time) == 801
    spin = work(wet_run["spin_power"].sum("wheel").values)
    assert spin == pytest.approx(spin_work, rel=2e-3)
    rates = wet_run["angular_velocity"].values
    axles = axle_directions(wet_run)
    soil_power = (wet_run["soil_force"].values * velocity[:, 1:]).sum((1, 2))
    moment = wet_run["soil_moment"].values
    soil_power += (moment * rates[:, 1:]).sum((1, 2))
    soil_power += ((moment * axles).sum(-1) * wet_run["wheel_speed"].values).sum(-1)
    assert work(soil_power) == pytest.approx(float(wet_run["work"].sel(work_kind="soil")[-1]), abs=0.01 * spin_work)
    assert soil_power.max() < 1.0  # soil takes energy; elastic recovery of sinkage may give a little back


def axle_directions(dataset):
    """World direction of +y of each wheel's upright."""
    w, x, y, z = np.moveaxis(dataset["quaternion"].values[:, 1:], -1, 0)
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=-1)


def test_kinetic_energy_is_that_of_the_bodies(dry_run, vehicle):
    """From velocities and rates of hull, uprights and spinning wheels: 1e-9 relative."""
    velocity, rate = dry_run["velocity"].values[-1], dry_run["angular_velocity"].values[-1]
    masses = dry_run["mass"].values
    energy = 0.5 * (masses[:, None] * velocity**2).sum()
    yaw = dry_run["yaw"].values[-1]
    hull = np.diag(vehicle.hull.inertia_tensor)
    energy += 0.5 * hull[2] * rate[0, 2] ** 2
    wheel, upright = np.diag(vehicle.wheel.inertia_tensor), np.diag(vehicle.suspension.upright_inertia_tensor)
    for i in range(4):
        spin = dry_run["wheel_speed"].values[-1, i]
        energy += 0.5 * (wheel[1] * spin**2 + (wheel[2] + upright[2]) * rate[1 + i, 2] ** 2)
    assert np.abs(rate[:, :2]).max() < 1e-4  # straight on level ground at the end: roll and pitch rates do not count
    assert np.abs(yaw - yaw[0]).max() < 1e-6
    assert float(dry_run["kinetic_energy"][-1]) == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("run", RUNS)
def test_force_balance(run, request):
    """Body by body, soil + water + gravity + suspension + constraints = mass * acceleration: 1e-4 of the weight."""
    assert float(np.abs(force_residual(request.getfixturevalue(run))).max()) < 1e-4 * WEIGHT


@pytest.mark.parametrize("run", RUNS)
def test_internal_forces_cancel(run, request):
    """Newton's third law: suspension and constraint loads of the five bodies sum to nothing, 1e-6 of the weight."""
    dataset = request.getfixturevalue(run)
    for name in ("suspension_load", "constraint_load"):
        total = dataset[name].sum("body")
        assert float(np.abs(total).max()) < 1e-6 * WEIGHT, name


def test_whole_vehicle_obeys_newton(wet_run):
    """External forces of the result alone against the acceleration of the centre of mass: 1e-4 of the weight."""
    outer = (wet_run["soil_load"] + wet_run["water_load"] + wet_run["gravity_load"]).sum("body")
    inertia = (wet_run["mass"] * wet_run["acceleration"]).sum("body")
    assert float(np.abs(outer - inertia).max()) < 1e-4 * WEIGHT


def test_acceleration_velocity_and_position_belong_together(dry_run):
    """Trapezoids every 10 ms: error 1e-5/12 times the second derivative, below 1e-3 m/s a second and 1e-4 m."""
    for rate, value, tolerance in (("velocity", "position", 1e-4), ("acceleration", "velocity", 2e-3)):
        rates, values = dry_run[rate].values, dry_run[value].values
        integral = 0.01 * np.cumsum(0.5 * (rates[1:] + rates[:-1]), axis=0)
        assert integral[:, 0] == pytest.approx(values[1:, 0] - values[0, 0], abs=tolerance), rate


def test_hull_moment_balance(vehicle, sand):
    """About the hull's centre of mass: suspension + constraints = d(I w)/dt; 1e-4 of weight times half a wheelbase.

    The suspension pushes along the hull's z axis at each wheel centre.
    """
    turn = LaneChange(start=0.4, end=1.4, ramp_time=0.4)
    model = MultibodyVehicle(vehicle, sand, turn, Terrain(), 5e-4, 1.5)
    model.settle(lambda states: np.zeros((5, 6)))
    model.advance(1.5, np.zeros((5, 6)))
    records = model.records
    inertia = vehicle.hull.inertia_tensor
    largest = 0.0
    for row in records:
        motion = row["motion"]
        turn_matrix = motion["rotation"][0]
        local_rate = turn_matrix.T @ motion["angular_velocity"][0]
        local_acceleration = turn_matrix.T @ motion["angular_acceleration"][0]
        change = turn_matrix @ (inertia @ local_acceleration + np.cross(local_rate, inertia @ local_rate))
        moment = row["constraint_wrench"][0, 3:].copy()
        for i in range(4):
            arm = motion["position"][1 + i] - motion["position"][0]
            moment += np.cross(arm, row["loads"]["suspension_force"][i] * turn_matrix[:, 2])
        largest = max(largest, float(np.abs(moment - change).max()))
    assert np.abs(records["constraint_wrench"][:, 0, 3:]).max() > 1.0  # there is something to balance
    assert largest < 1e-4 * WEIGHT * 0.357


def test_spin_torque_balances_soil_and_inertia(dry_run, vehicle):
    """Straight ahead (before 2 s): spin torque + soil moment about the axle = I dw/dt; 1e-3 of the 4 N m of driving.

    A wheel turns with its upright's pitch and with its spin.
    """
    maneuver = lane_change()
    times = dry_run["time"].values[:200]
    inertia = vehicle.wheel.inertia_tensor[1, 1]
    expected = inertia * np.array([maneuver.wheel_speed(t)[1] for t in times])[:, None]
    expected = expected + inertia * dry_run["angular_acceleration"].sel(axis="y").values[:200, 1:]
    total = dry_run["spin_torque"].values[:200] + dry_run["soil_moment"].sel(axis="y").values[:200]
    assert np.abs(total - expected).max() < 4e-3


# -- driving -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("run", ["dry_run", "wet_run"])
def test_driving_costs_power(run, request):
    """Steady and straight (1.2 to 2 s): positive torque, power and slip at all wheels together; soil takes energy."""
    steady = request.getfixturevalue(run).sel(time=slice(1.2, 2.0))
    assert float(steady["spin_torque"].sum("wheel").min()) > 0.0
    assert float(steady["spin_power"].sum("wheel").min()) > 0.0
    assert float(steady["slip_ratio"].min()) > 0.0
    assert float(steady["forward_velocity"].min()) > 0.1
    soil = steady["work"].sel(work_kind="soil").values
    assert (np.diff(soil) < 0.0).all()


def test_steady_slip_is_that_of_its_definition(dry_run):
    """s = (r w - v_x) / (r w) driving, straight ahead where the wheel's speed is the hull's (1e-4: pitch)."""
    steady = dry_run.sel(time=slice(1.5, 1.95))
    rim = 0.1 * steady["wheel_speed"].values
    expected = (rim - steady["forward_velocity"].values[:, None]) / rim
    assert steady["slip_ratio"].values == pytest.approx(expected, abs=1e-3)


def test_reverse_is_the_opposite(vehicle, sand):
    """Wheels turned backwards: the vehicle goes back, torque negative, power still positive."""
    run = simulate(vehicle, sand, None, ConstantSteer(speed=-5.0), duration=2.0, micro_step=5e-4, macro_step=20e-3)
    steady = run.sel(time=slice(1.5, 2.0))
    assert float(run["position"].sel(body="hull", axis="x")[-1] - run["position"].sel(body="hull", axis="x")[0]) < -0.3
    assert float(steady["spin_torque"].sum("wheel").max()) < 0.0
    assert float(steady["spin_power"].sum("wheel").min()) > 0.0


def test_wishbone_vehicle_energy_and_forces(sand):
    """The same balances for the full-scale vehicle: 1 % of the spin work, 1e-4 of the weight."""
    truck = light_4x4()
    turn = LaneChange(amplitude=math.radians(20.0), start=0.5, end=2.0, ramp_time=0.5, speed=4.0)
    run = simulate(truck, sand, None, turn, duration=2.2, micro_step=5e-4, macro_step=20e-3)
    spin = float(run["work"].sel(work_kind="spin")[-1])
    assert float(np.abs(energy_residual(run)).max()) < 0.01 * spin
    assert float(np.abs(force_residual(run)).max()) < 1e-4 * truck.mass * GRAVITY


# -- symmetry ----------------------------------------------------------------------------------------------------------


def test_mirrored_steering_gives_the_mirrored_path(wet_run, mirrored_wet_run):
    """A head current keeps the symmetry: 1e-5 m, m/s and rad over 4 m (Newton's tolerance, 1e-6 m, grown over 8 s)."""
    flip = np.array([1.0, -1.0, 1.0])
    swap = [0, 2, 1, 4, 3]
    for name, sign, tolerance in (
        ("position", flip, 1e-5), ("velocity", flip, 1e-5), ("angular_velocity", -flip, 1e-4)
    ):  # fmt: skip
        mirrored = mirrored_wet_run[name].values[:, swap] * sign
        assert wet_run[name].values == pytest.approx(mirrored, abs=tolerance), name
    assert wet_run["yaw"].values == pytest.approx(-mirrored_wet_run["yaw"].values[:, swap], abs=1e-5)
    wheels = [1, 0, 3, 2]
    assert wet_run["soil_force"].values == pytest.approx(
        mirrored_wet_run["soil_force"].values[:, wheels] * flip, abs=1e-4 * WEIGHT
    )
    assert wet_run["sinkage"].values == pytest.approx(mirrored_wet_run["sinkage"].values[:, wheels], abs=1e-5)
    assert float(np.abs(wet_run["position"].sel(body="hull", axis="y")).max()) > 0.1  # it does change lanes


def test_lane_change_goes_left_first_and_ends_parallel(dry_run):
    """Positive amplitude turns left (design): the path ends 0.54 m to the left, the heading is the start's again."""
    y = dry_run["position"].sel(body="hull", axis="y").values
    assert y[-1] == pytest.approx(0.538, abs=0.02)
    assert float(dry_run["yaw"].sel(body="hull").max()) > 0.2
    assert abs(float(dry_run["yaw"].sel(body="hull")[-1])) < math.radians(0.2)


def test_straight_driving_stays_straight(dry_run):
    """Before the steering begins nothing is lateral: 1e-9 m."""
    before = dry_run.sel(time=slice(0.0, 1.99), body="hull")
    assert float(np.abs(before["position"].sel(axis="y")).max()) < 1e-9
