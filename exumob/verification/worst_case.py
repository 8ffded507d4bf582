"""How far can the vehicle's loads be trusted in its worst case, 1 m/s against a current of 1 m/s in 0.12 m of water?

All cases are slow. Limits and expectations, from theory before anything was measured:

- **Clean.** Noise of the hull's drag <= 1 % and lift <= 3 % about a moving average of 21 ms; the level ahead of the bow
  wave within 2 mm of still water (relative speed 1.84 times critical: only the bore at the bow runs ahead of it);
  nothing that is not a number. The strip was first laid 0.5 to 0.7 m ahead of the bow; the foot of the bore was then
  found to stand there, up to 0.65 m ahead, in the normal window as in one twice as large, and the strip now begins at
  0.8 m.
- **Window, step.** 1 ms against 2 ms: 5 % of the smoothed loads. Window doubled: 5 % of the hull's resistance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from exumob.flow import FlowSettings, KOmegaSST, Tread
from exumob.flow.vehicle_window import doubled_window
from exumob.support.declared import checked
from exumob.support.smoothing import smoothed
from exumob.towing_tank.motion import CaptiveMotion
from exumob.vehicle.motion import BODIES
from exumob.verification.check import Case, Check, absolute, reported
from exumob.verification.options import CellSize, Duration, Interval, Threads
from exumob.verification.runs import DEPTH, finished_run, loads_after, paper_vehicle
from exumob.verification.uncertainty import mean_uncertainty
from exumob.water.conditions import Water

NOISE_WINDOW = 0.021
"""Width of the moving average that noise is counted from [s]."""
LOADS = (("hull", 0, "Fx"), ("hull", 2, "Fz"), ("hull", 4, "My"), *((wheel, 0, "Fx") for wheel in BODIES[1:]))
"""Body, component (force, then moment) and name of the loads compared."""


@checked
def worst_run(
    cell_size: CellSize, duration: Duration, interval: Interval = 1.0e-3, threads: Threads = 1,
    allow_coarse: bool = False, *,
    label: str = "worst case", settings: FlowSettings | None = None, **options: Any,
) -> xr.Dataset:  # fmt: skip
    """Run the worst case: 1 m/s against a current of 1 m/s in 0.12 m of water, wheels at 10 rad/s.

    Parameters are those of `captive_run`; `label` names the run in the log.
    """
    motion = CaptiveMotion(1.0, wheel_speed=10.0, ramp_time=min(1.0, 0.4 * duration))
    return finished_run(
        paper_vehicle(), Water(DEPTH, current_speed=1.0), motion, cell_size=cell_size, duration=duration,
        interval=interval, settings=replace(settings or FlowSettings(), threads=threads), allow_coarse=allow_coarse,
        snapshots=0.004 * max(round(duration / 0.32), 1),
        label=f"{label}, {1e3 * cell_size:g} mm, {1e3 * interval:g} ms", **options,
    )  # fmt: skip


@checked
def worst_case(
    cell_size: CellSize = 0.018, duration: Duration = 8.0, interval: Interval = 1.0e-3, threads: Threads = 1,
    allow_coarse: bool = False,
) -> list[Check]:  # fmt: skip
    """Noise, level ahead of the bow wave, volume and statistics of the loads: clean from beginning to end."""
    run = worst_run(cell_size, duration, interval, threads, allow_coarse)
    start = 0.25 * duration
    raw = loads_after(run, start, smooth=False)
    smooth = smoothed(raw, interval, NOISE_WINDOW)
    noise = (raw - smooth).std(axis=0) / np.abs(raw.mean(axis=0))
    lost = sum(int(np.sum(~np.isfinite(run[name].values))) for name in ("force", "moment"))
    surface = run["elevation"].sel(snapshot=slice(start, None))
    strip = surface.sel(x=slice(1.3, 1.6), y=slice(-0.6, 0.6)).mean(("x", "y"))
    bore = (surface.sel(y=slice(-0.15, 0.15)).mean("y") > 0.002).any("snapshot")
    bow = 0.5 * paper_vehicle().hull.length
    volume = DEPTH * float((run["x"][-1] - run["x"][0]) * (run["y"][-1] - run["y"][0]))
    areas = run["x"].copy(data=np.gradient(run["x"])) * run["y"].copy(data=np.gradient(run["y"]))
    checks = [
        absolute("loads that are not numbers", lost, 0.0, 0.0),
        absolute("noise of hull Fx over its mean", noise[0, 0], 0.0, 0.01),
        absolute("noise of hull Fz over its mean", noise[0, 2], 0.0, 0.03),
        absolute("level ahead of the bow wave, largest", float(np.abs(strip).max()), 0.0, 0.002, "m"),
        reported("reach of the bow wave ahead of the bow", float(run["x"].where(bore).max()) - bow, unit="m"),
        reported("steps halved", float(run["halvings"].sum())),
        reported("water added by the far field over the window's", float(run["volume_added"][-1]) / volume),
        reported("mean level of the window at the end", float(surface[-1].weighted(areas).mean()), unit="m"),
    ]
    for body, component, name in LOADS:
        series = smooth[:, BODIES.index(body), component]
        unit = "N" if component < 3 else "N m"
        checks.append(reported(f"{body} {name}, mean", series.mean(), unit=unit))
        checks.append(reported(f"{body} {name}, standard error of the mean", mean_uncertainty(series).error, unit=unit))
        checks.append(reported(f"{body} {name}, deviation", series.std(), unit=unit))
    return checks


def compared(name: str, run: xr.Dataset, other: xr.Dataset, limit: float) -> list[Check]:
    """Compare mean smoothed loads of the last three quarters of two runs.

    Errors are over the load, or over the hull's Fx if that is larger.
    """
    start = 0.25 * float(run["time"][-1])
    one, two = loads_after(run, start), loads_after(other, start)
    scale = abs(float(one[:, 0, 0].mean()))
    checks = []
    for body, component, load in LOADS:
        a, b = (part[:, BODIES.index(body), component] for part in (one, two))
        error = float((b.mean() - a.mean()) / max(abs(a.mean()), scale if component < 3 else 0.0))
        unit = "N" if component < 3 else "N m"
        checks.append(Check(f"{body} {load}, mean, {name}", float(b.mean()), float(a.mean()), error, limit, unit))
        apart = math.hypot(mean_uncertainty(a).error, mean_uncertainty(b).error)
        checks.append(reported(f"{body} {load}, standard error of the difference, {name}", apart, unit=unit))
        checks.append(reported(f"{body} {load}, deviation, {name}", float(b.std()), float(a.std()), unit))
    return checks


@checked
def domain(cell_size: CellSize = 0.028, duration: Duration = 16.0, interval: Interval = 1.0e-3, threads: Threads = 1,
           allow_coarse: bool = True) -> list[Check]:  # fmt: skip
    """Compare the window doubled with the normal one, long enough for means of the unsteady bow wave to settle."""
    wide = doubled_window(paper_vehicle(), cell_size, Water(DEPTH))
    normal = worst_run(cell_size, duration, interval, threads, allow_coarse)
    doubled = worst_run(cell_size, duration, interval, threads, allow_coarse, label="window doubled", grid=wide)
    return compared("window doubled", normal, doubled, 0.05)


@checked
def time_step(cell_size: CellSize = 0.022, duration: Duration = 6.0, threads: Threads = 1,
              allow_coarse: bool = True) -> list[Check]:  # fmt: skip
    """Compare steps of 2 ms with steps of 1 ms."""
    one, two = (worst_run(cell_size, duration, dt, threads, allow_coarse) for dt in (1e-3, 2e-3))
    return compared("2 ms against 1 ms", one, two, 0.05)


LUGS = Tread(lug_height=0.01, lug_count=24)
"""Lugs of a tenth of the wheel's radius, 26 mm apart, as an off-road tyre of this size may have."""
MODELS: dict[str, dict[str, Any]] = {
    "PLIC": {"settings": FlowSettings(surface="plic")},
    "k-omega SST": {"settings": FlowSettings(closure=KOmegaSST())},
    "laminar": {"settings": FlowSettings(closure=None)},
    "lugs of 10 mm": {"tread": LUGS},
}
"""Options that replace a model of the default: none of these choices is plainly right or wrong."""


@checked
def models(
    cell_size: CellSize = 0.0224, duration: Duration = 8.0, interval: Interval = 1.0e-3, threads: Threads = 1,
    allow_coarse: bool = True, names: Sequence[str] = tuple(MODELS),
) -> list[Check]:  # fmt: skip
    """Report the loads of the worst case with other models, as an estimate of what the choice of a model changes."""
    default = worst_run(cell_size, duration, interval, threads, allow_coarse)
    checks = []
    for name in names:
        run = worst_run(cell_size, duration, interval, threads, allow_coarse, label=name, **MODELS[name])
        checks += compared(name, default, run, math.inf)
    return checks


CASES: tuple[Case, ...] = (
    Case(
        "worst-case",
        "The vehicle at 1 m/s against 1 m/s at D60, 8 s: clean from beginning to end",
        worst_case,
        20.0,
        slow=True,
    ),
    Case("domain", "The same in a window twice as large", domain, 35.0, slow=True),
    Case("time-step", "The same with steps of 1 and 2 ms", time_step, 14.0, slow=True),
    Case(
        "models",
        "The same with PLIC, k-omega SST, no turbulence model, lugs on the wheels (reported)",
        models,
        35.0,
        slow=True,
    ),
)
