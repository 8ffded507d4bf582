"""How far runs end from one whose equations are solved further, by Newton's tolerance, and what that costs.

`python benchmarks/newton_tolerance.py [DURATION]`: D60/U1 with coefficients, fast setting, both vehicles; CPU times of
interleaved runs in one process.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import xarray as xr

from exumob import CoefficientHydrodynamics, Soil, Vehicle, Water, simulate
from exumob.multibody import settling, system
from exumob.multibody.solver_settings import TOLERANCE
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

TIGHT = 0.05 * TOLERANCE
TOLERANCES = (50.0 * TOLERANCE, 5.0 * TOLERANCE, TOLERANCE)
REPEATS = 2


def run(vehicle: Vehicle, tolerance: float, duration: float) -> tuple[xr.Dataset, float]:
    """Run the lane change with another tolerance; return the result and the CPU time [s]."""
    system.TOLERANCE = settling.TOLERANCE = tolerance
    water = Water.at_ratio(0.6, 1.0, tyre_diameter=vehicle.wheel.diameter)
    begin = time.process_time()
    result = simulate(vehicle, Soil.published("LETE sand"), water, None, CoefficientHydrodynamics(), duration=duration)
    return result, time.process_time() - begin


def main() -> None:
    """Print the table."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
    for vehicle in (amphibious_vehicle(), light_4x4()):
        run(vehicle, TIGHT, 0.1)  # compiles
        tight, _ = run(vehicle, TIGHT, duration)
        times: dict[float, list[float]] = {tolerance: [] for tolerance in TOLERANCES}
        for _ in range(REPEATS):
            for tolerance in TOLERANCES:
                result, spent = run(vehicle, tolerance, duration)
                times[tolerance].append(spent)
                if len(times[tolerance]) == 1:
                    path = float(np.abs(result["position"] - tight["position"]).max())
                    reaction = float(np.abs(result["constraint_load"] - tight["constraint_load"]).max())
                    print(
                        f"{vehicle.name}, {tolerance:g}: path {path:.1e} m, reactions {reaction:.1e} N off", flush=True
                    )
        fastest = min(times[TOLERANCES[0]])
        for tolerance in TOLERANCES:
            print(
                f"{vehicle.name}, {tolerance:g}: {min(times[tolerance]):.2f} s, {min(times[tolerance]) / fastest:.2f}"
            )


if __name__ == "__main__":
    main()
