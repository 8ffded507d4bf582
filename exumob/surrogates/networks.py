"""Trained networks as data: their architecture, their file and its checks, and their answer to inputs.

A `NetworkSet` is one network for each of the five bodies (paper Fig. 3), all of one `Architecture`. Its file is a
safetensors file (arrays only, no code) whose header carries a JSON text: names and units of inputs and outputs,
training runs, preset, seed, versions. Networks are evaluated by `exumob.surrogates.network_kernels`, without torch.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from exumob.support.arrays import Array
from exumob.support.declared import Declared
from exumob.support.files import PACKAGE, atomic_write, why_no_file
from exumob.support.quantities import Quantity, shown
from exumob.surrogates.inputs import INPUTS, PAPER_INPUTS, SAMPLING
from exumob.surrogates.network_kernels import (
    InputScaling,
    OutputLayers,
    Single,
    TrainingRange,
    evaluate_batch,
    evaluate_dense,
    evaluate_lstm,
    exponents,
    measure_excess,
    monomials,
)
from exumob.surrogates.vehicle_shape import GEOMETRY, first_of, shape_differences, times_as_large
from exumob.vehicle.motion import BODIES, WRENCH_COMPONENTS
from exumob.vehicle.parameters import Vehicle
from exumob.water.wave_loads import WaveCoefficients

FORMAT, VERSION = "exumob networks", 3
RANGE_STATES = 256
"""States of the training runs that a file keeps of each body, to tell what is unlike them."""
SLIGHT_VELOCITY, SLIGHT_ANGLE = 0.05, 0.005
"""Differences that hardly change the water's loads, however small they were in training: of a velocity over the scale
of the largest one [-], of an angle or its sine [rad, -]; chosen by us."""
WEIGHTS = PACKAGE / "surrogates" / "weights"
"""Folder of the networks that come with exumob."""
FULL_RANGE = "full-range"
"""Name of the networks for 20 to 90 % depth and currents from all sides, an ensemble with its report card."""
PAPER = "paper-lstm"
"""Name of the paper's LSTMs (Secs. 3 and 5), one seed, in half precision."""
NAMED = (PAPER, FULL_RANGE)
"""Networks that come with exumob and are asked for by name."""
COME_WITH_IT = f"and {' and '.join(NAMED)} come with exumob"
TRAINED_DENSITY = 1000.0
"""Density of the water to which the wrenches in training are brought [kg/m^3]; they are proportional to it."""
EDGE = 0.05
"""Distance outside its training range, over the range's width, at which an input is held [-]."""


