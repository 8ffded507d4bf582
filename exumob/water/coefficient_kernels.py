"""Kernels of the coefficient model: hydrostatic, drag and added-mass wrenches of the five bodies."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.kernels import njit
from exumob.water.conditions import WaterOverBed
from exumob.water.hydrostatics import WET_INTEGRALS, wet_integrals
from exumob.water.water_field import water_at
from exumob.water.wetted_surface import Integers

FILTER_STEPS = 2.0
"""Lag of the added-mass wrench behind the acceleration, in macro steps; see `filter_time`."""
HYDROSTATIC, DRAG, ADDED_MASS = range(3)
"""Parts of the wrenches, in the order of the first axis of `parts`."""


class BodyPanels(NamedTuple):
    """Surfaces of the five bodies, one after the other."""

    triangles: Array
    """Corners in each body's axes [m], shape (triangles, 3, 3)"""
    cells: Integers
    """Cell of each triangle in its body, shape (triangles,)"""
    first_triangle: Integers
    """First triangle of each body, and the number of all, shape (6,)"""
    strip_beams: Array
    """Beam of each strip of the fully wetted hull [m], shape (strips,); a strip has a starboard and a port cell"""
    strip_centers: Array
    """Middle of each strip along the hull's x axis [m], shape (strips,)"""


class ModelParameters(NamedTuple):
    """All numbers of the coefficient model that stay the same during a run."""

    density: float
    """Density of the water [kg/m^3]"""
    surroundings: WaterOverBed
    """Level and current of the water, and the bed"""
    macro_step: float
    """Interval over which the wrenches are held [s]"""
    entry_draught: float
    """Draught over which drag and added mass build up [m]"""
    hull_length: float
    """Extent of the hull's surface along x [m]"""
    hull_beam: float
    """Extent of the hull's surface along y [m]"""
    strip_length: float
    """Length of each strip of the hull [m]"""
    heave_end_factor: float
    """Share of the strips' heave added mass that the flow round bow and stern leaves [-]"""
    roll_gyration: float
    """Radius of gyration of a section's heave added mass in roll, over half the beam [-]"""
    wheel_in_plane_added_mass: float
    """Added mass of a wheel in its plane, over the displaced mass [-]"""
    wheel_axial_added_mass: float
    """Added mass of a wheel along its axle, over the displaced mass [-]"""
    drag_coefficients: Array
    """Drag coefficients of each body along its x, y, z [-], shape (5, 3); nan: from `sway_drag`"""
    sway_drag: Array
    """Ratios of beam to twice the draught, and drag coefficients of the hull's sections [-], shape (2, n)"""
    section_added_mass: Array
    """Ratios b/a and added-mass coefficients of the hull's sections [-], shape (2, n)"""
    rigid_masses: Array
    """Mass (three times) and principal moments of inertia of each body [kg, kg m^2], shape (5, 6)"""
    frontal_share: float
    """Share of the hull's areas across its x axis that is not in the shade of others (`frontal_share`) [-]"""
    pore_pressure: bool
    """True: the water's pressure acts below the soil surface too"""
    added_mass: bool
    """True: there is an added mass"""


class RecentMotion(NamedTuple):
    """Motion of the five bodies since the last call: m samples, and the velocities of the last one."""

    since: float
    """Time of the last sample of the call before [s]"""
    time: Array
    """Times of the samples [s], shape (m,)"""
    rotation: Array
    """Rotation matrices, body -> world, shape (m, 5, 3, 3)"""
    acceleration: Array
    """Accelerations of the origins, world axes [m/s^2], shape (m, 5, 3)"""
    angular_acceleration: Array
    """Angular accelerations, world axes [rad/s^2], shape (m, 5, 3)"""
    position: Array
    """Positions of the origins at the last sample, world axes [m], shape (5, 3)"""
    velocity: Array
    """Velocities of the origins at the last sample, world axes [m/s], shape (5, 3)"""
    angular_velocity: Array
    """Angular velocities at the last sample, world axes [rad/s], shape (5, 3)"""


