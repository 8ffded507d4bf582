"""Path following: distances and headings, smooth steering, what the driver does, repeated and resumed runs."""

import math

import numpy as np
import pytest

from exumob import CoefficientHydrodynamics, ConstantSteer, Soil, Water, simulate
from exumob.coupling.strong import Strong
from exumob.driving.path_following import PathFollowing, StanleyDriver, _Polyline, lane_shift
from exumob.support.errors import SimulationInterrupted
from exumob.vehicle.motion import BodyStates
from vehicle_models.amphibious import amphibious_vehicle

FAST = {"micro_step": 5e-4, "macro_step": 20e-3, "record_step": 20e-3}
STRAIGHT = ((0.0, 0.0), (10.0, 0.0))


def states(time=0.0, x=0.0, y=0.0, yaw=0.0, speed=0.0, yaw_rate=0.0):
    """Five bodies in a row, the front axle at (x, y)."""
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    position, spin = np.zeros((1, 5, 3)), np.zeros((1, 5, 3))
    position[..., :2], spin[..., 2] = (x, y), yaw_rate
    velocity = np.broadcast_to(speed * turn[:, 0], (1, 5, 3))
    zero = np.zeros((1, 5, 3))
    return BodyStates(
        np.array([time]), position, np.broadcast_to(turn, (1, 5, 3, 3)), velocity, spin, zero, zero, np.zeros((1, 4))
    )


def wanted_angle(maneuver, **seen):
    """What the wheels come to after one look."""
    driver = StanleyDriver(maneuver)
    driver.observe(states(**seen))
    return driver.steering(10.0)[0]


def test_distance_and_heading_of_a_path():
    path = _Polyline(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0)))
    assert path.nearest(0.5, 0.3) == (pytest.approx(0.3), pytest.approx(0.0), pytest.approx(0.5))
    assert path.nearest(0.5, -0.3)[0] == pytest.approx(-0.3)
    assert path.nearest(2.4, 1.5)[0] == pytest.approx(-0.4)  # to the right of a way to the left
    assert path.nearest(2.4, 1.5)[1] == pytest.approx(math.pi / 2, rel=0.26)
    assert path.nearest(2.1, -0.1)[0] == pytest.approx(-math.hypot(0.1, 0.1))
    assert path.nearest(-5.0, 0.7)[:2] == (pytest.approx(0.7), pytest.approx(0.0))  # straight on before the first
    assert path.nearest(1.5, 8.0)[0] == pytest.approx(0.5)  # and after the last


def test_heading_does_not_jump_where_a_path_crosses_the_negative_x_axis():
    circle = [(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2.0 * math.pi, 73)]
    path = _Polyline(tuple(circle))
    for a in np.linspace(0.2, 6.0, 50):
        distance, heading, _ = path.nearest(0.9 * math.cos(a), 0.9 * math.sin(a))
        assert distance == pytest.approx(0.1, abs=2e-3)
        assert heading == pytest.approx(a + math.pi / 2, abs=0.02)


def test_law_of_hoffmann_et_al():
    maneuver = PathFollowing(
        STRAIGHT, gain=1.5, softening_speed=0.2, yaw_damping=0.3, integral_gain=0.0, max_rate=100.0
    )
    assert wanted_angle(maneuver, y=0.1, speed=0.5) == pytest.approx(-math.atan2(0.15, 0.7))
    assert wanted_angle(maneuver, yaw=0.2, speed=0.5) == pytest.approx(-0.2)
    assert wanted_angle(maneuver, yaw_rate=0.4, speed=0.5) == pytest.approx(-0.12)
    assert wanted_angle(maneuver, y=-3.0, yaw=-1.0) == pytest.approx(0.98 * maneuver.max_steering)


def test_integral_holds_against_a_steady_push_and_is_bounded():
    maneuver = PathFollowing(STRAIGHT, gain=0.0, yaw_damping=0.0, integral_gain=0.5, max_rate=100.0)
    driver = StanleyDriver(maneuver)
    for n in range(101):
        driver.observe(states(time=0.02 * n, y=0.1))
    assert driver.steering(10.0)[0] == pytest.approx(-0.5 * 0.1 * 2.0)
    for n in range(101, 5000):
        driver.observe(states(time=0.02 * n, y=0.1))
    assert driver.steering(1000.0)[0] == pytest.approx(-math.radians(15.0))


def test_steering_is_twice_differentiable_and_bounded():
    maneuver = PathFollowing(STRAIGHT, max_rate=2.0)
    driver, rng = StanleyDriver(maneuver), np.random.default_rng(1)
    last, rates = driver.steering(0.0), []
    for n in range(200):
        time = 0.02 * n
        before = driver.steering(time)
        driver.observe(states(time=time, y=rng.normal(0.0, 0.5), yaw=rng.normal(0.0, 0.3), speed=0.5))
        assert driver.steering(time) == pytest.approx(before, abs=1e-9)  # angle, rate and acceleration go on
        for t in np.linspace(time + 1e-3, time + 0.019, 7):
            now, after = driver.steering(t - 1e-5), driver.steering(t + 1e-5)
            assert driver.steering(t)[1] == pytest.approx((after[0] - now[0]) / 2e-5, abs=1e-5)
            assert driver.steering(t)[2] == pytest.approx((after[1] - now[1]) / 2e-5, abs=1e-2)
            rates.append(abs(driver.steering(t)[1]))
            last = driver.steering(t)
            assert abs(last[0]) <= maneuver.max_steering
    assert 0.8 * maneuver.max_rate < max(rates) < 1.5 * maneuver.max_rate