@dataclass(frozen=True)
class Architecture(Declared):
    """Inputs and layers of the five networks."""

    inputs: tuple[str, ...] = PAPER_INPUTS
    """Names of the input features, from `exumob.surrogates.inputs.INPUTS`"""
    taps: Annotated[int, Quantity("1", at_least=1, at_most=1000)] = 3
    """Instants in the input window: now and those before"""
    stride: Annotated[int, Quantity("ms", at_least=1, at_most=1000)] = 1
    """Interval between them"""
    layer: Literal["lstm", "dense", "polynomial"] = "lstm"
    """First layer; ``"polynomial"`` is a regression without any"""
    width: Annotated[int, Quantity("1", at_least=1, at_most=4096)] = 400
    """Units of the first layer"""
    dense: Annotated[int, Quantity("1", at_least=1, at_most=4096)] = 100
    """Units of the dense layer that follows"""
    degree: Annotated[int, Quantity("1", at_least=1, at_most=6)] = 3
    """Degree of the polynomial"""
    base: Literal["none", "coefficients"] = "none"
    """Model to whose wrenches those of the network are added; with it the waves of `NetworkSet.waves`"""
    filters: tuple[Annotated[float, Quantity("s", at_least=1e-3, at_most=1e3)], ...] = ()
    """Time constants of the filtered inputs (`exumob.surrogates.memory`) that a dense layer sees before the instants"""

    def _check(self) -> None:
        unknown = [name for name in self.inputs if name not in INPUTS]
        if unknown or not self.inputs:
            raise ValueError(f"Architecture.inputs: {unknown or 'nothing'} is not known; use {', '.join(INPUTS)}.")
        if len(set(self.inputs)) < len(self.inputs):
            raise ValueError(f"Architecture.inputs = {', '.join(self.inputs)}: one stands twice; leave it out once.")
        terms = math.comb(len(self.inputs) + self.degree, self.degree)
        if self.layer == "polynomial" and terms > 20_000:
            raise ValueError(f"Architecture.degree = {self.degree} makes {terms} terms; give a lower one.")
        if self.layer == "polynomial" and self.taps != 1:
            raise ValueError(f"Architecture.taps = {self.taps}: a polynomial is quasi-steady; use 1.")
        if self.layer != "dense" and self.filters:
            raise ValueError(
                f"Architecture.filters = {self.filters}: filtered inputs have no place in a layer {self.layer!r}; use "
                "'dense', or leave them out."
            )

    @property
    def memory(self) -> float:
        """Length of the input window, or the longest time constant of its filters if that is longer [s]."""
        return max(SAMPLING * self.stride * (self.taps - 1), *self.filters, 0.0)

    @property
    def window(self) -> int:
        """Rows of the input window: filtered inputs, then the instants, the present one last."""
        return len(self.filters) + self.taps

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shape of each array of weights of one body, by name."""
        k, h, d, n = len(self.inputs), self.width, self.dense, len(WRENCH_COMPONENTS)
        if self.layer == "polynomial":
            return {"coefficients": (len(exponents(k, self.degree)), n)}
        first: dict[str, tuple[int, ...]] = {"W": (h, k * self.window), "b": (h,)}
        if self.layer == "lstm":
            first = {"W": (4 * h, k), "U": (4 * h, h), "b": (4 * h,)}
        return first | {"dense_weight": (d, h), "dense_bias": (d,), "out_weight": (n, d), "out_bias": (n,)}


@dataclass(frozen=True)
class NetworkSet:
    """Five trained networks, their scalers and the range in which they were trained."""

    architecture: Architecture
    arrays: dict[str, Single]
    """Arrays by name, body first: weights (`Architecture.shapes`), scalers and learning curves.

    ``input_low``, ``input_high``, shape (5, k): range of each input in training; ``range_states`` (5, n, k): inputs of
    `RANGE_STATES` instants in training, far from each other, less their mean and over `range_scale`; ``range_reach``
    (5,): distance from them within which runs in training lie from each other (`exumob.learning.coverage`)."""
    about: dict[str, Any]
    """Origin of the networks: preset, seed, runs, held_back, geometry, data_hash, provenance; ``waves``, the terms of
    `NetworkSet.waves`, of those that are added to coefficients"""

    @property
    def name(self) -> str:
        """Preset and seed."""
        return f"{self.about.get('preset', 'unnamed')}, seed {self.about.get('seed', '?')}"

    @cached_property
    def waves(self) -> WaveCoefficients | None:
        """The coefficients of waves in the loads to which those of the networks are added; None: added to none.

        They are all 0 of networks that were trained beside published coefficients alone.
        """
        if self.architecture.base == "none":
            return None
        if "waves" not in self.about:
            return WaveCoefficients(np.zeros(WaveCoefficients.SHAPE), {})
        return WaveCoefficients.of_terms(self.about["waves"], {})

    @property
    def size(self) -> int:
        """Size of the weights [bytes]."""
        return sum(self.arrays[name].nbytes for name in self.architecture.shapes())

    def check_vehicle(self, vehicle: Vehicle) -> None:
        """Raise ValueError if the vehicle differs in shape (`GEOMETRY`) from the one of the training runs.

        One of the same form in another size is taken (`exumob.surrogates.vehicle_shape.times_as_large`).
        """
        if times_as_large(vehicle, self.about["geometry"]) is not None:
            return
        differences = shape_differences(vehicle, self.about["geometry"])
        if differences:
            raise ValueError(
                f"networks ({self.name}) were trained for another shape than that of {vehicle.name}: "
                f"{first_of(differences)}. Leave them out, then calibrated coefficients act, or make networks for it "
                "(`exumob learn`)."
            )

    def save(self, file: str | Path, half: bool = False) -> Path:
        """Write the file (.safetensors), whole or not at all; return its path.

        Parameters
        ----------
        file : path
        half : bool
            Keep the matrices of weights in half precision (11 bits): half as large, and read as single precision.
        """
        header = {
            "format": FORMAT, "version": VERSION, "architecture": asdict(self.architecture), "about": self.about,
            "input_units": [INPUTS[name].unit for name in self.architecture.inputs], "bodies": BODIES,
            "outputs": WRENCH_COMPONENTS, "output_units": ["N"] * 3 + ["N m"] * 3,
        }  # fmt: skip
        path = Path(file)
        matrices = [name for name in self.architecture.shapes() if half and self.arrays[name].ndim == 3]
        tensors = {
            name: np.array(a, np.float16 if name in matrices else a.dtype, order="C") for name, a in self.arrays.items()
        }
        write_arrays(path, header, tensors)
        return path

    @classmethod
    def load(cls, file: str | Path) -> NetworkSet:
        """Read a file written by `save`, or the paper's networks, which come with exumob by name (`PAPER`).

        Raises
        ------
        ValueError
            If it is not such a file, of another version, incomplete, or damaged; the message names the file.
        """
        path = network_file(file)
        header, arrays = read_arrays(path, "a file of networks", f"`exumob train` makes them, {COME_WITH_IT}.")
        if isinstance(several := header.get("members"), list):
            raise ValueError(
                f"{path} holds {len(several)} sets of networks (`exumob learn`), and a file of one is wanted; give one "
                "out of the folder networks that the command made beside it, or one of `exumob train`."
            )
        if header.get("format") != FORMAT:
            raise ValueError(f"{path} holds arrays, but not exumob's networks; `exumob train` makes them.")
        check_version(header, path)
        architecture = _architecture(header.get("architecture"), path)
        arrays = _checked_arrays(architecture, arrays, path)
        return cls(architecture, arrays, _checked_about(header.get("about"), architecture, path))

    @classmethod
    def stacked(cls, sets: Sequence[NetworkSet]) -> NetworkSet:
        """Return sets of one architecture as one that holds the bodies of all, one set after the other."""
        first = sets[0]
        assert all(s.architecture == first.architecture for s in sets)
        names = [name for name in first.arrays if not name.endswith("_loss")]
        return cls(first.architecture, {n: np.concatenate([s.arrays[n] for s in sets]) for n in names}, first.about)

    def digest(self) -> str:
        """Return a short hash of all arrays, and of the coefficients to whose loads theirs are added."""
        found = hashlib.sha256()
        if "waves" in self.about and self.waves is not None:
            found.update(self.waves.values.tobytes())
        for name in sorted(self.arrays):
            found.update(name.encode() + self.arrays[name].tobytes())
        return found.hexdigest()[:16]

    def scaled(self, inputs: Array) -> Single:
        """Return inputs less their mean, over their scale; shape (..., 5, window, k).

        Inputs outside their training range are first held a little outside it (`EDGE`): networks do not extrapolate.
        """
        mean, scale, lowest, highest = (values[:, None, :] for values in self._scaling)
        return np.asarray((np.clip(inputs, lowest, highest) - mean) / scale, np.float32)

    @cached_property
    def _scaling(self) -> InputScaling:
        """Scalers of the inputs and the limits at which they are held."""
        mean, scale, low, high = (
            self.arrays[name] for name in ("input_mean", "input_scale", "input_low", "input_high")
        )
        edge = EDGE * (high - low)
        return InputScaling(mean, scale, low - edge, high + edge)

    def wrenches(self, inputs: Array) -> Array:
        """Return the wrenches of the networks for one instant.

        Parameters
        ----------
        inputs : array, shape (5, window, k)
            Input windows, unscaled: filtered inputs if there are any, then the instants, oldest first.

        Returns
        -------
        array, shape (5, 6); (5 sets, 6) if several are `stacked`
            Force [N] and moment [N m], body axes; without those of the base model. All nan if an input is not finite.
        """
        networks = len(self._scaling.mean)
        if not np.isfinite(inputs).all():  # the kernels' arithmetic would lose it
            return np.full((networks, len(WRENCH_COMPONENTS)), np.nan)
        if self.architecture.layer == "polynomial":
            return self.batch_wrenches(np.tile(inputs, (networks // len(inputs), 1, 1))[None])[0]
        weights, bias, layers = self._transposed, self.arrays["b"], self._output_layers
        wrenches = np.empty((networks, len(WRENCH_COMPONENTS)))
        if self.architecture.layer == "lstm":
            evaluate_lstm(inputs, self._scaling, weights["W"], weights["U"], bias, layers, wrenches)
        else:
            evaluate_dense(inputs, self._scaling, weights["W"], bias, layers, wrenches)
        return wrenches

    @cached_property
    def _transposed(self) -> dict[str, Single]:
        """Matrices of weights with the inputs first: the order in which the kernels read them."""
        names = [name for name in self.architecture.shapes() if self.arrays[name].ndim == 3]
        return {name: np.ascontiguousarray(self.arrays[name].mT) for name in names}

    @cached_property
    def _output_layers(self) -> OutputLayers:
        """The dense layer and the linear one, as the kernels read them."""
        weights, arrays = self._transposed, self.arrays
        return OutputLayers(
            weights["dense_weight"], arrays["dense_bias"], weights["out_weight"], arrays["out_bias"],
            arrays["output_mean"], arrays["output_scale"],
        )  # fmt: skip

    def batch_wrenches(self, inputs: Array, batch: int = 2048) -> Array:
        """Return `wrenches` for n instants at once, by matrix products; shape (n, 5, window, k) -> (n, 5, 6)."""
        layer, degree = self.architecture.layer, self.architecture.degree
        out = []
        for i in range(0, len(inputs), batch):
            scaled = self.scaled(inputs[i : i + batch])
            if layer == "polynomial":
                terms = monomials(scaled[:, :, 0], degree)
                out.append(np.asarray(np.einsum("nbt,btm->nbm", terms, self.arrays["coefficients"]), np.float32))
            else:
                out.append(evaluate_batch(scaled, self.arrays, recurrent=layer == "lstm"))
        return np.asarray(np.concatenate(out) * self.arrays["output_scale"] + self.arrays["output_mean"], float)

    def excess(self, inputs: Array) -> Array:
        """Measure how far inputs lie outside the training range.

        Parameters
        ----------
        inputs : array, shape (5, k)
            Inputs of one instant.

        Returns
        -------
        array, shape (5, 2); (5 sets, 2) if several are `stacked`
            The worst single input: its distance from its range, over the range's width. All inputs jointly: their
            distance to the nearest of the ``range_states``, over ``range_reach``, less 1. Both are at most 0 inside the
            range. Ranges are wider by slight differences, and those count less (`range_scale`).
        """
        excess = np.empty((len(self._range.low), 2))
        measure_excess(inputs, self._range, self._scaling, excess)
        return excess

    @cached_property
    def _range(self) -> TrainingRange:
        """Range of the inputs in training, as the kernel reads it."""
        low, high, scale, states, reach = (
            self.arrays[name] for name in ("input_low", "input_high", "input_scale", "range_states", "range_reach")
        )
        compared, wider = range_scale(self.architecture.inputs, scale, high > low)
        low, high = low - wider, high + wider
        states = np.ascontiguousarray(states.mT)  # one input of all states after the other, as the kernel reads them
        return TrainingRange(low, high, np.maximum(high - low, 1e-3 * scale), compared, states, reach)


def range_scale(inputs: Sequence[str], scale: Single, varied: NDArray[np.bool_]) -> tuple[Single, Single]:
    """Return the scales by which states are compared: not less than slight differences.

    A wheel in a lane change goes up and down by 1 mm/s, and by 7 mm/s it would be far out of that range; beside a flow
    of 1 m/s neither is felt.

    Parameters
    ----------
    inputs : sequence of str
        The names of k inputs.
    scale : array, shape (..., k)
        Their scales in training: deviations, or 1 of those that were always the same.
    varied : array of bool, shape (..., k)
        Whether they were not.

    Returns
    -------
    array, shape (..., k)
        The scales for the comparison.
    array, shape (..., k)
        By how much the range of each input is wider than in training, on either side; 0 but of velocities and angles.
    """
    units = np.array([INPUTS[name].unit for name in inputs])
    deviation = np.where(varied, scale, np.float32(0.0))
    moving, turned = units == "m/s", (units == "rad") | (units == "1")
    least = np.zeros_like(deviation)
    if moving.any():
        least[..., moving] = SLIGHT_VELOCITY * deviation[..., moving].max(axis=-1, keepdims=True)
    least[..., turned] = SLIGHT_ANGLE
    wider = np.maximum(least - deviation, np.float32(0.0))
    return np.where(wider > 0.0, least, scale), wider


def check_version(header: Mapping[str, Any], path: Path) -> None:
    """Raise ValueError unless the header of a file of networks is of this program's version."""
    if header.get("version") != VERSION:
        raise ValueError(
            f"{path} is of version {header.get('version')} and this program reads {VERSION}; train again with `exumob "
            "train`, or with the `exumob learn` that made it, which goes on with its runs."
        )


