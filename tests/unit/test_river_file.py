"""Rivers from netCDF: names and units of other programs, turned axes, dry land, and what is refused."""

import numpy as np
import pytest
import xarray as xr

from exumob.water.river_file import read_river
from exumob.water.water_field import water_at

X, Y = 5e5 + 2.0 * np.arange(7), 5.6e6 + 3.0 * np.arange(5)
BED = 2.0 + 0.1 * np.abs(np.arange(7) - 3.0) * np.ones((5, 1)) + 0.01 * np.arange(5)[:, None]
LEVEL = np.full((5, 7), 2.25)
U, V = 0.1 * np.ones((5, 7)), np.linspace(0.2, 0.6, 35).reshape(5, 7)


def river(names=("bed", "level", "velocity_x", "velocity_y"), units=("m", "m", "m/s", "m/s"), **changes):
    fields = dict(zip(names, (BED, LEVEL, U, V), strict=True)) | changes
    data = xr.Dataset(
        {name: (("y", "x"), np.array(v, float)) for name, v in fields.items()}, {"x": ("x", X), "y": ("y", Y)}
    )
    for name, unit in zip(names, units, strict=True):
        data[name].attrs["units"] = unit
    return data


def values(terrain, water, x, y):
    record, nodes = water.as_arrays(terrain)
    return (terrain.height_and_normal(x, y)[0], *water_at(record[0], nodes, x, y))


PROGRAMS = {
    "HEC-RAS": ("Terrain", "Water Surface", "Velocity X", "Velocity Y"),
    "TELEMAC-2D": ("BOTTOM", "FREE SURFACE", "VELOCITY U", "VELOCITY V"),
    "Serafin": ("B", "S", "U", "V"),
    "TELEMAC-2D, French": ("FOND", "SURFACE LIBRE", "VITESSE U", "VITESSE V"),
    "Delft3D FM": ("mesh2d_flowelem_bl", "mesh2d_s1", "mesh2d_ucx", "mesh2d_ucy"),
}


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("turned", [(), ("y",), ("x", "y")])
def test_names_of_programs_and_axes_either_way(tmp_path, program, turned):
    data = river(PROGRAMS[program], ("M", "m", "M/S", "m s-1"))
    data = data.isel({axis: slice(None, None, -1) for axis in turned})
    path = tmp_path / "river.nc"
    data.transpose("x", "y").expand_dims(time=1).to_netcdf(path)
    for source in (path, data):
        terrain, water = read_river(source)
        assert values(terrain, water, X[2], Y[3]) == pytest.approx((BED[3, 2], 2.25, 0.1, V[3, 2]), abs=1e-9)
        assert terrain.extent == pytest.approx((X[0], X[-1], Y[0], Y[-1]))


def test_depth_instead_of_level_and_standard_names():
    data = river(("ground", "h", "p", "q"), level=LEVEL).drop_vars("level")
    data["h"] = (("y", "x"), np.maximum(LEVEL - BED, 0.0))
    for name, standard in zip("ground p q".split(), ("altitude", "sea_water_x_velocity", "sea_water_y_velocity"),
                              strict=True):  # fmt: skip
        data[name].attrs["standard_name"] = standard
    assert values(*read_river(data), X[3], Y[2]) == pytest.approx((BED[2, 3], 2.25, 0.1, V[2, 3]), abs=1e-9)


def test_dry_land_however_it_is_marked():
    """nan, -9999, depth 0 and a level at the bed all mean the same."""
    dry = BED > 2.25
    marks = {
        "nan": river(level=np.where(dry, np.nan, LEVEL)),
        "-9999": river(level=np.where(dry, -9999.0, LEVEL)),
        "bed": river(level=np.where(dry, BED, LEVEL)),
        "velocities too": river(level=np.where(dry, np.nan, LEVEL), velocity_x=np.where(dry, np.nan, U)),
    }
    for name, data in marks.items():
        terrain, water = read_river(data)
        for x in X:
            bed, level, u, v = values(terrain, water, x, Y[1])
            wet = bed < 2.25
            assert level == pytest.approx(2.25), name
            assert (u > 0.0, v > 0.0) == (wet, wet), name


def test_land_behind_a_dike_stays_dry():
    bed = np.full((5, 7), 2.0)
    bed[:, 3] = 3.0
    data = river(bed=bed, level=np.where(np.arange(7) < 3, 2.5, np.nan) * np.ones((5, 1)))
    terrain, water = read_river(data)
    level = water.at([[x, Y[2]] for x in X], terrain)[0]
    np.testing.assert_allclose(level[:4], 2.5)
    np.testing.assert_allclose(level[4:], 2.0)