@njit(cache=True, error_model="numpy")
def filter_time(macro_step: float, added_mass: float, mass: float) -> float:
    """Return the time constant of the first-order filter tau a_f' = a - a_f behind the added-mass load -m_a a_f.

    The load is held over the macro step H while the body answers at once with a = (F - m_a a_f) / m: without a filter
    the error grows by m_a/m a step. With it tau a_f' = F/m - (1 + m_a/m) a_f, whose own time constant
    tau / (1 + m_a/m) is made `FILTER_STEPS` macro steps. Over one held step the error is then multiplied by
    1 - (1 + m_a/m) (1 - exp(-H / tau)), which lies between 1 - 1/FILTER_STEPS and exp(-1/FILTER_STEPS): stable and
    free of overshoot for any m_a/m. The price is a lag, first order in H: in an oscillation at omega the load is that
    of the added mass m_a / (1 + (omega tau)^2) and of a damper omega^2 tau times as large, never a negative one.
    Halve the macro step where that matters.

    Parameters
    ----------
    macro_step : float
        [s]
    added_mass, mass : float
        Masses of the same kind [kg or kg m^2].

    Returns
    -------
    float
        tau [s].
    """
    return FILTER_STEPS * macro_step * (1.0 + added_mass / mass)


@njit(cache=True, error_model="numpy")
def evaluate_wrenches(
    panels: BodyPanels, model: ModelParameters, motion: RecentMotion, filtered: Array, matrices: Array, parts: Array,
    filter_times: Array,
) -> None:  # fmt: skip
    """Evaluate the wrenches of the five bodies at the last sample, body axes about the body's origin.

    Parameters
    ----------
    panels : BodyPanels
    model : ModelParameters
    motion : RecentMotion
    filtered : array, shape (5, 6), changed
        Filtered linear and angular accelerations, body axes [m/s^2, rad/s^2]; they move on to the last sample.
    matrices : array, shape (5, 6, 6), changed
        Added masses at the last sample [kg, kg m, kg m^2].
    parts : array, shape (3, 5, 6), changed
        The parts `HYDROSTATIC`, `DRAG` and `ADDED_MASS` are added to it [N, N m].
    filter_times : array, shape (5, 6), changed
        Time constants of the filter [s]; 0 without added mass.
    """
    scratch = np.empty((3, 9, 5))
    totals = np.zeros(1, WET_INTEGRALS)
    all_moments = np.empty((2 * panels.strip_beams.size, 3, 4))
    place, current, angular_velocity = np.empty(3), np.zeros(3), np.empty(3)
    turned, relative_velocity = np.empty((3, 3)), np.empty((2 * panels.strip_beams.size, 3))
    ahead, around = 0.5 * model.macro_step, model.surroundings
    for body in range(5):
        rotation = motion.rotation[-1, body]
        for k in range(3):
            place[k] = motion.position[body, k] + ahead * motion.velocity[body, k]
            angular_velocity[k] = 0.0
            for i in range(3):  # body axes
                angular_velocity[k] += rotation[i, k] * motion.angular_velocity[body, i]
        _rotation_ahead(rotation, angular_velocity, ahead, turned)
        level, current[0], current[1] = water_at(around.water[0], around.water_nodes, place[0], place[1])
        _set_relative(rotation, motion.velocity[body], current, relative_velocity[0])
        for cell in range(1, relative_velocity.shape[0] if body == 0 else 1):
            relative_velocity[cell] = relative_velocity[0]
        if body == 0 and around.water_nodes.shape[1] > 0:
            _set_strips_relative(panels, around, rotation, place, motion.velocity[0], current, relative_velocity)

        area_moments = all_moments if body == 0 else all_moments[:1]
        area_moments[:] = 0.0
        _clear(totals)
        total = totals[0]
        first, last = panels.first_triangle[body], panels.first_triangle[body + 1]
        wet_integrals(
            panels.triangles[first:last], panels.cells[first:last], turned, place, level, around.bed,
            around.bed_nodes, totals, area_moments, scratch,
        )  # fmt: skip
        for k in range(6):
            buried = total.buried_wrench[k] if model.pore_pressure else 0.0
            parts[HYDROSTATIC, body, k] = model.density * GRAVITY * (total.exposed_wrench[k] + buried)

        build_up = min(total.draught / model.entry_draught, 1.0)
        build_up *= build_up * (3.0 - 2.0 * build_up)
        for cell in range(area_moments.shape[0]):
            for k in range(3):
                share = build_up * (model.frontal_share if body == 0 and k == 0 else 1.0)
                for i in range(4):
                    area_moments[cell, k, i] *= share
        _add_drag(
            area_moments, model.drag_coefficients[body], panels.strip_beams, model, relative_velocity, angular_velocity,
            parts[DRAG, body],
        )  # fmt: skip

        matrix = matrices[body]
        matrix[:] = 0.0
        if not model.added_mass:
            filter_times[body] = 0.0
            continue
        if body == 0:
            _add_hull_added_mass(area_moments, panels.strip_beams, model, matrix)
        else:
            displaced = model.density * (total.submerged_volume - total.buried_volume) * build_up
            for k in range(3):
                ratio = model.wheel_axial_added_mass if k == 1 else model.wheel_in_plane_added_mass
                _add_directed_mass(displaced * ratio, k, area_moments[0, k], matrix)
        for k in range(6):
            filter_times[body, k] = filter_time(model.macro_step, matrix[k, k], model.rigid_masses[body, k])
        _filter_acceleration(motion, body, filter_times[body], filtered[body])
        for k in range(6):
            for i in range(6):
                parts[ADDED_MASS, body, k] -= matrix[k, i] * filtered[body, i]


