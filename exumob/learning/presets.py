"""Presets: named architectures with the settings of their training."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from exumob.support.declared import Declared
from exumob.support.quantities import Quantity
from exumob.surrogates.networks import Architecture

FLOW_INPUTS = ("forward_flow", "lateral_flow", "forward_speed", "yaw_rate", "steering", "water_depth")
"""Motion through the water and over ground, turning, steering: smooth where the angles of Eq. (7) are not."""
RICH_INPUTS = (
    "forward_flow", "lateral_flow", "forward_speed", "yaw_rate", "immersion", "pitch", "roll", "heave_rate", "steering",
    "current_speed", "water_depth",
)  # fmt: skip
"""... and heave, pitch, roll."""
RESIDUAL_INPUTS = tuple(name for name in RICH_INPUTS if name not in ("current_speed", "water_depth"))
"""... without current and depth, which the coefficients beside the networks know: nine runs have nine pairs of them, by
which networks told the runs apart."""
COUNT = Quantity("1", at_least=1, at_most=1_000_000)
"""Numbers of examples and epochs"""
SHARE = Quantity("1", at_least=0.0, at_most=10.0)
"""Noise and penalties, over the deviation of what they are added to"""


@dataclass(frozen=True)
class Preset(Declared):
    """An architecture and the settings of its training."""

    name: str
    architecture: Architecture
    learning_rate: Annotated[float, Quantity("1", above=0.0, at_most=1.0)] = 1e-3
    """Learning rate of Adam; the default is the paper's"""
    batch: Annotated[int, COUNT] = 256
    epochs: Annotated[int, COUNT] = 100
    """Largest number of epochs"""
    patience: Annotated[int, COUNT] = 12
    """Epochs without a smaller validation error after which training stops"""
    thinning: Annotated[int, Quantity("ms", at_least=1, at_most=1000)] = 8
    """Interval between examples [ms]; every epoch begins at another offset"""
    mirror: bool = False
    """Learn from every run also as mirrored in the vehicle's plane of symmetry"""
    noise: Annotated[float, SHARE] = 0.0
    """Standard deviation of the noise added to the scaled inputs [-]"""
    equal_runs: bool = False
    """Weigh the errors of each run by the inverse variance of its loads: violent water does not drown calm water"""
    ridge: Annotated[float, SHARE] = 1e-3
    """Ridge penalty on the polynomial's coefficients, over the number of examples [-]"""

    def _check(self) -> None:
        if self.equal_runs and self.architecture.layer == "polynomial":
            raise ValueError("Preset.equal_runs has no effect on a polynomial, which is fitted at once; leave it out.")
        if not self.name.replace("-", "").replace("_", "").isalnum():
            raise ValueError(f"Preset.name = {self.name!r} names files; use letters, digits, - and _ alone.")


PRESETS = {
    preset.name: preset
    for preset in (
        Preset("paper-lstm", Architecture()),
        Preset("present-lstm", Architecture(taps=1)),
        Preset("paper-dense", Architecture(layer="dense", taps=1)),
        Preset("coefficients", Architecture(layer="polynomial", taps=1, degree=3)),
        Preset("flow-dense", Architecture(FLOW_INPUTS, 1, 1, "dense", 64, 32), mirror=True, noise=0.02),
        Preset("rich-dense", Architecture(RICH_INPUTS, 1, 1, "dense", 64, 32), mirror=True, noise=0.02),
        Preset(
            "residual",
            Architecture(RESIDUAL_INPUTS, 1, 1, "dense", 64, 32, base="coefficients"),
            mirror=True,
            noise=0.2,
        ),
        Preset(
            "memory",
            Architecture(RESIDUAL_INPUTS, 1, 1, "dense", 64, 32, base="coefficients", filters=(0.1, 0.3, 1.0, 2.5)),
            mirror=True,
            noise=0.2,
        ),
    )
}
PRESETS["balanced"] = replace(PRESETS["memory"], name="balanced", equal_runs=True)
LANE_CHANGES = "memory"
"""Preset of the networks for lane changes that come with exumob, chosen by closed-loop error on the validation runs:
0.43 % of the path (``residual``, the same without filtered inputs: 0.53 %)."""
WHOLE_RANGE = "balanced"
"""Preset of the networks for the whole range, and of `exumob learn`. Its weights of runs: `studies/weighing_runs.py`,
in which the load error of single networks on runs left out falls from 0.62 to 0.59."""
