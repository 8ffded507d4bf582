"""How large is the resistance of the vehicle, and does it depend only on the motion relative to the water?

Both cases are slow. Limits and expectations, from theory before anything was measured:

- **Towed or held.** Loads depend on the motion relative to the water alone (the bed is frictionless here): 1 % of the
  hull's resistance.
- **Resistance hump.** In water of depth h waves cannot outrun sqrt(g h). The wave resistance of a pressure point or
  slender hull rises to a maximum near depth Froude number 1 and falls beyond it, where no transverse waves are left
  (Havelock, Proc. R. Soc. A 100 (1922) 499; Inui, JSNAM 1954; Schlichting's charts, 1934; measured at 0.9 to 1.0
  for ships as slow waves of finite height travel ahead). This vehicle is not slender: a blunt hull 42 mm deep over
  78 mm of water, and wheels that stand on the bed as columns. Their form drag, a coefficient of order 1 at any speed,
  is added to the waves'. At low speed the coefficient is that form drag; at high speed it tends to it again, with a
  raised bow wave and a dry stern, whose missing pressure g T / U^2 falls with the speed. Hence a maximum of the
  coefficient between 0.8 and 1.2, on the hull; on the whole vehicle it may be a shoulder and is reported.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from exumob.flow import FlowSettings
from exumob.support.constants import GRAVITY
from exumob.support.declared import checked
from exumob.towing_tank.motion import CaptiveMotion
from exumob.verification.check import Case, Check, absolute, reported
from exumob.verification.options import CellSize, Duration, Interval, Threads
from exumob.verification.runs import DEPTH, finished_run, loads_after, paper_vehicle, second_half
from exumob.water.conditions import Water

FROUDE_NUMBERS = (0.5, 0.7, 0.85, 1.0, 1.15, 1.4, 1.9)
"""Depth Froude numbers of the resistance curve [-]."""


@checked
def towed_held(
    speed: float = 0.8, cell_size: CellSize = 0.019, duration: Duration = 3.0, interval: Interval = 1.0e-3,
    threads: Threads = 1,
    allow_coarse: bool = False,
) -> list[Check]:  # fmt: skip
    """Compare the loads of the vehicle towed through still water and held in a current of the same speed."""
    ramp = min(1.0, 0.4 * duration)
    settings = FlowSettings(threads=threads)
    how = {"cell_size": cell_size, "duration": duration, "interval": interval, "allow_coarse": allow_coarse}
    towed, held = (
        second_half(finished_run(paper_vehicle(), water, motion, settings=settings, label=name, **how))
        for name, water, motion in (
            ("towed", Water(DEPTH), CaptiveMotion(speed, ramp_time=ramp)),
            ("held", Water(DEPTH, current_speed=speed), CaptiveMotion(0.0, ramp_time=ramp)),
        )
    )
    scale = abs(towed[0, 0])
    checks = [reported("hull Fx, towed", towed[0, 0], unit="N")]
    for name, one, other in (
        ("hull Fx", towed[0, 0], held[0, 0]), ("hull Fz", towed[0, 2], held[0, 2]),
        ("hull My", towed[0, 4], held[0, 4]), ("mean wheel Fx", towed[1:, 0].mean(), held[1:, 0].mean()),
    ):  # fmt: skip
        unit, name = "N m" if name.endswith("My") else "N", f"{name}, held against towed, over hull Fx"
        checks.append(Check(name, float(other), float(one), float((other - one) / scale), 0.01, unit))
    return checks


@checked
def resistance(
    froude: float, cell_size: CellSize = 0.022, duration: Duration = 3.5, interval: Interval = 1.0e-3,
    threads: Threads = 1,
    allow_coarse: bool = True,
) -> xr.Dataset:  # fmt: skip
    """Resistance, lift and trim at a depth Froude number: rolling wheels, still water; second half of the run.

    Coefficients are over rho U^2 / 2 and the frontal area under the still water: the hull's breadth times its
    draught, a wheel's width times the depth, and their sum.
    """
    vehicle = paper_vehicle()
    speed = froude * math.sqrt(GRAVITY * DEPTH)
    motion = CaptiveMotion(speed, wheel_speed=speed / vehicle.wheel.radius, ramp_time=min(1.0, 0.4 * duration))
    run = finished_run(
        vehicle, Water(DEPTH), motion, cell_size=cell_size, duration=duration, interval=interval,
        settings=FlowSettings(threads=threads), allow_coarse=allow_coarse, label=f"Fr {froude:g}",
    )  # fmt: skip
    mean, rest = second_half(run), loads_after(run, 0.0, smooth=False)[0]
    deviation = loads_after(run, 0.5 * duration).std(axis=0)
    areas = np.array(
        [vehicle.hull.width * max(DEPTH - vehicle.hull.ground_clearance, 0.0), vehicle.wheel.width * DEPTH]
    )
    head = 500.0 * speed**2
    drag = np.array([-mean[0, 0], -mean[1:3, 0].mean(), -mean[3:, 0].mean(), -mean[:, 0].sum()])
    over = np.array([areas[0], areas[1], areas[1], areas[0] + 4.0 * areas[1]])
    parts = ["hull", "front wheel", "rear wheel", "vehicle"]
    return xr.Dataset(
        {
            "resistance": ("part", drag, {"units": "N", "long_name": "mean resistance"}),
            "coefficient": ("part", drag / (head * over), {"units": "1", "long_name": "resistance coefficient"}),
            "fluctuation": ((), float(deviation[0, 0]), {"units": "N", "long_name": "deviation of hull Fx, smoothed"}),
            "lift_change": ((), float(mean[0, 2] - rest[0, 2]), {"units": "N", "long_name": "hull Fz less buoyancy"}),
            "trim_change": ((), float(mean[0, 4] - rest[0, 4]), {"units": "N m", "long_name": "hull My less at rest"}),
        },
        coords={"part": parts, "froude": froude},
    )


@checked
def resistance_hump(
    froude_numbers: Sequence[float] = FROUDE_NUMBERS, cell_size: CellSize = 0.022, duration: Duration = 3.5,
    interval: Interval = 1.0e-3, threads: Threads = 1, allow_coarse: bool = True,
) -> list[Check]:  # fmt: skip
    """Find where the resistance coefficient of hull and vehicle is largest."""
    found = [resistance(f, cell_size, duration, interval, threads, allow_coarse) for f in froude_numbers]
    curve = xr.concat(found, dim="froude", coords="minimal", compat="override", join="outer")
    checks = []
    for part in ("hull", "vehicle", "front wheel", "rear wheel"):
        values = curve["coefficient"].sel(part=part).values
        for froude, value in zip(froude_numbers, values, strict=True):
            checks.append(reported(f"{part}, resistance coefficient at depth Froude number {froude:g}", value))
        peak = float(froude_numbers[int(np.argmax(values))])
        if part == "hull":
            checks.append(absolute("hull, depth Froude number of the largest coefficient", peak, 1.0, 0.2))
        else:
            checks.append(reported(f"{part}, depth Froude number of the largest coefficient", peak, 1.0))
    return checks


CASES: tuple[Case, ...] = (
    Case(
        "towed-held",
        "The vehicle towed through still water, or held in a current: the same loads",
        towed_held,
        11.0,
        slow=True,
    ),
    Case(
        "resistance-hump",
        "The vehicle's resistance over depth Froude number: largest near 1 (Havelock 1922)",
        resistance_hump,
        40.0,
        slow=True,
    ),
)