def test_a_path_that_crosses_itself_is_followed_branch_by_branch():
    angles = np.linspace(0.0, 2.0 * math.pi, 121)
    path = _Polyline(tuple((4.0 * math.sin(a), 2.0 * math.sin(2.0 * a)) for a in angles))  # crosses at (0, 0)
    x, y = 0.01, -0.01  # nearer to the other branch
    _, first, _ = path.nearest(x, y, 0.0)
    half = path.arc[60]
    _, second, way = path.nearest(x, y, half)
    assert first == pytest.approx(math.pi / 4, abs=0.1)
    assert math.cos(second - math.radians(135.0)) > 0.99
    assert way == pytest.approx(half, abs=0.1)


class Looking:
    """A maneuver whose driver only notes when it looks; `save` gives its own list away."""

    control_step, max_steering = 0.02, 0.1

    def steering(self, time):
        """Straight."""
        return 0.0, 0.0, 0.0

    def wheel_speed(self, time):
        """A gentle start."""
        return ConstantSteer().wheel_speed(time)

    def driver(self, vehicle):
        """One for each run."""
        fresh = Looking()
        fresh.looks = []
        Looking.last = fresh
        return fresh

    def observe(self, states):
        """Note the time."""
        self.looks.append(float(states.time[0]))

    def save(self):
        """Live, and under a name that the model uses, too."""
        return {"looks": self.looks}

    def restore(self, saved):
        """Take it."""
        self.looks = saved["looks"]


def test_driver_looks_once_at_each_time_though_steps_are_repeated():
    result = simulate(
        amphibious_vehicle(), Soil.published("LETE sand"), Water.at_ratio(0.4), Looking(), CoefficientHydrodynamics(),
        duration=0.2, micro_step=5e-4, macro_step=5e-3, coupling=Strong(),
    )  # fmt: skip
    assert float(result["coupling_iterations"].max()) > 1.0  # steps were repeated
    assert Looking.last.looks == pytest.approx(list(np.arange(0.0, 0.2001, 0.02)))


def test_drivers_that_lack_something_are_refused(tmp_path):
    class Blind(Looking):
        max_steering = property(lambda self: (_ for _ in ()).throw(AttributeError()))

    car, soil = amphibious_vehicle(), Soil.published("LETE sand")
    with pytest.raises(ValueError, match="Blind has a driver, but no max_steering"):
        simulate(car, soil, None, Blind(), duration=0.1)
    with pytest.raises(ValueError, match="Looking cannot be told from another one"):
        simulate(car, soil, None, Looking(), duration=0.1, checkpoint=tmp_path / "run.npz")


def test_resumed_run_has_the_same_bits(tmp_path):
    car, soil = amphibious_vehicle(), Soil.published("LETE sand")
    maneuver = PathFollowing(lane_shift(0.3, 0.1, 0.8), gain=2.0, integral_gain=0.3)
    run = lambda **more: simulate(car, soil, None, maneuver, duration=1.6, **FAST, **more)  # noqa: E731
    whole = run()

    def stop(time):
        if time > 1.29:
            raise KeyboardInterrupt

    with pytest.raises(SimulationInterrupted):
        run(checkpoint=tmp_path / "run.npz", progress=stop)
    again = run(checkpoint=tmp_path / "run.npz", resume=True)
    np.testing.assert_array_equal(again["steering_angle"], whole["steering_angle"])
    np.testing.assert_array_equal(again["position"], whole["position"])
    assert np.abs(whole["steering_angle"]).max() > 0.01


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"waypoints": ((0.0, 0.0),)}, r"waypoints has 1 point\(s\)"),
        ({"waypoints": ((0.0, 0.0), (0.0, 0.0))}, "coincide"),
        ({"waypoints": ((0.0, 0.0), (math.nan, 0.0))}, "finite"),
        ({"control_step": 0.0}, "control_step"),
        ({"control_step": 0.1}, "at most half of response_time"),
        ({"waypoints": ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0))}, "a turn of 90 degrees at point 2"),
        ({"gain": -1.0}, "gain"),
        ({"max_steering": 2.0}, "max_steering"),
    ],
)
def test_bad_paths_and_gains(options, match):
    with pytest.raises(ValueError, match=match):
        PathFollowing(**options)


def test_driver_may_not_steer_beyond_the_vehicle():
    with pytest.raises(ValueError, match=r"Steering\.limit"):
        simulate(amphibious_vehicle(), Soil.published("LETE sand"), None, PathFollowing(max_steering=1.2), duration=0.1)


@pytest.mark.parametrize(
    ("waypoints", "match"),
    [
        (((456_789.0, 5_432_101.0), (456_799.0, 5_432_101.0)), r"no nearer .* than .*subtract the place of the start"),
        (((30.0, 0.0), (40.0, 0.0)), r"than 29\.643 m, at \(30, 0\) m; 10 m at most"),
        (((-5.0, 40.0), (5.0, 40.0)), "than 40 m"),
    ],
)
def test_a_path_far_from_the_start(waypoints, match):
    with pytest.raises(ValueError, match=match):
        simulate(amphibious_vehicle(), Soil.published("LETE sand"), None, PathFollowing(waypoints), duration=0.1)
