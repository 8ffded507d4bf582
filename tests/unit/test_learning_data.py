"""The data set: packed runs, their names, and histories imported from other programs."""

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up_run
from scipy.spatial.transform import Rotation

from exumob import Soil, Water, lane_change, simulate
from exumob.learning.compact import DERIVED, GRAIN, compact, thinned
from exumob.learning.dataset import DOUBLE, VARIABLES, load_run, load_runs, pack, usable
from exumob.learning.evaluation import closed_loop
from exumob.learning.importing import import_histories
from exumob.paper.scenarios import DRAWN, TRAINING, UNSEEN, Scenario
from exumob.simulation.result_files import load_dataset, save_dataset
from exumob.simulation.verdict import FURTHER, NEEDED, VerdictLimits, judge
from exumob.vehicle.motion import BODIES
from vehicle_models.amphibious import amphibious_vehicle

WATER = Water.at_ratio(0.6, 1.0)
FLIP = np.array([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def run():
    """Start and a bit of steering, coefficient model."""
    maneuver = lane_change(np.radians(20.0), 8.0)
    return simulate(
        amphibious_vehicle(), Soil.published("LETE sand"), WATER, maneuver, "coefficients", duration=2.5,
        micro_step=5e-4, macro_step=5e-3, record_step=1e-3,
    )  # fmt: skip


# -- names -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["D60/U1", "D45/U0.75", "D50/U0.5/15deg", "D50/U0.5/-30deg", "D50/U0.5@20", "D50/U1@-7.5/-30deg"]
)
def test_scenario_keeps_its_name(name):
    assert Scenario.named(name).name == name


def test_scenario_says_water_and_steering():
    scenario = Scenario.named("D50/U0.5/15deg")
    water = scenario.water(amphibious_vehicle())
    assert (water.depth, water.current_speed) == (pytest.approx(0.1), 0.5)
    assert scenario.maneuver().amplitude == pytest.approx(np.radians(15.0))
    assert scenario.file_stem == "D50_U0.5_15deg"


def test_current_comes_from_the_left():
    """At 30 degrees it flows back and to the right."""
    water = Scenario.named("D60/U1@30").water(amphibious_vehicle())
    assert water.velocity == pytest.approx([-np.sqrt(0.75), -0.5, 0.0])
    assert Scenario.named("D60/U1").water(amphibious_vehicle()).current_direction == np.pi
    with pytest.raises(ValueError, match="current_angle"):
        Scenario(0.6, 1.0, current_angle=200.0)


@pytest.mark.parametrize("name", ["D60", "60/1", "D60/U1/15", "d60/u1", "D60/U1@", "D60@20/U1"])
def test_other_names_are_refused(name):
    with pytest.raises(ValueError, match="is not of the form"):
        Scenario.named(name)


def test_unseen_scenarios_are_not_trained_on():
    assert len(TRAINING) == 9
    assert len(UNSEEN) == 4
    assert not set(TRAINING) & set(UNSEEN)
    drawn, rng = [], np.random.default_rng(2026)
    for _ in DRAWN:
        depth, current = rng.uniform(0.4, 0.6), rng.uniform(0.0, 1.0)
        drawn.append(Scenario(round(depth, 2), round(current, 2)))
    assert tuple(drawn) == DRAWN and not set(DRAWN) & {*TRAINING, *UNSEEN}


# -- packed runs -------------------------------------------------------------------------------------------------------


def test_packed_run_holds_motion_and_loads(run, tmp_path):
    file = tmp_path / "run.nc"
    save_dataset(pack(run.assign_attrs(scenario="D60/U1")), file)
    packed = load_runs([file])["D60/U1"]
    assert set(VARIABLES) < set(packed.data_vars)
    assert all(v.dtype == (np.float64 if name in DOUBLE else np.float32) for name, v in packed.data_vars.items())
    assert packed["water_wrench"].values == pytest.approx(run["water_wrench"].values, rel=1e-6, abs=1e-6)
    assert "vehicle" in packed.attrs["parameters"]
    assert packed["water_wrench_smooth"].attrs["units"] == "N, N m"


def test_a_whole_result_is_packed_as_it_is_read(run, tmp_path):
    """What `exumob drive --output` writes may be put beside packed runs; one of longer intervals is refused."""
    file = save_dataset(run.assign_attrs(scenario="mine"), tmp_path / "mine.nc")
    xr.testing.assert_identical(load_runs([file])["mine"], pack(load_dataset(file)))
    rare = save_dataset(run.isel(time=slice(None, None, 10)), tmp_path / "rare.nc")
    with pytest.raises(ValueError, match=r"rare\.nc: the run is not sampled every 1 ms \(10 to 10 ms\)"):
        load_runs([rare])


def test_a_compact_run_is_a_third_as_large_and_the_same_but_for_rounding(run, tmp_path):
    packed = pack(run.assign_attrs(scenario="mine"))
    file, whole = save_dataset(compact(packed), tmp_path / "run.nc"), save_dataset(packed, tmp_path / "whole.nc")
    assert file.stat().st_size < 0.4 * whole.stat().st_size
    found = load_runs([file])["mine"]
    assert set(found.variables) == set(packed.variables)
    for name, v in packed.data_vars.items():
        assert found[name].attrs == v.attrs and found[name].dims == v.dims and found[name].dtype == v.dtype, name
        if v.dtype.kind != "f":
            continue
        off = np.abs(found[name].values - v.values)
        bound = GRAIN.get(name, 0.0) if name in GRAIN else 2.0**-10 * np.abs(v.values)
        if name in DERIVED:  # as far off as what they follow from
            bound = {"flow_state": 2e-3, "water_wrench_smooth": 1e-3 * np.abs(packed["water_wrench"].values).max()}.get(
                name, 2e-5
            )
        assert np.all((off <= bound) | np.isnan(off)), name
    xr.testing.assert_identical(compact(found), compact(packed))  # rounding is done once


@pytest.mark.parametrize("file", sorted((Path(__file__).parents[2] / "data").rglob("*.nc")), ids=lambda f: f.stem)
def test_every_run_that_comes_with_exumob_can_be_learnt_from(file):
    """Also those that were thinned before jumps were noted."""
    found = load_run(file)
    assert found.attrs["status"] == "completed" and usable(found).mean() > 0.95
    assert {"position", "water_wrench", "water_wrench_smooth", "flow_state"} <= set(found.variables)


def test_a_thinned_run_judges_as_the_whole_one(run, tmp_path):
    """A sixth of the size; motion as it was, loads to a hundredth of their deviation."""
    packed = pack(run.assign_attrs(scenario="mine"))
    file, whole = save_dataset(thinned(packed), tmp_path / "run.nc"), save_dataset(packed, tmp_path / "whole.nc")
    assert file.stat().st_size < 0.17 * whole.stat().st_size
    found = load_runs([file])["mine"]
    np.testing.assert_allclose(found["time"], packed["time"], atol=1e-9)
    for name, off in (("position", 2e-6), ("quaternion", 2e-5), ("velocity", 2e-3), ("flow_state", 5e-3)):
        assert np.abs(found[name].values - packed[name].values).max() < off, name
    late = slice(100, -100)  # the release is a jump
    a, b = (data["water_wrench_smooth"].values[late].astype(float) for data in (found, packed))
    assert np.sqrt(np.mean((a - b) ** 2)) < 0.01 * b.std()
    assert closed_loop(found, packed)["final"] < 1e-3
    fewer = load_runs([save_dataset(thinned(packed, every=10), tmp_path / "fewer.nc")])["mine"]
    assert (tmp_path / "fewer.nc").stat().st_size < 0.7 * file.stat().st_size
    np.testing.assert_allclose(fewer["time"], packed["time"][: fewer.sizes["time"]], atol=1e-9)
    assert np.abs(fewer["position"].values - packed["position"].values[: fewer.sizes["time"]]).max() < 1e-5
    even = thinned(packed, every=5)["water_wrench"].values[
        20:-20
    ]  # means over five samples, about the one that is kept
    about = np.mean([packed["water_wrench"].values[100 + k : -100 + k : 5][: len(even)] for k in range(-2, 3)], axis=0)
    assert np.abs(even - about).max() < 5e-3 * np.abs(about).max()
    with pytest.raises(ValueError, match=r"thinned.every = 7 leaves out the last of \d+ samples; give a divisor"):
        thinned(packed, every=7)


def test_a_thinned_run_keeps_all_that_it_is_asked_for_and_knows_its_jumps(run, tmp_path):
    """A jump of one sample is not seen among every fourth one, and must not be learnt from all the same."""
    packed = pack(run.assign_attrs(scenario="mine"))
    packed["water_wrench"][501, 0, 2] += 500.0
    assert np.flatnonzero(~usable(packed)).tolist() == list(range(481, 522))
    file = save_dataset(thinned(packed, None), tmp_path / "run.nc")
    found = load_runs([file])["mine"]
    assert set(found.variables) == set(packed.variables)
    assert np.flatnonzero(~usable(found)).tolist() == list(range(481, 522))
    for name in ("sinkage", "soil_force", "steering_angle"):
        off = np.abs(found[name].values - packed[name].values)[100:-100]
        assert off.max() < 0.02 * np.ptp(packed[name].values), name
    assert judge(found).sentence == judge(packed).sentence
    calm = load_runs([save_dataset(thinned(pack(run)), tmp_path / "calm.nc")]).popitem()[1]
    assert usable(calm)[100:].all()
    damaged = save_dataset(thinned(packed).assign_attrs(jumps="early"), tmp_path / "damaged.nc")
    with pytest.raises(ValueError, match=r"damaged\.nc: the attribute jumps is 'early', and must be times in seconds"):
        load_runs([damaged])


@pytest.mark.parametrize("every", [0, -4, "four", np.array([4, 4])], ids=str)
def test_a_thinned_run_that_does_not_say_how_much_is_refused_by_the_name_of_its_file(run, tmp_path, every):
    file = save_dataset(thinned(pack(run)).assign_attrs(thinned=every), tmp_path / "run.nc")
    with pytest.raises(ValueError, match=r"run\.nc: the attribute thinned is .*, and must be a whole number"):
        load_runs([file])


def test_smoothed_loads_are_not_late(run):
    """Against the raw ones moved by a few samples: nearest where they are not moved."""
    packed = pack(run)
    raw, smooth = (packed[name].values[:, 0, 0].astype(float) for name in ("water_wrench", "water_wrench_smooth"))
    apart = [np.abs(np.roll(raw, shift)[50:-50] - smooth[50:-50]).mean() for shift in (-10, -5, 0, 5, 10)]
    assert np.argmin(apart) == 2


def test_packed_run_keeps_its_verdict_and_can_be_judged_again(run):
    """Single precision changes the sentence by no digit; limits that make it stuck give the same onset."""
    packed = pack(run)
    assert packed.attrs["verdict"] == run.attrs["verdict"] == "drives"
    assert judge(packed).sentence == run.attrs["verdict_sentence"]
    strict = VerdictLimits(stuck_share=0.9)
    assert judge(packed, strict).kind == "stuck"
    assert judge(packed, strict).since == pytest.approx(judge(run, strict).since, abs=2e-3)


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ({"forward": lambda t: 0.8 if t < 1.0 else 0.0, "belly": 0.4}, "bottomed"),
        ({"forward": lambda t: 0.8 if t < 1.0 else 0.0}, "stuck"),
        ({"load": 0.02, "height": 0.4}, "afloat"),
        ({"height": -0.6}, "submerged"),
        ({"lateral": 0.9, "push": (0.0, 20.0)}, "swept away"),
        ({"lateral": 0.9, "push": (0.0, -20.0)}, "slides"),
        ({"lateral": -0.2, "steering": -0.4, "belly": lambda t: 0.2 if 1.0 < t < 1.1 else 0.0}, "drives"),
        ({"roll": 1.4}, "tipped"),
        ({"sinkage": 0.95}, "sunk"),
    ],
)
def test_packed_run_gets_the_verdict_of_the_run(run, values, kind):
    """Each kind of verdict: a variable that one of them depends on is not lost."""
    made_up = made_up_run(end=2.0, step=1e-3, **values)
    upright = {"quaternion": (("time", "body", "q"), np.tile([1.0, 0.0, 0.0, 0.0], (len(made_up["time"]), 5, 1)))}
    wrench = np.zeros((len(made_up["time"]), 5, 6))
    wrench[..., :3] = made_up["water_load"].values
    about = {"long_name": "loads of the water", "units": "N, N m"}
    whole = made_up.assign(upright | {"water_wrench": (("time", "body", "component"), wrench, about)})
    rest = {name: ("time", np.zeros(len(made_up["time"]))) for name in VARIABLES if name not in whole}
    packed = pack(whole.assign(rest))
    found, again = judge(whole), judge(packed)
    assert found.kind == kind
    assert (again.kind, again.sentence) == (found.kind, found.sentence)
    assert (again.flags == found.flags).all()


