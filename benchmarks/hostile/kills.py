"""Kills at random moments: process groups end by SIGKILL; what the rerun leaves equals that of no kill.

All runs use a copy of the project, which nobody edits meanwhile. Work goes on where it was stopped, and files
that differ are kept with what they should have been.
"""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.tree import ROOT, copied

ARMS = {
    "planar2": ("trajectory.harmonics=3", "long.period=32", "long.harmonics=[3,12]", "long.samples=200"),
    "kuka_lwr4": ("long.harmonics=[6]", "long.period=64", "long.samples=320"),
}
_COMMAND = (sys.executable, "-m", "sidegan.run", "+experiment=exp1", "scale=tiny", "tracking=off")
_WORKERS = "parallel.workers=2"
_REACH = 0.6  # of the time of a whole run, within which a kill comes: about every stage is hit in turn
_UNEQUAL = (".locks", "costs", "runs")  # folders that tell of times and processes
_SEMAPHORES = Path("/dev/shm")
_STAGE = re.compile(r": (\w+) …$", re.MULTILINE)  # a line of the log with which a stage begins


class Outcome(NamedTuple):
    """What came of some kills."""

    kills: int
    finished: int  # runs that came to their end after kills
    unequal: list[str]  # files that differ from those of a run without a kill, or are too many or missing
    left: int  # semaphores of the killed runs that are still in shared memory
    stages: dict[str, int]  # how often each stage was hit


@dataclass(frozen=True)
class Kills:
    """Kills of the tiny experiment of one arm, with all their files in a folder of its own.

    Attributes:
        arm: one of ``ARMS``.
        work: the folder; what is there already is not done again.
        tree: copy of the project that runs.
        seed: of the moments.
    """

    arm: str
    work: Path
    tree: Path
    seed: int = 0

    def run(self, count: int) -> Outcome:
        """Run again and again, killed ``count`` times in all, and compare what each finished run leaves."""
        took, expected = self._whole, contents(self.work / "whole")
        torn = self.work / "torn"
        while (killed := len(self._told("killed"))) < count or torn.exists():
            past = f"{killed}-{len(self._told('finished'))}"  # another moment after a run that was quicker
            moment = random.Random(f"{self.seed}-{self.arm}-{past}").uniform(0, _REACH * took)
            before = len(_logs(torn))
            process, code = self._start(torn, moment if killed < count else None)
            if code is None:
                self._tell({"killed": moment, "stage": stage_of(_logs(torn)[before:]), "process": process})
                continue
            unequal = differences(expected, contents(torn)) + [f"{self.arm}: failed"] * (code != 0)
            self._keep(unequal)
            self._tell({"finished": killed, "unequal": unequal})
            shutil.rmtree(torn)
        finished = self._told("finished")
        wrong = [name for one in finished for name in one["unequal"]] + self._unsteady(expected)
        kills = self._told("killed")
        left = sum(len(semaphores(one["process"])) for one in kills if "process" in one)
        return Outcome(killed, len(finished), wrong, left, dict(Counter(one["stage"] for one in kills)))

    @cached_property
    def _whole(self) -> float:
        """Time of a run without a kill [s], the second of two: the first compiles the kernels too."""
        path = self.work / "whole.json"
        if not path.exists():
            for name in ("first", "whole"):
                shutil.rmtree(self.work / name, ignore_errors=True)
                began = time.monotonic()
                self._start(self.work / name, None)
                took = time.monotonic() - began
            path.write_text(json.dumps(took), encoding="utf-8")
        return float(json.loads(path.read_text(encoding="utf-8")))

    def _unsteady(self, expected: dict[str, bytes]) -> list[str]:
        """What the two runs without a kill differ in."""
        if not expected:
            return [f"{self.arm}: nothing was made"]
        return [f"without a kill: {x}" for x in differences(expected, contents(self.work / "first"))]

    def _start(self, outputs: Path, moment: float | None) -> tuple[int, int | None]:
        """Process and exit code of a run, None when killed at a moment [s]; nothing of it stays alive."""
        settings = (f"robot={self.arm}", f"outputs={outputs.resolve()}", _WORKERS, *ARMS[self.arm])
        null, environment = subprocess.DEVNULL, {**os.environ, "PYTHONPATH": str(self.tree.resolve())}
        process = subprocess.Popen(
            [*_COMMAND, *settings],
            cwd=self.tree,
            env=environment,
            stdout=null,
            stderr=null,
            start_new_session=True,
        )
        try:
            return process.pid, process.wait(moment)
        except subprocess.TimeoutExpired:
            return process.pid, None
        finally:
            if process.returncode is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def _keep(self, unequal: list[str]) -> None:
        """Copy files that differ, each beside what it should have been."""
        number = len(self._told("finished"))
        for name in unequal:
            for kind in ("whole", "torn"):
                source, target = self.work / kind / name, self.work / "unequal" / str(number) / kind / name
                if source.is_file():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(source, target)

    def _tell(self, row: dict[str, Any]) -> None:
        with (self.work / "record.jsonl").open("a", encoding="utf-8") as file:
            file.write(f"{json.dumps(row)}\n")

    def _told(self, key: str) -> list[dict[str, Any]]:
        path = self.work / "record.jsonl"
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        return [row for row in map(json.loads, lines) if key in row]


def killed(arm: str, count: int, work: Path) -> Outcome:
    """What comes of so many kills of one arm's runs; those that ``work`` tells of are counted in."""
    folder = work / arm
    folder.mkdir(parents=True, exist_ok=True)
    return Kills(arm, folder, copied(ROOT, work / "tree")).run(count)


def _logs(outputs: Path) -> list[Path]:
    """Logs of the runs below some outputs, the latest last."""
    return sorted(outputs.glob("runs/*/*/*.log"))


def stage_of(logs: Sequence[Path]) -> str:
    """Stage in which the run of the last of some logs was killed; ``start`` before the first."""
    found = _STAGE.findall(logs[-1].read_text(encoding="utf-8")) if logs else []
    return found[-1] if found else "start"


def contents(outputs: Path) -> dict[str, bytes]:
    """What lies in the artifacts of a folder of outputs, and in what is unfinished."""
    files = (path for path in outputs.rglob("*") if path.is_file())
    names = {str(path.relative_to(outputs)): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if Path(name).parts[0] not in _UNEQUAL}


def differences(expected: dict[str, bytes], found: dict[str, bytes]) -> list[str]:
    """Names that are in one of both alone, or whose bytes differ."""
    return sorted(name for name in {*expected, *found} if expected.get(name) != found.get(name))


def semaphores(process: int) -> list[str]:
    """Names in shared memory of what a process made for its workers; loky names them after the process."""
    return sorted(path.name for path in _SEMAPHORES.glob(f"sem.loky-{process}-*"))
