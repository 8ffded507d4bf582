"""A small passenger car: a Toyota Yaris of 2005 to 2010 as far as it is published, and rules of the class beyond that.

Published values carry their source. The rules, for what is not: an eighth of the mass is unsprung; the centre of mass
of what is sprung lies at 0.40 of the height; radii of gyration are 0.40 of the track in roll, 0.46 and 0.48 of the
wheelbase in pitch and yaw; the body heaves at 1.25 Hz in front and 1.4 Hz at the back, damped by 30 % of critical;
lengths without a source are round ones of such cars, chosen by us.

The body is watertight here: all of it up to the waist lifts, and so does the cabin. Of a real car the engine bay fills
at once and the cabin within minutes. UNSW's Yaris of 1.05 t floated in 0.60 m of water (Smith et al., WRL TR 2017/07);
this one, whose whole body lifts, in less: see docs/limits.md. Its tyres are rigid, as all are.
"""

import math

from exumob.vehicle.parameters import Box, Hull, Steering, Suspension, Vehicle, Wheel, WheelArches


def small_car() -> Vehicle:
    """1,050 kg passenger car, wheelbase 2.46 m, ground clearance 0.12 m."""
    front = Suspension(
        stiffness=17.0e3,  # [N/m] rule: 1.25 Hz with 276 kg
        damping=1.3e3,  # [N s/m] rule: 30 % of critical
        upright_mass=17.0,  # [kg] rule: with the wheel, a quarter of an eighth of the mass
        upright_size=0.20,  # [m] chosen by us
        bump_travel=0.080,  # [m] chosen by us
        rebound_travel=0.080,  # [m] chosen by us
        stop_stiffness=2.5e5,  # [N/m] chosen by us: fifteen times the spring
        stop_softening=0.01,  # [m] chosen by us
    )  # a strut: the wheel moves straight up and down
    rear = Suspension(
        stiffness=14.3e3,  # [N/m] rule: 1.4 Hz with 184 kg
        damping=0.97e3,  # [N s/m] rule: 30 % of critical
        upright_mass=17.0,  # [kg] a quarter of an eighth of the mass, with the wheel
        upright_size=0.20,  # [m] chosen by us
        bump_travel=0.080,  # [m] chosen by us
        rebound_travel=0.080,  # [m] chosen by us
        stop_stiffness=2.5e5,  # [N/m] chosen by us
        stop_softening=0.01,  # [m] chosen by us
    )
    return Vehicle(
        name="small car",
        hull=Hull(
            mass=920.0,  # [kg] 1,052 kg in total (moto123.com, road test 2006) less an eighth
            length=3.785,  # [m] auto.cz, table of the generations of the Yaris
            width=1.695,  # [m] auto.cz, the same table
            height=0.78,  # [m] up to the waist; chosen by us
            ground_clearance=0.12,  # [m] small cars have less (Shand et al. 2011); VW Polo 0.110 m (car-catalog.com)
            center_of_mass_height=0.61,  # [m] rule: 0.40 of the height of 1.530 m (auto.cz)
            center_of_mass_x=0.246,  # [m] 60 % of the weight on the front axle: front-wheel drive; chosen by us
            center_x=0.10,  # [m] overhangs 0.76 m in front and 0.56 m at the back; chosen by us
            bow_length=0.30,  # [m] chosen by us
            bow_height=0.20,  # [m] chosen by us
            stern_length=0.20,  # [m] chosen by us
            stern_height=0.15,  # [m] chosen by us
            inertia=(320.0, 1180.0, 1280.0),  # [kg m^2] rule: radii of gyration 0.59, 1.13 and 1.18 m
            boxes=(
                Box(
                    length=2.30,  # [m] the cabin, from the windscreen's middle; chosen by us
                    width=1.40,  # [m] chosen by us
                    height=0.63,  # [m] up to the height of 1.530 m (auto.cz)
                    bottom=0.90,  # [m] on the waist
                    center_x=-0.35,  # [m] chosen by us
                ),
            ),
            wheel_arches=WheelArches(),  # as the tyres need them
        ),
        wheel=Wheel(
            mass=16.0,  # [kg] chosen by us
            diameter=0.603,  # [m] 185/60 R15 (driving.ca, 2008): 15 in and twice 0.60 times 185 mm
            width=0.185,  # [m] 185/60 R15
            inertia=(0.90, 0.50),  # [kg m^2] spin, transverse: mass at 0.79 of the radius; chosen by us
        ),
        suspension=front,
        rear_suspension=rear,
        steering=Steering(
            geometry="ackermann",
            limit=math.radians(35.0),  # [rad] from a turning circle of 9.9 m (Hartford Courant, 14 Oct. 2006)
        ),
        wheelbase=2.460,  # [m] auto.cz
        track=1.475,  # [m] auto.cz: 1.480 m in front, 1.470 m at the back
    )
