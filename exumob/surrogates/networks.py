"""Trained networks as data: what they are, their file, and how they are evaluated without torch.

A `NetworkSet` is one network for each of the five bodies (paper Fig. 3), all of one `Architecture`. Its file is a
safetensors file (arrays only, no code) whose header carries a JSON text: names and units of inputs and outputs,
training runs, preset, seed, versions.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from exumob.support.arrays import Array
from exumob.support.checks import require_within
from exumob.support.files import atomic_write
from exumob.surrogates.inputs import INPUTS, PAPER_INPUTS
from exumob.vehicle.motion import BODIES, HISTORY_STEP, WRENCH_COMPONENTS
from exumob.vehicle.parameters import Vehicle

Single = NDArray[np.float32]
FORMAT, VERSION = "exumob networks", 1
SAMPLING = HISTORY_STEP
"""Interval at which networks see the past [s]."""
TRAINED_DENSITY = 1000.0
"""Of the water to which the loads in training are brought [kg/m^3]; they are proportional to it."""
EDGE = 0.05
"""Share of an input's training range by which it may leave it before it is held."""
GEOMETRY = (
    "hull.length", "hull.width", "hull.height", "hull.ground_clearance", "hull.center_of_mass_height",
    "hull.center_of_mass_x", "hull.center_x", "hull.bow_length", "hull.bow_height", "hull.mesh", "wheel.diameter",
    "wheel.width", "wheelbase", "track",
)  # fmt: skip
"""What the water sees of a vehicle: networks fit no vehicle that differs in it."""


