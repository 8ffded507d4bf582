"""The vehicle as a redundant-coordinate Exudyn model (paper Eq. 6), advanced macro step by macro step.

Nine rigid bodies with Euler parameters (hull, four uprights, four wheels), joints as algebraic constraints; steering
and wheel spin are kinematic constraints in time. Soil, suspension and water come from `exumob.multibody.applied_loads` as user loads:
one gather before each Newton residual, each load returns its row.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from exumob.support.exudyn import exu  # isort: skip (before anything of exudyn)
from exudyn.itemInterface import (
    LoadForceVector,
    LoadTorqueVector,
    MarkerBodiesRelativeRotationCoordinate,
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    ObjectConnectorCoordinate,
    ObjectConnectorDistance,
    ObjectJointGeneric,
    ObjectJointRevoluteZ,
)
from exudyn.utilities import RigidBodyInertia

from exumob.driving.maneuver import Driver, FeedbackManeuver, Maneuver
from exumob.ground.soil import Soil
from exumob.ground.terrain import Terrain
from exumob.multibody.applied_loads import (
    HISTORY,
    LOADS,
    WORK,
    add_work,
    load_model,
    sample_motion,
    soil_damping,
    vehicle_loads,
)
from exumob.multibody.constraints import Constraints
from exumob.support.arrays import Array
from exumob.support.errors import SimulationError
from exumob.vehicle.motion import BodyStates
from exumob.vehicle.parameters import Suspension, Vehicle

HISTORY_STEP = 1.0e-3
"""Sampling of the motion that every water model sees [s]; the paper's networks were trained at it."""
SETTLING_STEP = 5.0e-3
"""Macro step while the static equilibrium is sought [s]."""
RECORD = np.dtype(
    [
        ("motion", HISTORY),
        ("loads", LOADS),
        ("ledger", WORK),
        ("spin_torque", "f8", (4,)),  # of the spin constraint on each wheel [N m]
        ("steering", "f8", (2,)),  # angles of the front wheels [rad]
        ("constraint_wrench", "f8", (9, 6)),  # on hull, uprights, wheels; world axes, about each origin
        ("constraint_error", "f8", (2,)),  # position level [m, rad], velocity level [rad/s]
    ],
    align=True,
)
"""All that is kept of one instant of a run."""
SPIN_FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]).T
"""Joint frame in wheel axes: its z axis is the wheel's y axis."""


