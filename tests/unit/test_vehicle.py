"""The vehicle as data: masses, inertia, steering geometry, bad input, vehicle files."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vehicle_models.amphibious
from exumob.support.quantities import ImplausibleValue, unusual
from exumob.vehicle.parameters import Steering, Vehicle, Wishbones, box_inertia
from exumob.vehicle.vehicle_file import load_vehicle
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.light_4x4 import light_4x4

AMPHIBIOUS = amphibious_vehicle()
TRUCK = light_4x4()
ARMS = TRUCK.suspension.wishbones


def test_paper_vehicle_weighs_57_kg():
    """Spec: 57.000 kg; a sum of short decimals, so exact to round-off."""
    assert AMPHIBIOUS.mass == pytest.approx(57.0, abs=1e-12)


def test_paper_vehicle_has_the_published_dimensions():
    assert AMPHIBIOUS.wheelbase == 0.714
    assert AMPHIBIOUS.hull.ground_clearance == 0.078
    assert AMPHIBIOUS.steering.limit >= math.radians(30.0)


def test_mass_counts_both_axles():
    heavy = replace(AMPHIBIOUS.suspension, upright_mass=1.5)
    assert replace(AMPHIBIOUS, rear_suspension=heavy).mass == pytest.approx(59.0, abs=1e-12)


def test_heave_frequency_and_damping_are_those_of_the_design():
    """Design: 3 Hz and 30 % of critical, rounded to three digits in the file."""
    quarter = AMPHIBIOUS.hull.mass / 4
    suspension = AMPHIBIOUS.suspension
    assert math.sqrt(suspension.stiffness / quarter) / (2 * math.pi) == pytest.approx(3.0, rel=5e-3)
    assert suspension.damping / (2 * math.sqrt(suspension.stiffness * quarter)) == pytest.approx(0.30, rel=5e-3)
    assert suspension.bump_travel + suspension.rebound_travel == pytest.approx(0.040, abs=1e-12)


def test_steered_wheel_clears_the_hull_by_25_mm():
    """Design: at 30 degrees; the innermost point of the tyre's outline from above."""
    angle, wheel = math.radians(30.0), AMPHIBIOUS.wheel
    inward = wheel.radius * math.sin(angle) + 0.5 * wheel.width * math.cos(angle)
    assert 0.5 * (AMPHIBIOUS.track - AMPHIBIOUS.hull.width) - inward == pytest.approx(0.025, abs=5e-4)


@pytest.mark.parametrize("vehicle", [AMPHIBIOUS, TRUCK], ids=lambda v: v.name)
def test_wheels_stand_on_the_ground_left_and_right_alike(vehicle):
    centers = vehicle.wheel_centers
    assert centers[:, 2] == pytest.approx(vehicle.wheel.radius)
    assert centers[0] * [1, -1, 1] == pytest.approx(centers[1])
    assert centers[2] * [1, -1, 1] == pytest.approx(centers[3])
    assert centers[0, 1] > 0.0  # left is +y
    assert centers[0, 0] - centers[2, 0] == pytest.approx(vehicle.wheelbase)


def test_front_load_share_balances_moments_about_the_rear_axle():
    hull = TRUCK.hull
    assert TRUCK.front_load_share * TRUCK.wheelbase == pytest.approx(hull.center_of_mass_x + 0.5 * TRUCK.wheelbase)


def test_box_inertia_is_the_integral_over_the_box():
    """Two-point Gauss quadrature is exact for the quadratic integrand."""
    sides = np.array([1.0, 0.44, 0.20])
    points = np.array(np.meshgrid(*(np.array([-0.5, 0.5]) * s / math.sqrt(3.0) for s in sides))).reshape(3, -1).T
    expected = sum(np.eye(3) * (p @ p) - np.outer(p, p) for p in points) * 49.0 / len(points)
    assert box_inertia(49.0, *sides) == pytest.approx(expected, abs=1e-12)


