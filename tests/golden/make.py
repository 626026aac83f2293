"""Numbers of fixed inputs, of functions and of stages.

`python -m tests.golden.make` makes them anew, which is a decision, not a repair. Every machine starts from
the same inputs: PCG64's own bits, which no version of numpy changes, over powers of two, and what is stored.
Arms are chains that were drawn once, two with the axes of a UR10 and a Panda; their shapes are capsules,
which nothing has to fit.
"""

import json
import math
import os
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import torch

from sidegan.base.arrays import Array, flatten
from sidegan.base.typed import build
from sidegan.design.excitation import excitation_of, information_of
from sidegan.design.objective import Goal, Objective, Penalty
from sidegan.design.problem import Problem
from sidegan.design.selection import a_optimal, d_optimal, greedy
from sidegan.gan.reward import DirectionEnergies
from sidegan.identification import FULL, RIGID, EstimationSettings, Measurements, Terms, TorqueModel, estimate
from sidegan.identification.workflow import identify_arm
from sidegan.library import Library
from sidegan.library.measure import library_of
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import EXPECTED, FACTS, RESULTS, RunContext
from sidegan.pipeline.stages.baselines import random_set
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.replication import compared_sets, regression_sums, replication
from sidegan.pipeline.stages.selection import ExcitationSet
from sidegan.pipeline.store import Store
from sidegan.plant import IDEAL, Plant
from sidegan.recording.checked import hold_out
from sidegan.recording.read import read_and_check
from sidegan.recording.settings import RecordingSettings
from sidegan.report.identification.results import verdict
from sidegan.robot import load_robot
from sidegan.validity import Box, Constraints, Plane, Sphere, check, default_home
from tests.tiny import tiny

FOLDER = Path(__file__).parent
STAGES = FOLDER / "stages.json"
NUMBERS, IDENTIFIED, MADE = FOLDER / "numbers.npz", FOLDER / "identified.json", FOLDER / "recording.csv"
DATA = Path(os.environ.get("SIDEGAN_DATA", Path(__file__).parents[3] / "shared" / "data"))
CHAINS = tuple(f"chain{seed}" for seed in range(1, 11))
ARMS = (*CHAINS, "ur10_like", "panda_like", "kuka_lwr4")
JUDGED = dict.fromkeys(CHAINS, (900, 100)) | {"kuka_lwr4": (9_000, 1_000)}  # random, and near the boundary
REGIONS = (Plane((0, 0, 1), -0.3), Box((0.4, -0.3, 0.2), (0.8, 0.3, 0.5)), Sphere((-0.5, 0.5, 0.4), 0.2))
WORDS = ("use", "verdict", "weak_parameters")  # of a verdict that are no sentences
GAINS = [14.87, 13.26, 11.13, 10.62, 11.03, 11.47]  # [N·m/A] of the UR10e
UR10E = ("ur10e/reference.urdf", {"cutoff": 5, "delay": None}, FULL, GAINS)
# Arm, settings of recordings and model, gains; what is trained on, and held out instead of its last part.
RECORDED = {
    "ur10e_first": (*UR10E, "ur10e/recorded_20s8h.csv", "ur10e/recorded_20s10h.csv"),
    "ur10e_second": (*UR10E, "ur10e/recorded_20s10h.csv", "ur10e/recorded_20s8h.csv"),
    "lwr4": ("kuka_lwr4", {"cutoff": 2}, Terms(), None, "kuka_lwr4/recorded_hw1_50hz.csv", None),
    "made": (str(FOLDER / "arms" / "ur10_like.urdf"), {}, Terms(), None, MADE, None),
}


def draw(seed: int, *shape: int) -> np.ndarray:
    """Numbers from −1 to 1 in steps of 1/512."""
    bits = np.random.PCG64(seed).random_raw(math.prod(shape)) >> np.uint64(54)
    return (bits.astype(np.int64).reshape(shape) - 512) / 512


@cache
def constraints_of(name: str) -> Constraints:
    """An arm among regions."""
    path = FOLDER / "arms" / f"{name}.urdf"
    return Constraints(load_robot(path if path.exists() else name), REGIONS, clearance=0.01)


def problem_of(name: str, home: np.ndarray) -> Problem:
    """Trajectories of an arm from a home."""
    return Problem(constraints_of(name), Trajectory(len(home), 4, 8.0, home.tolist()), 40)


def trajectories(seed: int, gain: np.ndarray, count: int, scales: np.ndarray | None = None) -> Array:
    """Coefficients (count, J, 4, 2) of joints with gains [rad/s], of random sizes unless scales are given."""
    u = draw(seed, count, len(gain) * 8 + 1)
    size = 1 + u[:, 0] if scales is None else scales.astype(float)
    c = u[:, 1:].reshape(count, -1, 4, 2) * gain[:, None, None].astype(float)
    return c * size[:, None, None, None]


