"""Content of a page about moving arms, as plain values and packed arrays."""

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sidegan.base.arrays import Array, flatten
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.report.style import PALETTE
from sidegan.report.viewer.surfaces import arm_parts, region_surface
from sidegan.robot import Arm
from sidegan.validity import Constraints, Plane
from sidegan.validity.constraints import DISTANCES

_RATE, _FEWEST, _MOST = 25.0, 100, 500  # samples [Hz] of a motion, and how many at least and at most


@dataclass
class View:
    """A page's content: plain values, and arrays of four-byte numbers that go with them."""

    head: dict[str, Any]
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)

    def packed(self) -> tuple[dict[str, Any], str]:
        """The plain values with a list of the arrays, and these as text (deflated, base 64)."""
        chunks, table, offset = [], {}, 0
        for name, x in self.arrays.items():
            table[name] = [x.dtype.name, offset, int(x.size)]
            chunks.append(x.tobytes())
            offset += x.nbytes
        return {**self.head, "arrays": table}, base64.b64encode(zlib.compress(b"".join(chunks), 9)).decode()


def view_of(
    constraints: Constraints,
    family: Trajectory,
    coefficients: Array,
    titles: Sequence[str] = (),
    arm: Arm | None = None,
) -> View:
    """View of trajectories with coefficients [rad/s], (B, J, H, 2).

    Args:
        constraints: the arm in its workspace.
        family: of the trajectories.
        coefficients: theirs.
        titles: what to call each; their numbers when there are none.
        arm: whose limits signals are shares of; the arm in its workspace when nobody says another.

    Raises:
        ShapeError: when there is no trajectory, or another number of titles.
    """
    count = len(coefficients)
    if count == 0 or (titles and len(titles) != count):
        raise ShapeError(f"there are {count} trajectories to show and {len(titles)} titles")
    arm = arm or constraints.arm
    samples = int(min(max(family.period * _RATE, _FEWEST), _MOST))
    times = np.linspace(0.0, family.period, samples + 1)
    motion = family.roll_out(coefficients, times)
    head = {
        "name": arm.name,
        "joints": list(arm.joint_names),
        "prismatic": arm.prismatic.tolist(),
        "period": family.period,
        "samples": samples,
        "titles": list(titles) or [str(k + 1) for k in range(count)],
        "checked": constraints.described(),
        "colours": list(PALETTE),
        "chain": {
            "rotation": flatten(arm.rotation, 1).tolist(),  # row by row
            "translation": arm.translation.tolist(),
            "axis": arm.axis.tolist(),
            "tip": arm.tip.tolist(),
        },
    }
    view = View(head)
    _add_signals(view, arm, constraints, motion)
    _add_closest(view, constraints, motion)
    _add_surfaces(view, constraints)
    return view


def _add_signals(view: View, arm: Arm, constraints: Constraints, motion: Motion) -> None:
    """Position, velocity, acceleration and torque as shares of their limits, (B, T, J) each."""
    middle = (arm.position_upper + arm.position_lower) / 2
    signals = {
        "position": (motion.position - middle, (arm.position_upper - arm.position_lower) / 2),
        "velocity": (motion.velocity, arm.velocity_limit),
        "acceleration": (motion.acceleration, arm.acceleration_limit),
        "torque": (constraints.body.drive_torque(*motion[1:]), arm.torque_limit),
    }
    view.head["middle"] = middle.tolist()
    view.head["signals"] = {}
    for name, (values, limit) in signals.items():
        largest = np.maximum(np.abs(values).max((0, 1)), 1e-9)
        limited = np.isfinite(limit) if limit is not None else np.zeros_like(largest, dtype=bool)
        scale = largest if limit is None else np.where(limited, limit, largest)
        view.head["signals"][name] = {"scale": scale.tolist(), "limited": limited.tolist()}
        view.arrays[name] = (values / scale).astype(np.float32)


def _add_closest(view: View, constraints: Constraints, motion: Motion) -> None:
    """Which pair is closest, and its distance [m]."""
    batch, samples, joints = motion.position.shape
    names = [label for name in DISTANCES for label in constraints.labels.get(name, ())]
    distance, which = constraints.nearest(motion.position.reshape(-1, joints))
    view.head["pairs"] = []
    if not np.isfinite(distance).all():
        return
    used, which = np.unique(which, return_inverse=True)
    view.head["pairs"] = [names[k] for k in used.tolist()]
    view.arrays["pair"] = which.astype(np.uint32).reshape(batch, samples)
    view.arrays["distance"] = distance.astype(np.float32)


def _add_surfaces(view: View, constraints: Constraints) -> None:
    """The arm, its capsules, and what it must not touch."""
    looks, shapes = arm_parts(constraints.arm)
    regions = [region_surface(region) for region in constraints.regions]
    planes = [region for region in constraints.regions if isinstance(region, Plane)]
    view.head["planes"] = [{"normal": plane.unit, "offset": plane.offset} for plane in planes]
    obstacles = [part for part in regions if part is not None]
    for kind, parts in (("arm", looks), ("shapes", shapes), ("obstacles", obstacles)):
        view.head[kind] = [part.link for part in parts]
        for k, part in enumerate(parts):
            view.arrays[f"{kind}{k}v"] = part.vertices.astype(np.float32)
            view.arrays[f"{kind}{k}f"] = part.faces.astype(np.uint32)
