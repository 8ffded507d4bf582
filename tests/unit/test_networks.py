"""Networks: their file, their inputs, their answers with and without torch, and as a model of the water."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from damage import damage
from made_up_networks import SMALL, made_up, residual
from typer.testing import CliRunner

from exumob.__main__ import app
from exumob.driving.maneuver import lane_change
from exumob.learning.dataset import body_states, usable, water_of
from exumob.paper.scenarios import UNSEEN
from exumob.simulation.result_files import save_dataset
from exumob.simulation.run import simulate
from exumob.surrogates.inputs import INPUTS, MIRRORED_BODIES, MIRRORED_LOADS, mirror_signs, network_inputs, window_rows
from exumob.surrogates.model import SurrogateHydrodynamics, shipped_networks
from exumob.surrogates.networks import Architecture, NetworkSet, read_arrays, write_arrays
from exumob.water.calibrated import CalibratedHydrodynamics
from exumob.water.conditions import Water
from exumob.water.wave_loads import fitted_coefficients

torch = pytest.importorskip("torch")
from exumob.learning.examples import Examples, training_runs, validation_runs
from exumob.learning.fitting import HEAVIEST, run_weights
from exumob.learning.onnx_export import export_onnx
from exumob.learning.torch_networks import LoadNetwork

SHAPES = [SMALL, replace(SMALL, layer="dense"), replace(SMALL, layer="polynomial", taps=1)]


@pytest.mark.parametrize("architecture", SHAPES, ids=lambda a: a.layer)
def test_one_instant_and_many_agree(architecture, vehicle):
    network = made_up(architecture, vehicle)
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 5, architecture.taps, 3))
    one_by_one = np.stack([network.wrenches(x) for x in inputs])
    assert network.batch_wrenches(inputs, batch=7) == pytest.approx(one_by_one, abs=2e-5)


@pytest.mark.parametrize("architecture", SHAPES[:2], ids=lambda a: a.layer)
def test_torch_and_the_loop_agree(architecture, vehicle):
    network = made_up(architecture, vehicle)
    inputs = np.random.default_rng(1).uniform(-1.0, 1.0, (5, architecture.taps, 3))
    loads = network.wrenches(inputs)
    for body in range(5):
        module = LoadNetwork(architecture, torch.Generator().manual_seed(0))
        module.load_state_dict({n: torch.from_numpy(network.arrays[n][body]) for n in architecture.shapes()})
        out = module(torch.from_numpy(network.scaled(inputs)[body][None])).detach().numpy()[0]
        assert 2.0 * out + network.arrays["output_mean"][body] == pytest.approx(loads[body], abs=2e-5)


@pytest.mark.parametrize("architecture", SHAPES, ids=lambda a: a.layer)
def test_onnx_and_the_loop_agree(architecture, vehicle, tmp_path):
    """Spec: single precision, inside and outside the training range (inputs are held at its edge)."""
    onnx, runtime = pytest.importorskip("onnx"), pytest.importorskip("onnxruntime")
    network = made_up(architecture, vehicle)
    file = export_onnx(network, tmp_path / "networks.onnx")
    onnx.checker.check_model(str(file), full_check=True)
    window = np.random.default_rng(5).uniform(-2.0, 2.0, (20, 5, architecture.taps, 3))
    session = runtime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    (loads,) = session.run(None, {"states": window.astype(np.float32)})
    assert loads == pytest.approx(network.batch_wrenches(window), rel=1e-4, abs=1e-4)
    said = session.get_modelmeta().custom_metadata_map
    assert said["inputs"].startswith("forward_flow [m/s]") and said["base"] == "none"


def test_export_command(tmp_path):
    pytest.importorskip("onnx")
    file = tmp_path / "one.onnx"
    answer = CliRunner().invoke(app, ["export", str(shipped_networks()[0]), "--output", str(file)])
    assert answer.exit_code == 0 and file.stat().st_size > 50_000
    assert "memory, seed 0" in answer.output and "'coefficients'" in answer.output
    wrong = CliRunner().invoke(app, ["export", str(shipped_networks()[0]), "--output", str(tmp_path / "one.pt")])
    assert wrong.exit_code == 2 and "use .onnx" in wrong.output
    foreign = CliRunner().invoke(app, ["export", str(file), "--output", str(file)])
    assert foreign.exit_code == 2 and "not a file of networks" in foreign.output.replace("\n", " ")


def test_lstm_is_the_papers():
    """Eqs. (8) and (9), written out, against torch's own LSTM."""
    module = LoadNetwork(SMALL, torch.Generator().manual_seed(3))
    theirs = torch.nn.LSTM(3, SMALL.width, batch_first=True)
    w = dict(module.named_parameters())
    with torch.no_grad():
        theirs.weight_ih_l0.copy_(w["W"])
        theirs.weight_hh_l0.copy_(w["U"])
        theirs.bias_ih_l0.copy_(w["b"])
        theirs.bias_hh_l0.zero_()
        x = torch.randn(6, 4, 3)
        assert torch.allclose(module._lstm(x, w), theirs(x)[0][:, -1], atol=1e-6)


