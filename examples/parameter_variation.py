"""A run of exumob in Exudyn's own `ParameterVariation` and `GeneticOptimization`. (a minute on one core)

Run: python examples/parameter_variation.py     (exumob's own sweeps, which keep every case: `exumob.sweeps`)
"""

from dataclasses import replace

from exudyn.processing import GeneticOptimization, ParameterVariation

from exumob import CoefficientHydrodynamics, ConstantSteer, Soil, Water, simulate
from vehicle_models.amphibious import amphibious_vehicle


def parameter_function(parameter_set):
    """Forward speed after 1.5 s of straight driving [m/s]."""
    vehicle = amphibious_vehicle()
    vehicle = replace(vehicle, hull=replace(vehicle.hull, mass=parameter_set.get("mass", 49.0)))  # [kg]
    water = Water.at_ratio(0.6, current_speed=parameter_set.get("current", 0.5))  # [m/s], head on
    maneuver = ConstantSteer(speed=parameter_set.get("wheel_speed", 10.0))  # [rad/s]
    run = simulate(
        vehicle, Soil.published("LETE sand"), water, maneuver, CoefficientHydrodynamics(),
        duration=1.5, micro_step=5e-4, macro_step=20e-3,
    )  # fmt: skip
    speed = float(run["forward_velocity"][-1])
    print(f"run {parameter_set.get('computationIndex')}: {speed:.3f} m/s")
    return speed


def distance_from_wanted_speed(parameter_set):
    """Objective of the optimisation: the vehicle is to drive at 0.4 m/s over ground."""
    return abs(parameter_function(parameter_set) - 0.4)


def main(population=6, generations=3, use_multi_processing=True):
    """Vary current and mass; then find the wheel speed that drives at 0.4 m/s against 0.5 m/s."""
    common = {"addComputationIndex": True, "useMultiProcessing": use_multi_processing, "showProgress": False}
    variation = ParameterVariation(parameter_function, {"current": (0.0, 1.0, 3), "mass": [45.0, 53.0]}, **common)
    optimum = GeneticOptimization(
        distance_from_wanted_speed, {"wheel_speed": (4.0, 12.0)}, populationSize=population,
        numberOfGenerations=generations, elitistRatio=0.25, randomizerInitialization=0, **common,
    )  # fmt: skip
    return variation, optimum


if __name__ == "__main__":
    (parameters, speeds), (best, error, *_) = main()
    for current, mass, speed in zip(parameters["current"], parameters["mass"], speeds, strict=True):
        print(f"current {current:.1f} m/s, hull {mass:.0f} kg: {speed:.3f} m/s")
    print(f"{best['wheel_speed']:.2f} rad/s drive at 0.4 m/s within {1e3 * error:.0f} mm/s")
