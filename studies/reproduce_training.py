"""Do the networks drive the runs that they learned from? (paper Sec. 5.1, Figs. 10 and 11)

The vehicle drives the nine training runs at 0.5/20 ms with the published coefficients, with a regression, with the
paper's networks and with those of exumob, five seeds each. Each seed has learnt from eight of the nine runs and stopped
by its error on the ninth, its validation run; by the errors on those, in the second table, the preset that comes with
exumob was chosen.

First: exumob train --output networks
Run: python studies/reproduce_training.py --networks networks     (about half an hour)
"""

from pathlib import Path

import matplotlib.pyplot as plt
import xarray as xr
from common import CFD_RUNS, add_networks, save, study_parser
from matplotlib.figure import Figure

from exumob.learning.dataset import load_runs
from exumob.learning.evaluation import compare
from exumob.learning.presets import LANE_CHANGES
from exumob.learning.report import ENSEMBLE, OF_LANE_CHANGES, by_scenario, load_models, markdown, plot_paths
from exumob.paper.scenarios import TRAINING, UNSEEN
from exumob.support.figures import STYLE
from exumob.surrogates.model import SurrogateHydrodynamics
from vehicle_models.amphibious import amphibious_vehicle


def plan() -> Figure:
    """Draw where the runs lie in the plane of current and depth (paper Fig. 10)."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(4.6, 3.2), layout="constrained")
        for scenarios, style, label in ((TRAINING, "o", "training"), (UNSEEN, "^", "unseen")):
            axes.plot(
                [s.current_speed for s in scenarios], [100 * s.depth_ratio for s in scenarios], style, label=label
            )
        axes.set(xlabel="current [m/s]", ylabel="depth over tyre diameter [%]", xlim=(-0.1, 1.1), ylim=(36, 66))
        axes.legend(ncols=2, loc="upper center")
    return figure


def validation(folder: Path, references: dict[str, xr.Dataset]) -> xr.Dataset:
    """Drive with every preset, each seed on its own validation run; all of them make one scenario, ``held back``."""
    tables = []
    for preset in OF_LANE_CHANGES:
        rows = []
        for n, file in enumerate(sorted(folder.glob(f"{preset}_seed*.safetensors"))):
            member = SurrogateHydrodynamics(file)
            name = member.networks[0].about["held_back"]
            table, _ = compare({preset: [member]}, {name: references[name]}, amphibious_vehicle(), progress=print)
            rows.append(table.drop_vars("scenario").assign_coords(scenario=["held back"], member=[n]))
        tables.append(xr.concat(rows, "member", join="outer"))
    return xr.concat(tables, "model", join="outer")


def main(quick: bool = False, networks: Path = Path("networks")) -> tuple[xr.Dataset, xr.Dataset]:
    """Drive the training runs; return the tables of all runs and of the validation runs."""
    names = [s.name for s in TRAINING]
    loaded = load_runs(CFD_RUNS / f"{s.file_stem}.nc" for s in TRAINING)
    references = {name: loaded[name] for name in (names[:1] if quick else names)}
    chosen = load_models(networks, () if quick else ("paper-lstm", "paper-dense", "coefficients", LANE_CHANGES))
    if quick:
        chosen = {ENSEMBLE: chosen[ENSEMBLE]}
    table, runs = compare(chosen, references, amphibious_vehicle(), progress=None if quick else print)
    if quick:
        return table, table
    validated = validation(networks, references)
    save(
        {
            "training_plan.png": plan(),
            "training_paths.png": plot_paths(runs, references, ("paper-lstm", ENSEMBLE)),
            "reproduce_training.nc": table,
            "held_back.nc": validated,
        }
    )
    return table, validated


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_networks(parser)
    answer, validated = main(**vars(parser.parse_args()))
    print("All training runs:", markdown(answer), by_scenario(answer), sep="\n\n")
    print("\nValidation runs:", markdown(validated), sep="\n\n")
