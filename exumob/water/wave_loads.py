"""Loads of the waves that a vehicle makes in shallow water: what published coefficients lack, fitted to flow runs.

A hull that moves through shallow water heaps it up before its bow, is sucked down or lifted by it, and trims; wheels
stand in the stream that the hull has parted. These loads grow with the square of the speed through the water u, and in
what form they depend on the rest is written down by dimensional analysis. With the local depth h, the draught T of the
hull's lowest point (negative: it is above the level), Froude's number F = |u| / sqrt(g h), and

    w = clip((T + min(u^2 / 2 g, h)) / h, 0, 1),   t = clip(T / h, 0, 0.6),

(w: how far the heap, no higher than the depth, reaches up the hull), each load is a sum of a few terms with one
dimensionless coefficient each. So the same numbers serve a vehicle of another size at the same Froude number. They are
fitted by `exumob.learning.calibration`; `studies/calibrate_coefficients.py` makes those that come with exumob, and says
how far they carry over to other vehicles.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.files import PACKAGE
from exumob.support.kernels import njit
from exumob.vehicle.motion import WRENCH_COMPONENTS, BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import WaterOverBed
from exumob.water.flow_states import horizontal_motion, local_current, local_depth
from exumob.water.wetted_surface import body_surfaces

FITTED = PACKAGE / "water" / "wave_loads.json"
"""The coefficients, with the runs to which they were fitted; `studies/calibrate_coefficients.py` writes them."""
MOST_FROUDE, MOST_DRAUGHT = 1.5, 0.6
"""Froude's number, and draught over depth (of a wheel: over its diameter), beyond which the coefficients change no
more [-]. The runs to which they were fitted reach 1.3 where the hull is a third of the depth in the water and 1.85
where its keel touches it, and three fifths of the wheels; those of the other vehicles three fifths of the depth."""
TERMS = 6
"""Most terms of a load."""
KINDS = ("hull", "front", "rear")
"""Bodies with coefficients of their own: the hull, the front wheels, the rear wheels."""
KIND_OF_BODY = (0, 1, 1, 2, 2)
"""Index of `KINDS` for each body."""
_EVEN = ("w", "w F", "w F^2", "w t", "w t F")
_ODD = ("w", "w F", "w t", "turn w", "turn w F")
_WHEEL = ("1", "F", "T/D")
FORMS: dict[str, dict[str, tuple[str, ...]]] = {
    "hull": {"Fx": _EVEN[:3], "Fy": _ODD, "Fz": _EVEN, "Mx": _ODD, "My": _EVEN, "Mz": _ODD},
    "front": {
        "Fx": _WHEEL, "Fy": (*_WHEEL, "wash", "aside 1", "aside F"), "Fz": _WHEEL,
        "Mx": (*_WHEEL, "wash", "aside 1", "aside F"), "My": _WHEEL,
    },
    "rear": dict.fromkeys(("Fx", "Fy", "Fz", "Mx", "My"), _WHEEL),
}  # fmt: skip
"""The terms of each load.

