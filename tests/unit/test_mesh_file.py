"""Hull meshes: sound ones count for what they enclose, all others are refused by name."""

import dataclasses
import itertools
import sys

import numpy as np
import pytest

from exumob.simulation.water_models import hydrodynamics_named
from exumob.surrogates.vehicle_shape import geometry
from exumob.water.conditions import Water
from exumob.water.hydrostatics import hydrostatic_wrench
from exumob.water.mesh_file import mesh_digest, mesh_triangles, mesh_wheel_gap
from exumob.water.mesh_lines import lines_through
from exumob.water.wetted_surface import Surface, hull_surface, hull_triangles

trimesh = pytest.importorskip("trimesh")

SIZE, PLACE = (1.0, 0.44, 0.2), (0.0, 0.0, 0.178)
"""Size and middle of the amphibious vehicle's hull [m]."""


def box(size=SIZE, place=PLACE):
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(place)
    return mesh


def joined(*meshes):
    return trimesh.util.concatenate(meshes)


def inverted(mesh):
    mesh = mesh.copy()
    mesh.invert()
    return mesh


def with_faces(faces, mesh=None):
    mesh = mesh or box()
    return trimesh.Trimesh(mesh.vertices, faces(mesh.faces), process=False)


def one_turned(faces):
    return np.concatenate([faces[:-1], faces[-1:, ::-1]])


def spiked(depth):
    """A box one point of whose deck is pushed down, through the keel if by more than 0.2 m."""
    mesh = box().subdivide().subdivide()
    middle = np.argmin(np.linalg.norm(mesh.vertices - [0.0, 0.0, 0.278], axis=1))
    mesh.vertices[middle, 2] -= depth
    return mesh


def twisted(turned):
    """A box whose bow's corners are mirrored: it cuts through itself amidships, `turned` from the middle."""
    mesh = box()
    corners = mesh.vertices.copy()
    bow = corners[:, 0] > 0.0
    corners[bow, 1] *= -turned
    return trimesh.Trimesh(corners, mesh.faces, process=False)


def tub(wall=0.01):
    """A box with walls, open on top."""
    inner = box(np.subtract(SIZE, (2.0 * wall, 2.0 * wall, wall)), (0.0, 0.0, PLACE[2] + 0.5 * wall))
    outer, inner = ([t for t in mesh.triangles if t[:, 2].min() < 0.277] for mesh in (box(), inverted(inner)))
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    rims = [np.column_stack([corners * half, np.full(4, 0.278)]) for half in ((0.5, 0.22), (0.5 - wall, 0.22 - wall))]
    (a, b), after = rims, [1, 2, 3, 0]
    rim = [t for k, m in enumerate(after) for t in ([a[k], a[m], b[m]], [a[k], b[m], b[k]])]
    triangles = np.array([*outer, *inner, *rim])
    return trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def overlapping(by):
    half = (0.5 + 0.5 * by, 0.44, 0.2)
    return joined(*(box(half, (s * (0.25 - 0.25 * by), 0.0, 0.178)) for s in (-1.0, 1.0)))


def saved(mesh, folder, name="hull.stl"):
    mesh.export(folder / name)
    return folder / name


