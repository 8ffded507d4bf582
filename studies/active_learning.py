"""Does it pay to compute next what the ensemble disagrees on most, instead of following a grid?

The first two runs with the flow in the loop are the corners D40/U0 and D60/U1, the fewest in which depth and current
vary. The others of the nine are added one at a time: (i) where the ensemble disagrees most
(`exumob.learning.disagreement`), which needs no run of the candidate; (ii) in a fixed order, the corners of the grid
first, then the design list (`GRID`); (iii) in random orders. After each run an ensemble of three `residual` networks is
trained anew and judged on the four unseen runs, in open loop (loads along the CFD-MBD run's path) and in closed loop
(the ensemble drives the vehicle, 0.5/20 ms). The unseen runs decide nothing.

Validation, which stops the training, uses a fifth of the time of every run, another for each seed and run (`fold`).
`exumob train` uses a whole run instead, which two or three runs do not allow: the rest would not span depth and
current. The same sets with other seeds show how much is chance.

Which scenario should then be computed next, after all thirteen? The disagreement of the ensemble that comes with exumob
ranks `CANDIDATES`, none of which has been run.

Run: python studies/active_learning.py --work runs/active_learning     (some hours; every trained network and every
measure is kept in that folder, and the same command continues after a stop)
"""

import json
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from common import CFD_RUNS, save, study_parser
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.stats import spearmanr

from exumob.learning.dataset import base_loads, load_runs, usable
from exumob.learning.disagreement import load_scale, rank
from exumob.learning.evaluation import FAST, THINNING, closed_loop, drive, open_loop, predicted_loads
from exumob.learning.examples import Examples, build_examples
from exumob.learning.fitting import fit_body
from exumob.learning.presets import PRESETS, Preset
from exumob.paper.scenarios import TRAINING, UNSEEN, Scenario
from exumob.support.errors import SimulationError
from exumob.support.figures import STYLE
from exumob.support.files import atomic_write
from exumob.surrogates.model import SurrogateHydrodynamics, shipped_networks
from exumob.surrogates.networks import VERSION, NetworkSet
from exumob.surrogates.vehicle_shape import geometry
from vehicle_models.amphibious import amphibious_vehicle

START = ("D40/U0", "D60/U1")
CORNERS = (*START, "D40/U1", "D60/U0")
GRID = CORNERS + tuple(s.name for s in TRAINING if s.name not in CORNERS)
"""The fixed order: corners of depth and current, then the design list's order."""
FOLDS = 5
"""Number of pieces into which a run is cut; every seed keeps one of them for validation."""
SEEDS, OTHER_SEEDS = (0, 1, 2), (3, 4, 5)
"""Seeds of the ensembles, and of those that show how much is chance."""
ORDERS = 3
"""Number of random orders."""
UNITS = {"load_error": "1", "final": "%", "path": "%", "yaw": "deg", "fallback": "1"}
"""Units of the measures of an ensemble on an unseen run: errors (`exumob.learning.evaluation`), and the share of the
coefficient model in its loads."""
CANDIDATES = tuple(
    Scenario(depth, current) for depth in (0.4, 0.45, 0.5, 0.55, 0.6) for current in (0.25, 0.5, 0.75, 1.0)
    if Scenario(depth, current) not in TRAINING + UNSEEN
) + tuple(
    Scenario(depth, current, steering, angle)
    for depth in (0.45, 0.6) for current in (0.5, 1.0) for angle in (15.0, 30.0) for steering in (30.0, -30.0)
)  # fmt: skip
"""Scenarios that have not been run: currents from ahead between and beside those of the runs; currents from the side,
steered either way."""

logger = logging.getLogger(__name__)


def fold(run: int, seed: int, rows: int) -> np.ndarray:
    """Mark the piece of a run that a seed keeps for validation: a fifth of its time; shape (rows,)."""
    return np.arange(rows) * FOLDS // rows == (run + seed) % FOLDS


