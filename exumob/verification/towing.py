"""The whole vehicle towed through water: what must hold of its loads, and how far they can be trusted.

All cases are slow. Limits and expectations, from theory before anything was measured:

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
- **Worst case** (1 m/s against 1 m/s, D60): noise of the hull's drag <= 1 % and lift <= 3 % about a moving average of
  21 ms; the level ahead of the bow wave within 2 mm of still water (relative speed 1.84 times critical: nothing
  runs ahead of it but the bore at the bow); nothing that is not a number. The strip was first laid 0.5 to 0.7 m ahead
  of the bow; the foot of the bore was then found to stand there, up to 0.65 m ahead, in the normal window as in one
  twice as large, and the strip now begins at 0.8 m.
- **Grid, window, step.** 1 ms against 2 ms: 5 % of the smoothed loads. Grid: index reported, no limit. Window
  doubled: 5 % of the hull's resistance.
"""

from __future__ import annotations

import argparse
import inspect
import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from exumob.flow.grid import Grid
from exumob.flow.settings import FlowSettings
from exumob.flow.tread import Tread
from exumob.flow.turbulence.closures import KOmegaSST
from exumob.support.arrays import Array
from exumob.support.constants import GRAVITY
from exumob.support.smoothing import smoothed
from exumob.towing_tank.motion import CaptiveMotion
from exumob.towing_tank.run import doubled_grid
from exumob.vehicle.motion import BODIES
from exumob.vehicle.parameters import Vehicle
from exumob.verification import Case, Check, absolute, reported
from exumob.verification.runs import finished_run
from exumob.verification.uncertainty import GridConvergence, deviation_uncertainty, grid_convergence, mean_uncertainty
from exumob.water.conditions import Water

DEPTH = 0.12
"""[m]: D60"""
FROUDE_NUMBERS = (0.5, 0.7, 0.85, 1.0, 1.15, 1.4, 1.9)
NOISE_WINDOW = 0.021
"""[s]"""
LOADS = (("hull", 0, "Fx"), ("hull", 2, "Fz"), ("hull", 4, "My"), *((wheel, 0, "Fx") for wheel in BODIES[1:]))
"""Body, component (force, then moment) and name of the loads compared."""


def paper_vehicle() -> Vehicle:
    """The vehicle of ``vehicle_models/amphibious.py``."""
    from vehicle_models.amphibious import amphibious_vehicle

    return amphibious_vehicle()


def loads_after(run: xr.Dataset, start: float, smooth: bool = True) -> Array:
    """Loads of the five bodies after `start` [s]: force [N], moment [N m], shape (n, 5, 6)."""
    end = "_smooth" if smooth else ""
    late = run.sel(time=slice(start, None))
    return np.concatenate([late[f"force{end}"].values, late[f"moment{end}"].values], axis=2)


def second_half(run: xr.Dataset) -> Array:
    """Mean loads over the second half of a run, shape (5, 6)."""
    return np.asarray(loads_after(run, 0.5 * float(run["time"][-1]), smooth=False).mean(axis=0))


# -- towed or held --------------------------------------------------------------------------------------------------


def towed_held(
    speed: float = 0.8, cell_size: float = 0.019, duration: float = 3.0, interval: float = 1.0e-3, threads: int = 1,
    allow_coarse: bool = False,
) -> list[Check]:  # fmt: skip
    """Towed at a speed through still water, and held in a current of that speed."""
    ramp = min(1.0, 0.4 * duration)
    cases = {
        "towed": (Water(DEPTH), CaptiveMotion(speed, ramp_time=ramp)),
        "held": (Water(DEPTH, current_speed=speed), CaptiveMotion(0.0, ramp_time=ramp)),
    }
    towed, held = (
        second_half(
            finished_run(
                paper_vehicle(), water, motion, cell_size=cell_size, duration=duration, interval=interval,
                settings=FlowSettings(threads=threads), allow_coarse=allow_coarse, label=name,
            )
        )
        for name, (water, motion) in cases.items()
    )  # fmt: skip
    scale = abs(towed[0, 0])
    checks = [reported("hull Fx, towed", towed[0, 0], unit="N")]
    for name, one, other in (
        ("hull Fx", towed[0, 0], held[0, 0]), ("hull Fz", towed[0, 2], held[0, 2]),
        ("hull My", towed[0, 4], held[0, 4]), ("mean wheel Fx", towed[1:, 0].mean(), held[1:, 0].mean()),
    ):  # fmt: skip
        checks.append(
            Check(
                f"{name}, held against towed, over hull Fx",
                float(other),
                float(one),
                float((other - one) / scale),
                0.01,
                "N m" if name.endswith("My") else "N",
            )
        )
    return checks