def test_verdict_depends_on_nothing_else_that_a_run_holds(run):
    """A run without all that no verdict is said to depend on gets the same one."""
    used = [name for name in run.data_vars if name in (*NEEDED, *FURTHER)]
    for limits in (VerdictLimits(), VerdictLimits(stuck_share=0.9), VerdictLimits(wheel_load=0.99)):
        whole, part = judge(run, limits), judge(run[used], limits)
        assert (part.kind, part.sentence) == (whole.kind, whole.sentence) and (part.flags == whole.flags).all()


def test_run_that_broke_down_is_not_packed(run):
    with pytest.raises(ValueError, match="not complete"):
        pack(run.assign_attrs(status="broke down at 1 s"))


def test_run_sampled_too_seldom_is_not_packed(run):
    with pytest.raises(ValueError, match=r"record_step=1e-3"):
        pack(run.isel(time=slice(None, None, 10)))


BAD_RUNS = [
    (lambda r: r["position"].values.fill(np.nan), r"position is not finite at 150 of 150 places, first at 0\.000 s"),
    (lambda r: r["velocity"].values.__setitem__((5, 0, 0), np.inf), r"velocity is not finite at 1 of 150"),
    (lambda r: r["water_wrench"].values.__setitem__((3, 1, 2), np.nan), r"water_wrench is not finite"),
    (
        lambda r: r["position"].values.__setitem__(slice(None), r["position"].values[:1]),
        r"no body moves by more than 0 m",
    ),
    (lambda r: r["position"].values.__imul__(1e3), r"a body moves at .* m/s, beyond the limit of 100 m/s"),
    (lambda r: r["water_wrench"].values.__imul__(1e30), r"forces of .* N are .* times what 0\.12 m of water exert"),
    (lambda r: r["water_wrench"].values.__imul__(1e4), r"forces of .* look at the unit of the loads"),
    (lambda r: r["water_wrench"].values[..., 3:].__imul__(1e5), r"moments of .* N m are"),
    (lambda r: r["water_wrench"].values.fill(0.0), r"all forces of the water are 0"),
    (lambda r: r["quaternion"].values.__imul__(2.0), r"quaternions have norms of 2 to 2"),
    (lambda r: r["time"].variable._data, None),
    (lambda r: r.attrs.update(parameters="{}"), r"do not say in which water"),
    (lambda r: r.attrs.update(parameters="[1]"), r"do not say in which water"),
    (lambda r: r.attrs.update(parameters="no JSON"), r"do not say in which water"),
    (lambda r: r.attrs.update(parameters='{"water": {"Water": {"depth": "a"}}}'), r"do not say in which water"),
    (lambda r: r.attrs.update(parameters='{"water": null}'), r"made without water"),
]


