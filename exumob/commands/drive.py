"""The command `exumob drive`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from exumob.commands.driving import (
    SNAPSHOTS,
    CheckpointFile,
    CouplingScheme,
    FlowOptions,
    Members,
    ModelOption,
    Resume,
    RunOptions,
    Scene,
    Scheme,
    SoilValue,
    WaterModel,
    cells_of,
    check_effects,
    drive,
    soil_with,
)
from exumob.commands.options import (
    EXPERT,
    GROUND,
    RUN,
    WATER,
    Animation,
    Coarse,
    CurrentDirection,
    Figure,
    MacroStep,
    MicroStep,
    Networks,
    Output,
    SettingName,
    SettingOption,
    SoilName,
    Threads,
    UnusualValues,
    VehicleFile,
    given,
    option,
    option_names,
    radians,
    refuse_without_effect,
)
from exumob.commands.shared import console, described_drive, fail, vehicle_of
from exumob.simulation.settings import DURATION, SOIL, time_scale, usual_speed
from exumob.support.quantities import (
    CELL_SIZE,
    CURRENT_SPEED,
    DEPTH,
    DEPTH_RATIO,
    DIRECTION,
    INITIAL_SPEED,
    STEERING_ANGLE,
    Quantity,
    Unusual,
)
from exumob.support.quantities import DURATION as TIME

if TYPE_CHECKING:
    from exumob.driving.maneuver import Maneuver
    from exumob.ground.terrain import Terrain
    from exumob.vehicle.parameters import Vehicle
    from exumob.water.conditions import Water

SPEED = Quantity("m/s", at_least=-100.0, at_most=100.0, plausible=(-30.0, 30.0))


class ManeuverName(StrEnum):
    """Maneuvers by name."""

    straight = "straight"
    lane_change = "lane-change"


def drive_command(  # one argument an option of the command line
    maneuver: Annotated[
        ManeuverName, option(RUN, "Straight ahead, or the paper's lane change in the time that suits the vehicle.")
    ] = ManeuverName.straight,
    path: Annotated[
        Path | None, option(RUN, "Follow the waypoints of this table: columns x [m], y [m], world coordinates.")
    ] = None,
    recorded: Annotated[
        Path | None,
        option(RUN, "Repeat the maneuver of this table: columns time [s], steering [deg], wheel speed [rad/s]."),
    ] = None,
    speed: Annotated[
        float | None,
        option(RUN, "Speed of the tyres' tread. Default: by Froude's law, 1 m/s on a wheelbase of 0.714 m.", of=SPEED),
    ] = None,
    soil: SoilName = SOIL,
    vehicle: VehicleFile = None,
    output: Output = None,
    figure: Figure = None,
    depth_ratio: Annotated[
        float | None, option(WATER, "Depth over tyre diameter, on level ground.", of=DEPTH_RATIO)
    ] = None,
    depth: Annotated[
        float | None, option(WATER, "Depth on level ground, or with --section the greatest one.", of=DEPTH)
    ] = None,
    level: Annotated[float | None, option(WATER, "Height of the still surface, world z, over any ground. [m]")] = None,
    river: Annotated[
        Path | None, option(WATER, "Ground and water of a river on a regular grid (netCDF; see the how-to of water).")
    ] = None,
    discharge: Annotated[
        float | None, option(WATER, "Discharge through --section, positive to the left. [m^3/s]")
    ] = None,
    current: Annotated[float, option(WATER, "Speed of the current.", of=CURRENT_SPEED)] = 0.0,
    current_direction: CurrentDirection = 180.0,
    hydrodynamics: ModelOption = WaterModel.auto,
    networks: Networks = None,
    members: Members = False,
    soil_value: SoilValue = None,
    slope: Annotated[float, option(GROUND, "Slope of the ground. [deg]")] = 0.0,
    slope_direction: Annotated[
        float, option(GROUND, "Where it rises to, counter-clockwise from world x.", of=DIRECTION)
    ] = 0.0,
    terrain: Annotated[Path | None, option(GROUND, "Field of heights: an Esri ASCII grid (.asc).")] = None,
    section: Annotated[
        Path | None, option(GROUND, "Cross-section along world x: columns station [m], bed [m], current [m/s].")
    ] = None,
    start_x: Annotated[float, option(GROUND, "World x of the start. [m]")] = 0.0,
    start_y: Annotated[float, option(GROUND, "World y of the start. [m]")] = 0.0,
    heading: Annotated[float, option(GROUND, "Heading at the start, from world x.", of=DIRECTION)] = 0.0,
    initial_speed: Annotated[
        float | None,
        option(
            GROUND, "Speed at time 0, its wheels rolling. Default: as the maneuver's wheels turn.", of=INITIAL_SPEED
        ),
    ] = None,
    animate: Animation = None,
    checkpoint: CheckpointFile = None,
    resume: Resume = False,
    steering: Annotated[
        float, option(EXPERT, "Steering amplitude of the lane change; a negative one mirrors it.", of=STEERING_ANGLE)
    ] = 30.0,
    duration: Annotated[
        float | None,
        option(EXPERT, "Simulated time. Default: by Froude's law, 8 s on a wheelbase of 0.714 m.", of=TIME),
    ] = None,
    setting: SettingOption = SettingName.fast,
    micro_step: MicroStep = None,
    macro_step: MacroStep = None,
    cell_size: Annotated[
        float | None,
        option(EXPERT, "Width of the flow solver's cells. Default: 0.0575 of the tyre's diameter.", of=CELL_SIZE),
    ] = None,
    coarse: Coarse = False,
    coupling: CouplingScheme = Scheme.semi_implicit,
    threads: Threads = 1,
    unusual: UnusualValues = False,
) -> None:
    """Drive any maneuver over any ground and through any water.

    Example: exumob drive --vehicle car.py --slope 5 --speed 2 --output run.nc --figure run.png

    Along waypoints through a river: exumob drive --path line.csv --river river.nc --start-x 120 --start-y 40 --heading
    90. For the question whether a vehicle can cross: exumob ford.

    With networks or calibrated coefficients, where no run like it was compared with the flow in the loop, it is driven
    once more with the published coefficients, and the line "2nd opinion" says how far the two are apart.
    """
    water = _WaterGiven(depth_ratio, depth, level, discharge, river is not None, section is not None)
    targets = {"--output": output, "--figure": figure, "--animate": animate}
    options = RunOptions(
        hydrodynamics, networks, members, setting.value, micro_step, macro_step, checkpoint, resume, targets, False
    )

    def number(value: Any) -> Any:
        return Unusual(value) if unusual and value is not None else value

    try:
        _check_choices(water, path, recorded, maneuver, slope, terrain)
        dry = ";--depth, --depth-ratio, --level or --river"
        check_effects(water.given, dry, current, hydrodynamics, micro_step, macro_step)
        options.check(duration)
    except (ValueError, OSError) as error:
        fail(error)

    def scene() -> Scene:
        from exumob.vehicle.start_pose import StartPose

        with option_names():
            car = vehicle_of(vehicle)
            tread = usual_speed(car) if speed is None else SPEED.check("--speed", number(speed))
            driver = _maneuver(car, maneuver, path, recorded, tread, radians("--steering", steering, STEERING_ANGLE))
            direction = radians("--current-direction", current_direction, DIRECTION, unusual)
            flow = number(current), direction
            ground, river_water = _ground(terrain, section, river, slope, slope_direction)
            found = river_water if river is not None else _water(water, car, section, flow, number)
            pose = StartPose(start_x, start_y, radians("--heading", heading, DIRECTION))
            time = math.ceil(10.0 * DURATION * time_scale(car) - 1e-9) / 10.0 if duration is None else duration
            return Scene(
                car, soil_with(soil, soil_value or []), found, driver, time, number(initial_speed), ground, pose
            )  # fmt: skip

    def flow_of(scene: Scene) -> FlowOptions:
        size = cells_of(scene.vehicle) if cell_size is None else number(cell_size)
        return FlowOptions(size, coarse, threads, coupling, SNAPSHOTS if animate else None)

    def say(scene: Scene) -> None:
        drives = described_drive(scene.vehicle, scene.maneuver, scene.duration)
        console.print(f"{'drive':<21} {drives}", soft_wrap=True)

    drive(options, scene, flow_of, say)


@dataclass(frozen=True)
class _WaterGiven:
    """How the water was given."""

    depth_ratio: float | None
    depth: float | None
    level: float | None
    discharge: float | None
    river: bool
    section: bool

    @property
    def ways(self) -> list[str]:
        """Options that were given, of which one may be."""
        found = {
            "--depth-ratio": self.depth_ratio is not None, "--depth": self.depth is not None,
            "--level": self.level is not None, "--river": self.river,
        }  # fmt: skip
        return [name for name, there in found.items() if there]

    @property
    def given(self) -> bool:
        """Whether there is water."""
        return bool(self.ways)


def _check_choices(
    water: _WaterGiven, path: Path | None, recorded: Path | None, maneuver: ManeuverName, slope: float,
    terrain: Path | None,
) -> None:  # fmt: skip
    """Refuse options of which only one can hold.

    Raises
    ------
    ValueError
        Naming them.
    """
    grounds = {"--slope": slope != 0.0, "--terrain": terrain is not None, "--section": water.section,
               "--river": water.river}  # fmt: skip
    for what, found in (
        ("maneuver", [*given("maneuver"), *(n for n, f in (("--path", path), ("--recorded", recorded)) if f)]),
        ("ground", [name for name, there in grounds.items() if there]),
        ("water", water.ways),
    ):
        if len(found) > 1:
            raise ValueError(f"{' and '.join(found)} each say the {what}; give one of them.")
    if slope == 0.0:
        refuse_without_effect("on level ground", "leave {it} out, or give --slope", "slope_direction")
    if maneuver is not ManeuverName.lane_change:
        refuse_without_effect("without the lane change", "add --maneuver lane-change, or leave {it} out", "steering")
    if recorded is not None:
        refuse_without_effect("with --recorded, which has the wheels' speed", "leave {it} out", "speed")
    if water.river:
        refuse_without_effect("with --river, which has its own", "leave {it} out", "current", "current_direction")
    if not water.section or not water.given:
        refuse_without_effect(
            "without a section under water", "give --section and --level or --depth, or leave {it} out", "discharge"
        )
    if water.section:
        refuse_without_effect(
            "with --section", "give --discharge, or a column current, or leave {it} out", "current", "current_direction"
        )
        if water.depth_ratio is not None:
            raise ValueError("--depth-ratio goes with level ground; give --level or --depth with --section.")
    elif water.depth is not None or water.depth_ratio is not None:
        uneven = [name for name in ("--slope", "--terrain") if grounds[name]]
        if uneven:
            raise ValueError(
                f"{water.ways[0]} goes with level ground, and with {uneven[0]} it is not level; give --level."
            )


def _maneuver(
    car: Vehicle, name: ManeuverName, path: Path | None, recorded: Path | None, tread: float, steering: float
) -> Maneuver:  # fmt: skip
    from exumob.driving.files import read_path, read_recorded
    from exumob.driving.maneuver import ConstantSteer, LaneChange
    from exumob.driving.path_following import PathFollowing

    if recorded is not None:
        return read_recorded(recorded)
    wheels, unit = tread / car.wheel.radius, time_scale(car)
    if isinstance(tread, Unusual):
        wheels = Unusual(wheels)
    if path is not None:
        most = min(math.radians(30.0), car.steering.limit)
        return PathFollowing(read_path(path), wheels, ramp_time=unit, max_steering=most)
    if name is ManeuverName.straight:
        return ConstantSteer(speed=wheels, ramp_time=unit)
    return LaneChange(steering, 2.0 * unit, 5.5 * unit, wheels, unit)


def _ground(
    terrain: Path | None, section: Path | None, river: Path | None, slope: float, direction: float
) -> tuple[Terrain | None, Water | None]:
    from exumob.ground.height_file import read_heights
    from exumob.ground.terrain import Terrain
    from exumob.water.cross_section import CrossSection
    from exumob.water.river_file import read_river

    if terrain is not None:
        return read_heights(terrain), None
    if section is not None:
        return CrossSection.read(section).terrain(), None
    if river is not None:
        return read_river(river)
    if slope == 0.0:
        return None, None
    angle = radians("--slope", slope, Quantity("rad", at_least=-math.radians(60.0), at_most=math.radians(60.0)))
    return Terrain.slope(angle, radians("--slope-direction", direction, DIRECTION)), None


def _water(
    given: _WaterGiven, car: Vehicle, section: Path | None, flow: tuple[float, float], number: Any
) -> Water | None:
    from exumob.water.conditions import Water
    from exumob.water.cross_section import CrossSection

    if not given.given:
        return None
    if section is not None:
        found = CrossSection.read(section)
        level = None if given.level is None else number(given.level)
        if level is None:
            level = found.level_at_depth(DEPTH.check("--depth", number(given.depth)))
        return found.water(level, given.discharge)
    if given.level is not None:
        return Water(None, *flow, level=given.level)
    if given.depth is not None:
        return Water(number(given.depth), *flow)
    return Water.at_ratio(
        number(given.depth_ratio), flow[0], tyre_diameter=car.wheel.diameter, current_direction=flow[1]
    )  # fmt: skip
