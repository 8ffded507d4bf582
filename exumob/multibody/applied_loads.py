"""All applied loads on the vehicle at one instant: soil, suspension and water, in one Numba call a residual.

The multibody solver asks for them at every Newton iteration, so they are gathered here from the coordinates of nine
rigid bodies (hull, four uprights, four wheels: Euler-parameter nodes of 7 coordinates each) into one record. Power
and stored energy of each kind of load come out alongside: they make the energy balance of a run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain, terrain_height
from exumob.ground.terramechanics import wheel_soil_kernel
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.vehicle.parameters import Vehicle

SOIL_PARAMETERS = len(Soil.published("LETE sand").as_array())
TERRAIN_PARAMETERS = len(Terrain().as_arrays()[0])

MODEL = np.dtype(
    [
        ("soil", "f8", (SOIL_PARAMETERS,)),
        ("terrain", "f8", (TERRAIN_PARAMETERS,)),
        ("wheel_radius", "f8"),
        ("wheel_width", "f8"),
        ("standstill_rate", "f8"),  # [rad/s]: spin below which shear is regularised, see `terramechanics`
        ("ride_position", "f8", (4, 3)),  # wheel centres at ride height, hull axes from the hull's origin [m]
        ("stiffness", "f8", (4,)),
        ("damping", "f8", (4,)),
        ("preload", "f8", (4,)),  # spring force at ride height [N]
        ("bump_travel", "f8", (4,)),
        ("rebound_travel", "f8", (4,)),
        ("stop_stiffness", "f8", (4,)),
        ("stop_softening", "f8", (4,)),
        ("body_mass", "f8", (9,)),  # hull, uprights, wheels [kg]
        ("body_inertia", "f8", (9, 3)),  # principal, about the origin [kg m^2]
        ("gravity", "f8"),
        ("settling_rate", "f8"),  # [1/s]: mass-proportional damping while the static equilibrium is sought
    ],
    align=True,
)
"""What the loads depend on besides the motion; constant during a run."""

LOADS = np.dtype(
    [
        ("water", "f8", (5, 6)),  # input: wrench on the five bodies, body axes [N, N m], held over a macro step
        ("hull_force", "f8", (3,)),  # all in world axes [N], [N m]
        ("hull_torque", "f8", (3,)),
        ("upright_force", "f8", (4, 3)),
        ("upright_torque", "f8", (4, 3)),
        ("wheel_torque", "f8", (4, 3)),
        ("soil_force", "f8", (4, 3)),
        ("soil_moment", "f8", (4, 3)),  # about the wheel centre
        ("suspension_force", "f8", (4,)),  # pushes hull and wheel apart [N]
        ("stroke", "f8", (4,)),  # wheel above its ride height relative to the hull [m]
        ("sinkage", "f8", (4,)),
        ("slip_ratio", "f8", (4,)),
        ("slip_angle", "f8", (4,)),  # of the velocity to the wheel's plane, 0 also in straight reverse
        ("soil_power", "f8"),  # into the vehicle [W]
        ("damper_power", "f8"),
        ("water_power", "f8"),
        ("settling_power", "f8"),
        ("spring_energy", "f8"),  # stored [J]
        ("kinetic_energy", "f8"),
        ("gravity_energy", "f8"),
        ("deepest", "f8"),  # largest sinkage over wheel radius
    ],
    align=True,
)
"""Loads on nine bodies at one instant, and what they are made of."""


def load_model(vehicle: Vehicle, soil: Soil, terrain: Terrain, standstill_rate: float) -> np.ndarray:
    """Pack what `vehicle_loads` needs into one record.

    Returns
    -------
    array of dtype `MODEL`, shape (1,)
    """
    model = np.zeros(1, MODEL)
    record = model[0]
    record["soil"] = soil.as_array()
    record["terrain"] = terrain.as_arrays()[0]
    record["wheel_radius"] = vehicle.wheel.radius
    record["wheel_width"] = vehicle.wheel.width
    record["standstill_rate"] = standstill_rate
    record["ride_position"] = vehicle.wheel_centers - vehicle.hull_origin
    front, rear = vehicle.axle_suspensions
    share = vehicle.front_load_share
    for wheel, suspension in enumerate((front, front, rear, rear)):
        for name in ("stiffness", "damping", "bump_travel", "rebound_travel", "stop_stiffness", "stop_softening"):
            record[name][wheel] = getattr(suspension, name)
        record["preload"][wheel] = 0.5 * vehicle.hull.mass * GRAVITY * (share if wheel < 2 else 1.0 - share)
        record["body_mass"][1 + wheel] = suspension.upright_mass
        record["body_inertia"][1 + wheel] = np.diag(suspension.upright_inertia_tensor)
        record["body_mass"][5 + wheel] = vehicle.wheel.mass
        record["body_inertia"][5 + wheel] = np.diag(vehicle.wheel.inertia_tensor)
    record["body_mass"][0] = vehicle.hull.mass
    record["body_inertia"][0] = np.diag(vehicle.hull.inertia_tensor)
    record["gravity"] = GRAVITY
    return model


@njit(cache=True, error_model="numpy", inline="always")
def _rotation(node: Array, a: Array) -> None:
    """Rotation matrix of Euler parameters node[3:7] (scalar first)."""
    e0, e1, e2, e3 = node[3], node[4], node[5], node[6]
    a[0, 0] = 2.0 * (e0 * e0 + e1 * e1) - 1.0
    a[0, 1] = 2.0 * (e1 * e2 - e0 * e3)
    a[0, 2] = 2.0 * (e1 * e3 + e0 * e2)
    a[1, 0] = 2.0 * (e1 * e2 + e0 * e3)
    a[1, 1] = 2.0 * (e0 * e0 + e2 * e2) - 1.0
    a[1, 2] = 2.0 * (e2 * e3 - e0 * e1)
    a[2, 0] = 2.0 * (e1 * e3 - e0 * e2)
    a[2, 1] = 2.0 * (e2 * e3 + e0 * e1)
    a[2, 2] = 2.0 * (e0 * e0 + e3 * e3) - 1.0


@njit(cache=True, error_model="numpy", inline="always")
def _spin(node: Array, rate: Array, w: Array) -> None:
    """Angular velocity in world axes: w = 2 G(e) e_t, from Euler parameters node[3:7] and rates rate[3:7]."""
    e0, e1, e2, e3 = node[3], node[4], node[5], node[6]
    d0, d1, d2, d3 = rate[3], rate[4], rate[5], rate[6]
    w[0] = 2.0 * (-e1 * d0 + e0 * d1 - e3 * d2 + e2 * d3)
    w[1] = 2.0 * (-e2 * d0 + e3 * d1 + e0 * d2 - e1 * d3)
    w[2] = 2.0 * (-e3 * d0 - e2 * d1 + e1 * d2 + e0 * d3)


@njit(cache=True, error_model="numpy", inline="always")
def _cross(a: Array, b: Array, c: Array) -> None:
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy", inline="always")
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def stop_force(penetration: float, stiffness: float, softening: float) -> tuple[float, float]:
    """Force [N] and energy [J] of a bump stop compressed by `penetration` [m]; stiffness builds up over `softening`."""
    if penetration <= 0.0:
        return 0.0, 0.0
    if penetration < softening:
        return 0.5 * stiffness * penetration**2 / softening, stiffness * penetration**3 / (6.0 * softening)
    beyond = penetration - softening
    force = stiffness * (beyond + 0.5 * softening)
    energy = stiffness * (softening**2 / 6.0 + 0.5 * softening * beyond + 0.5 * beyond**2)
    return force, energy


@njit(cache=True, error_model="numpy")
def _soil_on_wheel(
    m: Any, heights: Array, center: Array, velocity: Array, axle: Array, omega: float, spin: Array, wheel: Array,
    force: Array, moment: Array,
) -> float:  # fmt: skip
    """Bekker-Wong force and moment in world axes, in the frame of the terrain below the wheel; returns the sinkage.

    `wheel` receives the result of `wheel_soil_kernel`, its last entry the angle of the velocity to the heading.
    """
    heading, left, normal = np.empty(3), np.empty(3), np.empty(3)
    ground, slope_x, slope_y = terrain_height(m.terrain, heights, center[0], center[1])
    norm = 1.0 / np.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
    normal[0], normal[1], normal[2] = -slope_x * norm, -slope_y * norm, norm
    _cross(axle, normal, heading)
    norm = 1.0 / np.sqrt(_dot(heading, heading))
    for k in range(3):
        heading[k] *= norm
    _cross(normal, heading, left)
    sinkage = m.wheel_radius - (center[2] - ground) * normal[2]
    v_x, v_y, v_z = _dot(velocity, heading), _dot(velocity, left), _dot(velocity, normal)
    omega_x, omega_z = _dot(spin, heading), _dot(spin, normal)
    wheel_soil_kernel(
        m.soil, m.wheel_radius, m.wheel_width, sinkage, v_x, v_y, v_z, omega, omega_x, omega_z, m.standstill_rate, wheel
    )  # fmt: skip
    for k in range(3):
        force[k] = wheel[0] * heading[k] + wheel[1] * left[k] + wheel[2] * normal[k]
        moment[k] = wheel[3] * heading[k] + wheel[4] * left[k] + wheel[5] * normal[k]
    wheel[11] = np.arctan2(v_y, abs(v_x)) if v_x * v_x + v_y * v_y > 1e-6 else 0.0
    return sinkage


@njit(cache=True, error_model="numpy")
def soil_damping(
    model: np.ndarray, heights: Array, coordinates: Array, velocities: Array, reference: Array, factor: float,
    entries: Array,
) -> None:  # fmt: skip
    """Derivative of the soil's generalised forces with respect to the velocities of the wheel centres.

    For the Newton iterations of the multibody solver: soil at standstill is stiff in velocity.

    Parameters
    ----------
    model, heights, coordinates, velocities, reference
        As for `vehicle_loads`.
    factor : float
        Multiplies the derivatives.
    entries : array, shape (132, 3)
        Receives row, column and value of a sparse matrix; rows are the coordinates of uprights and wheels, columns the
        velocities of the uprights' origins.
    """
    m = model[0]
    step = 1e-7
    upright, spin, wheel_spin = np.empty((3, 3)), np.empty(3), np.empty(3)
    speed, axle = np.empty(3), np.empty(3)
    wheel, force, changed = np.empty(12), np.empty(3), np.empty(3)
    moment, changed_moment, bearing = np.empty(3), np.empty(3), np.empty(3)
    entry = 0
    for i in range(4):
        first, rim = 7 * (1 + i), 7 * (5 + i)
        body = coordinates[first : first + 7] + reference[first : first + 7]
        rim_node = coordinates[rim : rim + 7] + reference[rim : rim + 7]
        _rotation(body, upright)
        _spin(body, velocities[first : first + 7], spin)
        _spin(rim_node, velocities[rim : rim + 7], wheel_spin)
        for k in range(3):
            axle[k] = upright[k, 1]
            speed[k] = velocities[first + k]
        omega = _dot(wheel_spin, axle)
        _soil_on_wheel(m, heights, body, speed, axle, omega, spin, wheel, force, moment)
        for k in range(3):
            speed[k] += step
            _soil_on_wheel(m, heights, body, speed, axle, omega, spin, wheel, changed, changed_moment)
            speed[k] -= step
            for j in range(3):
                entries[entry, 0], entries[entry, 1] = first + j, first + k
                entries[entry, 2] = factor * (changed[j] - force[j]) / step
                entry += 1
                bearing[j] = factor * (changed_moment[j] - moment[j]) / step
            torque = _dot(bearing, axle)
            for j in range(3):
                bearing[j] -= torque * axle[j]
            for row, node, part in ((first, body, bearing), (rim, rim_node, torque * axle)):
                e0, e1, e2, e3 = node[3], node[4], node[5], node[6]  # Q_e = 2 G^T(e) moment
                for j in range(4):
                    entries[entry + j, 0], entries[entry + j, 1] = row + 3 + j, first + k
                entries[entry, 2] = 2.0 * (-e1 * part[0] - e2 * part[1] - e3 * part[2])
                entries[entry + 1, 2] = 2.0 * (e0 * part[0] + e3 * part[1] - e2 * part[2])
                entries[entry + 2, 2] = 2.0 * (-e3 * part[0] + e0 * part[1] + e1 * part[2])
                entries[entry + 3, 2] = 2.0 * (e2 * part[0] - e1 * part[1] + e0 * part[2])
                entry += 4


@njit(cache=True, error_model="numpy")
def vehicle_loads(
    model: np.ndarray, heights: Array, coordinates: Array, velocities: Array, reference: Array, loads: np.ndarray
) -> None:
    """Compute the loads on all bodies for given coordinates.

    Parameters
    ----------
    model : array of dtype `MODEL`, shape (1,)
    heights : array, shape (ny, nx)
        Height field of the terrain (see `Terrain.as_arrays`).
    coordinates, velocities, reference : array, shape (63,)
        Node displacements and Euler-parameter increments, their rates, and the reference values.
    loads : array of dtype `LOADS`, shape (1,)
        ``loads["water"]`` is read; everything else is written.
    """
    m = model[0]
    out = loads[0]
    node = np.empty((9, 7))
    for i in range(9):
        for k in range(7):
            node[i, k] = coordinates[7 * i + k] + reference[7 * i + k]
    rate = velocities.reshape(9, 7)
    hull, upright = np.empty((3, 3)), np.empty((3, 3))
    hull_spin, upright_spin, wheel_spin = np.empty(3), np.empty(3), np.empty(3)
    arm, arm_velocity, lift, moment = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    axle, soil_force, soil_moment = np.empty(3), np.empty(3), np.empty(3)
    wheel = np.empty(12)
    _rotation(node[0], hull)
    _spin(node[0], rate[0], hull_spin)
    lift[0], lift[1], lift[2] = hull[0, 2], hull[1, 2], hull[2, 2]
    settling = m.settling_rate
    soil_power = 0.0
    damper_power = 0.0
    water_power = 0.0
    settling_power = 0.0
    spring_energy = 0.0
    deepest = 0.0
    kinetic = 0.0
    potential = 0.0
    for i in range(9):
        _rotation(node[i], upright)
        _spin(node[i], rate[i], upright_spin)
        for k in range(3):
            local = upright[0, k] * upright_spin[0] + upright[1, k] * upright_spin[1] + upright[2, k] * upright_spin[2]
            kinetic += 0.5 * m.body_inertia[i, k] * local * local + 0.5 * m.body_mass[i] * rate[i, k] ** 2
        potential += m.body_mass[i] * m.gravity * node[i, 2]

    for k in range(3):
        f = 0.0
        t = 0.0
        for j in range(3):
            f += hull[k, j] * out.water[0, j]
            t += hull[k, j] * out.water[0, 3 + j]
        water_power += f * rate[0, k] + t * hull_spin[k]
        f_s = -settling * m.body_mass[0] * rate[0, k]
        t_s = -settling * m.body_inertia[0, k] * hull_spin[k]
        settling_power += f_s * rate[0, k] + t_s * hull_spin[k]
        out.hull_force[k] = f + f_s
        out.hull_torque[k] = t + t_s

    for i in range(4):
        body, rim = node[1 + i], node[5 + i]
        speed = rate[1 + i]
        _rotation(body, upright)
        _spin(body, speed, upright_spin)
        _spin(rim, rate[5 + i], wheel_spin)
        for k in range(3):
            axle[k] = upright[k, 1]

        # water on the wheel body, and settling damping
        for k in range(3):
            f = 0.0
            t = 0.0
            for j in range(3):
                f += upright[k, j] * out.water[1 + i, j]
                t += upright[k, j] * out.water[1 + i, 3 + j]
            water_power += f * speed[k] + t * upright_spin[k]
            f_s = -settling * (m.body_mass[1 + i] + m.body_mass[5 + i]) * speed[k]
            settling_power += f_s * speed[k]
            out.upright_force[i, k] = f + f_s
            out.upright_torque[i, k] = t

        # suspension: along the hull's z axis through the wheel centre
        for k in range(3):
            arm[k] = body[k] - node[0, k]
        _cross(hull_spin, arm, arm_velocity)
        stroke = _dot(lift, arm) - m.ride_position[i, 2]
        stroke_rate = 0.0
        for k in range(3):
            stroke_rate += lift[k] * (speed[k] - rate[0, k] - arm_velocity[k])
        bump, bump_energy = stop_force(stroke - m.bump_travel[i], m.stop_stiffness[i], m.stop_softening[i])
        rebound, rebound_energy = stop_force(-stroke - m.rebound_travel[i], m.stop_stiffness[i], m.stop_softening[i])
        damper = m.damping[i] * stroke_rate
        force = m.preload[i] + m.stiffness[i] * stroke + damper + bump - rebound
        damper_power -= damper * stroke_rate
        spring_energy += m.preload[i] * stroke + 0.5 * m.stiffness[i] * stroke**2 + bump_energy + rebound_energy
        _cross(arm, lift, moment)
        for k in range(3):
            out.upright_force[i, k] -= force * lift[k]
            out.hull_force[k] += force * lift[k]
            out.hull_torque[k] += force * moment[k]
        out.stroke[i] = stroke
        out.suspension_force[i] = force

        # soil
        omega = _dot(wheel_spin, axle)
        sinkage = _soil_on_wheel(m, heights, body, speed, axle, omega, upright_spin, wheel, soil_force, soil_moment)
        torque = _dot(soil_moment, axle)
        for k in range(3):
            soil_power += soil_force[k] * speed[k] + soil_moment[k] * upright_spin[k]
            soil_power += torque * axle[k] * (wheel_spin[k] - upright_spin[k])
            out.upright_force[i, k] += soil_force[k]
            out.upright_torque[i, k] += soil_moment[k] - torque * axle[k]
            out.wheel_torque[i, k] = torque * axle[k]
            out.soil_force[i, k] = soil_force[k]
            out.soil_moment[i, k] = soil_moment[k]
        out.sinkage[i] = sinkage
        out.slip_ratio[i] = wheel[7]
        out.slip_angle[i] = wheel[11]
        deepest = max(deepest, sinkage / m.wheel_radius)

    out.soil_power = soil_power
    out.damper_power = damper_power
    out.water_power = water_power
    out.settling_power = settling_power
    out.spring_energy = spring_energy
    out.kinetic_energy = kinetic
    out.gravity_energy = potential
    out.deepest = deepest


WORK = np.dtype(
    [
        ("time", "f8"),  # of `power` [s]
        ("power", "f8", (6,)),  # into the vehicle: soil, damper, water, spin, steering, settling [W]
        ("work", "f8", (6,)),  # its integral over time, trapezoidal [J]
    ],
    align=True,
)
"""Running energy account of a run."""

HISTORY = np.dtype(
    [
        ("time", "f8"),
        ("position", "f8", (5, 3)),
        ("rotation", "f8", (5, 3, 3)),
        ("velocity", "f8", (5, 3)),
        ("angular_velocity", "f8", (5, 3)),
        ("acceleration", "f8", (5, 3)),
        ("angular_acceleration", "f8", (5, 3)),
        ("wheel_speed", "f8", (4,)),
    ],
    align=True,
)
"""One sample of the five bodies' motion; the fields of `exumob.vehicle.motion.BodyStates`."""


