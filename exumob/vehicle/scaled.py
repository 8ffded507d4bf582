"""The same vehicle in another size, by Froude's law: what a model says of its full-scale original, and the reverse.

Lengths go with the factor, masses with its cube (the same density), times and speeds with its root. So do the loads of
water, with the cube, as long as neither viscosity nor surface tension matters. Soil does not follow the law.
"""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Annotated, Any

from exumob.support.declared import checked, declared_fields
from exumob.support.quantities import Quantity
from exumob.vehicle.parameters import Vehicle

POWERS = {"1": 0.0, "rad": 0.0, "m": 1.0, "N/m": 2.0, "N s/m": 2.5, "kg": 3.0, "kg m^2": 5.0}
"""Power of the factor with which a quantity goes, by its unit: m = 1, s = 1/2, kg = 3."""


@checked
def scaled_vehicle(
    vehicle: Vehicle,
    factor: Annotated[float, Quantity("1", above=0.0, at_most=1e3, plausible=(0.01, 100.0))],
    name: str | None = None,
) -> Vehicle:
    """Return a vehicle of the same form and mass distribution, some times as large, with springs and dampers to match.

    Networks that know the vehicle know the other one, too, unless they sample the past or its hull has several boxes
    (`exumob.surrogates.model.SurrogateHydrodynamics`).

    Parameters
    ----------
    vehicle : Vehicle
    factor : float
        Length of the new vehicle over that of the given one [-].
    name : str, optional
        Default: the old name with the factor.

    Raises
    ------
    ValueError
        If the hull is a mesh, whose file keeps its size; or a value becomes impossible or implausible.
    """
    if vehicle.hull.mesh is not None:
        raise ValueError(
            f"scaled_vehicle.vehicle: Hull.mesh = {vehicle.hull.mesh} keeps its size; write the mesh {factor:g} times "
            "as large, and a vehicle file with it."
        )
    found = _scaled(vehicle, factor)
    values = {field.name: getattr(found, field.name) for field in declared_fields(Vehicle)}
    return Vehicle(**(values | {"name": f"{vehicle.name}, {factor:g} times as large" if name is None else name}))


def _scaled(part: Any, factor: float) -> Any:
    """Return a component in the other size, with all components of its own."""
    values = {}
    for field in declared_fields(type(part)):
        value = getattr(part, field.name)
        power = 0.0 if field.quantity is None else POWERS[field.quantity.unit]
        values[field.name] = _times(value, factor, power)
    return type(part)(**values)


def _times(value: Any, factor: float, power: float) -> Any:
    if is_dataclass(value):
        return _scaled(value, factor)
    if isinstance(value, tuple):
        return tuple(_times(one, factor, power) for one in value)
    return value * factor**power if power and value is not None else value