@dataclass
class Laboratory:
    """The runs, the ensembles trained on sets of them, and their measures: each made once and kept in a folder."""

    work: Path
    names: tuple[str, ...] = GRID
    """Runs to learn from, the first two to begin with"""
    unseen: tuple[Scenario, ...] = UNSEEN
    preset: Preset = PRESETS["residual"]  # beside published coefficients: fitted ones would know all runs
    steps: dict[str, Any] = field(default_factory=lambda: dict(FAST))
    progress: Callable[[str], None] = logger.info

    def __post_init__(self) -> None:
        self.work.mkdir(parents=True, exist_ok=True)
        self.vehicle = amphibious_vehicle()
        self.runs = load_runs(CFD_RUNS / f"{Scenario.named(name).file_stem}.nc" for name in self.names)
        self.references = load_runs(CFD_RUNS / f"{scenario.file_stem}.nc" for scenario in self.unseen)
        self._bodies: list[Examples] = []
        self._base: dict[str, np.ndarray] = {}

    def ensemble(self, chosen: Iterable[str], seeds: Sequence[int] = SEEDS) -> list[NetworkSet]:
        """Networks trained on some of the runs, one for each seed."""
        files = [self._file(chosen, f"seed{seed}.safetensors") for seed in seeds]
        for seed, file in zip(seeds, files, strict=True):
            if not file.exists():
                began = time.process_time()
                self._train(sorted(chosen), seed).save(file)
                self.progress(f"{file.stem}: trained in {time.process_time() - began:.0f} s")
        return [NetworkSet.load(file) for file in files]

    def _train(self, chosen: Sequence[str], seed: int) -> NetworkSet:
        if not self._bodies:
            self._names, self._bodies = build_examples(self.runs, self.vehicle, self.preset)
        which = [self._names.index(name) for name in chosen]
        validation = [fold(n, seed, len(self._bodies[0].usable[n])) for n in which]
        learn = len(which) * (2 if self.preset.mirror else 1)
        bodies = []
        for b, found in enumerate(self._bodies):
            entries = which + [len(self._names) + n for n in which if self.preset.mirror]
            parts = Examples(
                [found.inputs[n] for n in entries + which], [found.loads[n] for n in entries + which],
                [found.usable[n] & ~validation[k % len(which)] for k, n in enumerate(entries)]
                + [found.usable[n] & validation[k] for k, n in enumerate(which)],
                found.filters, len(which),
            )  # fmt: skip
            bodies.append(
                fit_body(parts, range(learn), range(learn, learn + len(which)), self.preset, seed, b)
            )  # fmt: skip
        arrays = {n: np.stack([body[n] for body in bodies]) for n in bodies[0] if not n.endswith("_loss")}
        about = {
            "preset": self.preset.name, "training": asdict(self.preset) | {"architecture": None}, "seed": seed,
            "runs": list(chosen), "held_back": f"1/{FOLDS} of each run", "geometry": geometry(self.vehicle),
        }  # fmt: skip
        return NetworkSet(self.preset.architecture, arrays, about)

    def measures(self, chosen: Iterable[str], seeds: Sequence[int] = SEEDS) -> dict[str, dict[str, Any]]:
        """Measures (`UNITS`) of an ensemble on each unseen run, and the load errors of its members."""
        what = f"measures_{''.join(map(str, seeds))}"
        return self._kept(chosen, what, lambda: self._measure(self.ensemble(chosen, seeds)))

    def _measure(self, networks: list[NetworkSet]) -> dict[str, dict[str, Any]]:
        found = {}
        for name, reference in self.references.items():
            base = self._base_of(name, reference)
            one: dict[str, Any] = {
                "load_error": float(open_loop(networks, reference, self.vehicle, base).mean()),
                "member_load_error": [float(open_loop(n, reference, self.vehicle, base).mean()) for n in networks],
            }
            try:
                run = drive(Scenario.named(name), SurrogateHydrodynamics(networks), self.vehicle, self.steps)
                one |= closed_loop(run, reference)
                one["fallback"] = float(run["hydrodynamics_fallback_share"].max("body").mean())
            except SimulationError as error:
                logger.warning("%s cannot be driven: %s", name, error)
                one |= dict.fromkeys(("path", "final", "yaw", "fallback"), float("nan"))
            found[name] = one
        return found

    def disagreements(self, chosen: Sequence[str]) -> dict[str, dict[str, float]]:
        """Disagreement on every run that is left, and, for judging it only, the true error there."""
        return self._kept(chosen, "asked", lambda: self._disagreements(chosen))

    def _disagreements(self, chosen: Sequence[str]) -> dict[str, dict[str, float]]:
        networks = self.ensemble(chosen)
        left = [Scenario.named(name) for name in self.names if name not in chosen]
        found = {}
        for one in rank(left, networks, self.vehicle, self.steps):
            name = one.scenario.name
            run, base = self.runs[name], self._base_of(name, self.runs[name])
            rows = np.flatnonzero(usable(run))[::THINNING]
            loads = np.mean([predicted_loads(n, run, self.vehicle, rows, base) for n in networks], axis=0)
            error = (loads - run["water_wrench_smooth"].values[rows]) / load_scale(networks)
            found[name] = {
                "disagreement": one.total, "out_of_range": one.out_of_range, "fallback": one.fallback,
                "error": float(np.sqrt(np.mean(error**2))),
            }  # fmt: skip
        return found

    def active_order(self) -> list[str]:
        """The runs in the order in which disagreement chooses them."""
        chosen = list(self.names[:2])
        while len(chosen) < len(self.names):
            left = self.disagreements(chosen)
            best = max(left, key=lambda name: left[name]["disagreement"])
            listed = ", ".join(f"{name} {one['disagreement']:.2f}" for name, one in left.items())
            self.progress(f"{len(chosen)} runs, next {best}: {listed}")
            chosen.append(best)
        return chosen

    def forward(self, candidates: Sequence[Scenario], networks: Sequence[NetworkSet]) -> dict[str, dict[str, float]]:
        """Disagreement of an ensemble on scenarios that have not been run."""
        kept = self.work / "forward.json"
        found = json.loads(kept.read_text()) if kept.exists() else {}
        for scenario in candidates:
            if scenario.name not in found:
                for one in rank([scenario], networks, self.vehicle, self.steps):
                    found[scenario.name] = {
                        "disagreement": one.total, "out_of_range": one.out_of_range, "fallback": one.fallback
                    }  # fmt: skip
                    self.progress(f"{scenario.name}: {one.total:.3f}, out of range {100 * one.out_of_range:.0f} %")
                _write(kept, found)
        return {s.name: found[s.name] for s in candidates if s.name in found}

    def _base_of(self, name: str, run: xr.Dataset) -> np.ndarray:
        if name not in self._base:
            self._base[name] = base_loads(run, self.vehicle)
        return self._base[name]

    def _file(self, chosen: Iterable[str], what: str) -> Path:
        marks = "".join("x" if name in chosen else "-" for name in GRID)
        return self.work / f"{self.preset.name}_v{VERSION}_{marks}_{what}"

    def _kept(self, chosen: Iterable[str], what: str, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        file = self._file(chosen, f"{what}.json")
        if not file.exists():
            began = time.process_time()
            _write(file, make())
            self.progress(f"{file.stem}: {time.process_time() - began:.0f} s")
        return dict(json.loads(file.read_text()))


def _write(file: Path, content: dict[str, Any]) -> None:
    with atomic_write(file) as temporary:
        temporary.write_text(json.dumps(content))


def random_orders(names: Sequence[str], number: int) -> list[list[str]]:
    """Random orders that begin with the same two runs; every call gives the same ones."""
    rng = np.random.default_rng(2024)
    return [[*names[:2], *(str(name) for name in rng.permutation(list(names[2:])))] for _ in range(number)]


def learning_curves(laboratory: Laboratory, orders: int, again: bool = True) -> xr.Dataset:
    """Follow all orders: the measures along them, and the disagreements on the way.

    Parameters
    ----------
    laboratory : Laboratory
    orders : int
        Number of random orders.
    again : bool
        Train the ensembles of the active and the fixed order again with other seeds.

    Returns
    -------
    xarray.Dataset
        `UNITS`, dims (seeds, order, runs, scenario); ``added`` (order, runs): the run that made the set; along the
        active order ``disagreement`` and ``true_error`` (runs, candidate) of the ensemble on each run that was left.
    """
    names = laboratory.names
    every = {"active": laboratory.active_order(), "fixed": list(names)}
    every |= {f"random {n + 1}": order for n, order in enumerate(random_orders(names, orders))}
    sizes = np.arange(2, len(names) + 1)
    shape = (2, len(every), len(sizes), len(laboratory.references))
    values = {measure: np.full(shape, np.nan) for measure in UNITS}
    jobs = [(0, k, n) for k in range(len(every)) for n in range(len(sizes))]
    if again:
        jobs += [(1, k, n) for k in range(2) for n in range(len(sizes))]
    for which, k, n in jobs:
        found = laboratory.measures(list(every.values())[k][: sizes[n]], (SEEDS, OTHER_SEEDS)[which])
        for measure in UNITS:
            values[measure][which, k, n] = [found[name][measure] for name in laboratory.references]
    steps = [laboratory.disagreements(every["active"][:n]) for n in sizes[:-1]]
    about = {
        kept: np.array([[step.get(name, {}).get(key, np.nan) for name in names] for step in [*steps, {}]])
        for kept, key in (("disagreement", "disagreement"), ("true_error", "error"))
    }
    added = [[" + ".join(order[:2]), *order[2:]] for order in every.values()]
    return xr.Dataset(
        {m: (("seeds", "order", "runs", "scenario"), v, {"units": UNITS[m]}) for m, v in values.items()}
        | {"added": (("order", "runs"), added)}
        | {name: (("runs", "candidate"), v, {"units": "1"}) for name, v in about.items()},
        {
            "seeds": [" ".join(map(str, seeds)) for seeds in (SEEDS, OTHER_SEEDS)], "order": list(every),
            "runs": ("runs", sizes, {"long_name": "number of training runs"}),
            "scenario": list(laboratory.references), "candidate": list(names),
        },
    )  # fmt: skip


def seed_deviation(table: xr.Dataset, measure: str) -> float:
    """Standard deviation of a measure, mean over the unseen runs, between ensembles that differ by seeds alone."""
    mean = table[measure].mean("scenario", skipna=False)
    gap = mean.isel(seeds=0) - mean.isel(seeds=1)
    apart = [n for n in range(table.sizes["runs"]) if not _same(table, n)]
    pairs = np.concatenate([gap.sel(order="active").values, gap.sel(order="fixed").values[apart]])  # each set once
    return float(np.sqrt(np.mean(pairs**2) / 2.0))


def rank_correlation(table: xr.Dataset) -> xr.DataArray:
    """Rank correlation (Spearman) of disagreement and true error over the runs that are left; dim runs."""
    found = []
    for n in table["runs"].values:
        one = table.sel(runs=n).dropna("candidate", subset=["disagreement"])
        few = one.sizes["candidate"] < 3
        found.append(np.nan if few else float(spearmanr(one["disagreement"], one["true_error"]).statistic))
    return xr.DataArray(found, {"runs": table["runs"]}, ("runs",))


def plot(table: xr.Dataset) -> Figure:
    """Draw errors against the number of runs; the runs over depth and current, with their places in the order."""
    colors = {"fixed": "C1", "active": "C0"}  # active on top where both are the same
    with plt.rc_context(STYLE):
        figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12.0, 4.0), layout="constrained")
        for axes, measure, label in (
            (left, "load_error", "load error, open loop [-]"),
            (middle, "final", "final position, closed loop [% of the path]"),
        ):
            mean = table[measure].mean("scenario", skipna=False)
            chance = mean.isel(seeds=0).sel(order=[o for o in table["order"].values if str(o).startswith("random")])
            if chance.sizes["order"]:
                axes.fill_between(
                    table["runs"], chance.min("order"), chance.max("order"), color="0.5", alpha=0.2, lw=0.0,
                    label=f"random: range of {chance.sizes['order']}",
                )  # fmt: skip
                axes.plot(table["runs"], chance.mean("order"), color="0.5", lw=1.2, label="random: mean")
            for order, color in colors.items():
                first, again = (mean.sel(order=order).isel(seeds=n) for n in range(2))
                axes.plot(table["runs"], first, color=color, marker="o", ms=4, lw=1.8, label=order)
                axes.plot(table["runs"], again, color=color, marker="s", ms=4, mfc="none", lw=0.9, ls=":")
            axes.set(xlabel="training runs", ylabel=label, xticks=table["runs"], yscale="log")
            axes.grid(True, which="both", axis="y")
        left.set_yticks([0.4, 0.5, 0.6, 0.8, 1.0], ["0.4", "0.5", "0.6", "0.8", "1"])
        middle.set_yticks([1, 2, 5, 10], ["1", "2", "5", "10"])
        for axes in (left, middle):
            axes.yaxis.set_minor_formatter("")
        left.plot([], [], color="0.3", marker="s", ms=4, mfc="none", lw=0.9, ls=":", label="the same, other seeds")
        left.legend()
        left.set_title("loads, mean of four unseen runs")
        middle.set_title("vehicle, mean of four unseen runs")
        right.text(0.25, 46.0, "above: active", color="C0", weight="bold", ha="center", fontsize=8)
        right.text(0.25, 44.9, "below: fixed", color="C1", weight="bold", ha="center", fontsize=8)
        for order, color in colors.items():
            up = 1.0 if order == "active" else -1.0
            for n, name in enumerate(_names(table, order)):
                scenario = Scenario.named(name)
                at = scenario.current_speed, 100.0 * scenario.depth_ratio
                right.plot(*at, "o", color="0.25", ms=5)
                right.annotate(
                    str(n + 1), at, (0, 10 * up), textcoords="offset points", ha="center", va="center", color=color,
                    weight="bold",
                )  # fmt: skip
        for name in table["scenario"].values:
            scenario = Scenario.named(str(name))
            right.plot(scenario.current_speed, 100.0 * scenario.depth_ratio, "x", color="0.6", ms=6)
        right.set(
            xlabel="head current [m/s]", ylabel="depth [% of tyre diameter]", xlim=(-0.12, 1.12), ylim=(37.5, 62.5),
            title="place in the order; x: unseen runs",
        )  # fmt: skip
    return figure


