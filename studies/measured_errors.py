"""How far off is each model of the water? The figures that every result states in its line of trust.

The thirteen lane changes with the flow in the loop (`data/cfd_mbd`) are driven anew with the networks that come with
exumob, the default ensemble and those with a name, with the coefficients that the ensemble rests on ("fitted"), the
calibrated and the published ones, at the steps that are the default, and the vehicle goes straight ahead in the same
water. What is found is written to `exumob/support/measured_errors.json`, which `exumob.simulation.trust` reads, with
what other studies measured: how far runs with the flow in the loop repeat (`cfd_lane_change.nc`), its loads beside
another program, and the soil's forces beside measurements (`docs/validation.md`).

Run: python studies/measured_errors.py     (ten minutes)
"""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from calibrate_coefficients import CURRENT, DEPTH
from cfd_lane_change import VARIANTS
from common import CFD_RUNS, FIGURES, study_parser

from exumob import Soil, load_dataset, simulate, summary
from exumob.driving.maneuver import ConstantSteer, LaneChange
from exumob.learning.dataset import load_runs
from exumob.learning.error_bars import fitted_floor
from exumob.learning.evaluation import closed_loop, drive
from exumob.learning.validation import compare_loads
from exumob.paper.reference_runs import CELL_SIZE, SOIL
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.simulation.ensemble import add_members
from exumob.simulation.settings import DEFAULT_SETTING, DURATION, setting_named
from exumob.support.files import atomic_write
from exumob.support.measured import MEASURED_FILE
from exumob.support.provenance import provenance
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NAMED
from exumob.vehicle.parameters import Vehicle
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

VALIDATION = Path(__file__).parents[1] / "docs" / "validation.md"
STRAIGHT = 4.0
"""Time for which the vehicle goes straight ahead [s]; its speed is the mean of the last `WINDOW` of it."""
WINDOW = 1.5
FLOW_WINDOW = 2.0
"""The same of the lane change with the flow in the loop, which is straight again at its end [s]."""


def end_speed(run: xr.Dataset, window: float) -> float:
    """Mean speed along the first heading over the end of a run [m/s]."""
    late = run["position"].sel(body="hull", axis="x").sel(time=slice(float(run["time"][-1]) - window, None))
    return float(late[-1] - late[0]) / float(late["time"][-1] - late["time"][0])


def errors(scenario: Scenario, reference: xr.Dataset, model: Hydrodynamics, vehicle: Vehicle) -> dict[str, float]:
    """Drive one lane change, and straight ahead in its water, and compare both with the flow in the loop.

    Returns
    -------
    dict
        ``end``: distance of the final positions over the length of the path [-]; ``forward``, ``lateral``: the model's
        displacement less the flow's [m]; ``speed``: speed straight ahead less the flow's [m/s]; with networks
        ``out_of_range`` and ``fallback`` (`exumob.simulation.summary.summary`), the larger one of both runs [-], and on
        unseen runs the ``spread`` of their members' ends [-].
    """
    run = drive(scenario, model, vehicle)
    found = closed_loop(run, reference)
    straight = simulate(
        vehicle, Soil.published(SOIL), scenario.water(vehicle), ConstantSteer(), model, duration=STRAIGHT
    )
    shares = [summary(r) for r in (run, straight)]
    row = {
        "end": 0.01 * found["final"],
        "forward": found["forward"],
        "lateral": found["lateral"],
        "speed": end_speed(straight, WINDOW) - end_speed(reference, FLOW_WINDOW),
    }
    if isinstance(model, SurrogateHydrodynamics) and len(model.networks) > 1 and scenario in UNSEEN:
        row["spread"] = members_spread(scenario, model, vehicle, run)
    for name in ("out_of_range", "fallback"):
        if f"{name}_share" in shares[0]:
            row[name] = max(s[f"{name}_share"] for s in shares)
    return {name: float(f"{value:.3g}") for name, value in row.items()}


