"""The identified arm as a function: joint torques from joint motion, by Pinocchio.

This file stands on its own: copy it with the MJCF and parameters.json that lie beside it. It needs NumPy and
Pinocchio (``pip install pin``), and sidegan no longer.

    from model import ArmDynamics
    torque = ArmDynamics().torque(q, dq, ddq)
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

Vector = np.ndarray[Any, np.dtype[np.floating[Any]]]


class ArmDynamics:
    """Inverse dynamics of the identified arm; J joints in the order of ``joints``, SI units.

    Args:
        folder: where the MJCF and parameters.json are; this file's own when None.

    Attributes:
        joints: names of the joints, from the base outwards.
        model: Pinocchio's model of the links, with the rotors' inertia as armature.
        method: by which the model was identified: "consistent" for links that can exist; those of another
            have the right torques only together.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        import pinocchio

        folder = Path(__file__).parent if folder is None else Path(folder)
        numbers = json.loads((folder / "parameters.json").read_text(encoding="utf-8"))
        self.joints: list[str] = numbers["joints"]
        self.model: Any = pinocchio.buildModelFromMJCF(str(folder / numbers["mjcf"]))
        self.model.gravity.linear = np.array(numbers["gravity"])  # which Pinocchio does not read from an MJCF
        use = numbers["use"]
        self.method: str = use["method"]
        self._terms = {name: np.array(values) for name, values in use["terms"].items()}
        for joint, link in enumerate(use["inertial_parameters"], start=1):
            self.model.inertias[joint] = pinocchio.Inertia.FromDynamicParameters(np.array(link))
        self.model.armature = self._terms.get("rotor_inertia", np.zeros(len(self.joints)))
        self._pinocchio = pinocchio
        self._data = self.model.createData()
        self._sign_width = float(numbers["sign_width"])
        self._effects: dict[str, float] = use["effects"]
        self._usual = np.array(numbers["usual_load"] or 1.0)

    def torque(self, q: Vector, dq: Vector, ddq: Vector) -> Vector:
        """Torque [N·m or N], (…, J), at positions [rad or m], velocities and accelerations, (…, J) each."""
        states = self._checked(q, dq, ddq)
        rows = zip(*(x.reshape(-1, len(self.joints)) for x in states))
        rigid = [self._pinocchio.rnea(self.model, self._data, *row).copy() for row in rows]
        moved = np.reshape(rigid, states[0].shape)
        return moved + self.friction(states[0], states[1], moved)

    def friction(self, q: Vector, dq: Vector, rigid: Vector) -> Vector:
        """Friction, offset and other effects on single joints [N·m or N], (…, J).

        At positions, velocities, and torques of rigid bodies and rotors, (…, J) each.
        """
        q, dq, rigid = self._checked(q, dq, rigid)
        still = np.zeros(len(self.joints))
        viscous, coulomb, offset = (self._terms.get(name, still) for name in ("viscous", "coulomb", "offset"))
        sign = np.tanh(dq / self._sign_width)
        torque = viscous * dq + coulomb * sign + offset
        waves = zip("kkkkwwww", "abcd" * 2, (2, 2, 8, 8, 20, 20, 100, 100), (np.sin, np.cos) * 4)
        forms = {
            "sa": sign * np.exp(-np.square(dq / 0.1)),
            "sb": sign * np.exp(-np.abs(dq) / 0.3),
            "fl": sign * np.abs(rigid) / self._usual,
            "fr": sign * np.sqrt(np.hypot(dq, 0.01)),
            "fd": np.abs(dq),
            "pa": sign * np.sin(2 * q),
            "pb": sign * np.cos(2 * q),
            **{kind + letter: wave(n * q) for kind, letter, n, wave in waves},
        }
        for name, value in self._effects.items():
            joint = int(name[2:]) - 1
            torque[..., joint] += value * forms[name[:2]][..., joint]
        return torque

    def gravity(self, q: Vector) -> Vector:
        """Torque [N·m or N], (J,), that holds the arm still at positions (J,), without friction."""
        (q,), still = self._checked(q, single=True), np.zeros(len(self.joints))
        return self._pinocchio.rnea(self.model, self._data, q, still, still)

    def mass_matrix(self, q: Vector) -> Vector:
        """Joint-space inertia with rotors [kg·m² or kg], (J, J), at positions (J,)."""
        (q,), rnea, still = self._checked(q, single=True), self._pinocchio.rnea, np.zeros(len(self.joints))
        # By rows, since Pinocchio's crba adds up links, whose masses may be negative here.
        rows = [rnea(self.model, self._data, q, still, unit).copy() for unit in np.eye(len(q))]
        return np.array(rows) - self.gravity(q)

    def _checked(self, *given: Vector, single: bool = False) -> list[Vector]:
        """Arrays of floats, (…, J) each, or (J,) of a single state; a ValueError for any other shape."""
        arrays = [np.asarray(x, dtype=float) for x in given]
        before = () if single else arrays[0].shape[:-1]
        if any(x.shape != (*before, len(self.joints)) for x in arrays):
            shapes = ", ".join(str(x.shape) for x in arrays)
            rows = "" if single else "…, "
            raise ValueError(f"states are {shapes}, expected ({rows}{len(self.joints)}) each")
        return arrays

    def predict(self, frame: Any) -> Any:
        """Table of torques ``tau_<joint>`` [N·m or N] of one with a row per state, as MLflow calls it.

        Its columns are ``q_<joint>``, ``dq_<joint>`` and ``ddq_<joint>``.
        """
        columns = [[f"{letter}_{name}" for name in self.joints] for letter in ("q", "dq", "ddq")]
        states = [frame[names].to_numpy(float) for names in columns]
        torques = self.torque(*states)
        return type(frame)(torques, index=frame.index, columns=[f"tau_{name}" for name in self.joints])


def _load_pyfunc(folder: str) -> ArmDynamics:
    """The model for ``mlflow.pyfunc.load_model``, which finds it by the file MLmodel beside this one."""
    return ArmDynamics(Path(folder))