@pytest.mark.parametrize(("change", "message"), BAD_RUNS, ids=[str(message) for _, message in BAD_RUNS])
def test_runs_that_teach_nothing_are_refused(small, tmp_path, change, message):
    run = small.copy(deep=True).load()
    change(run)
    file = save_dataset(run, tmp_path / "bad.nc")
    if message is None:
        assert load_runs([file])
        return
    with pytest.raises(ValueError, match=message):
        load_runs([file])


@pytest.fixture(scope="module")
def small(run):
    """Ten samples of the packed run at full speed."""
    part = pack(run).isel(time=slice(2000, 2010))
    return part.assign_coords(time=part["time"] - part["time"][0])


def test_variables_of_another_shape_are_refused(small, tmp_path):
    flat = small.assign(position=small["position"].isel(axis=0))
    with pytest.raises(ValueError, match=r"position has shape \(10, 5\) of float64; it must be \(10, 5, 3\)"):
        load_runs([save_dataset(flat, tmp_path / "flat.nc")])
    with pytest.raises(ValueError, match="is not a run to learn from"):
        load_runs([save_dataset(small.drop_vars("velocity"), tmp_path / "less.nc")])
    (tmp_path / "torn.nc").write_bytes((tmp_path / "less.nc").read_bytes()[:3000])
    with pytest.raises(ValueError, match=r"torn\.nc cannot be read as netCDF-4"):
        load_runs([tmp_path / "torn.nc"])


