"""Which runs teach networks the water's loads on a vehicle, and what they take: planned before anything is computed.

Teachers are drives with the flow in the loop, over three soils, in which speed and steering change all the time
(`exumob.learning.drives`), and one captive run for every three of them, in which everything moves at once
(`exumob.towing_tank.excitation`): drives teach what drives are like, captive runs what else may come. A few captive
runs and drives are kept apart: no network learns from them or is chosen by them. The number of a run says all of it,
whatever the budget is: a larger budget adds runs to those of a smaller one. Depth and current stay the same in a run,
as the flow solver knows one level and one uniform current; over the runs they fill their ranges evenly.
"""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from exumob.coupling.spin_up import FlowSpinUp
from exumob.driving.maneuver import LaneChange, Maneuver
from exumob.flow import FlowSettings
from exumob.flow.cost import COURANT_FACTOR, FlowCost, flow_cost
from exumob.flow.grid import CELL_SIZE
from exumob.flow.resolution import lengths_in_cells
from exumob.flow.vehicle_window import vehicle_window
from exumob.learning.cost import seed_time
from exumob.learning.drives import FASTEST, SOFT_GROUND, SOILS, judging_drives, maneuver_name, teaching_drive
from exumob.learning.presets import PRESETS, WHOLE_RANGE, Preset
from exumob.paper.reference_runs import SOIL
from exumob.simulation.cost import REPEATED, driving_time
from exumob.simulation.settings import time_scale, usual_speed
from exumob.support.cost import cores, spelled_size, spelled_time
from exumob.support.declared import Declared, checked
from exumob.support.provenance import parameters_json
from exumob.support.quantities import CURRENT_SPEED, DEPTH_RATIO, ImplausibleValue, Quantity, Unusual, unusual
from exumob.support.wording import whence
from exumob.towing_tank.excitation import CHANNELS, Envelope, Excitation
from exumob.vehicle.parameters import Vehicle
from exumob.water.conditions import Water

Directions = Literal["ahead", "along", "all"]
"""Where currents come from: from ahead; from ahead and behind; from all sides."""
LISTED = 25
"""Runs that a plan lists one by one."""
BUDGET = Quantity("h", above=0.0, at_most=1e6)
"""Time of a core"""
USUAL_BUDGET = 12.0
"""Budget that is taken if none is given, or what the least runs of a vehicle take where that is more [h]."""
CORNERS = ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.5), (1.0, 0.0, 0.0))
"""Shares of the ranges of depth, current and its direction in the first runs of each kind that teach: the fastest
current comes from ahead, where most drives are, and from behind."""
APART = 5
"""One captive run in so many is kept apart: the last of each group."""
LEAST_DRIVES, DRIVES_A_ROUND = 4, 3
"""Drives that teach at least, and those that are added for each captive run."""
BESIDE = 3
"""Runs of the smallest plan beside the drives that teach: a captive one, one kept apart and a drive kept apart."""
ON_SOFT_GROUND, EVERY_ROUND = 100, 4
"""Number of the first drive on soft ground, in the deepest water: there the wheels are deepest in it; and in how
many rounds there is one."""
FIRST = (0, 1, 4, 5, 2, 3)
"""Numbers of the first drives: two at the ends of the ranges, two within, and the other ends."""
CELLS = 0.09
"""Usual width of the cells, over the tyre's diameter: that of the runs that come with exumob."""
RUN_TIME, RAMP = 8.0, 1.0
"""Duration of a run that teaches and of a captive run's ramp, times `time_scale` [s]."""
MOST_APART, MOST_RUNS = 6, 1000
"""Most drives that are kept apart, and most runs in all."""
INTERVALS = (10e-3, 5e-3, 4e-3, 2.5e-3, 2e-3, 1.5e-3, 1.25e-3, 1e-3)
"""Intervals of the loads of captive runs [s]: the longest one that the flow goes through in one step is taken."""
MICRO_STEP, LONGEST_MACRO_STEP = 5e-4, 4e-3
"""Steps of the drives [s]; the macro steps follow the flow."""
TOO_FAST = 3.0
"""Highest frequency in captive runs over that of the drives above which a plan says so [-]."""
ADVANCES = 1.1
"""How often the flow goes through a macro step, on average [-]."""


