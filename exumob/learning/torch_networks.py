"""The networks as torch modules: paper Eqs. (8) and (9), and the dense layer of the ablation."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from exumob.surrogates.networks import Architecture


class LoadNetwork(nn.Module):
    """Six scaled loads of one body from a window of its scaled inputs (paper Fig. 3).

    An LSTM layer (or a dense one fed the whole window at once), then a dense layer, both with hyperbolic tangents, then
    a linear one. Parameters have the names and shapes of `Architecture.shapes`.
    """

    def __init__(self, architecture: Architecture, generator: torch.Generator) -> None:
        super().__init__()
        if architecture.layer == "polynomial":
            raise ValueError("Architecture.layer = 'polynomial' has no weights to train; see `polynomial`.")
        self.architecture = architecture
        shapes = architecture.shapes()
        for name, shape in shapes.items():
            fan = {"W": architecture.width, "U": architecture.width, "b": architecture.width}
            reach = 1.0 / math.sqrt(
                fan.get(name, shapes["dense_weight"][1] if name.startswith("dense") else shapes["out_weight"][1])
                if architecture.layer == "lstm" or name not in ("W", "b")
                else shapes["W"][1]
            )
            value = (2.0 * torch.rand(shape, generator=generator) - 1.0) * reach
            self.register_parameter(name, nn.Parameter(value))

    def forward(self, x: Tensor) -> Tensor:
        """Scaled loads, shape (n, 6), from windows of scaled inputs, shape (n, taps, k), oldest first."""
        w = dict(self.named_parameters())
        if self.architecture.layer == "dense":
            hidden = torch.tanh(torch.addmm(w["b"], x.flatten(1), w["W"].T))
        else:
            hidden = self._lstm(x, w)
        hidden = torch.tanh(torch.addmm(w["dense_bias"], hidden, w["dense_weight"].T))
        return torch.addmm(w["out_bias"], hidden, w["out_weight"].T)

    def _lstm(self, x: Tensor, w: dict[str, Tensor]) -> Tensor:
        """Paper Eqs. (8) and (9); h and c start at 0, gates in the order i, f, c, o."""
        hidden = cell = None
        for tap in range(x.shape[1]):
            gates = torch.addmm(w["b"], x[:, tap], w["W"].T)
            if hidden is not None:
                gates = torch.addmm(gates, hidden, w["U"].T)
            i, f, g, o = gates.chunk(4, dim=1)
            fresh = torch.sigmoid(i) * torch.tanh(g)
            cell = fresh if cell is None else torch.sigmoid(f) * cell + fresh
            hidden = torch.sigmoid(o) * torch.tanh(cell)
        assert hidden is not None
        return hidden
