"""Networks as an ONNX graph: for other programs, languages and machines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exumob.support.files import atomic_write, require_ending
from exumob.surrogates.inputs import INPUTS, SAMPLING
from exumob.surrogates.networks import EDGE, Architecture, NetworkSet, exponents
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS

OPSET = 17
"""Version of the ONNX operators."""


def export_onnx(networks: NetworkSet, file: str | Path) -> Path:
    """Write the five networks as one graph.

    Input ``states``, float32, shape (n, 5, taps, k): unscaled, oldest first, bodies and inputs as the file's metadata
    say. Output ``loads``, shape (n, 5, 6): N and N m, body axes. Scaling and the training range's edge,
    at which inputs are held, are part of the graph; a base model, whose loads are to be added, is not: the metadata
    ``waves`` hold its coefficients of waves (`exumob.water.wave_loads.WaveCoefficients.terms`).

    Parameters
    ----------
    networks : NetworkSet
    file : path
        Name of the file, ending in .onnx.

    Returns
    -------
    Path

    Raises
    ------
    ImportError
        If the package onnx is not installed (``pip install 'exumob[onnx]'``).
    ValueError
        If the file's ending is another.
    """
    require_ending("export_onnx.file =", file, (".onnx",))
    import onnx
    from onnx import TensorProto, helper

    architecture = networks.architecture
    graph = _Graph(helper)
    _add_networks(graph, networks)
    states: list[str | int] = ["n", len(BODIES), architecture.window, len(architecture.inputs)]
    loads: list[str | int] = ["n", len(BODIES), len(WRENCH_COMPONENTS)]
    model = helper.make_model(
        helper.make_graph(
            graph.nodes, "exumob_networks",
            [helper.make_tensor_value_info("states", TensorProto.FLOAT, states)],
            [helper.make_tensor_value_info("loads", TensorProto.FLOAT, loads)],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9,
        producer_name="exumob",
    )  # fmt: skip
    helper.set_model_props(
        model,
        {
            "bodies": ", ".join(BODIES),
            "inputs": ", ".join(f"{name} [{INPUTS[name].unit}]" for name in architecture.inputs),
            "outputs": ", ".join(WRENCH_COMPONENTS),
            "interval": f"{architecture.stride * SAMPLING:g} s between the taps, the present one last",
            "filters": ", ".join(f"{tau:g}" for tau in architecture.filters)
            + " s: time constants of filtered inputs, which stand before the taps" * bool(architecture.filters),
            "base": architecture.base,
            "waves": json.dumps(networks.about.get("waves", [])),
            "networks": f"{networks.name}, {networks.digest()}",
        },
    )
    path = Path(file)
    with atomic_write(path) as temporary:
        onnx.save(model, str(temporary))
    return path


def _add_networks(graph: _Graph, networks: NetworkSet) -> None:
    """Add all nodes from ``states`` to ``loads``: hold at the edge of the range, scale, network, scale back."""
    architecture, a = networks.architecture, networks.arrays
    mean, scale, low, high = (a[f"input_{name}"][:, None, :] for name in ("mean", "scale", "low", "high"))
    edge = EDGE * (high - low)
    held = graph("Min", graph("Max", "states", graph.constant(low - edge)), graph.constant(high + edge))
    scaled = graph("Div", graph("Sub", held, graph.constant(mean)), graph.constant(scale))
    x = graph("Transpose", scaled, perm=[1, 2, 0, 3])  # body, tap, instant, input
    taps = [graph("Gather", x, graph.constant(np.array(n)), axis=1) for n in range(architecture.window)]

    def layer(given: str, weight: str, bias: str) -> str:
        return graph("Add", graph("MatMul", given, graph.constant(a[weight].mT)), graph.constant(a[bias][:, None]))

    if architecture.layer == "polynomial":
        out = _polynomial(graph, taps[0], architecture, a)
    else:
        if architecture.layer == "dense":
            hidden = graph("Tanh", layer(graph("Concat", *taps, axis=2), "W", "b"))
        else:
            hidden = _lstm(graph, taps, a, layer)
        hidden = graph("Tanh", layer(hidden, "dense_weight", "dense_bias"))
        out = layer(hidden, "out_weight", "out_bias")
    sized = graph("Mul", out, graph.constant(a["output_scale"][:, None]))
    graph("Transpose", graph("Add", sized, graph.constant(a["output_mean"][:, None])), perm=[1, 0, 2])
    graph.nodes[-1].output[0] = "loads"


def _polynomial(graph: _Graph, present: str, architecture: Architecture, arrays: dict[str, Any]) -> str:
    """Nodes of the regression: all monomials of the present inputs, times the coefficients."""
    k, degree = len(architecture.inputs), architecture.degree
    factors = [(*[k] * (degree - len(c)), *c) for c in exponents(k, degree)]  # input k is the constant 1
    with_one = graph("Pad", present, graph.constant(np.array([0, 0, 0, 0, 0, 1])), graph.constant(np.float32(1.0)))
    terms, *others = [
        graph("Gather", with_one, graph.constant(np.array(c)), axis=2) for c in zip(*factors, strict=True)
    ]
    for column in others:
        terms = graph("Mul", terms, column)
    return graph("MatMul", terms, graph.constant(arrays["coefficients"]))


def _lstm(graph: _Graph, taps: list[str], arrays: dict[str, Any], layer: Any) -> str:
    """Nodes of the LSTM layer: paper Eqs. (8) and (9), gates in the order i, f, c, o."""
    recurrent = graph.constant(arrays["U"].mT)
    hidden = cell = ""
    for given in taps:
        gates = layer(given, "W", "b")
        if hidden:  # h = c = 0 before
            gates = graph("Add", gates, graph("MatMul", hidden, recurrent))
        i, f, g, o = graph.split(gates, 4)
        fresh = graph("Mul", graph("Sigmoid", i), graph("Tanh", g))
        cell = graph("Add", graph("Mul", graph("Sigmoid", f), cell), fresh) if cell else fresh
        hidden = graph("Mul", graph("Sigmoid", o), graph("Tanh", cell))
    return hidden


class _Graph:
    """A graph under construction: nodes and constants, named by number."""

    def __init__(self, helper: Any) -> None:
        self._helper = helper
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def __call__(self, operation: str, *inputs: str, **attributes: Any) -> str:
        name = f"v{len(self.nodes)}"
        self.nodes.append(self._helper.make_node(operation, list(inputs), [name], **attributes))
        return name

    def split(self, value: str, parts: int) -> list[str]:
        """Names of equal parts of the last axis."""
        names = [f"v{len(self.nodes)}_{n}" for n in range(parts)]
        self.nodes.append(self._helper.make_node("Split", [value], names, axis=2))
        return names

    def constant(self, value: NDArray[Any] | np.generic) -> str:
        """Name of a new constant: float32, or int64 for whole numbers."""
        from onnx import numpy_helper

        array = np.asarray(value)
        kind = np.int64 if np.issubdtype(array.dtype, np.integer) else np.float32
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.array(array, kind, order="C"), name))
        return name