@dataclass(frozen=True)
class LearningRange(Declared):
    """What networks are to know of the water; speeds scale with the vehicle.

    A depth is a ratio of the tyre's diameter. A current is that of the paper's vehicle, whose wheelbase is 0.714 m;
    another vehicle's is larger by the root of its wheelbase over that (Froude's law: the same speed over sqrt(g L)).
    The vehicle's own speeds and times follow the same law (`exumob.simulation.settings.time_scale`).

    Raises
    ------
    ValueError
        If a smallest value is above the largest, or there are currents from no side.
    """

    depth: Annotated[tuple[float, float], DEPTH_RATIO] = (0.2, 0.9)
    """Smallest and largest depth over the tyre's diameter"""
    current: Annotated[tuple[float, float], CURRENT_SPEED] = (0.0, 1.5)
    """Smallest and largest speed of the current, of the paper's vehicle"""
    directions: Directions = "all"
    """Where currents come from: from ahead; from ahead and behind (along); from all sides"""

    def _check(self) -> None:
        for name in ("depth", "current"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(
                    f"LearningRange.{name} = ({low:g}, {high:g}): the first is above the second; give the smaller one "
                    "first."
                )

    def depths(self, vehicle: Vehicle) -> tuple[float, float]:
        """Return the smallest and the largest depth for a vehicle [m]."""
        low, high = (ratio * vehicle.wheel.diameter for ratio in self.depth)
        return low, high

    def currents(self, vehicle: Vehicle) -> tuple[float, float]:
        """Return the smallest and the largest speed of the current for a vehicle [m/s].

        Raises
        ------
        ImplausibleValue
            If the largest is implausible for this vehicle.
        """
        scale = time_scale(vehicle)
        low, high = (speed * scale for speed in self.current)
        fastest = CURRENT_SPEED.plausible[1] if CURRENT_SPEED.plausible else math.inf
        if high > fastest and not isinstance(high, Unusual):
            raise ImplausibleValue(
                f"LearningRange.current = {self.current[1]:g} m/s of a vehicle of the paper's size is {high:.3g} m/s "
                f"of {vehicle.name} by Froude's law, and no more than {fastest:g} m/s is plausible; give at most "
                f"{math.floor(100.0 * fastest / scale) / 100.0:g} m/s, or say that it is meant: "
                f"unusual({self.current[1]:g}) in Python, --unusual at the command line."
            )
        return low, high

    def water(self, vehicle: Vehicle, depth: float, current: float, side: float) -> Water:
        """Return the water at shares of the ranges, 0 to 1; `side` chooses the direction."""
        low, high = self.depths(vehicle)
        slow, fast = self.currents(vehicle)
        turn = {"ahead": 0.0, "along": math.pi * (side >= 0.5), "all": 2.0 * math.pi * side}[self.directions]
        direction = math.remainder(math.pi + turn, 2.0 * math.pi)
        return Water(_between(low, high, depth), _between(slow, fast, current), direction)

    def samples(self, vehicle: Vehicle) -> list[Water]:
        """Return waters at the ends and in the middle of the ranges, for the drives that give the envelope."""
        sides = {"ahead": (0.0,), "along": (0.0, 0.5), "all": (0.0, 0.25, 0.5)}[self.directions]
        places = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 0.5, 0.0), (0.0, 1.0, 0.0)]
        return [self.water(vehicle, *place) for place in places + [(1.0, 1.0, side) for side in sides]]


@dataclass(frozen=True)
class CaptiveTask:
    """A captive run: a prescribed motion through water."""

    name: str
    role: Literal["teach", "apart"]
    """"teach": networks learn from it; "apart": they never see it"""
    water: Water
    motion: Excitation
    cell_size: float
    interval: float
    """Of the loads [s]"""
    cost: FlowCost

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return self.motion.duration