def network_file(file: str | Path) -> Path:
    """Return the path of a file of networks, or of those that come with exumob under a name of `NAMED`."""
    return WEIGHTS / "named" / f"{file}.safetensors" if str(file) in NAMED else Path(file)


def write_arrays(path: Path, header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays and a JSON header as a safetensors file, with a digest of both, whole or not at all."""
    from safetensors.numpy import save

    digest = _file_digest(json.loads(json.dumps(header)), arrays)
    data = save(dict(arrays), {"exumob": json.dumps(header | {"digest": digest})})
    with atomic_write(path) as temporary:
        temporary.write_bytes(data)


def read_arrays(path: Path, what: str, remedy: str) -> tuple[dict[str, Any], dict[str, Single]]:
    """Read a file of `write_arrays` into memory, or another safetensors file.

    Parameters
    ----------
    path : Path
    what, remedy : str
        What the file is to be, and where such files come from, for messages.

    Returns
    -------
    header : dict
        The JSON header; empty if there is none.
    arrays : dict

    Raises
    ------
    ValueError
        If the file is not of that format, or damaged.
    """
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise ValueError(f"file of networks {path} {why_no_file(path)}; {remedy}")
    try:
        with safe_open(path, "np") as stream:
            header = json.loads((stream.metadata() or {}).get("exumob", "{}"))
            arrays = {name: stream.get_tensor(name) for name in stream.keys()}
    except (SafetensorError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        why = " ".join(str(error).split())[:200]
        raise ValueError(f"{path} is not {what}, or is damaged ({why}); {remedy}") from None
    except OSError as error:
        raise ValueError(f"{path} cannot be read ({error.strerror or error}); {remedy}") from None
    if not isinstance(header, dict):
        raise ValueError(f"{path} is not {what}: its header is a {type(header).__name__}; {remedy}")
    digest = header.pop("digest", None)  # files made before have none
    if digest is not None and digest != _file_digest(header, arrays):
        raise ValueError(
            f"{path} is damaged: it is not what was written (its digest differs). Use a whole copy; {remedy}"
        )
    return header, arrays


def _file_digest(header: dict[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """Digest of all that a file of networks holds."""
    found = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name in sorted(arrays):
        found.update(f"{name} {arrays[name].dtype.str} {arrays[name].shape}".encode())
        found.update(np.ascontiguousarray(arrays[name]).tobytes())
    return found.hexdigest()


def _architecture(given: Any, path: Path) -> Architecture:
    """Architecture of a file, its kinds and bounds checked."""
    known = {field.name for field in fields(Architecture)}
    if not isinstance(given, dict) or set(given) != known:
        wrong = sorted(set(given) ^ known) if isinstance(given, dict) else shown(given)
        raise ValueError(f"{path}: its architecture has {wrong} too many or too few; train again with `exumob train`.")
    try:
        return Architecture(**(given | {name: tuple(given[name]) for name in ("inputs", "filters")}))
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error} Train again with `exumob train`.") from None


def _checked_about(about: Any, architecture: Architecture, path: Path) -> dict[str, Any]:
    """Return the origin of networks, or refuse a file that does not say for which vehicle and on what base they are."""
    trained = about.get("geometry") if isinstance(about, dict) else None
    if not isinstance(about, dict) or not isinstance(trained, dict):
        raise ValueError(
            f"{path} does not say for which vehicle its networks were trained (about.geometry is {shown(trained)}); it "
            "is incomplete, train again with `exumob train`."
        )
    unknown, missing = sorted(set(trained) - set(GEOMETRY)), sorted(set(GEOMETRY) - set(trained))
    wrong = [name for name, value in trained.items() if not isinstance(value, int | float | str | None)]
    if unknown or wrong or missing:
        raise ValueError(
            f"{path}: about.geometry has wrong, unknown or missing parameters: {', '.join(unknown + wrong + missing)}; "
            "it is of another version, train again with `exumob train`."
        )
    if architecture.base == "coefficients" and "waves" in about:  # beside published coefficients there are none
        try:
            WaveCoefficients.of_terms(about["waves"], {})
        except ValueError as error:
            raise ValueError(
                f"{path}: about.waves, coefficients of the loads to which its networks add, are not those of this "
                f"program ({error}); train again with `exumob train`."
            ) from None
    return about


def _checked_arrays(architecture: Architecture, arrays: dict[str, Single], path: Path) -> dict[str, Single]:
    """Return arrays in single precision; refuse those that are missing, not finite or of another shape or kind."""
    weights = architecture.shapes()
    arrays = {
        name: a.astype(np.float32) if name in weights and a.dtype == np.float16 else a for name, a in arrays.items()
    }
    k, n = len(architecture.inputs), len(WRENCH_COMPONENTS)
    shapes: dict[str, tuple[int, ...]] = dict(architecture.shapes())
    shapes |= {name: (k,) for name in ("input_mean", "input_scale", "input_low", "input_high")}
    shapes |= {"range_states": (RANGE_STATES, k), "range_reach": (), "output_mean": (n,), "output_scale": (n,)}
    for name, shape in shapes.items():
        if name not in arrays:
            raise ValueError(f"{path}: {name} is missing; the file is incomplete, train again with `exumob train`.")
        array = arrays[name]
        if array.shape != (5, *shape) or array.dtype != np.float32:
            raise ValueError(
                f"{path}: {name} is of shape {array.shape} of {array.dtype}; it must be {(5, *shape)} of float32. "
                "Train again with `exumob train`."
            )
        if not np.isfinite(array).all():
            count = int((~np.isfinite(array)).sum())
            raise ValueError(
                f"{path}: {name} is of shape {array.shape}, and not finite at {count} of {array.size} places; train "
                "again with `exumob train`."
            )
    for name in ("input_scale", "output_scale", "range_reach"):
        if not (arrays[name] > 0.0).all():
            raise ValueError(f"{path}: {name} must be > 0 everywhere; train again with `exumob train`.")
    if (arrays["input_low"] > arrays["input_high"]).any():
        raise ValueError(f"{path}: input_low lies above input_high; train again with `exumob train`.")
    return arrays
