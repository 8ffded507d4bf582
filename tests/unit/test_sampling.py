"""What is varied and how: names, grids, distributions, correlations, study files."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from exumob.driving.maneuver import ConstantSteer
from exumob.ground.soil import Soil
from exumob.support.identity import differences, users_identity
from exumob.support.quantities import ImplausibleValue
from exumob.surrogates.ensemble import save_ensemble
from exumob.surrogates.model import SurrogateHydrodynamics
from exumob.sweeps import Choice, Experiment, LogNormal, Normal, Triangular, Uniform, as_grid, grid, sample
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.sweeps.run import _check_cases
from exumob.sweeps.sampling import Range
from exumob.sweeps.study import from_options, parse_variation, read_study
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.coefficients import CoefficientHydrodynamics
from exumob.water.conditions import Water
from exumob.water.hydrodynamics import NoWater

# -- names -------------------------------------------------------------------------------------------------------------


def test_every_field_is_set_by_its_name():
    base = amphibious_lane_change()
    values = {
        "hull.mass": 60.0, "wheel.width": 0.07, "suspension.stiffness": 5000.0, "wheelbase": 0.75, "soil.n": 0.9,
        "water.depth": 0.11, "water.current_speed": 0.3, "maneuver.amplitude": 0.2, "hydrodynamics": "coefficients",
        "hydrodynamics.hull_surge_drag": 1.1, "macro_step": 5e-3, "steering.limit": 0.6,
    }  # fmt: skip
    changed = base.with_values(values)
    assert changed.vehicle.hull.mass == 60.0 and changed.vehicle.hull.length == base.vehicle.hull.length
    assert changed.vehicle.wheel.width == 0.07 and changed.vehicle.suspension.stiffness == 5000.0
    assert changed.vehicle.wheelbase == 0.75 and changed.vehicle.steering.limit == 0.6
    assert changed.soil.n == 0.9 and changed.soil.cohesion == base.soil.cohesion
    assert (changed.water.depth, changed.water.current_speed) == (0.11, 0.3)
    assert changed.maneuver.amplitude == 0.2 and changed.macro_step == 5e-3
    model = changed.water_model()
    assert isinstance(model, CoefficientHydrodynamics) and model.coefficients.hull_surge_drag == 1.1
    assert base == amphibious_lane_change()  # nothing of the base changes


def test_soil_by_name_comes_before_its_fields():
    changed = amphibious_lane_change().with_values({"soil.cohesion": 500.0, "soil": "Sandy loam 11 %"})
    assert changed.soil.cohesion == 500.0 and changed.soil.k_phi == Soil.published("Sandy loam 11 %").k_phi


def test_depth_ratio_follows_the_tyre():
    changed = amphibious_lane_change().with_values({"water.depth_ratio": 0.5, "wheel.diameter": 0.22})
    assert changed.water.depth == pytest.approx(0.11)
    dry = changed.with_values({"water.depth_ratio": 0.0})
    assert dry.water is None and isinstance(dry.water_model(), NoWater)


def test_members_of_the_ensemble_by_number():
    base = amphibious_lane_change()
    one = base.with_values({"hydrodynamics.member": 3}).water_model()
    assert isinstance(one, SurrogateHydrodynamics) and one.networks[0].about["seed"] == 3
    with pytest.raises(ValueError, match="there are 5, from 0 on"):
        base.with_values({"hydrodynamics.member": 7}).water_model()


def test_networks_of_ones_own_give_the_loads_of_all_cases(tmp_path):
    """A file with two networks of the five, by name and by path; its contents tell one sweep from another."""
    shipped = SurrogateHydrodynamics().networks
    file = save_ensemble(shipped[:2], tmp_path / "mine.safetensors")
    base = amphibious_lane_change()
    mine = base.with_networks([str(file)])
    assert mine.networks == (file,) and mine.member_count() == 2
    assert mine.with_one_model([{"soil.n": 0.9}]).hydrodynamics == "networks"
    assert [n.digest() for n in mine.water_model().networks] == [n.digest() for n in shipped[:2]]
    assert mine.with_values({"hydrodynamics.member": 1}).water_model().networks[0].about["seed"] == 1
    assert mine.with_values({"hydrodynamics": "calibrated"}).water_model().waves.digest() == shipped[0].waves.digest()
    assert base.with_networks(["paper-lstm"], tmp_path).water_model().networks[0].name.startswith("paper-lstm")
    before = users_identity(mine)
    save_ensemble(shipped[2:4], file)
    said = differences(before.values, users_identity(mine).values)
    assert "ensemble was" in said and "mine.safetensors" in said
    with pytest.raises(ValueError, match=r"\(.*mine\.safetensors\) have no effect with hydrodynamics = 'coeff"):
        base.with_values({"hydrodynamics": "coefficients"}).with_networks([file])
    assert isinstance(mine.with_values({"hydrodynamics": "coefficients"}).water_model(), CoefficientHydrodynamics)
    with pytest.raises(ValueError, match="networks names a file twice"):
        base.with_networks([file, file])
    with pytest.raises(ValueError, match=r"no_such\.safetensors does not exist"):
        base.with_networks(["no_such.safetensors"], tmp_path)
    with pytest.raises(ValueError, match="they were trained with"):
        mine.with_values({"hull.length": 1.2}).with_one_model().water_model()


def test_networks_of_a_study_file_lie_beside_it(tmp_path, monkeypatch):
    """Or come with exumob; one name or several."""
    (tmp_path / "sub").mkdir()
    save_ensemble(SurrogateHydrodynamics().networks[:2], tmp_path / "sub" / "mine.safetensors")
    monkeypatch.chdir(tmp_path)
    study = tmp_path / "sub" / "study.toml"
    for text, members in (('"mine.safetensors"', 2), ('["paper-lstm"]', 1), ('["mine.safetensors"]', 2)):
        study.write_text(f"[base]\nnetworks = {text}\n[vary]\nwater.current_speed = [0.0, 1.0]\n")
        experiment, cases = read_study(study)
        assert experiment.member_count() == members and len(cases) == 2
    for text, word in (("3", r"base\.networks = 3 must be the name"), ('"other.safetensors"', "does not exist")):
        study.write_text(f"[base]\nnetworks = {text}\n[vary]\nwater.current_speed = [0.0, 1.0]\n")
        with pytest.raises(ValueError, match=word):
            read_study(study)
    vary = "[vary]\nwater.current_speed = [0.0, 1.0]\n"
    study.write_text('[base]\nnetwork = "mine.safetensors"\n' + vary)
    with pytest.raises(ValueError, match=r"base\.network is not known; did you mean networks\?"):
        read_study(study)
    study.write_text('[base]\nnetworks = "mine.safetensors"\nhull.length = 1.2\n' + vary)
    with pytest.raises(ValueError, match=r"study\.toml: networks \(.*another shape.*amphibious: hull\.length"):
        read_study(study)


def test_bad_names_and_values_are_named():
    base = amphibious_lane_change()
    with pytest.raises(ValueError, match=r"'hull.mas' is not known; did you mean hull.mass"):
        base.with_values({"hull.mas": 1.0})
    with pytest.raises(ValueError, match=r"Soil\.n"):
        base.with_values({"soil.n": -1.0})
    with pytest.raises(ValueError, match="hydrodynamics = 'magic' is not known"):
        base.with_values({"hydrodynamics": "magic"})
    with pytest.raises(ValueError, match="they were trained with"):
        base.with_values({"hydrodynamics": "networks", "hull.length": 1.2}).check()


@pytest.mark.usefixtures("fresh_warnings")
def test_one_model_serves_all_cases(caplog):
    """A sweep over the hull's length must not compare networks with coefficients."""
    base = amphibious_lane_change()
    assert base.hydrodynamics == "auto"
    assert base.with_one_model([{"soil.n": 0.9}, {"hull.length": 1.0}]).hydrodynamics == "networks"
    assert base.with_one_model([{"hull.length": 1.0}, {"hull.length": 1.2}]).hydrodynamics == "calibrated"
    assert "hull.length = 1.2" in caplog.text
    chosen = replace(base, hydrodynamics="coefficients")
    assert chosen.with_one_model([{"soil.n": 0.9}]) is chosen
    dry = replace(base, water=None)
    assert dry.with_one_model([{"soil.n": 0.9}]) is dry
    assert base.with_values({"hydrodynamics.member": 1}).hydrodynamics == "networks"
    other = base.with_values({"hull.length": 1.2}).with_one_model([{"hydrodynamics.member": 1}])
    with pytest.raises(ValueError, match="they were trained with"):  # members of networks that do not fit
        other.water_model()