@dataclass(frozen=True)
class FreeTask:
    """A drive with the flow in the loop."""

    name: str
    role: Literal["teach", "apart"]
    """As of a captive run"""
    water: Water
    maneuver: Maneuver
    duration: float
    """Simulated time after the release [s]"""
    cell_size: float
    cost: FlowCost
    soil: str = SOIL
    """Published soil"""


Task = CaptiveTask | FreeTask


@dataclass(frozen=True)
class LearningPlan:
    """The runs, what they take, and what the cells resolve."""

    vehicle: Vehicle
    range: LearningRange
    envelope: Envelope
    cell_size: float
    budget: float
    """[h]"""
    seeds: int
    preset: Preset
    tasks: tuple[Task, ...]
    resolved: tuple[str, ...]
    """Lengths of the vehicle that have cells enough"""
    lost: tuple[str, ...]
    """Lengths that have not"""

    @property
    def simulated(self) -> float:
        """Simulated time of all runs, without the spin-up of the drives [s]."""
        return sum(task.duration for task in self.tasks)

    @property
    def core_hours(self) -> float:
        """Time of a core for the runs [h]."""
        return sum(task.cost.seconds for task in self.tasks) / 3600.0

    @property
    def training_hours(self) -> float:
        """Time of a core for the training [h]."""
        return _training(self.tasks, self.preset, self.seeds) / 3600.0

    def lines(self, jobs: int) -> list[str]:
        """Describe the plan in lines of text.

        Parameters
        ----------
        jobs : int
            Runs side by side.
        """
        car, wanted = self.vehicle, self.range
        (low, high), (slow, fast) = wanted.depths(car), wanted.currents(car)
        captive = [t for t in self.tasks if isinstance(t, CaptiveTask)]
        free = [t for t in self.tasks if isinstance(t, FreeTask)]
        apart = [sum(t.role == "apart" for t in tasks) for tasks in (free, captive)]
        most = max(self.tasks, key=lambda task: task.cost.memory)
        slower, fastest = captive[0].motion.highest_frequencies()
        hurried = (
            f"drives have up to {self.envelope.slow:.2g} and {self.envelope.fast:.2g} Hz: in runs as short as these, "
            "loads are much those of added mass; longer ones have slower motions"
        )
        shares = [f"{v[0]:.3g} to {v[1]:.3g} {unit}" for v, unit in (
            (self.envelope.speed, "m/s ahead"), (self.envelope.sway, "m/s sideways"),
            (self.envelope.yaw_rate, "rad/s"), (np.degrees(self.envelope.pitch), "deg pitch"),
            (np.degrees(self.envelope.roll), "deg roll"), (1e3 * np.array(self.envelope.heave), "mm heave"),
        )]  # fmt: skip
        found = [
            f"vehicle   {car.name}, wheelbase {car.wheelbase:g} m, tyres {car.wheel.diameter:g} m",
            f"range     depth {wanted.depth[0]:g} to {wanted.depth[1]:g} of the tyre's diameter ({low:.3g} to "
            f"{high:.3g} m); current {wanted.current[0]:g} to {wanted.current[1]:g} m/s of the paper's vehicle, by "
            f"Froude's law {slow:.3g} to {fast:.3g} m/s of this one, {_sides(wanted.directions)}",
            f"motion    {', '.join(shares)}; in captive runs with up to {slower:.2g} Hz (speeds, steering) and "
            f"{fastest:.2g} Hz (pitch, roll, heave)",
            *([f"          {hurried}"] if fastest > TOO_FAST * self.envelope.fast else []),
            f"cells     {1e3 * self.cell_size:.3g} mm (--cell-size {self.cell_size:.9g})",
            *[f"          resolved: {text}" for text in self.resolved],
            *[f"          lost: {text}" for text in self.lost],
        ]
        if self.lost:
            found.append(
                "          what has too few cells has rough loads: water passes a gap too hardly or not at all, and "
                "networks learn that"
            )
        found.append(
            f"runs      {len(free)} drives ({apart[0]} kept apart) and {len(captive)} captive ones ({apart[1]} kept "
            f"apart) of up to {captive[0].duration:g} s: {self.simulated:.0f} s in all"
            + (f"; more than {MOST_RUNS} are not planned" if len(self.tasks) >= MOST_RUNS else "")
        )
        found += [
            f"          {task.name}: {_described(task, car)}; {task.cost.cells:,.0f} cells, {task.cost.steps:,.0f} "
            f"steps, {spelled_time(task.cost.seconds)} of a core" for task in self.tasks[:LISTED]
        ]  # fmt: skip
        if (more := len(self.tasks) - LISTED) > 0:
            found.append(f"          and {more} more")
        side_by_side = max(min(jobs, cores()), 1)
        total = self.core_hours + self.training_hours
        found.append(
            f"takes     {self.core_hours:.2g} core hours for the runs and {self.training_hours:.2g} for {self.seeds} "
            f"seeds of networks, of a budget of {self.budget:g}; about {spelled_time(3600.0 * total / side_by_side)} "
            f"with {jobs} worker{'s' if jobs > 1 else ''} on an idle machine"
            + (f", of which this process may use {cores()} core{'s' if cores() > 1 else ''}" if jobs > cores() else "")
            + f"; {spelled_size(jobs * most.cost.memory)} of memory"
        )
        return found


