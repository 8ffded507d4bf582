"""The paper's model-scale amphibious vehicle. Edit a value, run again: nothing else needs to change.

The paper gives the total mass, wheelbase and ground clearance; everything else is ours and says so.
"""

import math

from exumob.vehicle.parameters import Hull, Steering, Suspension, Vehicle, Wheel


def amphibious_vehicle() -> Vehicle:
    """57 kg amphibious vehicle, wheelbase 0.714 m, ground clearance 78 mm (paper, Sec. 4)."""
    return Vehicle(
        name="amphibious",
        hull=Hull(
            mass=49.0,  # [kg] 57 kg in total (paper) less four wheels with uprights
            length=1.00,  # [m] ours
            width=0.44,  # [m] ours
            height=0.20,  # [m] ours
            ground_clearance=0.078,  # [m] paper
            center_of_mass_height=0.17,  # [m] above ground; ours
            center_of_mass_x=0.0,  # [m] ahead of mid wheelbase; ours
            bow_length=0.12,  # [m] the keel rises over the foremost 0.12 m; ours
            bow_height=0.12,  # [m] ... by 0.12 m: a 45 degree rake; ours
        ),
        wheel=Wheel(
            mass=1.5,  # [kg] ours
            diameter=0.200,  # [m] ours; the paper's depths are ratios of it
            width=0.080,  # [m] ours
        ),
        suspension=Suspension(
            stiffness=4350.0,  # [N/m] 3 Hz heave of the hull's quarter mass; ours
            damping=139.0,  # [N s/m] 30 % of critical; ours
            upright_mass=0.5,  # [kg] ours
            upright_size=0.06,  # [m] ours
            bump_travel=0.020,  # [m] 40 mm travel in all; ours
            rebound_travel=0.020,  # [m] ours
            stop_stiffness=5.0e4,  # [N/m] ours
        ),
        steering=Steering(
            geometry="parallel",  # both front wheels turn alike (paper)
            limit=math.radians(35.0),  # [rad] ours
        ),
        wheelbase=0.714,  # [m] paper
        track=0.660,  # [m] ours; a wheel steered 30 degrees clears the hull's side by 25 mm
    )