@dataclass(frozen=True)
class SavedState:
    """All that the next step depends on; see `MultibodyVehicle.save`."""

    time: float
    coordinates: dict[str, Array]
    algorithmic_acceleration: Array
    loads: np.ndarray
    ledger: np.ndarray
    samples: int
    rows: int
    history: np.ndarray | None
    records: np.ndarray | None
    driver: dict[str, Any] | None = None


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
        Of the run [s]; history and records are kept for as long.
    record_step : float
        Interval between records of all loads and reactions [s].
    standstill_rate : float
        Spin below which the shear displacement is regularised [rad/s] (see `exumob.ground.terramechanics`).

    Notes
    -----
    Generalized-alpha (spectral radius 0.8, index 3; Arnold & Bruels 2007) with modified Newton iterations.
    Call `settle` once, then `advance` macro step by macro step.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        soil: Soil,
        maneuver: Maneuver,
        terrain: Terrain,
        micro_step: float,
        duration: float,
        record_step: float = 1.0e-2,
        standstill_rate: float = 0.05,
    ) -> None:
        """Build the system at ride height on the terrain."""
        self.vehicle = vehicle
        self.maneuver = maneuver
        self._feedback = maneuver if isinstance(maneuver, FeedbackManeuver) else None
        self._driver: Driver | None = None  # of a maneuver with feedback, while driving
        self._looks = 0
        self.micro_step = micro_step
        self.model = load_model(vehicle, soil, terrain, standstill_rate)
        self.loads = np.zeros(1, LOADS)
        self.ledger = np.zeros(1, WORK)
        self._heights = terrain.as_arrays()[1]
        self._history = np.zeros(round(duration / HISTORY_STEP) + 2, HISTORY)
        self._samples = 0
        self._record_step = record_step
        self._records = np.zeros(round(duration / record_step) + 2, RECORD)
        self._rows = 0
        self._command = [0.0, 0.0, 0.0]  # front-left and front-right steering angle, wheel speed
        self._driving = False  # until the vehicle has settled: wheels locked, steering as at time 0
        self._rates = np.zeros(3)  # of the two angles, and the wheel speed again
        self._water: tuple[Array, Array, float] | None = None  # mean, rate and middle of a load that changes in a step

        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        self._build(terrain)
        self.mbs.Assemble()
        data = self.mbs.systemData
        self._q = data.GetODE2Coordinates(copy=False)  # live views
        self._v = data.GetODE2Coordinates_t(copy=False)
        self._a = data.GetODE2Coordinates_tt(copy=False)
        self._multipliers = data.GetAECoordinates(copy=False)
        self._reference = np.array(data.GetODE2Coordinates(configuration=exu.ConfigurationType.Reference))
        self._steering_rows = np.array([data.GetObjectLTGAE(i)[0] for i in self._steering_joints], dtype=np.int64)
        self._spin_rows = np.array([data.GetObjectLTGAE(i)[0] for i in self._spin_joints], dtype=np.int64)
        self._damping_entries = np.zeros((132, 3))
        self._settings = _solver_settings(micro_step, duration)
        self._solver = exu.MainSolverImplicitSecondOrder()
        self._constraints = Constraints(self.mbs, self._q, self._v, self._multipliers, self._reference, self._spin_rows)

    # -- model -------------------------------------------------------------------------------------------------------

    def _build(self, terrain: Terrain) -> None:
        vehicle, mbs = self.vehicle, self.mbs
        height, normal = terrain.height_and_normal(0.0, 0.0)
        tilt = _frame_on(normal)
        origin = np.array([0.0, 0.0, height])
        gravity = [0.0, 0.0, -float(self.model[0]["gravity"])]

        def add_body(name: str, mass: float, inertia: Array, position: Array) -> int:
            body: int = mbs.CreateRigidBody(
                name=name,
                referencePosition=origin + tilt @ position,
                referenceRotationMatrix=tilt,
                inertia=RigidBodyInertia(mass, inertia),
                gravity=gravity,
            )
            return body

        hull = add_body("hull", vehicle.hull.mass, vehicle.hull.inertia_tensor, vehicle.hull_origin)
        suspensions = [suspension for suspension in vehicle.axle_suspensions for _ in range(2)]
        uprights = [
            add_body(f"upright {i}", s.upright_mass, s.upright_inertia_tensor, c)
            for i, (s, c) in enumerate(zip(suspensions, vehicle.wheel_centers, strict=True))
        ]
        wheels = [
            add_body(f"wheel {i}", vehicle.wheel.mass, vehicle.wheel.inertia_tensor, c)
            for i, c in enumerate(vehicle.wheel_centers)
        ]
        ground = mbs.AddNode(NodePointGround())
        self._ground = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
        self._steering_joints: list[int] = []
        self._spin_joints: list[int] = []
        self._suspension_joints: list[int] = []
        for i, suspension in enumerate(suspensions):
            steered = i < 2
            if suspension.wishbones is None:
                self._add_pillar(hull, uprights[i], i, steered)
            else:
                self._add_wishbones(hull, uprights[i], i, suspension)
            if steered or suspension.wishbones is not None:
                self._steering_joints.append(
                    self._constrain_rotation(
                        hull, uprights[i], [0.0, 0.0, 1.0],
                        rate=(lambda *_, i=i: float(self._rates[i])) if steered else (lambda *_: 0.0),
                        angle=(lambda *_, i=i: self._command[i]) if steered else (lambda *_: 0.0),
                    )
                )  # fmt: skip
            marker_0, marker_1 = (
                mbs.AddMarker(MarkerBodyRigid(bodyNumber=b, localHT=exu.HT(rotation=SPIN_FRAME)))
                for b in (uprights[i], wheels[i])
            )
            mbs.AddObject(ObjectJointRevoluteZ(markerNumbers=[marker_0, marker_1]))
            self._spin_joints.append(
                self._constrain_rotation(uprights[i], wheels[i], [0.0, 1.0, 0.0], rate=lambda *_: self._command[2])
            )
        record = self.loads[0]
        self._load(hull, record["hull_force"], record["hull_torque"])
        for i in range(4):
            self._load(uprights[i], record["upright_force"][i], record["upright_torque"][i])
            self._load(wheels[i], None, record["wheel_torque"][i])

    def _load(self, body: int, force: Array | None, torque: Array) -> None:
        marker = self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=body))
        if force is not None:
            self.mbs.AddLoad(LoadForceVector(markerNumber=marker, loadVectorUserFunction=lambda *_: force))
        self.mbs.AddLoad(LoadTorqueVector(markerNumber=marker, loadVectorUserFunction=lambda *_: torque))

    def _add_pillar(self, hull: int, upright: int, wheel: int, steered: bool) -> None:
        """Upright slides along the hull's z axis; a steered one also turns about it."""
        arm = self.vehicle.wheel_centers[wheel] - self.vehicle.hull_origin
        markers = [
            self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=hull, localPosition=arm)),
            self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=upright)),
        ]
        axes = [1, 1, 0, 1, 1, 0 if steered else 1]
        self._suspension_joints.append(
            self.mbs.AddObject(ObjectJointGeneric(markerNumbers=markers, constrainedAxes=axes))
        )

    def _add_wishbones(self, hull: int, upright: int, wheel: int, suspension: Suspension) -> None:
        """Four rigid rods: fore and aft of the upper and of the lower arm."""
        arms = suspension.wishbones
        assert arms is not None
        center = self.vehicle.wheel_centers[wheel] - self.vehicle.hull_origin
        side = 1.0 if center[1] > 0.0 else -1.0
        for length, joint_height, drop in (
            (arms.upper_length, arms.upper_height, arms.upper_pivot_drop),
            (arms.lower_length, -arms.lower_height, 0.0),
        ):
            ball = np.array([0.0, -side * arms.ball_joint_inset, joint_height])
            reach = np.sqrt(length**2 - drop**2)
            for x in (0.5 * arms.pivot_spread, -0.5 * arms.pivot_spread):
                pivot = center + ball + np.array([x, -side * reach, -drop])
                markers = [
                    self.mbs.AddMarker(MarkerBodyPosition(bodyNumber=hull, localPosition=pivot)),
                    self.mbs.AddMarker(MarkerBodyPosition(bodyNumber=upright, localPosition=ball)),
                ]
                rod = float(np.hypot(length, x))
                self._suspension_joints.append(
                    self.mbs.AddObject(ObjectConnectorDistance(markerNumbers=markers, distance=rod))
                )

    def _constrain_rotation(
        self,
        body_0: int,
        body_1: int,
        axis: list[float],
        rate: Callable[..., float],
        angle: Callable[..., float] | None = None,
    ) -> int:
        """Prescribe the relative rotation about `axis` of body 0; without an angle, on velocity level."""
        marker = self.mbs.AddMarker(MarkerBodiesRelativeRotationCoordinate(bodyNumbers=[body_0, body_1], axis0=axis))
        joint: int = self.mbs.AddObject(
            ObjectConnectorCoordinate(
                markerNumbers=[self._ground, marker],
                velocityLevel=angle is None,
                offsetUserFunction=angle or 0,
                offsetUserFunction_t=rate,
            )
        )
        return joint

    # -- running -----------------------------------------------------------------------------------------------------

    def settle(self, water_load: Callable[[BodyStates], Array], limit: float = 20.0) -> None:
        """Find the static equilibrium by dynamic relaxation, and make it the state at time 0.

        Wheels are locked. First every body is damped in proportion to its mass, on slippery and then on the true soil;
        then it stands free until the largest acceleration is below 3e-7 g. What is left is the slow creep with which
        soil at standstill resists.

        Parameters
        ----------
        water_load : callable
            Wrenches of the water for the present states, shape (5, 6), asked for every `SETTLING_STEP`.
        limit : float
            Give up after this simulated time [s].

        Raises
        ------
        SimulationError
            If no equilibrium is found (the vehicle sinks in, floats or slides).
        """
        model, step = self.model[0], 1.0e-3
        settings = _solver_settings(step, limit, tolerance=1e-7)
        settings.timeIntegration.newton.modifiedNewtonContractivity = 0.5  # half the time of 0.05; 1e-11 m apart
        damping = 2.0 * float(np.sqrt(model["stiffness"].sum() / self.vehicle.mass))  # about critical for heave
        standstill_rate = float(model["standstill_rate"])
        # slippery soil first: friction at the tyres would hold a linkage suspension back
        stages = [
            (20.0 * standstill_rate, damping, 1e-5),
            (standstill_rate, damping, 1e-6),
            (standstill_rate, 0.0, 3e-7),
        ]
        self._start(settings, driving=False)
        try:
            for n in range(round(limit / SETTLING_STEP)):
                model["standstill_rate"], model["settling_rate"], target = stages[0]
                self.loads[0]["water"] = water_load(self.present())
                self._advance(settings, (n + 1) * SETTLING_STEP)
                state = self.present()
                acceleration = max(np.abs(state.acceleration).max(), 0.1 * np.abs(state.angular_acceleration).max())
                if acceleration < target * model["gravity"] and n * SETTLING_STEP > 0.2:
                    stages.pop(0)
                    if not stages:
                        break
            speed = float(np.hypot(*state.velocity[0, 0, :2]))
            if stages or speed > model["wheel_radius"] * standstill_rate:
                raise _because(
                    self._footing(speed),
                    f"{self.vehicle.name}: no static equilibrium within {limit} s (largest acceleration "
                    f"{acceleration:.2g} m/s^2, speed {speed:.2g} m/s); the vehicle floats, slides or trembles on its "
                    "tyres. Lower the water depth or the current, choose a firmer soil or a gentler slope.",
                )
        finally:
            self._solver.FinalizeSolver(self.mbs, settings)
            model["settling_rate"] = 0.0
            model["standstill_rate"] = standstill_rate
        data = self.mbs.systemData
        data.SetODE2Coordinates(np.array(self._q), configuration=exu.ConfigurationType.Initial)
        data.SetODE2Coordinates_t(np.array(self._v), configuration=exu.ConfigurationType.Initial)
        self._start(self._settings, driving=True)

    def _footing(self, speed: float) -> str:
        """Why the vehicle cannot stand, as `SimulationError.cause`."""
        borne = float(self.loads[0]["soil_force"][:, 2].sum())
        if borne < 0.05 * self.vehicle.mass * float(self.model[0]["gravity"]):
            return "afloat"
        return "swept away" if speed > self.model[0]["wheel_radius"] * self.model[0]["standstill_rate"] else ""

    def _start(self, settings: Any, driving: bool) -> None:
        """Begin a run at time 0 from the initial configuration."""
        self._driving = driving
        self.ledger[:] = 0
        self._samples = self._rows = self._looks = 0
        self._driver = self._feedback.driver(self.vehicle) if self._feedback and driving else None
        self._solver = exu.MainSolverImplicitSecondOrder()
        data = self.mbs.systemData
        data.SetTime(0.0)
        self._q[:] = data.GetODE2Coordinates(configuration=exu.ConfigurationType.Initial)
        self._v[:] = data.GetODE2Coordinates_t(configuration=exu.ConfigurationType.Initial)
        self._evaluate(0.0)  # Exudyn computes initial accelerations without calling the residual hook
        self.mbs.SetPreNewtonResidualUserFunction(self._before_residual)
        self.mbs.SetPostStepUserFunction(self._after_step)
        self.mbs.SetSystemJacobianUserFunction(self._load_jacobian)
        if not self._solver.InitializeSolver(self.mbs, settings):
            raise SimulationError(f"{self.vehicle.name}: Exudyn could not start: {self._solver.GetErrorString()}")
        self._evaluate(0.0)
        self._account(0.0)
        self._sample(0.0)
        self._look(0.0)
        if driving:
            self._record(0.0)

    def _set_command(self, time: float) -> None:
        driver = self._driver or self.maneuver
        left, right = self.vehicle.steering_angles(driver.steering(time if self._driving else 0.0))
        speed = driver.wheel_speed(time)[0] if self._driving else 0.0
        self._command[:] = left[0], right[0], speed
        self._rates[:] = left[1], right[1], speed

    def _evaluate(self, time: float) -> None:
        self._set_command(time)
        vehicle_loads(self.model, self._heights, self._q, self._v, self._reference, self.loads)

    def _before_residual(self, mbs: Any, time: float, newton_iteration: int, discontinuous_iteration: int) -> None:
        if newton_iteration == 0:
            self._set_command(time)
            if self._water is not None:
                mean, rate, middle = self._water
                self.loads[0]["water"] = mean + (time - middle) * rate
        vehicle_loads(self.model, self._heights, self._q, self._v, self._reference, self.loads)

    def _load_jacobian(
        self, mbs: Any, time: float, factor: float, factor_velocity: float, factor_first_order: float
    ) -> Any:
        """Add the soil's damping to the Newton matrix: without it, rest on firm soil costs many iterations."""
        soil_damping(
            self.model, self._heights, self._q, self._v, self._reference, factor_velocity, self._damping_entries
        )
        matrix = exu.MatrixContainer()
        n = len(self._q) + len(self._multipliers)
        matrix.SetWithSparseMatrix(self._damping_entries, numberOfRows=n, numberOfColumns=n)
        return matrix

    def _account(self, time: float) -> float:
        return add_work(
            time, self.loads, self._multipliers, self._steering_rows, self._spin_rows, self._rates, self.ledger
        )

    def _sample(self, time: float) -> None:
        sample = self._history[self._samples % len(self._history)]
        sample["time"] = time
        sample_motion(self._q, self._v, self._a, self._reference, sample)
        self._samples += 1

    def _after_step(self, mbs: Any, time: float) -> bool:
        depth = self._account(time)
        if not depth < 1.0:
            cause = "" if np.isnan(depth) else "sunk"
            phase = "" if self._driving else "while settling, "
            raise _because(cause, _sunk(self.vehicle.name, time, depth, phase))
        if time >= self._samples * HISTORY_STEP - 1e-9:
            self._sample(time)
        self._look(time)
        if self._driving and time >= self._rows * self._record_step - 1e-9:
            self._record(time)
        return True

    def _look(self, time: float) -> None:
        """Let the driver of a maneuver with feedback see the vehicle, if it is time to."""
        if self._feedback and self._driver and time >= self._looks * self._feedback.control_step - 1e-9:
            self._driver.observe(self.present())
            self._looks += 1

    def _record(self, time: float) -> None:
        """Store all loads (at the converged state), reactions and constraint errors."""
        row = self._records[self._rows % len(self._records)]
        vehicle_loads(self.model, self._heights, self._q, self._v, self._reference, self.loads)
        sample_motion(self._q, self._v, self._a, self._reference, row["motion"])
        row["motion"]["time"] = time
        row["loads"] = self.loads[0]
        row["ledger"] = self.ledger[0]
        row["spin_torque"] = -np.array(self._multipliers)[self._spin_rows]
        row["steering"] = self._command[:2]
        row["constraint_wrench"] = self.constraint_wrenches()
        row["constraint_error"] = self.constraint_errors()
        self._rows += 1

    def _advance(self, settings: Any, end_time: float) -> None:
        self._solver.it.endTime = end_time
        try:
            converged = self._solver.SolveSteps(self.mbs, settings)
        except Exception as error:
            if isinstance(error.__cause__, SimulationError | KeyboardInterrupt):  # from a user function
                raise error.__cause__ from None
            raise
        if not converged:
            raise SimulationError(
                f"{self.vehicle.name}: the time integration broke down at {self.time:.4f} s (Newton did not converge). "
                "Halve micro_step, or soften the soil, the bump stops or the maneuver."
            )

    def advance(self, end_time: float, water: Array, rate: Array | None = None) -> None:
        """Integrate to `end_time` with the water's wrenches on the five bodies.

        Parameters
        ----------
        end_time : float
            [s]
        water : array, shape (5, 6)
            Mean wrenches over the interval [N, N m], body axes.
        rate : array, shape (5, 6), optional
            Their change in time [N/s, N m/s], about the middle of the interval: the mean is kept. None: they are held.

        Raises
        ------
        SimulationError
            If a wheel sinks to its centre, the motion is not finite or the integration does not converge.
        """
        self.loads[0]["water"] = water
        middle = 0.5 * (self.time + end_time)
        self._water = None if rate is None else (np.array(water), np.array(rate), middle)
        try:
            self._advance(self._settings, end_time)
        finally:
            self._water = None

    # -- state -------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return float(self.mbs.systemData.GetTime())

    @property
    def history(self) -> BodyStates:
        """Motion of the five bodies every `HISTORY_STEP` from time 0, and now (views)."""
        if self.time > self._history["time"][self._samples - 1] + 1e-9:  # between two samples: lent the next one's row
            now = self._history[self._samples]
            now["time"] = self.time
            sample_motion(self._q, self._v, self._a, self._reference, now)
            return _as_states(self._history[: self._samples + 1])
        return _as_states(self._history[: self._samples])

    def present(self) -> BodyStates:
        """Motion of the five bodies now, n = 1."""
        sample = np.zeros(1, HISTORY)
        sample["time"] = self.time
        sample_motion(self._q, self._v, self._a, self._reference, sample[0])
        return _as_states(sample)

    def record_end(self) -> None:
        """Add a record of the present instant unless the last one is."""
        if self.time > self._records["motion"]["time"][self._rows - 1] + 1e-9:
            self._record(self.time)

    @property
    def records(self) -> np.ndarray:
        """Loads, reactions and energy every `record_step` from time 0 to now, dtype `RECORD` (a view)."""
        return self._records[: self._rows]

    def save(self, histories: bool = True) -> SavedState:
        """Return all that the next step depends on, to be given to `restore`.

        Without `histories` it is light and fits this model only (repeated macro steps); with them, any equal model.
        """
        data = self.mbs.systemData
        return SavedState(
            time=self.time,
            coordinates={k: np.array(v) for k, v in data.GetSystemStateDict().items()},
            algorithmic_acceleration=np.array(self._solver.GetAAlgorithmic()),
            loads=self.loads.copy(),
            ledger=self.ledger.copy(),
            samples=self._samples,
            rows=self._rows,
            history=self._history[: self._samples].copy() if histories else None,
            records=self._records[: self._rows].copy() if histories else None,
            driver=None if self._driver is None else {"looks": self._looks, "own": copy.deepcopy(self._driver.save())},
        )

    def restore(self, saved: SavedState) -> None:
        """Return to a saved state, bit for bit."""
        data, settings = self.mbs.systemData, self._settings
        if not self._driving:
            self._start(settings, driving=True)
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
        self.loads[:] = saved.loads
        self.ledger[:] = saved.ledger
        self._samples, self._rows = saved.samples, saved.rows
        if self._driver is not None and saved.driver is not None:
            self._looks = saved.driver["looks"]
            self._driver.restore(copy.deepcopy(saved.driver["own"]))
        if saved.history is not None and saved.records is not None:
            self._history[: self._samples] = saved.history
            self._records[: self._rows] = saved.records
        self._set_command(saved.time)

    def constraint_wrenches(self) -> Array:
        """Reactions on the nine bodies, see `Constraints.wrenches`."""
        return self._constraints.wrenches()

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
        sample = np.zeros(1, HISTORY)
        sample["time"] = now + step
        try:
            self.mbs.systemData.SetTime(now + step)
            self._set_command(now + step)
            self._q[:] = q + step * v + 0.5 * step**2 * a
            self._v[:] = v + step * a
            self._constraints.project()
            sample_motion(self._q, self._v, self._a, self._reference, sample[0])
        finally:
            self.mbs.systemData.SetTime(now)
            self._q[:], self._v[:] = q, v
            self._set_command(now)
        return _as_states(sample)