def test_paper_sizes():
    shapes = Architecture().shapes()
    assert shapes["U"] == (1600, 400) and shapes["W"] == (1600, 5) and shapes["dense_weight"] == (100, 400)
    assert shapes["out_weight"] == (6, 100) and Architecture().memory == pytest.approx(2e-3)


def test_file_round_trip(vehicle, tmp_path):
    network = made_up(SMALL, vehicle)
    again = NetworkSet.load(network.save(tmp_path / "a.safetensors"))
    assert again.architecture == SMALL and again.about == network.about and again.digest() == network.digest()
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("layer", ["lstm", "dense"])
def test_weights_in_half_precision_lose_bits_and_nothing_else(vehicle, tmp_path, layer):
    network = made_up(replace(SMALL, layer=layer, width=64), vehicle)
    files = [network.save(tmp_path / f"{half}.safetensors", half) for half in (False, True)]
    again = NetworkSet.load(files[1])
    assert files[1].stat().st_size < 0.75 * files[0].stat().st_size
    for name, array in network.arrays.items():
        assert again.arrays[name].dtype == np.float32
        matrix = name in SMALL.shapes() and array.ndim == 3
        np.testing.assert_allclose(again.arrays[name], array, rtol=2.0**-11 if matrix else 0.0, atol=1e-7)
    assert NetworkSet.load(again.save(tmp_path / "again.safetensors", half=True)).digest() == again.digest()


def test_foreign_files_are_refused(vehicle, tmp_path, monkeypatch):
    from safetensors.numpy import save_file

    with pytest.raises(ValueError, match=r"none\.safetensors does not exist; "):
        NetworkSet.load(tmp_path / "none.safetensors")
    with pytest.raises(ValueError, match="is a folder; "):
        NetworkSet.load(tmp_path)
    (tmp_path / "text.safetensors").write_text("not a network at all, whatever its name says")
    with pytest.raises(ValueError, match="is not a file of networks"):
        NetworkSet.load(tmp_path / "text.safetensors")
    save_file({"a": np.zeros(3)}, tmp_path / "other.safetensors")
    with pytest.raises(ValueError, match="not exumob's networks"):
        NetworkSet.load(tmp_path / "other.safetensors")
    network = made_up(SMALL, vehicle)
    short = NetworkSet(SMALL, {n: a for n, a in network.arrays.items() if n != "U"}, network.about)
    with pytest.raises(ValueError, match="U is missing"):
        NetworkSet.load(short.save(tmp_path / "short.safetensors"))
    broken = NetworkSet(SMALL, network.arrays | {"U": np.full_like(network.arrays["U"], np.nan)}, network.about)
    with pytest.raises(ValueError, match="not finite"):
        NetworkSet.load(broken.save(tmp_path / "nan.safetensors"))
    monkeypatch.setattr("exumob.surrogates.networks.VERSION", 0)
    network.save(tmp_path / "old.safetensors")
    monkeypatch.undo()
    with pytest.raises(ValueError, match="version 0 and this program reads "):
        NetworkSet.load(tmp_path / "old.safetensors")


def _waves(value):
    """Terms of coefficients, one of which has a value."""
    terms = fitted_coefficients().terms
    terms["hull"]["Fx"]["w"] = value
    return terms


