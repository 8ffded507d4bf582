"""The command `exumob lane-change`."""

from __future__ import annotations

from typing import Annotated

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
    WaterModel,
    check_effects,
    drive,
)
from exumob.commands.options import (
    EXPERT,
    RUN,
    Animation,
    CellSize,
    Coarse,
    CurrentDirection,
    Duration,
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
    option,
    option_names,
    radians,
)
from exumob.commands.shared import fail, vehicle_of
from exumob.simulation.settings import DURATION, SOIL
from exumob.support.quantities import (
    CURRENT_SPEED,
    DEPTH_RATIO,
    DIRECTION,
    INITIAL_SPEED,
    STEERING_ANGLE,
    WHEEL_SPEED,
)


def lane_change_command(  # one argument an option of the command line
    depth_ratio: Annotated[
        float, option(RUN, "Water depth over tyre diameter; 0 is dry ground.", of=DEPTH_RATIO)
    ] = 0.6,
    current: Annotated[float, option(RUN, "Speed of the current, against the vehicle.", of=CURRENT_SPEED)] = 1.0,
    soil: SoilName = SOIL,
    vehicle: VehicleFile = None,
    current_direction: CurrentDirection = 180.0,
    hydrodynamics: ModelOption = WaterModel.auto,
    networks: Networks = None,
    members: Members = False,
    output: Output = None,
    figure: Figure = None,
    animate: Animation = None,
    checkpoint: CheckpointFile = None,
    resume: Resume = False,
    steering: Annotated[
        float, option(EXPERT, "Steering amplitude; a negative one mirrors the maneuver.", of=STEERING_ANGLE)
    ] = 30.0,
    wheel_speed: Annotated[
        float,
        option(
            EXPERT,
            "Final wheel speed, of any vehicle (`exumob drive` has one that goes with its size).",
            of=WHEEL_SPEED,
        ),
    ] = 10.0,
    initial_speed: Annotated[
        float, option(EXPERT, "Speed of the vehicle at time 0, ahead, its wheels rolling.", of=INITIAL_SPEED)
    ] = 0.0,
    duration: Duration = DURATION,
    setting: SettingOption = SettingName.fast,
    micro_step: MicroStep = None,
    macro_step: MacroStep = None,
    cell_size: CellSize = 0.0115,
    coarse: Coarse = False,
    coupling: CouplingScheme = Scheme.semi_implicit,
    threads: Threads = 1,
    unusual: UnusualValues = False,
) -> None:
    """Drive the single lane change of the paper through water on soft soil.

    Example: exumob lane-change --depth-ratio 0.6 --current 1 --output run.nc --figure run.png

    With the flow solver in the loop: exumob lane-change --hydrodynamics cfd --cell-size 0.018 --coarse --checkpoint
    run.npz --output run.nc; when it was stopped, the same with --resume. Other maneuvers, ground and water: exumob
    drive.
    """
    from exumob.driving.maneuver import lane_change
    from exumob.ground.soil import Soil
    from exumob.support.quantities import Unusual
    from exumob.water.conditions import Water

    measured = vehicle is None and hydrodynamics is not WaterModel.cfd and micro_step is None and macro_step is None
    targets = {"--output": output, "--figure": figure, "--animate": animate}
    options = RunOptions(
        hydrodynamics, networks, members, setting.value, micro_step, macro_step, checkpoint, resume, targets, measured
    )
    snapshots = SNAPSHOTS if animate else None
    if unusual:
        depth_ratio, current, wheel_speed, cell_size = map(Unusual, (depth_ratio, current, wheel_speed, cell_size))
        initial_speed = Unusual(initial_speed)
    try:
        dry = " (--depth-ratio 0);a --depth-ratio"
        check_effects(depth_ratio != 0.0, dry, current, hydrodynamics, micro_step, macro_step)
        options.check(duration)
    except (ValueError, OSError) as error:
        fail(error)

    def scene() -> Scene:
        car = vehicle_of(vehicle)
        water = None
        if depth_ratio != 0.0:
            direction = radians("--current-direction", current_direction, DIRECTION, unusual)
            with option_names():
                water = Water.at_ratio(
                    depth_ratio, current, tyre_diameter=car.wheel.diameter, current_direction=direction
                )
        with option_names():
            maneuver = lane_change(radians("--steering", steering, STEERING_ANGLE), wheel_speed)
            return Scene(car, Soil.published(soil), water, maneuver, duration, initial_speed)

    drive(options, scene, lambda scene: FlowOptions(cell_size, coarse, threads, coupling, snapshots))
