"""Errors of runs that broke down or were stopped; both keep what was computed until then."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


class SimulationError(RuntimeError):
    """A run could not go on; the message says when, why and what to do."""

    def __init__(self, message: str = "", *, cause: str = "") -> None:
        """Say what happened; `cause` is for programs, see below."""
        super().__init__(message)
        self.cause = cause

    result: xr.Dataset | None = None
    """The run until then, if anything of it was computed"""
    state: dict[str, Any] | None = None
    """State of the flow solver before the step that failed, for `exumob.flow.FlowSolver.restore`"""
    cause: str
    """What befell the vehicle, a word of `exumob.simulation.verdict.CONDITIONS`: ``"sunk"`` if a wheel sank to its
    centre, ``"tipped"`` if the vehicle fell over before the start; else empty"""


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C was pressed during a run."""

    def __init__(self, time: float, result: xr.Dataset) -> None:
        """Keep the time reached [s] and what was computed until then."""
        super().__init__(f"interrupted at {time:.3f} s of simulated time")
        self.time = time
        self.result = result
