"""Flow, coupling and towing tank: what is of the wrong kind, type, shape or size is refused by name."""

import inspect
import math
from dataclasses import asdict, replace

import numpy as np
import pytest
import xarray as xr

from exumob.coupling.explicit import Explicit
from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.coupling.spin_up import USUAL, FlowSpinUp, poses_between, poses_during_ramp
from exumob.coupling.strong import Strong
from exumob.driving.path_following import PathFollowing
from exumob.flow import (
    FlowSettings,
    FlowSolver,
    Grid,
    KOmegaSST,
    Poses,
    Smagorinsky,
    Solid,
    Tread,
    box,
    cylinder,
    hull_prism,
    prism,
    sphere,
    vehicle_solids,
)
from exumob.flow.output.pictures import SurfaceView, animate_surface
from exumob.flow.output.vtk import VtkSeries
from exumob.flow.resolution import check_resolution
from exumob.flow.vehicle_window import doubled_window, settings_for_vehicle, vehicle_window
from exumob.towing_tank import CaptiveMotion, captive_run, captive_summary
from exumob.towing_tank.plots import plot_captive
from exumob.vehicle.scaled import scaled_vehicle
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.small_car import small_car

VEHICLE = amphibious_vehicle()
WATER = Water(0.12, 1.0)
GRID = Grid.uniform((-1.5, -1.0, 0.0), (1.5, 1.0, 0.4), 0.05)
FIVE = np.zeros((5, 3))
ONE = np.tile(np.eye(3), (5, 1, 1))
NEVER = (
    10**400, -(10**400), math.nan, "text", b"bytes", 1j, object(), [], {}, np.datetime64("2020-01-01"),
    np.ma.masked_array([1.0, 2.0], mask=[True, False]),
)  # fmt: skip
"""No field and no argument takes any of these; what takes a text, takes another one."""
CALLS = {
    FlowSettings: {}, Smagorinsky: {}, KOmegaSST: {}, CaptiveMotion: {}, FlowSpinUp: {}, Explicit: {}, SemiImplicit: {},
    Strong: {}, BuiltInFlow: {}, CfdHydrodynamics: {},
    Tread: {"lug_height": 0.01, "lug_count": 12},
    Poses: {"position": FIVE, "rotation": ONE, "velocity": FIVE, "angular_velocity": FIVE, "spin": np.zeros(5)},
    Poses.at_rest: {"position": FIVE},
    Grid: {f"{axis}_faces": np.linspace(0.0, 1.0, 11) for axis in "xyz"},
    Grid.uniform: {"low": (0, 0, 0), "high": (1, 1, 1), "cell_size": 0.1},
    Grid.stretched: {
        "core_low": (0, 0, 0), "core_high": (1, 1, 1), "low": (-1, -1, 0), "high": (2, 2, 2), "cell_size": 0.1
    },
    Grid.around_vehicle: {"vehicle": VEHICLE, "ahead": 1.8, "top": 0.42},
    vehicle_window: {"vehicle": VEHICLE, "cell_size": 0.05, "water": WATER},
    doubled_window: {"vehicle": VEHICLE, "cell_size": 0.05, "water": WATER},
    check_resolution: {"vehicle": VEHICLE, "grid": GRID, "steering_range": (0.0, 0.0)},
    Solid: {"shape": sphere(0.1).shape, "low": -np.ones(3), "high": np.ones(3)},
    sphere: {"radius": 0.1, "friction": 0.0}, box: {"length": 1.0, "width": 1.0, "height": 1.0},
    cylinder: {"radius": 1.0, "width": 1.0, "edge_radius": 0.1}, hull_prism: {"hull": VEHICLE.hull},
    prism: {"outline": [(0, 0), (1, 0), (0, 1)], "width": 1.0},
    vehicle_solids: {"vehicle": VEHICLE, "cell_size": 0.05},
    FlowSolver: {"grid": GRID, "water": WATER, "settings": FlowSettings(follow=None)},
    captive_run: {"vehicle": VEHICLE, "water": WATER, "motion": CaptiveMotion(), "cell_size": 0.05, "grid": None},
    poses_during_ramp: {"rest": Poses.at_rest(FIVE), "water": WATER, "elapsed": 0.1, "ramp": 1.0},
    poses_between: {"begin": Poses.at_rest(FIVE), "end": Poses.at_rest(FIVE), "part": 0.1, "duration": 1.0},
    captive_summary: {"dataset": None}, plot_captive: {"dataset": None}, SurfaceView: {"dataset": None},
    VtkSeries: {"vehicle": VEHICLE},
    animate_surface: {"dataset": None},
}  # fmt: skip