@njit(cache=True, error_model="numpy")
def sample_motion(coordinates: Array, velocities: Array, accelerations: Array, reference: Array, sample: Any) -> None:
    """Write the five bodies' motion into one `HISTORY` record."""
    node = np.empty(7)
    spin, wheel_spin = np.empty(3), np.empty(3)
    for i in range(5):
        for k in range(7):
            node[k] = coordinates[7 * i + k] + reference[7 * i + k]
        for k in range(3):
            sample.position[i, k] = node[k]
            sample.velocity[i, k] = velocities[7 * i + k]
            sample.acceleration[i, k] = accelerations[7 * i + k]
        _rotation(node, sample.rotation[i])
        _spin(node, velocities[7 * i : 7 * i + 7], spin)
        for k in range(3):
            sample.angular_velocity[i, k] = spin[k]
        _spin(node, accelerations[7 * i : 7 * i + 7], sample.angular_acceleration[i])  # G(e_t) e_t = 0
        if i > 0:
            for k in range(7):
                node[k] = coordinates[7 * (i + 4) + k] + reference[7 * (i + 4) + k]
            _spin(node, velocities[7 * (i + 4) : 7 * (i + 4) + 7], wheel_spin)
            speed = 0.0
            for k in range(3):
                speed += (wheel_spin[k] - spin[k]) * sample.rotation[i, k, 1]
            sample.wheel_speed[i - 1] = speed