BAD = {
    "overlapping": (lambda: overlapping(0.2), r"2 closed bodies of 0\.0528 and 0\.0528 m\^3 that overlap.*about 0\.01"),
    "overlapping by a little": (lambda: overlapping(0.002), "2 closed bodies .* that overlap"),
    "nested": (lambda: joined(box(), box((0.5, 0.2, 0.1))), r"0\.088 and 0\.01 m\^3 that overlap or lie within"),
    "three": (lambda: joined(overlapping(0.2), box((0.1, 0.1, 0.4))), "3 closed bodies"),
    "hollow": (lambda: joined(box(), inverted(box((0.98, 0.42, 0.18)))), r"0\.088 and -0\.07409 m\^3.*inner shells"),
    "one inside out": (
        lambda: joined(box((0.4, 0.44, 0.2), (-0.3, 0, 0.178)), inverted(box((0.4, 0.44, 0.2), (0.3, 0, 0.178)))),
        "2 closed bodies .*turned inside out",
    ),
    "inside out": (lambda: inverted(box()), r"faces that point inwards \(enclosed volume -0\.088 m\^3\)"),
    "the same twice": (lambda: joined(box(), box()), "12 of 24 faces stand twice"),
    "a double wall": (lambda: with_faces(lambda f: np.concatenate([f, f[:1, ::-1]])), "1 of 13 faces stand twice"),
    "a hole": (lambda: with_faces(lambda f: f[:-1]), "not watertight: 3 edges have a face on one side only"),
    "a sheet": (lambda: with_faces(lambda f: f[:2]), "not watertight"),
    "one face turned": (lambda: with_faces(one_turned), "faces point inwards beside others"),
    "a wall in common": (
        lambda: joined(*(box((0.5, 0.44, 0.2), (s, 0, 0.178)) for s in (-0.25, 0.25))),
        "more than two faces meet|stand twice",
    ),
    "a spike through the keel": (lambda: spiked(0.3), "cuts through itself: about"),
    "twisted": (lambda: twisted(0.5), "cuts through itself|encloses nothing"),
    "a bow-tie": (lambda: twisted(1.0), "encloses nothing on balance: it cuts through itself"),
    "an open tub": (tub, r"11\.1 % of the box round it \(at least 20 %\).* thick in the mean .*: a shell with walls"),
    "an open tub with thick walls": (lambda: tub(0.015), "a shell with walls"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_refuses(kind, tmp_path):
    mesh, message = BAD[kind]
    with pytest.raises(ValueError, match=message):
        mesh_triangles(saved(mesh(), tmp_path))


GOOD = {
    "a box": (box, 0.088),
    "a dented box": (lambda: spiked(0.15), None),
    "a catamaran": (lambda: joined(*(box((1.0, 0.15, 0.2), (0.0, y, 0.178)) for y in (-0.14, 0.14))), 0.06),
    "a slim catamaran": (lambda: joined(*(box((1.0, 0.08, 0.15), (0.0, y, 0.178)) for y in (-0.4, 0.4))), 0.024),
    "a hull with a mast": (lambda: joined(box(), box((0.02, 0.02, 1.0), (0.0, 0.0, 0.779))), 0.0884),
    "bodies that touch": (
        lambda: joined(box((0.5, 0.44, 0.2), (-0.25, 0, 0.178)), box((0.5, 0.4, 0.18), (0.25, 0, 0.178))),
        0.08,
    ),
    "an ellipsoid": (
        lambda: trimesh.creation.icosphere(3).apply_scale((0.5, 0.22, 0.1)).apply_translation(PLACE),
        None,
    ),
    "collapsed faces": (lambda: with_faces(lambda f: np.concatenate([f, [[0, 0, 1]]])), 0.088),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "suffix"), list(itertools.product(GOOD, (".stl", ".obj", ".ply"))))
def test_sound_meshes_pass_with_their_volume(kind, suffix, tmp_path):
    mesh, volume = GOOD[kind]
    triangles = mesh_triangles(saved(mesh(), tmp_path, f"hull{suffix}"))
    expected = mesh().volume if volume is None else volume
    assert Surface(triangles, np.zeros(len(triangles), np.int64)).volume == pytest.approx(expected, rel=1e-6)
    assert not triangles.flags.writeable


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("hull.stl", b"", "cannot be read as a mesh|holds no triangles"),
        ("hull.stl", b"\x00" * 200, "cannot be read as a mesh|holds no triangles"),
        ("hull.obj", b"not a mesh", "cannot be read as a mesh|holds no triangles"),
        ("hull.obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", r"corners: .* not finite"),
        ("hull.xyz", b"1 2 3\n", "cannot be read as a mesh|holds no triangles"),
        ("hull.txt", b"v 0 0 0", "cannot be read as a mesh"),
        ("hull.gltf", b"{}", "keeps its shape in other files"),
    ],
)
def test_files_that_are_no_meshes(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        mesh_triangles(tmp_path / name)


def test_missing_file_and_missing_package(monkeypatch, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"hull\.stl"):
        mesh_triangles(tmp_path / "hull.stl")
    (tmp_path / "hull.stl").write_bytes(b"something")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match=r"exumob\[mesh\]"):
        mesh_triangles(tmp_path / "hull.stl")


