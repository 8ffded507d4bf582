"""A full-scale light four-wheel-drive truck: double wishbones, Ackermann steering, tyres 0.72 m high.

It is no particular make: all values are round ones of the class of light military and farm vehicles, chosen by us. A
different vehicle needs such a file, and nothing else.
"""

import math

from exumob.vehicle.parameters import Hull, Steering, Suspension, Vehicle, Wheel, WheelArches, Wishbones


def light_4x4() -> Vehicle:
    """1,340 kg light 4x4, wheelbase 2.40 m, ground clearance 0.24 m."""
    wishbones = Wishbones(
        upper_length=0.30,  # [m]
        lower_length=0.38,  # [m]
        ball_joint_inset=0.06,  # [m] ball joints inboard of the wheel's middle plane
        upper_height=0.12,  # [m] upper ball joint above the wheel centre
        lower_height=0.14,  # [m] lower ball joint below the wheel centre
        pivot_spread=0.30,  # [m] fore and aft pivots of an arm
        upper_pivot_drop=0.03,  # [m] camber gain in bump
    )
    front = Suspension(
        stiffness=27.0e3,  # [N/m] 1.5 Hz heave of the hull's share
        damping=1.7e3,  # [N s/m] 30 % of critical
        upright_mass=18.0,  # [kg]
        upright_size=0.25,  # [m]
        bump_travel=0.09,  # [m]
        rebound_travel=0.09,  # [m]
        stop_stiffness=4.0e5,  # [N/m]
        stop_softening=0.01,  # [m]
        wishbones=wishbones,
    )
    rear = Suspension(
        stiffness=24.0e3,  # [N/m]
        damping=1.5e3,  # [N s/m]
        upright_mass=18.0,  # [kg]
        upright_size=0.25,  # [m]
        bump_travel=0.09,  # [m]
        rebound_travel=0.09,  # [m]
        stop_stiffness=4.0e5,  # [N/m]
        stop_softening=0.01,  # [m]
        wishbones=wishbones,
    )
    return Vehicle(
        name="light 4x4",
        hull=Hull(
            mass=1160.0,  # [kg]
            length=3.70,  # [m]
            width=1.68,  # [m] covers the tyres, 1.635 m from face to face; cars of the class: VAZ-2121 Niva, 1.68 m
            height=0.90,  # [m]
            ground_clearance=0.24,  # [m]
            center_of_mass_height=0.62,  # [m] above ground
            center_of_mass_x=0.06,  # [m] ahead of mid wheelbase
            bow_length=0.35,  # [m]
            bow_height=0.45,  # [m]
            inertia=(260.0, 1150.0, 1250.0),  # [kg m^2] roll, pitch, yaw
            wheel_arches=WheelArches(),  # as the tyres need them
        ),
        wheel=Wheel(
            mass=27.0,  # [kg]
            diameter=0.72,  # [m]
            width=0.215,  # [m]
            inertia=(2.2, 1.3),  # [kg m^2] spin, transverse
        ),
        suspension=front,
        rear_suspension=rear,
        steering=Steering(
            geometry="ackermann",
            limit=math.radians(32.0),  # [rad]
        ),
        wheelbase=2.40,  # [m]
        track=1.42,  # [m]
    )
