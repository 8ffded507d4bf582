"""Several networks in one file, with what was measured of them: the line of trust quotes it, and what is beyond."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_up_networks import SMALL, made_up

from exumob.coupling.explicit import Explicit
from exumob.coupling.semi_implicit import SemiImplicit
from exumob.driving.maneuver import ConstantSteer, Recorded, lane_change, smooth_step
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.simulation.description import RunDescription, Steps
from exumob.simulation.trust import trust_of
from exumob.simulation.water_models import hydrodynamics_named
from exumob.surrogates.ensemble import card_of, load_members, save_ensemble
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.surrogates.networks import VERSION, Architecture, NetworkSet, network_file, write_arrays
from exumob.surrogates.vehicle_shape import card_parameters
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle

CAR = amphibious_vehicle()
MEMBERS = [made_up(SMALL, CAR, seed) for seed in range(3)]
TIMES = np.linspace(0.0, 1.0, 9)
RECORDED = Recorded(TIMES, 0.0 * TIMES, [smooth_step(x)[0] for x in TIMES])
CARD = {
    "vehicle": "amphibious", "parameters": card_parameters(CAR), "members": 3,
    "cell_size": 0.02, "runs": 4, "seconds": 90.0, "load_error": 0.31,
    "coefficients_load_error": 0.9, "worst_load": "hull Fz 0.71", "inside": 0.62, "depth_ratio": [0.2, 0.9],
    "current_speed": [0.0, 1.5], "directions": "along", "soils": ["LETE sand"], "lost": [], "drives_failed": 0,
    "drives": [
        {"name": "a", "maneuver": "lane change", "duration": 8.0, "end": 0.012, "outside": 0.1, "fallback": 0.01},
        {"name": "b", "maneuver": "straight", "duration": 4.0, "end": -0.034, "outside": 0.0, "fallback": 0.0},
    ],
}  # fmt: skip
FLOOR = [[3.0, 2.0, 9.0, 0.3, 1.0, 0.2]] * 5


@pytest.fixture
def file(tmp_path):
    return save_ensemble(MEMBERS, tmp_path / "networks.safetensors", CARD)


def test_the_papers_networks_are_there_by_name(tmp_path):
    """In half precision: 7 MB. A file that is called so is not meant."""
    (tmp_path / "paper-lstm").touch()
    (found,) = load_members("paper-lstm")
    assert (found.about["preset"], found.architecture) == ("paper-lstm", Architecture())
    assert network_file("paper-lstm").stat().st_size < 8e6
    with pytest.raises(ValueError, match="is not a file of networks"):
        load_members(tmp_path / "paper-lstm")


def test_members_come_back_as_they_were(file, tmp_path):
    found = load_members(file)
    assert [member.digest() for member in found] == [member.digest() for member in MEMBERS]
    assert [member.architecture for member in found] == [SMALL] * 3
    assert card_of(found) == CARD
    single = MEMBERS[0].save(tmp_path / "one.safetensors")
    assert [m.digest() for m in load_members(single)] == [MEMBERS[0].digest()]
    with pytest.raises(ValueError, match=r"save_ensemble.members is empty"):
        save_ensemble([], tmp_path / "none.safetensors")


def with_card(member, card):
    return replace(member, about=member.about | {"report_card": card})


@pytest.mark.parametrize(
    "change",
    [
        lambda m: m[:2],  # not all of them
        lambda m: [*m, m[0]],
        lambda m: [m[0], m[1], MEMBERS[2]],  # one without a card
        lambda m: [with_card(x, CARD | {"load_error": math.nan}) for x in m],
        lambda m: [with_card(x, CARD | {"drives": "none"}) for x in m],
        lambda m: [with_card(x, CARD | {"load_floor": FLOOR[:4]}) for x in m],
        lambda m: [with_card(x, CARD | {"load_floor": [[1.0, 1.0, "1", 1.0, 1.0, 1.0]] * 5}) for x in m],
        lambda m: [with_card(x, {k: v for k, v in CARD.items() if k != "parameters"}) for x in m],
        lambda m: [with_card(x, CARD | {"drives": [{"end": 0.1}]}) for x in m],
        lambda m: [with_card(x, "good") for x in m],
        lambda m: [],
    ],
)  # fmt: skip
def test_a_card_holds_for_all_of_its_members_alone(file, change):
    assert card_of(change(load_members(file))) is None


def test_a_damaged_file_is_refused(file, tmp_path):
    data = bytearray(file.read_bytes())
    data[-3] ^= 0xFF
    (tmp_path / "bad.safetensors").write_bytes(bytes(data))
    with pytest.raises(ValueError, match="is damaged"):
        load_members(tmp_path / "bad.safetensors")
    with pytest.raises(ValueError, match=r"none\.safetensors"):
        load_members(tmp_path / "none.safetensors")
    header = {"format": "exumob ensemble", "version": VERSION}
    for members, message in (([], "does not say what its members are"), ([{}], "architecture"), ([3], "does not say")):
        write_arrays(tmp_path / "x.safetensors", header | {"members": members}, {"0/W": np.zeros(3, np.float32)})
        with pytest.raises(ValueError, match=message):
            load_members(tmp_path / "x.safetensors")
    write_arrays(tmp_path / "x.safetensors", header | {"version": 7}, {})
    with pytest.raises(ValueError, match="is of version 7"):
        load_members(tmp_path / "x.safetensors")


def test_a_drive_takes_the_file(file):
    model = hydrodynamics_named("networks", CAR, Water(0.12), networks=[file])
    assert len(model.networks) == 3
    more = hydrodynamics_named("networks", CAR, Water(0.12), networks=[file, MEMBERS[0]])
    assert len(more.networks) == 4 and isinstance(more.networks[3], NetworkSet)
    assert len(SurrogateHydrodynamics(file).networks) == 3
    with pytest.raises(ValueError, match="rest on no coefficients that were fitted to their runs; give some"):
        hydrodynamics_named("calibrated", CAR, Water(0.12), networks=[file])
    with pytest.raises(ValueError, match=r"networks\.safetensors holds 3 sets of networks .* a file of one is wanted"):
        NetworkSet.load(file)


# -- line of trust -----------------------------------------------------------------------------------------------------


@pytest.fixture
def run(file):
    return RunDescription(
        CAR, Soil.published("LETE sand"), Water.at_ratio(0.6, 1.0), Terrain(), lane_change(),
        SurrogateHydrodynamics(load_members(file)), Explicit(), Steps(8.0, 1e-3, 20e-3, 1e-2), 0.0,
    )  # fmt: skip


def test_the_line_of_trust_quotes_the_card(run):
    found = trust_of(run, 0.05, 0.0)
    assert (found.status, found.departures) == ("measured", ())
    assert found.mean == pytest.approx(0.023) and found.worst == 0.034
    for text in ("2 drives kept apart ended 2.3 % of the path (at worst 3.4 %)", "off by 0.31 of their deviation",
                 "worst hull Fz 0.71", "62 % of them within two deviations", "cells of 20 mm"):  # fmt: skip
        assert text in found.line


@pytest.mark.parametrize(
    ("change", "quantity", "measured"),
    [
        ({"water": Water.at_ratio(1.0, 1.0)}, "depth ratio", "0.2 to 0.9"),
        ({"water": Water.at_ratio(0.5, 2.0)}, "current", "0 to 1.5"),
        ({"water": Water.at_ratio(0.5, 1.0, current_direction=1.0)}, "current turned from ahead by", "0 or 180"),
        ({"water": Water.at_ratio(0.5, 1.0, density=1100.0)}, "density", "1000"),
        ({"coupling": SemiImplicit()}, "coupling", "Explicit"),
        ({"coupling": Explicit(within_step="held")}, "loads within a step", "linear"),
        ({"soil": Soil.published("Grenville loam 24 %")}, "soil", "LETE sand"),
        ({"terrain": Terrain.slope(0.1), "water": Water(level=0.1)}, "terrain", "flat"),
        ({"maneuver": ConstantSteer(0.2)}, "maneuver", "lane change, straight"),
        ({"maneuver": RECORDED}, "maneuver", "lane change, straight"),
        ({"steps": Steps(8.0, 1e-3, 40e-3, 1e-2)}, "macro step", "20"),
        ({"steps": Steps(20.0, 1e-3, 20e-3, 1e-2)}, "duration", "8"),
        ({"initial_speed": 0.5}, "initial speed", "0"),
        ({"vehicle": replace(CAR, hull=replace(CAR.hull, mass=90.0))}, "hull.mass", "49"),
        ({"vehicle": replace(CAR, suspension=replace(CAR.suspension, damping=60.0))}, "suspension.damping", "139"),
    ],
)  # fmt: skip
def test_what_is_beyond_the_card_is_said(run, change, quantity, measured):
    found = trust_of(replace(run, **change), 0.05, 0.0)
    assert found.status == "beyond"
    assert measured in {d.quantity: d.measured for d in found.departures}[quantity]


def test_another_name_is_no_other_vehicle(run):
    assert trust_of(replace(run, vehicle=replace(CAR, name="another")), 0.0, 0.0).status == "measured"


def test_one_seed_has_error_bars_if_they_were_measured(run, tmp_path):
    one = save_ensemble(MEMBERS[:1], tmp_path / "one.safetensors", CARD | {"members": 1, "inside": 0.0})
    line = trust_of(replace(run, hydrodynamics=SurrogateHydrodynamics(one)), 0.0, 0.0).line
    assert "without error bars, as one seed has none" in line and "two standard deviations" not in line
    one = save_ensemble(MEMBERS[:1], tmp_path / "one.safetensors", CARD | {"members": 1, "load_floor": FLOOR})
    line = trust_of(replace(run, hydrodynamics=SurrogateHydrodynamics(one)), 0.0, 0.0).line
    assert "62 % of them within two standard deviations of their error bars" in line


def test_parts_of_the_error_say_what_was_not_measured(run):
    parts = dict(trust_of(run, 0.0, 0.0).parts)
    for name in ("flow made again", "other cells"):
        assert "not measured" not in parts[name]  # the card's vehicle is the one that was
    card = CARD | {"vehicle": "my car"}
    mine = SurrogateHydrodynamics([with_card(member, card) for member in MEMBERS])
    parts = dict(trust_of(replace(run, hydrodynamics=mine), 0.0, 0.0).parts)
    assert parts["model beside the flow"] == "2.3 %; at worst 3.4 %"
    assert parts["members of the ensemble"] == "two deviations of the ensemble hold 62 % of the loads kept apart"
    for name in ("flow made again", "other cells"):
        assert parts[name].startswith("not measured on my car; on the amphibious vehicle ")


def test_water_from_behind_is_within_along(run):
    behind = replace(run, water=Water.at_ratio(0.5, 1.0, current_direction=0.0))
    assert trust_of(behind, 0.0, 0.0).status == "measured"


def test_more_time_outside_the_range_is_said(run):
    found = trust_of(run, 0.5, 0.2)
    assert "outside the networks' training range for 50 % of the time (10 % of the time)" in found.line


def test_without_drives_nothing_is_validated(run, tmp_path):
    other = save_ensemble(MEMBERS, tmp_path / "other.safetensors", CARD | {"drives": []})
    found = trust_of(replace(run, hydrodynamics=SurrogateHydrodynamics(other)))
    assert found.status == "not validated" and "no drive was compared" in found.line


def test_drives_in_which_networks_hardly_answered_validate_nothing(run, tmp_path):
    drives = [one | {"fallback": 0.9} for one in CARD["drives"]]
    other = save_ensemble(MEMBERS, tmp_path / "other.safetensors", CARD | {"drives": drives})
    found = trust_of(replace(run, hydrodynamics=SurrogateHydrodynamics(other)))
    assert found.status == "not validated" and "the coefficients gave 90 % of the loads" in found.line
