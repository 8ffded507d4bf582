"""What is checked before a captive run: the cells, the window, the motion, the steps."""

from __future__ import annotations

import logging
import math

import numpy as np
from numpy.typing import NDArray

from exumob.flow.grid import Grid
from exumob.flow.solids import Solid, vehicle_solids
from exumob.flow.tread import Tread
from exumob.support.arrays import Array
from exumob.support.checks import require_positive
from exumob.towing_tank.motion import PrescribedMotion
from exumob.vehicle.motion import BODIES, WHEELS
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

logger = logging.getLogger(__name__)

ROUNDING = 0.02
"""By which a grid's cells may be larger than asked for, since whole cells must fit [-]."""
LEAST_CELLS_IN_GAP = 2.0
LEAST_CELLS_ACROSS_WHEEL = 4.0


def check_resolution(
    vehicle: Vehicle, grid: Grid, steering_range: tuple[float, float] = (0.0, 0.0), *, allow_coarse: bool = False
) -> None:
    """Find out before a run whether a grid can carry a vehicle.

    Gaps between hull and wheels and under the keel need two cells, a wheel's width four; hull and wheels must stay
    inside the window.

    Parameters
    ----------
    vehicle : Vehicle
    grid : Grid
        In the hull's frame.
    steering_range : (float, float)
        Smallest and largest angle of a front wheel during the run [rad].
    allow_coarse : bool
        Log a warning where cells are too coarse. A vehicle outside the window or a bad mesh is always an error.

    Raises
    ------
    ValueError
        Naming the gap or the wheel, its size, and the cell size that would do; or the window that would do; or if the
        hull's mesh is not watertight or not in the vehicle's frame.
    """
    checked_solids(vehicle, grid, steering_range, allow_coarse)


def checked_solids(
    vehicle: Vehicle, grid: Grid, steering_range: tuple[float, float], allow_coarse: bool, tread: Tread | None = None
) -> tuple[Solid, ...]:
    """Solids of the five bodies for a grid, after the checks of `check_resolution`; a mesh is sampled only once."""
    if vehicle.hull.mesh is not None:
        from exumob.water.wetted_surface import hull_surface

        hull_surface(vehicle)  # raises for a mesh that leaks, is turned inside out, or is in other units
    coarse = [np.diff(faces).max(initial=0.0, where=_spanned(faces, *extent)) for faces, extent in zip(
        (grid.x_faces, grid.y_faces), _reach(vehicle, grid), strict=True)]  # fmt: skip
    cell = float(max(coarse))
    solids = vehicle_solids(vehicle, grid.smallest_width, tread)
    hull, *_, wheel = solids
    angles = sorted({0.0, *np.linspace(*steering_range, 13)})
    gaps = [(_gap(vehicle, hull, wheel, angle, k), angle, k) for angle in angles for k in (0, 1)]
    gaps += [(_gap(vehicle, hull, wheel, 0.0, k), 0.0, k) for k in (2, 3)]
    gap, angle, k = min(gaps)
    if gap <= 0.0:
        raise ValueError(
            f"{vehicle.name}: the {_words(WHEELS[k])} wheel cuts {-1e3 * gap:.0f} mm into the hull when steered "
            f"{math.degrees(angle):.0f} deg; steer less, or widen the track."
        )
    keel = float(vehicle.hull.center_of_mass_height + hull.low[2])
    steered = f" steered {math.degrees(angle):.0f} deg" if abs(angle) > 0.005 else ""
    needs = [
        (f"the gap between hull and {_words(WHEELS[k])} wheel{steered}", gap, LEAST_CELLS_IN_GAP),
        ("the gap between keel and bed", keel, LEAST_CELLS_IN_GAP),
        ("a wheel's width", vehicle.wheel.width, LEAST_CELLS_ACROSS_WHEEL),
    ]
    lacking = [need for need in needs if need[1] / cell < need[2] * (1.0 - ROUNDING) and need[1] > 0.0]
    if not lacking:
        return solids
    finest = math.floor(1e4 * min(size / least for _, size, least in lacking)) / 1e4
    message = "; ".join(
        f"{what} of {1e3 * size:.1f} mm has {size / cell:.1f} cells of {1e3 * cell:.1f} mm and needs {least:g}"
        for what, size, least in lacking
    )
    if not allow_coarse:
        raise ValueError(
            f"{vehicle.name}: {message}; use a cell size of {finest:g} m or less, or accept coarse cells "
            "(allow_coarse, --coarse) for a quick look."
        )
    logger.warning("%s: %s; loads of this run are rough (%g m would do).", vehicle.name, message, finest)
    return solids


