"""What does a lane change cost, and what does a longer macro step do to it? (paper Sec. 5.3)

D60/U1 of 8 s is driven on one core with macro steps of 1 to 50 ms and multibody steps of 0.1 and 0.5 ms, with the
coefficient model, one set of the paper's LSTM networks, and the ensemble that comes with exumob. The error of the steps
counts from the same model at 0.1/1 ms; the times are compared with the CFD-MBD run's and with the paper's (1,099 s, and
214 s at 0.5/20 ms, on 28 processors; CFD-MBD 73 h on 336).

First: exumob train --preset paper-lstm --output networks
Run: python studies/computational_time.py --networks networks     (about ten minutes on one core)
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, add_networks, save, study_parser
from matplotlib.figure import Figure

from exumob.learning.dataset import load_runs
from exumob.learning.evaluation import closed_loop, drive
from exumob.paper.scenarios import Scenario
from exumob.support.figures import STYLE
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.hydrodynamics import Hydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

SCENARIO = Scenario.named("D60/U1")
MACRO = (1.0, 5.0, 10.0, 20.0, 50.0)
"""Macro steps [ms]."""
MICRO = (0.1, 0.5)
"""Multibody steps [ms]."""
PAPER = {
    "0.1/1 ms, 28 processors": 1099.0 * 28 / 3600,
    "0.5/20 ms, 28 processors": 214.0 * 28 / 3600,
    "CFD-MBD": 73.0 * 336,
}
"""Cost of the paper's runs [core hours] (Sec. 5.3)."""


def cfd_wall_time() -> float:
    """Wall time of a run with the flow in the loop on one core [s]: median over those that were never stopped.

    The file of a run holds the time since it was last continued; one that was stopped shows none for the settling.
    """
    runs = load_runs(sorted(CFD_RUNS.glob("*.nc"))).values()
    walls = [(float(run.attrs["settling_wall_time"]), float(run.attrs["wall_time"])) for run in runs]
    return float(np.median([settling + wall for settling, wall in walls if settling > 60.0]))


def main(quick: bool = False, networks: Path = Path("networks")) -> xr.Dataset:
    """Drive with every pair of steps; return wall time and errors, dims (model, micro, macro)."""
    vehicle = amphibious_vehicle()
    reference = load_runs([CFD_RUNS / f"{SCENARIO.file_stem}.nc"])[SCENARIO.name]
    models: dict[str, Hydrodynamics] = {"ensemble of five": SurrogateHydrodynamics()}
    if not quick:
        lstm = sorted(networks.glob("paper-lstm_seed*.safetensors"))
        if not lstm:
            raise SystemExit(f"first: exumob train --preset paper-lstm --output {networks}")
        models = {"coefficients": CoefficientHydrodynamics(), "paper-lstm": SurrogateHydrodynamics(lstm[0])} | models
    micro, macro = ((0.5,), (20.0, 50.0)) if quick else (MICRO, MACRO)
    drive(SCENARIO, next(iter(models.values())), vehicle, {"micro_step": 5e-4, "macro_step": 20e-3})  # compile
    shape = (len(models), len(micro), len(macro))
    wall, step_error, final, yaw = (np.full(shape, np.nan) for _ in range(4))
    for m, (model, hydrodynamics) in enumerate(models.items()):
        finest: xr.Dataset | None = None
        for i, fine in enumerate(micro):
            for j, coarse in enumerate(macro):
                steps = {"micro_step": 1e-3 * fine, "macro_step": 1e-3 * coarse}
                run = drive(SCENARIO, hydrodynamics, vehicle, steps)
                finest = run if finest is None else finest
                off = run["position"].sel(body="hull") - finest["position"].sel(body="hull")
                measured = closed_loop(run, reference)
                wall[m, i, j] = float(run.attrs["wall_time"])
                step_error[m, i, j] = 1e3 * float(np.hypot(*off.values[-1, :2]))
                final[m, i, j], yaw[m, i, j] = measured["final"], measured["yaw"]
                if not quick:
                    print(f"{model}, {fine:g}/{coarse:g} ms: {wall[m, i, j]:.2f} s, {step_error[m, i, j]:.2f} mm")
    dims = ("model", "micro", "macro")
    table = xr.Dataset(
        {
            "wall_time": (dims, wall, {"units": "s"}),
            "step_error": (dims, step_error, {"units": "mm", "long_name": "final position, from that at 0.1/1 ms"}),
            "final": (dims, final, {"units": "%", "long_name": "final position from CFD-MBD's, over the path"}),
            "yaw": (dims, yaw, {"units": "deg", "long_name": "rms from CFD-MBD's"}),
        },
        {"model": list(models), "micro": list(micro), "macro": list(macro)},
        {"cfd_wall_time": cfd_wall_time()},
    )
    if not quick:
        save({"computational_time.png": plot(table), "computational_time.nc": table})
    return table


def plot(table: xr.Dataset) -> Figure:
    """Draw time and error over the macro step."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 3.6), layout="constrained")
        for m, model in enumerate(table["model"].values):
            for micro, line in zip(table["micro"].values, ("-", "--"), strict=False):
                one = table.sel(model=model, micro=micro)
                style = {"color": f"C{m}", "ls": line, "marker": "o", "ms": 3.5}
                left.loglog(one["macro"], one["wall_time"], label=f"{model}, {micro:g} ms", **style)
                right.loglog(one["macro"], np.maximum(one["step_error"], 1e-2), **style)
        left.axhline(8.0, color="0.6", lw=0.8)
        left.annotate("real time", (52.0, 8.3), fontsize="small", color="0.4", ha="right")
        left.set(xlabel="macro step [ms]", ylabel="wall time of 8 s [s], one core")
        right.set(xlabel="macro step [ms]", ylabel="final position, from 0.1/1 ms [mm]")
        for axes in (left, right):
            axes.set_xticks(table["macro"].values, [f"{m:g}" for m in table["macro"].values])
            axes.minorticks_off()
        left.set_yticks((5, 10, 20, 40), ("5", "10", "20", "40"))
        figure.legend(loc="outside right center", fontsize="small")
    return figure


def markdown(table: xr.Dataset) -> str:
    """Table with a row for each model and multibody step, a column for each macro step."""
    macro = table["macro"].values
    lines = [f"| model, multibody step | {' | '.join(f'{m:g} ms' for m in macro)} |", "|---" * (len(macro) + 1) + "|"]
    for model in table["model"].values:
        for micro in table["micro"].values:
            one = table.sel(model=model, micro=micro)
            cells = [
                f"{float(w):.1f} s, {float(e):.1f} mm" for w, e in zip(one["wall_time"], one["step_error"], strict=True)
            ]
            lines.append(f"| {model}, {micro:g} ms | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_networks(parser)
    answer = main(**vars(parser.parse_args()))
    print(markdown(answer))
    one = answer.sel(model="ensemble of five", micro=0.5, macro=20.0)
    cfd, fast = answer.attrs["cfd_wall_time"], float(one["wall_time"])
    print(
        f"\nCFD-MBD: {cfd / 3600:.2f} core hours; the ensemble at 0.5/20 ms {fast:.1f} s: {cfd / fast:.0f} times less."
    )
    slow, quick = PAPER["CFD-MBD"], PAPER["0.5/20 ms, 28 processors"]
    print(f"The paper: {slow:.0f} against {quick:.2f} core hours: {slow / quick:.0f} times.")
