"""Torque limits of the joints of a compiled MJCF, and what else acts on them."""

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
_ON_JOINTS = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_MOTORS = {  # gain, bias and dynamics of actuators whose control range bounds their force
    (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE), int(dynamics))
    for dynamics in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
}
_SMALL = 1e-9  # moment arm or torque that is rounding
Acting = Mapping[str, frozenset[str]]  # names of joints, by what acts on them in words


def name_of(model: mujoco.MjModel, kind: str, index: int) -> str:
    """Name of an object; its kind and number if it has none."""
    code = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    return mujoco.mj_id2name(model, code, index) or f"{kind}_{index}"


def not_read(model: mujoco.MjModel) -> tuple[Acting, Acting]:
    """Motors of limited force that are not on a joint, and passive forces, with the joints on which they act.

    Moment arms and forces are MuJoCo's at a random posture.
    """
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
    limited, passive = dict[str, Vector](), dict[str, Vector]()
    for i, kind in enumerate(model.actuator_trntype.tolist()):
        if kind not in _ON_JOINTS and np.isfinite(_forces(model, i)).any():
            tendon = kind == int(mujoco.mjtTrn.mjTRN_TENDON)
            on = f"tendon {name_of(model, 'tendon', int(model.actuator_trnid[i, 0]))}" if tendon else "sites"
            limited[f"actuator {name_of(model, 'actuator', i)} acts on {on}"] = motors[:, i]
    for t in np.flatnonzero(model.tendon_limited).tolist():
        passive[f"the range of tendon {name_of(model, 'tendon', t)}"] = tendons[:, t]
    passive["springs (stiffness)"] = data.qfrc_spring
    passive["damping other than the joints' linear one"] = data.qfrc_damper + model.dof_damping
    passive["drag of the medium (density, viscosity)"] = data.qfrc_fluid

    def joints(force: Vector) -> frozenset[str]:
        acted = model.dof_jntid[np.abs(force) > _SMALL].tolist()
        return frozenset(name_of(model, "joint", joint) for joint in acted)

    return {x: joints(arms) for x, arms in limited.items()}, {
        x: joints(force) for x, force in passive.items()
    }


def _forces(model: mujoco.MjModel, actuator: int) -> Vector:
    """Smallest and largest force of an actuator before its gear, (2,), from its force or control range.

    The control range bounds the force only of motors, whose force is a fixed multiple of the control.
    """
    found = np.array([-np.inf, np.inf])
    kinds = model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype
    if model.actuator_ctrllimited[actuator] and tuple(int(kind[actuator]) for kind in kinds) in _MOTORS:
        found = np.sort(model.actuator_gainprm[actuator, 0] * model.actuator_ctrlrange[actuator])
    if model.actuator_forcelimited[actuator]:
        found = np.clip(found, *model.actuator_forcerange[actuator])
    return found


def efforts(model: mujoco.MjModel) -> dict[int, float]:
    """Largest torque or force [N·m or N] available to each joint in both directions, if it is limited.

    Forces of a joint's actuators add up, and the joint's own range clips the sum.
    """
    ranges: dict[int, Vector] = {}
    for i in range(model.nu):
        if int(model.actuator_trntype[i]) in _ON_JOINTS:
            joint = int(model.actuator_trnid[i, 0])
            gear = model.actuator_gear[i, 0]
            force = np.sort(_forces(model, i) * gear) if gear else np.zeros(2)
            ranges[joint] = ranges.get(joint, np.zeros(2)) + force
    for joint in np.flatnonzero(model.jnt_actfrclimited).tolist():
        lower, upper = model.jnt_actfrcrange[joint]
        least, most = ranges.get(joint, (-np.inf, np.inf))
        ranges[joint] = np.array([max(lower, least), min(upper, most)])
    sides = {joint: np.abs(force) for joint, force in ranges.items()}
    largest = {joint: float(x.min() or x.max()) for joint, x in sides.items()}  # some push one way only
    return {joint: force for joint, force in largest.items() if np.isfinite(force)}
