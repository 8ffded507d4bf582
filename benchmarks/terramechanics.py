"""What does one wheel cost, and how exact is it? Time per call of the kernel in a compiled loop against adaptive
quadrature.

Run: python benchmarks/terramechanics.py
The kernel is timed as the vehicle uses it (from compiled code), at the default number of nodes and at others; "error"
is the worst over random states of all published soils, relative to the resultant force (see
tests/physics/test_terramechanics_quadrature.py).
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numba import njit

from exumob.ground import contact_patch
from exumob.ground.contact_patch import PATCH_FORCES, WheelMotion, WheelSize
from exumob.ground.soil import Soil

VERIFICATION = Path(__file__).parents[1] / "tests" / "physics" / "test_terramechanics_quadrature.py"
STATES = {
    "driving": (0.010, 0.80, 0.10, 10.0),
    "braking, shear reverses": (0.020, 1.15, 0.10, 10.0),
    "locked": (0.010, 0.50, 0.10, 0.0),
    "at rest": (0.010, 1e-4, 1e-4, 1e-3),
}  # sinkage [m], v_x, v_y [m/s], spin [rad/s]


def load(path: Path, name: str) -> ModuleType:
    """Import a file as a module."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def with_nodes(count: int, folder: Path) -> ModuleType:
    """The kernel's module with another number of nodes (they are constants of the compiled code)."""
    text = Path(contact_patch.__file__).read_text().replace(f"NODES = {contact_patch.NODES}", f"NODES = {count}")
    path = folder / f"contact_patch_{count}.py"
    path.write_text(text.replace("cache=True, ", ""))
    return load(path, path.stem)


def microseconds(module: ModuleType, soil: np.ndarray, state: tuple[float, ...], calls: int = 20_000) -> float:
    """Best of five loops."""
    kernel = module.wheel_soil_kernel

    @njit
    def loop(soil, sinkage, v_x, v_y, omega, calls, out):  # type: ignore[no-untyped-def]
        total = 0.0
        for i in range(calls):
            motion = WheelMotion(v_x, v_y, 0.0, omega, 0.0, 0.0)
            kernel(soil[0], WheelSize(0.1, 0.08), sinkage + 1e-9 * i, motion, 0.01, out[0])
            total += out[0].force[0]
        return total

    out, best = np.zeros(1, PATCH_FORCES), np.inf
    loop(soil, *state, 10, out)
    for _ in range(5):
        start = time.perf_counter()
        loop(soil, *state, calls, out)
        best = min(best, time.perf_counter() - start)
    return 1e6 * best / calls


def main() -> None:
    """Print the two tables."""
    verification = load(VERIFICATION, "verification")
    soil = Soil.published("LETE sand")
    rng = np.random.default_rng(0)
    cases = [
        (replace(row.soil, rebound_ratio=0.1), *verification.random_state(rng, regime))
        for row in Soil.published_table()
        for regime in verification.REGIMES
    ]
    start = time.perf_counter()
    references = [verification.reference(*case) for case in cases]
    quadrature = 1e6 * (time.perf_counter() - start) / len(cases)

    default = microseconds(contact_patch, soil.as_record(), STATES["driving"])
    print(f"{'nodes':>8} {'us a wheel':>11} {'time':>8} {'worst error':>12}   (driving; {len(cases)} states)")
    with tempfile.TemporaryDirectory() as folder:
        for count in (8, 12, contact_patch.NODES, 24, 32):
            module = with_nodes(count, Path(folder)) if count != contact_patch.NODES else contact_patch
            worst = 0.0
            for (case_soil, r, b, z, v, spin), exact in zip(cases, references, strict=True):
                out = np.zeros(1, PATCH_FORCES)
                motion = WheelMotion(*map(float, (*v, *spin)))
                record = case_soil.as_record()
                module.wheel_soil_kernel(record[0], WheelSize(r, b), z, motion, verification.RATE, out[0])
                scale = np.linalg.norm(exact[:3]) * np.array([1.0, 1.0, 1.0, r, r, r])
                worst = max(
                    worst, float((np.abs(np.concatenate([out["force"][0], out["moment"][0]]) - exact) / scale).max())
                )
            cost = microseconds(module, soil.as_record(), STATES["driving"])
            mark = "  <- default" if count == contact_patch.NODES else ""
            print(f"{count:8d} {cost:11.3f} {cost / default:7.2f}x {worst:12.1e}{mark}")
    print(f"{'adaptive':>8} {quadrature:11.0f} {quadrature / default:7.0f}x {'reference':>12}\n")

    print(f"{'regime':>25} {'per axis':>10} {'resultant':>10}   us a wheel, {contact_patch.NODES} nodes")
    resultant = replace(soil, shear_limit="resultant").as_record()
    for name, state in STATES.items():
        pair = [microseconds(contact_patch, packed, state) for packed in (soil.as_record(), resultant)]
        print(f"{name:>25} {pair[0]:10.3f} {pair[1]:10.3f}")


if __name__ == "__main__":
    main()