def candidates(name: str, own: dict[str, np.ndarray]) -> Array:
    """An arm's trajectories to judge: random ones, then those near the boundary."""
    (count, near), gain = JUDGED[name], own["gain"]
    return np.concatenate([trajectories(10, gain, count), trajectories(11, gain, near, own["scales"])])


def numbers(problem: Problem, c: Array) -> dict[str, np.ndarray]:
    """Gram, slopes, sums and margins of a few trajectories."""
    body, trajectory = problem.body, problem.trajectory
    grams, sides = problem.gram(c), draw(1, body.parameters_count + 1, 3)
    found = {"gram": grams @ sides[1:], "spectrum": excitation_of(body, grams).spectrum}
    for kind, penalty in (("plain", None), ("penalised", Penalty(1e2))):
        found[f"{kind}_value"], found[f"{kind}_slopes"] = _slopes(problem, c, penalty)
    x = torch.from_numpy(c).clone().requires_grad_(True)
    goal = _volume(problem, x)
    found["goal"], found["goal_slopes"] = goal.detach().numpy(), torch.autograd.grad(goal, x)[0]
    states = [part.reshape(-1, part.shape[-1]) for part in trajectory.roll_out(c, trajectory.times(20))[1:]]
    noise = draw(2, *states[0].shape)
    measured = Measurements(*states, body.torque(*states) + noise)
    found["sums"] = body.sums(*states, measured.torque) @ sides
    for terms in (RIGID, FULL):
        model = TorqueModel(body, terms)
        fitted = estimate("weighted", model, measured)
        found |= {
            f"weighted_{model.count}": fitted.parameters,
            f"weighted_{model.count}_sd": fitted.deviation,
        }
    found |= {f"states_{key}": x.min(0) for key, x in problem.constraints.margins(*states).items()}
    found |= {f"least_{key}": x for key, x in check(problem.constraints, trajectory, c).margins.items()}
    return found


def _slopes(problem: Problem, c: Array, penalty: Penalty | None) -> tuple[Array, Array]:
    """Values, (B,), and gradients, (B, J, H, 2), of condition number and penalty together."""
    objective, gradient = Objective(problem, Goal(), penalty), np.empty_like(c)
    values = [sum(objective(x, slope)) for x, slope in zip(flatten(c, 2), flatten(gradient, 2))]
    return np.array(values), gradient


