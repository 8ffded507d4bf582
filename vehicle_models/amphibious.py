"""The paper's model-scale amphibious vehicle. Edit a value and run again: nothing else needs to change.

The paper gives the total mass, wheelbase and ground clearance; everything else is chosen by us and marked so.
"""

import math

from exumob.vehicle.parameters import Hull, Steering, Suspension, Vehicle, Wheel


def amphibious_vehicle() -> Vehicle:
    """57 kg amphibious vehicle, wheelbase 0.714 m, ground clearance 78 mm (paper, Sec. 4)."""
    return Vehicle(
        name="amphibious",
        hull=Hull(
            mass=49.0,  # [kg] 57 kg in total (paper) less four wheels with uprights
            length=1.00,  # [m] chosen by us
            width=0.44,  # [m] chosen by us
            height=0.20,  # [m] chosen by us
            ground_clearance=0.078,  # [m] paper
            center_of_mass_height=0.17,  # [m] above ground; chosen by us
            center_of_mass_x=0.0,  # [m] ahead of mid wheelbase; chosen by us
            bow_length=0.12,  # [m] the keel rises over the foremost 0.12 m; chosen by us
            bow_height=0.12,  # [m] ... by 0.12 m: a 45 degree rake; chosen by us
        ),
        wheel=Wheel(
            mass=1.5,  # [kg] chosen by us
            diameter=0.200,  # [m] chosen by us; the paper's depths are ratios of it
            width=0.080,  # [m] chosen by us
        ),
        suspension=Suspension(
            stiffness=4350.0,  # [N/m] 3 Hz heave of the hull's quarter mass; chosen by us
            damping=139.0,  # [N s/m] 30 % of critical; chosen by us
            upright_mass=0.5,  # [kg] chosen by us
            upright_size=0.06,  # [m] chosen by us
            bump_travel=0.020,  # [m] 40 mm travel in all; chosen by us
            rebound_travel=0.020,  # [m] chosen by us
            stop_stiffness=5.0e4,  # [N/m] chosen by us
        ),
        steering=Steering(
            geometry="parallel",  # both front wheels turn alike (paper)
            limit=math.radians(35.0),  # [rad] chosen by us
        ),
        wheelbase=0.714,  # [m] paper
        track=0.660,  # [m] chosen by us; a wheel steered 30 degrees clears the hull's side by 25 mm
    )