def test_default_wheel_inertia_is_that_of_a_solid_cylinder():
    """Integrated over rings (Gauss-Legendre in the radius and along the axle, exact for polynomials)."""
    wheel = AMPHIBIOUS.wheel
    x, w = np.polynomial.legendre.leggauss(4)
    r, weight_r = 0.5 * wheel.radius * (x + 1), 0.5 * wheel.radius * w
    y, weight_y = 0.5 * wheel.width * x, 0.5 * wheel.width * w
    density = wheel.mass / (math.pi * wheel.radius**2 * wheel.width)
    ring = 2 * math.pi * density * np.outer(r * weight_r, weight_y)
    spin = (ring * (r**2)[:, None]).sum()
    transverse = (ring * (0.5 * (r**2)[:, None] + y**2)).sum()
    assert np.diag(wheel.inertia_tensor) == pytest.approx([transverse, spin, transverse])


def test_given_inertia_is_used():
    assert np.diag(TRUCK.wheel.inertia_tensor) == pytest.approx([1.3, 2.2, 1.3])
    assert np.diag(TRUCK.hull.inertia_tensor) == pytest.approx([260.0, 1150.0, 1250.0])


# -- steering ----------------------------------------------------------------------------------------------------------


def test_parallel_steering_turns_both_wheels_by_the_command():
    command = (0.3, -1.2, 5.0)
    assert AMPHIBIOUS.steering_angles(command) == (command, command)


@pytest.mark.parametrize("degrees", [-32.0, -10.0, -1e-4, 1e-4, 5.0, 20.0, 32.0])
def test_ackermann_axes_meet_on_the_rear_axle_line(degrees):
    """Both front axes cross the rear axle's line where that of a wheel in the middle does (relative 1e-9)."""
    command = math.radians(degrees)
    radius = TRUCK.wheelbase / math.tan(command)
    for (angle, _, _), y in zip(TRUCK.steering_angles((command, 0.0, 0.0)), TRUCK.wheel_centers[:2, 1], strict=True):
        assert y + TRUCK.wheelbase / math.tan(angle) == pytest.approx(radius, rel=1e-9)


def test_ackermann_straight_ahead_is_straight():
    left, right = TRUCK.steering_angles((0.0, 0.0, 0.0))
    assert left == right == (0.0, 0.0, 0.0)


def test_ackermann_inner_wheel_turns_more():
    left, right = TRUCK.steering_angles((0.4, 0.0, 0.0))
    assert left[0] > 0.4 > right[0]


def test_ackermann_is_mirrored_with_the_command():
    left, right = TRUCK.steering_angles((0.4, 0.7, -2.0))
    mirror_left, mirror_right = TRUCK.steering_angles((-0.4, -0.7, 2.0))
    assert mirror_left == pytest.approx([-v for v in right], abs=1e-15)
    assert mirror_right == pytest.approx([-v for v in left], abs=1e-15)


def test_ackermann_rates_are_the_derivatives():
    """Central differences with h = 1e-5 s of a sine command: error h^2/6 of the third derivative, below 1e-7."""
    amplitude, frequency, h = math.radians(30.0), 3.0, 1e-5

    def angles(t):
        s, c = math.sin(frequency * t), math.cos(frequency * t)
        return np.array(
            TRUCK.steering_angles((amplitude * s, amplitude * frequency * c, -amplitude * frequency**2 * s))
        )

    for t in np.linspace(0.0, 2.1, 23):
        difference = (angles(t + h) - angles(t - h)) / (2 * h)
        assert angles(t)[:, 1] == pytest.approx(difference[:, 0], abs=1e-7)
        assert angles(t)[:, 2] == pytest.approx(difference[:, 1], abs=1e-7)


# -- bad input ---------------------------------------------------------------------------------------------------------

NOT_POSITIVE = (0.0, -1.0, math.nan, math.inf, "1", None, True)