def _between(low: float, high: float, share: float) -> float:
    """Return a value within a range; it may be unusual if an end of the range is."""
    value = low + share * (high - low)
    return unusual(value) if isinstance(low, Unusual) or isinstance(high, Unusual) else value


def _sides(directions: Directions) -> str:
    return {"ahead": "from ahead", "along": "from ahead and behind", "all": "from all sides"}[directions]


def _described(task: Task, vehicle: Vehicle) -> str:
    water = task.water
    where = f"depth {water.uniform_depth / vehicle.wheel.diameter:.2f}, current {water.current_speed:.2f} m/s"
    where += f" {whence(water.current_direction)}" if water.current_speed > 0.0 else ""
    apart = "; kept apart" if task.role == "apart" else ""
    if isinstance(task, FreeTask):
        return f"{maneuver_name(task.maneuver)}, {task.duration:.3g} s on {task.soil}, {where}{apart}"
    speeds = ", ".join(f"{v:.2f}" for v in task.motion.speeds)
    return f"{task.duration:g} s, {where}, speeds {speeds} m/s{apart}"


@checked
def make_plan(  # each argument is a choice of its own
    vehicle: Vehicle,
    wanted: LearningRange,
    budget: Annotated[float | None, BUDGET],
    cell_size: Annotated[float, CELL_SIZE],
    envelope: Envelope,
    *,
    seeds: Annotated[int, Quantity("1", at_least=1, at_most=1000)] = 5,
    preset: Preset = PRESETS[WHOLE_RANGE],
    run_time: Annotated[float | None, Quantity("s", at_least=0.05, at_most=1e4)] = None,
) -> LearningPlan:
    """Plan the runs that a budget buys.

    Parameters
    ----------
    vehicle : Vehicle
    wanted : LearningRange
    budget : float or None
        Time of a core for runs and training [h]; None: `USUAL_BUDGET`, or what the least runs take where that is more.
    cell_size : float
        Of the flow round the vehicle [m]. Cells too coarse for a gap are said to lose it, and taken.
    envelope : Envelope
        See `exumob.learning.envelope.envelope_of`.
    seeds : int
        Networks of each body.
    preset : Preset
        What is trained. Default: as the networks for the whole range that come with exumob.
    run_time : float, optional
        Duration of a run that teaches [s]. Default: `RUN_TIME` times `time_scale`; drives kept apart in proportion.

    Raises
    ------
    ValueError
        If the budget buys too few runs to learn from, with what it would buy and what would do; or the grid does not
        fit into memory.
    """
    part, duration = _run_time(vehicle, run_time)
    costs = _Costs(vehicle, cell_size)
    drives, judges = _teaching(vehicle, wanted, duration, costs), _judging(vehicle, wanted, part, costs)
    soft = _on_soft_ground(vehicle, wanted, duration, costs)
    captive, captive_apart = itertools.tee(_captive(vehicle, wanted, envelope, duration, costs))
    order = _order(
        drives, soft, judges, (task for task in captive if task.role == "teach"),
        (task for task in captive_apart if task.role == "apart"),
    )  # fmt: skip
    chosen = list(itertools.islice(order, LEAST_DRIVES + BESIDE))

    def price(tasks: list[Task]) -> float:
        return (sum(task.cost.seconds for task in tasks) + _training(tasks, preset, seeds)) / 3600.0

    if budget is None:
        budget = max(USUAL_BUDGET, math.ceil(price(chosen)))
    if price(chosen) > budget:
        _refuse_budget(len(chosen), sum(task.duration for task in chosen), price(chosen), budget, cell_size)
    left = budget - price(chosen)
    for task in itertools.islice(order, MOST_RUNS - len(chosen)):
        left -= price([task])
        if left < 0.0:
            break
        chosen.append(task)
    limit = vehicle.steering.limit
    angles = [m[0] for command in (-limit, limit) for m in vehicle.steering_angles((command, 0.0, 0.0))]
    grid = vehicle_window(vehicle, cell_size, chosen[0].water)
    resolved, lost = lengths_in_cells(vehicle, grid, (min(angles), max(angles)))
    return LearningPlan(
        vehicle, wanted, envelope, cell_size, budget, seeds, preset, tuple(chosen), tuple(resolved), tuple(lost)
    )  # fmt: skip