def test_coordinates_of_a_map_keep_their_millimetres(run, tmp_path):
    """Positions near 5e6 m (UTM), packed and imported: exact to 1e-8 m, where single precision has steps of 0.5 m."""
    far = run.assign(position=run["position"] + np.array([5.0e5, 5.2e6, 0.0]))
    file = save_dataset(pack(far.assign_attrs(scenario="far")), tmp_path / "far.nc")
    packed = load_runs([file])["far"]
    assert np.abs(packed["position"].values - far["position"].values).max() < 1e-8
    columns = columns_of(far)
    found = import_histories(write_csv(tmp_path / "far.csv", columns, SI), WATER)
    assert np.abs(found["position"].values - far["position"].values).max() < 1e-4
    assert np.abs(found["velocity"].values - far["velocity"].values)[20:-20].max() < 0.01


# -- import ------------------------------------------------------------------------------------------------------------


def columns_of(run, length=1.0, force=1.0, degrees=True, flip=False, world=False, speeds=True, quaternion=False):
    """A run as another program might write it: names and values."""
    rotation = Rotation.from_quat(run["quaternion"].values.reshape(-1, 4), scalar_first=True).as_matrix()
    rotation = rotation.reshape(-1, 5, 3, 3)
    wrench = run["water_wrench"].values.reshape(-1, 5, 2, 3)
    if world:
        wrench = np.einsum("nbij,nbkj->nbki", rotation, wrench)
    f = FLIP if flip else np.ones(3)
    rotation, wrench = f[:, None] * rotation * f, wrench * f
    position, velocity = run["position"].values * f * length, run["velocity"].values * f
    found = {"time": run["time"].values}
    for b, body in enumerate(BODIES):
        turn = Rotation.from_matrix(rotation[:, b])
        found |= {f"{body}_{c}": position[:, b, k] for k, c in enumerate("xyz")}
        if quaternion:
            found |= {f"{body}_q{c}": turn.as_quat(scalar_first=True)[:, k] for k, c in enumerate("wxyz")}
        else:
            angles = turn.as_euler("ZYX", degrees=degrees)
            found |= {f"{body}_{c}": angles[:, k] for k, c in enumerate(("yaw", "pitch", "roll"))}
        if speeds:
            found |= {f"{body}_v{c}": velocity[:, b, k] for k, c in enumerate("xyz")}
        found |= {f"{body}_{'FM'[m]}{c}": wrench[:, b, m, k] * force for m in range(2) for k, c in enumerate("xyz")}
    return found