BAD = [
    *[
        (AMPHIBIOUS.hull, field, value)
        for field in ("mass", "length", "width", "height", "ground_clearance", "center_of_mass_height")
        for value in NOT_POSITIVE
    ],
    *[(AMPHIBIOUS.hull, field, value) for field in ("center_of_mass_x", "center_x") for value in (math.nan, 5.0, -5.0)],
    *[(AMPHIBIOUS.hull, field, value) for field in ("bow_length", "bow_height") for value in (math.nan, -0.01, 5.0)],
    (AMPHIBIOUS.hull, "inertia", (0.0, 1.0, 1.0)),
    (AMPHIBIOUS.hull, "inertia", (1.0, -1.0, 1.0)),
    (AMPHIBIOUS.hull, "inertia", (1.0, 1.0, math.nan)),
    (AMPHIBIOUS.hull, "inertia", (1.0, 1.0, 2.1)),  # no rigid body: I_a <= I_b + I_c
    *[(AMPHIBIOUS.wheel, field, value) for field in ("mass", "diameter", "width") for value in NOT_POSITIVE],
    (AMPHIBIOUS.wheel, "inertia", (0.0, 1.0)),
    (AMPHIBIOUS.wheel, "inertia", (1.0, -1.0)),
    (AMPHIBIOUS.wheel, "inertia", (1.0, 0.4)),  # no rigid body: spin <= 2 transverse
    *[
        (AMPHIBIOUS.suspension, field, value)
        for field in (
            "stiffness", "upright_mass", "upright_size", "bump_travel", "rebound_travel", "stop_stiffness",
            "stop_softening",
        )
        for value in NOT_POSITIVE
    ],
    *[(AMPHIBIOUS.suspension, "damping", value) for value in (-1.0, math.nan, math.inf, "1")],
    *[
        (ARMS, field, value)
        for field in ("upper_length", "lower_length", "upper_height", "lower_height", "pivot_spread")
        for value in NOT_POSITIVE
    ],
    (ARMS, "ball_joint_inset", math.nan),
    (ARMS, "upper_pivot_drop", math.inf),
    (ARMS, "upper_pivot_drop", 0.31),  # an arm of 0.30 m cannot drop so far
    (ARMS, "upper_pivot_drop", -0.31),  # an arm of 0.30 m cannot drop so far
    (AMPHIBIOUS.steering, "geometry", "rack"),
    *[(AMPHIBIOUS.steering, "limit", value) for value in (-0.1, 2.0, math.nan)],
    *[(AMPHIBIOUS, field, value) for field in ("wheelbase", "track") for value in NOT_POSITIVE],
    (AMPHIBIOUS, "track", 0.50),  # tyres inside the hull
]  # fmt: skip


def label(case):
    part, field, value = case
    return f"{type(part).__name__}.{field}={value}"


@pytest.mark.parametrize(("part", "field", "value"), BAD, ids=[label(case) for case in BAD])
def test_bad_field_is_named_with_value_limit_and_remedy(part, field, value):
    with pytest.raises(ValueError, match=field) as raised:
        replace(part, **{field: value})
    message = str(raised.value)
    numbers = value if isinstance(value, tuple) else (value,)
    assert any(repr(v) in message or f"{v}" in message for v in numbers), message
    assert re.search(r"must|outside \[|not a finite number|not known|breaks", message), f"no limit: {message}"
    assert re.search(r"give|use|check|choose|at least", message, re.IGNORECASE), f"no remedy: {message}"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: replace(v, suspension=replace(v.suspension, damping=0.139)),
         r"damping = 0\.139 N s/m is 0\.03 % of the critical one .* is it in N s/mm\? Then give 139 N s/m"),
        (lambda v: replace(v, wheelbase=0.6, track=1.0), r"track = 1 m is 1\.67 times the wheelbase, .* swapped"),
        (lambda v: replace(v, hull=replace(v.hull, ground_clearance=29.0)),
         r"ground_clearance = 29\.0 m .*is it in mm\? Then give 0\.029 m; or in cm\? Then give 0\.29 m; or in inches"),
    ],
)  # fmt: skip
def test_what_is_in_another_unit_or_swapped_is_asked_for(change, message):
    with pytest.raises(ImplausibleValue, match=message):
        change(AMPHIBIOUS)


def test_no_damping_and_what_is_meant_pass():
    for damping in (0.0, unusual(0.139)):
        assert replace(AMPHIBIOUS, suspension=replace(AMPHIBIOUS.suspension, damping=damping)).mass > 0.0


def test_center_of_mass_must_lie_between_the_axles():
    with pytest.raises(ValueError, match=r"center_of_mass_x = 0\.4 .*between the axles"):
        replace(AMPHIBIOUS, hull=replace(AMPHIBIOUS.hull, center_of_mass_x=0.4))


