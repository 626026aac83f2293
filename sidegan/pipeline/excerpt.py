"""What a page is made from, without the rest: ``python -m sidegan.pipeline.excerpt OUTPUTS FOLDER``.

Of everything that the reproduction made at the paper's scale in OUTPUTS, by runs with ``named=true``, the
folder gets what its page shows: reports, histories and tables, the seeds and the sets that were picked.
Networks, sums of least squares and libraries stay behind, apart from those of the one generator that the page
draws and times. Where something is not made yet, what that would need stays behind and is made anew.

Runs take the folder's artifacts for their own: ``mkdir -p outputs && cp -r FOLDER/. outputs/``.
"""

import argparse
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from sidegan.base.storage import read_json
from sidegan.errors import SideganError
from sidegan.pipeline.dvc import task
from sidegan.pipeline.graph import Artifact, waves
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.training import generator
from sidegan.pipeline.store import STAMP, Store, left_out, write_stamp
from sidegan.pipeline.task import LIBRARY, Task

_NETWORKS = ".pt"  # and sums of least squares
_LARGE = {"library", "random"}  # makers whose trajectories no page shows


def listed(task: Task) -> list[Artifact]:
    """Every artifact of a task's stages, in every column, and what they are made from; none twice."""
    found: dict[str, Artifact] = {}

    def add(artifacts: Iterable[Artifact]) -> None:
        for one in artifacts:
            if one.digest not in found:
                found[one.digest] = one
                add(one.parents)

    for name in task.cfg.stages:
        add(stage(name).listed(task))
    return list(found.values())


def excerpt(task: Task, folder: Path) -> tuple[int, int]:
    """Write what the page of a task needs into a folder, whose artifacts are replaced.

    Returns:
        Number of artifacts in the folder, and of those that are missing there.

    Raises:
        SideganError: when there is nothing to copy, or the folder cannot be written.
    """
    every = listed(task)
    kept = _without_unfinished(task, every)
    if not kept:
        raise SideganError(f"{task.store.root} holds nothing of the experiment {task.cfg.experiment!r}")
    shutil.rmtree(folder, ignore_errors=True)
    target = Store(folder, named=True)
    for one in kept:
        _copy(one, task, target, _behind(one, task))
    return len(kept), len(every) - len(kept)


def _without_unfinished(task: Task, every: list[Artifact]) -> list[Artifact]:
    """What is there, but for what something that is not there would need whole."""
    kept: list[Artifact] = []
    needed: set[str] = set()
    for one in [one for wave in waves(every) for one in wave][::-1]:  # children come first
        there = task.store.find(one) is not None
        if there and not (one.digest in needed and _behind(one, task)):
            kept.append(one)
        else:
            needed |= {parent.digest for parent in one.parents}
    return kept[::-1]


def _behind(one: Artifact, task: Task) -> set[str]:
    """Names of the files of an artifact that no page shows, those it was copied without among them."""
    folder, trainings = task.store.folder(one), task.cfg.trainings
    shown = {made(task, "eigen", trainings[0]).digest for made in (generator, library)}
    if one.digest in shown:
        return set(left_out(folder))
    names = {path.name for path in folder.iterdir()} if folder.exists() else set()
    large = {LIBRARY} if one.maker in _LARGE else set()
    return {name for name in names if name.endswith(_NETWORKS) or name in large} | set(left_out(folder))


def _copy(one: Artifact, task: Task, target: Store, behind: set[str]) -> None:
    folder = target.folder(one)
    leave = shutil.ignore_patterns(STAMP, *behind)
    shutil.copytree(task.store.require(one), folder, ignore=leave)
    write_stamp(folder, one.stamp, sorted(behind))
    if costs := task.store.costs(one):
        target.keep_costs(one, costs)


def main() -> int:
    """Exit code of the command."""
    about = "What the reproduction's page is made from, without networks, libraries and sums."
    parser = argparse.ArgumentParser(prog="python -m sidegan.pipeline.excerpt", description=about)
    parser.add_argument("outputs", type=Path, help="where the reproduction was made")
    parser.add_argument("folder", type=Path, help="what gets the excerpt, in place of what it holds")
    given = parser.parse_args()
    try:
        there, missing = excerpt(task("reproduction", given.outputs), given.folder)
    except SideganError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1
    size = sum(path.stat().st_size for path in given.folder.rglob("*") if path.is_file())
    spent = sum(read_json(path).get("cpu_seconds", 0.0) for path in (given.folder / "costs").rglob("*.json"))
    about = f"{there} artifacts, {size / 1e6:.1f} MB, made in {spent / 3600:.1f} hours of one core"
    sys.stdout.write(f"{about}; {missing} are not made yet or not whole\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