@njit(cache=True, error_model="numpy")
def _clear(totals: Array) -> None:
    """Set a record of `WET_INTEGRALS` to zero."""
    total = totals[0]
    total.exposed_wrench[:] = 0.0
    total.buried_wrench[:] = 0.0
    total.submerged_volume = 0.0
    total.buried_volume = 0.0
    total.exposed_area = 0.0
    total.draught = 0.0


@njit(cache=True, error_model="numpy")
def _rotation_ahead(rotation: Array, angular_velocity: Array, ahead: float, turned: Array) -> None:
    """Write the world's axes in body axes a short time `ahead` [s] to the rows of `turned`.

    Each row has length 1; they are orthogonal but for the square of the angle. The angular velocity is in body axes.
    """
    for row in range(3):
        x, y, z = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        turned[row, 0] = x - ahead * (angular_velocity[1] * z - angular_velocity[2] * y)
        turned[row, 1] = y - ahead * (angular_velocity[2] * x - angular_velocity[0] * z)
        turned[row, 2] = z - ahead * (angular_velocity[0] * y - angular_velocity[1] * x)
        norm = math.sqrt(turned[row, 0] ** 2 + turned[row, 1] ** 2 + turned[row, 2] ** 2)
        for k in range(3):
            turned[row, k] /= norm


@njit(cache=True, error_model="numpy")
def _set_relative(rotation: Array, velocity: Array, current: Array, relative: Array) -> None:
    """Write a velocity relative to a current, both in world axes, to `relative`, in body axes [m/s]."""
    for k in range(3):
        relative[k] = 0.0
        for i in range(3):
            relative[k] += rotation[i, k] * (velocity[i] - current[i])


@njit(cache=True, error_model="numpy")
def _set_strips_relative(
    panels: BodyPanels, around: WaterOverBed, rotation: Array, place: Array, velocity: Array, current: Array,
    relative: Array,
) -> None:  # fmt: skip
    """Write the hull's velocity relative to the current at each strip to `relative`, body axes, shape (cells, 3)."""
    for strip in range(panels.strip_centers.size):
        x = place[0] + rotation[0, 0] * panels.strip_centers[strip]
        y = place[1] + rotation[1, 0] * panels.strip_centers[strip]
        _, current[0], current[1] = water_at(around.water[0], around.water_nodes, x, y)
        for cell in range(2 * strip, 2 * strip + 2):
            _set_relative(rotation, velocity, current, relative[cell])


@njit(cache=True, error_model="numpy")
def _interpolate(table: Array, ratio: float) -> float:
    """Interpolate linearly in a table of ratios and coefficients, shape (2, n); constant beyond the ends."""
    if ratio <= table[0, 0]:
        return table[1, 0]
    for i in range(1, table.shape[1]):
        if ratio <= table[0, i]:
            part = (ratio - table[0, i - 1]) / (table[0, i] - table[0, i - 1])
            return table[1, i - 1] + part * (table[1, i] - table[1, i - 1])
    return table[1, -1]


