"""Randomised plants that differ from their description, simulated in MuJoCo for many motions at once.

MuJoCo moves an arm whose links are heavier or lighter than described, servos feed forward the described
torques, and friction does not have an identified model's form. Torque is measured at the motor, or by a
sensor behind rotor and gear, as in an LWR.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.base.typed import Hertz, NonNegative, Positive, Share
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.kernels.friction import Law
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion
from sidegan.plant.execute import largest_inertia
from sidegan.plant.model import IDEAL, mujoco_model
from sidegan.robot import Arm
from sidegan.robot.write_mjcf import mujoco_logged

if TYPE_CHECKING:
    import mujoco

_STATES = 2_000  # random states from which the joints' torque scales are computed
RADII = np.array([0.125, 0.25, 0.5])  # of a sensor's stops, as shares of its range: an assumption
_STIFF = 1.5  # least steps in which friction near rest stops a rotor, for stable explicit integration


@dataclass(frozen=True, kw_only=True)
class FrictionSettings:
    """Magnitudes of friction and ripple, which identified models lack; zero switches a part off.

    The law differs in form from the smooth basis with which ``identification.residuals`` explains residuals.
    """

    # range of the Coulomb friction, as a share of the joint's torque
    coulomb: tuple[Share, Share] = (0.05, 0.2)
    # range of the viscous friction at top speed, relative to Coulomb friction
    viscous: tuple[NonNegative, NonNegative] = (0.3, 1.0)
    width: Positive = 0.03  # speed [rad/s] at which the smooth sign is at 76 %
    stribeck: NonNegative = 0.4  # extra friction near rest, relative to Coulomb friction
    load: NonNegative = 0.05  # friction per transmitted torque
    asymmetry: Share = 0.15  # half the difference between directions, relative to Coulomb friction
    position: Share = 0.15  # position-dependent friction, relative to Coulomb friction
    ripple: NonNegative = 0.01  # relative to the joint's torque


@dataclass(frozen=True, kw_only=True)
class VariedSettings:
    """Differences of a plant from its description; torques are relative to ``torque_scale``.

    Sensor errors are relative to the sensor's range, which is the joint's torque limit at the link.
    """

    rate: Hertz = 500.0  # of the servos and of the physics
    bandwidth: Hertz = 6.0  # of the servos
    tolerance: Positive = 0.5  # [rad] tracking error at which an execution has failed
    parameters: Share = 0.2  # largest relative difference of a link's inertial parameters
    tool: NonNegative = 1.0  # largest mass of an unknown tool [kg]
    rotor: Positive = 0.3  # rotor inertia relative to the joint's largest inertia
    floor: Share = 0.02  # least torque scale of a joint, relative to the largest
    friction: FrictionSettings = FrictionSettings()
    compliance: NonNegative = 2e-3  # wind-up of a joint at its torque [rad], seen by encoders at the motors
    backlash: NonNegative = 4e-4  # [rad], also seen by the encoders
    encoder: NonNegative = 2.4e-5  # resolution [rad]
    # place of the torque sensor: before friction and rotor, or behind those of motor and gear
    sensor: Literal["motor", "link"] = "link"
    # range of the Coulomb friction behind a sensor at the link, relative to its range
    bearings: tuple[Share, Share] = (0.003, 0.013)
    hysteresis: Share = 0.005  # half the width of the sensor's loop
    offset: Share = 0.008  # largest sensor offset
    resolution: NonNegative = 5e-4  # of measured torques
    delay: NonNegative = 2e-3  # of torques behind positions [s]


def torque_scale(body: RigidBody, floor: float) -> Array:
    """Root mean square rigid torque of each joint over random states, (J,), at least a share of the largest.

    Without that minimum, joints of very light links would hardly have any friction.
    """
    arm = body.arm
    random = np.random.default_rng(0)
    speed = arm.velocity_limit / 2
    most = arm.velocity_limit  # acceleration of a joint without a limit: to its top speed in a second
    size = (_STATES, arm.joints)
    if (limit := arm.acceleration_limit) is not None:
        most = np.where(np.isfinite(limit), limit, most)
    q = random.uniform(arm.position_lower, arm.position_upper, size)
    dq = random.uniform(-speed, speed, size)
    ddq = random.uniform(-most, most, size)
    rms = np.sqrt(np.square(body.torque(q, dq, ddq)).mean(0))
    return np.maximum(rms, floor * rms.max())


class VariedPlant:
    """A random plant.

    Attributes:
        true: the simulated arm.
        law: friction of motors and gears.
        bearings: friction behind the sensors.
        rotor: reflected rotor inertia [kg·m²], (J,).
        gains: of the servos, stiffness [N·m/rad] and damping [N·m·s/rad], (J,) each.
        range: of the torque sensors [N·m or N], (J,).
        offset: of the torque sensors [N·m or N], (J,).
    """

    def __init__(self, arm: Arm, settings: VariedSettings, seed: np.random.SeedSequence) -> None:
        self.arm, self.settings = arm, settings
        self.body = RigidBody(arm)
        self.scale = torque_scale(self.body, settings.floor)
        random = np.random.default_rng(seed)
        share = settings.parameters * random.uniform(-1, 1, (arm.joints, 1))
        own = arm.inertial_parameters * (1 + share)
        own[-1] += _tool(random, settings.tool)
        self.true = replace(arm, inertial_parameters=own)
        top = arm.velocity_limit
        self.law = _friction_of(settings.friction, self.scale, top, random)
        limit = np.where(np.isfinite(arm.torque_limit), arm.torque_limit, self.scale)
        self.range = limit if settings.sensor == "link" else self.scale
        behind = replace(settings.friction, coulomb=settings.bearings, load=0.0, ripple=0.0)
        self.bearings = _friction_of(behind, self.range, top, random)
        self.offset = settings.offset * self.range * random.uniform(-1, 1, arm.joints)
        largest = largest_inertia(self.body)
        steep = 1 + settings.friction.stribeck + settings.friction.asymmetry
        slope = sum(
            steep / settings.friction.width * x.coulomb + x.viscous for x in (self.law, self.bearings)
        )
        self.rotor = np.maximum(settings.rotor * largest, _STIFF * slope / settings.rate)
        speed = 2 * np.pi * settings.bandwidth
        self.gains = (largest + self.rotor) * speed**2, 2 * (largest + self.rotor) * speed

    @cached_property
    def model(self) -> "mujoco.MjModel":
        """MuJoCo model of links and rotors only, without contacts and limits."""
        from mujoco import mjtDisableBit, mjtIntegrator

        settings = replace(IDEAL, rate=self.settings.rate, rotor_inertia=self.rotor.tolist())
        model = mujoco_model(self.true, settings)
        model.opt.integrator = mjtIntegrator.mjINT_EULER
        for unused in ("CONSTRAINT", "LIMIT", "SENSOR", "EQUALITY", "FRICTIONLOSS", "ACTUATION", "WARMSTART"):
            model.opt.disableflags |= int(getattr(mjtDisableBit, f"mjDSBL_{unused}"))
        return model

    def follow(self, motion: Motion) -> tuple[Array, Array]:
        """Encoder positions and noise-free measured torques, (B, T, J), along B motions.

        Motions begin at rest; the controller feeds forward the described torques, without friction.

        Raises:
            ShapeError: when the motion is not at the plant's rate.
            RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
            InfeasibleError: when a joint does not follow.
        """
        if abs((motion.time[1] - motion.time[0]) * self.settings.rate - 1) > 1e-3:
            raise ShapeError(f"the motion is not at the plant's {self.settings.rate:g} Hz")
        ahead = self.body.torque(*motion[1:]) + self.rotor * motion.acceleration
        q, motor, load = self.simulate(motion.position, motion.velocity, ahead)
        late = np.abs(q - motion.position).max((0, 1)) if np.isfinite(q).all() else [np.inf]
        if max(late) > self.settings.tolerance:
            raise InfeasibleError(
                f"joints of a plant do not follow: they are up to {max(late):.3g} rad or m off"
            )
        share = load / self.scale  # encoders sit at the motors
        seen = q + self.settings.compliance * share + self.settings.backlash / 2 * np.tanh(20 * share)
        torque = load if self.settings.sensor == "link" else motor
        torque = self.offset + lagging(torque, self.range, self.settings.hysteresis)
        behind = 0, self.settings.delay * self.settings.rate, 0  # samples, in between linearly
        torque = scipy.ndimage.shift(torque, behind, order=1, mode="nearest")
        resolution = self.settings.resolution * self.range
        return _rounded(seen, self.settings.encoder), _rounded(torque, resolution)

    def simulate(self, q: Array, dq: Array, ahead: Array) -> tuple[Array, Array, Array]:
        """Positions, motor torques and torques behind the gears, (B, T, J), of servos along references."""
        from mujoco import MjData, mj_step

        from sidegan.kernels.servos import Servos, drive  # numba is slow to import

        servos = Servos(q, dq, ahead, *self.gains, self.arm.torque_limit)
        machines = [MjData(self.model) for _ in q]
        for machine, start, speed in zip(machines, q[:, 0], dq[:, 0]):
            machine.qpos[:], machine.qvel[:] = start, speed
        qpos = [machine.qpos for machine in machines]  # views that follow the state
        qvel = [machine.qvel for machine in machines]
        qacc = [machine.qacc for machine in machines]
        pushes = [machine.qfrc_applied for machine in machines]
        out = np.empty((3, *q.shape))
        torques = np.empty((3, *q[:, 0].shape))
        motor, driven, net = torques
        load = np.zeros_like(driven)
        with mujoco_logged(self.arm.name), np.errstate(all="ignore"):  # what does not follow is refused later
            for i in range(q.shape[1]):
                position = np.array(qpos)
                drive(i, servos, self.law, self.bearings, position, np.array(qvel), load, torques)
                for machine, applied, total in zip(machines, pushes, net):
                    applied[:] = total
                    mj_step(self.model, machine)
                load = driven - self.rotor * np.array(qacc)
                out[:, :, i] = position, motor, load
        return out[0], out[1], out[2]


def _friction_of(settings: FrictionSettings, scale: Array, top: Array, random: np.random.Generator) -> Law:
    """A random friction law for joints with these torque scales and top speeds, (J,) each."""
    joints = len(scale)
    coulomb = scale * random.uniform(*settings.coulomb, joints)
    viscous = coulomb / top * random.uniform(*settings.viscous, joints)
    speed = random.uniform(0.02, 0.08, joints) * top
    phases = random.uniform(0, 2 * np.pi, (3, joints))
    return Law(
        scale=scale,
        coulomb=coulomb,
        viscous=viscous,
        width=np.full(joints, settings.width),
        speed=speed,
        stribeck=settings.stribeck * coulomb,
        skew=settings.asymmetry * coulomb * random.uniform(-1, 1, joints),
        place=settings.position * coulomb,
        load=np.full(joints, settings.load),
        ripple=settings.ripple * scale,
        phases=phases,
    )


def lagging(load: Array, full: Array, share: float) -> Array:
    """Reading of a sensor of range ±``full``, (J,), for a load (B, T, J) that starts from zero, in its unit.

    A Prandtl–Ishlinskii operator: each of a few stops follows the load up to its radius, where it slips. Only
    the sequence of the load's reversals counts, and larger swings erase the memory of smaller ones. ``share``
    of the range is the largest error, half the width at zero of the loop over the whole range.

    Source: Brokate, Sprekels 1996, Hysteresis and Phase Transitions.
    """
    from sidegan.kernels.servos import slipped  # numba is slow to import

    held = np.zeros_like(load)
    slipped(load, RADII[:, None] * full, held)
    return load - share / RADII.sum() * held


def _tool(random: np.random.Generator, most: float) -> Array:
    """Inertial parameters about the last joint's frame, (10,), of a solid sphere of random mass and place."""
    mass = random.uniform(0, most)
    centre = random.uniform(-0.08, 0.08, 3)
    radius = 0.05
    about = 0.4 * mass * radius**2 * np.eye(3) + mass * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    return np.array([mass, *(mass * centre), *about[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def _rounded(x: Array, step: Array | float) -> Array:
    return np.round(x / step) * step if np.all(step) else x
