"""How fast is a run, and where does the time go? Ratios side by side in one process, one core.

Run: python benchmarks/simulation.py
The lane change of the paper with the coefficient model (D60/U1) at its two settings (0.1/1 ms and 1/20 ms), best of
several; then the cost of each piece of a step, and of the same system without water.
"""

from __future__ import annotations

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"

import time
from collections.abc import Callable

import numpy as np

from exumob import CoefficientHydrodynamics, NoWater, Soil, Terrain, Water, lane_change, simulate
from exumob.multibody.applied_loads import vehicle_loads
from exumob.multibody.soil_contact import soil_damping
from exumob.multibody.system import MultibodyVehicle
from vehicle_models.amphibious import amphibious_vehicle

VEHICLE, SOIL, WATER = amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0)
SETTINGS = {"1 ms / 20 ms": (1e-3, 20e-3, 8.0, 5), "0.1 ms / 1 ms": (1e-4, 1e-3, 8.0, 3)}


def best(run: Callable[[], object], repeats: int) -> float:
    """Smallest wall time of several runs [s]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def microseconds(call: Callable[[], object], number: int) -> float:
    """Mean time of a call, best of three batches [us]."""
    return 1e6 / number * best(lambda: [call() for _ in range(number)], 3)


def whole_runs() -> None:
    """Real-time factors."""
    simulate(VEHICLE, SOIL, WATER, lane_change(), duration=0.1)  # compile
    print(f"{'setting':<16} {'water':<14} {'wall [s]':>9} {'settling [s]':>13} {'real-time factor':>17}")
    for name, (micro, macro, duration, repeats) in SETTINGS.items():
        for water, model in ((None, NoWater), (WATER, CoefficientHydrodynamics)):
            walls = [
                simulate(
                    VEHICLE, SOIL, water, lane_change(), model(), duration=duration, micro_step=micro, macro_step=macro
                ).attrs
                for _ in range(repeats)
            ]
            wall = min(w["wall_time"] for w in walls)
            settling = min(w["settling_wall_time"] for w in walls)
            print(f"{name:<16} {model.__name__[:14]:<14} {wall:9.2f} {settling:13.2f} {duration / wall:17.2f}")


def pieces() -> None:
    """Cost of the pieces of a step."""
    for name, (micro, macro, _, _) in SETTINGS.items():
        model = MultibodyVehicle(VEHICLE, SOIL, lane_change(), Terrain(), micro, 8.0)
        model.settle(lambda states: np.zeros((5, 6)))
        dry = np.zeros((5, 6))
        for n in range(round(2.5 / macro)):
            model.advance((n + 1) * macro, dry)
        counts = model._solver.it.newtonStepsCount, model._solver.it.newtonJacobiCount
        start, steps = time.perf_counter(), round(0.5 / micro)
        first = round(2.5 / macro)
        for n in range(first, first + round(0.5 / macro)):
            model.advance((n + 1) * macro, dry)
        step = 1e6 * (time.perf_counter() - start) / steps
        newton = (model._solver.it.newtonStepsCount - counts[0]) / steps
        jacobians = (model._solver.it.newtonJacobiCount - counts[1]) / steps
        state = model._q, model._v, model._reference
        water = CoefficientHydrodynamics()
        water.start(VEHICLE, WATER, macro)
        gather = microseconds(
            lambda m=model, s=state: vehicle_loads(
                m.parameters, m._heights, m._hull_points, *s, m.loads, m._generalized
            ), 2000,
        )  # fmt: skip
        hook = microseconds(lambda m=model: m._before_residual(None, 3.0, 1, 0), 2000)
        command = microseconds(lambda m=model: m._prescribe(3.0), 2000)
        account = microseconds(lambda m=model: m._account(3.0), 2000)
        damping = microseconds(
            lambda m=model, s=state: soil_damping(m.parameters, m._heights, *s, 1.0, m._damping_entries), 500
        )
        wrenches = microseconds(lambda m=model, w=water: w.wrenches(m.history, m.present), 200)
        predict = microseconds(lambda m=model: m.predict(macro), 20)  # noqa: B023
        reactions = microseconds(model.constraint_wrenches, 50)
        newton_work = step - newton * hook - command - account
        print(f"\n{name}: {step:.0f} us a micro step, {newton:.2f} Newton iterations, {jacobians:.3f} Jacobians")
        rows = (
            ("Exudyn: residuals, factorisation, load calls", newton_work),
            ("soil, suspension, water: Numba gather", newton * gather),
            ("... its Python hook", newton * (hook - gather)),
            ("maneuver", command),
            ("energy account", account),
        )
        for text, cost in rows:
            print(f"  {text:<46} {cost:7.1f} us a step {100 * cost / step:5.1f} %")
        print(f"  {'water, coefficients':<46} {wrenches:7.1f} us a macro step")
        print(f"  {'soil Jacobian (velocities)':<46} {damping:7.1f} us a Jacobian")
        print(f"  {'extrapolate and project (when asked for)':<46} {predict:7.1f} us a macro step")
        print(f"  {'reactions':<46} {reactions:7.1f} us a record (10 ms)")


if __name__ == "__main__":
    whole_runs()
    pieces()
