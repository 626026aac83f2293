"""The command ``python benchmarks/with_figaroh.py``: trajectories by FIGAROH's optimiser, as waypoints.

They contend in the study of motions (``conf/worth``). FIGAROH needs an environment of its own, since it is
no dependency of sidegan: ``pip install figaroh cyipopt`` (1.0.2 and 1.7.0 were used), with a library of
IPOPT that cyipopt can be built against, such as that in casadi's wheel. This file imports nothing of sidegan,
so that it runs there.

Under the same limits as other contenders: those of position, velocity and torque of the description, the desk
as a box, and distances between links. FIGAROH knows no limit of acceleration. What it is given: an initial
guess that violates nothing (its own is drawn over all positions, which the desk never allows), and bounds
that lead the last waypoint of the last segment back to where the first began.
"""

import argparse
import json
import logging
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from figaroh.optimal import BaseOptimalTrajectory
from figaroh.optimal.base_optimal_trajectory import BaseTrajectoryIPOPTProblem
from figaroh.optimal.contraints import TrajectoryConstraintManager
from figaroh.tools.robot import Robot
from figaroh.utils.cubic_spline import CubicSpline, calc_torque

_WAYPOINTS, _SEGMENT, _SEGMENTS = 5, 2.0, 2  # FIGAROH's defaults: 2 times 4 moves of 2 s
_RATE = 20  # Hz at which it looks; its default of 100 takes five times as long
_ATTEMPTS = 3  # at a segment, whose search may end where a limit is violated
_MOST = 5  # times as many attempts as trajectories
_SHRINK, _TRIES = 0.97, 4000  # of guesses that violate something
_MARGIN, _SCREEN = 0.01, 0.03  # [m]
_DESK = 4.0  # [m] edge of the box that is the desk

Array = np.ndarray


class _Problem(BaseTrajectoryIPOPTProblem):
    """The last segment ends where the first began."""

    goal: Array | None = None

    def get_variable_bounds(self) -> tuple[list[float], list[float]]:
        lower, upper = super().get_variable_bounds()
        if self.goal is not None:
            lower[-self.n_joints :] = upper[-self.n_joints :] = self.goal.tolist()
        return lower, upper


class Optimiser(BaseOptimalTrajectory):
    """FIGAROH's optimiser with a guess of ours."""

    goal: Array | None = None

    def create_ipopt_problem(self, *arguments: Any) -> _Problem:
        """The problem of a segment."""
        problem = _Problem(self, *arguments)
        problem.goal = self.goal
        return problem

    def begin(self, dropped: Any, kept: Any) -> None:
        """``initialize`` with columns of the regressor that are known already."""
        self.base_computer = None
        count, limit = self.trajectory_config["n_wps"], self.trajectory_config["soft_lim"]
        self.CB = CubicSpline(self.robot, count, self.active_joints, limit)
        self.constraint_manager = TrajectoryConstraintManager(
            self.robot, self.CB, self.trajectory_config, self.identif_config
        )
        self.idx_e, self.idx_b = dropped, kept

    def _generate_feasible_initial_guess(self, start: Array, *rest: Any) -> Any:
        """Random waypoints around the start, closer to it until nothing is violated."""
        count, joints = self.trajectory_config["n_wps"], len(start)
        times = np.matrix(self.trajectory_config["t_s"] * np.arange(count)).T
        still = np.zeros((joints, count))
        for _ in range(_TRIES // 100):
            way = np.random.uniform(-1, 1, (count, joints)) * (self.CB.upper_q - self.CB.lower_q) / 2
            way[0] = 0
            for _ in range(100):
                points = (start + way).clip(self.CB.lower_q, self.CB.upper_q)
                if self.goal is not None:
                    points[-1] = self.goal
                states = self.CB.get_full_config(
                    self.trajectory_config["freq"], times, points.T, still, still
                )
                if self._clear(times, points.T, still, states):
                    return points.T, still, still, times, *states
                way = way * _SHRINK
        raise RuntimeError("no guess was found that violates nothing")

    def _clear(self, times: Any, points: Array, still: Array, states: Any) -> bool:
        _, q, dq, ddq = states
        torque = calc_torque(len(q), self.robot, q, dq, ddq).reshape(dq.shape[1], len(q)).T
        if self.CB.check_cfg_constraints(q, dq, torque, self.trajectory_config["soft_lim"]):
            return False
        return self.constraint_manager.trajectory_clear(times, points, still, still)

    def closed(self, home: Array, segments: int) -> list[Array]:
        """Waypoints (K, J) of a trajectory from home to home.

        Raises:
            RuntimeError: when a segment fails.
        """
        start, stack, found = home, None, [home]
        for number in range(segments):
            self.goal = home if number == segments - 1 else None
            still = np.zeros(len(start))
            if not self._solve_segment(number, start, still, still, stack):
                raise RuntimeError(f"segment {number + 1} failed")
            rows = round(self.trajectory_config["t_s"] * self.trajectory_config["freq"])
            found += list(self.results["P_F"][-1][rows::rows, self.CB.act_idxq])
            if number < segments - 1:
                start, stack = self._prepare_next_segment()
        return found


def robot_of(urdf: Path, folder: Path, floor: float | None) -> Robot:
    """The arm, without shapes that are missing, above a desk of some height [m]."""
    text = urdf.read_text(encoding="utf-8")
    if "package://" in text:
        text = re.sub(r"<(collision|visual)\b.*?</\1>", "", text, flags=re.DOTALL)
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    robot = Robot(str(path), package_dirs=str(urdf.parent))
    if floor is not None:
        import coal
        import pinocchio as pin

        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, floor - _DESK / 2]))
        desk = pin.GeometryObject("desk", 0, 0, place, coal.Box(_DESK, _DESK, _DESK))
        robot.geom_model.addGeometryObject(desk)
        robot.collision_model = robot.geom_model
        _pair(robot, pin)
    return robot


