"""What does it cost the vehicle to wade, and how does the speed change it? (about 40 minutes on one core)

The vehicle is towed straight through 0.12 m of still water, wheels rolling, at depth Froude numbers 0.5 to 1.9. The
figure shows the resistance coefficients of hull and wheels, and the changes of the hull's lift and trim moment from
those at rest. Near depth Froude number 1 the waves keep up with the vehicle: ships meet a hump of resistance there
(Havelock, Proc. R. Soc. A 100 (1922) 499). This hull is blunt and the wheels are columns on the bed, so form drag is
always there too; see `exumob.verification.towing`, whose case ``resistance-hump`` uses the same runs.

With EXUMOB_RUNS naming a folder, finished runs are kept there.

Run: python studies/captive_resistance.py
"""

from __future__ import annotations

import json
import logging
from pathlib import Path

import xarray as xr
from matplotlib.figure import Figure

from exumob.simulation.result_files import save_dataset
from exumob.support.provenance import provenance
from exumob.verification.runs import DEPTH
from exumob.verification.towing import FROUDE_NUMBERS, resistance

FIGURES = Path(__file__).parent / "figures"


def main(quick: bool = False) -> xr.Dataset:
    """Return resistance [N], coefficients, lift [N] and trim [N m] of the towed vehicle over depth Froude number."""
    how = {"cell_size": 0.04, "duration": 0.4, "interval": 0.002, "allow_coarse": True} if quick else {
        "cell_size": 0.022, "duration": 3.5, "interval": 0.001, "allow_coarse": True
    }  # fmt: skip
    numbers = (0.5, 1.0) if quick else FROUDE_NUMBERS
    found = [resistance(froude, **how) for froude in numbers]
    result = xr.concat(found, dim="froude", coords="minimal", compat="override", join="outer")
    result["froude"].attrs = {"units": "1", "long_name": "depth Froude number"}
    result.attrs = provenance() | {"title": "captive resistance", "parameters": json.dumps(how | {"depth": DEPTH})}
    if not quick:
        FIGURES.mkdir(exist_ok=True)
        plot(result).savefig(FIGURES / "captive_resistance.png", dpi=150)
        save_dataset(result, FIGURES / "captive_resistance.nc")
    return result


def plot(result: xr.Dataset) -> Figure:
    """Resistance coefficients; resistances; lift and trim."""
    figure = Figure(figsize=(11.0, 3.8), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    froude = result["froude"]
    for part in result["part"].values:
        row = result.sel(part=part)
        width = 2.2 if part == "vehicle" else 1.4
        left.plot(froude, row["coefficient"], "o-", lw=width, label=part)
        middle.plot(froude, row["resistance"], "o-", lw=width, label=part)
    middle.fill_between(
        froude,
        result["resistance"].sel(part="hull") - result["fluctuation"],
        result["resistance"].sel(part="hull") + result["fluctuation"],
        alpha=0.2,
    )
    left.set(ylabel="resistance coefficient [-]", title="over $\\rho U^2 / 2$ and wetted frontal area at rest")
    middle.set(ylabel="resistance [N]", title="band: deviation of the hull's")
    right.plot(froude, result["lift_change"], "o-", label="lift of hull [N]")
    right.plot(froude, 10.0 * result["trim_change"], "s--", label="trim moment, bow down [0.1 N m]")
    right.axhline(0.0, color="0.6", lw=0.8)
    right.set(title="change from rest")
    for axes in (left, middle, right):
        axes.axvline(1.0, color="0.6", lw=0.8, ls=":")
        axes.set_xlabel("depth Froude number [-]")
    left.legend(fontsize="small")
    right.legend(fontsize="small")
    return figure


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    answer = main()
    print(answer["coefficient"].to_pandas().round(3).to_string())