def members_spread(scenario: Scenario, model: SurrogateHydrodynamics, vehicle: Vehicle, run: xr.Dataset) -> float:
    """How far the members end from each other: standard deviation over the length of the path [-]."""
    soil, water = Soil.published(SOIL), scenario.water(vehicle)
    steps = {"setting": DEFAULT_SETTING, "record_step": 10e-3}
    found = summary(add_members(run, vehicle, soil, water, scenario.maneuver(), model, **steps))
    return float(np.hypot(found["forward_spread"], found["lateral_spread"])) / found["distance"]


def floors(models: dict[str, SurrogateHydrodynamics], runs: dict[str, xr.Dataset], vehicle: Vehicle) -> dict[str, Any]:
    """Floor of the networks' error bars on runs that they had not seen [N, N m], by networks."""
    found = {}
    for name, model in models.items():
        compared = [compare_loads(model.networks, run, vehicle) for run in runs.values()]
        floor = fitted_floor([one.networks - one.flow for one in compared], [one.spread for one in compared])
        found[name] = [[float(f"{value:.3g}") for value in row] for row in floor]
    return found


def dry(vehicle: Vehicle) -> dict[str, Any]:
    """How far the lane change on dry ground ends from that with the finest steps, over the length of its path [-]."""
    fast, fine = (simulate(vehicle, Soil.published(SOIL), setting=setting) for setting in (DEFAULT_SETTING, "fine"))
    ends = [run["position"].sel(body="hull").values[-1, :2] for run in (fast, fine)]
    return {"end": float(f"{np.hypot(*(ends[0] - ends[1])) / summary(fine)['distance']:.1g}")}


def repeatability(table: xr.Dataset) -> dict[str, Any]:
    """How far D60/U1 with the flow in the loop ends from itself: mirrored, on other cells, whatever there is."""
    variants = [name for name in VARIANTS if name in table["run"].values]
    forward, lateral = (np.abs(table[name].sel(run=["D60/U1", *variants]).values) for name in ("forward", "lateral"))
    off = np.hypot(forward - forward[0], lateral - lateral[0]) / np.hypot(forward[0], lateral[0])
    sizes = {CELL_SIZE} | {VARIANTS[name].cell_size for name in variants}
    ends = {name: float(f"{end:.2g}") for name, end in zip(variants, off[1:], strict=True)}
    return {
        "source": "studies/figures/cfd_lane_change.nc (python studies/cfd_lane_change.py)",
        "scenario": "D60/U1", "variants": variants, "cell_sizes": sorted(sizes),
        "cell_size": CELL_SIZE, "ends": ends, "end": float(f"{off.max():.2g}"),
    }  # fmt: skip


def elsewhere(table: xr.Dataset, later: xr.Dataset) -> dict[str, Any]:
    """Where coefficients end from the flow in the loop for other vehicles: least and largest share [-].

    Those of the lane changes are for calibrated coefficients that were fitted without the vehicle that is judged. Of
    the drives that were made later, in other water, the waters are told, too.
    """
    others = [name for name in table["run"].values if "/" not in name]
    final = 0.01 * table["final"].sel(run=others)
    ends = {
        "calibrated": final.sel(model="without it").values,
        "coefficients": final.sel(model="coefficients").values,
    }
    return {
        "source": "studies/figures/calibrate_coefficients.nc (python studies/calibrate_coefficients.py)",
        "vehicles": [str(name) for name in others], "depth_ratio": DEPTH, "current_speed": CURRENT,
        **{name: _ends(found) for name, found in ends.items()},
        "later": {
            "source": "studies/figures/calibrated_later.nc (python studies/calibrate_coefficients.py --later)",
            "vehicle": "light 4x4", "drives": later.sizes["run"],
            **{name: _ends(later[name]) for name in ("depth_ratio", "current")},
            **{name: _ends(0.01 * later["final"].sel(model=name)) for name in ends},
        },
    }  # fmt: skip


def _ends(found: Any) -> list[float]:
    """Least and largest of some ends."""
    return [float(f"{end:.2g}") for end in (found.min(), found.max())]


