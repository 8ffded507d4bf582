"""Short runs to which something happens, and the verdict that they carry."""

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer
from exumob.ground.terrain import Terrain
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.simulation.run import simulate
from exumob.simulation.summary import summary
from exumob.simulation.verdict import judge, verdict_of_error
from exumob.support.errors import SimulationError, SimulationInterrupted
from exumob.support.quantities import unusual
from exumob.water.conditions import Water

AHEAD = ConstantSteer(ramp_time=0.5)


def verdict_on(run):
    """The verdict that the Dataset carries, after a look at whether all says the same."""
    attrs = run.attrs
    found = judge(run)
    assert (attrs["verdict"], attrs["verdict_sentence"]) == (found.kind, found.sentence)
    assert summary(run)["verdict"] == found.kind
    np.testing.assert_equal(summary(run)["verdict_since"], found.since)
    assert (run["verdict_flag"].values == found.flags).all()
    return found


def test_stands(vehicle, sand):
    run = simulate(vehicle, sand, maneuver=ConstantSteer(speed=0.0), duration=0.6)
    assert verdict_on(run).kind == "stands"


def test_stuck_on_slippery_soil(vehicle, sand):
    """Friction of 5 degrees: the wheels spin from the start; they turn faster than standing counts from 0.15 s on."""
    soil = replace(sand, cohesion=100.0, friction_angle=math.radians(5.0))
    found = verdict_on(simulate(vehicle, soil, maneuver=AHEAD, duration=0.9))
    assert found.kind == "stuck"
    assert found.since < 0.2


def test_afloat(vehicle, sand):
    run = simulate(vehicle, sand, Water(0.5), AHEAD, "coefficients", duration=0.6)
    found = verdict_on(run)
    assert found.sentence == "afloat since 0.00 s: 0 % of the weight on the ground"
    assert run["slip_ratio"].isnull().all()
    assert math.isnan(summary(run)["mean_slip"])


def test_swept_away_afloat(vehicle, sand):
    """Nothing holds it in a current from the side: aside at once; the wheels push hardly at all."""
    water = Water(0.5, 1.0, current_direction=0.5 * math.pi)
    found = verdict_on(simulate(vehicle, sand, water, AHEAD, "coefficients", duration=0.8))
    assert found.kind == "swept away"
    assert found.since < 0.2
    assert {"afloat", "stuck"} <= {condition.kind for condition in found.conditions}


def test_slides_down_a_slope_on_locked_wheels(vehicle, sand):
    """A slope of 30 degrees of a soil that holds 20: it slides back, from 0.02 sqrt(g L) on."""
    soil = replace(sand, cohesion=0.0, friction_angle=math.radians(20.0))
    slope = Terrain(slope_x=math.tan(math.radians(30.0)))
    run = simulate(vehicle, soil, None, ConstantSteer(speed=0.0), duration=0.9, terrain=slope)
    found = verdict_on(run)
    assert found.kind == "slides"
    assert 0.0 < found.since < 0.7
    assert run["forward_velocity"].sel(time=found.since, method="nearest") == pytest.approx(-0.053, abs=0.01)


def test_submerged(vehicle, sand):
    """Twice as heavy as the water that it displaces, 0.5 m deep: it drives on the bed, with the deck under water."""
    heavy = replace(vehicle, hull=replace(vehicle.hull, mass=180.0))
    found = verdict_on(simulate(heavy, replace(sand, k_phi=2e7), Water(0.5), AHEAD, "coefficients", duration=0.6))
    assert (found.kind, found.since) == ("submerged", 0.0)


def test_swept_away_by_a_current_from_ahead_and_the_side(vehicle, sand):
    """2.2 m/s, 30 degrees off the bow: spinning wheels cannot hold it sideways; 0.2 m/s to the left."""
    water = Water.at_ratio(0.6, 2.2, current_direction=math.radians(150.0))
    run = simulate(vehicle, sand, water, AHEAD, "coefficients", duration=1.1)
    found = verdict_on(run)
    assert found.kind == "swept away"
    assert 0.1 < found.since < 0.4
    assert float(run["lateral_velocity"][-1]) > float(run["forward_velocity"][-1])


def test_tipped_on_a_side_slope_that_gets_steeper(vehicle, sand, caplog):
    """Centre of mass half a metre up: its weight falls beside the wheels at 35 degrees; the slope goes to 38."""
    caplog.set_level(logging.CRITICAL)
    tall = replace(vehicle, hull=replace(vehicle.hull, center_of_mass_height=unusual(0.5)))
    firm = replace(sand, cohesion=20e3, k_phi=5e7)
    x, y = np.linspace(-4.0, 8.0, 61), np.linspace(-4.0, 4.0, 41)
    rise = np.clip(x - 0.5, 0.0, 1.0)
    rise = rise**2 * (3.0 - 2.0 * rise)
    slope = Terrain(
        heights=math.tan(math.radians(38.0)) * rise * y[:, None], origin=(-4.0, -4.0), spacing=0.2, steepest=10.0
    )
    found = verdict_on(simulate(tall, firm, maneuver=AHEAD, terrain=slope, duration=2.44, micro_step=1e-3))
    assert found.kind == "tipped"
    assert 1.4 < found.since < 1.9


@pytest.fixture(scope="module")
def sunken(vehicle, sand):
    """Off a ledge at 6 m/s onto soil so soft that a wheel sinks to its centre where it lands."""
    x = np.linspace(-2.0, 10.0, 241)
    ledge = Terrain(
        heights=np.broadcast_to(np.where(x > 0.55, -0.7, 0.0), (3, 241)), origin=(-2.0, -3.0), spacing=(0.05, 3.0),
        steepest=20.0,
    )  # fmt: skip
    with pytest.raises(SimulationError, match="sunk to its centre") as caught:
        simulate(
            vehicle, replace(sand, k_phi=2e5, k_c=0.0), maneuver=ConstantSteer(speed=60.0), terrain=ledge, duration=2.0,
            initial_speed=6.0,
        )  # fmt: skip
    return caught.value


def test_sunk_on_the_way(sunken):
    found = verdict_on(sunken.result)
    assert (sunken.cause, found.kind) == ("sunk", "sunk")
    assert 0.38 < found.since < 0.48
    assert f"broke down at {found.since:.4f} s" in found.sentence
    assert verdict_of_error(sunken).kind == "sunk"


def test_slip_is_not_a_number_where_a_wheel_has_no_contact_and_only_there(sunken):
    run = sunken.result
    in_contact = run["sinkage"].values > 0.0
    assert (np.isnan(run["slip_ratio"].values) == ~in_contact).all()
    assert not in_contact.all()
    assert in_contact.any()


def test_broken_down_and_interrupted_runs_carry_a_verdict(vehicle, sand, tmp_path):
    def stop(kind):
        def progress(time):
            if time > 0.55:
                raise kind("enough")

        return progress

    soil = {"maneuver": AHEAD, "duration": 2.0}
    with pytest.raises(SimulationError) as broken:
        simulate(vehicle, sand, progress=stop(RuntimeError), **soil)
    found = verdict_on(broken.value.result)
    assert found.kind == "broke down"
    assert found.since == pytest.approx(0.56, abs=0.02)
    loaded = load_dataset(save_dataset(broken.value.result, tmp_path / "broken.nc"))
    assert verdict_on(loaded).kind == "broke down"
    with pytest.raises(SimulationInterrupted) as stopped:
        simulate(vehicle, sand, progress=stop(KeyboardInterrupt), **soil)
    assert verdict_on(stopped.value.result).sentence.endswith("; the run was interrupted at 0.5600 s")
