"""Exact physics in the loop beside surrogates, plain optimisation and chance: the page ``beyond.md``.

No number in it is typed: everything comes from artifacts.
"""

from pathlib import Path

from experiments import beyond_goals, beyond_sections
from experiments.beyond_evidence import Evidence
from sidegan.base.storage import write_json
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.plan import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.document import Document
from sidegan.report.markdown import write_markdown


def collect(task: Task) -> Evidence:
    """Everything that the page needs, from the artifacts.

    Raises:
        ConfigError: when the variant that all is compared with is not trained.
    """
    plan_beyond.source(task)
    return Evidence(task)


def present(evidence: Evidence, folder: Path, tracker: Tracker) -> None:
    """Write ``beyond.md``, its tables, figures and metrics; record the page."""
    target = Path(evidence.task.cfg.publish or folder)
    assets = target / "beyond" / "figures"
    made = [
        beyond_sections.goals(evidence, assets),
        beyond_sections.quality(evidence, assets),
        beyond_sections.first(evidence, assets),
        beyond_sections.best(evidence, assets),
        beyond_sections.polish(evidence, assets),
        beyond_sections.objectives(evidence, assets),
        beyond_sections.transfers(evidence, assets),
        beyond_sections.few(evidence, assets),
        beyond_sections.choices(evidence),
        beyond_sections.method(evidence),
    ]
    write_markdown(
        Document("Beyond the paper: exact physics in the loop", _lead(evidence), made), target / "beyond.md"
    )
    known = metrics(evidence)
    write_json(target / "beyond" / "metrics.json", known)
    tracker.log_artifact(target / "beyond.md", "report")
    tracker.log_metrics(known)


def metrics(evidence: Evidence) -> dict[str, float]:
    """The numbers that a later run is compared by."""
    names = dict.fromkeys(name for name, _ in plan_beyond.pools(evidence.task))
    summary = beyond_goals.Summary(evidence)
    keys = ("success", "condition", "distance", "rank", "stack", "covariance_norm", "nmse", "nmse_weighted")
    return {
        f"{name}.{key}": value for name in names for key, value in summary.of(name).items() if key in keys
    }


def _lead(evidence: Evidence) -> str:
    cfg = evidence.task.cfg
    return (
        "The paper trains its generator against surrogates, because its physics was not differentiable. Here "
        "the exact condition number of YᵀY and the exact constraints of what is generated flow back into the "
        "generator: `exact` from the arm and its workspace alone, `exact_together` rewarded for what 32 of "
        "them tell together too, `exact_adversarial` against the seeds. "
        f"Beside them stand the surrogate variants, {cfg.seeds.count} optimised seeds, and random valid "
        "trajectories. This page is generated from artifacts; no number in it is typed. "
        f"Robot: {evidence.task.arm.name}."
    )
