"""Execution of motions by a simulated arm with servos."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import write_parquet
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion, concatenate
from sidegan.plant.model import PlantSettings, mujoco_model
from sidegan.robot import Arm
from sidegan.robot.write_mjcf import mujoco_logged

if TYPE_CHECKING:
    import mujoco

_POSTURES = 64  # random postures over which the largest joint inertia is computed
_OFF_GRID = 1e-3  # relative tolerance of time steps, since a period may not be a whole number of them
_AT_THE_LIMIT = 0.999  # of the torque limit


class Executed(NamedTuple):
    """Recorded signals of an executed motion."""

    time: Array  # [s], (T,)
    position: Array  # [rad or m], (T, J)
    velocity: Array  # [rad/s or m/s], (T, J)
    torque: Array  # [N·m or N], (T, J)


def save_recording(executed: Executed, joint_names: Sequence[str], path: Path) -> None:
    """Write a recording as Parquet: ``time`` [s], then ``q_<joint>``, ``dq_``, ``tau_`` in SI units.

    Raises:
        ShapeError: when there is not a name for each joint.
        StorageError: when the file cannot be written.
    """
    import pyarrow as pa

    joints = executed.position.shape[1]
    if len(joint_names) != joints:
        raise ShapeError(f"joint_names are {[*joint_names]}, expected a name for each of {joints} joints")
    columns = {"time": executed.time}
    for letter, values in zip(("q", "dq", "tau"), executed[1:]):
        columns |= {f"{letter}_{name}": values[:, i] for i, name in enumerate(joint_names)}
    write_parquet(path, pa.table(columns))


class Plant:
    """An arm in MuJoCo, each joint under a position servo with inverse-dynamics feed-forward.

    Torques are the drives', including what rotors and friction need; so are torque limits.
    """

    def __init__(self, arm: Arm, settings: PlantSettings) -> None:
        self.arm = arm
        self.settings = settings
        self.body = RigidBody(arm)

    @cached_property
    def gains(self) -> tuple[Array, Array]:
        """Stiffness [N·m/rad] and damping [N·m·s/rad] of the servos, (J,) each.

        The settings' bandwidth and damping ratio are those of a single joint with its largest inertia.
        """
        inertia = largest_inertia(self.body) + self._each("rotor_inertia")
        speed = 2 * np.pi * self._each("bandwidth")
        return inertia * speed**2, 2 * inertia * speed * self._each("damping_ratio")

    @cached_property
    def model(self) -> "mujoco.MjModel":
        """MuJoCo model with servos."""
        return mujoco_model(self.arm, self.settings, *self.gains)

    def execute(self, motion: Motion, seed: int | np.random.SeedSequence, noise: float) -> Executed:
        """What ``follow`` returns, with Gaussian torque noise of this standard deviation [N·m or N]."""
        true = self.follow(motion)
        draw = np.random.default_rng(seed).standard_normal(true.torque.shape)
        return true._replace(torque=true.torque + noise * draw)

    def follow(self, motion: Motion) -> Executed:
        """True signals of a motion, or of several executed one after another.

        Args:
            motion: states (B, T, J) at the plant's rate (``Trajectory.times(settings.rate)``); with
                B > 1, motions that begin and end at rest at the same position.

        Raises:
            ShapeError: when the motion does not fit the arm or the rate, or is not finite.
            RobotError: when a link is not physically consistent (each is named), or MuJoCo refuses the arm.
            ConfigError: when the settings do not fit the arm.
            InfeasibleError: when a joint does not follow.
        """
        self._check(motion)
        if len(motion.position) > 1:
            motion = concatenate(motion)
        reference = Motion(motion.time, *(x[0] for x in motion[1:]))
        position, velocity, torque = self._simulate(reference)
        self._check_tracking(reference, position, torque)
        return Executed(reference.time - reference.time[0], position, velocity, torque)

    def _simulate(self, reference: Motion) -> tuple[Array, Array, Array]:
        """True position, velocity and torque, (T, J) each.

        With implicit integration, damping acts on the velocity at the end of a step, so the torque over a
        step depends on the velocity after it; a drive at its limit when the step begins stays there.
        """
        from mujoco import MjData, rollout

        stiffness, damping = self.gains
        rigid = self.body.torque(*reference[1:]) + self._each("rotor_inertia") * reference.acceleration
        ahead = np.concatenate([reference.velocity[1:], reference.velocity[-1:]])
        feed = damping * ahead + self.settings.feed_forward * rigid
        target = reference.position + feed / stiffness
        # MuJoCo's state is time, positions and velocities
        start = np.concatenate([[0.0], reference.position[0], reference.velocity[0]])
        warm = np.zeros(self.model.nv)  # results must not depend on what was simulated before
        with mujoco_logged(self.arm.name):
            data = MjData(self.model)
            states, _ = rollout.rollout(self.model, data, start, target[None], initial_warmstart=warm)
        without_time = np.concatenate([start[None], states[0]])[:, 1:]
        position, velocity = np.split(without_time, 2, axis=1)
        spring = stiffness * (target - position[:-1])
        limit = self.arm.torque_limit
        demand = spring - damping * velocity[:-1]
        held = np.clip(demand, -limit, limit)
        torque = np.where(np.abs(demand) < limit, spring - damping * velocity[1:], held)
        return position[:-1], velocity[:-1], torque

    def _check(self, motion: Motion) -> None:
        joints = self.arm.joints
        rate = self.settings.rate
        count = len(motion.time)
        for name, x in zip(motion._fields[1:], motion[1:]):
            if x.ndim != 3 or x.shape[1:] != (count, joints) or not len(x) or count < 2:
                raise ShapeError(f"{name} is {x.shape}, expected (B, {count}, {joints}), two samples or more")
            if not np.isfinite(x).all():
                raise ShapeError(f"{name} of the motion is not finite")
        steps = np.diff(motion.time) * rate
        if not (np.abs(steps - 1) <= _OFF_GRID).all():
            given = f"{steps.min() / rate:.6g} to {steps.max() / rate:.6g} s"
            raise ShapeError(
                f"the motion's time steps are {given}, expected {1 / rate:g} s: the plant runs at {rate:g} Hz"
            )

    def _check_tracking(self, reference: Motion, position: Array, torque: Array) -> None:
        late = np.argwhere(~(np.abs(position - reference.position) <= self.settings.tolerance))
        if not len(late):
            return
        sample, joint = late[0].tolist()
        name, limit = self.arm.joint_names[joint], self.arm.torque_limit[joint]
        saturated = (np.abs(torque[: sample + 1, joint]) >= _AT_THE_LIMIT * limit).any()
        unit, force = ("m", "N") if self.arm.prismatic[joint] else ("rad", "N·m")
        hint = f"; its torque reached the limit of {limit:g} {force} before" if saturated else ""
        raise InfeasibleError(
            f"joint {name!r} does not follow: after {sample / self.settings.rate:.3f} s it is more than "
            f"{self.settings.tolerance:g} {unit} off its reference{hint}"
        )

    def _each(self, name: str) -> Array:
        return self.settings.of(name, self.arm.joints)


def largest_inertia(body: RigidBody) -> Array:
    """Largest diagonal element of the mass matrix over random postures, (J,)."""
    arm = body.arm
    random = np.random.default_rng(0)
    postures = random.uniform(arm.position_lower, arm.position_upper, (_POSTURES, 1, arm.joints))
    q = np.repeat(postures, arm.joints, axis=1)
    still = np.zeros_like(q)
    unit = np.broadcast_to(np.eye(arm.joints), q.shape)
    return np.linalg.diagonal(body.torque(q, still, unit) - body.torque(q, still, still)).max(0)