DAMAGE = [
    (lambda h, a: h.pop("about"), "does not say for which vehicle"),
    (lambda h, a: h.update(about=[1]), "does not say for which vehicle"),
    (lambda h, a: h["about"].update(geometry=None), r"about\.geometry is None"),
    (lambda h, a: h["about"].update(geometry=[]), r"about\.geometry is \[\]"),
    (lambda h, a: h["about"]["geometry"].pop("track"), "missing parameters: track"),
    (lambda h, a: h["about"]["geometry"].update({"no.such": 1.0}), r"no\.such"),
    (lambda h, a: h["about"]["geometry"].update(track=[1]), "missing parameters: track"),
    (
        lambda h, a: (h["architecture"].update(base="coefficients"), h["about"].update(waves=[1.0])),
        "about.waves.*TypeError",
    ),
    (
        lambda h, a: (h["architecture"].update(base="coefficients"), h["about"].update(waves={"hull": {}})),
        "about.waves.*Fx",
    ),
    (
        lambda h, a: (h["architecture"].update(base="coefficients"), h["about"].update(waves=_waves(10**400))),
        "OverflowError",
    ),
    (lambda h, a: (h["architecture"].update(base="coefficients"), h["about"].update(waves=_waves(math.nan))), "finite"),
    (lambda h, a: h.pop("version"), "is of version None and this program reads "),
    (lambda h, a: h.update(version="1"), "is of version 1 and"),
    (lambda h, a: h.pop("architecture"), "its architecture has None"),
    (lambda h, a: h["architecture"].pop("taps"), r"its architecture has \['taps'\]"),
    (lambda h, a: h["architecture"].update(width="7"), "width"),
    (lambda h, a: h["architecture"].update(width=2.5), "width"),
    (lambda h, a: h["architecture"].update(width=10**400), "width"),
    (lambda h, a: h["architecture"].update(inputs=3), "int"),
    (lambda h, a: h["architecture"].update(inputs=[["yaw_rate"]]), "inputs"),
    (lambda h, a: h["architecture"].update(layer=None), "layer"),
    (lambda h, a: a.pop("b"), "b is missing"),
    (lambda h, a: a.update(b=a["b"][:4]), r"b is of shape \(4, 28\) of float32; it must be \(5, 28\)"),
    (lambda h, a: a.update(b=a["b"].astype(np.float64)), "b is of shape .* of float64"),
    (lambda h, a: a.update(b=a["b"].astype(np.int32)), "b is of shape .* of int32"),
    (lambda h, a: a["b"].__setitem__((0, 3), np.nan), "b is of shape .*not finite at 1 of 140 places"),
    (lambda h, a: a["input_scale"].__setitem__((0, 0), 0.0), "input_scale must be > 0"),
    (lambda h, a: a["input_low"].__setitem__((0, 0), 9.0), "input_low lies above input_high"),
]


@pytest.mark.parametrize(("change", "message"), DAMAGE, ids=[message for _, message in DAMAGE])
def test_incomplete_files_are_refused(vehicle, tmp_path, change, message):
    file = made_up(SMALL, vehicle).save(tmp_path / "a.safetensors")
    header, arrays = read_arrays(file, "", "")
    arrays = {name: array.copy() for name, array in arrays.items()}
    change(header, arrays)
    write_arrays(file, header, arrays)
    with pytest.raises(ValueError, match=message) as caught:
        NetworkSet.load(file)
    assert str(file) in str(caught.value) and "exumob train" in str(caught.value)


@pytest.mark.parametrize("header", [[1], None, 3, "a"])
def test_headers_of_another_kind_are_refused(tmp_path, header):
    from safetensors.numpy import save_file

    save_file({"a": np.zeros(3)}, tmp_path / "a.safetensors", {"exumob": json.dumps(header)})
    with pytest.raises(ValueError, match=r"a\.safetensors is not a file of networks: its header is a"):
        NetworkSet.load(tmp_path / "a.safetensors")


@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_file_is_the_right_one_or_refused(vehicle, tmp_path, seed):
    """Cut off, bits turned over, pieces left out: at places drawn at random, and at both ends."""
    network = made_up(SMALL, vehicle)
    file = network.save(tmp_path / "a.safetensors")
    damage(file, seed, (0, -1, 8, 20))
    try:
        found = NetworkSet.load(file)
    except ValueError as error:
        assert str(file) in str(error) and "exumob train" in str(error)
    else:
        assert found.digest() == network.digest() and found.about == network.about


def test_files_without_a_digest_are_read(vehicle, tmp_path):
    """As they were written before there was one."""
    from safetensors.numpy import save_file

    network = made_up(SMALL, vehicle)
    header, arrays = read_arrays(network.save(tmp_path / "a.safetensors"), "", "")
    save_file(arrays, tmp_path / "b.safetensors", {"exumob": json.dumps(header)})
    assert NetworkSet.load(tmp_path / "b.safetensors").digest() == network.digest()