def with_unit(name, unit):
    data = river()
    data[name].attrs["units"] = unit
    return data


REFUSED = {
    "feet": (with_unit("level", "ft"), {}, r"level is in 'ft' and must be in m; multiply it by 0\.3048"),
    "knots": (with_unit("velocity_x", "knots"), {}, "velocity_x is in 'knots'"),
    "degrees": (with_unit("x", "degrees_east"), {}, "project the grid"),
    "no bed": (river().drop_vars("bed"), {}, r"no variable is known as the bed; there are .*level"),
    "no level": (river().drop_vars("level"), {}, r"level \(or depth\)"),
    "no velocity": (river().drop_vars("velocity_y"), {}, "For still water"),
    "holes": (river(bed=np.where(np.eye(5, 7) > 0, np.nan, BED)), {}, r"bed has holes at 5 of 35 points, the first"),
    "all dry": (river(level=BED), {}, "at or below the bed everywhere"),
    "contradiction": (river(depth=LEVEL - BED + 0.2), {}, r"differs from bed plus depth by up to 0\.2 m"),
    "negative depth": (river(depth=BED - 3.0).drop_vars("level"), {}, "is it a level"),
    "velocity lacks": (river(velocity_x=np.full((5, 7), 1e20)), {}, "velocity_x is missing at"),
    "uneven": (river().assign_coords(x=X**2 / 5e5), {}, None),
    "really uneven": (river().assign_coords(x=[0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0]), {}, "equally far apart"),
    "several instants": (xr.concat([river(), river()], "time"), {}, "2 values along time; choose the instant"),
    "no such instant": (xr.concat([river(), river()], "time"), {"time": 2}, "time = 2"),
    "mesh": (river().stack(face=("y", "x")).reset_index("face"), {}, "regular grid"),
    "name": (river(), {"names": {"bed": "zz"}}, "'zz' is no variable"),
    "role": (river(), {"names": {"beds": "bed"}}, "'beds' is not known"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_reason(case):
    data, options, text = REFUSED[case]
    if text is None:  # within the rounding of single precision
        read_river(data, **options)
        return
    with pytest.raises(ValueError, match=text):
        read_river(data, **options)


def test_still_water_an_instant_and_other_names():
    data = xr.concat([river(), river(level=LEVEL + 0.1)], "time").rename(bed="zz", velocity_x="a").drop_vars("a")
    still = {"bed": "zz", "velocity_x": None, "velocity_y": None}
    terrain, water = read_river(data, still, time=-1)
    assert values(terrain, water, X[3], Y[0]) == pytest.approx((2.0, 2.35, 0.0, 0.0))


@pytest.mark.parametrize(("contents", "said"), [
    (None, "does not exist; give a netCDF file of bed"), (b"", "is empty; give"), ("folder", "is a folder; give"),
    (b"no netCDF at all" * 40, "is not a netCDF file; give a netCDF file of bed, level and velocity"),
    (b"CDF\x01" + bytes(range(200)), "begins as a netCDF file does, but cannot be read"),
    (b"CDF\x05" + bytes(range(200)), "begins as a netCDF file does, but cannot be read"),
    (b"\x89HDF\r\n\x1a\n" + bytes(300), "begins as a netCDF file does, but cannot be read"),
])  # fmt: skip
def test_files_that_are_none(tmp_path, contents, said):
    path = tmp_path / "river.nc"
    if contents == "folder":
        path.mkdir()
    elif contents is not None:
        path.write_bytes(contents)
    with pytest.raises(ValueError, match=rf"river\.nc {said}") as found:
        read_river(path)
    assert "xarray" not in str(found.value) and "engine" not in str(found.value)


def test_files_cut_off_or_without_variables_of_their_own(tmp_path):
    whole = tmp_path / "whole.nc"
    river().to_netcdf(whole, engine="h5netcdf")
    (tmp_path / "cut.nc").write_bytes(whole.read_bytes()[:4000])
    with pytest.raises(ValueError, match=r"cut\.nc begins as a netCDF file does.*export it anew"):
        read_river(tmp_path / "cut.nc")
    river().to_netcdf(tmp_path / "group.nc", engine="h5netcdf", group="Results/2D")
    with pytest.raises(ValueError, match=r"group\.nc holds no variables outside its groups.*of the file itself"):
        read_river(tmp_path / "group.nc")