def _volume(problem: Problem, c: torch.Tensor) -> torch.Tensor:
    """Minus the mean log eigenvalue of the weighted information of pairs, 0-dimensional."""
    weights = 1 / np.arange(1.0, 1 + problem.body.joints)
    subspace, logs = problem.body.base.subspace, []
    for pair in c[: len(c) // 2 * 2].split(2):
        grams = gram(problem.body, problem.trajectory, pair.detach().numpy(), problem.samples, weights)
        whole = grams.sum(0)
        directions = subspace @ np.linalg.eigh(subspace.T @ whole @ subspace)[1]
        logs.append(DirectionEnergies.apply(pair, problem, directions, weights).sum(0).log())
    return -torch.stack(logs).mean()


def picks(problem: Problem, gain: np.ndarray) -> dict[str, np.ndarray]:
    """Sets that are picked from 200 trajectories."""
    c = trajectories(12, gain, 200)
    information = information_of(problem.body, problem.trajectory, c)
    found = {"greedy": greedy(problem.gram(c).diagonal(axis1=1, axis2=2), 20)}
    found |= {"d_optimal": d_optimal(information, 20), "a_optimal": a_optimal(information, 20)}
    return found


def record(c: Array, home: np.ndarray) -> None:
    """Write the recording of the repository: an arm with friction in MuJoCo, at 50 Hz."""
    arm = load_robot(RECORDED["made"][0])
    family = Trajectory(arm.joints, 4, 8.0, home.tolist())
    settings = replace(IDEAL, coulomb=[3.0], viscous=[2.0], rotor_inertia=[0.2])
    executed = Plant(arm, settings).execute(family.roll_out(c, family.times(settings.rate)), 0, 0.5)
    signals = dict(zip(("q", "dq", "tau"), executed[1:]))
    table = {f"{key}{j + 1}": x[:, j] for key, x in signals.items() for j in range(arm.joints)}
    frame = pd.DataFrame({"t": executed.time, **table})[::20]
    frame.to_csv(MADE, index=False, float_format="%.4f")


def identified(name: str) -> dict[str, Any]:
    """Verdict on a recorded arm, flat, without sentences; see ``RECORDED``."""
    robot, recording, model, gains, first, other = RECORDED[name]
    arm = load_robot(DATA / robot if robot.endswith("urdf") else robot)
    more = arm, build(RecordingSettings, recording), gains, model.sign_width
    (training,) = read_and_check([(str(DATA / first), "training")], *more)
    if other is None:
        training, held_out = hold_out(training, 0.3)
    else:
        (held_out,) = read_and_check([(str(DATA / other), "validation")], *more)
    plain = replace(model, effects="none")  # which thresholds decide
    result = identify_arm(arm, [training], [held_out], plain, EstimationSettings())
    return _flat(verdict(result))


def _flat(tree: dict[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, x in tree.items():
        if isinstance(x, dict):
            found |= _flat(x, f"{path}{key}.")
        elif key in WORDS or (np.size(x) and np.array(x).dtype.kind in "if"):
            found[path + key] = x
    return found


@dataclass(frozen=True)
class FixedRun(RunContext):
    """A tiny run whose seeds and libraries are the same 24 trajectories on every machine."""

    def load(self, *artifacts: Artifact) -> Library:
        """These trajectories, whatever the artifacts."""
        c = draw(1, 24, 2, 3, 2) / np.array([1.0, 2.0, 3.0])[:, None]
        return library_of(self.cell.constraints, self.cell.trajectory, c, "fixed")


def stages() -> dict[str, dict[str, float]]:
    """Means over all rows of what the stages identification and replication find in a fixed run."""
    with TemporaryDirectory() as folder:
        run = FixedRun(tiny(f"outputs={folder}", "gan=eigen", experiment="reproduction"), Store(Path(folder)))
        excitation = ExcitationSet("fixed", None, run.cell.trajectory, random_set(run))
        for pool in compared_sets(run):
            run.store.produce(regression_sums(run, pool, "all"))
        return {
            "identification": _means(run, identification(run, excitation), EXPECTED, RESULTS, FACTS),
            "replication": _means(run, replication(run, "all"), RESULTS, FACTS),
        }


def _means(run: RunContext, artifact: Artifact, *files: str) -> dict[str, float]:
    """Means of columns of an artifact's tables, over weightings, joints, noise and tests."""
    run.store.produce(artifact)
    found = {}
    for file in files:
        table = run.frame(artifact, file)
        columns = ("nmse", "covariance_norm", "condition", "samples")
        found |= {f"{Path(file).stem}/{key}": float(table[key].mean()) for key in columns if key in table}
    return found


def _near(problem: Problem, gain: np.ndarray, count: int) -> np.ndarray:
    """Scales a hundredth to a millionth beside those at which a verdict turns, (count,)."""
    low, high = np.zeros(count), np.full(count, 16.0)
    for _ in range(40):
        middle = (low + high) / 2
        c = trajectories(11, gain, count, middle)
        valid = check(problem.constraints, problem.trajectory, c).valid
        low, high = np.where(valid, middle, low), np.where(valid, high, middle)
    index = np.arange(count)
    return (low * (1 + 10.0 ** -(2 + index // 2 % 5) * (-1) ** index)).astype(np.float32)


def _judgement(problem: Problem, c: Array) -> dict[str, np.ndarray]:
    """Verdicts, and which of them rounding cannot turn: margins and a change of 10⁻⁹ leave them."""
    validity = check(problem.constraints, problem.trajectory, c)
    clear = np.abs(np.stack([*validity.margins.values()]).min(0)) > 1e-9
    for factor in (1 - 1e-9, 1 + 1e-9):
        clear &= check(problem.constraints, problem.trajectory, factor * c).valid == validity.valid
    return {"valid": np.packbits(validity.valid), "clear": np.packbits(clear)}


def main() -> None:
    """Write all of it."""
    found: dict[str, np.ndarray] = {}
    for name in ARMS:
        constraints = constraints_of(name)
        home = np.array(default_home(constraints) or [0.0] * constraints.arm.joints)
        problem = problem_of(name, home)
        use = problem.limit_use(trajectories(13, np.ones(len(home)), 200)).mean(0)
        gain = (0.6 / use).astype(np.float32)
        c = trajectories(14, gain, 50)
        c = c[problem.fitness(c).argsort()[:3]].round(6)  # the best: condition magnifies rounding
        own = {"home": home, "gain": gain, "c": c, **numbers(problem, c)}
        if name in JUDGED:
            own["scales"] = _near(problem, gain, JUDGED[name][1])
            own |= _judgement(problem, candidates(name, own))
        if name == "kuka_lwr4":
            own |= picks(problem, gain)
        found |= {f"{name}/{key}": x for key, x in own.items()}
        if name == "ur10_like":
            record(0.35 * c, home)  # within limits
    np.savez_compressed(NUMBERS, **found)
    IDENTIFIED.write_text(json.dumps({name: identified(name) for name in RECORDED}, indent=1) + "\n")
    STAGES.write_text(json.dumps(stages(), indent=1) + "\n")


if __name__ == "__main__":
    main()
