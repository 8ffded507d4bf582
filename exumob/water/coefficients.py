"""Water loads from published coefficients: hydrostatics, quasi-steady drag and added mass of five independent bodies.

This is the reduced-order kind of model that the paper argues against, and so the baseline. It leaves out the waves and
wakes of the vehicle, the flow between hull, wheels and bed (blockage, shallow-water added mass), lift and the Munk
moment, memory of the flow, slamming, and the spin of the wheels. All published values are those of a single body in
unbounded flow; the free surface acts as a mirror ("double body": hull and image have twice the area and twice the
force, so that the same coefficient holds for the wetted half).
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
import xarray as xr

from exumob.ground.terrain import Terrain
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.support.declared import Declared, checked
from exumob.support.quantities import Quantity
from exumob.vehicle.body import is_plain
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.coefficient_kernels import (
    ADDED_MASS,
    DRAG,
    HYDROSTATIC,
    BodyPanels,
    ModelParameters,
    RecentMotion,
    evaluate_wrenches,
)
from exumob.water.conditions import Water, require_within
from exumob.water.hydrostatics import WET_INTEGRALS, clipping_space, wet_integrals
from exumob.water.wetted_surface import Surface, body_surfaces, frontal_share

Table = tuple[tuple[float, float], ...]
COEFFICIENT = Quantity("1", at_least=0.0, at_most=100.0, remedy="coefficients refer to the wetted area; give a number.")
"""Drag or added-mass coefficient, or the ratio that it belongs to"""


@dataclass(frozen=True)
class Coefficients(Declared):
    """Published drag and added-mass coefficients, each of a simple shape that is like the body [-].

    A table is pairs of a ratio and a coefficient, linear in between and constant beyond its ends. Drag coefficients
    refer to the wetted projected area, force = C / 2 density area speed^2.

    Raises
    ------
    ValueError
        If a coefficient is negative or a table's ratios do not increase.
    """

    hull_surge_drag: Annotated[float, COEFFICIENT] = 0.81
    """Blunt cylinder along the flow, length/diameter > 2: Hoerner, Fluid-Dynamic Drag (1965), Ch. 3 (blunt nose)"""
    hull_sway_drag: Annotated[Table, COEFFICIENT] = (
        (0.1, 1.9), (0.5, 2.5), (0.65, 2.9), (1.0, 2.2), (2.0, 1.6), (3.0, 1.3), (6.0, 0.9),
    )  # fmt: skip
    """Rectangular section, by length along / height across the flow (here beam / twice the draught), Re 1e5: Munson et
    al., Fundamentals of Fluid Mechanics (6th ed.), Fig. 9.19; ratio 6: White, Fluid Mechanics, Table 7.2"""
    hull_heave_drag: Annotated[float, COEFFICIENT] = 1.17
    """Square plate across the flow: Hoerner (1965), Ch. 3 (DNV-RP-H103, Table B-2: 1.16, and 1.20 at length/width 5);
    a hull whose bottom alone is wet feels half of it"""
    wheel_plane_drag: Annotated[float, COEFFICIENT] = 0.58
    """Open rotating wheel, width/diameter 0.28, on its frontal area: Matthews, Aeronautical Engineer's Data Book,
    Fig. 5.13 (a cylinder of length = diameter across the flow: 0.63, same table)"""
    wheel_axial_drag: Annotated[float, COEFFICIENT] = 1.1
    """Circular cylinder along the flow, length/diameter 0.5: Munson et al., Fig. 9.20 (a thin disk: 1.17)"""
    section_added_mass: Annotated[Table, COEFFICIENT] = (
        (0.0, 1.00), (0.1, 1.14), (0.2, 1.21), (0.5, 1.36), (1.0, 1.51), (2.0, 1.70), (5.0, 1.98), (10.0, 2.23),
    )  # fmt: skip
    """Rectangular section 2a across by 2b along the motion, by b/a; times density pi a^2: DNV-RP-C205 (2010), App. D,
    Table D-1 (a panel method gives the same to 0.01)"""
    plate_added_mass: Annotated[Table, COEFFICIENT] = (
        (1.0, 0.579), (1.25, 0.642), (1.5, 0.690), (2.0, 0.757), (2.5, 0.801), (3.0, 0.830), (4.0, 0.872), (5.0, 0.897),
        (6.25, 0.917), (8.0, 0.934), (10.0, 0.947),
    )  # fmt: skip
    """Rectangular plate across the motion, by length/width; the share of its strips' added mass that is left by the
    flow round the ends: DNV-RP-C205 (2010), App. D, Table D-2. Used in heave"""
    hull_roll_gyration: Annotated[float, COEFFICIENT] = math.sqrt(1.0 / 8.0)
    """Radius of gyration of a section's heave added mass in roll, over half the beam: a plate rolling about its middle,
    density pi a^4 / 8, and heaving, density pi a^2 (DNV-RP-C205, Table D-1; Newman, Marine Hydrodynamics, 1977)"""
    wheel_added_mass: Annotated[tuple[float, float] | None, COEFFICIENT] = None
    """(In the wheel's plane, along its axle) over the displaced mass; None: the spheroid with the wheel's ratio of
    width to diameter, Lamb, Hydrodynamics (1932), Art. 114 and 373"""
    entry_draught: Annotated[float, Quantity("m", above=0.0, at_most=10.0, plausible=(1e-4, 1.0))] = 0.010
    """Draught over which drag and added mass of a body build up from zero, chosen by us: otherwise they would jump
    when a level flat bottom touches the water. The slam itself is not modelled"""

    def _check(self) -> None:
        for name in ("hull_sway_drag", "section_added_mass", "plate_added_mass"):
            ratios = [ratio for ratio, _ in getattr(self, name)]
            if len(ratios) < 2 or any(later <= earlier for earlier, later in itertools.pairwise(ratios)):
                raise ValueError(
                    f"Coefficients.{name}: the ratios {ratios} must be two or more and increase; sort the pairs."
                )


class CoefficientHydrodynamics:
    """Hydrostatics of the wetted geometry, quasi-steady drag and added mass with published coefficients.

    The hydrostatic part is exact for each body's surface as it lies in still water: horizontal at the level at the
    body's place, over the bed below it. It is taken half a macro step ahead (along the body's present velocity), so
    that holding it over the step does no work on a heaving body to first order.

    The drag acts on each cell of a surface along each body axis: -C/2 density area |u| u, with the velocity u of the
    cell's wetted centre relative to the undisturbed current at the strip or wheel. The hull's cells are half strips
    (cross-flow drag, with yaw rate); a wheel is one cell.

    The added-mass part is minus the added-mass matrix of the present wetted geometry times the filtered acceleration
    (see `exumob.water.coefficient_kernels.filter_time`); the undisturbed flow is steady.

    Parameters
    ----------
    coefficients : Coefficients, optional
        Default: the published values.
    pore_pressure : bool
        False leaves out the water's pressure on the parts below the undisturbed soil surface.
    added_mass : bool
        False leaves out the added mass.
    """

    @checked
    def __init__(
        self, coefficients: Coefficients | None = None, *, pore_pressure: bool = True, added_mass: bool = True
    ) -> None:
        self.coefficients = Coefficients() if coefficients is None else coefficients
        self.pore_pressure = pore_pressure
        self.added_mass = added_mass
        self.parameters = {
            "coefficients": asdict(self.coefficients), "pore_pressure": pore_pressure, "added_mass": added_mass,
        }  # fmt: skip
        """The chosen settings, as kept in results."""
        self._water: Water | None = None
        self._bed = Terrain()

    def set_bed(self, terrain: Terrain) -> None:
        """Take the ground of the runs to come. See `exumob.water.hydrodynamics.BedHydrodynamics`."""
        self._bed = terrain

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
        length, beam = np.ptp(surfaces[0].triangles.reshape(-1, 3), axis=0)[:2]
        strip_length = length / (surfaces[0].n_cells // 2)
        self._panels = BodyPanels(
            triangles=np.concatenate([surface.triangles for surface in surfaces]),
            cells=np.concatenate([surface.cells for surface in surfaces]),
            first_triangle=np.cumsum([0] + [len(surface.triangles) for surface in surfaces]),
            strip_beams=_strip_beams(surfaces[0], strip_length),
            strip_centers=_strip_centers(surfaces[0], strip_length),
        )
        chosen = self.coefficients
        in_plane, axial = chosen.wheel_added_mass or spheroid_added_mass(vehicle.wheel.width / vehicle.wheel.diameter)
        self._model = ModelParameters(
            density=float(water.density),
            surroundings=water.over(self._bed),
            macro_step=float(macro_step),
            entry_draught=float(chosen.entry_draught),
            hull_length=float(length),
            hull_beam=float(beam),
            strip_length=float(strip_length),
            heave_end_factor=float(np.interp(length / beam, *_columns(chosen.plate_added_mass))),
            roll_gyration=float(chosen.hull_roll_gyration),
            wheel_in_plane_added_mass=float(in_plane),
            wheel_axial_added_mass=float(axial),
            drag_coefficients=_drag_coefficients(chosen),
            sway_drag=_columns(chosen.hull_sway_drag),
            section_added_mass=_columns(chosen.section_added_mass),
            rigid_masses=_rigid_masses(vehicle),
            frontal_share=1.0 if is_plain(vehicle.hull) else frontal_share(surfaces[0]),
            pore_pressure=bool(self.pore_pressure),
            added_mass=bool(self.added_mass),
        )

    def wrenches(self, history: BodyStates, predict: Callable[[], BodyStates]) -> Array:
        """Return the wrenches for the macro step that begins now; `predict` is not called. See `Hydrodynamics`."""
        if self._water is None:
            return np.zeros((5, 6))
        now = float(history.time[-1])
        if math.isnan(self._sampled_until):
            self._sampled_until = now
        first = min(bisect_left(history.time, self._sampled_until + 1.0e-9), len(history) - 1)
        require_within(self._water, history)
        motion = RecentMotion(
            since=self._sampled_until,
            time=_contiguous_copy(history.time[first:]),
            rotation=_contiguous_copy(history.rotation[first:]),
            acceleration=_contiguous_copy(history.acceleration[first:]),
            angular_acceleration=_contiguous_copy(history.angular_acceleration[first:]),
            position=_contiguous_copy(history.position[-1]),
            velocity=_contiguous_copy(history.velocity[-1]),
            angular_velocity=_contiguous_copy(history.angular_velocity[-1]),
        )
        parts, filter_times = np.zeros((3, 5, 6)), np.empty((5, 6))
        evaluate_wrenches(
            self._panels, self._model, motion, self._filtered, self._added_mass_matrices, parts, filter_times
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
        """Return the parts of the wrenches and the time constants of the filter; empty without water."""
        if not self._times:
            return {}
        time = xr.Variable("macro_time", self._times, {"units": "s", "long_name": "start of the macro step"})
        coords = {"macro_time": time, "body": list(BODIES), "component": list(WRENCH_COMPONENTS)}
        parts = np.array(self._parts)
        series = {
            "hydrostatic_load": (parts[:, HYDROSTATIC], "N, N m", "hydrostatic part of the water load, body axes"),
            "drag_load": (parts[:, DRAG], "N, N m", "quasi-steady drag part of the water load, body axes"),
            "added_mass_load": (parts[:, ADDED_MASS], "N, N m", "added-mass part of the water load, body axes"),
            "added_mass_filter_time": (np.array(self._filter_times), "s", "time constant of the acceleration filter"),
        }
        return {
            name: xr.DataArray(values, coords, tuple(coords), attrs={"units": units, "long_name": long_name})
            for name, (values, units, long_name) in series.items()
        }


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


def _contiguous_copy(values: Array) -> Array:
    """Return a writable copy in C order: one memory layout, so that the kernel is compiled once."""
    return np.array(values, dtype=float, order="C")


def _columns(table: Table) -> Array:
    """Return a table of pairs as two rows, ratios and coefficients, shape (2, n)."""
    return np.array(table, dtype=float).T.copy()


def _drag_coefficients(chosen: Coefficients) -> Array:
    """Return the drag coefficients of each body along its axes [-], shape (5, 3); nan: the hull's table for sway."""
    hull = [chosen.hull_surge_drag, math.nan, chosen.hull_heave_drag]
    wheel = [chosen.wheel_plane_drag, chosen.wheel_axial_drag, chosen.wheel_plane_drag]
    return np.array([hull, wheel, wheel, wheel, wheel])


