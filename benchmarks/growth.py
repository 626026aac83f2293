"""How cost grows: CPU seconds, peak memory and size of files, each large size in a process of its own.

python -m benchmarks.growth library 100000
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.threads import one_thread
from sidegan.design.problem import Problem
from sidegan.design.selection import Selection, choose
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.fit import gather, least_squares
from sidegan.library.draw import Expansion, draw_valid
from sidegan.library.measure import library_of
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.compose import composed
from sidegan.pipeline.run import run_stages
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check

_COUNT, _SAMPLES = 400, 80  # trajectories of a small size, and their samples
_REACH, _BATCH = 0.5, 1000  # of random draws of a library
_PICKED = 35
_AT_ONCE = 1_000  # of a pool's trajectories
_PIECE = 100.0  # [s] of motion that is held at once, at 100 Hz

Costs = dict[str, float]


def _lwr(**family: float) -> Problem:
    """Trajectories of the LWR on its desk."""
    constraints = Constraints(load_robot("kuka_lwr4"), [Plane((0.0, 0.0, 1.0), 0.10)])
    return Problem(constraints, Trajectory(constraints.arm.joints, **family))


def _peak() -> float:
    """Largest memory of this process up to now [MB]; ``resource`` would count that of its parent too."""
    status = Path("/proc/self/status").read_text().split()
    return int(status[status.index("VmHWM:") + 1]) / 1024


def _spent(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _small(problem: Problem, samples: int = _SAMPLES) -> Costs:
    """CPU time [µs] of a trajectory: YᵀY, and validity."""
    c = problem.start(_COUNT, np.random.default_rng(0))
    works = {
        "regressor": lambda: gram(problem.body, problem.trajectory, c, samples),
        "validity": lambda: check(problem.constraints, problem.trajectory, c),
    }
    for work in works.values():
        work()
    return {name: 1e6 * min(_spent(work) for _ in range(3)) / _COUNT for name, work in works.items()}


def joints(size: int) -> Costs:
    """A random chain of so many joints."""
    from tests.chains import random_chain

    return _small(Problem(Constraints(random_chain(size, 0)[0], [], torque=False), Trajectory(size)))


def samples(size: int) -> Costs:
    """So many samples of each trajectory; validity has none."""
    return {"regressor": _small(_lwr(), samples=size)["regressor"]}


def harmonics(size: int) -> Costs:
    """So many harmonics."""
    return _small(_lwr(harmonics=size))


def library(size: int) -> Costs:
    """A library of random valid trajectories."""
    problem = _lwr()
    constraints, family = problem.constraints, problem.trajectory
    noise = np.random.default_rng(0)
    settings = Expansion(count=size, batch=_BATCH, draws=20 * size, least=size)
    found = Costs()
    start = time.process_time()
    draws = draw_valid(
        lambda n: problem.start(n, noise, _REACH), lambda c: check(constraints, family, c), settings, "random"
    )
    found["draw and check"] = time.process_time() - start
    start = time.process_time()
    made = library_of(constraints, family, draws.coefficients, "random")
    found["measure"] = time.process_time() - start
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.parquet"
        found["save"] = _spent(lambda: made.save(path))
        found["file"] = path.stat().st_size / 1e6
    assert len(made) == size and made.valid.all()
    return found


def _pick(method: str, size: int) -> Costs:
    problem = _lwr()
    noise = np.random.default_rng(0)
    c = np.concatenate([problem.start(_AT_ONCE, noise) for _ in range(size // _AT_ONCE)])
    diagonal = noise.random((size, problem.body.parameters_count))
    picked = list[Array]()
    settings = Selection(count=_PICKED, method=method)
    found = {
        "pick": _spent(lambda: picked.append(choose(settings, problem.body, problem.trajectory, c, diagonal)))
    }
    assert len(set(picked[0].tolist())) == _PICKED
    return found


def greedy(size: int) -> Costs:
    """The paper's pick of 35."""
    return _pick("greedy", size)


def d_optimal(size: int) -> Costs:
    """The D-optimal pick of 35."""
    return _pick("d_optimal", size)


def rls(size: int) -> Costs:
    """Least squares of so many seconds of motion at 100 Hz, read piece by piece."""
    problem = _lwr(period=_PIECE)
    body, family = problem.body, problem.trajectory
    c = problem.start(1, np.random.default_rng(0))
    motion = family.roll_out(c, family.grid(round(100 * _PIECE)))
    part = Measurements(*(x[0] for x in motion[1:]), body.torque(*motion[1:])[0])
    model = TorqueModel(body, RIGID)
    pieces = round(size / _PIECE)
    return {"fit": _spent(lambda: least_squares(gather(model, (part for _ in range(pieces))).sums))}


def workers(size: int) -> Costs:
    """Wall time [s] of 2,000 seeds by gradients in so many processes, their start included."""
    words = "+experiment=exp1", "seeds=gradient", "seeds.count=2000", "stages=[seeds]", "tracking=off"
    with tempfile.TemporaryDirectory() as folder:
        config = composed(*words, f"outputs={folder}", f"parallel.workers={size}")
        start = time.perf_counter()
        run_stages(config, Path(folder) / "run", "growth")
        return {"2,000 seeds": time.perf_counter() - start}


POINTS: dict[Callable[[int], Costs], list[int]] = {
    joints: [2, 4, 7, 10, 14],
    samples: [40, 80, 160, 320, 640],
    harmonics: [2, 4, 6, 12, 24],
    library: [1_000, 10_000, 100_000, 1_000_000],
    greedy: [10_000, 100_000, 1_000_000],
    d_optimal: [10_000, 100_000, 1_000_000],
    rls: [1_000, 10_000, 100_000],
    workers: [1, 2],
}


def main(name: str, *sizes: str) -> None:
    """Print the costs of these sizes of a work, one JSON object."""
    work = {known.__name__: known for known in POINTS}[name]
    found = {}
    for size in sizes:
        with one_thread():
            costs = work(int(size))
        found[size] = costs | ({"peak": _peak()} if len(sizes) == 1 else {})
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