def write_csv(file, columns, units):
    kinds = {**dict.fromkeys(("x", "y", "z"), "length"), **dict.fromkeys(("roll", "pitch", "yaw"), "angle")}
    kinds |= {**dict.fromkeys(("vx", "vy", "vz"), "speed"), **dict.fromkeys(("Fx", "Fy", "Fz"), "force")}
    kinds |= {**dict.fromkeys(("Mx", "My", "Mz"), "moment"), "time": "time"}
    with file.open("w", newline="") as stream:
        writer = csv.writer(stream)
        kind = [kinds.get(name.rsplit("_", 1)[-1]) for name in columns]
        writer.writerow([f"{n} [{units[k]}]" if k in units else n for n, k in zip(columns, kind, strict=True)])
        writer.writerows(np.stack(list(columns.values()), axis=1).tolist())
    return file


SI = {"time": "s", "length": "m", "angle": "deg", "speed": "m/s", "force": "N", "moment": "N m"}


def assert_same_run(found, run, motion=1e-3, loads=1e-3):
    span = run["position"].values.max() - run["position"].values.min()
    assert np.abs(found["position"].values - run["position"].values).max() < motion * span
    late = slice(20, -20)
    for name, scale in (("velocity", 1.0), ("angular_velocity", 1.0), ("yaw", 1.0)):
        assert np.abs(found[name].values - run[name].values)[late].max() < 0.01 * scale
    size = np.abs(run["water_wrench"].values).max()
    assert np.abs(found["water_wrench"].values - run["water_wrench"].values).max() < loads * size
    assert np.abs(found["flow_state"].values - run["flow_state"].values)[200:-20].max() < 0.02


def test_own_run_comes_back_from_csv(run, tmp_path):
    file = write_csv(tmp_path / "theirs.csv", columns_of(run), SI)
    found = import_histories(file, WATER, scenario="D60/U1")
    with pytest.raises(ValueError, match="no wheel_speed, sinkage, soil_force; a verdict needs"):
        judge(found)
    assert_same_run(found, run)
    save_dataset(found, tmp_path / "found.nc")
    assert list(load_runs([tmp_path / "found.nc"])) == ["D60/U1"]


