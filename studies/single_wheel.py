"""How far can Bekker-Wong be trusted for one wheel? Four published tests of a rigid wheel on soil (6 s on one core).

- `single_wheel_stress.png`: the stresses of paper Fig. 1 on the wheel of ``vehicle_models/amphibious.py``.
- `single_wheel_cmu.png`: CMU tests of a small wheel on dry sand, smooth and with grousers. The soil is calibrated at
  side-slip angle 0 only (longitudinal force and sinkage at the measured load); 15 to 90 degrees are predictions.
- `single_wheel_wong_reece.png`: the driven wheels of Wong & Reece (1967), Reece's pressure form. The data file holds
  their soils and loads but no measured curve, so this is a computation, not a comparison: it is checked against what
  must hold (a wider wheel sinks less and pulls more on the same sand; torque and pull grow with slip).
- `single_wheel_mgru3.png`: slip over slope of the MGRU3 wheel on GRC-1 sand. Three times: blind, with the table's lunar
  soil (which GRC-1 imitates: Oravec et al., J. Terramechanics 47 (2010) 361); and with the friction angle, or else the
  shear modulus, calibrated on one point, the one nearest 15 degrees. Grousers (24 of 30 mm, closer than three heights)
  are taken to hold the soil between them: a smooth wheel out to the tips, r = 0.255 m. The width of 0.200 m is that of
  the public Chrono model of this test.

Where Bekker-Wong is known to fail, and does so here:

- Wheels smaller than about 0.5 m in diameter: the plate pressures overestimate what a short curved patch carries
  (Meirion-Griffith & Spenko, J. Terramechanics 48 (2011) 149). All wheels here but Wong & Reece's are smaller;
  calibration hides it.
- Slip sinkage: sand is dug out from under a spinning or skidding wheel; the model sinks only by the shear's vertical
  part.
- Side force: the wall of the rut pushes against the wheel's side (bulldozing). The model has shear under the patch
  only, so it falls short as the side-slip angle and the sinkage grow (Ishigami et al., J. Field Robotics 24 (2007) 233,
  add such a term).
- Sinkage beyond the wheel centre (CMU at 75 and 90 degrees): the patch geometry ends there.
- High slip on slopes: the measured pull keeps growing with slip (grousers dig and push soil backwards) where Eq. (4)
  has saturated. The calibrated model cannot climb the 20 and 25 degrees that the MGRU3 wheel climbs at 76 and 88 %
  slip.
- The CMU fit ends on the bounds of n (1.6, the largest published), c1 (0) and c2 (0.4): it bends what it has to make up
  for slip sinkage. Its parameters are a fit, not properties of the sand.
- Strength per axis (paper Eq. 4): at 90 degrees of side slip the spin's shear keeps its full strength next to the side
  force.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize, wheel_soil_kernel
from exumob.ground.soil import Soil
from exumob.ground.terramechanics import contact_stresses, wheel_soil_forces
from exumob.support.constants import GRAVITY

Array = NDArray[np.float64]

DATA = Path(__file__).parents[1] / "tests" / "validation" / "data"
FIGURES = Path(__file__).parent / "figures"

DEEPEST = 0.98
"""Largest sinkage over radius that is searched [-]."""

STANDSTILL_RATE = 1.0e-4
"""[rad/s]; the tests are slow (3 mm/s at the rim)."""


# --------------------------------------------------------------------------------------------------------------------
# A wheel that carries a given load
# --------------------------------------------------------------------------------------------------------------------


@njit(error_model="numpy")
def sinkage_under_load(soil, wheel, motion, load, standstill_rate, result):  # type: ignore[no-untyped-def]
    """Smallest sinkage [m] at which the soil carries `load` [N], NaN if none; leaves the kernel's results in `result`.

    `soil` and `result` are arrays of one record: they stay alive while this runs.
    """
    low = 0.0
    steps = 80
    for i in range(1, steps + 1):
        high = DEEPEST * wheel.radius * (i / steps) ** 2
        wheel_soil_kernel(soil[0], wheel, high, motion, standstill_rate, result[0])
        if result[0].force[2] >= load:
            for _ in range(40):
                middle = 0.5 * (low + high)
                wheel_soil_kernel(soil[0], wheel, middle, motion, standstill_rate, result[0])
                if result[0].force[2] >= load:
                    high = middle
                else:
                    low = middle
            return high
        low = high
    return np.nan


def loaded_wheel(soil: Soil, radius: float, width: float, v: tuple[float, float], omega: float, load: float) -> Array:
    """Sinkage [m], force (3) [N] and driving torque [N m] of a wheel under a load [N]; NaN where nothing carries it."""
    wheel = WheelSize(float(radius), float(width))
    motion = WheelMotion(float(v[0]), float(v[1]), 0.0, float(omega), 0.0, 0.0)
    result = np.zeros(1, PATCH_FORCES)
    z = sinkage_under_load(soil.as_record(), wheel, motion, float(load), STANDSTILL_RATE, result)
    if math.isnan(z):
        return np.full(5, np.nan)
    return np.array([z, *result[0]["force"], result[0]["driving_torque"]])


# --------------------------------------------------------------------------------------------------------------------
# CMU: small wheel on dry sand, slip and side slip
# --------------------------------------------------------------------------------------------------------------------

CMU_RADIUS, CMU_WIDTH = 0.058, 0.050  # [m]
CMU_SPEED = 0.010  # [m/s] of the carriage; the wheel's axis is turned by the side-slip angle
CMU_ANGLES = (0, 15, 45, 75, 90)  # [deg]
CMU_START = {"log_k": math.log(1.5e5), "n": 0.8, "friction": 0.55, "modulus": 0.010, "c1": 0.4, "c2": 0.2}
CMU_BOUNDS = {
    "log_k": (math.log(1e3), math.log(1e8)), "n": (0.1, 1.6), "friction": (0.3, 0.75), "modulus": (0.001, 0.05),
    "c1": (0.0, 0.6), "c2": (0.0, 0.4),
}  # fmt: skip


def read_cmu(kind: str) -> dict[str, Array]:
    """Columns of one CMU file, in SI; forces on the wheel: forward and towards the side it slides to are negative."""
    rows = np.genfromtxt(DATA / f"cmu_{kind}_wheel.csv", delimiter=",", skip_header=1)
    return {
        "rim_speed": 1e-3 * rows[:, 0], "angle": np.radians(rows[:, 1]), "slip": rows[:, 3], "side_force": rows[:, 4],
        "longitudinal_force": -rows[:, 5], "load": -rows[:, 6], "sinkage": -1e-3 * rows[:, 7],
    }  # fmt: skip


def cmu_soil(parameters: Iterable[float]) -> Soil:
    """Dry sand without cohesion; one width only, so k_c is not separable and left at 0."""
    log_k, n, friction, modulus, c1, c2 = (float(p) for p in parameters)
    return Soil(
        k_c=0.0, k_phi=math.exp(log_k), n=n, cohesion=0.0, friction_angle=friction, shear_modulus_x=modulus,
        shear_modulus_y=modulus, c1=c1, c2=c2, name="CMU dry sand (calibrated)",
    )  # fmt: skip


def cmu_model(soil: Soil, data: dict[str, Array]) -> Array:
    """Longitudinal force [N], side force [N] and sinkage [m] for each row of the data, shape (n, 3)."""
    result = np.empty((data["load"].size, 3))
    for i, (rim, angle, load) in enumerate(zip(data["rim_speed"], data["angle"], data["load"], strict=True)):
        v = (CMU_SPEED * math.cos(angle), -CMU_SPEED * math.sin(angle))
        if angle > math.radians(89.0):
            v = (0.0, -CMU_SPEED)
        z, f_x, f_y, _, _ = loaded_wheel(soil, CMU_RADIUS, CMU_WIDTH, v, rim / CMU_RADIUS, load)
        result[i] = f_x, f_y, z
    return result


def calibrate_cmu(data: dict[str, Array]) -> Soil:
    """Soil that fits longitudinal force (over load) and sinkage (over radius) at side-slip angle 0."""
    straight = {name: column[data["angle"] == 0.0] for name, column in data.items()}

    def residual(parameters: Array) -> Array:
        model = cmu_model(cmu_soil(parameters), straight)
        force = (model[:, 0] - straight["longitudinal_force"]) / straight["load"]
        depth = (model[:, 2] - straight["sinkage"]) / CMU_RADIUS
        return np.nan_to_num(np.concatenate([force, depth]), nan=2.0)  # a load that nothing carries: a large miss

    low, high = np.array(list(CMU_BOUNDS.values())).T
    best = None
    for stiffness in (0.1, 1.0, 10.0):
        start = np.array(list(CMU_START.values()))
        start[0] += math.log(stiffness)
        fit = least_squares(residual, start, bounds=(low, high), x_scale=high - low, diff_step=1e-4)
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None
    return cmu_soil(best.x)


def run_cmu() -> tuple[dict[str, xr.Dataset], dict[str, Soil]]:
    """Measured and computed forces of both wheels, and their soils."""
    results, soils = {}, {}
    for kind in ("smooth", "grouser"):
        data = read_cmu(kind)
        soils[kind] = calibrate_cmu(data)
        model = cmu_model(soils[kind], data)
        columns = {
            name: ("test", data[name.removeprefix("vertical_")], {"units": unit, "long_name": text})
            for name, unit, text in (
                ("slip", "1", "slip ratio of the rim speed against the carriage"), ("angle", "rad", "side-slip angle"),
                ("vertical_load", "N", "measured vertical load"),
                ("longitudinal_force", "N", "measured longitudinal force on the wheel"),
                ("side_force", "N", "measured side force on the wheel"), ("sinkage", "m", "measured sinkage"),
            )
        }  # fmt: skip
        for i, (name, unit) in enumerate((("longitudinal_force", "N"), ("side_force", "N"), ("sinkage", "m"))):
            columns[f"model_{name}"] = (
                "test",
                model[:, i],
                {"units": unit, "long_name": f"computed {name.replace('_', ' ')}"},
            )
        results[kind] = xr.Dataset(columns)
    return results, soils


def cmu_errors(tests: xr.Dataset) -> xr.Dataset:
    """Root-mean-square errors by side-slip angle: forces over the load [-], sinkage over the radius [-]."""
    rows = []
    for degrees in CMU_ANGLES:
        chosen = tests.isel(test=np.isclose(np.degrees(tests.angle), degrees))
        force = (chosen.model_longitudinal_force - chosen.longitudinal_force) / chosen.vertical_load
        side = (chosen.model_side_force - chosen.side_force) / chosen.vertical_load
        depth = (chosen.model_sinkage - chosen.sinkage) / CMU_RADIUS
        share = float(np.isfinite(chosen.model_sinkage).mean())
        rows.append([float(np.sqrt((e**2).mean())) for e in (force, side, depth)] + [share])
    names = ("longitudinal_force", "side_force", "sinkage", "carried")
    texts = (
        "rms error over load",
        "rms error over load",
        "rms error over radius",
        "share of tests in which the model carries the load",
    )
    return xr.Dataset(
        {
            name: (
                "angle",
                [row[i] for row in rows],
                {"units": "1", "long_name": f"{name.replace('_', ' ')}: {texts[i]}"},
            )
            for i, name in enumerate(names)
        },
        coords={"angle": ("angle", list(CMU_ANGLES), {"units": "degree", "long_name": "side-slip angle"})},
    )


# --------------------------------------------------------------------------------------------------------------------
# Wong & Reece (1967): driven wheels on sand
# --------------------------------------------------------------------------------------------------------------------

INCH, POUND, PSI = 0.0254, 4.4482216, 6894.757
WONG_REECE_RADIUS = 24.7 * INCH
WONG_REECE_MODULUS = 1.5 * INCH


def wong_reece_cases() -> dict[str, tuple[Soil, float, float]]:
    """Soil, width [m] and load [N] of each case."""
    cases = {}
    with (DATA / "wong_reece_1967.csv").open() as file:
        for row in csv.DictReader(file):
            soil = Soil(
                k_c=float(row["k1"]) * PSI, k_phi=float(row["k2"]) * PSI / INCH, n=float(row["n"]),
                cohesion=float(row["c_psi"]) * PSI, friction_angle=math.radians(float(row["phi_deg"])),
                shear_modulus_x=WONG_REECE_MODULUS, shear_modulus_y=WONG_REECE_MODULUS, c1=float(row["c1"]),
                c2=float(row["c2"]), pressure_form="reece", name=f"{row['case']} (Wong & Reece 1967)",
            )  # fmt: skip
            cases[row["case"]] = soil, float(row["b_in"]) * INCH, float(row["W_lb"]) * POUND
    return cases


def run_wong_reece(slips: Array) -> xr.Dataset:
    """Drawbar pull, torque and sinkage over slip."""
    cases = wong_reece_cases()
    result = np.empty((len(cases), slips.size, 3))
    for i, (soil, width, load) in enumerate(cases.values()):
        for j, slip in enumerate(slips):
            omega = 1.0
            z, pull, _, _, torque = loaded_wheel(
                soil, WONG_REECE_RADIUS, width, (WONG_REECE_RADIUS * omega * (1.0 - slip), 0.0), omega, load
            )
            result[i, j] = pull, torque, z
    return xr.Dataset(
        {
            "drawbar_pull": (("case", "slip"), result[..., 0], {"units": "N", "long_name": "drawbar pull"}),
            "torque": (("case", "slip"), result[..., 1], {"units": "N m", "long_name": "driving torque"}),
            "sinkage": (("case", "slip"), result[..., 2], {"units": "m", "long_name": "sinkage"}),
            "vertical_load": (
                "case",
                [load for _, _, load in cases.values()],
                {"units": "N", "long_name": "vertical load"},
            ),
        },
        coords={"case": list(cases), "slip": ("slip", slips, {"units": "1", "long_name": "slip ratio"})},
    )


# --------------------------------------------------------------------------------------------------------------------
# MGRU3: slip over slope
# --------------------------------------------------------------------------------------------------------------------

MGRU3_RADIUS = 0.225 + 0.030  # [m] to the tips of the grousers
MGRU3_WIDTH = 0.200  # [m]
MGRU3_WEIGHT = 17.5 * GRAVITY  # [N] a wheel
MGRU3_SPIN = 0.8  # [rad/s]
MGRU3_CALIBRATION_SLOPE = 14.961  # [deg] the point used


def read_mgru3() -> tuple[Array, Array]:
    """Slope [rad] and measured slip [-]."""
    slip, slope = np.genfromtxt(DATA / "mgru3_slip_slope.csv", delimiter=",", skip_header=1).T
    return np.radians(slope), 0.01 * slip


def slip_on_slope(soil: Soil, slope: float) -> float:
    """Slip at which pull balances the weight along the slope; NaN if the wheel cannot climb."""

    def excess(slip: float) -> float:
        v_x = MGRU3_RADIUS * MGRU3_SPIN * (1.0 - slip)
        z, pull, _, _, _ = loaded_wheel(
            soil, MGRU3_RADIUS, MGRU3_WIDTH, (v_x, 0.0), MGRU3_SPIN, MGRU3_WEIGHT * math.cos(slope)
        )
        return pull - MGRU3_WEIGHT * math.sin(slope) if math.isfinite(z) else -MGRU3_WEIGHT

    slips = np.linspace(-0.2, 0.995, 60)
    values = [excess(s) for s in slips]
    for i in range(slips.size - 1):
        if values[i] < 0.0 <= values[i + 1]:
            return float(brentq(excess, slips[i], slips[i + 1], xtol=1e-6))
    return math.nan


def calibrate_mgru3(soil: Soil, field: str, low: float, high: float) -> Soil:
    """Value of one field of the soil, between low and high, that meets the slip of the one calibration point."""
    slope, slip = read_mgru3()
    k = int(np.argmin(np.abs(np.degrees(slope) - MGRU3_CALIBRATION_SLOPE)))

    def miss(value: float) -> float:
        computed = slip_on_slope(replace(soil, **{field: value}), slope[k])
        return (computed if math.isfinite(computed) else 1.0) - slip[k]

    return replace(soil, **{field: brentq(miss, low, high, xtol=1e-6)}, name=f"{soil.name}, {field} calibrated")


def run_mgru3(slopes: Array) -> tuple[xr.Dataset, dict[str, Soil]]:
    """Slip over slope, blind and calibrated on one point, with the measured points."""
    blind = Soil.published("Lunar soil")
    soils = {
        "blind": blind,
        "friction": calibrate_mgru3(blind, "friction_angle", math.radians(18.0), math.radians(45.0)),
        "modulus": calibrate_mgru3(blind, "shear_modulus_x", 0.004, 0.05),
    }
    measured_slope, measured_slip = read_mgru3()
    data = xr.Dataset(
        {
            "slip": (("soil", "slope"), [[slip_on_slope(s, b) for b in slopes] for s in soils.values()]),
            "slip_at_tests": (
                ("soil", "test"),
                [[slip_on_slope(s, b) for b in measured_slope] for s in soils.values()],
            ),
            "measured_slip": ("test", measured_slip),
            "measured_slope": ("test", measured_slope, {"units": "rad", "long_name": "slope of the test bed"}),
        },
        coords={"soil": list(soils), "slope": ("slope", slopes, {"units": "rad", "long_name": "slope"})},
    )
    for name, text in (("slip", "computed"), ("slip_at_tests", "computed"), ("measured_slip", "measured")):
        data[name].attrs.update(units="1", long_name=f"{text} slip ratio")
    return data, soils


# --------------------------------------------------------------------------------------------------------------------
# Figures
# --------------------------------------------------------------------------------------------------------------------

COLORS = ("#1b6ca8", "#d1495b", "#2e933c", "#8d6a9f", "#e39100")


def _style(axes: plt.Axes, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def plot_cmu(results: dict[str, xr.Dataset]) -> Figure:
    """Measured points and computed lines over slip, one column a quantity, one row a wheel."""
    figure, grid = plt.subplots(2, 3, figsize=(11.5, 6.6), layout="constrained", sharex=True, sharey="col")
    quantities = (
        ("longitudinal_force", "longitudinal force / load [-]"), ("side_force", "side force / load [-]"),
        ("sinkage", "sinkage [mm]"),
    )  # fmt: skip
    for k, (kind, tests) in enumerate(results.items()):
        row = grid[k]
        for axes, (name, label) in zip(row, quantities, strict=True):
            scale = 1e3 if name == "sinkage" else 1.0 / tests.vertical_load
            for color, degrees in zip(COLORS, CMU_ANGLES, strict=True):
                pick = np.isclose(np.degrees(tests.angle), degrees)
                x, text = tests.slip[pick], f"{degrees}°" + (" (calibrated)" if degrees == 0 else "")
                axes.plot(x, (scale * tests[name])[pick], "o", ms=4.5, color=color)
                axes.plot(x, (scale * tests[f"model_{name}"])[pick], "-", lw=1.6, color=color, label=text)
            _style(axes, "slip ratio [-]" if k == len(results) - 1 else "", label)
            if name == "sinkage":
                axes.axhline(1e3 * CMU_RADIUS, color="0.4", lw=0.9, ls=":")
                axes.text(0.95, 1e3 * CMU_RADIUS - 1, "wheel centre", fontsize=8, color="0.35", ha="right", va="top")
        row[0].set_title(f"{kind} wheel" if kind == "smooth" else "wheel with grousers", loc="left", fontweight="bold")
    handles, texts = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, [f"side slip {text}" for text in texts], loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(
        "CMU single wheel on dry sand (r = 58 mm): points measured, lines Bekker-Wong calibrated at 0° only.\n"
        "The model has no bulldozing and no digging: side force and sinkage fall short as the side-slip angle grows.",
        fontsize=10,
    )  # fmt: skip
    return figure


def plot_wong_reece(data: xr.Dataset) -> Figure:
    """Pull, torque and sinkage over slip."""
    figure, row = plt.subplots(1, 3, figsize=(11.5, 3.8), layout="constrained")
    for color, case in zip(COLORS, data.case.values, strict=False):
        chosen, percent = data.sel(case=case), 100.0 * data.slip
        row[0].plot(percent, chosen.drawbar_pull / chosen.vertical_load, color=color, lw=1.8, label=str(case))
        row[1].plot(percent, chosen.torque / (chosen.vertical_load * WONG_REECE_RADIUS), color=color, lw=1.8)
        row[2].plot(percent, 1e3 * chosen.sinkage, color=color, lw=1.8)
    row[0].axhline(0.0, color="0.4", lw=0.8)
    row[0].legend(frameon=False, fontsize=9)
    for axes, label in zip(row, ("drawbar pull / load [-]", "torque / (load r) [-]", "sinkage [mm]"), strict=True):
        _style(axes, "slip [%]", label)
    figure.suptitle(
        "Driven rigid wheels of Wong & Reece (1967), r = 0.627 m: computed with Reece's pressure; no measured curves",
        fontsize=10,
    )
    return figure


def plot_mgru3(data: xr.Dataset, soils: dict[str, Soil]) -> Figure:
    """Slip over slope."""
    figure, axes = plt.subplots(figsize=(6.4, 4.4), layout="constrained")
    labels = {
        "blind": "lunar soil of the table, $\\phi$ = 35°, K = 10 mm (blind)",
        "friction": f"$\\phi$ = {math.degrees(soils['friction'].friction_angle):.1f}°, calibrated on the ringed point",
        "modulus": f"K = {1e3 * soils['modulus'].shear_modulus_x:.1f} mm, calibrated on the ringed point",
    }
    for color, name in zip(COLORS, soils, strict=False):
        axes.plot(np.degrees(data.slope), 100.0 * data.slip.sel(soil=name), color=color, lw=1.8, label=labels[name])
    slope, slip = np.degrees(data.measured_slope), 100.0 * data.measured_slip
    axes.plot(slope, slip, "ko", ms=5, label="measured (NASA GRC), digitised")
    k = int(np.argmin(np.abs(slope.values - MGRU3_CALIBRATION_SLOPE)))
    axes.plot(slope[k], slip[k], "o", ms=13, mfc="none", mec="0.3")
    axes.set_ylim(-8.0, 118.0)
    axes.legend(frameon=False, fontsize=8.5, loc="upper left")
    _style(axes, "slope [deg]", "slip [%]")
    figure.suptitle(
        "MGRU3 wheel on GRC-1: slip at which it climbs; a line ends where the model cannot climb", fontsize=10
    )
    return figure


def plot_stress(soil: Soil) -> Figure:
    """Stresses of paper Fig. 1 around the wheel, and over the angle for three slip ratios."""
    radius, width, sinkage, omega = 0.100, 0.080, 0.020, 10.0
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained", width_ratios=(1.0, 1.25))
    slip = 0.2
    full = contact_stresses(soil, radius, width, sinkage, (radius * omega * (1.0 - slip), 0.0, 0.0), omega)
    forces = wheel_soil_forces(soil, radius, width, sinkage, (radius * omega * (1.0 - slip), 0.0, 0.0), omega)
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    left.fill(1e3 * radius * np.sin(turn), 1e3 * radius * np.cos(turn), color="0.92", ec="0.35", lw=1.4)
    level = 1e3 * (sinkage - radius)
    entry_x = 1e3 * radius * math.sin(forces.entry_angle)
    left.plot([entry_x, 115.0], [level, level], color="#8a6d3b", lw=2)
    left.plot([-80.0, 0.0], [-1e3 * radius] * 2, color="#8a6d3b", lw=2)
    scale = 45.0 / full.normal.max()  # [mm/Pa]
    rim, outward, along = (
        1e3 * radius * np.array([np.sin(full.angle), -np.cos(full.angle)]),
        np.array([np.sin(full.angle), -np.cos(full.angle)]),
        np.array([np.cos(full.angle), np.sin(full.angle)]),
    )
    for stress, side, color in ((full.normal, 1.0, COLORS[0]), (full.shear_x, -1.0, COLORS[1])):
        curve = rim + side * scale * stress * outward
        left.fill(*np.concatenate([rim, curve[:, ::-1]], axis=1), color=color, alpha=0.18, lw=0)
        left.plot(*curve, color=color, lw=1.6)
    arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.004, "headwidth": 3.5}
    pick = np.arange(6, 180, 12)
    tail = (rim + scale * full.normal * outward)[:, pick]
    left.quiver(*tail, *(rim[:, pick] - tail), color=COLORS[0], **arrows)
    start = (rim - 0.5 * scale * full.shear_x * outward)[:, pick[::2]]
    left.quiver(*start, *(scale * full.shear_x * along)[:, pick[::2]], color=COLORS[1], **arrows)
    for text, angle, shift in (
        ("$\\theta_f$", forces.entry_angle, (4, 6)),
        ("$\\theta_m$", forces.maximum_pressure_angle, (-44, 0)),
    ):
        tip = 1e3 * radius * np.array([math.sin(angle), -math.cos(angle)])
        left.plot([0, tip[0]], [0, tip[1]], color="0.4", lw=0.8, ls="--")
        left.annotate(
            f"{text} = {math.degrees(angle):.0f}°",
            0.45 * tip,
            xytext=shift,
            textcoords="offset points",
            fontsize=10,
            color="0.25",
        )
    left.plot([0, 0], [0, -1e3 * radius], color="0.4", lw=0.8)
    left.annotate("", (-20, -25), (-60, -25), arrowprops={"arrowstyle": "->", "color": "0.3"})
    left.text(-52, -21, "travel", fontsize=9, color="0.3")
    left.set_aspect("equal")
    left.set(xlim=(-80, 115), ylim=(-150, 12))
    _style(left, "x [mm]", "z from the wheel centre [mm]")
    left.set_title(f"slip {100 * slip:.0f} %: normal (blue) and shear stress (red) on the rim", fontsize=10)
    for style, slip in zip((":", "-", "--"), (-0.3, 0.2, 0.8), strict=True):
        v_x = radius * omega * (1.0 - slip) if slip > 0.0 else radius * omega / (1.0 + slip)
        s = contact_stresses(soil, radius, width, sinkage, (v_x, 0.0, 0.0), omega)
        right.plot(
            np.degrees(s.angle),
            1e-3 * s.normal,
            style,
            color=COLORS[0],
            lw=1.7,
            label=f"$\\sigma$, slip {100 * slip:.0f} %",
        )
        right.plot(
            np.degrees(s.angle),
            1e-3 * s.shear_x,
            style,
            color=COLORS[1],
            lw=1.7,
            label=f"$\\tau$, slip {100 * slip:.0f} %",
        )
    right.axhline(0.0, color="0.4", lw=0.8)
    right.legend(frameon=False, fontsize=9, ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.14))
    _style(right, "angle from the vertical $\\theta$ [deg]", "stress [kPa]")
    figure.suptitle(
        f"Stresses on the wheel, paper Eqs. (3) and (4): {soil.name}, sinkage {1e3 * sinkage:.0f} mm", fontsize=11
    )
    return figure


# --------------------------------------------------------------------------------------------------------------------


def main(quick: bool = False) -> xr.Dataset:
    """Run all four; `quick` coarsens the curves and saves no figure.

    Returns
    -------
    xarray.Dataset
        Errors by side-slip angle of both CMU wheels (``cmu_<wheel>_<quantity>``), Wong & Reece curves, MGRU3 curves.
    """
    cmu, cmu_soils = run_cmu()
    wong_reece = run_wong_reece(np.linspace(0.02, 0.6, 5 if quick else 59))
    mgru3, mgru3_soils = run_mgru3(np.radians(np.linspace(0.0, 28.0, 5 if quick else 57)))
    errors = {
        f"cmu_{kind}_{name}": variable.rename(angle="side_slip_angle")
        for kind, tests in cmu.items()
        for name, variable in cmu_errors(tests).data_vars.items()
    }
    result = xr.Dataset(errors)
    result = result.merge(wong_reece.rename(slip="wong_reece_slip"))
    result = result.merge(mgru3.rename(slip="mgru3_slip", slip_at_tests="mgru3_slip_at_tests", test="mgru3_test"))
    soils = {
        **{f"cmu_{kind}": s for kind, s in cmu_soils.items()},
        **{f"mgru3_{kind}": s for kind, s in mgru3_soils.items()},
    }
    result.attrs["soils"] = json.dumps({name: asdict(soil) for name, soil in soils.items()})
    if not quick:
        FIGURES.mkdir(exist_ok=True)
        for name, figure in (
            ("cmu", plot_cmu(cmu)), ("wong_reece", plot_wong_reece(wong_reece)),
            ("mgru3", plot_mgru3(mgru3, mgru3_soils)), ("stress", plot_stress(Soil.published("LETE sand"))),
        ):  # fmt: skip
            figure.savefig(FIGURES / f"single_wheel_{name}.png", dpi=110)
            plt.close(figure)
    return result


if __name__ == "__main__":
    table = main()
    for wheel in ("smooth", "grouser"):
        print(
            f"CMU {wheel} wheel: rms error of longitudinal force / load, side force / load, sinkage / radius; carried"
        )
        for degrees in CMU_ANGLES:
            row = table.sel(side_slip_angle=degrees)
            names = ("longitudinal_force", "side_force", "sinkage", "carried")
            print(f"  {degrees:2d} deg  " + "  ".join(f"{float(row[f'cmu_{wheel}_{name}']):6.3f}" for name in names))
    print("MGRU3: slope, measured slip, blind, friction angle calibrated, shear modulus calibrated")
    for i in range(table.sizes["mgru3_test"]):
        row = table.isel(mgru3_test=i)
        print(
            f"  {math.degrees(row.measured_slope):5.1f} deg  {float(row.measured_slip):6.3f}  "
            + "  ".join(f"{float(x):6.3f}" for x in row.mgru3_slip_at_tests)
        )
