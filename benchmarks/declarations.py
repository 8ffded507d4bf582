"""What checks by declaration cost: construction of a soil and a vehicle, and the time to import.

`python benchmarks/declarations.py`; where pydantic and attrs are installed, the same ten fields with their checks, too.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, make_dataclass, replace
from typing import Annotated, Any

from exumob import Soil
from exumob.support.declared import Declared
from exumob.support.quantities import Quantity
from vehicle_models.amphibious import amphibious_vehicle

REPEATS = 20_000
NAMES = [f"value_{n}" for n in range(10)]
VALUES = [1.0 + n for n in range(10)]


def microseconds(call: Callable[[], Any]) -> float:
    """Least time of a call in five rounds [us]."""
    call()
    rounds = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(REPEATS // 5):
            call()
        rounds.append((time.perf_counter() - begin) / (REPEATS // 5))
    return 1e6 * min(rounds)


def milliseconds_to_import(module: str) -> float:
    """Least wall time of a new interpreter that imports a module, less that of one that imports none [ms]."""

    def run(code: str) -> float:
        rounds = []
        for _ in range(5):
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            rounds.append(time.perf_counter() - begin)
        return min(rounds)

    return 1e3 * (run(f"import {module}") - run("pass"))


def ten_fields() -> dict[str, Callable[[], Any]]:
    """Classes of ten checked numbers, by what checks them."""
    kind = Annotated[float, Quantity("m", at_least=0.0, at_most=1e12, plausible=(0.1, 1e6))]
    plain = make_dataclass("Plain", [(name, float) for name in NAMES], frozen=True)
    ours = dataclass(frozen=True)(type("Ours", (Declared,), {"__annotations__": dict.fromkeys(NAMES, kind)}))
    found = {"no checks": lambda: plain(*VALUES), "Declared": lambda: ours(*VALUES)}
    try:
        import attr

        checks = [attr.validators.instance_of((int, float)), attr.validators.ge(0.0), attr.validators.le(1e12)]
        with_attrs = attr.make_class("WithAttrs", {name: attr.ib(validator=checks) for name in NAMES}, frozen=True)
        found["attrs"] = lambda: with_attrs(*VALUES)
    except ImportError:
        pass
    try:
        from pydantic import Field
        from pydantic.dataclasses import dataclass as pydantic_dataclass

        bounded = Annotated[float, Field(ge=0.0, le=1e12, allow_inf_nan=False)]
        made = type("WithPydantic", (), {"__annotations__": dict.fromkeys(NAMES, bounded)})
        with_pydantic = pydantic_dataclass(frozen=True)(made)
        found["pydantic"] = lambda: with_pydantic(*VALUES)
    except ImportError:
        pass
    return found


def main() -> None:
    """Print the table."""
    print("ten numbers [us]")
    for name, make in ten_fields().items():
        print(f"  {name:<10} {microseconds(make):6.2f}")
    soil, vehicle = Soil.published("LETE sand"), amphibious_vehicle()
    print(f"a changed soil    {microseconds(lambda: replace(soil, n=0.8)):6.2f} us")
    print(f"a changed vehicle {microseconds(lambda: replace(vehicle, track=0.67)):6.2f} us")
    print(f"a whole vehicle   {microseconds(amphibious_vehicle):6.2f} us")
    for module in ("exumob.support.declared", "exumob", "attr", "pydantic.dataclasses"):
        try:
            print(f"import {module:<24} {milliseconds_to_import(module):6.0f} ms")
        except subprocess.CalledProcessError:
            print(f"import {module:<24} not installed")


if __name__ == "__main__":
    main()