def test_other_units_axes_and_quaternions(run, tmp_path):
    columns = columns_of(run, length=1e3, force=1e-3, flip=True, world=True, quaternion=True, speeds=False)
    units = {"time": "s", "length": "mm", "force": "kN", "moment": "kN m"}
    found = import_histories(write_csv(tmp_path / "theirs.csv", columns, units), WATER, up="-z", load_axes="world")
    assert_same_run(found, run)


def test_names_and_units_given_by_hand_netcdf_and_coarser_samples(run, tmp_path):
    columns = {f"my {name}": values[::5] for name, values in columns_of(run, degrees=False).items()}
    file = tmp_path / "theirs.nc"
    xr.Dataset({name: ("n", values) for name, values in columns.items()}).to_netcdf(file, engine="h5netcdf")
    names = {name.removeprefix("my "): name for name in columns}
    found = import_histories(file, WATER, names=names, units=SI | {"angle": "rad"})
    assert found.sizes["time"] == 2501
    assert_same_run(found, run, loads=2e-2)


@pytest.mark.parametrize(
    ("change", "given", "message"),
    [
        (lambda c: c.pop("rear_left_Fz"), {}, "has no column 'rear_left_Fz'"),
        (lambda c: c.update(hull_Fx=np.full(len(c["time"]), np.nan)), {}, "'hull_Fx' is not a number in row 0"),
        (lambda c: c.update(time=c["time"][::-1]), {}, "time must rise"),
        (lambda c: c.update(time=20.0 * c["time"]), {}, "samples lie 20 ms apart"),
        (lambda c: c.update(time=c["time"] + 4e-4 * (np.arange(len(c["time"])) % 2)), {}, "samples are uneven"),
        (lambda c: None, {"up": "-z"}, "y must|y to the left"),
        (lambda c: c.update({f"{b}_vx": 3.6 * c[f"{b}_vx"] for b in BODIES}), {}, "given speeds differ"),
        (lambda c: c.update({f"{b}_Fz": -c[f"{b}_Fz"] for b in BODIES}), {}, "pulls the vehicle down"),
        (lambda c: c.update(hull_yaw=40.0 * np.sin(3.0 * c["time"])), {}, "contradict each other"),
        (lambda c: None, {"units": {"mass": "kg"}}, "mass is not a kind"),
        (lambda c: None, {"load_axes": "ship"}, "load_axes = 'ship'"),
        (
            lambda c: c.update({n: 1e30 * v for n, v in c.items() if n[-2] in "FM"}),
            {},
            "forces of .* times what",
        ),
        (lambda c: c.update({n: 1e4 * v for n, v in c.items() if n[-2] == "M"}), {}, "moments of .* look at the unit"),
        (lambda c: c.update({n: 0.0 * v for n, v in c.items() if n[-2] == "F"}), {}, "all forces of the water are 0"),
        (
            lambda c: c.update({n: 0.0 * v + v[0] for n, v in c.items() if n != "time"}),
            {},
            "no body moves by more than 0",
        ),
        (lambda c: c.update({n: 1e3 * v for n, v in c.items() if n[-2:] in ("_x", "_y", "_z")}), {}, "a body moves at"),
        (lambda c: c.update({n: 1e300 * v for n, v in c.items() if n[-2:] in ("_x", "_y")}), {}, "a body moves at"),
        (lambda c: None, {"bed": float("nan")}, "bed"),
        (lambda c: None, {"units": 3}, "units"),
    ],
)
def test_what_contradicts_itself_is_refused(run, tmp_path, change, given, message):
    columns = columns_of(run)
    change(columns)
    file = write_csv(tmp_path / "theirs.csv", columns, SI)
    with pytest.raises(ValueError, match=message):
        import_histories(file, WATER, **given)


def test_no_unit_is_guessed(run, tmp_path):
    file = write_csv(tmp_path / "theirs.csv", columns_of(run), {k: v for k, v in SI.items() if k != "force"})
    with pytest.raises(ValueError, match=r"'hull_Fx' carries no unit"):
        import_histories(file, WATER)
    with pytest.raises(ValueError, match="unit 'lb' of"):
        import_histories(file, WATER, units={"force": "lb"})