@njit(cache=True, error_model="numpy")
def _add_drag(
    area_moments: Array, coefficients: Array, strip_beams: Array, model: ModelParameters, relative_velocity: Array,
    angular_velocity: Array, wrench: Array,
) -> None:  # fmt: skip
    """Add the drag of each cell along each body axis, at the centre of the cell's wetted area.

    `relative_velocity`: of the body's origin relative to the current at the cell, shape (n_cells, 3).
    """
    center = np.empty(3)
    for cell in range(area_moments.shape[0]):
        for k in range(3):
            area = area_moments[cell, k, 0]
            if area <= 0.0:
                continue
            for i in range(3):
                center[i] = area_moments[cell, k, i + 1] / area
            coefficient = coefficients[k]
            if math.isnan(coefficient):  # sway of the hull: a cell is half a strip
                ratio = strip_beams[cell // 2] * model.strip_length / (4.0 * area)
                coefficient = _interpolate(model.sway_drag, ratio)
            i, j = (k + 1) % 3, (k + 2) % 3  # k, i, j is cyclic: component k of a cross product is i, j less j, i
            speed = relative_velocity[cell, k] + angular_velocity[i] * center[j] - angular_velocity[j] * center[i]
            force = -0.5 * model.density * coefficient * area * abs(speed) * speed
            wrench[k] += force
            wrench[3 + i] += center[j] * force
            wrench[3 + j] -= center[i] * force


@njit(cache=True, error_model="numpy")
def _add_directed_mass(mass: float, k: int, moments: Array, matrix: Array) -> None:
    """Add a mass that resists motion along axis k only, at the centre of an area.

    `moments`: the area and its first moments, shape (4,); `matrix`: the body's added mass, shape (6, 6).
    """
    if mass <= 0.0 or moments[0] <= 0.0:
        return
    i, j = (k + 1) % 3, (k + 2) % 3
    arm = np.zeros(6)  # the point's speed along k is arm @ (velocity, angular velocity)
    arm[k], arm[3 + i], arm[3 + j] = 1.0, moments[1 + j] / moments[0], -(moments[1 + i] / moments[0])
    for row in range(6):
        for column in range(6):
            matrix[row, column] += mass * arm[row] * arm[column]


@njit(cache=True, error_model="numpy")
def _add_hull_added_mass(area_moments: Array, strip_beams: Array, model: ModelParameters, matrix: Array) -> None:
    """Add strip theory in sway and heave, one section in surge, all of the double body at the present draught."""
    frontal, lateral, plan = np.zeros(4), np.empty(4), np.empty(4)
    density, table = model.density, model.section_added_mass
    for s in range(strip_beams.size):
        for i in range(4):
            frontal[i] += area_moments[2 * s, 0, i] + area_moments[2 * s + 1, 0, i]
            lateral[i] = area_moments[2 * s, 1, i] + area_moments[2 * s + 1, 1, i]
            plan[i] = area_moments[2 * s, 2, i] + area_moments[2 * s + 1, 2, i]
        width, draught = strip_beams[s], lateral[0] / model.strip_length
        if draught > 0.0:
            section = _interpolate(table, 0.5 * width / draught)
            sway = 0.5 * density * section * math.pi * draught**2 * model.strip_length
            _add_directed_mass(sway, 1, lateral, matrix)
        section = _interpolate(table, 2.0 * draught / width)
        heave = model.heave_end_factor * density * section * 0.25 * math.pi * width * plan[0]  # plan: half the bottom
        _add_directed_mass(heave, 2, plan, matrix)
        matrix[3, 3] += heave * (0.5 * model.roll_gyration * width) ** 2
    draught = frontal[0] / model.hull_beam
    if draught > 0.0:
        section = _interpolate(table, 0.5 * model.hull_length / draught)
        surge = 0.5 * density * section * math.pi * draught**2 * model.hull_beam
        _add_directed_mass(surge, 0, frontal, matrix)


@njit(cache=True, error_model="numpy")
def _filter_acceleration(motion: RecentMotion, body: int, filter_times: Array, filtered: Array) -> None:
    """Move a body's filtered acceleration (body axes, shape (6,)) through the samples since the last call."""
    before = motion.since
    for sample in range(motion.time.shape[0]):
        interval = motion.time[sample] - before
        before = motion.time[sample]
        for k in range(6):
            value = 0.0
            for i in range(3):
                part = motion.acceleration[sample, body, i] if k < 3 else motion.angular_acceleration[sample, body, i]
                value += motion.rotation[sample, body, i, k % 3] * part
            filtered[k] += (1.0 - math.exp(-interval / filter_times[k])) * (value - filtered[k])