@checked
def require_budget(
    vehicle: Vehicle,
    wanted: LearningRange,
    budget: Annotated[float | None, BUDGET],
    cell_size: Annotated[float, CELL_SIZE],
    *,
    run_time: Annotated[float | None, Quantity("s", at_least=0.05, at_most=1e4)] = None,
) -> None:
    """Refuse a budget that does not even buy the least drives, before those that give the envelope are made.

    The least captive runs are taken to cost as much each, and a tenth more is asked for; `make_plan` tells exactly.

    Parameters
    ----------
    vehicle, wanted, budget, cell_size, run_time
        As in `make_plan`.

    Raises
    ------
    ValueError
        With what the budget would buy and what would do, about.
    """
    part, duration = _run_time(vehicle, run_time)
    costs = _Costs(vehicle, cell_size)
    drives = list(itertools.islice(_teaching(vehicle, wanted, duration, costs), len(FIRST)))
    least = [*(drives[number] for number in FIRST[:LEAST_DRIVES]), next(_judging(vehicle, wanted, part, costs))]
    price = sum(task.cost.seconds for task in least) / 3600.0
    if budget is not None and price > budget:
        runs = LEAST_DRIVES + BESIDE
        more, seconds = runs / len(least), sum(task.duration for task in least)
        _refuse_budget(runs, more * seconds, more * price, budget, cell_size, "about ", 1.1)


def _run_time(vehicle: Vehicle, run_time: float | None) -> tuple[float, float]:
    """Return the duration of a run that teaches, over the usual one and in seconds."""
    usual = RUN_TIME * time_scale(vehicle)
    if run_time is None:
        return 1.0, max(round(10.0 * usual), 1) / 10.0
    if not _divides(INTERVALS[-1], run_time):
        raise ValueError(
            f"make_plan.run_time = {run_time:.9g} s must be a whole number of milliseconds; give "
            f"{round(run_time, 3):g} s, say."
        )
    return run_time / usual, run_time


def _refuse_budget(
    runs: int, seconds: float, price: float, budget: float, cell_size: float, about: str = "", reserve: float = 1.0
) -> None:  # fmt: skip
    """Raise ValueError: say what the budget would buy, and what would do, about: with a reserve."""
    bought = budget / price * seconds
    coarser = cell_size * (price / budget) ** 0.25  # cells go with the cube of their size, steps with its inverse
    raise ValueError(
        f"make_plan.budget = {budget:g} h buys about {bought:.2g} s of flow on cells of {1e3 * cell_size:.3g} mm, and "
        f"{seconds:.0f} s ({runs} runs) are the least from which networks can be learnt and tried; give {about}"
        f"{math.ceil(100.0 * reserve * price) / 100.0:g} h, or a cell_size of about {coarser:.2g} m, which loses more."
    )


