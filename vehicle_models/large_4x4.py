"""A large four-wheel-drive station wagon: a Nissan Patrol (Y61) as far as it is published, and rules of the class.

Published values carry their source. The rules, for what is not, are those of `small_car`: an eighth of the mass is
unsprung; the centre of mass of what is sprung lies at 0.40 of the height; radii of gyration are 0.40 of the track in
roll, 0.46 and 0.48 of the wheelbase in pitch and yaw; dampers have 30 % of critical. The body heaves at 1.3 Hz in front
and 1.5 Hz at the back. Lengths without a source are round ones, chosen by us. The real one has rigid axles; here each
wheel moves straight up and down by itself.

The body is watertight here: all of it up to the waist lifts, and so does the cabin. Of a real one the frame and the
engine bay fill at once and the cabin within minutes. UNSW's Patrol of 2.5 t floated in 0.95 m of water (Smith et al.,
WRL TR 2017/07); this one, whose whole body lifts, in less: see docs/limits.md. Its tyres are rigid, as all are.
"""

import math

from exumob.vehicle.parameters import Box, Hull, Steering, Suspension, Vehicle, Wheel, WheelArches


def large_4x4() -> Vehicle:
    """2,500 kg four-wheel-drive wagon, wheelbase 2.97 m, ground clearance 0.22 m."""
    front = Suspension(
        stiffness=38.7e3,  # [N/m] rule: 1.3 Hz with 580 kg
        damping=2.84e3,  # [N s/m] rule: 30 % of critical
        upright_mass=42.0,  # [kg] rule: with the wheel, a quarter of an eighth of the mass
        upright_size=0.30,  # [m] chosen by us
        bump_travel=0.120,  # [m] half of 240 mm (biznews.com, 14 Dec. 2015)
        rebound_travel=0.120,  # [m] the other half
        stop_stiffness=6.0e5,  # [N/m] chosen by us: fifteen times the spring
        stop_softening=0.01,  # [m] chosen by us
    )
    rear = Suspension(
        stiffness=45.7e3,  # [N/m] rule: 1.5 Hz with 514 kg
        damping=2.91e3,  # [N s/m] rule: 30 % of critical
        upright_mass=42.0,  # [kg] as in front
        upright_size=0.30,  # [m] chosen by us
        bump_travel=0.120,  # [m] as in front
        rebound_travel=0.120,  # [m] as in front
        stop_stiffness=6.0e5,  # [N/m] chosen by us
        stop_softening=0.01,  # [m] chosen by us
    )
    return Vehicle(
        name="large 4x4",
        hull=Hull(
            mass=2188.0,  # [kg] 2.5 t in total (New Atlas on UNSW's test, 2016; Auto Bild, 2005) less an eighth
            length=5.06,  # [m] automobilrevue.de, 2003
            width=1.93,  # [m] automobilrevue.de, 2003
            height=0.93,  # [m] up to the waist; chosen by us
            ground_clearance=0.22,  # [m] large 4x4 have more (Shand et al. 2011); Land Cruiser 0.215 m
            center_of_mass_height=0.74,  # [m] rule: 0.40 of the height
            center_of_mass_x=0.09,  # [m] 53 % of the weight on the front axle; chosen by us
            center_x=-0.19,  # [m] overhangs 0.86 m in front and 1.24 m at the back; chosen by us
            bow_length=0.50,  # [m] chosen by us: 31 deg of approach, as a Land Cruiser (terminalsecurity.info)
            bow_height=0.30,  # [m] chosen by us
            stern_length=0.90,  # [m] chosen by us
            stern_height=0.30,  # [m] chosen by us
            inertia=(920.0, 4090.0, 4450.0),  # [kg m^2] rule: radii of gyration 0.65, 1.37 and 1.43 m
            boxes=(
                Box(
                    length=3.30,  # [m] the cabin, from the windscreen's middle; chosen by us
                    width=1.60,  # [m] chosen by us
                    height=0.70,  # [m] up to a height of 1.85 m, a round one of the class
                    bottom=1.15,  # [m] on the waist
                    center_x=-1.00,  # [m] chosen by us
                ),
            ),
            wheel_arches=WheelArches(),  # as the tyres need them
        ),
        wheel=Wheel(
            mass=36.0,  # [kg] chosen by us
            diameter=0.789,  # [m] 275/65 R17 (marquenews.com.au): 17 in and twice 0.65 times 275 mm
            width=0.275,  # [m] 275/65 R17
            inertia=(3.5, 2.0),  # [kg m^2] spin, transverse: mass at 0.79 of the radius; chosen by us
        ),
        suspension=front,
        rear_suspension=rear,
        steering=Steering(
            geometry="ackermann",
            limit=math.radians(34.0),  # [rad] from a turning circle of 12.2 m (djz.de)
        ),
        wheelbase=2.97,  # [m] auto.de
        track=1.62,  # [m] the tyres' outer faces 17 mm inside the body; chosen by us
    )
