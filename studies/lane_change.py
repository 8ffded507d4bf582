"""What does water do to a lane change? (after the paper's Figs. 6 and 8; half a minute on one core)

No water is compared with depths of 40 % and 60 % of the tyre diameter, calm and with a head current of 1 m/s, all with
the coefficient model: quasi-steady, hull and wheels independent. It is the reduced-order kind of model that the paper
argues against, so these are the baseline's answers, not the paper's.

Run: python studies/lane_change.py     (half a minute)
"""

import numpy as np
import xarray as xr
from common import save, study_parser

from exumob import Soil, Water, lane_change, simulate, summary
from exumob.simulation.plotting import compare_runs
from exumob.simulation.summary import FIGURES
from vehicle_models.amphibious import amphibious_vehicle

SCENARIOS = {
    "no water": None,
    "D40/U0": Water.at_ratio(0.4, current_speed=0.0),
    "D40/U1": Water.at_ratio(0.4, current_speed=1.0),
    "D60/U0": Water.at_ratio(0.6, current_speed=0.0),
    "D60/U1": Water.at_ratio(0.6, current_speed=1.0),
}


def main(quick: bool = False) -> xr.Dataset:
    """Run all scenarios; return their key figures by scenario (see `exumob.summary`)."""
    vehicle, soil = amphibious_vehicle(), Soil.published("LETE sand")
    setting = "fast" if quick else "fine"
    names = ("no water", "D60/U0", "D60/U1") if quick else tuple(SCENARIOS)
    runs = {
        name: simulate(vehicle, soil, SCENARIOS[name], lane_change(), "coefficients", setting=setting) for name in names
    }
    if not quick:
        save({"lane_change.png": compare_runs(runs)})
    table = [summary(run) for run in runs.values()]
    return xr.Dataset(
        {
            name: ("scenario", [row[name] for row in table], {"units": FIGURES[name][0], "long_name": FIGURES[name][1]})
            for name in table[0]
        },
        coords={"scenario": list(runs)},
    )


if __name__ == "__main__":
    result = main(**vars(study_parser(__doc__).parse_args()))
    for scenario in result["scenario"].values:
        row = result.sel(scenario=scenario)
        print(
            f"{scenario:<9} forward {row['forward']:.3f} m  lateral {row['lateral']:+.3f} m  "
            f"yaw {np.degrees(row['yaw']):+.2f} deg  slip {100 * row['mean_slip']:.1f} %  "
            f"buoyed {100 * row['buoyed_share']:.1f} %  wall time {row['wall_time']:.1f} s"
        )
