"""``dvc.yaml`` from the graph of artifacts: ``python -m sidegan.pipeline.dvc`` writes it.

Each stage of the reproduction at paper scale is a stage of DVC, and the page on exact physics is one
more; the ladders stand in ``ladders/dvc.yaml``, a target of its own. What a stage is made with stands in
``outputs/settings.yaml``, composed from ``conf/`` by the pipeline's first stage, so that a changed setting
reruns what depends on it and nothing else. Outputs persist: the stages themselves know by their stamps what
can be reused.
"""

import argparse
import shlex
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import yaml

from sidegan.base.storage import write_bytes
from sidegan.pipeline.columns import OURS
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.run import composed
from sidegan.pipeline.stages import STAGES, stage
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task

SHARED = ("seeds", "kinds")  # stages that make theirs for all columns
PAGES = ("beyond", "ladder", "quality", "worth")  # experiments with a page of their own
LADDERS = "ladders/dvc.yaml"  # those of them that `dvc repro` leaves alone
# The study of motions is of the arm that every machine has; its page, which has another too, is left alone.
_ALONE = {"worth": ("~worth.others.ur10e",)}
SETTINGS = "outputs/settings.yaml"
_RUN = "python -m sidegan.run +experiment={} {} named=true"
_MANY = 6  # outputs that get a line each
_VERSIONS = "sidegan/pipeline/versions.yaml"
_PARTS = ("/tables", "/figures", "/metrics")  # folders of a page
_ENDS = {"beyond": (".md", *_PARTS)}  # of what a page consists of
HEAD = """\
# Written by `python -m sidegan.pipeline.dvc`; do not edit. The paper at its own scale: `dvc repro`.
# A stage that is killed goes on where it was.
"""
HEAD_LADDERS = """\
# Written by `python -m sidegan.pipeline.dvc`; do not edit. From the paper's recipe to ours, and from poor
# seeds to good ones, and what motions are worth on the LWR, at its scale: `dvc repro ladders/dvc.yaml`.
"""


def task(experiment: str, outputs: Path) -> Task:
    """An experiment of the pipeline."""
    options = _options(experiment)
    cfg = composed(f"+experiment={experiment}", *options, "named=true", f"outputs={outputs}")
    return Task(cfg, Store(outputs, named=True))


def parts(outputs: Path) -> dict[str, list[Artifact]]:
    """Every stage of the pipeline and the artifacts that it makes; what two of them list is of the first."""
    owned: set[str] = set()
    made: dict[str, list[Artifact]] = {}
    paper = task("reproduction", outputs)
    stages = {name: stage(name) for name in paper.cfg.stages if name != "table"}
    ours = paper.with_settings(only=[OURS])
    listed = {name: one.listed(paper if name in SHARED else ours) for name, one in stages.items()}
    for column in paper.cfg.columns:
        alone = paper.with_settings(only=[column])
        listed[column] = [x for one in stages.values() if one.columnwise for x in one.listed(alone)]
    for page in PAGES:
        whole = task(page, outputs)
        listed[page] = [one for name in whole.cfg.stages for one in stage(name).listed(whole)]
    for name, artifacts in listed.items():
        new = {one.digest: one for one in artifacts if one.digest not in owned}
        owned |= set(new)
        made[name] = list(new.values())
    return made


def settings(made: Mapping[str, Iterable[Artifact]]) -> dict[str, dict[str, Any]]:
    """What every stage is made with: settings and the digests of what is read, by artifact."""
    return {
        name: {
            f"{one.maker}/{one.label}": {
                "settings": one.stamp["settings"],
                "read": {key: digest for key, digest in one.inputs.items() if isinstance(digest, str)},
            }
            for one in artifacts
        }
        for name, artifacts in made.items()
    }


def files(made: Mapping[str, list[Artifact]]) -> dict[str, str]:
    """The text of ``dvc.yaml`` and of that of the ladders, by path."""
    stages = _stages(made)
    apart = {name: {"wdir": "..", **stages.pop(name)} for name in PAGES if name != "beyond"}
    shown = [f"docs/{name}/metrics" for name in ("reproduction", "beyond")]
    plots = ["docs/reproduction/figures/training.png"]
    whole = {"stages": stages, "metrics": shown, "plots": plots}
    return {"dvc.yaml": text(whole, HEAD), LADDERS: text({"stages": apart}, HEAD_LADDERS)}


