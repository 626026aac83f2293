"""Chains of many joints: how long a first step with one takes, in how much memory, or that it is refused."""

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from sidegan.design.excitation import excite
from sidegan.errors import RobotError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, check

COUNTS, FEW = (20, 30, 60), (8, 60)  # joints
REFUSED = "refused"
_TRAJECTORIES = 10
_LINK = """<link name="l{k}"><inertial><mass value="{mass}"/><origin xyz="0.01 0 0.05"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.008"/></inertial>
<collision><origin xyz="0 0 0.05"/><geometry><sphere radius="0.03"/></geometry></collision></link>
<joint name="j{k}" type="revolute"><parent link="l{before}"/><child link="l{k}"/>
<origin xyz="0 0.01 0.1"/><axis xyz="{axis}"/>
<limit lower="-1" upper="1" velocity="1" effort="500"/></joint>"""
_AXES = ("0 0 1", "0 1 0", "1 0 0")


def chain(joints: int) -> str:
    """A description of so many revolute joints in a row."""
    links = (
        _LINK.format(k=k, before=k - 1, mass=1 + 1 / k, axis=_AXES[k % len(_AXES)])
        for k in range(1, joints + 1)
    )
    return f'<robot name="chain{joints}"><link name="l0"/>{"".join(links)}</robot>'


def first_step(joints: int) -> tuple[str, float, float]:
    """What came of base parameters, checks and excitation of some trajectories; seconds, and memory [GB]."""
    torch.set_num_threads(1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.monotonic()
    with TemporaryDirectory() as folder:
        path = Path(folder, "chain.urdf")
        path.write_text(chain(joints), encoding="utf-8")
        try:
            words = _step(path, joints)
        except RobotError as error:
            words = f"{REFUSED}: {str(error).partition(' has ')[2]}"
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e6
    return words, time.monotonic() - began, memory


def _step(path: Path, joints: int) -> str:
    arm = load_robot(path)
    constraints, trajectory = Constraints(arm), Trajectory(joints)
    random = torch.Generator().manual_seed(0)
    c = 0.01 * torch.randn(_TRAJECTORIES, *trajectory.shape, generator=random, dtype=torch.float64)
    excite(constraints.body, trajectory, c)
    valid = int(check(constraints, trajectory, c).valid.sum())
    return f"{len(constraints.body.base.values)} base parameters, {valid} of {len(c)} valid"


def measured(counts: tuple[int, ...]) -> dict[int, tuple[str, float, float]]:
    """The same for each number of joints, in a process of its own each."""
    with ProcessPoolExecutor(1, get_context("forkserver"), max_tasks_per_child=1) as pool:
        return dict(zip(counts, pool.map(first_step, counts)))
