"""A run that is killed at three points, with its whole group, leaves the files of one that is not."""

import multiprocessing
import os
import random
import signal
import time
from pathlib import Path

import pytest

from sidegan.pipeline.run import run_stages
from tests.tiny import tiny

STAGES = "stages=[seeds,surrogates,gan]", "gan=eigen"
KILLS, SEED = 3, 0
UNEQUAL = {".locks", "costs", "run"}  # folders that tell of times and processes


def files(outputs):
    """The files in the artifacts of a folder of outputs, finished or not, while folders may come and go."""
    paths = [Path(folder, name) for folder, _, names in os.walk(outputs) for name in names]
    return {path for path in paths if path.relative_to(outputs).parts[0] not in UNEQUAL}


def contents(outputs):
    return {str(path.relative_to(outputs)): path.read_bytes() for path in files(outputs)}


def run(outputs):
    """A whole run in a group of processes of its own."""
    os.setsid()
    run_stages(tiny(*STAGES, f"outputs={outputs}"), outputs / "run", "run")


@pytest.fixture
def start():
    """Starts a run in a new process: a fork of one that has imported everything and run nothing."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["sidegan.pipeline.context", "sidegan.steps.train", "sidegan.gan.training"]
    )

    def started(outputs):
        process = context.Process(target=run, args=(outputs,))
        process.start()
        return process

    return started


@pytest.mark.slow
def test_a_run_killed_three_times_ends_like_an_undisturbed_one(tmp_path, start):
    whole, torn, seen = tmp_path / "whole", tmp_path / "torn", set()
    run_stages(tiny(*STAGES, f"outputs={whole}"), whole / "run", "run")
    expected = contents(whole)
    for point in sorted(random.Random(SEED).sample(range(1, len(expected) - 1), KILLS)):
        process = start(torn)
        # as many files, of whatever it has written, and a group of its own
        while process.is_alive() and (len(seen) < point or os.getpgid(process.pid) != process.pid):
            seen |= files(torn)
            time.sleep(0.005)
        assert process.is_alive(), "it ended before its kill"
        os.killpg(process.pid, signal.SIGKILL)
        process.join()
    last = start(torn)
    last.join()
    assert last.exitcode == 0 and contents(torn) == expected
