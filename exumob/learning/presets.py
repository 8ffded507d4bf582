"""Presets: named architectures with the settings of their training."""

from __future__ import annotations

from dataclasses import dataclass

from exumob.support.checks import require_positive, require_within
from exumob.surrogates.networks import Architecture

FLOW_INPUTS = ("forward_flow", "lateral_flow", "forward_speed", "yaw_rate", "steering", "water_depth")
"""Motion through the water and over ground, turning, steering: smooth where the angles of Eq. (7) are not."""
RICH_INPUTS = (
    "forward_flow", "lateral_flow", "forward_speed", "yaw_rate", "immersion", "pitch", "roll", "heave_rate", "steering",
    "current_speed", "water_depth",
)  # fmt: skip
"""... and heave, pitch, roll."""


@dataclass(frozen=True)
class Preset:
    """An architecture and the settings of its training."""

    name: str
    architecture: Architecture
    learning_rate: float = 1e-3
    """Learning rate of Adam; the default is the paper's"""
    batch: int = 256
    epochs: int = 100
    """Largest number of epochs"""
    patience: int = 12
    """Epochs without a smaller validation error after which training stops"""
    thinning: int = 8
    """Interval between examples [ms]; every epoch begins at another offset"""
    mirror: bool = False
    """Learn from every run also as mirrored in the vehicle's plane of symmetry"""
    noise: float = 0.0
    """Standard deviation of the noise added to the scaled inputs [-]"""
    ridge: float = 1e-3
    """Ridge penalty on the polynomial's coefficients, over the number of examples [-]"""

    def __post_init__(self) -> None:
        require_positive("Preset", learning_rate=self.learning_rate)
        require_within("Preset", 1, 1_000_000, batch=self.batch, epochs=self.epochs, patience=self.patience)
        require_within("Preset", 1, 1000, thinning=self.thinning)
        require_within("Preset", 0.0, 10.0, noise=self.noise, ridge=self.ridge)


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
            "residual", Architecture(RICH_INPUTS, 1, 1, "dense", 64, 32, base="coefficients"), mirror=True, noise=0.05
        ),
        Preset(
            "memory", Architecture(RICH_INPUTS, 5, 250, "dense", 64, 32, base="coefficients"), mirror=True, noise=0.05
        ),
    )
}
BEST = "residual"
"""Preset of the networks that come with exumob, chosen by closed-loop error on the validation runs.

``memory``, the same with a second of the past, is worse there (0.98 instead of 0.75 % of the path): nine runs are too
few to learn the effect of the bow wave's history from."""