def with_mesh(vehicle, mesh, folder):
    return dataclasses.replace(vehicle, hull=dataclasses.replace(vehicle.hull, mesh=saved(mesh, folder)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.apply_scale(1000.0), r"from -500 to 500 m along x.*likely in millimetres: scale it by 0\.001"),
        (lambda m: m.apply_scale(100.0), "likely in centimetres"),
        (lambda m: m.apply_scale(1.0 / 0.0254), r"likely in inches: scale it by 0\.0254"),
        (lambda m: m.apply_scale(1e-3), "likely in kilometres"),
        (lambda m: m.apply_translation((456_789.0, 0.0, 0.0)), "Move it to the design frame"),
        (lambda m: m.apply_translation((0.0, 0.0, -0.178)), "along z.*Move it to the design frame"),
        (lambda m: m.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]), "x, z, y for x, y, z"),
        (lambda m: m.apply_scale((1.0, 1.6, 1.0)), r"track = 0\.66 m .* the front left tyre inside the hull"),
    ],
)  # fmt: skip
def test_must_agree_with_the_vehicle(vehicle, change, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        hull_triangles(with_mesh(vehicle, change(box()), tmp_path))


def test_a_body_over_the_wheels_is_a_mesh_with_arches(vehicle, tmp_path):
    hull = dataclasses.replace(vehicle.hull, width=0.7)
    with pytest.raises(ValueError, match=r"tyres .* inside the hull, a box; .*Hull\.mesh.* with wheel arches"):
        dataclasses.replace(vehicle, hull=hull)
    high, low = box((1.0, 0.7, 0.05), (0.0, 0.0, 0.253)), box((1.0, 0.44, 0.15), (0.0, 0.0, 0.153))
    arched = dataclasses.replace(vehicle, hull=dataclasses.replace(hull, mesh=saved(joined(high, low), tmp_path)))
    assert hull_surface(arched).volume == pytest.approx(0.7 * 0.05 + 0.44 * 0.15, rel=1e-6)
    assert mesh_wheel_gap(arched).gap == pytest.approx(0.228 - 0.22, abs=2e-4)  # under the roof, in full bump


@pytest.mark.parametrize(
    ("high", "width", "message"),
    [
        (0.215, 0.44, r"the (front|rear) (left|right) tyre.*, 20 mm up, at .* 5\.0 mm deep.*larger wheel arches"),
        (0.228, 0.50, r"front (left|right) tyre steered [+-]35\.0 deg, .* mm deep.*Steering\.limit = 35 deg"),
    ],
)
def test_tyres_must_not_enter_a_mesh_on_their_way(vehicle, high, width, message, tmp_path):
    """Clear at ride height and straight ahead; a roof that is too low, a body that is too wide between the wheels."""
    hull = dataclasses.replace(vehicle.hull, width=0.7)
    upper = box((1.0, 0.7, 0.278 - high), (0.0, 0.0, 0.5 * (0.278 + high)))
    lower = box((1.0, width, high - 0.078), (0.0, 0.0, 0.5 * (high + 0.078)))
    mesh = saved(joined(upper, lower), tmp_path)
    with pytest.raises(ValueError, match=message):
        hull_triangles(dataclasses.replace(vehicle, hull=dataclasses.replace(hull, mesh=mesh)))


def test_two_halves_lift_as_the_whole(vehicle, tmp_path):
    """Bodies that touch: the walls between them press on each other, and the sum is Archimedes'."""
    lifts = [
        hydrostatic_wrench(hull_surface(with_mesh(vehicle, mesh, tmp_path)), np.eye(3), (0.0, 0.0, 0.17), 0.178)[2]
        for mesh in (
            box(),
            joined(box((0.5, 0.44, 0.2), (-0.25, 0, 0.178)), box((0.5, 0.43999, 0.2), (0.25, 0, 0.178))),
        )
    ]
    assert lifts[0] == pytest.approx(1000.0 * 9.81 * 0.44 * 0.1, rel=1e-6)
    assert lifts[1] == pytest.approx(lifts[0], rel=1e-4)


def test_digest_follows_the_contents(vehicle, tmp_path):
    first = with_mesh(vehicle, box(), tmp_path)
    one = mesh_digest(first.hull)
    assert mesh_digest(vehicle.hull) == ""
    volume = hull_surface(first).volume
    second = with_mesh(vehicle, box((1.0, 0.42, 0.2)), tmp_path)  # the same name
    assert second == first
    assert mesh_digest(second.hull) != one
    assert hull_surface(second).volume == pytest.approx(volume * 0.42 / 0.44, rel=1e-6)


def test_lines_through_a_corner_and_along_a_face():
    u = np.array([-0.5, 0.0, 0.5, 0.6])  # on edges, through the diagonals of the faces, beside the box
    found = lines_through(box((1.0, 1.0, 1.0), (0, 0, 0)).triangles, 2, u, u, -np.inf, 0.25)
    assert found.wrong.max() == 0.0
    assert found.enclosed[1, 1] == pytest.approx(0.75)
    assert found.enclosed[3].max() == 0.0


def test_networks_know_the_contents_of_a_mesh(vehicle, tmp_path):
    one = geometry(with_mesh(vehicle, box(), tmp_path))
    other = geometry(with_mesh(vehicle, box((1.0, 0.42, 0.2)), tmp_path))
    assert one["hull.mesh"] != other["hull.mesh"]
    assert {k: v for k, v in one.items() if k != "hull.mesh"} == {k: v for k, v in other.items() if k != "hull.mesh"}
    assert geometry(vehicle)["hull.mesh"] is None


@pytest.mark.usefixtures("fresh_warnings")
def test_a_mesh_is_looked_at_before_what_the_networks_lack(vehicle, tmp_path, caplog):
    """Of a hull that the networks do not know either: one message, the one that matters."""
    (tmp_path / "empty.stl").write_bytes(b"")
    hull = dataclasses.replace(vehicle.hull, mesh=tmp_path / "empty.stl", width=0.4)
    with pytest.raises(ValueError, match=r"empty\.stl"):
        hydrodynamics_named("auto", dataclasses.replace(vehicle, hull=hull), Water(0.1))
    assert caplog.records == []
