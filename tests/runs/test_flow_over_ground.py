"""The flow solver in the loop over uneven ground: a vehicle drives down a bank into a river."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exumob.coupling.flow_code import BuiltInFlow
from exumob.coupling.flow_in_loop import CfdHydrodynamics
from exumob.coupling.spin_up import FlowSpinUp
from exumob.driving.maneuver import ConstantSteer
from exumob.flow import FlowSettings
from exumob.flow.revision import solver_revision
from exumob.simulation.run import simulate
from exumob.water.cross_section import CrossSection
from exumob.water.hydrostatics import hydrostatic_wrench
from exumob.water.wetted_surface import body_surfaces

RIVER = CrossSection(
    station=(-9.0, 0.4, 1.4, 3.4, 9.0), bed=(0.033, 0.033, -0.117, -0.117, 0.4), current=(0.0, 0.0, 0.3, 0.3, 0.0)
)
SHORT = FlowSpinUp(ramp=0.04, hold=0.04, adjustment=0.04)


@pytest.fixture(scope="module")
def into_the_river(vehicle, sand, tmp_path_factory):
    """Half a second from 0.3 m before the foot of the bank, on coarse cells; with a checkpoint, and its model."""
    model = CfdHydrodynamics(
        BuiltInFlow(0.04, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=0.1), spin_up=SHORT
    )
    file = tmp_path_factory.mktemp("river") / "run.npz"
    run = simulate(
        vehicle, sand, RIVER.water(0.0), ConstantSteer(speed=10.0, ramp_time=0.1), model, terrain=RIVER.terrain(),
        start=(1.2, 0.0, 0.0), duration=0.5, checkpoint=file,
    )  # fmt: skip
    return run, model, file


def test_it_drives_into_deeper_water_and_is_lifted_and_pushed(into_the_river):
    run, _, _ = into_the_river
    assert run.attrs["status"] == "completed"
    assert run.attrs["cell_size"] == 0.04 and run.attrs["flow_revision"] == solver_revision()
    depth = run["water_depth"].values
    assert depth[-1] > depth[0] + 0.02
    lift = run["water_load"].sel(axis="z").sum("body").values
    assert lift[-10:].mean() > lift[:10].mean()
    sideways = run["water_load"].sel(axis="y").sum("body").values
    assert sideways[-10:].mean() > 0.0  # to the left, as the current
    assert set(run["hydrodynamics_bed_elevation"].dims) == {"snapshot", "y", "x"}
    assert float(run["hydrodynamics_bed_elevation"].min()) == pytest.approx(-0.117, abs=2e-3)


def test_its_lift_on_the_held_vehicle_is_near_that_of_still_water(into_the_river, vehicle):
    """Archimedes over the bank, to a tenth of the weight of the vehicle: cells of 4 cm, a young current."""
    run, _, _ = into_the_river
    late = run["hydrodynamics_development_load"].isel(development_time=slice(-5, None)).mean("development_time")
    turns = Rotation.from_quat(run["quaternion"].values[0], scalar_first=True).as_matrix()
    places, terrain = run["position"].values[0], RIVER.terrain()
    still = np.array([
        turn @ hydrostatic_wrench(surface, turn, place, 0.0, terrain=terrain)[:3]
        for surface, turn, place in zip(body_surfaces(vehicle), turns, places, strict=True)
    ])  # fmt: skip
    weight = -float(run["gravity_load"].isel(time=0).sel(axis="z").sum())
    assert still[:, 2].sum() > 0.1 * weight
    assert float(late.sel(component="Fz").sum("body")) == pytest.approx(still[:, 2].sum(), abs=0.1 * weight)


def test_it_goes_on_from_its_checkpoint_with_the_same_bits(into_the_river, vehicle, sand):
    run, _, file = into_the_river
    model = CfdHydrodynamics(
        BuiltInFlow(0.04, settings=FlowSettings(threads=1), allow_coarse=True, snapshots=0.1), spin_up=SHORT
    )
    again = simulate(
        vehicle, sand, RIVER.water(0.0), ConstantSteer(speed=10.0, ramp_time=0.1), model, terrain=RIVER.terrain(),
        start=(1.2, 0.0, 0.0), duration=0.5, checkpoint=file, resume=True,
    )  # fmt: skip
    for name in ("position", "water_load", "hydrodynamics_bed_elevation"):
        assert np.array_equal(run[name], again[name]), name


def test_a_river_elsewhere_and_turned_is_the_same_river(vehicle, sand):
    """Moved by (1000, 2000, 7) m and turned by 37 degrees, the vehicle in midstream.

    Loads on the held vehicle to 1e-5 of the largest; the wheels then creep to a place that round-off decides to 0.1 mm.
    """
    origin, turn = (1000.0, 2000.0), math.radians(37.0)
    c, s = math.cos(turn), math.sin(turn)

    def midstream(section, level, **where):
        place = (where["origin"][0] + 2.4 * c, where["origin"][1] + 2.4 * s, turn) if where else (2.4, 0.0, 0.0)
        model = CfdHydrodynamics(
            BuiltInFlow(0.04, settings=FlowSettings(threads=1), allow_coarse=True), spin_up=SHORT
        )  # fmt: skip
        return simulate(
            vehicle, sand, section.water(level, **where), ConstantSteer(speed=10.0, ramp_time=0.1), model,
            terrain=section.terrain(**where), duration=0.1, start=place,
        )  # fmt: skip

    here = midstream(RIVER, 0.0)
    there = midstream(replace(RIVER, bed=tuple(z + 7.0 for z in RIVER.bed)), 7.0, origin=origin, direction=turn)
    loads, others = (run["hydrodynamics_development_load"].values[:10] for run in (here, there))
    assert np.abs(loads).max() > 50.0
    assert others == pytest.approx(loads, abs=1e-5 * np.abs(loads).max())
    back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    apart = (there["position"].values - [*origin, 7.0]) @ back.T - here["position"].values
    assert np.abs(apart).max() < 1e-4