def _because(cause: str, message: str) -> SimulationError:
    error = SimulationError(message)
    error.cause = cause
    return error


def _sunk(name: str, time: float, depth: float, phase: str) -> str:
    if np.isnan(depth):
        return f"{name}: {phase}the motion is not finite at {time:.4f} s; halve micro_step and macro_step."
    return (
        f"{name}: {phase}a wheel has sunk to its centre at {time:.4f} s (sinkage {depth:.2f} radii; Bekker-Wong "
        "ends at 1). Choose a firmer soil or a lighter vehicle."
    )


def _as_states(samples: np.ndarray) -> BodyStates:
    return BodyStates(*(samples[name] for name in BodyStates.__dataclass_fields__))


def _frame_on(normal: Array) -> Array:
    """Rotation matrix whose z axis is the terrain's normal and whose x axis points along world x."""
    left = np.cross(normal, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    return np.column_stack([np.cross(left, normal), left, normal])


def _solver_settings(step: float, duration: float, tolerance: float = 1e-5) -> Any:
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps = max(round(duration / step), 1)
    integration.endTime = integration.numberOfSteps * step
    integration.generalizedAlpha.spectralRadius = 0.8
    newton = integration.newton
    newton.useModifiedNewton = True
    newton.modifiedNewtonContractivity = 0.05
    newton.relativeTolerance, newton.absoluteTolerance = tolerance, 1e-2 * tolerance
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.linearSolver.reuseAnalyzedPattern = True
    _silence(settings)
    return settings


def _silence(settings: Any) -> None:
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.file.writeInitialValues = False
    settings.solution.sensors.active = False
