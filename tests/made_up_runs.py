"""Runs that were never computed: a vehicle moves as a test says, for the verdict on it."""

import numpy as np
import xarray as xr

import exumob.vehicle.scaled
from exumob.support.constants import GRAVITY
from exumob.support.provenance import parameters_json
from exumob.vehicle.motion import BODIES, WHEELS
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water
from vehicle_models.amphibious import amphibious_vehicle


def sized_amphibious(factor: float) -> Vehicle:
    """The amphibious vehicle in another size."""
    return exumob.vehicle.scaled.scaled_vehicle(amphibious_vehicle(), factor, "amphibious")


def made_up_run(
    factor=1.0, end=6.0, step=0.01, tread=1.0, forward=0.8, lateral=0.0, load=0.6, roll=0.0, pitch=0.0, sinkage=0.05,
    height=0.17, depth=0.12, push=(0.0, 0.0), steering=0.0, belly=0.0, status="completed", **attrs,
) -> xr.Dataset:  # fmt: skip
    """A run along x; each value a number or a function of time, in the units of the vehicle of factor 1.

    Parameters
    ----------
    factor : float
        Scale of the vehicle; times, speeds and forces scale with it as Froude's law says.
    tread, forward, lateral : [m/s]
    load, belly : share of the weight on the wheels, on the hull
    sinkage : over the wheel's radius
    height : of the hull's origin [m]
    push : force of the water along world x and y [N]
    """
    vehicle = sized_amphibious(factor)
    tick = np.sqrt(factor)
    time = np.linspace(0.0, end, round(end / step) + 1)

    def series(value, unit=1.0):
        return unit * (np.vectorize(value, otypes=[float])(time) if callable(value) else np.full(len(time), value))

    n = len(time)
    position, water_load, soil_force = np.zeros((n, 5, 3)), np.zeros((n, 5, 3)), np.zeros((n, 4, 3))
    v_x, v_y = series(forward, tick), series(lateral, tick)
    for k, speed in enumerate((v_x, v_y)):
        way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step * tick)])
        position[:, :, k] = way[:, None]
    position[:, :, 2] = series(height, factor)[:, None]
    hull_force = np.zeros((n, 3))
    hull_force[:, 2] = series(belly, GRAVITY * vehicle.mass)
    soil_force[..., 2] = series(load, 0.25 * GRAVITY * vehicle.mass)[:, None]
    for k in range(2):
        water_load[:, 0, k] = series(push[k], factor**3)
    bodies, wheels = ("time", "body"), ("time", "wheel")

    def alike(value, number, unit=1.0):
        return np.repeat(series(value, unit)[:, None], number, axis=1)

    return xr.Dataset(
        {
            "position": ((*bodies, "axis"), position), "water_load": ((*bodies, "axis"), water_load),
            "hull_soil_force": (("time", "axis"), hull_force),
            "hull_contact_center": (("time", "axis"), position[:, 0] + [0.1 * factor, 0.0, 0.0]),
            "soil_force": ((*wheels, "axis"), soil_force), "yaw": (bodies, np.zeros((n, 5))),
            "roll": (bodies, alike(roll, 5)), "pitch": (bodies, alike(pitch, 5)),
            "forward_velocity": ("time", v_x), "lateral_velocity": ("time", v_y),
            "wheel_speed": (wheels, alike(tread, 4, tick / vehicle.wheel.radius)),
            "sinkage": (wheels, alike(sinkage, 4, vehicle.wheel.radius)),
            "slip_ratio": (wheels, np.full((n, 4), 0.3)), "spin_power": (wheels, np.full((n, 4), 25.0)),
            "steering_angle": (("time", "front_wheel"), alike(steering, 2)),
        },
        coords={"time": tick * time, "body": list(BODIES), "wheel": list(WHEELS), "axis": ["x", "y", "z"]},
        attrs={
            "parameters": parameters_json({"vehicle": vehicle, "water": Water(factor * depth) if depth else None}),
            "status": status, **attrs,
        },
    )  # fmt: skip