@dataclass(frozen=True)
class Architecture:
    """Shape of the five networks."""

    inputs: tuple[str, ...] = PAPER_INPUTS
    """Of `exumob.surrogates.inputs.INPUTS`"""
    taps: int = 3
    """Instants that the network sees: now and those before"""
    stride: int = 1
    """Between them [ms]"""
    layer: Literal["lstm", "dense", "polynomial"] = "lstm"
    """First layer; ``"polynomial"`` is a regression without any"""
    width: int = 400
    """Units of the first layer"""
    dense: int = 100
    """Units of the dense layer that follows"""
    degree: int = 3
    """Of the polynomial"""
    base: Literal["none", "coefficients"] = "none"
    """Model to whose loads the network's are added"""

    def __post_init__(self) -> None:
        unknown = [name for name in self.inputs if name not in INPUTS]
        if unknown or not self.inputs:
            raise ValueError(f"Architecture.inputs: {unknown or 'nothing'} is not known; use {', '.join(INPUTS)}.")
        if self.layer not in ("lstm", "dense", "polynomial"):
            raise ValueError(f"Architecture.layer = {self.layer!r} is not known; use 'lstm', 'dense' or 'polynomial'.")
        if self.base not in ("none", "coefficients"):
            raise ValueError(f"Architecture.base = {self.base!r} is not known; use 'none' or 'coefficients'.")
        require_within("Architecture", 1, 1000, taps=self.taps, stride=self.stride)
        require_within("Architecture", 1, 4096, width=self.width, dense=self.dense)
        require_within("Architecture", 1, 6, degree=self.degree)
        if self.layer == "polynomial" and self.taps != 1:
            raise ValueError(f"Architecture.taps = {self.taps}: a polynomial is quasi-steady; use 1.")

    @property
    def memory(self) -> float:
        """How far the networks look back [s]."""
        return SAMPLING * self.stride * (self.taps - 1)

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each array of weights of one body."""
        k, h, d, n = len(self.inputs), self.width, self.dense, len(WRENCH_COMPONENTS)
        if self.layer == "polynomial":
            return {"coefficients": (len(exponents(k, self.degree)), n)}
        first: dict[str, tuple[int, ...]] = {"W": (h, k * self.taps), "b": (h,)}
        if self.layer == "lstm":
            first = {"W": (4 * h, k), "U": (4 * h, h), "b": (4 * h,)}
        return first | {"dense_weight": (d, h), "dense_bias": (d,), "out_weight": (n, d), "out_bias": (n,)}


@dataclass(frozen=True)
class NetworkSet:
    """Five trained networks, their scalers and the range in which they were trained."""

    architecture: Architecture
    arrays: dict[str, Single]
    """By name, body first: weights (`Architecture.shapes`), scalers and learning curves.

    ``input_low``, ``input_high``, shape (5, k): range of each input in training; ``joint_inverse`` (5, k, k): inverse
    covariance of the scaled inputs; ``joint_limit`` (5,): largest Mahalanobis distance in training."""
    about: dict[str, Any]
    """preset, seed, runs, held_back, geometry, data_hash, provenance"""

    @property
    def name(self) -> str:
        """Preset and seed."""
        return f"{self.about.get('preset', 'unnamed')}, seed {self.about.get('seed', '?')}"

    @property
    def size(self) -> int:
        """Bytes of weights."""
        return sum(self.arrays[name].nbytes for name in self.architecture.shapes())

    def check_vehicle(self, vehicle: Vehicle) -> None:
        """Raise ValueError if the water sees another vehicle than the one of the training runs."""
        for name, trained in self.about["geometry"].items():
            found = geometry(vehicle)[name]
            same = found == trained if not isinstance(trained, float) else math.isclose(found, trained, rel_tol=1e-3)
            if not same:
                raise ValueError(
                    f"networks ({self.name}): {vehicle.name} has {name} = {found}, they were trained with {trained}. "
                    "Train networks for this vehicle (`exumob train`), or use the coefficient model or the flow solver."
                )

    def save(self, file: str | Path) -> Path:
        """Write the file (.safetensors), under a temporary name first."""
        from safetensors.numpy import save

        header = {
            "format": FORMAT, "version": VERSION, "architecture": asdict(self.architecture), "about": self.about,
            "input_units": [INPUTS[name].unit for name in self.architecture.inputs], "bodies": BODIES,
            "outputs": WRENCH_COMPONENTS, "output_units": ["N"] * 3 + ["N m"] * 3,
        }  # fmt: skip
        path = Path(file)
        tensors = {name: np.array(a, order="C") for name, a in self.arrays.items()}
        data = save(tensors, {"exumob": json.dumps(header)})
        with atomic_write(path) as temporary:
            temporary.write_bytes(data)
        return path

    @classmethod
    def load(cls, file: str | Path) -> NetworkSet:
        """Read a file written by `save`.

        Raises
        ------
        ValueError
            If it is not such a file, of another version, or incomplete.
        """
        from safetensors import SafetensorError, safe_open

        path = Path(file)
        if not path.is_file():
            raise ValueError(f"{path}: there is no such file of networks; `exumob train` makes them.")
        try:
            with safe_open(path, "np") as stream:
                header = json.loads((stream.metadata() or {}).get("exumob", "{}"))
                arrays = {name: stream.get_tensor(name) for name in stream.keys()}
        except (SafetensorError, json.JSONDecodeError) as error:
            raise ValueError(f"{path} is not a file of networks ({error}); `exumob train` makes them.") from None
        if header.get("format") != FORMAT:
            raise ValueError(f"{path} holds arrays, but not exumob's networks; `exumob train` makes them.")
        if header["version"] != VERSION:
            raise ValueError(
                f"{path} is of version {header['version']} and this program reads {VERSION}; train again with "
                "`exumob train`."
            )
        known = {field.name for field in fields(Architecture)}
        given = header["architecture"]
        if set(given) != known:
            raise ValueError(f"{path}: its architecture has {sorted(set(given) ^ known)} too many or too few.")
        architecture = Architecture(**(given | {"inputs": tuple(given["inputs"])}))
        _check_arrays(architecture, arrays, path)
        return cls(architecture, arrays, header["about"])

    @classmethod
    def together(cls, sets: Sequence[NetworkSet]) -> NetworkSet:
        """Several sets of one architecture as one that holds the bodies of all, one set after the other."""
        first = sets[0]
        assert all(s.architecture == first.architecture for s in sets)
        names = [name for name in first.arrays if not name.endswith("_loss")]
        return cls(first.architecture, {n: np.concatenate([s.arrays[n] for s in sets]) for n in names}, first.about)

    def digest(self) -> str:
        """Short hash of all arrays."""
        found = hashlib.sha256()
        for name in sorted(self.arrays):
            found.update(name.encode() + self.arrays[name].tobytes())
        return found.hexdigest()[:16]

    def scaled(self, inputs: Array) -> Single:
        """Inputs less their mean over their scale; shape (..., 5, taps, k).

        Inputs outside their training range are first held at its edge: no network is asked for what it cannot know.
        """
        mean, scale, low, high = (
            self.arrays[name][:, None, :] for name in ("input_mean", "input_scale", "input_low", "input_high")
        )
        edge = EDGE * (high - low)
        return np.asarray((np.clip(inputs, low - edge, high + edge) - mean) / scale, np.float32)

    def loads(self, inputs: Array) -> Array:
        """Loads of the five networks for one instant.

        Parameters
        ----------
        inputs : array, shape (5, taps, k)
            Oldest first, unscaled.

        Returns
        -------
        array, shape (5, 6)
            Force [N] and moment [N m], body axes; without the base model's.
        """
        scaled = self.scaled(inputs)
        out = np.empty((len(scaled), len(WRENCH_COMPONENTS)), np.float32)
        a, architecture = self.arrays, self.architecture
        if architecture.layer == "polynomial":
            terms = monomials(scaled[:, 0], architecture.degree)
            out = np.einsum("bt,btn->bn", terms, a["coefficients"])
        else:
            turned = self._turned
            last = turned["dense_weight"], a["dense_bias"], turned["out_weight"], a["out_bias"]
            if architecture.layer == "lstm":
                _lstm(scaled, turned["W"], turned["U"], a["b"], *last, out)
            else:
                _dense(scaled.reshape(len(scaled), -1), turned["W"], a["b"], *last, out)
        return np.asarray(out * a["output_scale"] + a["output_mean"], float)

    @cached_property
    def _turned(self) -> dict[str, Single]:
        """Weights with the inputs first: the order in which they are read."""
        names = [name for name in self.architecture.shapes() if self.arrays[name].ndim == 3]
        return {name: np.ascontiguousarray(self.arrays[name].mT) for name in names}

    def many_loads(self, inputs: Array, batch: int = 2048) -> Array:
        """`loads` for n instants at once, with matrix products; shape (n, 5, taps, k) -> (n, 5, 6)."""
        out = [self._batch(self.scaled(inputs[i : i + batch])) for i in range(0, len(inputs), batch)]
        return np.asarray(np.concatenate(out) * self.arrays["output_scale"] + self.arrays["output_mean"], float)

    def _batch(self, scaled: Single) -> Single:
        a, architecture = self.arrays, self.architecture
        x = np.moveaxis(scaled, 1, 0)  # body, instant, tap, input
        if architecture.layer == "polynomial":
            terms = monomials(scaled[:, :, 0], architecture.degree)
            return np.asarray(np.einsum("nbt,btm->nbm", terms, a["coefficients"]), np.float32)
        if architecture.layer == "dense":
            hidden = np.tanh(x.reshape(len(x), len(scaled), -1) @ a["W"].mT + a["b"][:, None])
        else:
            hidden = cell = np.zeros((len(x), len(scaled), architecture.width), np.float32)
            for tap in range(architecture.taps):
                gates = x[:, :, tap] @ a["W"].mT + hidden @ a["U"].mT + a["b"][:, None]
                i, f, g, o = np.split(gates, 4, axis=-1)
                cell = _sigmoid(f) * cell + _sigmoid(i) * np.tanh(g)
                hidden = _sigmoid(o) * np.tanh(cell)
        hidden = np.tanh(hidden @ a["dense_weight"].mT + a["dense_bias"][:, None])
        return np.moveaxis(hidden @ a["out_weight"].mT + a["out_bias"][:, None], 0, 1)

    def excess(self, inputs: Array) -> Array:
        """How far inputs lie outside the training range.

        Parameters
        ----------
        inputs : array, shape (..., 5, k)
            Of one instant each.

        Returns
        -------
        array, shape (..., 5, 2)
            Worst single input: distance from its range over the range's width; all jointly: Mahalanobis distance over
            the largest in training, less 1. At most 0 inside.
        """
        low, high = self.arrays["input_low"], self.arrays["input_high"]
        width = np.maximum(high - low, 1e-3 * self.arrays["input_scale"])
        single = (np.maximum(low - inputs, inputs - high) / width).max(axis=-1)
        scaled = (inputs - self.arrays["input_mean"]) / self.arrays["input_scale"]
        square = np.einsum("...bi,bij,...bj->...b", scaled, self.arrays["joint_inverse"], scaled)
        joint = np.sqrt(np.maximum(square, 0.0)) / self.arrays["joint_limit"] - 1.0
        return np.stack([single, joint], axis=-1)


def geometry(vehicle: Vehicle) -> dict[str, Any]:
    """What the water sees of a vehicle, by name (`GEOMETRY`)."""
    found: dict[str, Any] = {}
    for name in GEOMETRY:
        value: Any = vehicle
        for part in name.split("."):
            value = getattr(value, part)
        found[name] = value if value is None or isinstance(value, int | float) else str(value)
    return found


def window_rows(time: Array, taps: int, stride: int) -> NDArray[np.intp]:
    """Rows of a history that the networks see, oldest first: by time, whatever the steps; before the first the first.

    Parameters
    ----------
    time : array, shape (n,)
        Of the rows [s].
    """
    wanted = time[-1] - SAMPLING * stride * np.arange(taps - 1, -1, -1)
    rows = np.searchsorted(time, wanted - 1e-7)  # the first row at or after: exact on the grid of the history
    return np.asarray(np.clip(rows, 0, len(time) - 1))


@cache
def exponents(k: int, degree: int) -> list[tuple[int, ...]]:
    """Factors of each monomial of k variables up to a degree, as their indices."""
    return [c for d in range(degree + 1) for c in itertools.combinations_with_replacement(range(k), d)]


def monomials(x: NDArray[Any], degree: int) -> NDArray[Any]:
    """All monomials up to a degree; shape (..., k) -> (..., terms)."""
    columns = [
        np.prod(x[..., list(c)], axis=-1) if c else np.ones(x.shape[:-1]) for c in exponents(x.shape[-1], degree)
    ]
    return np.stack(columns, axis=-1)


def _check_arrays(architecture: Architecture, arrays: dict[str, Single], path: Path) -> None:
    k, n = len(architecture.inputs), len(WRENCH_COMPONENTS)
    shapes: dict[str, tuple[int, ...]] = dict(architecture.shapes())
    shapes |= {name: (k,) for name in ("input_mean", "input_scale", "input_low", "input_high")}
    shapes |= {"joint_inverse": (k, k), "joint_limit": (), "output_mean": (n,), "output_scale": (n,)}
    for name, shape in shapes.items():
        if name not in arrays:
            raise ValueError(f"{path}: {name} is missing; the file is incomplete, train again with `exumob train`.")
        if arrays[name].shape != (5, *shape) or not np.isfinite(arrays[name]).all():
            raise ValueError(
                f"{path}: {name} has shape {arrays[name].shape} or is not finite; it must be {(5, *shape)}."
            )


def _sigmoid(x: Single) -> Single:
    return np.asarray(1.0 / (1.0 + np.exp(-x)), np.float32)


@njit(inline="always")
def _tanh(x: np.float32) -> np.float32:
    """Tanh to 3e-7 as a quotient of polynomials, the one of Eigen (MPL 2): without calls, hence vectorised."""
    x = min(max(x, np.float32(-7.9053111)), np.float32(7.9053111))
    s = x * x
    p = np.float32(-2.76076847742355e-16)
    p = p * s + np.float32(2.00018790482477e-13)
    p = p * s + np.float32(-8.60467152213735e-11)
    p = p * s + np.float32(5.12229709037114e-08)
    p = p * s + np.float32(1.48572235717979e-05)
    p = p * s + np.float32(6.37261928875436e-04)
    p = p * s + np.float32(4.89352455891786e-03)
    q = np.float32(1.19825839466702e-06)
    q = q * s + np.float32(1.18534705686654e-04)
    q = q * s + np.float32(2.26843463243900e-03)
    q = q * s + np.float32(4.89352518554385e-03)
    return x * p / q


@njit(inline="always")
def _add_product(turned: Single, x: Single, out: Single) -> None:
    """Out += turned.T @ x, four rows at a time: contiguous, vectorised, and out stays in the nearest cache."""
    n = turned.shape[0]
    whole = n - n % 4
    for k in range(0, whole, 4):
        x0, x1, x2, x3 = x[k], x[k + 1], x[k + 2], x[k + 3]
        r0, r1, r2, r3 = turned[k], turned[k + 1], turned[k + 2], turned[k + 3]
        for j in range(out.size):
            out[j] += r0[j] * x0 + r1[j] * x1 + r2[j] * x2 + r3[j] * x3
    for k in range(whole, n):
        row, value = turned[k], x[k]
        for j in range(out.size):
            out[j] += row[j] * value


@njit(cache=True, fastmath=True, error_model="numpy")
def _lstm(
    x: Single, w: Single, u: Single, b: Single, dense_weight: Single, dense_bias: Single, out_weight: Single,
    out_bias: Single, out: Single,
) -> None:  # fmt: skip
    """Eqs. (8) and (9), gates in the order i, f, c, o, then the dense layer and the outputs; bodies one by one.

    All matrices are turned: inputs first.
    """
    n = u.shape[1]
    hidden, cell, gates = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(4 * n, np.float32)
    half = np.float32(0.5)
    for body in range(x.shape[0]):
        cell[:] = 0.0
        for tap in range(x.shape[1]):
            gates[:] = b[body]
            _add_product(w[body], x[body, tap], gates)
            if tap > 0:  # h = 0 before
                _add_product(u[body], hidden, gates)
            for j in range(n):
                keep = half + half * _tanh(half * gates[n + j])
                take = half + half * _tanh(half * gates[j])
                cell[j] = keep * cell[j] + take * _tanh(gates[2 * n + j])
            for j in range(n):
                hidden[j] = _tanh(cell[j]) * (half + half * _tanh(half * gates[3 * n + j]))
        _outputs(hidden, dense_weight[body], dense_bias[body], out_weight[body], out_bias[body], out[body])


@njit(cache=True, fastmath=True, error_model="numpy")
def _dense(
    x: Single, w: Single, b: Single, dense_weight: Single, dense_bias: Single, out_weight: Single, out_bias: Single,
    out: Single,
) -> None:  # fmt: skip
    """The ablation: a dense layer in the place of the LSTM."""
    hidden = np.empty(w.shape[2], np.float32)
    for body in range(x.shape[0]):
        hidden[:] = b[body]
        _add_product(w[body], x[body], hidden)
        for j in range(hidden.size):
            hidden[j] = _tanh(hidden[j])
        _outputs(hidden, dense_weight[body], dense_bias[body], out_weight[body], out_bias[body], out[body])


@njit(cache=True, fastmath=True, error_model="numpy")
def _outputs(
    hidden: Single, dense_weight: Single, dense_bias: Single, out_weight: Single, out_bias: Single, out: Single
) -> None:
    last = dense_bias.copy()
    _add_product(dense_weight, hidden, last)
    for j in range(last.size):
        last[j] = _tanh(last[j])
    out[:] = out_bias
    _add_product(out_weight, last, out)