# -- resistance -----------------------------------------------------------------------------------------------------


def resistance(
    froude: float, cell_size: float = 0.022, duration: float = 3.5, interval: float = 1.0e-3, threads: int = 1,
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


def resistance_hump(
    froude_numbers: Sequence[float] = FROUDE_NUMBERS, cell_size: float = 0.022, duration: float = 3.5,
    interval: float = 1.0e-3, threads: int = 1, allow_coarse: bool = True,
) -> list[Check]:  # fmt: skip
    """Where the resistance coefficient of hull and vehicle is largest."""
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


# -- the worst case -------------------------------------------------------------------------------------------------


def worst_run(
    cell_size: float, duration: float, interval: float = 1.0e-3, threads: int = 1, allow_coarse: bool = False,
    grid: Grid | None = None, label: str = "worst case", settings: FlowSettings | None = None,
    tread: Tread | None = None,
) -> xr.Dataset:  # fmt: skip
    """1 m/s against a current of 1 m/s in 0.12 m of water, wheels at 10 rad/s."""
    motion = CaptiveMotion(1.0, wheel_speed=10.0, ramp_time=min(1.0, 0.4 * duration))
    return finished_run(
        paper_vehicle(), Water(DEPTH, current_speed=1.0), motion, cell_size=cell_size, duration=duration,
        interval=interval, grid=grid, settings=replace(settings or FlowSettings(), threads=threads),
        snapshots=0.004 * max(round(duration / 0.32), 1), allow_coarse=allow_coarse, tread=tread,
        label=f"{label}, {1e3 * cell_size:g} mm, {1e3 * interval:g} ms",
    )  # fmt: skip


def worst_case(
    cell_size: float = 0.018, duration: float = 8.0, interval: float = 1.0e-3, threads: int = 1,
    allow_coarse: bool = False,
) -> list[Check]:  # fmt: skip
    """Clean from beginning to end: noise, level ahead, volume, statistics of the loads."""
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


# -- grid, window, step ---------------------------------------------------------------------------------------------


def load_convergence(
    cell_sizes: Sequence[float] = (0.028, 0.0224, 0.018), duration: float = 8.0, interval: float = 1.0e-3,
    threads: int = 1, allow_coarse: bool = True,
) -> xr.Dataset:  # fmt: skip
    """Mean and deviation of the worst case's loads on three grids, with their uncertainties (dims load, cell_size).

    The mean's index of grid convergence is to be read together with the statistical error: differences between grids
    that are not larger than it say nothing of an order.
    """
    rows: dict[str, list[list[float]]] = {"mean": [], "mean_error": [], "deviation": [], "deviation_error": []}
    for cell in cell_sizes:
        run = worst_run(cell, duration, interval, threads, allow_coarse)
        series = [loads_after(run, 0.25 * duration)[:, BODIES.index(b), c] for b, c, _ in LOADS]
        means, deviations = [mean_uncertainty(s) for s in series], [deviation_uncertainty(s) for s in series]
        rows["mean"].append([m.mean for m in means])
        rows["mean_error"].append([m.error for m in means])
        rows["deviation"].append([d for d, _ in deviations])
        rows["deviation_error"].append([e for _, e in deviations])
    values = {name: np.array(table).T for name, table in rows.items()}
    result = xr.Dataset(
        {name: (("load", "cell_size"), table, {"units": "N or N m"}) for name, table in values.items()},
        coords={"load": [f"{body} {name}" for body, _, name in LOADS], "cell_size": list(cell_sizes)},
    )
    for kind in ("mean", "deviation"):
        found: list[GridConvergence] = [grid_convergence(cell_sizes, row) for row in values[kind]]
        for name in ("order", "extrapolated", "gci"):
            result[f"{kind}_{name}"] = ("load", [float(getattr(g, name)) for g in found])
        result[f"{kind}_convergence"] = ("load", [g.kind for g in found])
    return result


def grid_convergence_case(
    cell_sizes: Sequence[float] = (0.028, 0.0224, 0.018), duration: float = 8.0, interval: float = 1.0e-3,
    threads: int = 1, allow_coarse: bool = True,
) -> list[Check]:  # fmt: skip
    """Order, extrapolation, index and statistical error of each load."""
    found = load_convergence(cell_sizes, duration, interval, threads, allow_coarse)
    finest = found["cell_size"].values.argmin()
    checks = []
    for load in found["load"].values:
        row = found.sel(load=load)
        for kind in ("mean", "deviation"):
            unit, about = "N m" if load.endswith("My") else "N", f"{load}, {kind}"
            value, extrapolated = float(row[kind][finest]), float(row[f"{kind}_extrapolated"])
            checks.append(reported(f"{about}, finest against extrapolated", value, extrapolated, unit))
            checks.append(
                reported(f"{about}, order ({row[f'{kind}_convergence'].item()})", row[f"{kind}_order"].item())
            )
            checks.append(reported(f"{about}, grid-convergence index", row[f"{kind}_gci"].item(), unit=unit))
            checks.append(reported(f"{about}, statistical error", float(row[f"{kind}_error"][finest]), unit=unit))
    return checks


def plot_convergence(found: xr.Dataset) -> Figure:
    """Mean loads over cell size: statistical errors as bars, the index as a bar at the extrapolated value."""
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    axes = figure.subplots(2, (found.sizes["load"] + 1) // 2).ravel()
    for ax, load in zip(axes, found["load"].values, strict=False):
        row, cells = found.sel(load=load), 1e3 * found["cell_size"].values
        ax.errorbar(cells, row["mean"], 2.0 * row["mean_error"], fmt="o-", capsize=3, label="mean, 2 standard errors")
        finest = float(row["mean"][cells.argmin()])
        ax.errorbar([cells.min() - 0.5], [finest], [float(row["mean_gci"])], fmt="none", capsize=5, label="GCI, finest")
        ax.plot([0.0], [float(row["mean_extrapolated"])], "x", label="extrapolated")
        ax.set(title=str(load), xlabel="cell size [mm]", ylabel="N m" if str(load).endswith("My") else "N")
        ax.set_xlim(left=-1.0)
    for ax in axes[found.sizes["load"] :]:
        ax.set_axis_off()
    axes[-1].legend(*axes[0].get_legend_handles_labels(), fontsize="small", loc="center")
    return figure


def compared(name: str, run: xr.Dataset, other: xr.Dataset, limit: float) -> list[Check]:
    """Mean smoothed loads of the last three quarters of two runs, over the load, or the hull's Fx if that is larger."""
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


def domain(cell_size: float = 0.028, duration: float = 16.0, interval: float = 1.0e-3, threads: int = 1,
           allow_coarse: bool = True) -> list[Check]:  # fmt: skip
    """Window doubled against the normal one; long, so that means of the unsteady bow wave settle to some per cent."""
    wide = doubled_grid(paper_vehicle(), cell_size, Water(DEPTH))
    normal = worst_run(cell_size, duration, interval, threads, allow_coarse)
    doubled = worst_run(cell_size, duration, interval, threads, allow_coarse, wide, "window doubled")
    return compared("window doubled", normal, doubled, 0.05)


def time_step(cell_size: float = 0.022, duration: float = 6.0, threads: int = 1,
              allow_coarse: bool = True) -> list[Check]:  # fmt: skip
    """Steps of 2 ms against 1 ms."""
    one, two = (worst_run(cell_size, duration, dt, threads, allow_coarse) for dt in (1e-3, 2e-3))
    return compared("2 ms against 1 ms", one, two, 0.05)


LUGS = Tread(lug_height=0.01, lug_count=24)
"""Lugs of a tenth of the wheel's radius, 26 mm apart: what an off-road tyre of this size may have."""
MODELS: dict[str, dict[str, Any]] = {
    "PLIC": {"settings": FlowSettings(surface="plic")},
    "k-omega SST": {"settings": FlowSettings(closure=KOmegaSST())},
    "laminar": {"settings": FlowSettings(closure=None)},
    "lugs of 10 mm": {"tread": LUGS},
}
"""Choices of the model that are no matter of right or wrong, against the default."""


def models(
    cell_size: float = 0.0224, duration: float = 8.0, interval: float = 1.0e-3, threads: int = 1,
    allow_coarse: bool = True, names: Sequence[str] = tuple(MODELS),
) -> list[Check]:  # fmt: skip
    """Loads of the worst case with other models: reported, as an estimate of what the choice of the model moves."""
    default = worst_run(cell_size, duration, interval, threads, allow_coarse)
    checks = []
    for name in names:
        run = worst_run(cell_size, duration, interval, threads, allow_coarse, label=name, **MODELS[name])
        checks += compared(name, default, run, math.inf)
    return checks


CASES: Sequence[Case] = (
    Case("towed-held", "Towed through still water or held in a current: the same loads", towed_held, 11.0, slow=True),
    Case("resistance-hump", "Resistance over depth Froude number: Havelock (1922)", resistance_hump, 40.0, slow=True),
    Case("worst-case", "1 m/s against 1 m/s at D60, 8 s: clean from beginning to end", worst_case, 20.0, slow=True),
    Case("grid-convergence", "The worst case on three grids: GCI", lambda: grid_convergence_case(), 40.0, slow=True),
    Case("domain", "The worst case in a window twice as large", domain, 35.0, slow=True),
    Case("time-step", "The worst case with steps of 1 and 2 ms", time_step, 14.0, slow=True),
    Case("models", "The worst case with PLIC, k-omega SST, no closure, lugs (reported)", models, 35.0, slow=True),
)


def main() -> None:
    """Run cases with parameters of one's own: python -m exumob.verification.towing --help."""
    from exumob.commands.verify import as_markdown
    from exumob.verification import squat

    runs = {case.name: case.run for case in CASES} | {
        "grid-convergence": grid_convergence_case, "squat": squat.squat
    }  # fmt: skip
    parser = argparse.ArgumentParser(description="Vehicle-level verification; EXUMOB_RUNS names the folder of runs.")
    parser.add_argument("case", choices=sorted(runs))
    parser.add_argument("--cell-size", type=float, nargs="+", help="[m]; three for grid-convergence")
    for option, kind in (("duration", float), ("interval", float), ("threads", int)):
        parser.add_argument(f"--{option}", type=kind)
    parser.add_argument("--coarse", dest="allow_coarse", action="store_true", default=None)
    given = {name: value for name, value in vars(parser.parse_args()).items() if value is not None}
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    name = given.pop("case")
    if (cells := given.pop("cell_size", None)) is not None:
        given |= {"cell_sizes": cells} if name == "grid-convergence" else {"cell_size": cells[0]}
    taken = inspect.signature(runs[name]).parameters
    if unknown := sorted(set(given) - set(taken)):
        parser.error(f"{name} has no {', '.join(unknown)}; it takes {', '.join(taken)}")
    print(as_markdown([(name, check) for check in runs[name](**given)]))


if __name__ == "__main__":
    main()
