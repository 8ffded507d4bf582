"""Hulls of boxes with wheel arches: one closed surface of the right volume and place, whatever they are made of."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from exumob.support.quantities import ImplausibleValue, unusual
from exumob.surrogates.vehicle_shape import geometry
from exumob.sweeps.experiment import amphibious_lane_change
from exumob.vehicle.body import arch_of, body_faces, is_plain, triangulated, with_shared_corners
from exumob.vehicle.hull import Box, Hull, WheelArches
from exumob.vehicle.wheel_motion import Axle
from exumob.water.hydrostatics import hydrostatic_wrench
from exumob.water.mesh_file import sound_triangles
from exumob.water.wetted_surface import Surface, frontal_share, hull_surface, hull_triangles
from vehicle_models.amphibious import amphibious_vehicle
from vehicle_models.large_4x4 import large_4x4
from vehicle_models.light_4x4 import light_4x4
from vehicle_models.small_car import small_car

BOX = Hull(mass=500.0, length=4.0, width=1.6, height=0.8, ground_clearance=0.2, center_of_mass_height=0.5)
AXLES = tuple(Axle(x, 0.65, 0.3, 0.1, -turn, turn, 0.08, 0.08, None) for x, turn in ((1.2, 0.5), (-1.2, 0.0)))
GIVEN = WheelArches(ahead=0.1, above=0.15, inboard=0.2, corners=2)
CABIN, BED, CHIMNEY = (
    Box(1.8, 1.4, 0.6, 1.0, -0.3), Box(1.0, 1.8, 0.3, 0.9, -1.6), Box(0.2, 0.2, 0.5, 1.3, 0.5),
)  # fmt: skip
HULLS = {
    "a box": BOX,
    "a raked box": replace(BOX, bow_length=0.6, bow_height=0.4, stern_length=0.3, stern_height=0.2),
    "square arches": replace(BOX, wheel_arches=GIVEN),
    "round arches": replace(BOX, wheel_arches=WheelArches()),
    "round arches in a raked box": replace(BOX, bow_length=1.2, bow_height=0.5, wheel_arches=WheelArches(corners=7)),
    "a cabin on top": replace(BOX, boxes=(CABIN,)),
    "a cabin and a bed that reach into it": replace(BOX, boxes=(CABIN, BED), wheel_arches=WheelArches()),
    "a chimney through the cabin": replace(BOX, boxes=(CABIN, CHIMNEY)),
    "flat arches that are open at the bow": replace(BOX, length=3.0, wheel_arches=WheelArches(above=0.09)),
    "arches through the deck": replace(BOX, height=0.3, wheel_arches=WheelArches()),
    "a raked box through another": replace(
        BOX, bow_length=1.0, bow_height=0.8, boxes=(Box(2.0, 1.2, 0.9, 0.3, 1.5, 0.7, 0.9),)
    ),
}  # fmt: skip


def volume_by_columns(hull, axles, step=0.01):
    """Volume from points, by the definition alone: in a box, and in no arch."""
    (x0, y0, z0), (x1, y1, z1) = hull.extent
    x, y, z = (np.arange(a + 0.5 * step, b, step) for a, b in ((x0, x1), (y0, y1), (z0, z1)))
    inside = np.zeros((len(x), len(y), len(z)), bool)
    for part in hull.parts:
        inside |= in_outline(part.side_profile(), x, z)[:, None] & (np.abs(y) < 0.5 * part.width)[:, None]
    for arch in () if hull.wheel_arches is None else (arch_of(hull.wheel_arches, axle) for axle in axles):
        outline = np.maximum(np.array(arch.outline), [-np.inf, -1.0])[::-1]
        inside &= ~(in_outline(outline, x, z)[:, None] & (np.abs(y) > arch.inner)[:, None])
    return inside.sum() * step**3, np.array([np.average(a, weights=inside.sum(axis=other)) for a, other in (
        (x, (1, 2)), (y, (0, 2)), (z, (0, 1)))])  # fmt: skip


def in_outline(outline, x, z):
    """Whether points of a grid lie within a convex outline, counter-clockwise."""
    edges = zip(outline, np.roll(outline, -1, axis=0), strict=True)
    return np.all([(b[0] - a[0]) * (z - a[1]) >= (b[1] - a[1]) * (x[:, None] - a[0]) for a, b in edges], axis=0)


@pytest.mark.parametrize("name", HULLS)
def test_a_body_is_one_closed_surface_of_the_right_volume(name):
    """Closed: each edge is met by two faces, to the last bit; nothing is enclosed twice (`sound_triangles`)."""
    hull = HULLS[name]
    triangles = triangulated(with_shared_corners(body_faces(hull, AXLES)))
    assert len(sound_triangles(name, triangles)) == len(triangles)
    surface = Surface(triangles, np.zeros(len(triangles), dtype=np.int64))
    volume, centroid = volume_by_columns(hull, AXLES)
    assert surface.volume == pytest.approx(volume, rel=5e-3)
    assert surface.centroid == pytest.approx(centroid, abs=5e-3)
    assert surface.centroid[1] == pytest.approx(0.0, abs=1e-12)
    mirrored = triangles[:, ::-1] * [1.0, -1.0, 1.0]
    assert Surface(mirrored, surface.cells).volume == pytest.approx(surface.volume, rel=1e-12)


def test_volumes_are_exact():
    """Square arches and boxes: sums of products, to 1e-12."""

    def volume(hull):
        triangles = triangulated(body_faces(hull, AXLES))
        return Surface(triangles, np.zeros(len(triangles), dtype=np.int64)).volume

    whole = 4.0 * 1.6 * 0.8
    arch = (2.0 * (0.3 + 0.1)) * (0.6 + 0.15 - 0.2) * (0.8 - (0.65 - 0.1 - 0.2))
    assert volume(BOX) == pytest.approx(whole, rel=1e-12)
    assert volume(HULLS["square arches"]) == pytest.approx(whole - 4.0 * arch, rel=1e-12)
    assert volume(HULLS["a cabin on top"]) == pytest.approx(whole + 1.8 * 1.4 * 0.6, rel=1e-12)
    beyond = 1.0 * 1.8 * 0.3 - 0.9 * 1.6 * 0.1 - 0.1 * 1.4 * 0.2  # the bed less what lies in the box and in the cabin
    assert volume(replace(BOX, boxes=(CABIN, BED))) == pytest.approx(whole + 1.8 * 1.4 * 0.6 + beyond, rel=1e-12)
    rakes = 0.5 * (0.6 * 0.4 + 0.3 * 0.2) * 1.6
    assert volume(HULLS["a raked box"]) == pytest.approx(whole - rakes, rel=1e-12)
    half_circle = 64 * 0.4**2 * math.tan(0.5 * math.pi / 64)  # a polygon that touches it with 64 faces
    arch = 0.45 * (0.8 * (0.75 - 0.4 - 0.2) + half_circle)
    many = WheelArches(ahead=0.1, above=0.15, inboard=0.2, corners=64)
    assert volume(replace(BOX, wheel_arches=many)) == pytest.approx(whole - 4.0 * arch, rel=1e-12)


@pytest.mark.parametrize("make", [light_4x4, small_car, large_4x4], ids=lambda f: f.__name__)
def test_surfaces_of_a_vehicle_are_the_same_body(make):
    vehicle = make()
    strips, closed = hull_surface(vehicle), hull_triangles(vehicle)
    assert len(sound_triangles(vehicle.name, closed)) == len(closed)
    whole = Surface(closed, np.zeros(len(closed), dtype=np.int64))
    assert strips.volume == pytest.approx(whole.volume, rel=1e-12)
    assert strips.centroid == pytest.approx(whole.centroid, abs=1e-12)
    areas = np.linalg.norm(np.cross(closed[:, 1] - closed[:, 0], closed[:, 2] - closed[:, 0]), axis=1)
    assert areas.min() > 1e-9
    force = hydrostatic_wrench(strips, np.eye(3), (0.0, 0.0, 10.0), 40.0)[:3]  # far below the surface
    assert force == pytest.approx([0.0, 0.0, 9810.0 * whole.volume], abs=1e-6 * 9810.0 * whole.volume)
    assert strips.cells.max() == strips.n_cells - 1
    port = strips.cells % 2 == 1
    assert strips.triangles[port, :, 1].min() >= -1e-12 and strips.triangles[~port, :, 1].max() <= 1e-12


def test_a_plain_box_keeps_its_surface():
    vehicle = amphibious_vehicle()
    assert is_plain(vehicle.hull)
    own = triangulated(body_faces(vehicle.hull, vehicle.axles)) - vehicle.hull_origin
    volume = Surface(own, np.zeros(len(own), dtype=np.int64)).volume
    assert hull_surface(vehicle).volume == pytest.approx(volume, rel=1e-12)


def test_walls_of_arches_lie_in_the_shade_of_the_body():
    """Square arches add eight walls of known size across the stream, and nothing to what is seen from ahead.

    Both count up to half of the height, 0.6 m above the ground; the arches are higher.
    """
    triangles = triangulated(body_faces(HULLS["square arches"], AXLES))
    surface = Surface(triangles, np.zeros(len(triangles), dtype=np.int64))
    ends, walls = 2.0 * 1.6 * 0.4, 8.0 * 0.45 * 0.4
    assert frontal_share(surface) == pytest.approx(ends / (ends + walls), rel=1e-9)
    box = triangulated(body_faces(BOX, AXLES))
    assert frontal_share(Surface(box, np.zeros(len(box), dtype=np.int64))) == pytest.approx(1.0, rel=1e-12)


def test_default_arches_leave_the_clearance_and_grow_with_steering_and_travel():
    front, rear = (arch_of(WheelArches(clearance=0.04), axle).distances for axle in AXLES)
    assert rear == pytest.approx((0.04, 0.04 + 0.08, 0.04))  # ahead, above in bump, inboard
    assert front[0] == pytest.approx(0.04 + math.hypot(0.3, 0.1) - 0.3, abs=2e-3)
    assert front[2] == pytest.approx(0.04 + 0.3 * math.sin(0.5) + 0.1 * math.cos(0.5) - 0.1)
    higher = arch_of(WheelArches(clearance=0.04), AXLES[1]._replace(bump=0.1)).distances
    assert higher[1] == pytest.approx(rear[1] + 0.02)
    assert arch_of(WheelArches(), AXLES[1]).distances == pytest.approx((0.03, 0.11, 0.03))  # a twentieth of 0.6 m


def test_networks_know_another_shape():
    vehicle = amphibious_vehicle()
    assert geometry(vehicle)["hull.mesh"] is None
    changed = [
        replace(vehicle.hull, wheel_arches=WheelArches()), replace(vehicle.hull, boxes=(Box(0.3, 0.3, 0.1, 0.278),)),
        replace(vehicle.hull, stern_length=0.1, stern_height=0.1),
    ]  # fmt: skip
    texts = [geometry(replace(vehicle, hull=hull))["hull.mesh"] for hull in changed]
    assert None not in texts and len(set(texts)) == 3


BAD = [
    ({"boxes": (CABIN,), "mesh": "hull.stl"}, r"Hull\.boxes and Hull\.mesh are both given"),
    ({"wheel_arches": GIVEN, "mesh": "hull.stl"}, r"Hull\.wheel_arches and Hull\.mesh are both given"),
    ({"stern_length": 4.5}, r"Hull\.stern_length = 4\.5 is outside \[0, 4\]"),
    ({"bow_length": 3.0, "stern_length": 2.0}, r"Hull\.stern_length = 2\.0 is outside \[0, 1\]; .*less bow_length"),
    ({"stern_height": 0.9}, r"Hull\.stern_height = 0\.9 is outside \[0, 0\.8\]"),
    ({"boxes": CABIN}, r"Hull\.boxes = Box"),
    ({"boxes": (3,)}, r"Hull\.boxes\[0\] = 3 must be a Box"),
    ({"wheel_arches": 0.1}, r"Hull\.wheel_arches = 0\.1 must be a WheelArches"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_refused_hulls(change, message):
    with pytest.raises(ValueError, match=message):
        replace(BOX, **change)


@pytest.mark.parametrize(("values", "message"), [
    ({"ahead": -0.1}, r"WheelArches\.ahead = -0\.1"), ({"corners": 1}, r"WheelArches\.corners = 1"),
    ({"inboard": math.nan}, r"WheelArches\.inboard"), ({"clearance": "wide"}, r"WheelArches\.clearance"),
])  # fmt: skip
def test_refused_arches(values, message):
    with pytest.raises(ValueError, match=message):
        WheelArches(**values)


def test_arches_that_meet():
    car = small_car()
    with pytest.raises(ValueError, match=r"WheelArches\.inboard = 0\.7 m lets the arches .*1\.29 m apart.*track"):
        replace(car, hull=replace(car.hull, wheel_arches=WheelArches(inboard=0.7)))


def test_shared_corners_stand_on_the_edges_of_their_neighbours():
    faces = body_faces(HULLS["a cabin and a bed that reach into it"], AXLES)
    whole = with_shared_corners(faces)
    assert sum(map(len, whole)) > sum(map(len, faces))
    edges = [
        tuple(map(tuple, edge)) for face in whole for edge in itertools.pairwise([*face.tolist(), face[0].tolist()])
    ]
    assert sorted(edges) == sorted(edge[::-1] for edge in edges)


def test_a_sweep_over_the_stern_takes_no_networks_of_another_shape():
    base = amphibious_lane_change()
    assert base.with_one_model([{"hull.mass": 49.0}]).hydrodynamics == "networks"
    cases = [{"hull.stern_length": length, "hull.stern_height": 0.05} for length in (0.0, 0.1)]
    assert base.with_one_model(cases).hydrodynamics == "calibrated"


def test_a_box_that_hangs_in_the_air_is_asked_about(vehicle):
    """Heights count from the ground: a cabin meant 1.0 m above the deck, a bed behind the hull; a tower is one hull."""
    hull = vehicle.hull
    deck = hull.ground_clearance + hull.height
    with pytest.raises(ImplausibleValue, match=r"Hull.boxes\[0\] hangs in the air: .* from 1\.\d+ to .* counts from"):
        replace(hull, boxes=(Box(0.3, 0.3, 0.1, deck + 1.0),))
    with pytest.raises(ImplausibleValue, match=r"Hull.boxes\[1\] hangs in the air"):
        replace(hull, boxes=(Box(0.3, 0.3, 0.1, deck), Box(0.3, 0.3, 0.1, hull.ground_clearance, center_x=-2.0)))
    tower = (Box(0.3, 0.3, 0.1, deck + 0.1), Box(0.3, 0.3, 0.1, deck))
    assert len(replace(hull, boxes=tower).parts) == 3
    assert len(replace(hull, boxes=(Box(0.3, 0.3, 0.1, unusual(deck + 0.5)),)).parts) == 2
