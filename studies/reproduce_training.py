"""Do the networks drive the runs that they learned from? (paper Sec. 5.1, Figs. 10 and 11)

The nine training runs, driven by each model: published coefficients, regression, the paper's networks, ours; five seeds
each, 0.5 ms / 20 ms. Each seed has learnt from eight of the nine; the ninth stopped its training, and by it, in the
second table, the preset that comes with exumob was chosen.

First: exumob train --output networks
Run: python studies/reproduce_training.py --networks networks
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import xarray as xr
from matplotlib.figure import Figure

from exumob.learning.dataset import load_runs
from exumob.learning.evaluation import compare
from exumob.learning.presets import BEST, PRESETS
from exumob.learning.report import ENSEMBLE, by_scenario, markdown, models, plot_paths
from exumob.paper.scenarios import TRAINING, UNSEEN
from exumob.simulation.result_files import save_dataset
from exumob.support.figures import STYLE, save_figure
from exumob.surrogates.model import SurrogateHydrodynamics
from vehicle_models.amphibious import amphibious_vehicle

FIGURES = Path(__file__).parent / "figures"
DATA = Path(__file__).parents[1] / "data" / "cfd_mbd"


def plan() -> Figure:
    """Where the runs lie (paper Fig. 10)."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(4.6, 3.2), layout="constrained")
        for scenarios, style, label in ((TRAINING, "o", "training"), (UNSEEN, "^", "unseen")):
            axes.plot(
                [s.current_speed for s in scenarios], [100 * s.depth_ratio for s in scenarios], style, label=label
            )
        axes.set(xlabel="current [m/s]", ylabel="depth over tyre diameter [%]", xlim=(-0.1, 1.1), ylim=(36, 66))
        axes.legend(ncols=2, loc="upper center")
    return figure


def held_back(folder: Path, references: dict[str, xr.Dataset]) -> xr.Dataset:
    """Every preset, each seed on the run that it held back; in the place of the scenarios one, ``held back``."""
    tables = []
    for preset in PRESETS:
        rows = []
        for n, file in enumerate(sorted(folder.glob(f"{preset}_seed*.safetensors"))):
            member = SurrogateHydrodynamics(file)
            name = member.networks[0].about["held_back"]
            table, _ = compare({preset: [member]}, {name: references[name]}, amphibious_vehicle(), told=print)
            rows.append(table.drop_vars("scenario").assign_coords(scenario=["held back"], member=[n]))
        tables.append(xr.concat(rows, "member", join="outer"))
    return xr.concat(tables, "model", join="outer")


def main(quick: bool = False, networks: Path = Path("networks")) -> tuple[xr.Dataset, xr.Dataset]:
    """Drive the training runs; return the tables of all runs and of those held back."""
    names = [s.name for s in TRAINING]
    loaded = load_runs(DATA / f"{s.file_stem}.nc" for s in TRAINING)
    references = {name: loaded[name] for name in (names[:1] if quick else names)}
    chosen = {
        n: m
        for n, m in models(networks, () if quick else ("paper-lstm", "paper-dense", "coefficients", BEST)).items()
        if not quick or n == ENSEMBLE
    }
    table, runs = compare(chosen, references, amphibious_vehicle(), told=None if quick else print)
    if quick:
        return table, table
    held = held_back(networks, references)
    FIGURES.mkdir(exist_ok=True)
    save_figure(plan(), FIGURES / "training_plan.png")
    save_figure(plot_paths(runs, references, ("paper-lstm", ENSEMBLE)), FIGURES / "training_paths.png")
    save_dataset(table, FIGURES / "reproduce_training.nc")
    save_dataset(held, FIGURES / "held_back.nc")
    return table, held


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--networks", type=Path, default=Path("networks"), help="folder of `exumob train`")
    answer, kept = main(networks=parser.parse_args().networks)
    print("All training runs:", markdown(answer), by_scenario(answer), sep="\n\n")
    print("\nRuns held back:", markdown(kept), sep="\n\n")