def _stages(made: Mapping[str, list[Artifact]]) -> dict[str, Any]:
    """Every stage as DVC knows it; those of pages come last."""
    owner = {one.digest: name for name, artifacts in made.items() for one in artifacts}
    makers: dict[str, set[str]] = {}
    for name, artifacts in made.items():
        for one in artifacts:
            if one.column is None:
                makers.setdefault(one.maker, set()).add(name)

    def path(one: Artifact) -> str:
        """That of its column, or of its maker where all artifacts are of one stage, or one of its own."""
        if one.column is not None:
            return f"outputs/columns/{one.column}"
        return f"outputs/{one.maker}" if len(makers[one.maker]) == 1 else f"outputs/{one.maker}/{one.label}"

    stages: dict[str, Any] = {
        "settings": {
            "cmd": "python -m sidegan.pipeline.dvc settings",
            "deps": ["conf", "sidegan/robot/models", "sidegan/pipeline/stages/arms"],
            "outs": [SETTINGS],
        }
    }
    columnwise = ",".join(
        name for name in made if name in STAGES and name not in SHARED and stage(name).columnwise
    )
    for name, artifacts in made.items():
        alone = "" if name in _ALONE else " publish=docs" if name in PAGES else f" 'stages=[{name}]'"
        if any(one.column == name for one in artifacts):
            alone = f" 'only=[{name}]' 'stages=[{columnwise}]'"
        elif name in columnwise.split(","):
            alone += f" 'only=[{OURS}]'"
        parents = [p for one in artifacts for p in one.parents if owner[p.digest] != name]
        stages[name] = {
            "cmd": _command(name if name in PAGES else "reproduction") + alone,
            "params": _Line([{SETTINGS: [name]}, {_VERSIONS: sorted({one.maker for one in artifacts})}]),
            **({"deps": list(dict.fromkeys(map(path, parents)))} if parents else {}),
            "outs": _outs(map(path, artifacts)),
        }
    everything = [path(one) for name, artifacts in made.items() if name not in PAGES for one in artifacts]
    stages["report"] = {
        "cmd": _command("reproduction") + " 'stages=[table]' publish=docs",
        "deps": ["experiments", *dict.fromkeys(everything)],
        **_published("reproduction", ".md", ".html", *_PARTS),
    }
    for name in PAGES:  # last: they take longest
        one = stages.pop(name)
        page = [] if name in _ALONE else _published(name, *_ENDS.get(name, (".md", "")))["outs"]
        stages[name] = {**one, "outs": one["outs"] + page}
    return stages


def _options(experiment: str) -> tuple[str, ...]:
    """The overrides of an experiment."""
    return ("scale=paper", *_ALONE.get(experiment, ()))


def _command(experiment: str) -> str:
    """The command of an experiment."""
    return _RUN.format(experiment, " ".join(map(shlex.quote, _options(experiment))))


def _outs(paths: Iterable[str]) -> list[Any]:
    """Outputs that persist, each once; many of them stand side by side."""
    outs = [{one: {"persist": True}} for one in dict.fromkeys(paths)]
    return _Line(outs) if len(outs) > _MANY else outs


def _published(name: str, *ends: str) -> dict[str, Any]:
    """What a published page consists of, by the ends of its paths; it is kept in git."""
    return {"outs": [{f"docs/{name}{end}": {"cache": False, "persist": True}} for end in ends]}


class _Line(list[Any]):
    """A list that is written on one line."""


class _Dumper(yaml.SafeDumper):
    """YAML without aliases, which nobody can read."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write everything out."""
        return True


_Dumper.add_representer(
    _Line, lambda dumper, data: dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=True)
)


def text(content: Any, head: str = "") -> str:
    """YAML of plain values."""
    options: dict[str, Any] = {"sort_keys": False, "width": 2000, "allow_unicode": True}
    return head + yaml.dump(content, Dumper=_Dumper, default_flow_style=None, **options)


def main(arguments: list[str] | None = None) -> int:
    """Write ``dvc.yaml``, or the settings that it refers to, into the current folder."""
    parser = argparse.ArgumentParser(description="Write dvc.yaml from the graph of artifacts.")
    parser.add_argument("what", nargs="?", choices=("pipeline", "settings"), default="pipeline")
    chosen = parser.parse_args(arguments)
    with TemporaryDirectory() as folder:
        made = parts(Path(folder))
    if chosen.what == "settings":
        write_bytes(Path(SETTINGS), text(settings(made)).encode())
    else:
        for path, content in files(made).items():
            write_bytes(Path(path), content.encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
