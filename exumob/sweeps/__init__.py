"""From one run to thousands: what is varied, how it is sampled, and how the cases are run and kept."""

from exumob.sweeps.experiment import Experiment
from exumob.sweeps.runner import sweep
from exumob.sweeps.sampling import Choice, LogNormal, Normal, Triangular, Uniform, as_grid, grid, sample

__all__ = ["Choice", "Experiment", "LogNormal", "Normal", "Triangular", "Uniform", "as_grid", "grid", "sample", "sweep"]