def _training(tasks: Sequence[Task], preset: Preset, seeds: int) -> float:
    """Return the time that training takes on one core [s]."""
    return seeds * seed_time(preset, sum(task.duration for task in tasks if task.role == "teach"))


class _Costs:
    """What runs take on one thread, with the grids that are asked for again."""

    def __init__(self, vehicle: Vehicle, cell_size: float) -> None:
        self.vehicle, self.cell_size = vehicle, cell_size
        self._grids: dict[float, tuple[int, float]] = {}
        self.courant = FlowSettings().courant

    def _grid(self, water: Water) -> tuple[int, float]:
        depth = water.uniform_depth
        if depth not in self._grids:
            grid = vehicle_window(self.vehicle, self.cell_size, water)
            self._grids[depth] = grid.n_cells, grid.smallest_width
        return self._grids[depth]

    def longest_step(self, water: Water, speed: float) -> float:
        """Longest step of the flow at a speed of the vehicle through the water [s]."""
        return self.courant * self._grid(water)[1] / (COURANT_FACTOR * max(speed, 1e-6))

    def flow(self, water: Water, speed: float, duration: float, interval: float) -> FlowCost:
        cells, width = self._grid(water)
        return flow_cost(cells, width, speed, duration, interval, self.courant)


def _shares(number: int, count: int) -> list[float]:
    """Place `number` of an additive sequence in a cube of `count` dimensions, each 0 to 1.

    Roberts' sequence: multiples of the powers of the root of x^(count + 1) = x + 1, which fill the cube evenly at any
    number of points.
    """
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (count + 1.0))
    return [math.fmod(0.5 + (number + 1) * root ** -(k + 1.0), 1.0) for k in range(count)]


