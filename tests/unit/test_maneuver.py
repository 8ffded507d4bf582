"""Maneuvers: smoothness, amplitude, quiet ends, recorded histories, bad input."""

import math

import numpy as np
import pytest

from exumob.driving.maneuver import ConstantSteer, LaneChange, Recorded, lane_change, ramp, smooth_step
from exumob.driving.path_following import PathFollowing

H = 1e-5
"""Step of central differences [s]: their error, H^2/6 times a third derivative (below 1e5), is below 2e-6."""
REFERENCE = lane_change()
RECORDED_TIMES = np.linspace(0.0, 8.0, 161)
RECORDED = Recorded(
    RECORDED_TIMES,
    [REFERENCE.steering(t)[0] for t in RECORDED_TIMES],
    [REFERENCE.wheel_speed(t)[0] for t in RECORDED_TIMES],
)
ALL = [
    pytest.param(REFERENCE.steering, id="lane change steering"),
    pytest.param(REFERENCE.wheel_speed, id="lane change speed"),
    pytest.param(LaneChange(0.2, 0.3, 0.9, 5.0, 0.3).steering, id="compressed lane change"),
    pytest.param(ConstantSteer(0.3, 8.0, 0.7).steering, id="constant steer"),
    pytest.param(ConstantSteer(0.3, -8.0, 0.7).wheel_speed, id="reverse"),
    pytest.param(RECORDED.steering, id="recorded steering"),
    pytest.param(RECORDED.wheel_speed, id="recorded speed"),
]


@pytest.mark.parametrize("motion", ALL)
def test_derivatives_are_consistent(motion):
    for t in np.linspace(0.003, 7.9, 400):
        before, now, after = (np.array(motion(t + k * H)) for k in (-1, 0, 1))
        assert now[1:] == pytest.approx((after[:2] - before[:2]) / (2 * H), abs=5e-4, rel=1e-5)


@pytest.mark.parametrize("motion", ALL)
def test_acceleration_is_continuous(motion):
    """C2: over 1 us the acceleration changes by less than jerk (< 1e5 rad/s^3) times 1 us; a jump would stay."""
    corners = [0.3, 0.35, 0.36, 0.65, 0.7, 1.0, 2.0, 2.35, 5.15, 5.5]
    for t in np.unique(np.concatenate([np.arange(0.05, 7.99, 0.05), corners])):
        assert motion(t - 5e-7)[2] == pytest.approx(motion(t + 5e-7)[2], abs=0.1)


