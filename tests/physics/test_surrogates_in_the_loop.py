"""Networks in the loop: the coefficient model where they add nothing, members' spread, range, restart."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up_networks import SMALL, made_up, residual

from exumob.driving.maneuver import lane_change
from exumob.learning.dataset import pack
from exumob.simulation.ensemble import add_members
from exumob.simulation.run import simulate
from exumob.simulation.summary import summary
from exumob.simulation.water_models import hydrodynamics_named
from exumob.support.measured import measured_errors
from exumob.surrogates.model import SurrogateHydrodynamics, shipped_networks
from exumob.surrogates.networks import FULL_RANGE, NetworkSet
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.conditions import Water
from exumob.water.wave_loads import WaveCoefficients

pytest.importorskip("torch")
from exumob.learning.evaluation import closed_loop

HEAD_CURRENT = Water(0.12, 1.0)
STEPS = {"micro_step": 5e-4, "macro_step": 20e-3}


@pytest.mark.parametrize("base", ["calibrated", "coefficients"])
def test_zero_residual_is_its_base(vehicle, sand, base):
    """Networks whose file says nothing of waves were trained beside published coefficients without any."""
    network = residual(vehicle)
    if base == "coefficients":
        network = replace(network, about={name: v for name, v in network.about.items() if name != "waves"})
    a, b = (
        simulate(vehicle, sand, HEAD_CURRENT, lane_change(), model, duration=0.4, **STEPS)
        for model in (base, SurrogateHydrodynamics(network))
    )
    assert np.array_equal(a["position"], b["position"])
    assert not b["hydrodynamics_out_of_range"].any() and summary(b)["out_of_range_share"] == 0.0
    assert closed_loop(b, pack(simulate(
        vehicle, sand, HEAD_CURRENT, lane_change(), base, duration=0.4, record_step=1e-3, **STEPS
    )))["final"] < 1e-4  # fmt: skip


def test_networks_keep_the_calibrated_coefficients_that_they_were_added_to(vehicle, sand, tmp_path):
    """Those that come with exumob may be fitted anew: networks in a file stand on the old ones, and do not mix."""
    other = residual(vehicle)
    waves = WaveCoefficients(0.5 * other.waves.values, {})
    other = NetworkSet(other.architecture, other.arrays, other.about | {"waves": waves.terms})
    other = NetworkSet.load(other.save(tmp_path / "other.safetensors"))
    old = CalibratedHydrodynamics(waves=waves)
    a, b = (
        simulate(vehicle, sand, HEAD_CURRENT, lane_change(), model, duration=0.4, **STEPS)
        for model in (old, SurrogateHydrodynamics(other))
    )
    assert np.array_equal(a["position"], b["position"])
    named = hydrodynamics_named("calibrated", vehicle, HEAD_CURRENT, networks=[tmp_path / "other.safetensors"])
    assert isinstance(named, CalibratedHydrodynamics) and named.waves.digest() == old.waves.digest()
    own = simulate(vehicle, sand, HEAD_CURRENT, lane_change(), named, duration=0.1, **STEPS)
    assert "calibrated, not validated: coefficients fitted to other runs than those of" in own.attrs["trust"]
    with pytest.raises(ValueError, match="2 different sets of coefficients"):
        SurrogateHydrodynamics([other, residual(vehicle)])


def test_ensemble_gives_mean_and_spread(vehicle, sand):
    members = [residual(vehicle, loads) for loads in (-1.0, 2.0)]
    run = simulate(
        vehicle, sand, HEAD_CURRENT, lane_change(), SurrogateHydrodynamics(members), duration=0.1, **STEPS
    )  # fmt: skip
    assert run["hydrodynamics_load_spread"].values == pytest.approx(3.0 / math.sqrt(2.0))


def test_error_bars_are_spread_and_floor_where_they_were_measured(vehicle, sand):
    """Of all members that come with exumob; nan where the coefficients take part, none with networks of one's own."""
    water = Water(0.5 * vehicle.wheel.diameter, 0.5, density=800.0)
    run = simulate(vehicle, sand, water, lane_change(), SurrogateHydrodynamics(), duration=0.1, **STEPS)
    floor = 0.8 * np.array(measured_errors()["load_floor"]["networks"])
    bars = np.hypot(run["hydrodynamics_load_spread"], floor)
    np.testing.assert_allclose(run["hydrodynamics_load_error_bar"], bars)
    beyond = Water(1.3 * vehicle.wheel.diameter, 2.2)
    run = simulate(vehicle, sand, beyond, lane_change(), SurrogateHydrodynamics(), duration=0.1, **STEPS)
    taking_part = run["hydrodynamics_fallback_share"].values > 0.0
    assert taking_part.any() and np.isnan(run["hydrodynamics_load_error_bar"].values[taking_part]).all()
    alone = simulate(
        vehicle, sand, beyond, lane_change(), SurrogateHydrodynamics(fallback=False), duration=0.1, **STEPS
    )
    outside = alone["hydrodynamics_out_of_range"].values
    assert outside.any() and np.isnan(alone["hydrodynamics_load_error_bar"].values[outside]).all()
    own = simulate(vehicle, sand, water, None, SurrogateHydrodynamics(residual(vehicle)), duration=0.04, **STEPS)
    assert "hydrodynamics_load_error_bar" not in own