Of the hull, with its length L and beam B: Fx over density u |u| / 2 B h; Fz over density u^2 / 2 B L, My the same with
u |u| and another L; Fy over density / 2 L h |u| v with the speed v to the left, its terms "turn" with u r L for |u| v,
where r is the yaw rate; Mx as Fy with another L; Mz the same with u v and |u| r L. Of a wheel, immersed by T: over
density u |u| / 2 (Fx, My) or u^2 / 2 (Fz) times its wetted frontal area, and its diameter D (My); Fy over
density / 2 D T |u| v, the lift of a disk that is turned to the stream, and Mx the same with the arm from the axle to
the middle of T; "wash": with the wheel's speed to the left of the hull's heading for that to the left of its own, as
the water before a drifting hull goes with it; "aside": with u^2 outward, as the hull parts the water. With these signs
each load turns with u as it must; in reverse front and rear wheels keep their own. Terms with pitch, roll or heaving
were tried and left out: such attitudes were small in the runs, and a pitch moment that grows with the pitch made
another vehicle dive."""


class VehicleLengths(NamedTuple):
    """The lengths of a vehicle that the terms refer to [m]."""

    hull_length: float
    hull_beam: float
    hull_lowest: float
    """Lowest point of the hull below its origin"""
    wheel_diameter: float
    wheel_width: float
    rear_exposed: float
    """Part of the rear wheels' width that stands out from the hull's beam [-]: within it they are in the hull's wake,
    and have no drag of waves"""


@dataclass(frozen=True)
class WaveCoefficients:
    """Dimensionless coefficients of the terms, in the order of `FORMS`."""

    SHAPE: ClassVar = (len(KINDS), len(WRENCH_COMPONENTS), TERMS)
    values: Array
    """Shape (3, 6, 6): kind of body, component, term; 0 where there is none"""
    about: dict[str, Any]
    """Origin: command, revision, runs, ranges"""

    @property
    def by_body(self) -> Array:
        """Coefficients of the five bodies, shape (5, 6, 6)."""
        return self.values[list(KIND_OF_BODY)]

    def digest(self) -> str:
        """Return a short hash of the coefficients."""
        return hashlib.sha256(self.values.tobytes()).hexdigest()[:16]

    @property
    def terms(self) -> dict[str, dict[str, dict[str, float]]]:
        """Coefficients by kind of body, component and term, as files keep them."""
        return {
            kind: {
                name: dict(zip(forms, map(float, self.values[n, WRENCH_COMPONENTS.index(name)]), strict=False))
                for name, forms in FORMS[kind].items()
            }
            for n, kind in enumerate(KINDS)
        }  # fmt: skip

    @classmethod
    def of_terms(cls, terms: Any, about: dict[str, Any]) -> WaveCoefficients:
        """Return the coefficients of `terms`.

        Raises
        ------
        ValueError
            If it has other terms than these forms, or a value is no finite number.
        """
        values = np.zeros(cls.SHAPE)
        try:
            for n, kind in enumerate(KINDS):
                for name, forms in FORMS[kind].items():
                    given = terms[kind][name]
                    if tuple(given) != forms:
                        raise ValueError(f"{kind} {name} has the terms {', '.join(map(str, given))}")
                    values[n, WRENCH_COMPONENTS.index(name), : len(forms)] = [float(given[form]) for form in forms]
        except (KeyError, TypeError, AttributeError, OverflowError) as error:
            raise ValueError(f"{type(error).__name__} {error}") from None
        if not np.isfinite(values).all():
            raise ValueError("not all of them are finite")
        return cls(values, about)

    def save(self, file: Path) -> None:
        """Write them as JSON text."""
        file.write_text(json.dumps(self.about | {"coefficients": self.terms}, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, file: Path) -> WaveCoefficients:
        """Read a file of `save`."""
        about = json.loads(file.read_text(encoding="utf-8"))
        return cls.of_terms(about.pop("coefficients"), about)


@cache
def fitted_coefficients() -> WaveCoefficients:
    """Return the coefficients that come with exumob."""
    return WaveCoefficients.load(FITTED)


def vehicle_lengths(vehicle: Vehicle) -> VehicleLengths:
    """Return the lengths that the terms refer to, from the hull's surface and the wheels."""
    corners = body_surfaces(vehicle)[0].triangles.reshape(-1, 3)
    length, beam = np.ptp(corners, axis=0)[:2]
    outside = (0.5 * (vehicle.track + vehicle.wheel.width) - 0.5 * float(beam)) / vehicle.wheel.width
    return VehicleLengths(
        float(length), float(beam), -float(corners[:, 2].min()), vehicle.wheel.diameter, vehicle.wheel.width,
        min(max(outside, 0.0), 1.0),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def wave_terms(
    lengths: VehicleLengths, density: float, around: WaterOverBed, position: Array, rotation: Array, velocity: Array,
    angular_velocity: Array, terms: Array,
) -> None:  # fmt: skip
    """Evaluate all terms, dimensions included, for one instant.

    Parameters
    ----------
    lengths : VehicleLengths
    density : float
        Of the water [kg/m^3].
    around : WaterOverBed
    position, rotation, velocity, angular_velocity : arrays, shape (5, 3), (5, 3, 3), (5, 3), (5, 3)
        Of the bodies, as in `exumob.vehicle.motion.BodyStates`, world axes.
    terms : array, shape (5, 6, 6), changed
        Body, component, term [N, N m]: times their coefficients they add up to the loads.
    """
    terms[:] = 0.0
    half = 0.5 * density
    heading = horizontal_motion(rotation[0], velocity[0])
    for body in range(5):
        depth = local_depth(around, position[body, 0], position[body, 1])
        if depth <= 0.0:
            continue
        turn = rotation[body]
        motion = horizontal_motion(turn, velocity[body])
        level, current_x, current_y, _, _ = local_current(
            around.water[0], around.water_nodes, position[body, 0], position[body, 1]
        )
        u = motion.forward - motion.cos * current_x - motion.sin * current_y
        froude = min(abs(u) / math.sqrt(GRAVITY * depth), MOST_FROUDE)
        along, square = u * abs(u), u * u
        v = motion.lateral - motion.cos * current_y + motion.sin * current_x
        if body > 0:
            diameter = lengths.wheel_diameter
            draught = min(max(level - position[body, 2] + 0.5 * diameter, 0.0), diameter)
            immersed = min(draught / diameter, MOST_DRAUGHT)
            area = half * lengths.wheel_width * draught * (lengths.rear_exposed if body > 2 else 1.0)
            for k, strength in ((0, along), (2, square), (4, along * diameter)):
                terms[body, k, 0] = area * strength
                terms[body, k, 1] = area * strength * froude
                terms[body, k, 2] = area * strength * immersed
            face = half * diameter * draught
            drift = heading.cos * (velocity[body, 1] - current_y) - heading.sin * (velocity[body, 0] - current_x)
            for k, arm in ((1, 1.0), (3, 0.5 * (diameter - draught))):
                terms[body, k, 0] = face * arm * abs(u) * v
                terms[body, k, 1] = face * arm * froude * abs(u) * v
                terms[body, k, 2] = face * arm * immersed * abs(u) * v
                if body < 3:
                    terms[body, k, 3] = face * arm * abs(u) * drift
                    outward = 1.0 if body == 1 else -1.0
                    terms[body, k, 4] = face * arm * outward * square
                    terms[body, k, 5] = face * arm * outward * froude * square
            continue
        length, beam, turning = lengths.hull_length, lengths.hull_beam, angular_velocity[0, 2] * lengths.hull_length
        draught = level - position[0, 2] + lengths.hull_lowest
        wet = min(max((draught + min(square / (2.0 * GRAVITY), depth)) / depth, 0.0), 1.0)
        t = min(max(draught / depth, 0.0), MOST_DRAUGHT)
        plan, side = half * beam * length * wet, half * length * depth * wet
        for k, strength in (
            (0, half * beam * depth * wet * along), (2, plan * square), (4, plan * length * along),
        ):  # fmt: skip
            terms[0, k, 0] = strength
            terms[0, k, 1] = froude * strength
            terms[0, k, 2] = froude * froude * strength
            if k > 0:
                terms[0, k, 3] = t * strength
                terms[0, k, 4] = t * froude * strength
        for k, across, turned in (
            (1, abs(u) * v, u * turning), (3, length * abs(u) * v, length * u * turning),
            (5, length * u * v, length * abs(u) * turning),
        ):  # fmt: skip
            terms[0, k, 0] = side * across
            terms[0, k, 1] = side * froude * across
            terms[0, k, 2] = side * t * across
            terms[0, k, 3] = side * turned
            terms[0, k, 4] = side * froude * turned


@njit(cache=True, error_model="numpy")
def wave_loads(
    lengths: VehicleLengths, density: float, around: WaterOverBed, position: Array, rotation: Array, velocity: Array,
    angular_velocity: Array, coefficients: Array,
) -> Array:  # fmt: skip
    """Return the loads of the waves on the five bodies, body axes about their origins [N, N m], shape (5, 6).

    Parameters
    ----------
    lengths, density, around, position, rotation, velocity, angular_velocity
        See `wave_terms`.
    coefficients : array, shape (5, 6, 6)
        `WaveCoefficients.by_body`.
    """
    terms = np.empty(coefficients.shape)
    wave_terms(lengths, density, around, position, rotation, velocity, angular_velocity, terms)
    return (terms * coefficients).sum(axis=2)


def wave_loads_along(
    vehicle: Vehicle, around: WaterOverBed, density: float, states: BodyStates, waves: WaveCoefficients
) -> Array:
    """Return `wave_loads` at all instants of a motion [N, N m], shape (n, 5, 6)."""
    return np.asarray((terms_along(vehicle, around, density, states) * waves.by_body).sum(axis=-1))


def terms_along(vehicle: Vehicle, around: WaterOverBed, density: float, states: BodyStates) -> Array:
    """Return `wave_terms` at all instants of a motion, shape (n, 5, 6, 6)."""
    lengths = vehicle_lengths(vehicle)
    found = np.empty((len(states), 5, len(WRENCH_COMPONENTS), TERMS))
    for n in range(len(states)):
        wave_terms(
            lengths, density, around, *(np.ascontiguousarray(getattr(states, name)[n]) for name in (
                "position", "rotation", "velocity", "angular_velocity"
            )), found[n],
        )  # fmt: skip
    return found
