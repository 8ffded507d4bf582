"""Fit of the waves' coefficients: it finds what made the loads, resists to the side, and holds to its prior."""

import itertools

import numpy as np
import pytest

pytest.importorskip("torch")
from exumob.learning.calibration import fit_wave_coefficients
from exumob.learning.dataset import base_loads, body_states, water_of
from exumob.vehicle.motion import WRENCH_COMPONENTS
from exumob.water.wave_loads import (
    FORMS,
    KINDS,
    MOST_DRAUGHT,
    MOST_FROUDE,
    WaveCoefficients,
    fitted_coefficients,
    wave_loads_along,
)


@pytest.fixture(scope="module")
def made(runs, vehicle):
    """Runs that sway, turn and steer, with the loads of known coefficients.

    They are -0.2 of every term, so that no two cancel each other. What moves the vehicle so is no matter.
    """
    values = np.zeros(WaveCoefficients.SHAPE)
    for n, name in enumerate(KINDS):
        for component, forms in FORMS[name].items():
            values[n, WRENCH_COMPONENTS.index(component), : len(forms)] = -0.2
    known = WaveCoefficients(values, {})
    found = {}
    for name, run in runs.items():
        phase = 30.0 * run["time"].values[:, None]
        run = run.copy(deep=True)
        run["velocity"][..., 1] += 0.3 * np.sin(phase)
        run["angular_velocity"][..., 2] += 0.8 * np.sin(1.7 * phase)
        half = 0.2 * np.sin(0.6 * phase)
        run["quaternion"][:, 1:3] = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=-1)
        water, states = water_of(run), body_states(run)
        waves = wave_loads_along(vehicle, water.over(), water.density, states, known)
        loads = (base_loads(run, vehicle) + waves).astype(np.float32)
        found[name] = run.assign(
            {one: run[one].copy(data=loads) for one in ("water_wrench", "water_wrench_smooth")}
        )  # fmt: skip
    return found, known


def side_forces(values):
    """Coefficients of the side forces at the corners of the range of Froude's number and draught; steered and not."""
    for n, name in enumerate(KINDS):
        forms = FORMS[name].get("Fy", ())
        if forms:
            given = values[n, WRENCH_COMPONENTS.index("Fy")]
            for wash in (0.0, given[3] if "wash" in forms else 0.0):
                for f, t in itertools.product((0.0, MOST_FROUDE), (0.0, MOST_DRAUGHT)):
                    yield given[0] + given[1] * f + given[2] * t + wash


def test_known_coefficients_are_found(made, vehicle):
    """Terms are alike on so few runs, so loads are compared, not coefficients: to 5 % (root mean square)."""
    runs, known = made
    found = fit_wave_coefficients([(vehicle, runs)])
    assert found.about["runs"] == {vehicle.name: sorted(runs)}
    one, other = (
        np.concatenate([
            wave_loads_along(vehicle, water_of(run).over(), water_of(run).density, body_states(run)[::50], waves)
            for run in runs.values()
        ])
        for waves in (found, known)
    )  # fmt: skip
    off = np.sqrt(((one - other) ** 2).mean(axis=0))
    share = off / np.maximum(np.sqrt((other**2).mean(axis=0)), 1e-9)
    assert share.max() < 0.05, np.round(share, 3)


def test_side_forces_resist_whatever_the_runs_say(made, vehicle):
    """Loads of the other sign would push a vehicle aside: at no Froude number and draught of the range they do."""
    runs, _ = made
    wrong = {
        name: run.assign(water_wrench_smooth=2.0 * run["water_wrench_smooth"] * [1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
        for name, run in runs.items()
    }
    for waves in (fitted_coefficients(), fit_wave_coefficients([(vehicle, wrong)])):
        assert max(side_forces(waves.values)) < 1e-4  # coefficients have five digits


def test_where_runs_say_nothing_the_prior_holds(made, vehicle):
    """In still water, at rest, waves have no loads; a run of motion moves the same coefficients."""
    runs, _ = made
    prior = fitted_coefficients()
    name, run = next(iter(runs.items()))
    still = run.isel(time=slice(0, 200)).copy(deep=True)
    for moving in ("velocity", "angular_velocity"):
        still[moving] = 0.0 * still[moving]
    attrs = {"parameters": run.attrs["parameters"].replace('"current_speed": 1.0', '"current_speed": 0.0')}
    still = still.assign_attrs(attrs)
    assert water_of(still).current_speed == 0.0, name
    assert fit_wave_coefficients([(vehicle, {"still": still})], prior).values == pytest.approx(
        prior.values, rel=1e-2, abs=1e-3
    )
    assert fit_wave_coefficients([(vehicle, runs)], prior).values != pytest.approx(prior.values, rel=1e-2)


@pytest.mark.parametrize("groups", [lambda v, r: [], lambda v, r: [(v, {})], lambda v, r: [(v, r), (v, r)]])
def test_nothing_to_fit_to_is_refused(made, vehicle, groups):
    with pytest.raises(ValueError, match="give vehicles of different names, each with its runs"):
        fit_wave_coefficients(groups(vehicle, made[0]))