def test_architecture_is_checked():
    with pytest.raises(ValueError, match="no_such_input"):
        Architecture(inputs=("no_such_input",))
    with pytest.raises(ValueError, match="quasi-steady"):
        Architecture(layer="polynomial", taps=3)
    with pytest.raises(ValueError, match="'lstm', 'dense' or 'polynomial'"):
        Architecture(layer="gru")


def test_window_is_taken_by_time():
    grid = 1e-3 * np.arange(101)
    assert list(window_rows(grid, 3, 1)) == [98, 99, 100]
    assert list(window_rows(grid, 4, 10)) == [70, 80, 90, 100]
    assert list(window_rows(grid[:2], 3, 1)) == [0, 0, 1]  # before the release: the first state
    uneven = np.r_[grid, 0.1005]  # now lies between two samples
    assert list(window_rows(uneven, 2, 1)) == [100, 101]


def test_inputs_of_the_mirrored_motion(runs):
    """Mirroring positions and velocities in the plane y = 0 changes the signs that `INPUTS` names."""
    states, water = body_states(runs["D60/U1"]), water_of(runs["D60/U1"])
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.standard_normal((len(states), 5, 3, 3)))[0]
    turn *= np.linalg.det(turn)[..., None, None]
    noisy = replace(
        states, rotation=turn, velocity=rng.standard_normal(states.velocity.shape),
        angular_velocity=rng.standard_normal(states.velocity.shape),
    )  # fmt: skip
    order, flip = list(MIRRORED_BODIES), np.array([1.0, -1.0, 1.0])
    mirrored = replace(
        noisy, rotation=(flip[:, None] * turn * flip)[:, order], velocity=(noisy.velocity * flip)[:, order],
        position=(noisy.position * flip)[:, order], angular_velocity=(-noisy.angular_velocity * flip)[:, order],
    )  # fmt: skip
    found = network_inputs(mirrored, water, tuple(INPUTS))
    expected = network_inputs(noisy, water, tuple(INPUTS))[:, order] * mirror_signs(tuple(INPUTS))
    assert found == pytest.approx(expected, abs=1e-12)


def test_jumps_are_left_out(runs):
    run = runs["D40/U0"].copy(deep=True)
    assert usable(run).all()
    run["water_wrench"][200, 0, 2] += 500.0
    assert np.flatnonzero(~usable(run)).tolist() == list(range(180, 221))


def test_validation_runs_lie_inside(runs):
    assert {*map(tuple, (validation_runs(runs, seed) for seed in range(4)))} == {("D50/U0.5",)}


def test_of_many_runs_each_seed_keeps_a_tenth(runs):
    """Different ones, spread over the names; of the paper's nine runs it is one."""
    many = {f"{n:02d}": runs["D50/U0.5"] for n in range(30)}
    kept = [validation_runs(many, seed) for seed in range(5)]
    assert all(len(set(names)) == 3 for names in kept) and len({name for names in kept for name in names}) == 15
    assert len(validation_runs({name: many[name] for name in list(many)[:9]}, 0)) == 1
    assert len(validation_runs(runs, 1)) == 1


def test_calm_runs_weigh_more_but_not_without_limit():
    """The weight of a run is the inverse variance of its loads, over that of the median run."""
    noise = np.random.default_rng(0).standard_normal((4000, 6))
    loads = [(scale * noise).astype(np.float32) for scale in (1.0, 3.0, 0.1, 0.0)]
    found = Examples([np.zeros((4000, 1), np.float32)] * 4, loads, [np.ones(4000, bool)] * 4, (), 4)
    weights = run_weights(found, [0, 1, 2], [3])
    assert weights[0] == pytest.approx(np.ones(6)) and weights[1] == pytest.approx(np.full(6, 1.0 / 9.0), rel=1e-3)
    assert weights[2] == pytest.approx(np.full(6, HEAVIEST)) and weights[3] == pytest.approx(np.full(6, HEAVIEST))
    with_jump = replace(found, usable=[np.arange(4000) < 2000, *found.usable[1:]])
    with_jump.loads[0][2000:] = 1e6
    assert run_weights(with_jump, [0, 1, 2], [])[0] == pytest.approx(np.ones(6), rel=0.1)


