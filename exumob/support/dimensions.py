"""Names along the dimensions of results: what they stand for, as the attributes that every variable has."""

from __future__ import annotations

import xarray as xr

DIMENSIONS = {
    "body": "hull, and each wheel with its upright",
    "wheel": "wheel",
    "front_wheel": "steered wheel",
    "axis": "axis: x forward, y left, z up; of the world or of the body, as the variable says",
    "quaternion_component": "component of a quaternion, scalar first",
    "component": "force and moment about the body's origin",
    "state": "state of paper Eq. 7",
    "work_kind": "what does the work",
    "constraint_level": "level on which the constraints are looked at",
    "condition": "what can befall the vehicle, worst first",
    "range_kind": "range of one input of the networks, or of all together",
    "frame_component": "place and heading of the grid's frame",
    "member": "member of an ensemble of networks",
    "model": "model of the water's loads",
    "scenario": "water and maneuver",
}
"""Meaning of the names along each dimension."""


def with_described_names(dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset with ``units`` and ``long_name`` at the names along its dimensions, where it has names."""
    return dataset.assign_coords(
        {
            name: (name, dataset[name].values, {"units": "1", "long_name": text})
            for name, text in DIMENSIONS.items()
            if name in dataset.coords and dataset[name].dims == (name,)
        }
    )