def test_beyond_lane_changes_networks_of_the_whole_range_take_over(vehicle, sand):
    """Within the range of lane changes those for them alone, in a current from behind the others alone, bit for bit."""
    ahead, behind = Water(0.5 * vehicle.wheel.diameter, 0.5), Water(0.6 * vehicle.wheel.diameter, 1.0, 0.0)
    lanes, wide = SurrogateHydrodynamics(shipped_networks()), SurrogateHydrodynamics(FULL_RANGE)
    assert lanes.beyond is None and wide.beyond is None
    for water, other, share in ((ahead, lanes, 0.0), (behind, wide, 1.0)):
        run, alone = (
            simulate(vehicle, sand, water, None, model, duration=0.3, **STEPS)
            for model in (SurrogateHydrodynamics(), other)
        )
        assert (run["hydrodynamics_wide_range_share"] == share).all() and "hydrodynamics_wide_range_share" not in alone
        for name in (
            "position",
            *(f"hydrodynamics_{one}" for one in ("load_spread", "load_error_bar", "fallback_share")),
        ):
            np.testing.assert_array_equal(run[name], alone[name], err_msg=f"{name}, {water}")
        assert not run["hydrodynamics_out_of_range"].any() and run["hydrodynamics_load_error_bar"].notnull().all()
    near = simulate(vehicle, sand, Water(0.62 * vehicle.wheel.diameter, 0.9), None, duration=0.3, **STEPS)
    between = near["hydrodynamics_wide_range_share"].values
    assert (between == between[:, :1]).all()  # of all bodies at once
    assert ((between > 0.0) & (between < 1.0)).any() and not near["hydrodynamics_out_of_range"].any()


def _ask(model, history, predict):
    model.wrenches(history, predict)


def test_networks_beyond_answer_as_if_they_had_been_asked_all_the_time(vehicle, sand, monkeypatch):
    """While nobody asks they only follow the motion: what they remember is the same when the range is left."""
    water = Water(0.45 * vehicle.wheel.diameter, 0.95)
    steps = {"duration": 1.2, "micro_step": 1e-3, "macro_step": 2e-3}  # no relaxing between macro steps
    followed = simulate(vehicle, sand, water, lane_change(speed=25.0), SurrogateHydrodynamics(), **steps)
    share = followed["hydrodynamics_wide_range_share"].max("body").values
    assert share[0] == 0.0 and (share == 0.0).sum() > 20 and share.max() > 0.1
    monkeypatch.setattr(SurrogateHydrodynamics, "remember", _ask)
    asked = simulate(vehicle, sand, water, lane_change(speed=25.0), SurrogateHydrodynamics(), **steps)
    for name in ("position", "water_wrench", "hydrodynamics_load_spread", "hydrodynamics_range_excess"):
        np.testing.assert_array_equal(followed[name], asked[name], err_msg=name)


