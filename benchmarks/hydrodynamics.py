"""Cost of the coefficient model by part (microseconds a call): `python benchmarks/hydrodynamics.py`."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from exumob.ground.terrain import Terrain
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.vehicle_file import load_vehicle
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.flow_states import flow_states
from exumob.water.hydrostatics import WET_INTEGRALS, clipping_space, wet_integrals
from exumob.water.wetted_surface import body_surfaces


def standing(vehicle: Vehicle, n: int) -> BodyStates:
    """Vehicle sunk 5 mm, moving a little, n samples 1 ms apart."""
    origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers]) - [0.0, 0.0, 0.005]
    small = np.full((n, 5, 3), 0.1)
    return BodyStates(
        1e-3 * np.arange(n), np.tile(origins, (n, 1, 1)), np.tile(np.eye(3), (n, 5, 1, 1)), *[small] * 4,
        np.zeros((n, 4)),
    )  # fmt: skip


def microseconds(call: Callable[[], object], repeats: int = 5000) -> float:
    """Best mean of five rounds."""
    call()
    rounds = []
    for _ in range(5):
        start = time.perf_counter()
        for _ in range(repeats // 5):
            call()
        rounds.append((time.perf_counter() - start) / (repeats // 5))
    return 1e6 * min(rounds)


def main() -> dict[str, float]:
    """Print and return microseconds a call by part."""
    vehicle = load_vehicle(Path(__file__).parents[1] / "vehicle_models" / "amphibious.py")
    water = Water.at_ratio(0.6, current_speed=1.0)
    history = standing(vehicle, 20)
    turn, scratch, totals, bed = np.eye(3), clipping_space(), np.zeros(1, WET_INTEGRALS), Terrain().as_arrays()

    costs = {}
    surfaces, places = body_surfaces(vehicle), history.position[-1].copy()
    areas = [np.zeros((surface.n_cells, 3, 4)) for surface in surfaces]

    def integrate(body: int) -> None:
        surface = surfaces[body]
        pose = turn, places[body], water.uniform_depth
        wet_integrals(
            surface.triangles, surface.cells, *pose, *bed, totals, areas[body], scratch
        )  # fmt: skip

    costs["wet integrals, hull"] = microseconds(lambda: integrate(0))
    costs["wet integrals, one wheel"] = microseconds(lambda: integrate(1))
    for label, options in {"all": {}, "without added mass": {"added_mass": False}}.items():
        model = CoefficientHydrodynamics(**options)
        model.start(vehicle, water, 1e-3)
        costs[f"wrenches, {label}"] = microseconds(lambda model=model: model.wrenches(history, lambda: history))
    costs["flow_states, 3 instants"] = microseconds(lambda: flow_states(history[-3:], water))
    for part, cost in costs.items():
        print(f"{part:28s} {cost:7.1f} us")
    return costs


if __name__ == "__main__":
    main()
