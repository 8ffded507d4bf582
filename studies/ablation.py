"""Does the LSTM layer matter? (paper Sec. 5.2, Fig. 15)

The paper's network against the same with a dense layer in the place of the LSTM's, fed y(t_n) alone: five seeds each,
paired by seed (the same runs to learn from), on the four unseen runs. Then why. What of the LSTM's answer comes from
the two samples before the present one, which lie 1 and 2 ms back? Their window is filled with the present state and the
change of the loads is compared with their size, along the CFD-MBD runs. And a third network: the LSTM fed y(t_n) alone,
as the dense one is (`present-lstm`: its gates are left, its memory is not).

First: exumob train --output networks
Run: python studies/ablation.py --networks networks
"""

import argparse
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import stats

from exumob.learning.dataset import body_states, load_runs, water_of
from exumob.learning.evaluation import THINNING, compare
from exumob.learning.report import MEASURES, markdown, plot_paths
from exumob.paper.scenarios import UNSEEN
from exumob.simulation.results import save_dataset
from exumob.support.figures import save_figure
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.vehicle.motion import BODIES
from vehicle_models.amphibious import amphibious_vehicle

FIGURES = Path(__file__).parent / "figures"
DATA = Path(__file__).parents[1] / "data" / "cfd_mbd"
PAIR = ("paper-lstm", "paper-dense")
MODELS = (*PAIR, "present-lstm")


def memory_share(network: NetworkSet, run: xr.Dataset) -> np.ndarray:
    """Rms change of the loads when the network is shown the present only, over the loads' deviation; shape (5,)."""
    architecture = network.architecture
    inputs = network_inputs(body_states(run), water_of(run), architecture.inputs)
    rows = np.arange(architecture.stride * (architecture.taps - 1), len(inputs), THINNING)
    back = architecture.stride * np.arange(architecture.taps - 1, -1, -1)
    window = np.moveaxis(inputs[rows[:, None] - back], 2, 1)
    loads = network.batch_wrenches(window)
    present = network.batch_wrenches(np.repeat(window[:, :, -1:], architecture.taps, axis=2))
    change = np.sqrt(np.mean((loads - present) ** 2, axis=0)) / np.maximum(loads.std(axis=0), 1e-9)
    return np.asarray(change.mean(axis=-1))


def paired(table: xr.Dataset, pair: tuple[str, str] = PAIR) -> str:
    """One less the other, seed by seed, means over the scenarios; negative: the first is nearer to CFD-MBD."""
    lines = [
        f"| {pair[0]} less {pair[1]} | mean | standard error | p (t test) | seeds for the first |",
        "|---|---|---|---|---|",
    ]
    for name, factor, unit in MEASURES:
        one, other = (factor * table[name].sel(model=model).mean("scenario").values for model in pair)
        gap = one - other
        p = stats.ttest_rel(one, other).pvalue if len(gap) > 1 else float("nan")
        error = gap.std(ddof=1) / np.sqrt(len(gap)) if len(gap) > 1 else float("nan")
        lines.append(
            f"| {name} [{unit}] | {gap.mean():+.2f} | {error:.2f} | {p:.2f} | {(gap < 0).sum()} of {len(gap)} |"
        )
    return "\n".join(lines)


def main(quick: bool = False, networks: Path = Path("networks")) -> tuple[xr.Dataset, np.ndarray]:
    """Drive the unseen runs with both; return the table, and the share of memory by seed and body."""
    files = {model: sorted(networks.glob(f"{model}_seed*.safetensors")) for model in MODELS}
    for model, found in files.items():
        if not found:
            raise SystemExit(f"{networks} holds no networks of {model}; first: exumob train --output {networks}")
    scenarios = UNSEEN[:1] if quick else UNSEEN
    references = load_runs(DATA / f"{s.file_stem}.nc" for s in scenarios)
    members = {model: [SurrogateHydrodynamics(file) for file in found] for model, found in files.items()}
    table, runs = compare(members, references, amphibious_vehicle(), told=None if quick else print)
    sets = [NetworkSet.load(file) for file in files["paper-lstm"]]
    share = np.array([np.mean([memory_share(n, run) for run in references.values()], axis=0) for n in sets])
    if not quick:
        FIGURES.mkdir(exist_ok=True)
        save_figure(plot_paths(runs, references, MODELS), FIGURES / "ablation_paths.png")
        save_dataset(table, FIGURES / "ablation.nc")
    return table, share


if __name__ == "__main__":
    import matplotlib

    matplotlib.use("Agg")
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--networks", type=Path, default=Path("networks"), help="folder of `exumob train`")
    answer, shares = main(networks=parser.parse_args().networks)
    print(markdown(answer), paired(answer), paired(answer, ("present-lstm", "paper-dense")), sep="\n\n")
    print("\nShare of the LSTM's loads that comes from the samples 1 and 2 ms back (rms over deviation):")
    print(", ".join(f"{body} {100 * share:.1f} %" for body, share in zip(BODIES, shares.mean(axis=0), strict=True)))
