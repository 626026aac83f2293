"""Take over the artifacts of version 0.1, once.

``python -m sidegan.pipeline.takeover +experiment=reproduction scale=paper named=true``

Their stamps held digests of source files, and some of their files what the work took. An artifact is
taken over when it was made by the last code of that version, for the same arm and seed, with the same
settings, from inputs that are taken over themselves; everything else is left where it is, and made anew
when it is needed.
"""

import hashlib
import json
import logging
import sys
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import Any

import pandas as pd

from sidegan.base.storage import read_json, write_json, write_parquet
from sidegan.errors import ArtifactError
from sidegan.pipeline.graph import Artifact, flatten, waves
from sidegan.pipeline.run import composed
from sidegan.pipeline.stages import stage
from sidegan.pipeline.store import STAMP, Store, write_stamp
from sidegan.pipeline.task import HISTORY, REPORT, RESULTS, Task
from sidegan.report.tables import arrow

log = logging.getLogger(__name__)

_FIELDS = ("stage", "label", "config", "inputs", "code", "seed")
_COSTS = {  # what went from reports to what is kept beside artifacts; None: all of it
    "seeds": ["cpu_seconds"],
    "optimised": ["cpu_seconds", "each"],
    "polished": ["each"],
    "timing": None,
    "first_set": None,
}
# First digits of the source digests of version 0.1.
_DIGESTS = """
conditional=66ed85d4 criteria=edb9c988 dynamics=f7a0ec9c excitation=74715f46 gan=b9e060a1
identification.estimate=6360ded6 identification.model=75147bf9 identification.replication=6b728610
information=f08cfb36 library=fbc37fd6 optimal=dce49b47 plan_conditional=b95c1033 plant=01aa076a
recording=324b180d seeds=9629374a seeds.problem=ff397695 selection=657b15e5 stages.best=ad1aaa80
stages.common=3d608f8b stages.conditional=4599c0c3 stages.conditional_study=e5e0f847
stages.density=8aff40a2 stages.first_set=f62b480f stages.optimised=8fd1ef91 stages.plant=edb76352
stages.polish=5c3a28a6 stages.random=88a81e5e stages.replication=37b5a7b9
stages.sensitivity=d1dfff3a stages.timing=775d68ec stages.transfer=21b7e6ef trajectory=9af730d2
validity=06c14f52 identification.identify=26419117 identification.measurements=02982ed8
identification.metrics=8065681e identification.rls=599f426d identification.study=71c6152f
identification.sums=f543a708
"""
_CODE = dict(entry.split("=") for entry in _DIGESTS.split())


def take_over(store: Store, artifacts: Iterable[Artifact]) -> tuple[list[Artifact], dict[str, str]]:
    """The artifacts that were taken over, and of the others why not, by their folder."""
    taken, refused = [], {}
    old: dict[str, str] = {}  # digest of an artifact's former stamp, by its digest today
    for artifact in chain.from_iterable(waves(artifacts)):
        name = artifact.label if store.named else f"{artifact.label}-{'?' * 8}"
        for path in sorted((store.root / artifact.maker).glob(f"{name}/{STAMP}")):
            folder = path.parent
            try:
                stamp = read_json(path)
                if "maker" in stamp:
                    continue
                _check(artifact, stamp, folder, old)
                _convert(store, artifact, stamp, folder)
            except (ArtifactError, KeyError) as error:
                refused[str(folder)] = str(error)
                continue
            plain = {key: stamp[key] for key in _FIELDS}
            old[artifact.digest] = hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()
            taken.append(artifact)
            break
    return taken, refused


def _check(artifact: Artifact, stamp: dict[str, Any], folder: Path, old: dict[str, str]) -> None:
    """Refuse an artifact that is not what the former code would have made of the same.

    Raises:
        ArtifactError: saying why.
    """
    if artifact.stamp["version"] > 1:
        raise ArtifactError("what it holds is computed in another way today")
    changed = [room for room, digest in stamp["code"].items() if not digest.startswith(_CODE.get(room, "?"))]
    if changed:
        raise ArtifactError(f"it is of another code: {', '.join(changed)}")
    for name, size in stamp["files"].items():
        if not (folder / name).is_file() or (folder / name).stat().st_size != size:
            raise ArtifactError(f"{name} is damaged")
    if stamp["seed"] != artifact.seed or stamp["inputs"].get("robot") != artifact.inputs["robot"]:
        raise ArtifactError("it is of another arm or seed")
    before = flatten(stamp["config"])
    for key, value in flatten(artifact.stamp["settings"]).items():
        if key == "trajectory.home" and value is None:
            value = [0.0] * len(before[key])
        if before.get(key, value) != value:
            raise ArtifactError(f"{key} was {before[key]}, not {value}")
    subset = artifact.stamp["settings"][artifact.maker].get("subset")
    if stamp["inputs"].get("subset") != (None if subset is None else str(subset)):
        raise ArtifactError("it learnt from another number of seeds")
    for parent in artifact.parents:
        told = artifact.maker != "surrogates" or parent.maker != "gan"  # negatives were settings
        if told and old.get(parent.digest) not in stamp["inputs"].values():
            raise ArtifactError(f"it was made from another {parent.maker}, or that is not taken over")


def _convert(store: Store, artifact: Artifact, stamp: dict[str, Any], folder: Path) -> None:
    costs: dict[str, Any] = {"seconds": stamp["seconds"]}
    if artifact.maker in _COSTS:
        report = read_json(folder / REPORT)
        keys = _COSTS[artifact.maker]
        costs |= {key: report.pop(key) for key in (keys if keys is not None else list(report))}
        if report:
            write_json(folder / REPORT, report)
        else:
            (folder / REPORT).unlink()
    if artifact.maker == "first_set":
        costs["cpu_seconds"] = costs.pop("seconds")
    if artifact.maker == "polish":
        frame = pd.read_parquet(folder / RESULTS)
        costs["each"] = frame.pop("seconds").tolist()
        write_parquet(folder / RESULTS, arrow(frame))
    if (folder / HISTORY).exists() and "seconds" in (rows := read_json(folder / HISTORY))[0]:
        costs["epochs"] = [row.pop("seconds") for row in rows]
        write_json(folder / HISTORY, rows)
    store.keep_costs(artifact, costs)
    (folder / STAMP).unlink()
    write_stamp(folder, artifact.stamp)
    folder.rename(store.folder(artifact))


def main(overrides: list[str]) -> int:
    """Take over what an experiment is made of, and say what was left."""
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    cfg = composed(*overrides)
    task = Task(cfg, Store(Path(cfg.outputs), cfg.named))
    artifacts = [one for name in cfg.stages for one in stage(name).artifacts(task)]
    taken, refused = take_over(task.store, artifacts)
    for folder, reason in refused.items():
        log.info("left %s: %s", folder, reason)
    log.info("%d artifacts taken over, %d left", len(taken), len(refused))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
