"""One recipe on several arms: each generator compared with its arm's seeds, and tried on other arms."""

from collections.abc import Collection, Mapping
from pathlib import Path

import pandas as pd

from experiments import tables
from experiments.artifacts import Artifacts
from experiments.pages import DOCS, FOLDER, leave, target_of
from experiments.sets import sort_sets
from sidegan.base.names import plain
from sidegan.errors import ConfigError
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages.measures import variations
from sidegan.pipeline.stages.selection import SEEDS
from sidegan.pipeline.tracking import Tracker
from sidegan.report.document import write_page
from sidegan.report.export import read_tables

NAME = "generality"  # of the page and its template
FULL = "paper"  # scale of the reproduction that the published page belongs to
_TRIED = 200  # trajectories of an arm to try on another
_BASELINES = ("natural", "search-10", "search-160")
_ARMS = "Generators and baselines; all but valid share and cosine relative to the arm's own seeds"
_TRANSFER = (
    f"Share of up to {_TRIED} trajectories generated for an arm that are valid on others with as many joints"
)
VALID, COSINE = "valid", "mean cosine"
# Of a generator or baseline relative to the seeds of its arm; an error is the inverse of a gain.
_OVER = {
    "condition": "cond(YᵀY)",
    "distance": "mean distance",
    "rank_uncentred": "uncentred rank",
    "gain": "error, the paper's noise",
    "gain_geometric": "… geometric",
    "gain_constant": "error, constant noise",
    "gain_constant_geometric": "… geometric, constant",
}
JUDGED = _OVER["distance"], _OVER["gain_geometric"]

Arms = Mapping[str, Artifacts]


def check(run: RunContext) -> None:
    """Refuse variants of which none has features, whose trajectories would be tried on other arms."""
    if not any(variant.features for variant in run.cfg.gan.values()):
        raise ConfigError("generality compares generators with surrogates: gan=eigen, for example")


def collect(run: RunContext) -> dict[str, Artifacts]:
    """Artifacts of every arm, by the arm's name in the settings."""
    return {name: Artifacts(arm_run) for name, arm_run in variations(run).items()}


def present(arms: Arms, folder: Path, tracker: Tracker) -> None:
    """Print, write and record the tables of arms, and the page."""
    first = next(iter(arms.values())).cfg
    numbers = {name: beside_seeds(results.generators, first.gan) for name, results in arms.items()}
    joined = pd.concat(numbers, names=["arm"])
    shown = {
        "arms": (joined.map(plain, na_action="ignore").reset_index(level="generator"), _ARMS),
        "transfer": (transfer(arms).map(plain, na_action="ignore"), _TRANSFER),
    }
    rows = joined.set_axis([f"{arm} {name}" for arm, name in joined.index])
    leave(folder, tracker, shown, rows)
    target = target_of(NAME, first.publish, folder)
    template = FOLDER / "templates" / f"{NAME}.md.j2"
    context = {"arms": arms, "cfg": first, "captions": {"arms": _ARMS, "transfer": _TRANSFER}}
    write_page(template, target, {name: table for name, (table, _) in shown.items()}, {}, **context)
    tracker.log_artifact(target, "report")


def beside_seeds(frame: pd.DataFrame, trained: Collection[str]) -> pd.DataFrame:
    """Valid share and cosine of generators and baselines, other metrics relative to the seeds; means."""
    rows = frame.assign(valid=tables.valid_share(frame))
    means = rows[["name", VALID, "cosine", *_OVER]].set_index("name").astype(float)
    means = means.groupby(level=0, sort=False).mean()
    over = means[[*_OVER]] / means.loc[SEEDS, [*_OVER]]
    gains = [name for name in _OVER if name.startswith("gain")]
    over[gains] = 1 / means[gains]
    table = pd.concat(
        [means[[VALID]], means[["cosine"]].set_axis([COSINE], axis=1), over.rename(columns=_OVER)], axis=1
    )
    order = [name for name in sort_sets(means.index) if name in (SEEDS, *_BASELINES, *trained)]
    return table.loc[order].rename_axis("generator")


def of_arms(run: RunContext) -> pd.DataFrame | None:
    """The published numbers by arm and generator; None where the page says nothing about a run."""
    table = _published("arm", run)
    return None if table is None else table.set_index(["arm", "generator"]).astype(float)


def of_others(run: RunContext) -> pd.Series | None:
    """Published valid shares of an arm's trajectories on another arm.

    None as in ``of_arms``, and where no two arms have as many joints.
    """
    table = _published("generated for", run)
    if table is None:
        return None
    long = table.melt("generated for", var_name="on").dropna()
    others = long[long["on"] != long["generated for"]].value.astype(float)
    return None if others.empty else others


def _published(first: str, run: RunContext) -> pd.DataFrame | None:
    """The last table of the published page whose first column has this name.

    None without the page, and for runs that it says nothing about: at another scale than the paper's, or of
    another arm than the first of the page, with which the others are compared.
    """
    path = DOCS / f"{NAME}.md"
    if run.cfg.scale["name"] != FULL or not path.exists():
        return None
    tables = read_tables(path.read_text(encoding="utf-8"))
    table = next((table for table in reversed(tables) if table.columns[0] == first), None)
    return None if table is None or table.iloc[0, 0] != run.cell.arm.name else table


def transfer(arms: Arms) -> pd.DataFrame:
    """Valid share of each arm's generated trajectories on all arms with as many joints."""
    rows = {}
    for name, made in arms.items():
        variant = next(key for key, settings in made.cfg.gan.items() if settings.features)
        c = made.generated(variant, made.cfg.trainings[0]).coefficients[:_TRIED]
        cells = {key: results.run.cell for key, results in arms.items()}
        fitting = {key: cell for key, cell in cells.items() if cell.trajectory.shape == c.shape[1:]}
        rows[name] = {key: float(cell.check(c).valid.mean()) for key, cell in fitting.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("generated for")