# -- samples -----------------------------------------------------------------------------------------------------------


def test_grid_has_all_combinations():
    cases = grid({"a": [1, 2], "b": ["x", "y", "z"]})
    assert len(cases) == 6 and cases[0] == {"a": 1, "b": "x"} and cases[1] == {"a": 1, "b": "y"}
    with pytest.raises(ValueError, match="b has no values"):
        grid({"a": [1], "b": []})


@pytest.mark.parametrize("method", ["sobol", "halton", "lhs", "random"])
def test_samples_have_their_distributions(method):
    """Spec: Kolmogorov-Smirnov distance below 0.05 at 1,024 draws (5 % limit of random draws: 0.042)."""
    given = {
        "u": (Uniform(2.0, 3.0), stats.uniform(2.0, 1.0)),
        "n": (Normal(10.0, 2.0, low=8.0), stats.truncnorm(-1.0, math.inf, loc=10.0, scale=2.0)),
        "l": (LogNormal(5.0, 0.3), stats.lognorm(0.3, scale=5.0)),
        "t": (Triangular(0.0, 1.0, 4.0), stats.triang(0.25, scale=4.0)),
    }
    cases = sample(1024, {name: d for name, (d, _) in given.items()}, method=method, seed=3)
    for name, (_, reference) in given.items():
        assert stats.kstest([case[name] for case in cases], reference.cdf).statistic < 0.05
    again = sample(1024, {name: d for name, (d, _) in given.items()}, method=method, seed=3)
    assert cases == again != sample(1024, {name: d for name, (d, _) in given.items()}, method=method, seed=4)


