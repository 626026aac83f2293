"""Torque limits of the joints of an MJCF, and what else acts on them; all elements must have names."""

import mujoco
import numpy as np

from sidegan.base.arrays import Array

_ON_JOINTS = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT
_MOTORS = [  # gain, bias and dynamics of actuators whose control range bounds their force
    (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE, dynamics)
    for dynamics in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
]
_UNLIMITED = -np.inf, np.inf
_SMALL = 1e-9  # moment arm or torque that is rounding


class Forces:
    """What acts on which joints, by MuJoCo's moment arms and forces at a random posture.

    Attributes:
        tendons: names of the joints that each tendon moves, by the tendon's name.
        motors: the same for motors of limited force that are not on a joint, by words on the motor.
        passive: the same for other forces, which are not read, by words on the force.
    """

    def __init__(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
        names = {joint.id: joint.name for joint in spec.joints}

        def joints(force: Array) -> frozenset[str]:
            acted = model.dof_jntid[np.abs(force) > _SMALL].tolist()
            return frozenset(names[joint] for joint in acted)

        data = mujoco.MjData(model)
        data.qpos[:] = np.random.default_rng(0).uniform(-1, 1, model.nq)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        mujoco.mj_fwdPosition(model, data)
        tendons, motors = (np.zeros((model.nv, len(x))) for x in (data.ten_velocity, data.actuator_velocity))
        for dof in range(model.nv):  # moved alone, at unit speed
            data.qvel[:] = np.arange(model.nv) == dof
            mujoco.mj_fwdVelocity(model, data)
            tendons[dof], motors[dof] = data.ten_velocity, data.actuator_velocity
        data.qvel[:] = 1
        mujoco.mj_fwdVelocity(model, data)
        self.tendons = {tendon.name: joints(tendons[:, tendon.id]) for tendon in spec.tendons}
        self.motors = dict[str, frozenset[str]]()
        for motor in spec.actuators:
            if motor.trntype not in _ON_JOINTS and np.isfinite(_range(model, motor)).any():
                tendon = motor.trntype == mujoco.mjtTrn.mjTRN_TENDON
                on = f"tendon {motor.target}" if tendon else "sites"
                self.motors[f"actuator {motor.name} acts on {on}"] = joints(motors[:, motor.id])
        self.passive = {
            f"the range of tendon {tendon.name}": self.tendons[tendon.name]
            for tendon in spec.tendons
            if model.tendon_limited[tendon.id]
        }
        self.passive["springs (stiffness)"] = joints(data.qfrc_spring)
        self.passive["damping other than the joints' linear one"] = joints(
            data.qfrc_damper + model.dof_damping
        )
        self.passive["drag of the medium (density, viscosity)"] = joints(data.qfrc_fluid)


def efforts(spec: mujoco.MjSpec, model: mujoco.MjModel) -> dict[str, float]:
    """Largest torque or force [N·m or N] available to each joint in both directions, if it is limited.

    Forces of a joint's actuators add up, and the joint's own range clips the sum.
    """
    ranges: dict[str, Array] = {}
    for motor in spec.actuators:
        if motor.trntype in _ON_JOINTS:
            gear = motor.gear[0]
            force = np.sort(_range(model, motor) * gear) if gear else np.zeros(2)
            ranges[motor.target] = ranges.get(motor.target, 0.0) + force
    for joint in spec.joints:
        if model.jnt_actfrclimited[joint.id]:
            given = ranges.get(joint.name, _UNLIMITED)
            ranges[joint.name] = np.clip(given, *model.jnt_actfrcrange[joint.id])
    sides = {joint: np.abs(force) for joint, force in ranges.items()}
    largest = {joint: float(x.min() or x.max()) for joint, x in sides.items()}  # some push one way only
    return {joint: force for joint, force in largest.items() if np.isfinite(force)}


def _range(model: mujoco.MjModel, motor: mujoco.MjsActuator) -> Array:
    """Smallest and largest force of an actuator before its gear, (2,), from its force or control range.

    The control range bounds the force only of motors, whose force is a fixed multiple of the control.
    """
    found = np.array(_UNLIMITED)
    limits = model.actuator(motor.id)
    if limits.ctrllimited and (motor.gaintype, motor.biastype, motor.dyntype) in _MOTORS:
        found = np.sort(motor.gainprm[0] * limits.ctrlrange)
    if limits.forcelimited:
        found = np.clip(found, *limits.forcerange)
    return found
