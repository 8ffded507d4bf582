"""Does the LSTM layer matter, and is it its memory that does? (paper Sec. 5.2, Fig. 15)

The paper's network drives the four unseen runs against the same network with a dense layer in place of the LSTM's,
which sees the present state y(t_n) alone; five seeds each, paired by seed, because those learnt from the same runs. To
see why they differ, the samples 1 and 2 ms back in the LSTM's window are replaced by the present one, which shows their
share in its loads; and a third network, `present-lstm`, keeps the gates of the LSTM but sees y(t_n) alone, too.

First: exumob train --output networks
Run: python studies/ablation.py --networks networks     (a few minutes)
"""

from pathlib import Path

import numpy as np
import xarray as xr
from common import CFD_RUNS, add_networks, save, study_parser
from scipy import stats

from exumob.learning.dataset import body_states, load_runs, water_of, windows
from exumob.learning.evaluation import THINNING, compare
from exumob.learning.report import MEASURES, markdown, plot_paths
from exumob.paper.scenarios import UNSEEN
from exumob.surrogates.inputs import network_inputs
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import NetworkSet
from exumob.vehicle.motion import BODIES
from vehicle_models.amphibious import amphibious_vehicle

PAIR = ("paper-lstm", "paper-dense")
"""Presets that are compared seed by seed."""
MODELS = (*PAIR, "present-lstm")


def memory_share(network: NetworkSet, run: xr.Dataset) -> np.ndarray:
    """Rms change of the loads if the network sees the present only, over their standard deviation [-]; shape (5,)."""
    architecture = network.architecture
    inputs = network_inputs(body_states(run), water_of(run), architecture.inputs)
    rows = np.arange(architecture.stride * (architecture.taps - 1), len(inputs), THINNING)
    window = np.moveaxis(windows(inputs, rows, architecture), 2, 1)
    loads = network.batch_wrenches(window)
    present = network.batch_wrenches(np.repeat(window[:, :, -1:], architecture.window, axis=2))
    change = np.sqrt(np.mean((loads - present) ** 2, axis=0)) / np.maximum(loads.std(axis=0), 1e-9)
    return np.asarray(change.mean(axis=-1))


def paired(table: xr.Dataset, pair: tuple[str, str] = PAIR) -> str:
    """Table of one model less the other, seed by seed, means over the scenarios; negative: the first is better."""
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
    """Drive the unseen runs with all three; return the table, and the share of memory by seed and body [-]."""
    files = {model: sorted(networks.glob(f"{model}_seed*.safetensors")) for model in MODELS}
    for model, found in files.items():
        if not found:
            raise SystemExit(f"{networks} holds no networks of {model}; first: exumob train --output {networks}")
    scenarios = UNSEEN[:1] if quick else UNSEEN
    references = load_runs(CFD_RUNS / f"{s.file_stem}.nc" for s in scenarios)
    members = {model: [SurrogateHydrodynamics(file) for file in found] for model, found in files.items()}
    table, runs = compare(members, references, amphibious_vehicle(), progress=None if quick else print)
    sets = [NetworkSet.load(file) for file in files["paper-lstm"]]
    share = np.array([np.mean([memory_share(n, run) for run in references.values()], axis=0) for n in sets])
    if not quick:
        save({"ablation_paths.png": plot_paths(runs, references, MODELS), "ablation.nc": table})
    return table, share


if __name__ == "__main__":
    parser = study_parser(__doc__)
    add_networks(parser)
    answer, shares = main(**vars(parser.parse_args()))
    print(markdown(answer), paired(answer), paired(answer, ("present-lstm", "paper-dense")), sep="\n\n")
    print("\nShare of the LSTM's loads that comes from the samples 1 and 2 ms back (rms over deviation):")
    print(", ".join(f"{body} {100 * share:.1f} %" for body, share in zip(BODIES, shares.mean(axis=0), strict=True)))