def test_choice_has_its_weights():
    cases = sample(4096, {"soil": Choice(("sand", "clay"), (3.0, 1.0))})
    assert np.mean([case["soil"] == "sand" for case in cases]) == pytest.approx(0.75, abs=0.01)


def test_correlations_are_kept():
    """Normal margins: their own correlation is the one asked for (spec: 0.02 at 4,096 quasi-random draws)."""
    given = {"a": Normal(0.0, 1.0), "b": Normal(5.0, 2.0), "c": Uniform(0.0, 1.0)}
    cases = sample(4096, given, correlations={("a", "b"): -0.6})
    a, b, c = (np.array([case[name] for case in cases]) for name in given)
    assert np.corrcoef(a, b)[0, 1] == pytest.approx(-0.6, abs=0.02)
    assert np.corrcoef(a, c)[0, 1] == pytest.approx(0.0, abs=0.02)
    assert b.std() == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("call, word", [
    (lambda: sample(8, {"a": Uniform(0.0, 1.0)}, correlations={("a", "b"): 0.5}), "'b' has no distribution"),
    (lambda: sample(8, {"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0)}, correlations={("a", "b"): 1.5}), "between"),
    (lambda: sample(8, {k: Uniform(0.0, 1.0) for k in "abc"},
                    correlations={("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.9}), "contradict"),
    (lambda: sample(8, {"a": Uniform(0.0, 1.0)}, method="magic"), "'magic' is not known"),
    (lambda: sample(8, {}), "no distributions"),
    (lambda: Uniform(1.0, 1.0), "Uniform.low = 1.0 must be below"),
    (lambda: Normal(0.0, 0.0), "Normal.deviation"),
    (lambda: Triangular(0.0, 2.0, 1.0), "Triangular.mode"),
    (lambda: Choice(()), "Choice.values is empty"),
    (lambda: Choice((1, 2), (1.0,)), "Choice.weights"),
    (lambda: Choice((1, 2), (1.0, math.nan)), "Choice.weights"), (lambda: Choice(3), "Choice.values = 3"),
    (lambda: Normal(0.0, 1.0, "a", "b"), "Normal.low = 'a'"), (lambda: Normal(0.0, 1.0, 40.0, 41.0), "cut off all but"),
    (lambda: Normal(math.inf, 1.0), "Normal.mean"), (lambda: Uniform(0.0, 10**400), "Uniform.high"),
    (lambda: Uniform(-1e308, 1e308), "Uniform.low"), (lambda: LogNormal(1.0, 1e3), "LogNormal.spread"),
    (lambda: sample(1.5, {"a": Uniform(0.0, 1.0)}), "sample.number = 1.5"),
    (lambda: sample(0, {"a": Uniform(0.0, 1.0)}), "sample.number = 0"),
    (lambda: sample(True, {"a": Uniform(0.0, 1.0)}), "sample.number = True"),
    (lambda: sample(10**12, {"a": Uniform(0.0, 1.0)}), "1,000,000,000,000 cases are too many"),
    (lambda: sample(8, {"a": Uniform(0.0, 1.0)}, seed=-1), "sample.seed = -1"),
    (lambda: sample(8, {"a": 3.0}), "a = 3.0 is no distribution"), (lambda: sample(8, [1]), "sample.distributions"),
    (lambda: sample(8, {"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0)}, correlations={"ab": 0.5}), "two different"),
    (lambda: sample(8, {"a": Uniform(0.0, 1.0), "b": Uniform(0.0, 1.0)}, correlations={("a", "b"): "x"}), "a number"),
    (lambda: grid({"a": 3}), "a = 3 must be a list"), (lambda: grid({"a": "abc"}), "must be a list"),
    (lambda: grid({"a": [1, 2, 1.0]}), "a = 1.0 stands twice"), (lambda: grid({"a": np.ones(2)}), "stands twice"),
    (lambda: grid({"a": np.ma.masked_equal([1, 2], 1)}), "masked values"),
    (lambda: grid({"a": {1, 2}}), "in their order"), (lambda: grid([1]), "grid.values"),
    (lambda: grid({"a": range(10**6), "b": range(10**6)}), "1,000,000,000,000 cases are too many"),
])  # fmt: skip
def test_bad_distributions_are_named(call, word):
    with pytest.raises(ValueError, match=word):
        call()


def test_grid_of_results_gets_its_dimensions():
    cases = grid({"a": [1.0, 2.0], "b": [10.0, 20.0, 30.0]})
    flat = xr.Dataset(
        {"v": ("case", [c["a"] * c["b"] for c in cases])},
        {"case": range(6), "a": ("case", [c["a"] for c in cases]), "b": ("case", [c["b"] for c in cases])},
        {"parameters": "a b"},
    )
    full = as_grid(flat)
    assert full["v"].dims == ("a", "b") and float(full["v"].sel(a=2.0, b=30.0)) == 60.0
    with pytest.raises(ValueError, match="not a full grid"):
        as_grid(flat.isel(case=slice(5)))


# -- text --------------------------------------------------------------------------------------------------------------


def test_variations_as_text():
    assert parse_variation("water.current_speed=0,0.5,1") == ("water.current_speed", [0, 0.5, 1])
    assert parse_variation("soil=LETE sand,Sandy loam 11 %") == ("soil", ["LETE sand", "Sandy loam 11 %"])
    name, values = parse_variation("hull.mass=40:60:3")
    assert (name, list(values)) == ("hull.mass", [40.0, 50.0, 60.0])
    assert parse_variation("soil.n~normal(0.8, 0.1)") == ("soil.n", Normal(0.8, 0.1))
    for bad, word in (
        ("hull.mass", "write name=0,0.5,1"), ("a~normal(1", "write name"), ("a~magic(1)", "'magic' is not known"),
        ("a~normal(1,2,3,4,5)", "takes other parameters"), ("a=1:2:x", "a range needs"),
        ("hull.mass=49:53", "a range needs from:to:number"), ("a=1:", "a range needs from:to:number"),
        ("a=1:2:3:4", "a range needs from:to:number"), ("a~normal(1300)", r"give normal\(mean, deviation\)"),
        ("a~uniform(1)", r"give uniform\(low, high\)"), ("a~lognormal(1)", r"give lognormal\(median, spread\)"),
        ("a~triangular(1,2)", r"give triangular\(low, mode, high\)"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=word):
            parse_variation(bad)


def test_options_make_a_grid_of_samples():
    experiment, cases = from_options(
        None, ["duration=0.5", "soil=Sandy loam 11 %"], ["water.depth_ratio=0.4,0.6", "hull.mass~uniform(45,50)"], 4, 7
    )  # fmt: skip
    assert experiment.duration == 0.5 and experiment.soil == Soil.published("Sandy loam 11 %")
    assert len(cases) == 8 and {c["water.depth_ratio"] for c in cases} == {0.4, 0.6}
    assert len({c["hull.mass"] for c in cases}) == 4 and all(45 < c["hull.mass"] < 50 for c in cases)
    with pytest.raises(ValueError, match="nothing varies"):
        from_options(None, [], [], 4, 0)


def test_study_file(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(
        'base.soil = "Sandy loam 11 %"\nbase.duration = 2\n[vary]\nwater.current_speed = [0.0, 1.0]\n'
        "hull.mass = { from = 40, to = 50, number = 3 }\n[sample]\nnumber = 4\nseed = 2\n"
        "[sample.distributions]\nsoil.n = { normal = [0.8, 0.05] }\nsoil.cohesion = { uniform = [800, 1200] }\n"
        'wheel.width = [0.07, 0.08]\n[sample.correlations]\n"soil.n, soil.cohesion" = 0.5\n'
    )
    experiment, cases = read_study(file)
    assert isinstance(experiment, Experiment) and experiment.duration == 2.0
    assert experiment.water == Water.at_ratio(0.6, 1.0)
    assert len(cases) == 2 * 3 * 4 and set(cases[0]) == {
        "water.current_speed", "hull.mass", "soil.n", "soil.cohesion", "wheel.width"
    }  # fmt: skip


@pytest.mark.parametrize("text, word", [
    ("[bass]\nduration = 1\n", "'bass' is not known"),
    ("[base]\nhull.mas = 1\n[vary]\nhull.mass = [1]\n", "did you mean hull.mass"),
    ("[vary]\nhull.mass = { from = 1, to = 2 }\n", "a range needs"),
    ("[sample]\nnumbers = 3\n", "'numbers' is not known"),
    ("[sample.distributions]\nsoil.n = { magic = [1] }\n", "not known"),
    ("[base\n", "is not TOML"),
    ("", "nothing varies"),
    ("base = 3\n", "base = 3 must be a table"), ("vary = []\n", r"vary = \[\] must be a table"),
    ("sample = []\n", r"sample = \[\] must be a table"),
    ("sample.correlations = 3\n", "correlations = 3 must be a table"),
    ("sample.distributions = 3\n", "distributions = 3 must be a table"), ("unusual = 1\n", "unusual = 1 must be true"),
    ("base.soil = [3]\n", r"soil = \[3\] must be the name"), ("base.soil = 3\n", "soil = 3 must be the name"),
    ("base.vehicle = 3\n", "base.vehicle = 3 must be the name of a file"),
    ('base.vehicle = "no.py"\n', "no.py does not exist"), ("base.maneuver = 3\n", "maneuver = 3"),
    ("base.duration = 1979-05-27\n", "duration = datetime.date"), ("base.duration = true\n", "duration = True"),
    ("base.hull.mass = [1, 2]\n", "Hull.mass = "), ("base.water = {}\n", "'water' is not known"),
    ("[vary]\nhull.mass = { from = 1, to = 2, number = 2.5 }\n", "a range needs"),
    ("[vary]\nhull.mass = { from = 1, to = 2, numbr = 2 }\n", "'numbr' is not known; did you mean number"),
    ("[vary]\nhull.mass = { from = nan, to = 2, number = 2 }\n", "must be finite"),
    ("[vary]\nhull.mass = { from = 1, to = 1, number = 2 }\n", "all the same"),
    ("[vary]\nhull.mass = []\n", "hull.mass has no values"), ("[vary]\nhull.mas = [1]\n", r"did you mean hull\.mass"),
    ("[vary]\nhull.mass = { from = 1, to = 2, number = 10000000000 }\n", "10,000,000,000 cases are too many"),
    ("[sample]\nnumber = 4\n", "draws nothing"),
    ("[sample]\nnumber = '4'\ndistributions.soil.n = { uniform = [0.5, 1] }\n", "sample.number = '4'"),
    ("[sample]\nseed = -1\ndistributions.soil.n = { uniform = [0.5, 1] }\n", "sample.seed = -1"),
    ("[sample]\nseed = 1.5\ndistributions.soil.n = { uniform = [0.5, 1] }\n", "sample.seed = 1.5"),
    ("[sample]\nmethod = 3\ndistributions.soil.n = { uniform = [0.5, 1] }\n", "sample.method = 3"),
    ("[sample.distributions]\nsoil.n = { uniform = 3 }\n", "uniform = 3 must be a list"),
    ("[sample.distributions]\nsoil.n = { unifrom = [0, 1] }\n", "'unifrom' is not known; did you mean uniform"),
    ("[sample.distributions]\nsoil.n = { uniform = ['a', 'b'] }\n", "soil.n: Uniform.low = 'a'"),
    ("[sample.distributions]\nsoil.n = 3\n", "soil.n = 3: a distribution is"),
    ("[sample]\ndistributions.soil.n = { uniform = [0.5, 1] }\ncorrelations.a = 1\n", "'a' must name two"),
    ("[sample]\ndistributions.soil.n = { uniform = [0.5, 1] }\ncorrelations.'soil.n,soil.n' = 1\n", "different"),
    ("[vary]\nsoil.n = [1]\n[sample]\ndistributions.soil.n = { uniform = [0.5, 1] }\n", "keep one"),
    ('[base]\nsoil.n = 1.0\n"soil.n" = 0.9\n', "soil.n is given twice"),
    ('[base]\nmaneuver = "straight"\n[base.maneuver]\nspeed = 4\n', 'write soil = "..." and "soil.cohesion"'),
    ("[base]\nhull.mass = 1\nhull.mass = 2\n", "is not TOML"), ("a = " + "[" * 5000, "is not TOML"),
])  # fmt: skip
def test_bad_study_files_are_named(text, word, tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(text)
    with pytest.raises(ValueError, match=word) as error:
        read_study(file)
    assert "study.toml" in str(error.value)


@pytest.mark.parametrize("above, dotted", [("[base]\n", ""), ("", "base.")])
def test_a_choice_may_stand_beside_its_fields(above, dotted, tmp_path):
    """As everybody writes it, though TOML by itself forbids it."""
    file = tmp_path / "study.toml"
    lines = ['maneuver = "straight"', "maneuver.speed = 4.0", "soil.cohesion = 900", 'soil = "Sandy loam 11 %"']
    file.write_text(above + "".join(f"{dotted}{line}\n" for line in lines) + "[vary]\nmaneuver.angle = [0.0, 0.1]\n")
    experiment, cases = read_study(file)
    assert experiment.maneuver == ConstantSteer(speed=4.0) and experiment.soil.cohesion == 900.0
    assert cases == [{"maneuver.angle": 0.0}, {"maneuver.angle": 0.1}]


def test_study_files_of_other_editors_are_read(tmp_path):
    file = tmp_path / "study.toml"
    text = '[base]\nsoil = "LETE sand"\n[vary]\nhull.mass = [48.0]\n'
    for data in (text.encode("utf-8-sig"), text.replace("\n", "\r\n").encode()):
        file.write_bytes(data)
        assert read_study(file)[1] == [{"hull.mass": 48.0}]
    file.write_bytes('[base]\nsoil = "Größe"\n'.encode("latin-1"))
    with pytest.raises(ValueError, match=r"study\.toml is not TOML: line 2 is not UTF-8"):
        read_study(file)
    with pytest.raises(ValueError, match="cannot be read"):
        read_study(tmp_path)
    with pytest.raises(ValueError, match="does not exist"):
        read_study(tmp_path / "no.toml")


def test_paths_of_a_study_file_count_from_its_folder(tmp_path):
    (tmp_path / "hull.stl").write_text("a hull")
    file = tmp_path / "study.toml"
    file.write_text('base.hull.mesh = "hull.stl"\nvary.hull.mass = [48.0]\n')
    assert read_study(file)[0].vehicle.hull.mesh == tmp_path / "hull.stl"


def test_unusual_draws_pass_if_that_is_said():
    """As at the command line; whole numbers and names stay what they are."""
    experiment = amphibious_lane_change()
    drawn = {
        "water.density": Normal(13_534.0, 10.0), "hydrodynamics.member": Choice((0, 1)), "hull.mass": Choice((0.002,)),
    }  # fmt: skip
    plain, marked = (sample(4, drawn, seed=1, unusual=unusual) for unusual in (False, True))
    assert plain == marked and {type(case["hydrodynamics.member"]) for case in marked} == {int}
    with pytest.raises(ValueError, match="plausible"):
        _check_cases(experiment, plain)
    _check_cases(experiment, marked)


def test_unusual_values_pass_if_that_is_said(tmp_path):
    file = tmp_path / "study.toml"
    text = "base.water.density = 13534.0\nvary.water.current_speed = [0.0, 18.0]\n"
    file.write_text(text)
    with pytest.raises(ValueError, match="plausible"):
        read_study(file)
    file.write_text("unusual = true\n" + text)
    experiment, cases = read_study(file)
    assert experiment.water.density == 13534.0
    _check_cases(experiment, cases)
    with pytest.raises(ValueError, match=r"water\.depth_ratio = -1"):
        from_options(None, ["water.depth_ratio=-1"], ["hull.mass=40,50"], 4, 0, unusual_values=True)


@pytest.mark.parametrize("varied, word", [
    (["hull.mass=1:2:1e10"], "10,000,000,000 cases are too many .*on the disk.*give 10,000,000 at most"),
    (["hull.mass=1:2:10000", "soil.n=0.5:1:10000"], "100,000,000 cases are too many"),
    (["hull.mass=1:2:1e300"], "more than 10.300 cases are too many"),
    (["hull.mass~uniform(40,50)"], "cases are too many"),
    (["hull.mass=40,50", "hull.mass=60"], "varied twice"), (["hull.mass="], "a value is missing"),
    (["hull.mass=40,,50"], "a value is missing"), (["hull.mass=1:2:-3"], "a range needs"),
])  # fmt: skip
def test_bad_variations_are_named_at_once(varied, word):
    """Nothing is made of a range before it is counted."""
    with pytest.raises(ValueError, match=word):
        from_options(None, [], varied, 10**9, 0)


def test_ranges_have_the_values_of_linspace():
    for begin, end, number in ((0.1, 0.7, 7), (40.0, 60.0, 3), (-1.0, 3.0, 1000), (2.0, 5.0, 1)):
        assert list(Range(begin, end, number)) == np.linspace(begin, end, number).tolist()
    endless = Range(0.0, 1.0, 10**18)
    assert len(endless) == 10**18 and endless[-1] == 1.0 and endless[5 * 10**17] == pytest.approx(0.5)


def test_values_can_be_asked_for_by_the_names_that_set_them():
    model = amphibious_lane_change()
    for name in model.names():
        if name in ("vehicle", "hull.mesh"):
            continue
        value = model.value(name)
        if isinstance(value, int | float) and name != "water.depth_ratio":
            assert model.with_values({name: value}).value(name) == value
    assert model.value("hull.mass") == model.vehicle.hull.mass
    assert model.value("water.depth_ratio") == pytest.approx(0.6)
    assert model.with_values({"water.depth_ratio": 0.0}).value("water.depth_ratio") == 0.0
    with pytest.raises(ValueError, match=r"did you mean hull\.mass"):
        model.value("hull.mas")


def test_maneuvers_have_names():
    model = amphibious_lane_change().with_values({"maneuver": "path following", "maneuver.gain": 3.0})
    assert model.maneuver.gain == 3.0
    assert model.value("maneuver.gain") == 3.0
    with pytest.raises(ValueError, match="'lane change', 'straight', 'path following'"):
        model.with_values({"maneuver": "slalom"})


@pytest.mark.parametrize("drawn", [
    "soil.cohesion~normal(300,120)", "soil.k_phi~lognormal(9000,0.4)", "soil.cohesion~uniform(1,600)",
    "soil.cohesion~triangular(1,2,2000)",
])  # fmt: skip
def test_the_tail_of_a_plausible_distribution_passes(drawn):
    """Single draws lie below the lower end of what is plausible; the median does not."""
    experiment, cases = from_options(None, ["soil=Sandy loam 22 %"], [drawn], 64, 0)
    (name,) = cases[0]
    low = min(case[name] for case in cases)
    with pytest.raises(ImplausibleValue):
        experiment.with_values({name: float(low)})
    experiment.check_values(name, [case[name] for case in cases])
    assert experiment.with_values({name: low}).value(name) == low


@pytest.mark.parametrize(
    "drawn", ["soil.cohesion~normal(1.3,0.2)", "soil.k_phi~uniform(3,9)", "soil.cohesion~uniform(1,20)"]
)
def test_a_distribution_in_another_unit_is_refused_by_its_median(drawn):
    with pytest.raises(ValueError, match=r"the median of what .* is drawn from.*"):
        from_options(None, [], [drawn], 8, 0)
    assert len(from_options(None, [], [drawn], 8, 0, True)[1]) == 8


def test_coefficients_of_ones_own_go_with_no_networks():
    """They were varied with networks, which do not know of them, and nothing changed."""
    base, name = amphibious_lane_change(), "hydrodynamics.hull_surge_drag"
    assert type(base.with_values({name: 1.1}).water_model()) is CalibratedHydrodynamics
    assert base.with_one_model([{name: 0.9}, {name: 1.1}]).hydrodynamics == "calibrated"
    with pytest.raises(ValueError, match=r"no effect on networks.*take hydrodynamics='calibrated'"):
        base.with_values({name: 1.1, "hydrodynamics": "networks"}).water_model()