def _strip_beams(hull: Surface, strip_length: float) -> Array:
    """Return the mean beam of each strip of the fully wetted hull [m], shape (strips,)."""
    moments = np.zeros((hull.n_cells, 3, 4))
    above = 2.0 * float(np.abs(hull.triangles).max())  # deep enough to wet the whole hull
    place, totals = np.array([0.0, 0.0, above]), np.zeros(1, WET_INTEGRALS)
    wet_integrals(
        hull.triangles, hull.cells, np.eye(3), place, 2.0 * above, *Terrain().as_arrays(), totals, moments,
        clipping_space(),
    )  # fmt: skip
    return moments[:, 2, 0].reshape(-1, 2).sum(axis=1) / strip_length


def _strip_centers(hull: Surface, strip_length: float) -> Array:
    """Return the middle of each strip along the hull's x axis [m], shape (strips,)."""
    stern = float(hull.triangles[..., 0].min())
    return np.asarray(stern + strip_length * (np.arange(hull.n_cells // 2) + 0.5), dtype=np.float64)


def _rigid_masses(vehicle: Vehicle) -> Array:
    """Return the mass (three times) and principal moments of inertia of each body [kg, kg m^2], shape (5, 6)."""
    masses = np.empty((5, 6))
    masses[0, :3] = vehicle.hull.mass
    masses[0, 3:] = np.diag(vehicle.hull.inertia_tensor)
    front, rear = vehicle.axle_suspensions
    for wheel, suspension in enumerate((front, front, rear, rear), start=1):
        masses[wheel, :3] = vehicle.wheel.mass + suspension.upright_mass
        masses[wheel, 3:] = np.diag(vehicle.wheel.inertia_tensor + suspension.upright_inertia_tensor)
        masses[wheel, 4] = suspension.upright_inertia_tensor[1, 1]  # the spinning wheel does not pitch with its upright
    return masses