@pytest.mark.parametrize("motion", ALL)
def test_start_has_zero_acceleration(motion):
    """A sudden start costs spin torques of hundreds of N m: value, rate and acceleration start at zero."""
    assert motion(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_amplitude_is_reached_exactly_and_never_passed():
    """The peaks of one sine period from 2.0 to 5.5 s lie at a quarter and three quarters of it."""
    assert REFERENCE.steering(2.875)[0] == pytest.approx(math.radians(30.0), abs=1e-14)
    assert REFERENCE.steering(4.625)[0] == pytest.approx(-math.radians(30.0), abs=1e-14)
    assert REFERENCE.steering(2.875)[1] == pytest.approx(0.0, abs=1e-12)
    angles = [REFERENCE.steering(t)[0] for t in np.linspace(0.0, 8.0, 20001)]
    assert max(np.abs(angles)) <= math.radians(30.0) + 1e-14


@pytest.mark.parametrize("time", [0.0, 1.0, 1.999999, 2.0, 5.5, 5.500001, 7.0, 8.0, 100.0])
def test_steering_is_zero_outside_the_period(time):
    assert REFERENCE.steering(time) == (0.0, 0.0, 0.0)


def test_first_half_turns_left_then_right_and_the_halves_cancel():
    """A lane change: odd about its middle at 3.75 s, so that steering integrates to zero."""
    for offset in np.linspace(0.01, 1.74, 30):
        before, after = REFERENCE.steering(3.75 - offset), REFERENCE.steering(3.75 + offset)
        assert before[0] > 0.0
        assert after[0] == pytest.approx(-before[0], abs=1e-13)
        assert after[1] == pytest.approx(before[1], abs=1e-12)


def test_between_the_fades_it_is_the_sine():
    for t in np.linspace(2.35, 5.15, 57):
        sine = math.radians(30.0) * math.sin(2 * math.pi * (t - 2.0) / 3.5)
        assert REFERENCE.steering(t)[0] == pytest.approx(sine, abs=1e-13)


def test_mirrored_amplitude_mirrors_the_steering():
    mirrored = lane_change(-math.radians(30.0))
    for t in np.linspace(0.0, 8.0, 101):
        assert mirrored.steering(t) == pytest.approx([-v for v in REFERENCE.steering(t)], abs=0.0)
        assert mirrored.wheel_speed(t) == REFERENCE.wheel_speed(t)


def test_wheel_speed_is_a_quintic_ramp_to_10_in_1_s():
    for x in np.linspace(0.0, 1.0, 21):
        expected = 10.0 * (10 * x**3 - 15 * x**4 + 6 * x**5)
        assert REFERENCE.wheel_speed(x)[0] == pytest.approx(expected, abs=1e-12)
    assert REFERENCE.wheel_speed(0.0) == (0.0, 0.0, 0.0)
    assert REFERENCE.wheel_speed(1.0) == pytest.approx((10.0, 0.0, 0.0), abs=1e-12)
    assert REFERENCE.wheel_speed(7.3) == (10.0, 0.0, 0.0)


def test_smooth_step_ends():
    assert smooth_step(-1.0) == smooth_step(0.0) == (0.0, 0.0, 0.0)
    assert smooth_step(1.0) == smooth_step(2.0) == (1.0, 0.0, 0.0)
    assert smooth_step(0.5) == pytest.approx((0.5, 1.875, 0.0))
    assert ramp(0.5, 2.0, 8.0)[0] == pytest.approx(8.0 * smooth_step(0.25)[0])


def test_constant_steer_holds_its_angle():
    turn = ConstantSteer(angle=0.2, speed=6.0, ramp_time=0.5)
    assert turn.steering(0.5) == (0.0, 0.0, 0.0)
    assert turn.steering(1.0) == pytest.approx((0.2, 0.0, 0.0))
    assert turn.wheel_speed(9.0) == (6.0, 0.0, 0.0)


def test_standing_still_is_a_maneuver():
    still = ConstantSteer(speed=0.0)
    assert still.steering(3.0) == still.wheel_speed(3.0) == (0.0, 0.0, 0.0)


# -- recorded ----------------------------------------------------------------------------------------------------------


def test_recorded_passes_through_its_samples():
    for t in RECORDED_TIMES[::7]:
        assert RECORDED.steering(t)[0] == pytest.approx(REFERENCE.steering(t)[0], abs=1e-12)
        assert RECORDED.wheel_speed(t)[0] == pytest.approx(REFERENCE.wheel_speed(t)[0], abs=1e-12)


def test_recorded_approaches_what_was_recorded():
    """Cubic splines over 50 ms: error 5/384 h^4 times the fourth derivative (3e4 at most), below 3e-3 rad."""
    for t in np.linspace(0.0, 8.0, 333):
        assert RECORDED.steering(t)[0] == pytest.approx(REFERENCE.steering(t)[0], abs=3e-3)


def test_recorded_holds_its_ends():
    assert RECORDED.wheel_speed(9.0) == pytest.approx((10.0, 0.0, 0.0), abs=1e-12)
    assert RECORDED.wheel_speed(-1.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_recorded_starts_with_zero_rates():
    coarse = Recorded([0.0, 0.5, 1.0, 2.0], [0.0, 0.1, 0.3, 0.2], [0.0, 2.0, 6.0, 10.0])
    assert coarse.steering(0.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    assert coarse.wheel_speed(0.0)[:2] == pytest.approx((0.0, 0.0), abs=1e-12)


# -- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LaneChange(amplitude=30.0), r"LaneChange\.amplitude = 30\.0 rad must be .*math\.radians"),
        (lambda: LaneChange(amplitude=math.nan), r"LaneChange\.amplitude = nan is not a finite number"),
        (lambda: LaneChange(start=-1.0), r"LaneChange\.start = -1\.0 s must be >= 0"),
        (lambda: LaneChange(start=5.5), r"LaneChange\.start = 5\.5 s must be .*before end = 5\.5"),
        (lambda: LaneChange(end=math.inf), r"LaneChange\.end = inf"),
        (lambda: LaneChange(speed=math.nan), r"LaneChange\.speed = nan"),
        (lambda: LaneChange(ramp_time=0.0), r"LaneChange\.ramp_time = 0\.0 s must be >= 0\.001"),
        (lambda: ConstantSteer(angle=20.0), r"ConstantSteer\.angle = 20\.0 rad must be"),
        (lambda: ConstantSteer(speed=math.inf), r"ConstantSteer\.speed = inf"),
        (lambda: ConstantSteer(ramp_time=-1.0), r"ConstantSteer\.ramp_time = -1\.0 s must be >= 0\.001"),
        (lambda: Recorded([0, 1, 2], [0, 0, 0], [0, 1, 2]), r"at least 4 samples"),
        (lambda: Recorded([0, 1, 2, 3], [0, 0, 0], [0, 1, 2, 3]), r"steering \(3,\).*equally long"),
        (lambda: Recorded([0, 1, 2, 3], [0, 0, 0, math.nan], [0, 1, 2, 3]), r"not finite"),
        (lambda: Recorded([0, 1, 1, 3], [0, 0, 0, 0], [0, 1, 2, 3]), r"Recorded\.time must increase"),
        (lambda: Recorded([1, 2, 3, 4], [0, 0, 0, 0], [0, 1, 2, 3]), r"Recorded\.time must increase from 0"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize("make", [
    lambda: lane_change(10.0, 0.5), lambda: LaneChange(10.0), lambda: ConstantSteer(10.0, 0.3),
])  # fmt: skip
def test_an_angle_in_place_of_a_wheel_speed_is_told_the_order(make):
    with pytest.raises(
        ValueError,
        match=r"is it in degrees\? Then give math\.radians\(10\)\. The angle comes first; a wheel "
        r"speed .* goes into the field `speed`",
    ):
        make()


@pytest.mark.parametrize(("waypoints", "reach", "said"), [
    (((0, 0), (5000, 500)), 2.0, True), (((0, 0), (5000, 500)), 60.0, True), (((0, 0), (20, 2)), 0.01, False),
    (((0, 0), (2000, 500)), 100.0, False), (((-1, 0), (2000, 0), (20000, 100)), 8.0, True),
])  # fmt: skip
def test_a_path_in_millimetres_is_noted(waypoints, reach, said, caplog):
    PathFollowing(waypoints).warn_of_length(reach)
    assert [("in mm" in record.message) for record in caplog.records] == [True] * said