def test_networks_beyond_need_a_fallback_and_go_with_their_members(vehicle):
    with pytest.raises(ValueError, match="beyond has no effect with fallback = False"):
        SurrogateHydrodynamics(shipped_networks(), fallback=False, beyond=FULL_RANGE)
    assert SurrogateHydrodynamics(fallback=False).beyond is None
    model = SurrogateHydrodynamics()
    third = model.member(2)
    assert [len(third.networks), len(third.beyond.networks)] == [1, 1]
    assert third.beyond.networks[0].digest() == model.beyond.networks[2].digest()
    assert model.parameters["beyond"] == model.beyond.parameters and len(model.all_networks) == 10
    own = SurrogateHydrodynamics(shipped_networks()[:2], beyond=shipped_networks()[2:3])
    assert own.member(1).beyond.networks[0].digest() == own.beyond.networks[0].digest()


def test_members_give_error_bars_on_the_path(vehicle, sand):
    """Each member's run is its own: the first is bit for bit the run of a surrogate of the first alone."""
    files = shipped_networks()[:2]
    given = vehicle, sand, Water.at_ratio(0.5, 0.5), None
    steps = {"duration": 0.3, "micro_step": 5e-4, "macro_step": 20e-3}
    times = []
    together = SurrogateHydrodynamics(files)
    result = add_members(simulate(*given, together, **steps), *given, together, progress=times.append, **steps)
    alone = simulate(*given, SurrogateHydrodynamics(files[0]), **steps)
    np.testing.assert_array_equal(result["member_position"].values[0], alone["position"].sel(body="hull").values)
    spread = summary(result)["forward_spread"]
    ends = result["member_position"].sel(axis="x").values[:, -1]
    assert spread == pytest.approx(abs(ends[0] - ends[1]) / math.sqrt(2.0)) and spread > 0.0
    assert times == sorted(times) and times[-1] == pytest.approx(0.3)
    with pytest.raises(ValueError, match="1 network gives no spread"):
        add_members(alone, *given, SurrogateHydrodynamics(files[0]), **steps)


def test_out_of_range_is_reported_and_falls_back(vehicle, sand):
    """A network that pushes with 2 N, trained up to 0.3 m/s: the coefficients take over, and the run says so."""
    narrow = {"input_low": np.full((5, 3), -0.3, np.float32), "input_high": np.full((5, 3), 0.3, np.float32)}
    pushing = residual(vehicle, 2.0, **narrow)
    run, alone = (
        simulate(vehicle, sand, HEAD_CURRENT, lane_change(), model, duration=0.6, **STEPS)
        for model in (SurrogateHydrodynamics(pushing), SurrogateHydrodynamics(pushing, fallback=False))
    )
    assert run["hydrodynamics_out_of_range"][-1].all() and (run["hydrodynamics_fallback_share"][-1] == 1.0).all()
    assert not alone["hydrodynamics_fallback_share"].any() and alone["hydrodynamics_out_of_range"][-1].all()
    assert summary(run)["out_of_range_share"] > 0.3


@pytest.mark.parametrize("shipped", [False, True])
def test_saved_and_restored(vehicle, sand, tmp_path, shipped):
    """A run stopped and resumed has the bits of the single run, whatever its networks, and those beyond, remember."""
    water = Water(0.14, 0.9) if shipped else HEAD_CURRENT
    rich = made_up(replace(SMALL, base="coefficients"), vehicle)
    late = made_up(replace(SMALL, base="coefficients", taps=1, layer="dense", filters=(0.1, 2.5)), vehicle)

    def run(duration, **more):
        model = SurrogateHydrodynamics([rich, residual(vehicle), late])
        model = SurrogateHydrodynamics() if shipped else model
        return simulate(vehicle, sand, water, lane_change(), model, duration=duration, **STEPS, **more)

    single = run(0.6)
    stopped = []

    def stop(time):
        if time > 0.5 and not stopped:
            stopped.append(time)
            raise RuntimeError("power cut")

    from exumob.support.errors import SimulationError

    with pytest.raises(SimulationError):
        run(0.6, checkpoint=tmp_path / "run.npz", progress=stop)
    resumed = run(0.6, checkpoint=tmp_path / "run.npz", resume=True)
    for name in ("position", "water_wrench", "hydrodynamics_load_spread", "hydrodynamics_range_excess"):
        assert np.array_equal(single[name], resumed[name])