@pytest.mark.parametrize("number", [1, np.float64(1.0), np.float32(1.0), np.int64(1)], ids=lambda v: type(v).__name__)
def test_numpy_numbers_are_numbers(number):
    """A sweep over np.arange or a value read from a netCDF file is no error."""
    assert replace(AMPHIBIOUS.wheel, mass=number).mass == 1.0


@pytest.mark.parametrize(("change", "message"), [
    (lambda v: replace(v, suspension=replace(v.suspension, stiffness=8.0)), r"N/mm\? Then give 8000 N/m"),
    (lambda v: replace(v.hull, mass=49e3), r"kg/m\^3"),
    (lambda v: replace(v.hull, inertia=(1.0, 1e3, 1e3)), r"m from its centre, in a hull of"),
    (lambda v: replace(v.wheel, inertia=(75.0, 40.0)), r"solid.*hoop"),
    (lambda v: replace(v.wheel, inertia=(0.008, 0.0135)), r"transverse inertia.*are they swapped\?"),
    (lambda v: replace(v.hull, inertia=(4.2, 0.9, 4.9)), r"roll axis.*are they swapped\?"),
    (lambda v: replace(v.hull, inertia=(4.2, 4.9, 0.9)), r"roll axis.*are they swapped\?"),
])  # fmt: skip
def test_values_that_do_not_fit_each_other_are_refused_with_what_they_mean(change, message):
    with pytest.raises(ImplausibleValue, match=message):
        change(AMPHIBIOUS)


def test_unlikely_inertias_pass_if_they_are_meant():
    assert replace(AMPHIBIOUS.wheel, inertia=(0.008, unusual(0.0135))).inertia == (0.008, 0.0135)
    assert replace(AMPHIBIOUS.hull, inertia=(unusual(4.2), 0.9, 4.9)).inertia == (4.2, 0.9, 4.9)
    wheel = AMPHIBIOUS.wheel
    spin = wheel.mass * wheel.radius**2  # a hoop at both sides of the tyre: the widest that there is
    assert replace(wheel, inertia=(spin, 0.5 * spin + 0.25 * wheel.mass * wheel.width**2)).inertia[0] == spin


def test_unknown_field_is_rejected_by_name():
    with pytest.raises(TypeError, match="wheel_base"):
        Vehicle(**(vars(AMPHIBIOUS) | {"wheel_base": 1.0}))


def test_vehicles_cannot_be_changed_in_place():
    with pytest.raises(AttributeError):
        AMPHIBIOUS.wheelbase = 1.0


def test_wishbones_that_just_fit_are_accepted():
    assert Wishbones(0.3, 0.3, -0.02, 0.1, 0.1, 0.2).upper_pivot_drop == 0.0
    assert Steering(limit=0.0).limit == 0.0


# -- vehicle files -----------------------------------------------------------------------------------------------------

EXAMPLES = Path(vehicle_models.amphibious.__file__).parent
HEADER = "from vehicle_models.amphibious import amphibious_vehicle as _base\n"


def write(folder, text, name="mine.py"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["amphibious", "light_4x4"])
def test_example_files_load(name):
    path = EXAMPLES / f"{name}.py"
    assert load_vehicle(path) == {"amphibious": AMPHIBIOUS, "light_4x4": TRUCK}[name]
    assert load_vehicle(str(path)).mass > 0.0


def test_edited_copy_changes_the_vehicle(tmp_path):
    """Editing a value in a vehicle file is all that a user does."""
    text = (EXAMPLES / "amphibious.py").read_text()
    assert text.count("mass=49.0") == 1
    assert load_vehicle(write(tmp_path, text.replace("mass=49.0", "mass=52.0"))).mass == pytest.approx(60.0)


def test_private_helpers_and_imports_do_not_count(tmp_path):
    text = HEADER + "import math\ndef _helper():\n    return _base()\ndef car():\n    return _helper()\n"
    assert load_vehicle(write(tmp_path, text)) == AMPHIBIOUS