def validated(text: str) -> dict[str, Any]:
    """Read from the page of validation how far loads of the flow and forces of the soil are off."""
    bodies = "sharp-edged box|hull with a raked bow|square column"
    drag = [
        float(row) / 100.0 for row in re.findall(rf"^\| (?:{bodies}), [\d.]+ m/s \| \*{{0,2}}([+-]\d+) %", text, re.M)
    ]
    wheel = re.search(r"CMU single wheel .*side slip (\d+) deg, \$F_x\$ \|[^|]*\| ([\d.]+) to ([\d.]+) \|", text)
    side = re.search(r"the same, \$F_y\$ \| measured; rms error over load \| ([\d.]+) to ([\d.]+) \|", text)
    if not (drag and wheel and side):
        raise ValueError(f"{VALIDATION} no longer holds the rows on interFoam's drag and the CMU wheel.")
    bounds = [float(wheel[2]), float(wheel[3]), float(side[1]), float(side[2])]
    return {
        "flow_loads": {
            "source": "docs/validation.md, Beside OpenFOAM", "drag_low": min(drag), "drag_high": max(drag),
        },
        "soil_forces": {
            "source": "docs/validation.md, Tyre and soil: CMU single wheel (python studies/single_wheel.py)",
            "wheel": "dry sand, 58 mm radius", "side_slip_deg": float(wheel[1]), "error_low": min(bounds),
            "error_high": max(bounds),
        },
    }  # fmt: skip


def main(quick: bool = False) -> dict[str, Any]:
    """Measure; return what is written to the file, or with `quick` the same for one scenario, which is not written."""
    vehicle = amphibious_vehicle()
    ensemble = SurrogateHydrodynamics()
    named = {name: SurrogateHydrodynamics(name) for name in NAMED}
    models: dict[str, Hydrodynamics] = {
        "networks": ensemble, **named, "fitted": CalibratedHydrodynamics(waves=ensemble.waves),
        "calibrated": CalibratedHydrodynamics(),
        "coefficients": CoefficientHydrodynamics(),
    }  # fmt: skip
    chosen = UNSEEN[:1] if quick else (*TRAINING, *UNSEEN)
    references = load_runs(CFD_RUNS / f"{s.file_stem}.nc" for s in chosen)
    setting = setting_named(DEFAULT_SETTING)
    micro_step, macro_step = setting.micro_step, setting.macro_step
    rows = []
    for scenario in chosen:
        row: dict[str, Any] = {
            "scenario": scenario.name, "depth_ratio": scenario.depth_ratio, "current_speed": scenario.current_speed,
            "steering_deg": scenario.steering, "taught_networks": scenario in TRAINING,
        }  # fmt: skip
        rows.append(row | {name: errors(scenario, references[scenario.name], m, vehicle) for name, m in models.items()})
        print(json.dumps(rows[-1]), flush=True)
    found = {
        "command": "python studies/measured_errors.py",
        "reference": "runs with the flow solver in the loop on 18 mm cells, data/cfd_mbd",
        **{name: provenance()[name] for name in ("exumob_version", "git_revision", "date")},
        "vehicle": json.loads(json.dumps(asdict(vehicle), default=str)),
        "soil": SOIL, "duration": DURATION, "straight_duration": STRAIGHT,
        "wheel_speed": LaneChange().speed, "micro_step": micro_step, "macro_step": macro_step,
        "density": chosen[0].water(vehicle).density,
        "networks": [network.digest() for network in ensemble.networks],
        "named": {name: [network.digest() for network in model.networks] for name, model in named.items()},
        "runs": rows,
        "load_floor": floors(
            {"networks": ensemble, **named}, {s.name: references[s.name] for s in chosen if s in UNSEEN}, vehicle
        ),
        "dry": {} if quick else dry(vehicle),
        "flow": repeatability(load_dataset(FIGURES / "cfd_lane_change.nc")),
        "elsewhere": elsewhere(
            *(load_dataset(FIGURES / f"{name}.nc") for name in ("calibrate_coefficients", "calibrated_later"))
        ),
        **validated(VALIDATION.read_text()),
    }  # fmt: skip
    if not quick:
        with atomic_write(MEASURED_FILE) as temporary:
            temporary.write_text(json.dumps(found, indent=1) + "\n")
    return found


if __name__ == "__main__":
    main(**vars(study_parser(__doc__).parse_args()))
