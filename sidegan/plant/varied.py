"""Randomised plants that differ from their description: many motions of one plant at once, in MuJoCo.

Nothing of our own dynamics is in the loop: MuJoCo moves an arm whose links are heavier or lighter than the
description says, the servos feed forward what the description says, and friction is not of a model's form.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy  # its parts are imported when they are used
import torch

from sidegan.base.typed import Hertz, NonNegative, Positive, Share
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion
from sidegan.plant.execute import Plant
from sidegan.plant.friction import Array, FrictionSettings, Law
from sidegan.plant.model import mujoco_model
from sidegan.plant.settings import IDEAL
from sidegan.robot import Arm
from sidegan.robot.mujoco_log import mujoco_logged

if TYPE_CHECKING:
    import mujoco

_STATES = 2_000  # random ones, for the scale of the joints' torques
_STIFF = 1.5  # steps that friction near rest takes at least to stop a rotor: an explicit step stays stable


@dataclass(frozen=True, kw_only=True)
class VariedSettings:
    """Differences of a plant from its description; shares of torque are of ``torque_scale``."""

    rate: Hertz = 500.0  # of the servos and of the physics
    bandwidth: Hertz = 6.0  # of the servos
    tolerance: Positive = 0.5  # [rad] off the reference at which an execution has failed
    parameters: Share = 0.2  # by which inertial parameters of a link differ from the description
    tool: NonNegative = 1.0  # largest mass of an unknown tool [kg]
    rotor: Positive = 0.3  # inertia of a rotor, of the joint's largest inertia
    floor: Share = 0.02  # of the largest joint's torque, that a small joint's counts as at least
    friction: FrictionSettings = FrictionSettings()
    compliance: NonNegative = 2e-3  # wind-up of a joint at its torque [rad], which encoders at the motors see
    backlash: NonNegative = 4e-4  # [rad], which they see too
    encoder: NonNegative = 2.4e-5  # resolution [rad]
    resolution: NonNegative = 2e-3  # of measured torques, as a share
    delay: NonNegative = 2e-3  # of torques behind positions [s]


def torque_scale(body: RigidBody, floor: float, seed: int = 0) -> Array:
    """Root mean square rigid torque of each joint over random states, (J,), not below a share of the largest.

    Joints whose links hardly weigh anything would otherwise have no friction to speak of.
    """
    arm, random = body.arm, torch.Generator().manual_seed(seed)
    draw = torch.rand(3, _STATES, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw[0])
    dq = arm.velocity_limit * (2 * draw[1] - 1) / 2
    most, limit = arm.velocity_limit, arm.acceleration_limit
    if limit is not None:  # infinite for a joint without one
        most = torch.where(limit.isfinite(), limit, most)
    rms = body.torque(q, dq, most * (2 * draw[2] - 1)).square().mean(0).sqrt()
    return rms.clamp_min(floor * float(rms.max())).numpy()


class VariedPlant:
    """One plant, drawn from a seed."""

    def __init__(self, arm: Arm, settings: VariedSettings, seed: np.random.SeedSequence) -> None:
        self.arm, self.settings = arm, settings
        self.body = RigidBody(arm)
        self.scale = torque_scale(self.body, settings.floor)
        random = np.random.default_rng(seed)
        share = settings.parameters * random.uniform(-1, 1, (arm.joints, 1))
        own = arm.inertial_parameters * torch.from_numpy(1 + share)
        own[-1] += torch.from_numpy(_tool(random, settings.tool))
        self.true = replace(arm, inertial_parameters=own)
        top = arm.velocity_limit.numpy()
        self.law = Law.drawn(settings.friction, self.scale, top, random)
        largest = Plant(arm, IDEAL).largest_inertia().numpy()
        steep = (1 + settings.friction.stribeck + settings.friction.asymmetry) * self.law.coulomb
        slope = steep / settings.friction.width + self.law.viscous
        self.rotor = np.maximum(settings.rotor * largest, _STIFF * slope / settings.rate)
        speed = 2 * np.pi * settings.bandwidth
        self._gains = (largest + self.rotor) * speed**2, 2 * (largest + self.rotor) * speed

    @cached_property
    def model(self) -> "mujoco.MjModel":
        """MuJoCo's model: links and rotors alone, no contacts and no limits."""
        from mujoco import mjtDisableBit, mjtIntegrator

        settings = replace(IDEAL, rate=self.settings.rate, rotor_inertia=self.rotor.tolist())
        model = mujoco_model(self.true, settings)
        model.opt.integrator = mjtIntegrator.mjINT_EULER
        for unused in ("CONSTRAINT", "LIMIT", "SENSOR", "EQUALITY", "FRICTIONLOSS", "ACTUATION", "WARMSTART"):
            model.opt.disableflags |= int(getattr(mjtDisableBit, f"mjDSBL_{unused}"))
        return model

    def follow(self, motion: Motion) -> tuple[Array, Array]:
        """Positions as the encoders see them and motor torques without noise, (B, T, J), along B motions.

        Each begins at rest; the controller feeds forward the description's torques, without friction.

        Raises:
            ShapeError: when the motion is not at the plant's rate.
            RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
            InfeasibleError: when a joint does not follow.
        """
        if abs(float(motion.time[1] - motion.time[0]) * self.settings.rate - 1) > 1e-3:
            raise ShapeError(f"the motion is not at the plant's {self.settings.rate:g} Hz")
        ahead = self.body.torque(*motion[1:]).numpy() + self.rotor * motion.acceleration.numpy()
        q, torque, friction = self._simulate(motion.position.numpy(), motion.velocity.numpy(), ahead)
        late = np.abs(q - motion.position.numpy()).max((0, 1)) if np.isfinite(q).all() else [np.inf]
        if max(late) > self.settings.tolerance:
            raise InfeasibleError(f"joints of a plant do not follow: they are up to {max(late):.3g} rad off")
        return self._sensed(q, torque, friction)

    def _simulate(self, q: Array, dq: Array, ahead: Array) -> tuple[Array, Array, Array]:
        """Positions, motor torques and friction, (B, T, J), of servos along references (B, T, J)."""
        from mujoco import MjData, mj_step

        (stiffness, damping), limit = self._gains, self.arm.torque_limit.numpy()
        machines = [MjData(self.model) for _ in q]
        for machine, start, speed in zip(machines, q[:, 0], dq[:, 0]):
            machine.qpos[:], machine.qvel[:] = start, speed
        qpos, qvel = [machine.qpos for machine in machines], [machine.qvel for machine in machines]
        pushes = [machine.qfrc_applied for machine in machines]
        out = np.empty((3, *q.shape))
        push, before = np.zeros_like(q[:, 0]), dq[:, 0]
        with mujoco_logged(self.arm.name), np.errstate(all="ignore"):  # what does not follow is refused later
            for i in range(q.shape[1]):
                position, velocity = np.array(qpos), np.array(qvel)
                servo = stiffness * (q[:, i] - position) + damping * (dq[:, i] - velocity)
                motor = np.minimum(np.maximum(ahead[:, i] + servo, -limit), limit)
                load = push - self.rotor * (velocity - before) * self.settings.rate
                friction = self.law(position, velocity, load)
                out[:, :, i] = position, motor, friction
                push, before = motor - friction, velocity
                for machine, applied, one in zip(machines, pushes, push):
                    applied[:] = one
                    mj_step(self.model, machine)
        return out[0], out[1], out[2]

    def _sensed(self, q: Array, torque: Array, friction: Array) -> tuple[Array, Array]:
        """Positions of encoders at the motors, and torques of sensors."""
        acceleration = np.gradient(np.gradient(q, axis=1), axis=1) * self.settings.rate**2
        load = (torque - friction - self.rotor * acceleration) / self.scale
        seen = q + self.settings.compliance * load + self.settings.backlash / 2 * np.tanh(20 * load)
        seen = _rounded(seen, self.settings.encoder)
        late = 0, self.settings.delay * self.settings.rate, 0  # samples, in between linearly
        torque = scipy.ndimage.shift(torque, late, order=1, mode="nearest")
        return seen, _rounded(torque, self.settings.resolution * self.scale)


def _tool(random: np.random.Generator, most: float) -> Array:
    """Inertial parameters about the last joint's frame, (10,), of a solid sphere of random mass and place."""
    mass, centre, radius = random.uniform(0, most), random.uniform(-0.08, 0.08, 3), 0.05
    about = 0.4 * mass * radius**2 * np.eye(3) + mass * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    return np.array([mass, *(mass * centre), *about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def _rounded(x: Array, step: Array | float) -> Array:
    return np.round(x / step) * step if np.all(step) else x