@njit(cache=True, error_model="numpy")
def add_work(
    time: float, loads: np.ndarray, multipliers: Array, steering_rows: Array, spin_rows: Array, rates: Array,
    ledger: np.ndarray,
) -> float:  # fmt: skip
    """Integrate the power of each kind of load over the step that ends at `time`.

    Parameters
    ----------
    time : float
    loads : array of dtype `LOADS`, shape (1,)
    multipliers : array
        Lagrange multipliers of the system.
    steering_rows, spin_rows : array of int
        Rows of the steering and spin constraints in `multipliers`.
    rates : array, shape (3,)
        Prescribed rates: of the left and the right front wheel's angle and of wheel spin [rad/s].
    ledger : array of dtype `WORK`, shape (1,)

    Returns
    -------
    float
        Largest sinkage over wheel radius (NaN if the motion is not finite).
    """
    account = ledger[0]
    out = loads[0]
    spin = 0.0
    for row in spin_rows:
        spin -= multipliers[row] * rates[2]
    steering = 0.0
    for i in range(2):
        steering -= multipliers[steering_rows[i]] * rates[i]
    power = np.array((out.soil_power, out.damper_power, out.water_power, spin, steering, out.settling_power))
    half_step = 0.5 * (time - account.time)
    for i in range(6):
        account.work[i] += half_step * (account.power[i] + power[i])
        account.power[i] = power[i]
    account.time = time
    return out.deepest