def _same(table: xr.Dataset, n: int) -> bool:
    """True if the active and the fixed order have chosen the same set of runs by a step."""
    one, other = ({*_names(table, order)[: n + 2]} for order in ("active", "fixed"))
    return one == other


def _names(table: xr.Dataset, order: str) -> list[str]:
    """Names of the runs along an order."""
    first, *others = (str(name) for name in table["added"].sel(order=order).values)
    return [*first.split(" + "), *others]


def plot_forward(table: xr.Dataset) -> Figure:
    """Draw the disagreement on scenarios that have not been run, the largest on top."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.5, 5.4), layout="constrained")
        names = [str(name) for name in table["next"].values]
        colors = ["C3" if Scenario.named(name).current_angle else "C0" for name in names]
        axes.barh(names, table["next_disagreement"], color=colors, height=0.7)
        for n, (value, outside) in enumerate(
            zip(table["next_disagreement"].values, table["next_out_of_range"].values, strict=True)
        ):
            axes.annotate(
                f"{100.0 * outside:.0f} %", (value, n), (3, 0), textcoords="offset points", va="center", fontsize=7
            )
        axes.margins(y=0.01)
        axes.invert_yaxis()
        axes.set(xlabel="disagreement [-]  (beside the bar: share of the time out of the training range)")
        axes.grid(False, axis="y")
        axes.legend(
            [Patch(color="C0"), Patch(color="C3")], ["head current", "current from the side (@: degrees)"],
            loc="lower right",
        )  # fmt: skip
    return figure


def report(table: xr.Dataset) -> str:
    """Table of the curves; the gain of the active order beside the chance of the seeds."""
    lines = [
        "| runs | active adds | load error | final | fixed adds | load error | final | random: load error | final |",
        "|---" * 9 + "|",
    ]
    mean = table.isel(seeds=0)[["load_error", "final"]].mean("scenario", skipna=False)
    chance = mean.sel(order=[o for o in table["order"].values if str(o).startswith("random")])
    for n in table["runs"].values:
        cells = [str(n)]
        for order in ("active", "fixed"):
            one = mean.sel(order=order, runs=n)
            cells += [str(table["added"].sel(order=order, runs=n).item())]
            cells += [f"{float(one['load_error']):.3f}", f"{float(one['final']):.2f} %"]
        for measure, form in (("load_error", ".3f"), ("final", ".2f")):
            values = chance[measure].sel(runs=n).values
            cells.append(f"{values.min():{form}} to {values.max():{form}}" if len(values) else "-")
        lines.append(f"| {' | '.join(cells)} |")
    for measure in ("load_error", "final"):
        both = table[measure].mean("scenario", skipna=False)
        apart = both.isel(runs=[n for n in range(table.sizes["runs"]) if not _same(table, n)])
        if not apart.sizes["runs"]:
            continue
        first, again = (apart.sel(order="active") - apart.sel(order="fixed")).mean("runs").values
        word = f"active less fixed {first:+.3f} (other seeds {again:+.3f})"
        if chance.sizes["order"]:
            others = apart.isel(seeds=0).sel(order=chance["order"]).mean("order")
            off = float((apart.isel(seeds=0).sel(order="active") - others).mean("runs"))
            word += f", less the mean of random {off:+.3f}"
        lines.append(
            f"{measure}, mean over the numbers of runs at which active and fixed differ: {word}; standard deviation of "
            f"an ensemble from seeds to seeds {seed_deviation(table, measure):.3f}"
        )
    known = rank_correlation(table).dropna("runs")
    ranks = ", ".join(f"{v:+.2f} ({n} runs)" for n, v in zip(known["runs"].values, known.values, strict=True))
    lines.append(f"rank correlation of disagreement and true error on the runs that were left: {ranks}")
    return "\n".join(lines)


def main(quick: bool = False, work: Path = Path("runs/active_learning")) -> xr.Dataset:
    """Follow all orders, rank the candidates; return the learning curves and the ranking in one Dataset."""
    if quick:
        tiny = Preset("tiny", PRESETS["residual"].architecture, epochs=3, thinning=64, mirror=True)
        laboratory = Laboratory(work / "quick", GRID[:4], UNSEEN[:1], tiny, dict(FAST) | {"duration": 0.5})
        candidates: Sequence[Scenario] = CANDIDATES[-1:]
    else:
        laboratory, candidates = Laboratory(work, progress=print), CANDIDATES
    table = learning_curves(laboratory, 0 if quick else ORDERS, again=not quick)
    found = laboratory.forward(candidates, [NetworkSet.load(file) for file in shipped_networks()])
    ranked = sorted(found, key=lambda name: found[name]["disagreement"], reverse=True)
    for key in ("disagreement", "out_of_range", "fallback"):
        table[f"next_{key}"] = ("next", [found[name][key] for name in ranked], {"units": "1"})
    table = table.assign_coords(next=ranked)
    if not quick:
        save(
            {
                "active_learning.png": plot(table),
                "active_learning_next.png": plot_forward(table),
                "active_learning.nc": table,
            }
        )
    return table


if __name__ == "__main__":
    parser = study_parser(__doc__)
    parser.add_argument("--work", type=Path, default=Path("runs/active_learning"), help="what is kept of the work")
    answer = main(**vars(parser.parse_args()))
    print("\n" + report(answer) + "\n\nto compute next:")
    for name, value, outside in zip(
        answer["next"].values, answer["next_disagreement"].values, answer["next_out_of_range"].values, strict=True
    ):
        print(f"  {name}: {value:.3f} (out of the training range for {100.0 * outside:.0f} % of the time)")