def _captive(
    vehicle: Vehicle, wanted: LearningRange, envelope: Envelope, duration: float, costs: _Costs
) -> Iterator[CaptiveTask]:
    """Captive runs one after the other, without end."""
    low, high = envelope.speed
    for number in itertools.count():
        depth, current, side = _shares(number, 3)
        fast, *offsets = np.random.default_rng(number).uniform(size=1 + len(CHANNELS))
        if number < len(CORNERS):
            depth, current, side = CORNERS[number]
        water = wanted.water(vehicle, depth, current, side)
        part = 0.4 + 0.6 * float(fast)
        ahead, back = part * high, part * min(low, 0.0)
        plans = [(ahead, 0.0, back), (0.0, ahead, 0.6 * ahead), (0.5 * ahead, ahead, 0.0), (back, 0.0, ahead),
                 (ahead, 0.5 * ahead, ahead)]  # fmt: skip
        motion = Excitation(
            envelope, plans[(number + number // len(plans)) % len(plans)], duration,
            min(RAMP * time_scale(vehicle), 0.25 * duration), tuple(float(2.0 * share - 1.0) for share in offsets),
            number, number,
        )  # fmt: skip
        speed = math.hypot(max(abs(low), high), envelope.sway[1]) + water.current_speed
        longest = costs.longest_step(water, speed)
        fitting = [step for step in INTERVALS if step <= longest and _divides(step, duration)]
        interval = fitting[0] if fitting else INTERVALS[-1]
        cost = costs.flow(water, speed, duration, interval)
        name = _name("captive", number, vehicle, [water, motion, costs.cell_size, interval])
        yield CaptiveTask(
            name, "apart" if number % APART == APART - 1 else "teach", water, motion, costs.cell_size, interval, cost
        )  # fmt: skip


def _divides(step: float, duration: float) -> bool:
    return abs(duration / step - round(duration / step)) < 1e-6


def _order(
    drives: Iterator[FreeTask], soft: Iterator[FreeTask], judges: Iterator[FreeTask],
    captive: Iterator[CaptiveTask], apart: Iterator[CaptiveTask],
) -> Iterator[Task]:  # fmt: skip
    """All runs in the order in which a budget buys them, without end: first the least, then rounds of some of each."""
    first = list(itertools.islice(drives, len(FIRST)))
    drives = itertools.chain((first[number] for number in FIRST), drives)
    yield from itertools.islice(drives, LEAST_DRIVES)
    yield from (next(captive), next(apart), next(judges))
    for number in itertools.count(1):
        yield from itertools.islice(drives, DRIVES_A_ROUND)
        if number % EVERY_ROUND == 1:
            yield next(soft)
        yield next(captive)
        if number < MOST_APART:
            yield next(judges)
        if number % (APART - 1) == 0:
            yield next(apart)


def _teaching(vehicle: Vehicle, wanted: LearningRange, duration: float, costs: _Costs) -> Iterator[FreeTask]:
    """Drives that teach one after the other, without end, over soils from firm to soft."""
    for number in itertools.count():
        shares = CORNERS[number] if number < len(CORNERS) else _shares(1000 + number, 3)
        water, maneuver = wanted.water(vehicle, *shares), teaching_drive(vehicle, number, duration)
        soil = SOILS[(number + number // len(SOILS)) % len(SOILS)]
        yield _drive("drive", number, "teach", (water, maneuver, duration, soil), costs)


def _on_soft_ground(
    vehicle: Vehicle, wanted: LearningRange, duration: float, costs: _Costs
) -> Iterator[FreeTask]:  # fmt: skip
    """Drives that teach on soft ground, one after the other, without end."""
    for number in itertools.count(ON_SOFT_GROUND):
        _, current, side = _shares(number, 3)
        water, maneuver = wanted.water(vehicle, 1.0, current, side), teaching_drive(vehicle, number, duration)
        what = water, maneuver, duration, SOFT_GROUND
        yield _drive("drive", number, "teach", what, costs)


def _judging(vehicle: Vehicle, wanted: LearningRange, part: float, costs: _Costs) -> Iterator[FreeTask]:
    """Drives kept apart one after the other, without end: lane change, circle, straight ahead, each on a soil."""
    choice = judging_drives(vehicle, part)
    for number in itertools.count():
        shares = (0.5, 0.5, 0.0) if number == 0 else _shares(500 + number, 3)
        maneuver, time = choice[number % len(choice)]
        if number >= len(choice) and isinstance(maneuver, LaneChange):
            maneuver = replace(maneuver, amplitude=-maneuver.amplitude)
        duration = max(round(10.0 * time), 1) / 10.0
        soil = SOILS[(number + 1 + number // len(SOILS)) % len(SOILS)]
        yield _drive("free", number, "apart", (wanted.water(vehicle, *shares), maneuver, duration, soil), costs)


def _drive(
    kind: str, number: int, role: Literal["teach", "apart"], what: tuple[Water, Maneuver, float, str], costs: _Costs
) -> FreeTask:
    """A drive of some kind and number: through a water, by a maneuver, for some time [s], on a soil."""
    water, maneuver, duration, soil = what
    speed = (FASTEST if role == "teach" else 1.0) * usual_speed(costs.vehicle) + water.current_speed
    macro_step = min(max(costs.longest_step(water, speed), MICRO_STEP), LONGEST_MACRO_STEP)
    before = FlowSpinUp().for_vehicle(costs.vehicle)
    held = costs.flow(water, max(water.current_speed, 1e-3), before.duration(water), before.interval)
    driven = costs.flow(water, speed, duration, macro_step)
    cost = replace(
        driven, steps=held.steps + ADVANCES * driven.steps,
        seconds=held.seconds + ADVANCES * driven.seconds
        + REPEATED * driving_time(duration, MICRO_STEP, macro_step),
    )  # fmt: skip
    name = _name(kind, number, costs.vehicle, [water, maneuver, costs.cell_size, duration, soil])
    return FreeTask(name, role, water, maneuver, duration, costs.cell_size, cost, soil)


def nameless(vehicle: Vehicle) -> Vehicle:
    """Return a vehicle without its own name: under another one it has the same runs."""
    return replace(vehicle, name="vehicle")


def _name(kind: str, number: int, vehicle: Vehicle, parts: list[object]) -> str:
    """Name of a run: its number, and a digest of all that it is made from."""
    text = parameters_json({str(n): part for n, part in enumerate([nameless(vehicle), *parts])})
    return f"{kind}_{number:03d}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"
