"""The energy account of a run: the work of each kind of load, summed up step by step."""

from __future__ import annotations

import numpy as np

from exumob.support.arrays import Array
from exumob.support.kernels import njit

WORK_KINDS = ("soil", "damper", "water", "spin", "steering", "settling", "point forces", "soil on hull")
"""Kinds of loads that do work on the vehicle, in the order of the arrays of `ENERGY_ACCOUNT`."""

ENERGY_ACCOUNT = np.dtype(
    [
        ("time", "f8"),  # of `power` [s]
        ("power", "f8", (len(WORK_KINDS),)),  # into the vehicle, by kind [W]
        ("work", "f8", (len(WORK_KINDS),)),  # its integral over time, trapezoidal [J]
    ],
    align=True,
)
"""Power and work of every kind of load up to one instant."""


@njit(cache=True, error_model="numpy")
def add_work(
    time: float, loads: np.ndarray, multipliers: Array, steering_rows: Array, spin_rows: Array, rates: Array,
    energy_account: np.ndarray,
) -> float:  # fmt: skip
    """Integrate the power of each kind of load over the step that ends at `time`.

    Parameters
    ----------
    time : float
        [s]
    loads : array of dtype `exumob.multibody.applied_loads.LOADS`, shape (1,)
    multipliers : array
        Lagrange multipliers of the system.
    steering_rows, spin_rows : array of int
        Rows of the steering and spin constraints in `multipliers`.
    rates : array, shape (3,)
        Prescribed rates: of the left and the right front wheel's angle and of wheel spin [rad/s].
    energy_account : array of dtype `ENERGY_ACCOUNT`, shape (1,), changed

    Returns
    -------
    float
        Largest sinkage over wheel radius (NaN if the motion is not finite).
    """
    account = energy_account[0]
    out = loads[0]
    spin = 0.0
    for row in spin_rows:
        spin -= multipliers[row] * rates[2]
    steering = 0.0
    for i in range(2):
        steering -= multipliers[steering_rows[i]] * rates[i]
    power = np.array(
        (
            out.soil_power, out.damper_power, out.water_power, spin, steering, out.settling_power, out.point_power,
            out.hull_soil_power,
        )
    )  # fmt: skip
    half_step = 0.5 * (time - account.time)
    for i in range(len(WORK_KINDS)):
        account.work[i] += half_step * (account.power[i] + power[i])
        account.power[i] = power[i]
    account.time = time
    return out.deepest
