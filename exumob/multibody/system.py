"""The vehicle as a redundant-coordinate Exudyn model (paper Eq. 6), advanced macro step by macro step.

`exumob.multibody.assembly` builds the system; soil, suspension and water come from `exumob.multibody.applied_loads`, in
one gather before each Newton residual. They enter as one vector of generalised forces, or, as Exudyn's users write
them, as user loads that return their rows.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from exumob.driving.maneuver import Driver, FeedbackManeuver, Maneuver
from exumob.ground.hull_contact import HullContact, no_hull_contact
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.applied_loads import LOADS, pack_parameters, vehicle_loads
from exumob.multibody.assembly import DrivingCommand, assemble
from exumob.multibody.constraints import Constraints
from exumob.multibody.energy_account import ENERGY_ACCOUNT, add_work
from exumob.multibody.placing import standing_pose
from exumob.multibody.predictor import NewmarkFactors, Predictor
from exumob.multibody.reactions import constraint_wrenches
from exumob.multibody.recorder import Recorder, SystemState
from exumob.multibody.rigid_body import add_force, generalized_moment, point_motion, rotation_matrix
from exumob.multibody.settling import SETTLING_MICRO_STEP, Start, relax
from exumob.multibody.soil_contact import DAMPING_ENTRIES, HULL_ENTRIES, hull_tangent, soil_damping
from exumob.multibody.solver_settings import LOOSER, SPECTRAL_RADIUS, TOLERANCE, integration_settings
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.support.exudyn import exu, held_weakly
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Vehicle
from exumob.vehicle.point_force import PointForce
from exumob.vehicle.start_pose import StartPose

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class SavedState:
    """All that the next step depends on; see `MultibodyVehicle.save`."""

    time: float
    coordinates: dict[str, Array]
    algorithmic_acceleration: Array
    predictor: Array
    loads: np.ndarray
    energy_account: np.ndarray
    samples: int
    rows: int
    history: np.ndarray | None
    records: np.ndarray | None
    driver: dict[str, Any] | None = None
    start_kind: str = ""


class MultibodyVehicle:
    """A `Vehicle` on `Soil`, driven by a `Maneuver`, as an Exudyn system.

    Parameters
    ----------
    vehicle : Vehicle
    soil : Soil
    maneuver : Maneuver
        A `FeedbackManeuver` is driven by its driver.
    terrain : Terrain
    micro_step : float
        Step of the time integration [s]; `HISTORY_STEP` must be a whole multiple of it.
    duration : float
        Duration of the run [s]; history and records are kept for as long.
    record_step : float
        Interval between records of all loads and reactions [s].
    standstill_rate : float
        Spin below which the shear displacement is regularised [rad/s] (see `exumob.ground.terramechanics`).
    user_loads : bool
        Let each load enter as a user function of Exudyn, as its users write them, not all of them as one vector.
    forces : sequence of PointForce
        Forces of the user's own.
    hull : HullContact, optional
        How the hull meets the ground; None: they do not touch each other.
    start : StartPose, optional
        Where the vehicle stands at time 0; default: at the world's origin, heading along world x.

    Notes
    -----
    Generalized-alpha (spectral radius 0.8, index 3; Arnold & Bruels 2007) with modified Newton iterations.
    Call `settle` once, then `advance` macro step by macro step.
    """

    def __init__(  # one argument a part of the run; all but six have defaults
        self,
        vehicle: Vehicle,
        soil: Soil,
        maneuver: Maneuver,
        terrain: Terrain,
        micro_step: float,
        duration: float,
        record_step: float = 1.0e-2,
        standstill_rate: float = 0.05,
        user_loads: bool = False,
        forces: Sequence[PointForce] = (),
        hull: HullContact | None = None,
        start: StartPose | None = None,
    ) -> None:
        """Build the system at ride height on the terrain."""
        self.vehicle = vehicle
        self.maneuver = maneuver
        self._feedback = maneuver if isinstance(maneuver, FeedbackManeuver) else None
        self._driver: Driver | None = None  # of a maneuver with feedback, while driving
        self._looks = 0
        self.micro_step = micro_step
        hull = no_hull_contact() if hull is None else hull
        self._hull_points = hull.points
        self.parameters = pack_parameters(vehicle, soil, terrain, hull, standstill_rate)
        self.loads = np.zeros(1, LOADS)
        self._generalized = np.zeros(63)
        origins = np.vstack([vehicle.hull_origin, vehicle.wheel_centers])
        self._forces = [
            (force, force.body_number, np.array(force.point) - origins[force.body_number]) for force in forces
        ]
        self.energy_account = np.zeros(1, ENERGY_ACCOUNT)
        start = StartPose() if start is None else start
        hull_points = hull.points["position"] + vehicle.hull_origin
        place, tilt = standing_pose(vehicle, terrain, start, hull_points)
        # the system counts from the start: coordinates of a map would take digits from sinkage and constraints
        self._about = np.array([start.x, start.y, terrain.height_and_normal(start.x, start.y)[0]])
        local, self._heights = terrain.as_arrays(tuple(self._about.tolist()))
        self.parameters["terrain"] = local
        self._ground_normal = tilt[:, 2]
        self._command = DrivingCommand()
        self.start_kind = ""
        """How the run started, see `exumob.multibody.settling.Start`"""
        self._loosened = False  # whether a macro step was solved to a looser tolerance
        self._driving = False  # until the vehicle has settled: wheels locked, steering as at time 0
        self._changing_wrench: tuple[Array, Array, float] | None = None  # mean, rate and middle of a macro step

        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        joints = assemble(
            self.mbs, vehicle, (place - self._about, tilt), self._command, self.loads[0] if user_loads else None
        )  # fmt: skip
        self._joints = joints
        data = self.mbs.systemData
        self._q = data.GetODE2Coordinates(copy=False)  # live views
        self._v = data.GetODE2Coordinates_t(copy=False)
        self._a = data.GetODE2Coordinates_tt(copy=False)
        self._multipliers = data.GetAECoordinates(copy=False)
        self._reference = np.array(data.GetODE2Coordinates(configuration=exu.ConfigurationType.Reference))
        self._steering_rows = np.array([data.GetObjectLTGAE(i)[0] for i in joints.steering], dtype=np.int64)
        self._spin_rows = np.array([data.GetObjectLTGAE(i)[0] for i in joints.spin], dtype=np.int64)
        self._damping_entries = np.zeros((DAMPING_ENTRIES + HULL_ENTRIES, 3))
        unknowns = len(self._q) + len(self._multipliers)
        self._residual_scale = vehicle.mass * float(self.parameters[0]["gravity"]) / np.sqrt(unknowns)
        self._settings = integration_settings(micro_step, duration, TOLERANCE * self._residual_scale)
        self._solver = exu.MainSolverImplicitSecondOrder()
        self._constraints = Constraints(self.mbs, self._q, self._v, self._multipliers, self._spin_rows)
        self._predictor = Predictor(self._q, self._v, self._a, self._multipliers, NewmarkFactors.of(SPECTRAL_RADIUS))
        about = np.tile([*self._about, 0.0, 0.0, 0.0, 0.0], len(self._reference) // 7)
        self._recorder = Recorder(
            SystemState(self._q, self._v, self._a, self._reference + about),
            duration, record_step,
        )  # fmt: skip

    # -- running -----------------------------------------------------------------------------------------------------

    def settle(self, water_wrenches: Callable[[BodyStates], Array], initial_speed: float = 0.0) -> Start:
        """Find the static equilibrium (`exumob.multibody.settling`), and make it the state at time 0.

        Parameters
        ----------
        water_wrenches : callable
            Wrenches of the water for the present states, shape (5, 6), asked for every `SETTLING_STEP`.
        initial_speed : float
            Speed at time 0 along the heading, parallel to the ground under the wheels [m/s].

        Returns
        -------
        Start
            Whether the vehicle stands, creeps or slides.

        Raises
        ------
        SimulationError
            If a wheel sinks to its centre, or the vehicle tips over.
        """
        settings = integration_settings(SETTLING_MICRO_STEP, 1.0, TOLERANCE * self._residual_scale)
        settings.timeIntegration.newton.modifiedNewtonContractivity = 0.9  # three quarters of the time of 0.5
        present = SETTLING_MICRO_STEP, TOLERANCE

        def advance(end_time: float, micro_step: float, tolerance: float) -> BodyStates:
            nonlocal present
            if (micro_step, tolerance) != present:
                present = micro_step, tolerance
                settings.timeIntegration.numberOfSteps = round(settings.timeIntegration.endTime / micro_step)
                settings.timeIntegration.newton.absoluteTolerance = tolerance * self._residual_scale
                self._go_on_from(self.save(histories=False), settings)
            self._advance(settings, end_time)
            return self.present()

        def state() -> tuple[Array, Array]:
            return np.array(self._q), np.array(self._v)

        data = self.mbs.systemData
        initial = exu.ConfigurationType.Initial
        laid = np.array(data.GetODE2Coordinates(initial)), np.array(data.GetODE2Coordinates_t(initial))

        def begin() -> BodyStates:
            data.SetODE2Coordinates(laid[0], configuration=initial)
            data.SetODE2Coordinates_t(laid[1], configuration=initial)
            self._start(settings, driving=False)
            return self.present()

        self.parameters[0]["hold_place"] = self._reference[:3] + laid[0][:3]
        self.parameters[0]["hold_normal"] = self._ground_normal
        start = relax(self.vehicle, self.parameters[0], self.loads[0], water_wrenches, advance, begin, state)
        self._solver.FinalizeSolver(self.mbs, settings)
        self.start_kind = start.kind
        moving = initial_speed != 0.0 or self.maneuver.wheel_speed(0.0)[0] != 0.0
        velocities = self._rolling(start.coordinates, initial_speed) if moving else start.velocities
        data.SetODE2Coordinates(start.coordinates, configuration=initial)
        data.SetODE2Coordinates_t(velocities, configuration=initial)
        self._start(self._settings, driving=True)
        return start

    def _rolling(self, coordinates: Array, speed: float) -> Array:
        """Velocities of a vehicle that moves straight ahead while its wheels turn as the maneuver begins."""
        node = (coordinates + self._reference).reshape(9, 7)
        rates, rotation, spinning = np.zeros((9, 7)), np.zeros((3, 3)), np.zeros(4)
        rotation_matrix(node[0], rotation)
        ahead = rotation[:, 0] - self._ground_normal * (rotation[:, 0] @ self._ground_normal)
        rates[:, :3] = speed * ahead / np.linalg.norm(ahead)
        wheel_speed = self.maneuver.wheel_speed(0.0)[0]
        for i in range(4):
            rotation_matrix(node[1 + i], rotation)
            generalized_moment(node[5 + i], 0.25 * wheel_speed * rotation[:, 1].copy(), spinning)
            rates[5 + i, 3:] = spinning  # e_t = G^T(e) w / 2
        return rates.ravel()

    def _start(self, settings: Any, driving: bool) -> None:
        """Begin a run at time 0 from the initial configuration."""
        self._driving = driving
        self.energy_account[:] = 0
        self._recorder.clear()
        self._predictor.forget()
        self._looks = 0
        self._driver = self._feedback.driver(self.vehicle) if self._feedback and driving else None
        self._solver = exu.MainSolverImplicitSecondOrder()
        data = self.mbs.systemData
        data.SetTime(0.0)
        self._q[:] = data.GetODE2Coordinates(configuration=exu.ConfigurationType.Initial)
        self._v[:] = data.GetODE2Coordinates_t(configuration=exu.ConfigurationType.Initial)
        self._evaluate(0.0)  # Exudyn computes initial accelerations without calling the residual hook
        self.mbs.SetPreNewtonResidualUserFunction(held_weakly(self._before_residual))
        self.mbs.SetPostStepUserFunction(held_weakly(self._after_step))
        self.mbs.SetSystemJacobianUserFunction(held_weakly(self._load_jacobian))
        if not self._solver.InitializeSolver(self.mbs, settings):
            raise SimulationError(f"{self.vehicle.name}: Exudyn could not start: {self._solver.GetErrorString()}")
        self._evaluate(0.0)
        self._predictor.remember(0.0)
        self._account(0.0)
        self._recorder.sample(0.0)
        self._look(0.0)
        if driving:
            self._record(0.0)

    def _prescribe(self, time: float) -> None:
        driver = self._driver or self.maneuver
        steering = self.vehicle.steering_angles(driver.steering(time if self._driving else 0.0))
        speed = driver.wheel_speed(time)[0] if self._driving else 0.0
        command = self._command
        for i, (angle, rate, _) in enumerate(steering):
            command.rates[i] = rate
            if command.angles[i] != angle:
                command.angles[i] = angle
                self.mbs.SetObjectParameter(self._joints.steering[i], "offset", angle)
        if command.rates[2] != speed:
            command.rates[2] = speed
            for joint in self._joints.spin:
                self.mbs.SetObjectParameter(joint, "offset", speed)

    def _evaluate(self, time: float) -> None:
        self._prescribe(time)
        self._apply_loads(time)

    def _apply_loads(self, time: float) -> None:
        if self._forces:
            self._apply_forces(time if self._driving else 0.0)
        vehicle_loads(
            self.parameters, self._heights, self._hull_points, self._q, self._v, self._reference, self.loads,
            self._generalized,
        )  # fmt: skip
        if self._joints.force_object is not None:
            self.mbs.SetObjectParameter(self._joints.force_object, "forceVector", self._generalized)

    def _apply_forces(self, time: float) -> None:
        """Ask for the user's forces, at their points as they move now."""
        wrenches = self.loads[0]["point_wrench"]
        wrenches[:] = 0.0
        node, rate = (self._q + self._reference).reshape(9, 7), self._v.reshape(9, 7)
        arm, position, velocity = np.empty(3), np.empty(3), np.empty(3)
        for force, body, place in self._forces:  # bodies 1 to 4 are the uprights
            point_motion(node[body], rate[body], place, arm, position, velocity)
            add_force(force.at(time, position + self._about, velocity.copy()), arm, wrenches[body])

    def _before_residual(self, mbs: Any, time: float, newton_iteration: int, discontinuous_iteration: int) -> None:
        if newton_iteration == 0:
            self._prescribe(time)
            if self._changing_wrench is not None:
                mean, rate, middle = self._changing_wrench
                self.loads[0]["water_wrench"] = mean + (time - middle) * rate
            self._predictor.predict(time)
        self._apply_loads(time)

    def _load_jacobian(
        self, mbs: Any, time: float, factor: float, factor_velocity: float, factor_first_order: float
    ) -> Any:
        """Add what the soil does to the Newton matrix: without it, rest on firm soil costs many iterations."""
        entries = self._damping_entries
        soil_damping(self.parameters, self._heights, self._q, self._v, self._reference, factor_velocity, entries)
        touches = hull_tangent(
            self.parameters, self._heights, self._hull_points, self._q, self._v, self._reference, factor,
            factor_velocity, entries[DAMPING_ENTRIES:],
        )  # fmt: skip
        matrix = exu.MatrixContainer()
        n = len(self._q) + len(self._multipliers)
        matrix.SetWithSparseMatrix(entries if touches else entries[:DAMPING_ENTRIES], numberOfRows=n, numberOfColumns=n)
        return matrix

    def _account(self, time: float) -> float:
        return add_work(
            time, self.loads, self._multipliers, self._steering_rows, self._spin_rows, self._command.rates,
            self.energy_account,
        )  # fmt: skip

    def _after_step(self, mbs: Any, time: float) -> bool:
        self._predictor.remember(time)
        depth = self._account(time)
        if not depth < 1.0:
            raise self._sunk(time, depth)
        self._recorder.sample(time)
        self._look(time)
        if self._driving and self._recorder.record_is_due(time):
            self._record(time)
        return True

    def _sunk(self, time: float, depth: float) -> SimulationError:
        """Say that a wheel has sunk to its centre, or that the motion is not finite (depth NaN)."""
        name, phase = self.vehicle.name, self._phase
        if np.isnan(depth):
            return SimulationError(
                f"{name}: {phase}the motion is not finite at {time:.4f} s; halve micro_step and macro_step."
            )
        p, loads = self.parameters[0], self.loads[0]
        wheel = int(loads["sinkage"].argmax())
        return SimulationError(
            f"{name}: {phase}a wheel has sunk to its centre at {time:.4f} s (sinkage {depth:.2f} radii; Bekker-Wong "
            f"ends at 1): the soil bears {loads['soil_force'][wheel, 2]:.0f} N there, a quarter of the weight is "
            f"{0.25 * self.vehicle.mass * float(p['gravity']):.0f} N. Choose a firmer soil or a lighter vehicle.",
            cause="sunk",
        )

    def _look(self, time: float) -> None:
        """Let the driver of a maneuver with feedback see the vehicle, if it is time to."""
        if self._feedback and self._driver and time >= self._looks * self._feedback.control_step - 1e-9:
            self._driver.observe(self.present())
            self._looks += 1

    def _record(self, time: float) -> None:
        """Store all loads (at the converged state), reactions and constraint errors."""
        self._apply_loads(time)
        self._recorder.add_record(
            time,
            loads=self.loads[0],
            energy_account=self.energy_account[0],
            spin_torque=-np.array(self._multipliers)[self._spin_rows],
            steering=self._command.angles,
            constraint_wrench=self.constraint_wrenches(),
            constraint_error=self.constraint_errors(),
        )

    def _advance(self, settings: Any, end_time: float) -> None:
        """Integrate to `end_time`, with a looser tolerance where rounding stops Newton's iterations short of it.

        While the vehicle settles, the looser tolerance stays: there each macro step meets the same rounding.
        """
        before = self.save(histories=False)
        if self._solve(settings, end_time):
            return
        newton = settings.timeIntegration.newton
        usual = newton.absoluteTolerance
        for tolerance in (t for t in LOOSER if t * self._residual_scale > usual):
            newton.absoluteTolerance = tolerance * self._residual_scale
            self._go_on_from(before, settings)
            if not self._solve(settings, end_time):
                continue
            logger.log(
                logging.DEBUG if self._loosened else logging.WARNING,
                "%s: %sNewton's iterations stopped short of the usual tolerance in the macro step that ends at %.4f s; "
                "it was solved to residuals of %g of the weight. Further ones are not named.",
                self.vehicle.name, self._phase, end_time, tolerance,
            )  # fmt: skip
            self._loosened = True
            if self._driving:
                newton.absoluteTolerance = usual
                self._go_on_from(self.save(histories=False), settings)
            return
        newton.absoluteTolerance = usual
        remedy = (
            "Halve micro_step, or soften the soil, the bump stops or the maneuver."
            if self._driving
            else "Start on gentler ground, or soften the soil or the suspension and its stops."
        )
        raise SimulationError(
            f"{self.vehicle.name}: {self._phase}the time integration broke down at {self.time:.4f} s (Newton did not "
            f"converge). {remedy}"
        )

    @property
    def _phase(self) -> str:
        return "" if self._driving else "while settling, "

    def _go_on_from(self, saved: SavedState, settings: Any) -> None:
        """Return to a state with a new solver: one that failed keeps its reduced step, and any the tolerance it had."""
        self._solver = exu.MainSolverImplicitSecondOrder()
        self._solver.InitializeSolver(self.mbs, settings)
        self._return_to(saved, settings)

    def _solve(self, settings: Any, end_time: float) -> bool:
        self._solver.it.endTime = end_time
        try:
            return bool(self._solver.SolveSteps(self.mbs, settings))
        except Exception as error:
            if isinstance(error.__cause__, SimulationError | KeyboardInterrupt):  # from a user function
                raise error.__cause__ from None
            raise

    def advance(self, end_time: float, wrenches: Array, rate: Array | None = None) -> None:
        """Integrate to `end_time` with the water's wrenches on the five bodies.

        Parameters
        ----------
        end_time : float
            [s]
        wrenches : array, shape (5, 6)
            Mean wrenches over the interval [N, N m], body axes.
        rate : array, shape (5, 6), optional
            Their change in time [N/s, N m/s], about the middle of the interval: the mean is kept. None: they are held.

        Raises
        ------
        SimulationError
            If a wheel sinks to its centre, the motion is not finite or the integration does not converge.
        """
        self.loads[0]["water_wrench"] = wrenches
        middle = 0.5 * (self.time + end_time)
        self._changing_wrench = None if rate is None else (np.array(wrenches), np.array(rate), middle)
        try:
            self._advance(self._settings, end_time)
        finally:
            self._changing_wrench = None

    # -- state -------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return float(self.mbs.systemData.GetTime())

    @property
    def slowest_slide(self) -> float:
        """Speed from which locked wheels slide [m/s]; slower, soil at standstill resists by creep."""
        return float(self.parameters[0]["wheel_radius"] * self.parameters[0]["standstill_rate"])

    @property
    def history(self) -> BodyStates:
        """Motion of the five bodies every `HISTORY_STEP` from time 0, and now (views)."""
        return self._recorder.history(self.time)

    def present(self) -> BodyStates:
        """Motion of the five bodies now, n = 1."""
        return self._recorder.present(self.time)

    def record_end(self) -> None:
        """Add a record of the present instant unless the last one is of it."""
        if self.time > self._recorder.last_record_time + 1e-9:
            self._record(self.time)

    @property
    def records(self) -> np.ndarray:
        """Loads, reactions and energy every `record_step` from time 0 to now, dtype `RECORD` (a view)."""
        return self._recorder.records

    def save(self, histories: bool = True) -> SavedState:
        """Return all that the next step depends on, to be given to `restore`.

        Without `histories` it is light and fits this model only (repeated macro steps); with them, any equal model.
        """
        data = self.mbs.systemData
        return SavedState(
            time=self.time,
            coordinates={k: np.array(v) for k, v in data.GetSystemStateDict().items()},
            algorithmic_acceleration=np.array(self._solver.GetAAlgorithmic()),
            predictor=self._predictor.save(),
            loads=self.loads.copy(),
            energy_account=self.energy_account.copy(),
            **self._recorder.save(histories),
            driver=None if self._driver is None else {"looks": self._looks, "own": copy.deepcopy(self._driver.save())},
            start_kind=self.start_kind,
        )

    def restore(self, saved: SavedState) -> None:
        """Return to a saved state, bit for bit."""
        if not self._driving:
            self._start(self._settings, driving=True)
        self._return_to(saved, self._settings)

    def _return_to(self, saved: SavedState, settings: Any) -> None:
        data = self.mbs.systemData
        # the algorithmic acceleration can only be written through the initial configuration
        initial = data.GetSystemStateDict(reference=True, configuration=exu.ConfigurationType.Initial)
        kept = {k: np.array(v) for k, v in initial.items()}
        for k in initial:
            initial[k][:] = saved.coordinates[k]
        initial["ODE2Coords_tt"][:] = saved.algorithmic_acceleration
        alpha = settings.timeIntegration.generalizedAlpha
        flags = alpha.computeInitialAccelerations, alpha.resetAccelerations
        alpha.computeInitialAccelerations = alpha.resetAccelerations = False
        self._solver.InitializeSolverInitialConditions(self.mbs, settings)
        alpha.computeInitialAccelerations, alpha.resetAccelerations = flags
        for k in initial:
            initial[k][:] = kept[k]
        current = data.GetSystemStateDict(reference=True)
        for k in current:
            current[k][:] = saved.coordinates[k]
        data.SetTime(saved.time)
        self._solver.it.currentTime = saved.time
        self._predictor.restore(saved.predictor)
        self.loads[:] = saved.loads
        self.energy_account[:] = saved.energy_account
        self._recorder.restore(saved.samples, saved.rows, saved.history, saved.records)
        if self._driver is not None and saved.driver is not None:
            self._looks = saved.driver["looks"]
            self._driver.restore(copy.deepcopy(saved.driver["own"]))
        self.start_kind = saved.start_kind
        self._prescribe(saved.time)

    def constraint_wrenches(self) -> Array:
        """Reactions on the nine bodies, shape (9, 6), see `exumob.multibody.reactions.constraint_wrenches`."""
        wrenches = np.empty((9, 6))
        constraint_wrenches(self.parameters, self.loads, self._q, self._v, self._a, self._reference, wrenches)
        return wrenches

    def constraint_errors(self) -> tuple[float, float]:
        """Largest constraint residuals now, see `Constraints.errors`."""
        return self._constraints.errors()

    def predict(self, step: float) -> BodyStates:
        """Extrapolate over `step` [s] and project on the constraints; the state of the model itself is left alone.

        q + h v + h^2/2 a and v + h a, then `Constraints.project` (paper Sec. 2.3).

        Returns
        -------
        BodyStates, n = 1
        """
        now, q, v, a = self.time, np.array(self._q), np.array(self._v), np.array(self._a)
        try:
            self.mbs.systemData.SetTime(now + step)
            self._prescribe(now + step)
            self._q[:] = q + step * v + 0.5 * step**2 * a
            self._v[:] = v + step * a
            self._constraints.project()
            return self._recorder.present(now + step)
        finally:
            self.mbs.systemData.SetTime(now)
            self._q[:], self._v[:] = q, v
            self._prescribe(now)