def test_file_may_be_called_like_a_library_module(tmp_path):
    assert load_vehicle(write(tmp_path, HEADER + "def car():\n    return _base()\n", "json.py")) == AMPHIBIOUS


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"absent\.py does not exist"):
        load_vehicle(tmp_path / "absent.py")


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        ("", "mine.py", "defines 0 public functions; it must define exactly one"),
        ("def a():\n    pass\ndef b():\n    pass\n", "mine.py", "defines 2 public functions"),
        ("def car():\n    return 57.0\n", "mine.py", r"car\(\) returned float; it must return a Vehicle"),
        (HEADER + "def car():\n    return _base()\n", "mine.txt", r"must end in \.py"),
        ("def car(:\n    return 1\n", "mine.py", r"mine\.py"),
        ("def car(wheelbase):\n    return wheelbase\n", "mine.py", "argument"),
    ],
    ids=["empty", "two functions", "not a vehicle", "not Python", "syntax error", "takes an argument"],
)  # fmt: skip
def test_unusable_file_is_a_value_error(tmp_path, text, name, message):
    with pytest.raises(ValueError, match=message):
        load_vehicle(write(tmp_path, text, name))


def test_bad_value_in_a_file_is_named(tmp_path):
    text = HEADER + "import dataclasses\ndef car():\n    return dataclasses.replace(_base(), wheelbase=-1.0)\n"
    with pytest.raises(ValueError, match=r"Vehicle\.wheelbase = -1\.0"):
        load_vehicle(write(tmp_path, text))


# -- the hull seen from the side ---------------------------------------------------------------------------------------


def profile_area(corners):
    (x, z), (x_next, z_next) = corners.T, np.roll(corners, -1, axis=0).T
    return 0.5 * float((x * z_next - x_next * z).sum())


@pytest.mark.parametrize(("bow_length", "bow_height", "corners"), [
    (0.25, 0.15, 5), (0.25, 0.0, 5), (0.25, AMPHIBIOUS.hull.height, 4), (0.0, 0.0, 4), (0.0, 0.15, 5),
    (AMPHIBIOUS.hull.length, AMPHIBIOUS.hull.height, 3),
])  # fmt: skip
def test_side_profile_is_a_box_less_the_rake(bow_length, bow_height, corners):
    hull = replace(AMPHIBIOUS.hull, bow_length=bow_length, bow_height=bow_height)
    profile = hull.side_profile()
    assert profile.shape == (corners, 2)
    assert (np.linalg.norm(profile - np.roll(profile, 1, axis=0), axis=1) > 0.0).all()
    assert profile_area(profile) == pytest.approx(hull.length * hull.height - 0.5 * bow_length * bow_height)
    assert profile.min(axis=0) == pytest.approx([hull.center_x - 0.5 * hull.length, hull.ground_clearance])


@pytest.mark.parametrize(("part", "change", "fields"), [
    ("wheel", {"diameter": 0.08, "width": 0.2}, ("width", "diameter")),
    ("hull", {"center_of_mass_height": 0.8}, ("center_of_mass_height", "height")),
    ("hull", {"center_of_mass_height": 0.01, "ground_clearance": 0.2}, ("center_of_mass_height", "ground_clearance")),
    ("hull", {"length": 0.44, "width": 1.0}, ("width", "length")),
    ("suspension", {"stiffness": 5e4, "stop_stiffness": 4350.0}, ("stop_stiffness", "stiffness")),
])  # fmt: skip
def test_swapped_sizes_are_refused_unless_they_are_meant(part, change, fields):
    whole = getattr(amphibious_vehicle(), part)
    with pytest.raises(ImplausibleValue, match=rf"{fields[0]} = .*{fields[1]} = .*{fields[0]}=unusual") as error:
        replace(whole, **change)
    assert f"{change[fields[0]]:g}" in str(error.value)
    assert getattr(replace(whole, **change | {fields[0]: unusual(change[fields[0]])}), fields[0]) == change[fields[0]]


def test_a_load_on_deck_passes():
    hull = amphibious_vehicle().hull
    deck = hull.ground_clearance + hull.height
    assert replace(hull, center_of_mass_height=deck + 0.9 * hull.height).center_of_mass_height > deck
    assert replace(amphibious_vehicle().wheel, width=0.2).width == 0.2  # as wide as high
