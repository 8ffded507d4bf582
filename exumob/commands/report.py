"""What a command says of a run: its verdict first, then its key figures, then the files written."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from exumob.commands.shared import aspects, console, write_result

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from exumob.mobility.ford import FordReport

DOUBTFUL = ("stuck", "bottomed", "afloat", "slides", "stands", "too short to tell")
"""Verdicts whose line is yellow."""


def report_run(result: xr.Dataset, targets: dict[str, Path | None], setting: str = "") -> bool:
    """Print verdict and key figures of a run, and write its files; return whether all of them were written.

    Parameters
    ----------
    result : xarray.Dataset
        The run, whole or not.
    targets : dict of str to path or None
        Files by option: ``--output``, ``--figure``, ``--animate``.
    setting : str
        The setting, with the error that was measured with it; empty: none was.
    """
    from exumob.simulation.plotting import plot_run
    from exumob.simulation.summary import summary

    _print_verdict(result)
    _print_trust(result)
    if result.sizes["time"] > 1:
        _print_summary(result, summary(result), setting)
    return write_result(result, targets, plot_run, _animation(result))


def report_ford(
    result: xr.Dataset, report: FordReport, targets: dict[str, Path | None], plot: Callable[[xr.Dataset], Figure]
) -> bool:
    """Print the report on a ford, and write the files of its run; return whether all of them were written.

    Parameters
    ----------
    result : xarray.Dataset
        The run, whole or not.
    report : FordReport
    targets : dict of str to path or None
        Files by option: ``--output``, ``--figure``, ``--animate``.
    plot : callable
        Draws it.
    """
    for name, text in report.lines().items():
        style = None
        if name == "verdict":
            style = _good(result) if report.crosses else "red"
        elif name == "trust":
            style = None if _good(result) == "green" else "yellow"
        console.print(f"{name:<12} {aspects(text, 13) if name == 'trust' else text}", style=style, soft_wrap=True)
    _print_second_opinion(result, 12)
    kept = result.isel(time=slice(report.last + 1))
    return write_result(result, targets, plot, lambda _, file: _animation(result)(kept, file))


def _animation(result: xr.Dataset) -> Callable[[xr.Dataset, Path], None]:
    from exumob.simulation.animation import animate_run

    animate: Callable[[xr.Dataset, Path], None] = animate_run
    if "hydrodynamics_elevation" in result:
        from exumob.flow.output.pictures import animate_surface as animate
    return animate


def _print_verdict(result: xr.Dataset) -> None:
    from exumob.simulation.verdict import verdict_of

    verdict = verdict_of(result)
    if verdict is not None:
        style = _good(result) if verdict.kind == "drives" else "yellow" if verdict.kind in DOUBTFUL else "red"
        console.print(f"{'verdict':<21} {verdict.sentence}", style=style, soft_wrap=True)


def _good(result: xr.Dataset) -> str:
    """Colour of good news: green only where runs like this one were measured."""
    return "green" if result.attrs.get("trust_status") == "measured" else "yellow"


def _print_trust(result: xr.Dataset) -> None:
    if "trust" in result.attrs:
        style = None if _good(result) == "green" else "yellow"
        console.print(f"{'trust':<21} {aspects(result.attrs['trust'], 22)}", style=style, soft_wrap=True)
    _print_second_opinion(result, 21)
    parts = str(result.attrs.get("trust_errors", "")).splitlines()
    if parts:
        heading = "parts of the error where it was measured, each by itself (of the path's end, over its length):"
        console.print(heading, soft_wrap=True)
    for part in parts:
        name, _, amount = part.partition(": ")
        console.print(f"  {name:<23} {amount}", soft_wrap=True)


def _print_second_opinion(result: xr.Dataset, width: int) -> None:
    if "second_opinion" in result.attrs:
        style = "yellow" if result.attrs["second_opinion_disagrees"] else None
        console.print(f"{'2nd opinion':<{width}} {result.attrs['second_opinion']}", style=style, soft_wrap=True)


def _print_summary(result: xr.Dataset, figures: dict[str, Any], setting: str) -> None:
    from exumob.simulation.plotting import water_label

    slip, dry = figures["mean_slip"], json.loads(result.attrs["parameters"])["water"] is None
    buoyed = f"{100 * figures['buoyed_share']:.1f} % carried by the water (mean)"
    lines = {
        "run": f"{result.attrs['title'].removeprefix('exumob run of ')}, {water_label(result)}; "
        f"{result.attrs['status'].split(':')[0]}",
        "distance": f"{figures['distance']:.3f} m along the path, {figures['forward']:.3f} m forward",
        "lateral displacement": f"{figures['lateral']:+.3f} m",
        "final yaw": f"{math.degrees(figures['yaw']):+.2f} deg",
        "drift angle": f"{math.degrees(figures['drift_angle']):+.2f} deg (course less heading, at the end)",
        "slip": "no contact with the soil (second half)"
        if math.isnan(slip)
        else f"{100 * slip:.1f} % (mean of the wheels in contact, second half)",
        **({} if dry else {"buoyed weight": buoyed}),
        "driving energy": f"{figures['spin_energy']:.1f} J",
        **({"setting": setting} if setting and result.attrs.get("trust_status") == "measured" else {}),
        **_range_lines(figures),
        **_member_lines(figures),
        "wall time": f"{figures['wall_time']:.2f} s, and {float(result.attrs['settling_wall_time']):.2f} s to settle"
        + _compiling(float(result.attrs["compiling_wall_time"])),
        "real-time factor": f"{figures['real_time_factor']:.2f} (simulated over wall time)",
    }
    for name, text in lines.items():
        console.print(f"{name:<21} {text}", soft_wrap=True)


def _compiling(seconds: float) -> str:
    """Say how long Numba compiled, apart from a second here or there."""
    return f"; {seconds:.0f} s to compile kernels, which are kept" if seconds > 2.0 else ""


def _range_lines(figures: dict[str, Any]) -> dict[str, str]:
    """Say how long the vehicle was outside the networks' training range."""
    if "out_of_range_share" not in figures:
        return {}
    wide = figures.get("wide_range_share", 0.0)
    return {
        "training range": f"left for {100 * figures['out_of_range_share']:.1f} % of the time; coefficients' "
        f"share of the loads {100 * figures['fallback_share']:.1f} %"
        + (f", that of the networks for the whole range {100 * wide:.1f} %" if wide > 0.0005 else "")
    }


def _member_lines(figures: dict[str, Any]) -> dict[str, str]:
    """Say how far the runs of the single networks end from each other."""
    if "forward_spread" not in figures:
        return {}
    return {
        "members' spread": f"of {figures['members']:.0f}: {1e3 * figures['forward_spread']:.0f} mm forward, "
        f"{1e3 * figures['lateral_spread']:.0f} mm lateral, "
        f"{math.degrees(figures['yaw_spread']):.2f} deg (standard deviations at the end)"
    }
