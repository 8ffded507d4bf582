"""Many runs: names of what is varied, samples, and the cases run side by side and kept."""

from typing import TYPE_CHECKING

from exumob.support.lazy import on_first_use

if TYPE_CHECKING:
    from exumob.sweeps.experiment import Experiment
    from exumob.sweeps.run import sweep
    from exumob.sweeps.sampling import Choice, LogNormal, Normal, Triangular, Uniform, as_grid, grid, sample
    from exumob.sweeps.tuning import Genetic, Simplex, Tuned, tune
else:
    __getattr__, __dir__ = on_first_use(__name__)

__all__ = [
    "Choice", "Experiment", "Genetic", "LogNormal", "Normal", "Simplex", "Triangular", "Tuned", "Uniform", "as_grid",
    "grid", "sample", "sweep", "tune",
]  # fmt: skip