def _pair(robot: Robot, pin: Any) -> None:
    """Pairs of shapes that move apart: not of neighbours, and none that is close at home already."""
    model, shapes = robot.model, robot.geom_model
    for a, one in enumerate(shapes.geometryObjects):
        for b, other in list(enumerate(shapes.geometryObjects))[a + 1 :]:
            first, second = sorted((one.parentJoint, other.parentJoint))
            if second - first > 1:
                shapes.addCollisionPair(pin.CollisionPair(a, b))
    data = shapes.createData()
    pin.computeDistances(model, model.createData(), shapes, data, robot.q0)
    pairs = [shapes.collisionPairs[k] for k in range(len(shapes.collisionPairs))]
    for pair, found in zip(pairs, data.distanceResults):
        if found.min_distance < 2 * _MARGIN:
            shapes.removeCollisionPair(pair)


def config_of(robot: Robot, iterations: int) -> dict[str, Any]:
    """FIGAROH's configuration."""
    names, identified = list(robot.model.names)[1:], list(range(robot.model.nv))
    parameters = {
        "has_friction": True, "has_actuator_inertia": True, "has_joint_offset": True,
        "is_joint_torques": True, "act_idxv": identified, "act_idxq": identified,
    }  # fmt: skip
    return {
        "robot": {"name": robot.model.name, "properties": {"joints": {"active_joints": names}}},
        "tasks": {
            "identification": {
                "type": "identification",
                "enabled": True,
                "parameters": parameters,
                "problem": parameters,
                "signal_processing": {"sampling_frequency": 1.0 * _RATE, "cutoff_frequency": _RATE / 4},
            },
            "optimal_trajectory": {
                "type": "optimal_trajectory",
                "enabled": True,
                "trajectory": {
                    "waypoints": _WAYPOINTS,
                    "frequency": _RATE,
                    "segment_duration": _SEGMENT,
                },
                "problem": {
                    "soft_lim": 0.01,
                    "max_iterations": iterations,
                    "segment_attempts": _ATTEMPTS,
                    "collision_margin": _MARGIN,
                    "collision_screen": _SCREEN,
                    "collision_check_frequency": 1.0 * _RATE,
                },
            },
        },
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Write waypoints and CPU times; exit code of the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("urdf", type=Path)
    parser.add_argument("file", type=Path, help="that is written")
    parser.add_argument("--home", type=float, nargs="+", help="joint positions; default: zeros")
    parser.add_argument("--floor", type=float, help="height of a desk [m]; default: none")
    parser.add_argument("--count", type=int, default=5, help="trajectories (default 5)")
    parser.add_argument("--iterations", type=int, default=30, help="of IPOPT for each segment (default 30)")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.ERROR)
    made: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        robot = robot_of(options.urdf, folder, options.floor)
        config = folder / "config.yaml"
        config.write_text(yaml.safe_dump(config_of(robot, options.iterations)), encoding="utf-8")
        base: tuple[Any, Any] | None = None
        home = np.array(options.home or np.zeros(robot.model.nq))
        began, seed = time.process_time(), -1
        while len(made) < options.count and (seed := seed + 1) < _MOST * options.count:
            np.random.seed(seed)
            optimiser = Optimiser(robot, list(robot.model.names)[1:], str(config))
            optimiser.identif_config["act_idxv"] = list(range(robot.model.nv))
            optimiser.identif_config["act_idxq"] = list(range(robot.model.nq))
            if base is None:
                optimiser.initialize()
                base = optimiser.idx_e, optimiser.idx_b
            else:  # the same for all
                optimiser.begin(*base)
            try:
                points = optimiser.closed(home, _SEGMENTS)
            except RuntimeError as error:  # what it took counts with the next one
                sys.stderr.write(f"{seed}: {error}\n")
                continue
            took = time.process_time() - began
            began = time.process_time()
            made.append({"seconds": round(took, 3), "waypoints": np.round(points, 6).tolist()})
            last = optimiser.results["iteration_data"][-1]
            sys.stderr.write(f"{seed}: {took:.0f} s, condition {last['obj_values'][-1]:.4g}\n")
            text = json.dumps({"step": _SEGMENT, "trajectories": made}, indent=1)
            options.file.write_text(text + "\n", encoding="utf-8")
    return 0 if len(made) == options.count else 1


if __name__ == "__main__":
    sys.exit(main())
