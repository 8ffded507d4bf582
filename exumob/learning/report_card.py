"""The report card of networks: one HTML page with its figures inside, for whoever is to rely on them."""

from __future__ import annotations

import base64
import html
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from exumob.learning.dataset import body_states, water_of
from exumob.learning.plan import FreeTask, LearningPlan
from exumob.learning.validation import BETTER, DEVIATIONS, TWO, Compared, Drive, compared_with, shortfall
from exumob.support.figures import STYLE
from exumob.surrogates.ensemble import bars_of
from exumob.surrogates.inputs import network_inputs
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS

NORMAL = [math.erf(z / math.sqrt(2.0)) for z in DEVIATIONS]
"""Shares of a normal distribution within `DEVIATIONS`."""
SHOWN = (("hull", "Fx", "N"), ("hull", "Fz", "N"), ("hull", "My", "N m"), ("front_left", "Fy", "N"))
"""Loads that are drawn over time."""
GREEN, AMBER = 0.35, 0.7
"""Load errors up to which a cell of the table is called good, and fair [-]."""
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
body {{ font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }}
h1 {{ font-size: 1.6rem; margin-bottom: .2rem; }} h2 {{ font-size: 1.15rem; margin-top: 2.2rem; }}
table {{ border-collapse: collapse; margin: .8rem 0; }} th, td {{ padding: .25rem .7rem; text-align: right; }}
th {{ border-bottom: 1px solid #888; font-weight: 600; }} td:first-child, th:first-child {{ text-align: left; }}
tr + tr td {{ border-top: 1px solid #e4e4e4; }} img {{ max-width: 100%; }} .note {{ color: #555; font-size: .92em; }}
.good {{ background: #dff0df; }} .fair {{ background: #fbf1d5; }} .poor {{ background: #f8dcd8; }}
.lead {{ font-size: 1.05rem; background: #f4f6f8; padding: .8rem 1rem; border-left: 4px solid #4a90c2; }}
</style></head><body>
{body}
</body></html>
"""


@dataclass(frozen=True)
class CardContents:
    """All that a report card is made of."""

    plan: LearningPlan
    figures: Mapping[str, Any]
    """See `exumob.learning.validation.card_figures`"""
    errors: xr.Dataset
    """See `exumob.learning.validation.load_errors`"""
    drives: Sequence[Drive]
    taught: Mapping[str, xr.Dataset]
    """Runs that networks have learnt from"""
    apart: Mapping[str, xr.Dataset]
    """Runs kept apart, captive ones and drives"""
    compared: Mapping[str, Compared]
    failed: Mapping[str, str]
    """Errors of runs that broke down"""
    spent: float
    """Wall time of the runs, each in one process [h]"""


def report_card(contents: CardContents) -> str:
    """Return the page as text: HTML that needs no other file."""
    c = contents
    name = html.escape(c.plan.vehicle.name)
    parts = [
        f"<h1>Report card: networks of {name}</h1>",
        f'<p class="note">{html.escape(_made(c))}</p>',
        f'<p class="lead">{html.escape(_verdict(c))}</p>',
        "<h2>Range covered</h2>", _range_text(c), _inlined(_draw_range(c)),
        "<h2>Errors of the loads, on runs kept apart</h2>", _load_text(c), _load_table(c), _inlined(_draw_loads(c)),
        "<h2>Drives, beside the same with the flow in the loop</h2>", _drive_text(c), _drive_table(c),
        *([_inlined(_draw_paths(c))] if c.drives else []),
        "<h2>Error bars</h2>", _calibration_text(c), _inlined(_draw_calibration(c)),
        "<h2>What these networks do not know</h2>", _list(unknown(c)),
        "<h2>How they were made</h2>", _run_table(c),
    ]  # fmt: skip
    return PAGE.format(title=f"Report card: networks of {name}", body="\n".join(parts))


def _made(c: CardContents) -> str:
    provenance = next(iter(c.taught.values())).attrs
    return (
        f"{_counted(c.figures['members'], 'set')} of networks, preset {c.plan.preset.name}; flow on cells of "
        f"{1e3 * c.plan.cell_size:.3g} mm, {c.figures['seconds']:.0f} s to learn from; all runs took {c.spent:.2g} h "
        f"on one core each ({c.plan.core_hours:.2g} h planned); exumob {provenance.get('exumob_version', '?')} "
        f"({provenance.get('git_revision', '?')}), {str(provenance.get('date', ''))[:10]}."
    )


def _verdict(c: CardContents) -> str:
    """Say in a few sentences what the card says."""
    error, base = c.figures["load_error"], c.figures["coefficients_load_error"]
    better = "better than" if error < BETTER * base else "no better than" if error < 1.05 * base else "worse than"
    drives = "No drive could be compared with the flow in the loop."
    if c.figures["drives"]:
        ends, others = ([one[name] for one in c.figures["drives"]] for name in ("end", "coefficients_end"))
        known = [end for end in others if end is not None]
        alone = f", with the coefficients {100.0 * float(np.mean(known)):.3g} %" if known else ""
        shares = 100.0 * float(np.mean([one["fallback"] for one in c.figures["drives"]]))
        drives = (
            f"Drives end {100.0 * float(np.mean(ends)):.3g} % of the path (at worst {100.0 * max(ends):.3g} %) from "
            f"those with the flow in the loop{alone}; the coefficients gave {shares:.0f} % of the loads in them."
        )
    bars = f"{100.0 * c.figures['inside']:.0f} % of the loads lie within two standard deviations (it should be 95 %)."
    return (
        f"On runs that they have not seen the loads are off by {error:.2f} of their deviation, {better} the "
        f"coefficients fitted to the same runs ({base:.2f}). {drives} {bars} {shortfall(c.figures)}"
    ).rstrip()


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _range_text(c: CardContents) -> str:
    f, car = c.figures, c.plan.vehicle
    text = (
        f"Runs to learn from have depths of {f['depth_ratio'][0]:.2f} to {f['depth_ratio'][1]:.2f} of the tyre's "
        f"diameter ({1e3 * car.wheel.diameter:.0f} mm) and currents of {f['current_speed'][0]:.2f} to "
        f"{f['current_speed'][1]:.2f} m/s. Depth and current are constant in each run. Below: "
        "waters of the runs, speeds of the hull through the water and attitudes over which the networks have learnt."
    )
    return f"<p>{html.escape(text)}</p>"


def _draw_range(c: CardContents) -> Figure:
    names = ("forward_flow", "lateral_flow", "immersion", "pitch", "yaw_rate", "steering")
    inputs = np.concatenate(
        [network_inputs(body_states(run)[::20], water_of(run), names)[:, 0] for run in c.taught.values()]
    )
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 4, figsize=(12.0, 3.0), layout="constrained")
        free = {task.name for task in c.plan.tasks if isinstance(task, FreeTask) and task.role == "apart"}
        kinds = (
            ("to learn from", "o", "C0", c.taught),
            ("captive, apart", "s", "C1", {n: run for n, run in c.apart.items() if n not in free}),
            ("drives, apart", "^", "C2", {n: run for n, run in c.apart.items() if n in free}),
        )
        for label, marker, color, runs in kinds:
            waters = [water_of(run) for run in runs.values()]
            velocity = np.array([water.velocity[:2] for water in waters]).reshape(-1, 2)
            ratio = [water.uniform_depth / c.plan.vehicle.wheel.diameter for water in waters]
            axes[0].scatter(ratio, np.hypot(*velocity.T), marker=marker, color=color, label=label, s=24)
            axes[1].scatter(*velocity.T, marker=marker, color=color, s=24)
        axes[0].set(xlabel="depth over tyre diameter", ylabel="current [m/s]", title="waters")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=3, fontsize="x-small")
        axes[1].set(xlabel="current ahead [m/s]", ylabel="to the left [m/s]", title="where currents flow to")
        axes[1].set_aspect("equal", "datalim")
        axes[2].hexbin(inputs[:, 0], inputs[:, 1], gridsize=28, mincnt=1, cmap="Blues", bins="log", linewidths=0.1)
        axes[2].set(xlabel="through the water ahead [m/s]", ylabel="to the left [m/s]", title="hull through the water")
        axes[3].hexbin(
            1e3 * inputs[:, 2], np.degrees(inputs[:, 3]), gridsize=28, mincnt=1, cmap="Blues", bins="log",
            linewidths=0.1,
        )  # fmt: skip
        axes[3].set(xlabel="level above the hull's origin [mm]", ylabel="pitch [deg]", title="immersion and trim")
    return figure


def _load_text(c: CardContents) -> str:
    runs = ", ".join(f"{name} {float(v):.2f}" for name, v in zip(c.compared, c.errors["by_run"].values, strict=True))
    text = (
        "Root mean square error over the standard deviation of the flow's loads in all runs kept apart; below 1 a "
        "model knows more than the mean. Deviations of less than a thousandth of the weight (a moment: times half the "
        f"wheelbase) count as that much. In brackets: the {compared_with(c.figures)}. Two "
        f"repetitions of one flow differ by about 0.2. By run (mean): {runs}."
    )
    return f"<p>{html.escape(text)}</p>"


def _load_table(c: CardContents) -> str:
    head = "".join(f"<th>{component}</th>" for component in WRENCH_COMPONENTS)
    rows = []
    for b, body in enumerate(BODIES):
        cells = []
        for k in range(len(WRENCH_COMPONENTS)):
            own, base = (float(c.errors[name].values[b, k]) for name in ("networks", "coefficients"))
            kind = "good" if own <= GREEN else "fair" if own <= AMBER else "poor"
            cells.append(f'<td class="{kind}">{own:.2f} <span class="note">({base:.2f})</span></td>')
        rows.append(f"<tr><td>{body.replace('_', ' ')}</td>{''.join(cells)}</tr>")
    return f"<table><tr><th>body</th>{head}</tr>{''.join(rows)}</table>"


def _draw_loads(c: CardContents) -> Figure:
    name, one = next(iter(c.compared.items()))
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(len(SHOWN), 1, figsize=(10.0, 7.0), sharex=True, layout="constrained")
        for axes, (body, component, unit) in zip(panels, SHOWN, strict=True):
            b, k = BODIES.index(body), WRENCH_COMPONENTS.index(component)
            mean, spread = one.networks[:, b, k], bars_of(one.spread, c.errors["floor"].values)[:, b, k]
            axes.fill_between(one.time, mean - 2.0 * spread, mean + 2.0 * spread, color="C0", alpha=0.25, lw=0.0)
            axes.plot(one.time, one.coefficients[:, b, k], color="0.6", lw=0.9, label="coefficients")
            axes.plot(one.time, one.flow[:, b, k], color="k", lw=1.0, label="flow")
            axes.plot(one.time, mean, color="C0", lw=1.2, label="networks, two standard deviations")
            axes.set_ylabel(f"{body.replace('_', ' ')} {component} [{unit}]")
            low, high = np.quantile(np.concatenate([one.flow[:, b, k], mean]), [0.002, 0.998])
            axes.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))
        panels[0].legend(ncols=3, loc="upper right")
        panels[0].set_title(f"{name}, kept apart")
        panels[-1].set_xlabel("time [s]")
    return figure


def _drive_text(c: CardContents) -> str:
    text = (
        "The vehicle drives with the networks (steps of the setting fast), with the "
        + compared_with(c.figures)
        + (", and with the calibrated coefficients that come with exumob" if c.figures["rests"] else "")
        + "; its path is compared with that of the run with the flow in the loop, over the length of that path."
    )
    return f"<p>{html.escape(text)}</p>"


def _drive_table(c: CardContents) -> str:
    if not c.drives:
        return "<p>None: the drives with the flow in the loop broke down, or there is none yet.</p>"
    rows = []
    for one in c.drives:

        def figure(measures: dict[str, float] | None, name: str, digits: str = ".2f") -> str:
            return "-" if measures is None else format(measures[name], digits)

        cells = [
            f"{one.maneuver}", one.soil, f"{one.duration:g}", f"{one.depth_ratio:.2f}", f"{one.current:.2f}",
            figure(one.networks, "path"),
            f"<b>{figure(one.networks, 'final')}</b>", figure(one.networks, "yaw"),
            figure(one.coefficients, "final"), figure(one.calibrated, "final"), f"{100.0 * one.outside:.0f}",
            f"{100.0 * one.fallback:.0f}",
        ]  # fmt: skip
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    heads = (
        "drive", "soil", "time [s]", "depth ratio", "current [m/s]", "path, rms [%]", "end [%]", "yaw, rms [deg]",
        "end, fitted coefficients [%]", "end, calibrated [%]", "outside range [% of time]", "coefficients' share [%]",
    )  # fmt: skip
    return f"<table><tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>{''.join(rows)}</table>"


def _draw_paths(c: CardContents) -> Figure:
    styles = {
        "flow in the loop": ("k", 1.6), "networks": ("C0", 1.4), "coefficients": ("0.6", 1.0),
        "calibrated": ("C1", 1.0),
    }  # fmt: skip
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            1, len(c.drives), figsize=(max(3.6 * len(c.drives), 5.0), 3.4), squeeze=False, layout="constrained"
        )
        for axes, one in zip(panels.flat, c.drives, strict=True):
            for model, path in one.paths.items():
                color, width = styles[model]
                axes.plot(*path, color=color, lw=width, label=model)
            axes.set(xlabel="x [m]", ylabel="y [m]", title=f"{one.maneuver}, depth {one.depth_ratio:.2f}")
            axes.set_aspect("equal", "datalim")
        panels[0, 0].legend(fontsize="x-small")
    return figure


def _calibration_text(c: CardContents) -> str:
    f, members = c.figures, c.figures["members"]
    reached = [z for z, share in zip(DEVIATIONS, c.errors["inside"].values, strict=True) if share >= NORMAL[TWO]]
    factor = (
        f"{reached[0]:g} deviations hold as many as two should"
        if reached
        else f"not even {DEVIATIONS[-1]:g} deviations hold as many as two should"
    )
    spread = float((c.errors["spread"] / c.errors["deviation"]).mean())
    alone = (
        f" The spread of the {members} members alone is {spread:.2f} wide, and two of it hold "
        f"{100.0 * f['inside_spread']:.0f} %."
        if members > 1
        else ""
    )
    others = "; each of these is judged with what was measured on the others" if f["runs"] > 1 else ""
    text = (
        "The error bar of a load is the spread of the members and what all of them lack, which was measured on the "
        f"runs kept apart{others}. Two standard deviations hold "
        f"{100.0 * f['inside']:.0f} % of the loads ({factor}); one is {f['width']:.2f} of the loads' deviation wide, "
        f"to either side.{alone} A run with the networks keeps the bars as hydrodynamics_load_error_bar. They hold the "
        "error beside the flow on these cells, with the flow's scatter from run to run; not what other cells would "
        "change, and not the error of the flow model."
    )
    return f"<p>{html.escape(text)}</p>"


def _draw_calibration(c: CardContents) -> Figure:
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(4.4, 3.4), layout="constrained")
        axes.plot(DEVIATIONS, 100.0 * np.array(NORMAL), color="0.5", ls="--", label="as errors should fall")
        axes.plot(DEVIATIONS, 100.0 * c.errors["inside"].values, color="C0", marker="o", ms=3, label="error bars")
        if c.figures["members"] > 1:
            alone = 100.0 * c.errors["inside_spread"].values
            axes.plot(DEVIATIONS, alone, color="C1", marker="s", ms=3, label="spread alone")
        axes.set(xlabel="standard deviations", ylabel="loads within [%]", ylim=(0.0, 102.0))
        axes.legend()
    return figure


def unknown(c: CardContents) -> list[str]:
    """Say what the networks of a card do not know, a line each."""
    f = c.figures
    found = [
        f"Depths outside {f['depth_ratio'][0]:.2f} to {f['depth_ratio'][1]:.2f} tyre diameters, currents above "
        f"{f['current_speed'][1]:.2f} m/s"
        + {"ahead": " or from any side but ahead", "along": " or from the sides", "all": ""}[f["directions"]]
        + ": the calibrated coefficients take over there.",
        "Beds that are not level, waves, and water whose depth or current changes in time or along the vehicle.",
        f"Other soils in closed loop: all drives above were on {', '.join(f['soils']) or 'none'}.",
        "This vehicle with another mass or suspension"
        + (f", and drives longer than {max(one.duration for one in c.drives):g} s." if c.drives else "."),
        "Motions beyond the envelope of the drives that it came from (the figure above shows what was met).",
        "The error of the flow solver itself: all is compared with it, and no vehicle was measured in water.",
    ]
    if c.plan.preset.architecture.memory < 0.1:
        found.insert(
            2, "The past: networks of this preset answer to the present motion; what lags behind it, as bow waves do, "
            "is an error of theirs."
        )  # fmt: skip
    if c.plan.lost:
        found.insert(0, "What the cells do not resolve: " + "; ".join(c.plan.lost) + ".")
    if c.figures["drives_failed"]:
        found.append(f"{c.figures['drives_failed']} drives could not be compared: one of the two broke down or stood.")
    versions = {run.attrs.get("flow_revision") for run in (*c.taught.values(), *c.apart.values())} - {None}
    if len(versions) > 1:
        found.append(f"The loads of one version of the flow solver: the runs are of {len(versions)}, which may differ.")
    if f["runs"] < 5:
        found.append(f"Much about their own errors: {f['runs']} runs were kept apart. A larger budget adds more.")
    return found + [f"Run {name} broke down and is not there: {text}" for name, text in c.failed.items()]


def _run_table(c: CardContents) -> str:
    rows = []
    for kind, runs in (("taught", c.taught), ("kept apart", c.apart)):
        for name, run in runs.items():
            water = water_of(run)
            hours = (float(run.attrs.get("wall_time", 0.0)) + float(run.attrs.get("settling_wall_time", 0.0))) / 3600.0
            side = math.degrees(math.remainder(water.current_direction - math.pi, 2.0 * math.pi))
            cells = (
                html.escape(name), kind, f"{float(run['time'][-1]):.1f}",
                f"{water.uniform_depth / c.plan.vehicle.wheel.diameter:.2f}", f"{water.current_speed:.2f}",
                f"{side:.0f}" if water.current_speed > 0.0 else "-", f"{hours:.3f}",
            )  # fmt: skip
            rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    heads = ("run", "for", "time [s]", "depth ratio", "current [m/s]", "from ahead by [deg]", "took [h]")
    return f"<table><tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>{''.join(rows)}</table>"


def _list(texts: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{html.escape(text)}</li>" for text in texts) + "</ul>"


def _inlined(figure: Figure) -> str:
    """Return a figure as an image inside the page."""
    stream = io.BytesIO()
    try:
        figure.savefig(stream, format="png", dpi=110)
    finally:
        plt.close(figure)
    return f'<p><img alt="" src="data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"></p>'
