"""A small job in the manner of a stage: seeds of planar2 by tasks, kept as an artifact.

python -m tests.small_job FOLDER              makes it
python -m tests.small_job FOLDER KILLS SEED   starts and kills it again and again, and says what became
"""

import json
import logging
import os
import random
import shutil
import signal
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import torch

from sidegan.base.storage import read_torch, write_json, write_torch
from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.store import Store
from sidegan.robot import load_robot
from sidegan.seeds import Gradient, Tasks, make_seeds
from sidegan.validity import Constraints

METHOD = Gradient(steps=10, attempts=5, reserve=0.2)
COUNT, BATCH = 12, 2


def problem():
    """Three harmonics of the planar arm, nowhere kept out."""
    return Problem(Constraints(load_robot("planar2"), []), Trajectory(2, 3, 8.0), samples=20)


def run(root, method=METHOD, workers=1):
    """Folder of the artifact."""
    store = Store(Path(root))

    def make(build):
        tasks = Tasks(COUNT, BATCH, build.work, workers)
        batch = make_seeds(problem(), method, tasks, np.random.SeedSequence(4))
        write_torch(build.folder / "seeds.pt", {"c": batch.coefficients, "fitness": batch.fitness})
        write_json(build.folder / "report.json", {"attempts": batch.attempts, "failed": batch.failed})

    return store.produce(
        Artifact("seeds", "planar2", "seeds", {"count": COUNT}, {}, 4, make, lambda folder: {})
    )


def same(one, other):
    """Whether two artifacts hold the same to the last bit."""
    left, right = read_torch(one / "seeds.pt"), read_torch(other / "seeds.pt")
    reports = [json.loads((folder / "report.json").read_text()) for folder in (one, other)]
    return all(torch.equal(left[key], right[key]) for key in right) and reports[0] == reports[1]


def killed_after(root, seconds):
    """Kill the job so many seconds after its start; None if it was at work, else how long it took [s]."""
    child, began = os.fork(), time.monotonic()
    if not child:
        run(root)
        os._exit(0)
    while (left := began + seconds - time.monotonic()) > 0:
        if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            break
        time.sleep(min(left, 0.01))
    took = time.monotonic() - began
    os.kill(child, signal.SIGKILL)
    return None if os.WIFSIGNALED(os.waitpid(child, 0)[1]) else took


def kill_often(root, kills, seed):
    """Kill the job at random points; whenever it is complete it is compared, taken away, and begun anew.

    A run that comes to its end before its kill tells that runs have become shorter than was thought.
    """
    reference, source, facts = run(root / "undisturbed"), random.Random(seed), Counter()
    began = time.monotonic()
    run(root / "timed")
    whole, disturbed = time.monotonic() - began, root / "disturbed"
    while facts["interrupted"] < kills:
        took = killed_after(disturbed, source.uniform(0.0, 0.8 * whole))
        facts["interrupted"] += took is None
        whole = whole if took is None else min(whole, max(took, 0.9 * whole))
        if list(disturbed.glob("seeds/planar2-????????")):
            facts["completed"] += 1
            facts["equal"] += same(run(disturbed), reference)
            shutil.rmtree(disturbed / "seeds")
    facts["completed"] += 1
    facts["equal"] += same(run(disturbed), reference)
    found = sorted(str(path.relative_to(disturbed)) for path in disturbed.rglob("*") if path.is_file())
    return {**facts, "files": found}


if __name__ == "__main__":
    torch.set_num_threads(1)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    if len(sys.argv) > 2:
        sys.stdout.write(json.dumps(kill_often(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
    else:
        run(sys.argv[1])
