"""What do the settings cost, and how far does "fast" end from "fine"? (`python benchmarks/settings.py`, 3 minutes)

Eight seconds of the lane change on LETE sand, amphibious vehicle, on dry ground and in two waters; each model of the
water's loads with both settings, one after the other in one process. Error: distance between the two ends of the path,
also in per cent of its length, and difference of the final yaw.
"""

import math

import numpy as np

from exumob import Soil, Water, simulate
from exumob.simulation.settings import SETTINGS
from vehicle_models.amphibious import amphibious_vehicle

WATERS = {"dry": None, "D60/U0": Water.at_ratio(0.6), "D60/U1": Water.at_ratio(0.6, 1.0)}


def main() -> None:
    """Print one row a water and model."""
    vehicle, soil = amphibious_vehicle(), Soil.published("LETE sand")
    simulate(vehicle, soil, WATERS["D60/U1"], duration=0.1)  # compile
    print("| water | model | fast | fine | path | end apart | of the path | yaw apart |\n" + 8 * "|---" + "|")
    for name, water in WATERS.items():
        for model in ("none",) if water is None else ("networks", "coefficients"):
            runs = {s: simulate(vehicle, soil, water, hydrodynamics=model, setting=s) for s in SETTINGS}
            ends = {s: run["position"].sel(body="hull").values[-1, :2] for s, run in runs.items()}
            yaws = {s: float(run["yaw"].sel(body="hull")[-1]) for s, run in runs.items()}
            walls = {s: float(run.attrs["wall_time"]) for s, run in runs.items()}
            path = np.hypot(*np.diff(runs["fine"]["position"].sel(body="hull").values[:, :2], axis=0).T).sum()
            apart = float(np.hypot(*(ends["fast"] - ends["fine"])))
            turned = math.degrees(abs(yaws["fast"] - yaws["fine"]))
            print(
                f"| {name} | {model} | {walls['fast']:.1f} s | {walls['fine']:.1f} s | {path:.2f} m "
                f"| {1e3 * apart:.1f} mm | {100 * apart / path:.2f} % | {turned:.2f} deg |"
            )


if __name__ == "__main__":
    main()
