"""What a step of the vehicle and its settling cost: `python benchmarks/multibody_step.py` (two minutes).

The lane change in D60/U1 with the coefficient model on LETE sand, both vehicles, one process: CPU times, the smallest
of three. Settling and driving apart; then, for the driving, the time of a step, what of it is ours, the iterations of
Newton and the Jacobians. Ratios are to `past.toml`; they hold for the machine named there. Last the floor: a step of
1 ms of the vehicle at rest with frozen loads, one iteration and none of our functions.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"

import time
from typing import Any

import numpy as np
import past

from exumob import CoefficientHydrodynamics, ConstantSteer, Soil, Terrain, Vehicle, Water, simulate
from exumob.multibody.system import MultibodyVehicle
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

REPEATS = 3
DURATION = 8.0
STEPS = {"fast": (1e-3, 20e-3), "0.5/20 ms": (5e-4, 20e-3), "fine": (1e-4, 1e-3)}


class Clock:
    """CPU time in settling, in our calls from Exudyn, and in macro steps; and what Newton did meanwhile."""

    def __init__(self) -> None:
        """Hook into `MultibodyVehicle`."""
        self.times: dict[str, float] = {}
        self.model: MultibodyVehicle | None = None
        for method in ("settle", "advance", "_before_residual", "_after_step", "_load_jacobian"):
            setattr(MultibodyVehicle, method, self._timed(method, getattr(MultibodyVehicle, method)))

    def _timed(self, name: str, method: Any) -> Any:
        def timed(model: MultibodyVehicle, *arguments: Any, **options: Any) -> Any:
            self.model = model
            began = time.perf_counter()
            try:
                return method(model, *arguments, **options)
            finally:
                spent = time.perf_counter() - began
                phase = name if model._driving or name == "settle" else "while settling"
                self.times[phase] = self.times.get(phase, 0.0) + spent

        return timed


def run(vehicle: Vehicle, micro_step: float, macro_step: float, clock: Clock) -> dict[str, float]:
    """Return the times of one run [s] and the counts of its iterations."""
    clock.times.clear()
    water = Water.at_ratio(0.6, 1.0, tyre_diameter=vehicle.wheel.diameter)
    began = time.process_time()
    simulate(
        vehicle, Soil.published("LETE sand"), water, None, CoefficientHydrodynamics(), duration=DURATION,
        micro_step=micro_step, macro_step=macro_step,
    )  # fmt: skip
    whole = time.process_time() - began
    assert clock.model is not None
    solver, times = clock.model._solver.it, clock.times
    ours = sum(times[name] for name in ("_before_residual", "_after_step", "_load_jacobian"))
    steps = DURATION / micro_step
    return {
        "settling": times["settle"], "driving": whole - times["settle"], "step": 1e6 * times["advance"] / steps,
        "ours": 1e6 * ours / steps, "newton": solver.newtonStepsCount / steps,
        "jacobians": solver.newtonJacobiCount / steps,
    }  # fmt: skip


def floor() -> float:
    """Return what Exudyn takes for a step with one iteration and no function of ours [us], the least of five."""
    dry = np.zeros((5, 6))
    model = MultibodyVehicle(
        amphibious_vehicle(), Soil.published("LETE sand"), ConstantSteer(speed=0.0), Terrain(), 1e-3, 10.0
    )
    model.settle(lambda states: dry)
    model._settings.timeIntegration.newton.absoluteTolerance = 1e3  # met by the first iteration
    model._go_on_from(model.save(histories=False), model._settings)
    for choose in ("PreNewtonResidual", "PostStep", "SystemJacobian"):
        getattr(model.mbs, f"Set{choose}UserFunction")(0)
    times = []
    for _ in range(5):
        began, steps = time.perf_counter(), model._solver.it.newtonStepsCount
        model._solve(model._settings, model.time + 1.0)
        times.append(1e6 * (time.perf_counter() - began) / 1000)
        assert model._solver.it.newtonStepsCount - steps == 1000
    return min(times)


def main() -> None:
    """Print one row a vehicle and pair of steps."""
    clock = Clock()
    rows = past.past("multibody_step")
    print(
        "| vehicle, steps | settling [s] | ratio | driving [s] | ratio | a step [us] | ours [us] | Newton | Jacobians |"
    )
    print(9 * "|---" + "|")
    for vehicle in (amphibious_vehicle(), light_4x4()):
        for name, (micro_step, macro_step) in STEPS.items():
            found = [run(vehicle, micro_step, macro_step, clock) for _ in range(REPEATS)]
            best = {key: min(row[key] for row in found) for key in found[0]}
            then = rows.get(f"{vehicle.name}, {name}", {})
            figures = (
                f"{best['settling']:.2f}", past.ratio(best["settling"], then, "settling_s"),
                f"{best['driving']:.2f}", past.ratio(best["driving"], then, "driving_s"),
                f"{best['step']:.0f}", f"{best['ours']:.0f}", f"{best['newton']:.2f}", f"{best['jacobians']:.3f}",
            )  # fmt: skip
            print(f"| {vehicle.name}, {name} | " + " | ".join(figures) + " |", flush=True)
    print(f"\nfloor: {floor():.0f} us a step")


if __name__ == "__main__":
    main()
