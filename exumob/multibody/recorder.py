"""Memory of a run: the motion of the five bodies at short intervals, and full records at longer ones."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from exumob.multibody.applied_loads import LOADS
from exumob.multibody.energy_account import ENERGY_ACCOUNT
from exumob.multibody.rigid_body import angular_velocity, rotation_matrix
from exumob.support.arrays import Array
from exumob.support.kernels import njit
from exumob.vehicle.motion import HISTORY_STEP, BodyStates

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

RECORD = np.dtype(
    [
        ("motion", HISTORY),
        ("loads", LOADS),
        ("energy_account", ENERGY_ACCOUNT),
        ("spin_torque", "f8", (4,)),  # of the spin constraint on each wheel [N m]
        ("steering", "f8", (2,)),  # angles of the front wheels [rad]
        ("constraint_wrench", "f8", (9, 6)),  # on hull, uprights, wheels; world axes, about each origin
        ("constraint_error", "f8", (2,)),  # position level [m, rad], velocity level [rad/s]
    ],
    align=True,
)
"""All that is kept of one instant of a run."""


class SystemState(NamedTuple):
    """Live views of the state of the nine rigid bodies, hull, uprights, wheels; each of shape (63,)."""

    coordinates: Array
    velocities: Array
    accelerations: Array
    reference: Array
    """Reference coordinates, to be added to `coordinates`"""


class Recorder:
    """Keeps the history of the motion and the records of one run.

    Parameters
    ----------
    state : SystemState
        Live views from which samples are taken.
    duration : float
        Time for which there is room [s].
    record_step : float
        Interval between two records [s].
    """

    def __init__(self, state: SystemState, duration: float, record_step: float) -> None:
        """Make room."""
        self._state = state
        self._record_step = record_step
        self._history = np.zeros(round(duration / HISTORY_STEP) + 2, HISTORY)
        self._records = np.zeros(round(duration / record_step) + 2, RECORD)
        self._samples = self._rows = 0

    def clear(self) -> None:
        """Begin again at time 0."""
        self._samples = self._rows = 0

    def sample(self, time: float) -> None:
        """Add a sample of the motion at `time` [s], if the next one is due."""
        if time >= self._samples * HISTORY_STEP - 1e-9:
            self._take(time, self._history[self._samples % len(self._history)])
            self._samples += 1

    def record_is_due(self, time: float) -> bool:
        """Tell if `record_step` has passed since the last record."""
        return time >= self._rows * self._record_step - 1e-9

    def add_record(self, time: float, **values: Any) -> None:
        """Add a record with the motion at `time` [s] and the values of all other fields of `RECORD`."""
        row = self._records[self._rows % len(self._records)]
        self._take(time, row["motion"])
        for name, value in values.items():
            row[name] = value
        self._rows += 1  # last: an interrupt leaves no record half filled

    @property
    def last_record_time(self) -> float:
        """Time of the last record [s]."""
        return float(self._records["motion"]["time"][self._rows - 1])

    @property
    def records(self) -> np.ndarray:
        """All records, dtype `RECORD` (a view)."""
        return self._records[: self._rows]

    def history(self, time: float) -> BodyStates:
        """Samples every `HISTORY_STEP` from time 0, and the motion at the present `time` [s] (views)."""
        if time > self._history["time"][self._samples - 1] + 1e-9:
            # between two samples: the row of the next one holds the present motion until that sample is taken
            self._take(time, self._history[self._samples])
            return _as_states(self._history[: self._samples + 1])
        return _as_states(self._history[: self._samples])

    def present(self, time: float) -> BodyStates:
        """Motion of the five bodies now, said to be at `time` [s]; n = 1."""
        sample = np.zeros(1, HISTORY)
        self._take(time, sample[0])
        return _as_states(sample)

    def _take(self, time: float, sample: np.void) -> None:
        sample_motion(*self._state, sample)
        sample["time"] = time

    def save(self, histories: bool) -> dict[str, Any]:
        """Return how much is kept, and with `histories` also a copy of it."""
        return {
            "samples": self._samples,
            "rows": self._rows,
            "history": self._history[: self._samples].copy() if histories else None,
            "records": self._records[: self._rows].copy() if histories else None,
        }

    def restore(self, samples: int, rows: int, history: np.ndarray | None, records: np.ndarray | None) -> None:
        """Return to what `save` gave."""
        self._samples, self._rows = samples, rows
        if history is not None and records is not None:
            self._history[:samples] = history
            self._records[:rows] = records


def _as_states(samples: np.ndarray) -> BodyStates:
    return BodyStates(*(samples[name] for name in BodyStates.__dataclass_fields__))


@njit(cache=True, error_model="numpy")
def sample_motion(coordinates: Array, velocities: Array, accelerations: Array, reference: Array, sample: Any) -> None:
    """Write the motion of the five bodies into one `HISTORY` record, all but the time."""
    node = np.empty(7)
    turning, wheel_rate = np.empty(3), np.empty(3)
    for i in range(5):
        for k in range(7):
            node[k] = coordinates[7 * i + k] + reference[7 * i + k]
        for k in range(3):
            sample.position[i, k] = node[k]
            sample.velocity[i, k] = velocities[7 * i + k]
            sample.acceleration[i, k] = accelerations[7 * i + k]
        rotation_matrix(node, sample.rotation[i])
        angular_velocity(node, velocities[7 * i : 7 * i + 7], turning)
        for k in range(3):
            sample.angular_velocity[i, k] = turning[k]
        angular_velocity(node, accelerations[7 * i : 7 * i + 7], sample.angular_acceleration[i])  # G(e_t) e_t = 0
        if i > 0:
            for k in range(7):
                node[k] = coordinates[7 * (i + 4) + k] + reference[7 * (i + 4) + k]
            angular_velocity(node, velocities[7 * (i + 4) : 7 * (i + 4) + 7], wheel_rate)
            speed = 0.0
            for k in range(3):
                speed += (wheel_rate[k] - turning[k]) * sample.rotation[i, k, 1]
            sample.wheel_speed[i - 1] = speed