def _spanned(faces: Array, low: float, high: float) -> NDArray[np.bool_]:
    """Which cells overlap an extent."""
    return (faces[1:] > low) & (faces[:-1] < high)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _reach(vehicle: Vehicle, grid: Grid) -> list[tuple[float, float]]:
    """Extents of the five bodies along the grid's x and y [m]; raises if they leave the window."""
    hull, radius = vehicle.hull, vehicle.wheel.radius
    turning = math.hypot(radius, 0.5 * vehicle.wheel.width)
    middle = hull.center_x - hull.center_of_mass_x
    axles = np.array([0.5, -0.5]) * vehicle.wheelbase - hull.center_of_mass_x
    extents = [
        (min(middle - 0.5 * hull.length, axles[1] - radius), max(middle + 0.5 * hull.length, axles[0] + turning)),
        (-max(0.5 * hull.width, 0.5 * vehicle.track + turning), max(0.5 * hull.width, 0.5 * vehicle.track + turning)),
    ]
    margin = 3.0 * grid.smallest_width
    for axis, faces, (low, high) in zip("xy", (grid.x_faces, grid.y_faces), extents, strict=True):
        if low - margin < faces[0] or high + margin > faces[-1]:
            raise ValueError(
                f"{vehicle.name} reaches from {low:.3f} to {high:.3f} m along {axis} (from the hull's centre of mass), "
                f"the window only from {faces[0]:.3f} to {faces[-1]:.3f} m; Grid.{axis}_faces must reach three cells "
                f"({1e3 * margin:.0f} mm) beyond it on both sides, and some hull lengths for the waves."
            )
    return extents


def _gap(vehicle: Vehicle, hull: Solid, wheel: Solid, angle: float, k: int) -> float:
    """Least distance [m] between the hull and wheel k turned by `angle` [rad], from points on the wheel's surface."""
    radius, half, edge = wheel.shape.half_x, wheel.shape.half_y, wheel.shape.edge_radius
    around = np.linspace(0.0, 2.0 * math.pi, 37)[:-1]
    corner = np.linspace(0.0, 0.5 * math.pi, 7)
    rings = [(radius - edge * (1.0 - math.cos(a)), half - edge * (1.0 - math.sin(a))) for a in corner]
    rings += [(part * (radius - edge), half) for part in (0.5, 0.0)]
    rings += [(r, -y) for r, y in rings]
    points = np.array([[r * math.cos(a), y, r * math.sin(a)] for r, y in rings for a in around])
    c, s = math.cos(angle), math.sin(angle)
    turned = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return float(hull.distance(turned + vehicle.wheel_centers[k] - vehicle.hull_origin).min())


def whole_multiple(name: str, long: float, of: str, short: float) -> int:
    """How many of `short` make `long`."""
    require_positive("captive_run", **{name: long, of: short})
    ratio = long / short
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        raise ValueError(
            f"captive_run.{name} = {long:g} s must be a whole multiple of {of} = {short:g} s; choose "
            f"{name} = {max(round(ratio), 1) * short:.9g} s, say."
        )
    return round(ratio)


def check_motion(motion: PrescribedMotion, vehicle: Vehicle, water: Water, duration: float) -> tuple[float, float]:
    """Refuse a motion whose velocities are not its derivatives; return the range of the front wheels' angles [rad]."""
    from scipy.spatial.transform import Rotation

    h, low, high = 1.0e-5, 0.0, 0.0
    for time in np.linspace(h, max(duration - h, 2.0 * h), 201):
        before, now, after = (motion.poses(vehicle, water, time + shift) for shift in (-h, 0.0, h))
        if now.position.shape != (5, 3) or now.rotation.shape != (5, 3, 3):
            raise ValueError(
                f"motion.poses returned {now.position.shape} positions and {now.rotation.shape} rotations; it must "
                "give (5, 3) and (5, 3, 3), the order of exumob.vehicle.motion.BODIES."
            )
        values = (now.position, now.rotation, now.velocity, now.angular_velocity, now.spin)
        if not all(np.isfinite(value).all() for value in values):
            raise ValueError(f"motion.poses is not finite at {time:.4f} s; mend its definition.")
        rate = (after.position - before.position) / (2.0 * h)
        turned = Rotation.from_matrix(after.rotation @ before.rotation.mT).as_rotvec() / (2.0 * h)
        for name, found, given in (
            ("velocity", rate, now.velocity),
            ("angular_velocity", turned, now.angular_velocity),
        ):
            apart = np.abs(found - given).max(axis=1)
            k = int(apart.argmax())
            if apart[k] > 1e-3 * (1.0 + float(np.abs(given[k]).max())):
                raise ValueError(
                    f"motion.poses: the {name} of {BODIES[k]} at {time:.4f} s is {apart[k]:.3g} off the derivative of "
                    "its place; return velocities that belong to the positions and rotations (world axes)."
                )
        angles = front_wheel_angles(now.rotation)
        low, high = min(low, float(angles.min())), max(high, float(angles.max()))
    start = motion.poses(vehicle, water, 0.0)
    slip = np.linalg.norm(start.velocity - water.velocity, axis=1).max()
    if slip > 0.05:
        logger.warning(
            "motion: starts at %.2f m/s relative to the water; the first second shows the impulse. Start with the "
            "current and ramp the speed, as CaptiveMotion does.", slip,
        )  # fmt: skip
    limit = vehicle.steering.limit
    largest = max(abs(m[0]) for command in (-limit, limit) for m in vehicle.steering_angles((command, 0.0, 0.0)))
    if max(-low, high) > largest + 1e-9:
        raise ValueError(
            f"motion: steers a front wheel {math.degrees(max(-low, high)):.1f} deg, beyond the "
            f"{math.degrees(largest):.1f} deg of {vehicle.name}; steer less or raise Steering.limit."
        )
    return low, high


def front_wheel_angles(rotation: Array) -> Array:
    """Angles of the two front wheels to the hull's heading [rad], shape (..., 2), from rotations (..., 5, 3, 3)."""
    yaw = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return np.asarray((yaw[..., 1:3] - yaw[..., :1] + math.pi) % (2.0 * math.pi) - math.pi)
