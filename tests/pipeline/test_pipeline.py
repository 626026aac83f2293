"""The pipeline at paper scale: it cannot be run here, but what it refers to must be there."""

import itertools
import re
import shlex
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir

from sidegan.pipeline import callbacks  # noqa: F401 - registers what the paths in conf/ use
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import validate
from sidegan.pipeline.plan import Task
from sidegan.pipeline.run import CONF
from sidegan.pipeline.stages import STAGES

ROOT = Path(__file__).parents[2]
PIPELINE = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))
VARIABLES = {key: value for entry in PIPELINE["vars"] for key, value in entry.items()}


def filled(value, item):
    """The value with every ${…} replaced."""
    if isinstance(value, dict):
        return {filled(k, item): filled(v, item) for k, v in value.items()}
    if isinstance(value, list):
        return [filled(x, item) for x in value]
    if not isinstance(value, str):
        return value
    known = VARIABLES | {f"item.{key}": x for key, x in item.items()}
    return re.sub(r"\$\{([\w.]+)\}", lambda m: str(known[m[1]]), value)


def expanded():
    """Name and content of every stage, one for each combination of its matrix."""
    for name, stage in PIPELINE["stages"].items():
        matrix = stage.get("matrix", {})
        for values in itertools.product(*matrix.values()):
            item = dict(zip(matrix, values))
            yield (
                "-".join(map(str, [name, *values])),
                filled({k: v for k, v in stage.items() if k != "matrix"}, item),
            )


STEPS = dict(expanded())


def paths(stage, key):
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in stage.get(key, [])]


def configured(stage):
    """The configuration of a stage's command, and its whole self."""
    commands = stage["cmd"] if isinstance(stage["cmd"], list) else [stage["cmd"]]
    words = shlex.split(commands[0])
    assert words[:3] == ["python", "-m", "sidegan.run"]
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return validate(compose("config", overrides=words[3:]))


@pytest.mark.parametrize("name", STEPS)
def test_a_stage_is_a_command_that_is_accepted(name):
    cfg = configured(STEPS[name])
    assert cfg.named and cfg.scale.name == "paper" and set(cfg.stages) <= set(STAGES)


@pytest.mark.parametrize("name", STEPS)
def test_what_a_stage_depends_on_is_there_or_made_before(name):
    made = {path for stage in STEPS.values() for key in ("outs", "metrics") for path in paths(stage, key)}
    for path in paths(STEPS[name], "deps"):
        assert path in made or (ROOT / path).exists(), path
    for entry in STEPS[name].get("params", []):
        for file, keys in entry.items():
            content = yaml.safe_load((ROOT / file).read_text(encoding="utf-8"))
            for key in keys or []:
                assert key in content, f"{file}: {key}"


def test_outputs_are_kept_and_named_as_the_artifacts(tmp_path):
    for name, stage in STEPS.items():
        for entry in [*stage.get("outs", []), *stage.get("metrics", [])]:
            assert next(iter(entry.values()))["persist"], name
    task = Task(configured(STEPS["report"]), Store(tmp_path, named=True))
    cfg = task.cfg
    known = [task.seeds, task.random_set, task.density, *(task.kind(kind).seeds for kind in cfg.kinds)]
    known += [task.surrogates(data) for data in ("broad", "paper")]
    known += [task.gan(n, s, k) for n, s in cfg.ablation.items() for k in cfg.scale.ablation_trainings]
    for k in cfg.trainings:
        known += [task.gan(n, s, k) for n, s in cfg.gan.items()]
        known += [task.library(n, k) for n in cfg.gan]
    folders = {f"outputs/{task.store.folder(stamp).relative_to(tmp_path)}" for stamp in known}
    made = {path for stage in STEPS.values() for path in paths(stage, "outs")}
    assert folders <= made