@pytest.mark.parametrize("function", CALLS, ids=lambda function: function.__qualname__)
def test_the_wrong_kind_is_refused_by_name(function):
    """Every field and every argument, each with all of `NEVER`; on the way nothing runs."""
    usual = CALLS[function]
    required = {"solids": ()} if function is FlowSolver else {"folder": "fields"} if function is VtkSeries else {}
    required |= {"file": "run.gif"} if function is animate_surface else {}
    for name in usual or inspect.signature(function).parameters:
        for value in NEVER:
            with pytest.raises(ValueError, match=rf"\b{name}\b"):
                function(**{**required, **usual, name: value})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: FlowSettings(closure=3), r"FlowSettings\.closure = 3"),
        (lambda: FlowSettings(closure=Smagorinsky), r"FlowSettings\.closure = Smagorinsky is a class.*Smagorinsky\("),
        (lambda: FlowSettings(iterations=1.5), r"FlowSettings\.iterations = 1\.5 .*whole number"),
        (lambda: FlowSettings(iterations=True), r"FlowSettings\.iterations = True"),
        (lambda: FlowSettings(far_x=1), r"FlowSettings\.far_x = 1 .*True or False"),
        (lambda: FlowSettings(threads=10**6), r"FlowSettings\.threads = 1000000 .*NUMBA_NUM_THREADS"),
        (lambda: FlowSettings(absorbing_width=5e-324), r"FlowSettings\.absorbing_width = 5e-324 m"),
        (lambda: FlowSettings(courant=0.6), r"FlowSettings\.courant = 0\.6 must be .*0\.5"),
        (lambda: CaptiveMotion(ramp_time=5e-324), r"CaptiveMotion\.ramp_time = 5e-324 s must be >= 0\.001"),
        (lambda: CaptiveMotion(frequency=5e-324), r"CaptiveMotion\.frequency = 5e-324 Hz"),
        (lambda: CaptiveMotion(drift_angle=45.0), r"drift_angle = 45\.0 rad .*degrees\? Then give math\.radians\(45\)"),
        (lambda: CaptiveMotion(wheel_speed=600.0), r"wheel_speed = 600\.0 rad/s .*revolutions a minute"),
        (lambda: CaptiveMotion(driver=CaptiveMotion()), r"CaptiveMotion\.driver = CaptiveMotion is no maneuver"),
        (
            lambda: CaptiveMotion(driver=PathFollowing(((0, 0), (5, 0)))),
            r"driver = PathFollowing answers",
        ),
        (lambda: FlowSpinUp(hold=0.01, interval=0.004), r"FlowSpinUp\.interval = 0\.004 s .* quarter of hold = 0\.01"),
        (lambda: FlowSpinUp(ramp=5e-324), r"FlowSpinUp\.ramp = 5e-324 s"),
        (lambda: Explicit(within_step="constant"), r"Explicit\.within_step = 'constant' is not known; use 'held' or"),
        (lambda: Strong(iterations=2.5), r"Strong\.iterations = 2\.5 .*whole number"),
        (lambda: SemiImplicit(renewal=0.0), r"SemiImplicit\.renewal = 0\.0 s"),
        (lambda: BuiltInFlow(18.0), r"BuiltInFlow\.cell_size = 18\.0 m .*mm\? Then give 0\.018 m"),
        (lambda: BuiltInFlow(grid=3), r"BuiltInFlow\.grid = 3"),
        (lambda: BuiltInFlow(snapshots=5e-324), r"BuiltInFlow\.snapshots = 5e-324"),
        (lambda: CfdHydrodynamics(3), r"CfdHydrodynamics\.flow = 3 .*has no advance"),
        (lambda: CfdHydrodynamics(BuiltInFlow), r"CfdHydrodynamics\.flow = BuiltInFlow is a class"),
        (lambda: Tread(0.01, 12.5), r"Tread\.lug_count = 12\.5 .*whole number"),
        (lambda: Grid.uniform((0, 0), (1, 1, 1), 0.1), r"Grid\.uniform\.low has shape \(2,\)"),
        (
            lambda: Grid.uniform((0, 0, 0), (1, 1, 1), 0.5),
            r"cell_size = 0\.5 m makes 2\.0 cells along x; .* 4, so",
        ),
        (lambda: Grid.stretched((0, 0, 0), (1, 1, 1), (0, 0, 0), (1, 1, 0.5), 0.1), r"Grid\.stretched: the core"),
        (lambda: Grid(np.zeros(9), np.arange(9.0), np.arange(9.0)), r"x_faces: face 1 at 0 m follows one at 0 m"),
        (lambda: Grid(np.arange(9e9, 9e9 + 9), np.arange(9.0), np.arange(9.0)), r"x_faces goes from 9e\+09"),
        (lambda: Poses(FIVE, ONE, FIVE[:4], FIVE, np.zeros(5)), r"Poses\.velocity has shape \(4, 3\)"),
        (lambda: Poses(FIVE, 2.0 * ONE, FIVE, FIVE, np.zeros(5)), r"Poses\.rotation\[0\] is no rotation"),
        (lambda: Poses(FIVE, -ONE, FIVE, FIVE, np.zeros(5)), r"Poses\.rotation\[0\] is no rotation"),
        (lambda: Poses(FIVE, ONE, FIVE, FIVE, np.full(5, np.inf)), r"Poses\.spin: 5 of 5 values are not finite"),
        (lambda: prism([(0, 0), (1, 0)], 1.0), r"prism\.outline has 2 corners"),
        (lambda: prism([(0, 0), (1, 0), (1, 0), (0, 1)], 1.0), r"prism\.outline: corners 1 and 2 are the same"),
        (lambda: cylinder(0.1, 0.1, 0.06), r"cylinder\.edge_radius = 0\.06 m must be >= 0 and <= 0\.05"),
        (lambda: FlowSolver(GRID, (3,), WATER), r"FlowSolver\.solids\[0\] = 3"),
        (lambda: captive_run(VEHICLE, 0.12), r"captive_run\.water = 0\.12"),
        (lambda: captive_run(VEHICLE, WATER, terrain=0.1), r"captive_run\.terrain = 0\.1"),
        (lambda: captive_run(VEHICLE, WATER, interval=True), r"captive_run\.interval = True"),
        (lambda: captive_summary(xr.Dataset()), r"captive_summary\.dataset has no force"),
        (lambda: SurfaceView(xr.Dataset()), r"holds no snapshots"),
        (lambda: animate_surface(xr.Dataset(), "run.gif", -1.0), r"animate_surface\.frames_per_second = -1\.0"),
    ],
)
def test_wrong_values_are_refused_with_what_would_do(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_zones_that_absorb_waves_are_in_proportion_to_the_vehicle_unless_their_width_is_given():
    given = FlowSettings(threads=2)
    assert given.zone_width == 0.6 and settings_for_vehicle(VEHICLE, given).zone_width == 0.6
    car = settings_for_vehicle(small_car(), given)
    assert car.zone_width == pytest.approx(0.6 * 3.785) and car.size == pytest.approx(3.785) and car.threads == 2
    assert settings_for_vehicle(small_car(), replace(given, reference_length=2.0)).zone_width == 1.2
    assert settings_for_vehicle(small_car(), FlowSettings(absorbing_width=0.3)).zone_width == 0.3
    grid = vehicle_window(small_car(), 0.1, Water(0.3))
    assert 2.0 * car.zone_width < min(-grid.y_faces[0], grid.x_faces[-1], -grid.x_faces[0]) * 2.0


def test_what_is_right_is_taken_in_any_kind():
    """Whole numbers for numbers, lists for arrays, numbers of numpy; defaults stay as they are."""
    settings = FlowSettings(courant=np.float32(0.25), iterations=np.int64(80), absorbing_width=1, far_x=np.True_)
    assert (settings.courant, settings.iterations, settings.absorbing_width) == (0.25, 80, 1.0)
    assert type(settings.iterations) is int and type(settings.far_x) is bool and type(settings.absorbing_width) is float
    assert Grid.uniform([0, 0, 0], np.ones(3), (0.1, 0.2, 0.25)).shape == (5, 4, 10)
    poses = Poses(FIVE.tolist(), ONE.tolist(), FIVE, FIVE, range(5))
    assert poses.spin.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert poses.position.flags.writeable


def test_spin_up_lasts_as_long_as_suits_the_vehicle():
    """By Froude's law: four times as large, twice as long; exactly as ever for the paper's; what is given stays."""
    paper, large = amphibious_vehicle(), scaled_vehicle(amphibious_vehicle(), 4.0)
    assert FlowSpinUp().for_vehicle(paper) == USUAL
    for name, time in asdict(FlowSpinUp().for_vehicle(large)).items():
        assert time == pytest.approx(2.0 * getattr(USUAL, name)), name
    given = FlowSpinUp(hold=0.01, ramp=0.3).for_vehicle(large)
    assert (given.ramp, given.hold, given.adjustment) == (0.3, 0.01, pytest.approx(1.0))
    assert given.interval == pytest.approx(0.0025)
    with pytest.raises(ValueError, match=r"FlowSpinUp\.interval = 0\.3 s must be at most a quarter of hold = 1 s"):
        FlowSpinUp(interval=0.3).for_vehicle(large)