def test_evaluation_runs_are_never_learnt_from(runs, tmp_path):
    for n, name in enumerate(["D40/U0", "D60/U1", *(s.name for s in UNSEEN)]):
        save_dataset(runs["D60/U1"].assign_attrs(scenario=name), tmp_path / f"{n}.nc")  # whatever the file's name
    assert set(training_runs(tmp_path)) == {"D40/U0", "D60/U1"}
    (tmp_path / "empty").mkdir()
    (tmp_path / "more").mkdir()
    for name, role in (("drive", "teach"), ("judge", "apart")):
        save_dataset(runs["D60/U1"].assign_attrs(scenario=name, role=role), tmp_path / "more" / f"{name}.nc")
    assert set(training_runs([tmp_path, str(tmp_path / "more")])) == {"D40/U0", "D60/U1", "drive"}
    with pytest.raises(ValueError, match="2 folders hold 1 runs to learn from"):
        training_runs([tmp_path / "empty", tmp_path / "more"])
    with pytest.raises(ValueError, match="there is another run of D40/U0"):
        training_runs([tmp_path, tmp_path])
    for folder, said in (
        ("empty", "holds 0 runs"),
        ("nowhere", "does not exist; give a folder"),
        ("0.nc", "is a file"),
    ):
        with pytest.raises(ValueError, match=said):
            training_runs(tmp_path / folder)


HEAD_CURRENT = Water(0.12, 1.0)


def test_members_together_answer_as_alone(vehicle):
    """Spec: round-off of single precision."""
    sets = [NetworkSet.load(file) for file in shipped_networks()]
    low, high = (sets[0].arrays[f"input_{end}"][:, None] for end in ("low", "high"))
    shape = 5, sets[0].architecture.window, low.shape[-1]
    window = low + np.random.default_rng(3).uniform(0.0, 1.0, shape) * (high - low)
    alone = np.concatenate([one.wrenches(window) for one in sets])
    every = NetworkSet.stacked(sets)
    together = every.wrenches(window)
    assert together == pytest.approx(alone, rel=1e-4, abs=1e-4)
    excess = np.concatenate([one.excess(window[:, -1]) for one in sets])
    assert every.excess(window[:, -1]) == pytest.approx(excess, rel=1e-5, abs=1e-6)


def test_far_outside_the_calibrated_coefficients_act_alone(runs, vehicle):
    narrow = {"input_low": np.full((5, 3), -0.3, np.float32), "input_high": np.full((5, 3), 0.3, np.float32)}
    states, answers = body_states(runs["D60/U1"])[:400], []
    pushing = SurrogateHydrodynamics(residual(vehicle, 2.0, **narrow))
    for model in (pushing, CalibratedHydrodynamics(), SurrogateHydrodynamics(pushing.networks, fallback=False)):
        model.start(vehicle, HEAD_CURRENT, 1e-3)
        answers.append(model.wrenches(states, lambda: states))
    assert answers[0] == pytest.approx(answers[1], abs=1e-12)
    assert answers[2] == pytest.approx(answers[1] + 2.0, abs=1e-6)


def test_another_vehicle_is_refused(vehicle, sand):
    wider = replace(vehicle, track=0.7)
    with pytest.raises(ValueError, match=r"track = 0\.7, they were trained with 0\.66"):
        simulate(wider, sand, HEAD_CURRENT, lane_change(), SurrogateHydrodynamics(residual(vehicle)), duration=0.1)
    heavier = replace(vehicle, hull=replace(vehicle.hull, mass=50.0))  # the water sees no mass
    residual(vehicle).check_vehicle(heavier)


def test_loads_are_proportional_to_density(runs, vehicle):
    states = body_states(runs["D60/U1"])[:300]
    network = made_up(SMALL, vehicle)
    answers = []
    for density in (1000.0, 1025.0):
        model = SurrogateHydrodynamics(network, fallback=False)
        model.start(vehicle, Water(0.12, 1.0, density=density), 1e-3)
        answers.append(model.wrenches(states, lambda: states))
    assert answers[1] == pytest.approx(1.025 * answers[0])


def test_mirrored_loads_are_their_own_inverse():
    order = list(MIRRORED_BODIES)
    assert [order[b] for b in order] == [0, 1, 2, 3, 4] and (MIRRORED_LOADS**2 == 1.0).all()
