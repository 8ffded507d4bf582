"""The type of the arrays of this package, and the check of those that users give."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of double-precision numbers; its shape and units stand where it is declared."""


def checked_array(name: str, value: Any, shape: tuple[int | str, ...], *, finite: bool = True) -> Array:
    """Return an array that a user gave as numbers of double precision, or refuse it.

    numpy by itself drops the mask of a masked array and the unit of a quantity, reads True as 1 and turns
    objects into whatever they answer to ``float``. Here each of these is an error.

    Parameters
    ----------
    name : str
        What the array is called in errors, with its owner, as in ``"Terrain.heights"``.
    value : array_like
        What was given.
    shape : tuple of int or str
        Lengths wanted. A text stands for any length, and names it in errors; the same text twice: the same length.
    finite : bool
        Whether nan and infinite values are refused.

    Returns
    -------
    array
        A read-only copy in C order.

    Raises
    ------
    ValueError
        If values are masked, not finite, logical, complex, texts or other objects, if rows differ in length, or if the
        shape is another one. The message says how many values are wrong, and where the first stands.
    """
    _refuse_hidden(name, value)
    wanted = _shape_text(shape)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what numpy only warns of is checked below
        try:
            found = np.asarray(value)
            if isinstance(value, list | tuple) and found.dtype.kind not in "fiu" and found.size == 0:
                found = found.astype(float)
        except Exception as error:  # a foreign object may raise anything when it is asked for its numbers
            raise ValueError(f"{name} is no array ({error}); give numbers in rows of equal length, {wanted}.") from None
        if found.dtype.kind not in "fiu":
            raise ValueError(
                f"{name} holds {_kind_text(found, value)}, not numbers; give real numbers in SI units, {wanted}."
            )
        with np.errstate(all="ignore"):
            numbers = np.array(found, dtype=np.float64, order="C", subok=False)
    lengths: dict[str, int] = {}
    fits = len(shape) == numbers.ndim and all(
        lengths.setdefault(want, n) == n if isinstance(want, str) else want == n
        for want, n in zip(shape, numbers.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} has shape {numbers.shape}; give {wanted}.")
    bad = ~np.isfinite(numbers)
    if finite and bad.any():
        first = found[tuple(np.argwhere(bad)[0])]
        raise ValueError(f"{name}{_which(bad, 'not finite', first)}; fill the gaps, or leave such values out.")
    numbers.setflags(write=False)
    return numbers


def _refuse_hidden(name: str, value: Any, depth: int = 5) -> None:
    """Refuse what numpy would drop or convert without a word: masks, units, and logical values among numbers."""
    if isinstance(value, np.ma.MaskedArray):
        mask = np.ma.getmaskarray(value)
        if mask.any():
            raise ValueError(
                f"{name}{_which(mask, 'masked')}; fill the gaps (numpy.ma.filled with values that stand for them), or "
                "cut them off."
            )
    elif isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} is {value}, a logical value; give real numbers in SI units.")
    elif isinstance(value, list | tuple) and depth > 0:
        for k, part in enumerate(value):
            if type(part) is not float and type(part) is not int:  # most are
                _refuse_hidden(f"{name}[{k}]", part, depth - 1)
    elif _answers_to(value, "magnitude") or (isinstance(value, np.ndarray) and _answers_to(value, "unit")):
        unit = getattr(value, "units", None) or getattr(value, "unit", None)
        raise ValueError(f"{name} has a unit of its own ({unit}); give plain numbers in SI units.")


def _answers_to(value: Any, name: str) -> bool:
    try:
        return hasattr(value, name)
    except Exception:  # a foreign __getattr__ may do anything
        return False


def _which(marks: NDArray[np.bool_], fault: str, first: object = None) -> str:
    """Say how many values have a fault, and where the first stands."""
    value = "" if first is None else f" ({first})"
    if marks.ndim == 0:
        return f" is {fault}{value}"
    n, place = int(marks.sum()), [int(i) for i in np.argwhere(marks)[0]]
    return f": {n} of {marks.size} values {'is' if n == 1 else 'are'} {fault}, the first at {place}{value}"


def _shape_text(shape: tuple[int | str, ...]) -> str:
    if not shape:
        return "a single number"
    return f"an array of shape ({', '.join(str(n) for n in shape)}{',' if len(shape) == 1 else ''})"


def _kind_text(found: np.ndarray, value: Any) -> str:
    kinds = {"b": "logical values", "c": "complex values", "U": "texts", "S": "bytes", "M": "dates", "m": "time spans"}
    if found.dtype.kind in kinds:
        return kinds[found.dtype.kind]
    if found.dtype.kind == "V":
        return "records"
    parts = found.flat if found.ndim else [value]
    first = next((v for v in parts if type(v) not in (int, float)), 0)
    return "whole numbers beyond double precision" if type(first) is int else f"{type(first).__name__} objects"
