"""What can be trained, by name."""

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
    """An architecture and how it is trained."""

    name: str
    architecture: Architecture
    learning_rate: float = 1e-3
    """Of Adam (the paper's)"""
    batch: int = 256
    epochs: int = 100
    """At most"""
    patience: int = 12
    """Epochs without a smaller error on the held-back run until training stops"""
    thinning: int = 8
    """Every so many milliseconds is an example, from another offset each epoch"""
    mirror: bool = False
    """Whether every run is also shown mirrored in the vehicle's plane of symmetry"""
    noise: float = 0.0
    """Standard deviation of what is added to the scaled inputs [-]"""
    ridge: float = 1e-3
    """Of the polynomial's coefficients, over the number of examples [-]"""

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
"""Chosen by closed-loop error on the held-back runs; comes with exumob.

``memory``, the same with a second of the past, is worse there (0.98 instead of 0.75 % of the path): nine runs do not
teach what the bow wave remembers."""
