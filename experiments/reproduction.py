"""The report on the whole paper: every figure and table beside ours, a verdict for each claim, and why.

No number in it is typed: everything comes from artifacts.
"""

from pathlib import Path

from experiments import sections
from experiments.artifacts import Evidence
from experiments.claims import claims
from sidegan.base.storage import write_json
from sidegan.pipeline.plan import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.document import Claims, Document, Section
from sidegan.report.markdown import write_markdown
from sidegan.report.web import write_html


def collect(task: Task) -> Evidence:
    """Everything that the report needs, from the artifacts."""
    return Evidence(task)


def present(evidence: Evidence, folder: Path, tracker: Tracker) -> None:
    """Write ``reproduction.md``, ``reproduction.html``, tables, figures and metrics; record the page."""
    target = Path(evidence.task.cfg.publish or folder)
    assets = target / "reproduction" / "figures"
    made = [
        sections.figure3(evidence, assets),
        sections.table1(evidence, assets),
        sections.table2(evidence, assets),
        sections.discussion(evidence, assets),
        sections.figure2(evidence, assets),
        sections.timing(evidence, assets),
        sections.kinds(evidence, assets),
        sections.sensitivity(evidence, assets),
        sections.ablation(evidence, assets),
        sections.deviations(evidence),
    ]
    judged = claims(evidence)
    verdicts = Section(
        "The paper's claims", [Claims(judged, "Every verdict follows from the numbers beside it.")]
    )
    document = Document("SIDE-GAN, reproduced", _lead(evidence), [verdicts, *made])
    write_markdown(document, target / "reproduction.md")
    write_html(document, target / "reproduction.html")
    known = metrics(evidence)
    write_json(target / "reproduction" / "metrics.json", known)
    tracker.log_artifact(target / "reproduction.html", "report")
    tracker.log_metrics(known)


def metrics(evidence: Evidence) -> dict[str, float]:
    """The numbers that a later run is compared by."""
    known: dict[str, float] = {}
    for name, part in evidence.generators.groupby("name"):
        for key in ("success", "condition", "distance", "rank", "distance_diagonal"):
            if key in part and part[key].notna().all():
                known[f"{name}.{key}"] = float(part[key].mean())
    errors = evidence.errors.groupby(["set", "weighted"], as_index=False).nmse.mean()
    for name, weighted, value in errors.itertuples(index=False):
        known[f"nmse.{name}.{'weighted' if weighted else 'unweighted'}"] = float(value)
    norms = evidence.replication.facts.groupby("set").covariance_norm.mean()
    return known | {f"covariance.{name}": float(value) for name, value in norms.items()}


def _lead(evidence: Evidence) -> str:
    cfg = evidence.task.cfg
    return (
        "Jegorova et al., *Adversarial generation of informative trajectories for dynamics system "
        f"identification* (IROS 2020), at its own scale: {cfg.seeds.count} seeds, {cfg.scale.gan_epochs} "
        f"epochs, {len(cfg.trainings)} trainings of each variant, {cfg.library.count} valid trajectories "
        "of each. "
        "This page is generated from the artifacts of `dvc repro`; no number in it is typed. "
        f"Robot: {evidence.task.arm.name}."
    )
