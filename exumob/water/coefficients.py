"""Water loads from published coefficients: hydrostatics, quasi-steady drag and added mass of five independent bodies.

The reduced-order kind of model that the paper argues against, and so the baseline. What it leaves out: waves and wakes
of the vehicle, the flow between hull, wheels and bed (blockage, shallow-water added mass), lift and the Munk moment,
memory of the flow, slamming, the spin of the wheels. All published values are those of a single body in unbounded
flow, the free surface being a mirror ("double body": hull and image have twice the area and twice the force, so that
the same coefficient holds for the wetted half).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import xarray as xr
from numba import njit

from exumob.support.arrays import Array
from exumob.support.checks import require_positive, require_within
from exumob.support.constants import GRAVITY
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from exumob.water.wetted_surface import N_SUMS, Integers, body_surfaces, wet_integrals

Table = tuple[tuple[float, float], ...]

FILTER_STEPS = 2.0
"""Lag of the added-mass load behind the acceleration, in macro steps; see `filter_time`."""


@dataclass(frozen=True)
class Coefficients:
    """Published drag and added-mass coefficients, each of a plain shape like the body's [-].

    A table is pairs of a ratio and a coefficient, linear in between and constant beyond its ends. Drag coefficients
    refer to the wetted projected area, force = C / 2 density area speed^2.

    Raises
    ------
    ValueError
        If a coefficient is negative or a table's ratios do not increase.
    """

    hull_surge_drag: float = 0.81
    """Blunt cylinder along the flow, length/diameter > 2: Hoerner, Fluid-Dynamic Drag (1965), Ch. 3 (blunt nose)"""
    hull_sway_drag: Table = (
        (0.1, 1.9), (0.5, 2.5), (0.65, 2.9), (1.0, 2.2), (2.0, 1.6), (3.0, 1.3), (6.0, 0.9),
    )  # fmt: skip
    """Rectangular section, by length along / height across the flow (here beam / twice the draught), Re 1e5: Munson et
    al., Fundamentals of Fluid Mechanics (6th ed.), Fig. 9.19; ratio 6: White, Fluid Mechanics, Table 7.2"""
    hull_heave_drag: float = 1.17
    """Square plate across the flow: Hoerner (1965), Ch. 3 (DNV-RP-H103, Table B-2: 1.16, and 1.20 at length/width 5);
    a hull whose bottom alone is wet feels half of it"""
    wheel_plane_drag: float = 0.58
    """Open rotating wheel, width/diameter 0.28, on its frontal area: Matthews, Aeronautical Engineer's Data Book,
    Fig. 5.13 (a cylinder of length = diameter across the flow: 0.63, same table)"""
    wheel_axial_drag: float = 1.1
    """Circular cylinder along the flow, length/diameter 0.5: Munson et al., Fig. 9.20 (a thin disk: 1.17)"""
    section_added_mass: Table = (
        (0.0, 1.00), (0.1, 1.14), (0.2, 1.21), (0.5, 1.36), (1.0, 1.51), (2.0, 1.70), (5.0, 1.98), (10.0, 2.23),
    )  # fmt: skip
    """Rectangular section 2a across by 2b along the motion, by b/a; times density pi a^2: DNV-RP-C205 (2010), App. D,
    Table D-1 (a panel method gives the same to 0.01)"""
    plate_added_mass: Table = (
        (1.0, 0.579), (1.25, 0.642), (1.5, 0.690), (2.0, 0.757), (2.5, 0.801), (3.0, 0.830), (4.0, 0.872), (5.0, 0.897),
        (6.25, 0.917), (8.0, 0.934), (10.0, 0.947),
    )  # fmt: skip
    """Rectangular plate across the motion, by length/width; the share of its strips' added mass that is left by the
    flow round the ends: DNV-RP-C205 (2010), App. D, Table D-2. Used in heave"""
    hull_roll_gyration: float = math.sqrt(1.0 / 8.0)
    """Radius of gyration of a section's heave added mass in roll, over half the beam: a plate rolling about its middle,
    density pi a^4 / 8, and heaving, density pi a^2 (DNV-RP-C205, Table D-1; Newman, Marine Hydrodynamics, 1977)"""
    wheel_added_mass: tuple[float, float] | None = None
    """(In the wheel's plane, along its axle) over the displaced mass; None: the spheroid with the wheel's ratio of
    width to diameter, Lamb, Hydrodynamics (1932), Art. 114 and 373"""
    entry_draught: float = 0.010
    """Draught over which drag and added mass of a body build up from zero [m]; ours: a level flat bottom would else
    meet them at once. The slam itself is not modelled"""

    def __post_init__(self) -> None:
        require_positive("Coefficients", entry_draught=self.entry_draught)
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in ("hull_sway_drag", "section_added_mass", "plate_added_mass"):
                _check_table(field.name, value)
            elif field.name == "wheel_added_mass":
                for part in value or ():
                    _check_coefficient(field.name, part)
            else:
                _check_coefficient(field.name, value)


class CoefficientHydrodynamics:
    """Hydrostatics of the wetted geometry, quasi-steady drag and added mass with published coefficients.

    Hydrostatics: exact for each body's surface as it lies in still water, taken half a macro step ahead (along the
    body's present velocity) so that holding the load over the step does no work on a heaving body to first order.
    Drag: on each cell of a surface and each body axis, -C/2 density area |u| u with the velocity u of the cell's wetted
    centre relative to the current: the hull's cells are strips (cross-flow drag, with yaw rate), a wheel is one cell.
    Added mass: minus the added-mass matrix of the present wetted geometry times the filtered acceleration (see
    `filter_time`), the water's own flow being steady.

    Parameters
    ----------
    coefficients : Coefficients
    pore_pressure : bool
        False leaves out the water's pressure on what lies below the undisturbed soil surface.
    added_mass : bool
        False leaves out the added mass.
    """

    def __init__(
        self, coefficients: Coefficients | None = None, *, pore_pressure: bool = True, added_mass: bool = True
    ) -> None:
        self.coefficients = coefficients or Coefficients()
        self.pore_pressure = pore_pressure
        self.added_mass = added_mass
        self.parameters = {
            "coefficients": asdict(self.coefficients), "pore_pressure": pore_pressure, "added_mass": added_mass,
        }  # fmt: skip
        """What was chosen, as kept in results."""
        self._water: Water | None = None

    def start(self, vehicle: Vehicle, water: Water | None, macro_step: float) -> None:
        """Build the surfaces and forget any earlier run."""
        require_positive("CoefficientHydrodynamics", macro_step=macro_step)
        self._water = water
        self._macro_step = macro_step
        self._times: list[float] = []
        self._parts: list[Array] = []
        self._filter_times: list[Array] = []
        self._filtered = np.zeros((5, 6))
        self._sampled_until = math.nan
        self._added_mass_matrices = np.zeros((5, 6, 6))
        if water is None:
            return

        surfaces = body_surfaces(vehicle)
        self._triangles = np.concatenate([surface.triangles for surface in surfaces])
        self._cells = np.concatenate([surface.cells for surface in surfaces])
        self._first_triangle = np.cumsum([0] + [len(surface.triangles) for surface in surfaces])
        hull = surfaces[0]
        areas = np.zeros((hull.n_cells, 3, 4))
        above = 2.0 * float(np.abs(hull.triangles).max())  # deep enough to wet the whole hull
        wet_integrals(
            hull.triangles, hull.cells, np.array([0.0, 0.0, 1.0]), above, 2.0 * above, np.zeros(N_SUMS), areas,
            np.empty((3, 9, 4)),
        )  # fmt: skip
        length, beam = np.ptp(hull.triangles.reshape(-1, 3), axis=0)[:2]
        strip = length / (hull.n_cells // 2)
        self._strip_beams = areas[:, 2, 0].reshape(-1, 2).sum(axis=1) / strip

        chosen = self.coefficients
        self._sway_table, self._section_table, plate_table = (
            np.array(table).T.copy()
            for table in (chosen.hull_sway_drag, chosen.section_added_mass, chosen.plate_added_mass)
        )
        in_plane, axial = chosen.wheel_added_mass or spheroid_added_mass(vehicle.wheel.width / vehicle.wheel.diameter)
        self._scalars = np.array(
            [
                water.density, water.depth, macro_step, chosen.entry_draught, length, beam, strip,
                np.interp(length / beam, *plate_table), chosen.hull_roll_gyration, in_plane, axial,
            ]
        )  # fmt: skip
        plane_drag = chosen.wheel_plane_drag
        self._drag_coefficients = np.array(
            [
                [chosen.hull_surge_drag, math.nan, chosen.hull_heave_drag],  # sway: from the table
                *[[plane_drag, chosen.wheel_axial_drag, plane_drag]] * 4,
            ]
        )
        self._masses = _rigid_masses(vehicle)

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the loads for the macro step that begins now; `predict` is not called. See `Hydrodynamics`."""
        if self._water is None:
            return np.zeros((5, 6))
        now = float(history.time[-1])
        if math.isnan(self._sampled_until):
            self._sampled_until = now
        first = min(int(np.searchsorted(history.time, self._sampled_until + 1.0e-9)), len(history) - 1)
        new = history[first:]
        parts, filter_times = np.zeros((3, 5, 6)), np.empty((5, 6))
        _evaluate(
            self._triangles, self._cells, self._first_triangle, self._strip_beams, self._scalars,
            self._drag_coefficients, self._sway_table, self._section_table, self._masses, self._water.velocity,
            self.pore_pressure, self.added_mass, self._sampled_until, _plain(new.time), _plain(new.position),
            _plain(new.rotation), _plain(new.velocity), _plain(new.angular_velocity), _plain(new.acceleration),
            _plain(new.angular_acceleration), self._filtered, self._added_mass_matrices, parts, filter_times,
        )  # fmt: skip
        self._sampled_until = now
        self._times.append(now)
        self._parts.append(parts)
        self._filter_times.append(filter_times)
        return parts.sum(axis=0)

    @property
    def added_mass_matrices(self) -> Array:
        """Added mass of each body at the last call, body axes about its origin [kg, kg m, kg m^2], shape (5, 6, 6)."""
        return self._added_mass_matrices.copy()

    def save(self, histories: bool = True) -> dict[str, Any]:
        """Return the filtered accelerations, the time they reach and the record, or its length only."""
        saved = {"filtered": self._filtered.copy(), "sampled_until": self._sampled_until, "count": len(self._times)}
        if histories:
            saved["times"] = np.array(self._times)
            saved["parts"] = np.array(self._parts).reshape(-1, 3, 5, 6)
            saved["filter_times"] = np.array(self._filter_times).reshape(-1, 5, 6)
        return saved

    def restore(self, saved: dict[str, Any]) -> None:
        """Return to a state given by `save`; a record kept after it is dropped."""
        self._filtered, self._sampled_until = saved["filtered"].copy(), saved["sampled_until"]
        if "times" in saved:
            self._times = [float(t) for t in saved["times"]]
            self._parts, self._filter_times = list(saved["parts"]), list(saved["filter_times"])
        count = saved["count"]
        del self._times[count:], self._parts[count:], self._filter_times[count:]

    def record(self) -> dict[str, xr.DataArray]:
        """Parts of the loads and the filter's time constants, one sample a macro step; empty without water."""
        if not self._times:
            return {}
        time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
        coords = {"macro_time": time, "body": list(BODIES), "component": list(WRENCH_COMPONENTS)}
        parts = np.array(self._parts)
        series = {
            "hydrostatic_load": (parts[:, 0], "N, N m", "hydrostatic part of the water load, body axes"),
            "drag_load": (parts[:, 1], "N, N m", "quasi-steady drag part of the water load, body axes"),
            "added_mass_load": (parts[:, 2], "N, N m", "added-mass part of the water load, body axes"),
            "added_mass_filter_time": (np.array(self._filter_times), "s", "time constant of the acceleration filter"),
        }
        return {
            name: xr.DataArray(values, coords, tuple(coords), attrs={"units": units, "long_name": long_name})
            for name, (values, units, long_name) in series.items()
        }


@njit(cache=True, error_model="numpy")
def filter_time(macro_step: float, added_mass: float, mass: float) -> float:
    """Time constant of the first-order filter tau a_f' = a - a_f behind the added-mass load -m_a a_f.

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
        Of the same kind [kg or kg m^2].

    Returns
    -------
    float
        tau [s].
    """
    return FILTER_STEPS * macro_step * (1.0 + added_mass / mass)


def spheroid_added_mass(aspect: float) -> tuple[float, float]:
    """Return the added mass of a spheroid over its displaced mass, across and along its axis of symmetry.

    Parameters
    ----------
    aspect : float
        Axis of symmetry over diameter [-], > 0: below 1 a disk-like, above 1 a rod-like spheroid.

    References
    ----------
    Lamb, Hydrodynamics (1932), Art. 114 and 373.
    """
    require_positive("spheroid_added_mass", aspect=aspect)
    if abs(aspect - 1.0) < 1.0e-3:  # the two formulas lose digits near the sphere
        return 0.5, 0.5
    if aspect < 1.0:
        e = math.sqrt(1.0 - aspect**2)
        gamma = 2.0 / e**2 * (1.0 - aspect / e * math.asin(e))
    else:
        e = math.sqrt(1.0 - 1.0 / aspect**2)
        gamma = 2.0 * (1.0 - e**2) / e**3 * (math.atanh(e) - e)
    alpha = 1.0 - 0.5 * gamma
    return alpha / (2.0 - alpha), gamma / (2.0 - gamma)


def _plain(values: Array) -> Array:
    """Writable copy in C order: one memory layout, so that the kernel is compiled once."""
    return np.array(values, dtype=float, order="C")


def _check_table(name: str, table: Table) -> None:
    """Raise unless the ratios increase and the coefficients are not negative."""
    ratios = [ratio for ratio, _ in table]
    if len(table) < 2 or any(later <= earlier for earlier, later in itertools.pairwise(ratios)):
        raise ValueError(f"Coefficients.{name}: the ratios {ratios} must be two or more and increase; sort the pairs.")
    for _, value in table:
        _check_coefficient(name, value)


def _check_coefficient(name: str, value: float) -> None:
    """Raise unless a coefficient is a number from 0 to 100."""
    require_within("Coefficients", 0.0, 100.0, "coefficients refer to the wetted area [-].", **{name: value})


def _rigid_masses(vehicle: Vehicle) -> Array:
    """Mass (three times) and principal moments of inertia of each body [kg, kg m^2], shape (5, 6)."""
    masses = np.empty((5, 6))
    masses[0, :3] = vehicle.hull.mass
    masses[0, 3:] = np.diag(vehicle.hull.inertia_tensor)
    front, rear = vehicle.axle_suspensions
    for wheel, suspension in enumerate((front, front, rear, rear), start=1):
        masses[wheel, :3] = vehicle.wheel.mass + suspension.upright_mass
        masses[wheel, 3:] = np.diag(vehicle.wheel.inertia_tensor + suspension.upright_inertia_tensor)
        masses[wheel, 4] = suspension.upright_inertia_tensor[1, 1]  # the spinning wheel does not pitch with its upright
    return masses


@njit(cache=True, error_model="numpy")
def _evaluate(
    triangles: Array, cells: Integers, first_triangle: Integers, strip_beams: Array, scalars: Array,
    drag_coefficients: Array, sway_table: Array, section_table: Array, masses: Array, current: Array,
    pore_pressure: bool, with_added_mass: bool, sampled_until: float, time: Array, position: Array, rotation: Array,
    velocity: Array, angular_velocity: Array, acceleration: Array, angular_acceleration: Array, filtered: Array,
    matrices: Array, parts: Array, filter_times: Array,
) -> None:  # fmt: skip
    """Hydrostatic, drag and added-mass loads of the five bodies into `parts`; the filter moves on to time[-1]."""
    density, depth, macro_step, entry_draught = scalars[0], scalars[1], scalars[2], scalars[3]
    strip, in_plane, axial = scalars[6], scalars[9], scalars[10]
    scratch = np.empty((3, 9, 4))
    sums = np.empty(N_SUMS)
    all_areas = np.empty((2 * strip_beams.size, 3, 4))
    up, flow, spin = np.empty(3), np.empty(3), np.empty(3)
    for body in range(5):
        turn = rotation[-1, body]
        for k in range(3):
            flow[k], spin[k] = 0.0, 0.0
            for i in range(3):  # velocity relative to the current and angular velocity, body axes
                flow[k] += turn[i, k] * (velocity[-1, body, i] - current[i])
                spin[k] += turn[i, k] * angular_velocity[-1, body, i]
        height = position[-1, body, 2] + 0.5 * macro_step * velocity[-1, body, 2]
        _vertical_ahead(turn, spin, 0.5 * macro_step, up)

        areas = all_areas if body == 0 else all_areas[:1]
        sums[:] = 0.0
        areas[:] = 0.0
        first, last = first_triangle[body], first_triangle[body + 1]
        wet_integrals(triangles[first:last], cells[first:last], up, height, depth, sums, areas, scratch)
        for k in range(6):
            below = sums[6 + k] if pore_pressure else 0.0
            parts[0, body, k] = density * GRAVITY * (sums[k] + below)

        rise = min(sums[15] / entry_draught, 1.0)
        rise *= rise * (3.0 - 2.0 * rise)
        for cell in range(areas.shape[0]):
            for k in range(3):
                for i in range(4):
                    areas[cell, k, i] *= rise
        _add_drag(areas, density, drag_coefficients[body], strip_beams, strip, sway_table, flow, spin, parts[1, body])

        matrix = matrices[body]
        matrix[:] = 0.0
        if not with_added_mass:
            filter_times[body] = 0.0
            continue
        if body == 0:
            _hull_added_mass(areas, strip_beams, scalars, section_table, matrix)
        else:
            displaced = density * (sums[12] - sums[13]) * rise
            for k in range(3):
                _add_point_mass(displaced * (axial if k == 1 else in_plane), k, areas[0, k], matrix)
        for k in range(6):
            filter_times[body, k] = filter_time(macro_step, matrix[k, k], masses[body, k])
        _filter(
            time, sampled_until, rotation, acceleration, angular_acceleration, body, filter_times[body], filtered[body]
        )
        for k in range(6):
            for i in range(6):
                parts[2, body, k] -= matrix[k, i] * filtered[body, i]


@njit(cache=True, error_model="numpy")
def _vertical_ahead(turn: Array, spin: Array, ahead: float, up: Array) -> None:
    """World z in body axes a short time ahead."""
    x, y, z = turn[2, 0], turn[2, 1], turn[2, 2]
    up[0] = x - ahead * (spin[1] * z - spin[2] * y)
    up[1] = y - ahead * (spin[2] * x - spin[0] * z)
    up[2] = z - ahead * (spin[0] * y - spin[1] * x)
    norm = math.sqrt(up[0] ** 2 + up[1] ** 2 + up[2] ** 2)
    for k in range(3):
        up[k] /= norm


@njit(cache=True, error_model="numpy")
def _interpolate(table: Array, ratio: float) -> float:
    """Linear interpolation, constant beyond the ends."""
    if ratio <= table[0, 0]:
        return table[1, 0]
    for i in range(1, table.shape[1]):
        if ratio <= table[0, i]:
            part = (ratio - table[0, i - 1]) / (table[0, i] - table[0, i - 1])
            return table[1, i - 1] + part * (table[1, i] - table[1, i - 1])
    return table[1, -1]


@njit(cache=True, error_model="numpy")
def _add_drag(
    areas: Array, density: float, coefficients: Array, strip_beams: Array, strip: float, sway_table: Array,
    flow: Array, spin: Array, load: Array,
) -> None:  # fmt: skip
    """Drag of each cell along each body axis, at the centre of the cell's wetted area."""
    for cell in range(areas.shape[0]):
        for k in range(3):
            area = areas[cell, k, 0]
            if area <= 0.0:
                continue
            x, y, z = areas[cell, k, 1] / area, areas[cell, k, 2] / area, areas[cell, k, 3] / area
            coefficient = coefficients[k]
            if k == 0:
                speed = flow[0] + spin[1] * z - spin[2] * y
            elif k == 1:
                speed = flow[1] + spin[2] * x - spin[0] * z
                if math.isnan(coefficient):  # hull: a cell is half a strip
                    coefficient = _interpolate(sway_table, strip_beams[cell // 2] * strip / (4.0 * area))
            else:
                speed = flow[2] + spin[0] * y - spin[1] * x
            force = -0.5 * density * coefficient * area * abs(speed) * speed
            load[k] += force
            if k == 0:
                load[4] += z * force
                load[5] -= y * force
            elif k == 1:
                load[3] -= z * force
                load[5] += x * force
            else:
                load[3] += y * force
                load[4] -= x * force


@njit(cache=True, error_model="numpy")
def _add_point_mass(mass: float, k: int, moments: Array, matrix: Array) -> None:
    """Add a mass that resists motion along axis k only, at the centre of an area with first `moments`."""
    if mass <= 0.0 or moments[0] <= 0.0:
        return
    x, y, z = moments[1] / moments[0], moments[2] / moments[0], moments[3] / moments[0]
    arm = np.zeros(6)
    arm[k] = 1.0
    if k == 0:
        arm[4], arm[5] = z, -y
    elif k == 1:
        arm[3], arm[5] = -z, x
    else:
        arm[3], arm[4] = y, -x
    for i in range(6):
        for j in range(6):
            matrix[i, j] += mass * arm[i] * arm[j]


@njit(cache=True, error_model="numpy")
def _hull_added_mass(areas: Array, strip_beams: Array, scalars: Array, section_table: Array, matrix: Array) -> None:
    """Strip theory in sway and heave, one section in surge, all of the double body at the present draught."""
    density, length, beam, strip = scalars[0], scalars[4], scalars[5], scalars[6]
    end_share, gyration = scalars[7], scalars[8]
    frontal, lateral, plan = np.zeros(4), np.empty(4), np.empty(4)
    for s in range(strip_beams.size):
        for i in range(4):
            frontal[i] += areas[2 * s, 0, i] + areas[2 * s + 1, 0, i]
            lateral[i] = areas[2 * s, 1, i] + areas[2 * s + 1, 1, i]
            plan[i] = areas[2 * s, 2, i] + areas[2 * s + 1, 2, i]
        width, draught = strip_beams[s], lateral[0] / strip
        if draught > 0.0:
            section = _interpolate(section_table, 0.5 * width / draught)
            _add_point_mass(0.5 * density * section * math.pi * draught**2 * strip, 1, lateral, matrix)
        section = _interpolate(section_table, 2.0 * draught / width)
        heave = end_share * density * section * 0.25 * math.pi * width * plan[0]  # plan: half of the wet bottom
        _add_point_mass(heave, 2, plan, matrix)
        matrix[3, 3] += heave * (0.5 * gyration * width) ** 2
    draught = frontal[0] / beam
    if draught > 0.0:
        section = _interpolate(section_table, 0.5 * length / draught)
        _add_point_mass(0.5 * density * section * math.pi * draught**2 * beam, 0, frontal, matrix)


@njit(cache=True, error_model="numpy")
def _filter(
    time: Array, sampled_until: float, rotation: Array, acceleration: Array, angular_acceleration: Array, body: int,
    filter_times: Array, filtered: Array,
) -> None:  # fmt: skip
    """Move the filtered acceleration (body axes) through the samples after `sampled_until`."""
    before = sampled_until
    for sample in range(time.shape[0]):
        interval = time[sample] - before
        before = time[sample]
        for k in range(6):
            value = 0.0
            for i in range(3):
                part = acceleration[sample, body, i] if k < 3 else angular_acceleration[sample, body, i]
                value += rotation[sample, body, i, k % 3] * part
            filtered[k] += (1.0 - math.exp(-interval / filter_times[k])) * (value - filtered[k])
