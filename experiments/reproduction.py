"""The report on the whole paper: its figures and tables next to ours, and a verdict on each claim."""

import os
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments import claims, exp1, exp2, figures, generality, tables, training
from experiments.artifacts import Artifacts, comparison
from experiments.pages import COLUMNS, DOCS, FOLDER, PAPER, target_of
from experiments.sets import SEEDS_ORIGIN, colours, title
from experiments.verdicts import CONFIDENCE, GANS, UNKNOWN
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages.baselines import long_family
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import SEEDS
from sidegan.pipeline.stages.training import generator, generators, surrogate_networks
from sidegan.pipeline.tracking import Tracker
from sidegan.report import export, motion
from sidegan.report.document import write_page
from sidegan.report.motion import Bundle
from sidegan.report.tables import formatted

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

NAME = "reproduction"  # of the page, its template, and the folder of its tables and figures
_ON_BOX = 1e-3  # share of the largest coefficient
_AT_LIMIT = 0.01  # rad
_TRACES = 8  # generated trajectories, as in the paper's figure 2

# tables over all conditions
_JOINED = ["generators", "likeness", "draws", "table1", "factors"]
_JOINED += ["table2", "table2_weighted", "readings", "table3", "density"]

Conditions = Mapping[str, Artifacts]

collect = comparison


def check(run: RunContext) -> None:
    """Refuse conditions that are unknown, the same, or leave verdicts without numbers, before any work."""
    seen: dict[str, str] = {}  # names of conditions by their settings
    for name, made in comparison(run).items():
        same = seen.setdefault(str(made.cfg.plain() | {"condition": None, "conditions": None}), name)
        if same != name:
            raise ConfigError(f"conditions {same} and {name} have the same settings: is seed set for both?")
        if missing := set(GANS) - made.cfg.gan.keys():
            expected = f"the page compares {', '.join(GANS)}"
            raise ConfigError(f"condition {name} does not train {', '.join(sorted(missing))}; {expected}")
        if made.cfg.identification.noise.state:
            raise ConfigError(
                "identification.noise.state is true: verdicts need expected errors, which have a closed form "
                "only with exact states"
            )


def present(conditions: Conditions, folder: Path, tracker: Tracker) -> None:
    """Write ``reproduction.md``, its tables, figures and metrics; record the page."""
    first = next(iter(conditions.values()))
    judged = claims.claims(conditions)
    target = target_of(NAME, first.cfg.publish, folder)
    template = FOLDER / "templates" / f"{NAME}.md.j2"
    shown = _all_tables(conditions, judged)
    numbers = metrics(conditions)
    drawn = {
        f"{name}-{key}": figure for name, made in conditions.items() for key, figure in _figures(made).items()
    }
    write_page(template, target, shown, drawn, **_context(conditions, judged, target))
    tracker.log_artifact(target, "report")
    for name, table in shown.items():
        text = table.reset_index().astype(str)
        tracker.log_table(text, name)
        tracker.log_note(f"**{name}**\n\n{export.markdown(text)}")
    for name, row in numbers.items():
        write_json(target.with_suffix("") / "metrics" / f"{name}.json", row)
        tracker.log_metrics({f"{name}/{key}": x for key, x in row.items()})


def _context(conditions: Conditions, judged: list[claims.Claim], target: Path) -> dict[str, Any]:
    """Values for the template, apart from tables and figures."""
    artifacts = next(iter(conditions.values()))
    checked: dict[str, list[str]] = {}  # definitions of valid, each with the conditions that use it
    for name, made in conditions.items():
        checked.setdefault(made.run.cell.constraints.described(), []).append(name)
    return {
        "docs": Path(os.path.relpath(DOCS, target.parent.resolve())),
        "generality": generality.of_arms(artifacts.run) is not None,
        "conditions": conditions,
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "paper": PAPER,
        "confidence": CONFIDENCE,
        "described": {name: described(made) for name, made in conditions.items()},
        "checked": checked,
        "readings": exp2.READINGS,
        "searched": training.SEARCHED,
        "plants": {name: exp1.on_plants(made.plant, made.cfg.gan) for name, made in conditions.items()},
        "verdicts": {name: _verdicts(judged, name) for name in conditions},
        "confirmed": {
            name: claims.confirmed(judged, next(iter(conditions)), name) for name in list(conditions)[1:]
        },
    }


def _verdicts(judged: list[claims.Claim], condition: str) -> str:
    """Text on how many claims hold under a condition, of all and of each kind."""
    kinds: dict[str, list[str]] = {}
    for claim in judged:
        kinds.setdefault(claim.kind, []).append(claim.findings[condition].verdict)
    parts = [f"{kind} ({len(found)}): {claims.totals(found)}" for kind, found in kinds.items()]
    return f"{claims.totals(chain(*kinds.values()))}. {'; '.join(parts)}"


def described(artifacts: Artifacts) -> str:
    """Sentence on the seeds, the recipe and the random numbers of a condition."""
    seeds = SEEDS_ORIGIN[artifacts.cfg.seeds.method]
    shipped = getattr(artifacts.cfg.surrogates, "shipped", None)  # only in the published recipe
    surrogates = "shipped" if shipped else "retrained"
    recipe = "our recipe" if shipped is None else f"their recipe, surrogates {surrogates}"
    random = f"random numbers of `seed={artifacts.cfg.seed}`"
    return f"{artifacts.seeds['count']:.0f} seeds {seeds}, {recipe}, {random}."


def metrics(conditions: Conditions) -> dict[str, dict[str, float]]:
    """Numbers to compare later runs by, for the seeds and every variant, mean over trainings."""
    rows = {}
    for condition, made in conditions.items():
        nmse = made.errors[~made.errors.weighted].groupby("set").nmse.mean()
        norms = made.whole_facts.groupby("set").covariance_norm.mean().rename({"seeds ×1": SEEDS})
        for name, mean in training.means(made.generators).to_dict("index").items():
            identified = {"nMSE": nmse, "‖diag P‖ [1e-9]": 1e9 * norms}
            row = mean | {key: x.get(str(name), np.nan) for key, x in identified.items()}
            rows[f"{condition}-{name}"] = {
                str(k): float(f"{x:.4g}") for k, x in row.items() if np.isfinite(x)
            }
    return rows


def _all_tables(conditions: Conditions, judged: list[claims.Claim]) -> dict[str, pd.DataFrame]:
    """The page's tables, shown or linked, by name."""
    tables_of = {name: _tables(made) for name, made in conditions.items()}
    seeds = pd.DataFrame({name: _seed_facts(made) for name, made in conditions.items()}).T
    return {
        "claims": claims.table(judged),
        "findings": claims.findings(judged),
        "seeds": _once(formatted(seeds, COLUMNS["seeds"]).rename_axis("condition")),
        **{key: _joined(key, tables_of) for key in _JOINED},
        **{f"{name}-{key}": table for name, shown in tables_of.items() for key, table in shown.items()},
    }


def _joined(key: str, tables_of: Mapping[str, Mapping[str, pd.DataFrame]]) -> pd.DataFrame:
    """A table over all conditions, with the paper's rows once at the end."""
    parts = {name: shown[key] for name, shown in tables_of.items()}
    of_paper = {name: part.index.astype(str).str.startswith("Paper") for name, part in parts.items()}
    ours = {name: part[~of_paper[name]] for name, part in parts.items()}
    joined = _once(pd.concat(ours, names=["condition"]))
    first, part = next(iter(parts.items()))
    paper = part[of_paper[first]]
    index = pd.MultiIndex.from_product([["paper"], paper.index], names=joined.index.names)
    return pd.concat([joined, paper.set_axis(index)]).fillna("—")


def _once(joined: pd.DataFrame) -> pd.DataFrame:
    """The table with a single row, of the condition ``all``, where all conditions have the same."""
    names = joined.index.names
    rows = joined.reset_index()
    same = [key for key in rows.columns if key != "condition"]
    shared = rows.groupby(same, dropna=False).condition.transform("size") == rows.condition.nunique()
    if rows.condition.nunique() > 1:
        rows["condition"] = rows.condition.mask(shared, "all")
    return rows.drop_duplicates().set_index(names)


def _tables(made: Artifacts) -> dict[str, pd.DataFrame]:
    """The tables of a condition, by name."""
    longs = {f"{name.removeprefix('long-')} harmonics": dict(x) for name, (x, _) in made.longs.items()}
    searches = formatted(pd.DataFrame(longs).T, COLUMNS["long"], UNKNOWN)
    shown = {
        "generators": tables.generator_table(made.generators),
        "likeness": tables.likeness_table(made.generators),
        "draws": exp1.draws(made.draws),
        "epochs": training.speed(made.histories),
        "sizes": training.sizes(made.subsets),
        "table1": exp1.table1(made.errors, made.plant, made.expected, made.constant),
        "factors": exp1.factors(made.errors, made.expected, made.plant, made.cfg.gan),
        "sets": tables.excitation_table(made.errors),
        "long": searches.rename_axis("single long trajectory"),
        "readings": exp2.readings(made),
        "table3": exp2.table3(made.whole_facts),
        "whole": exp2.errors(made.whole_errors),
        "searches": training.searched(made),
        "density": formatted(made.density, COLUMNS["density"]).set_index("bandwidth [Scott's]"),
        "timing": _timing(made),
    }
    return shown | {name: table for name, (table, _) in exp2.tables2(made.whole_errors, made.cfg).items()}


def _seed_facts(artifacts: Artifacts) -> dict[str, float]:
    """Numbers that characterise a seed set."""
    library = artifacts.run.load(seed_set(artifacts.run))
    c = library.coefficients
    margin = library.margins["position"]
    on_box = np.abs(c) > (1 - _ON_BOX) * np.abs(c).max()
    lower, middle, upper = np.quantile(library.fitness, [0.25, 0.5, 0.75])
    kept = ("count", "diagonal_ratio", "distance", "rank")
    return {key: float(artifacts.seeds[key]) for key in kept} | {
        "condition": middle,
        "lower": lower,
        "upper": upper,
        "mean": float(np.abs(c).mean()),
        "a_on_box": float(on_box[..., 0].mean()),
        "b_on_box": float(on_box[..., 1].mean()),
        "at_limit": float((margin < _AT_LIMIT).mean()),
        "seconds": artifacts.seed_seconds,
    }


def _timing(artifacts: Artifacts) -> pd.DataFrame:
    """Table of the times in the paper's text, and ours."""
    speed, run, seed = artifacts.speed, artifacts.run, artifacts.seed_seconds
    trainings = [artifacts.costs(generator(run, *one))["cpu_seconds"] for one in generators(run)]
    long = max(report["cpu_seconds"] for report, _ in artifacts.longs.values())
    rows = {
        "long": ("the single long trajectory, CPU", long),
        "seed": ("one seed, CPU", seed),
        "seeds": ("the seed set, CPU", seed * run.cfg.seeds.count),
        "surrogates": ("the surrogates, CPU", artifacts.costs(surrogate_networks(run))["cpu_seconds"]),
        "training": ("one training, CPU", float(np.mean(trainings))),
        "generation": ("one generated trajectory", speed["generation_seconds"]),
        "checked": ("one valid trajectory, checked", artifacts.valid_seconds),
    }
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=["what", "ours"])
    frame["paper"] = pd.Series(PAPER["seconds"], dtype=float)
    table = formatted(frame.assign(ratio=frame.paper / frame.ours), COLUMNS["timing"])
    ours = COLUMNS["timing"]["ours"][0]
    return table.assign(**{ours: table[ours].replace("—", UNKNOWN)}).set_index("what")


def _figures(made: Artifacts) -> dict[str, "Figure"]:
    """The figures of a condition, by name; the last two are of motion in space."""
    eigen = made.generators[made.generators.name == "eigen"]
    union = {key: float(eigen[f"union_{key}"].mean()) for key in ("distance", "distance_diagonal")}
    arm, family = made.run.cell.arm, made.run.cell.trajectory
    first = made.cfg.trainings[0]
    generated = made.generated("eigen", first).coefficients[:_TRACES]
    traces = [Bundle(f"trajectory {k + 1}", family, c[None]) for k, c in enumerate(generated)]
    longs = zip(made.cfg.long.harmonics, made.longs.items())
    sets = {name: (long_family(made.run, h), library.coefficients) for h, (name, (_, library)) in longs}
    for name in (SEEDS, "eigen"):
        sets[name] = family, made.selected(name, first).coefficients
    stacked = []
    for (name, (kind, c)), shade in zip(sets.items(), colours(sets)):
        size = f"{kind.period:.4g} s" if len(c) == 1 else f"{len(c)} × {kind.period:.4g} s"
        stacked.append(Bundle(f"{title(name)}\n{size}", kind, c, shade))
    return {
        "training": training.figure(made.histories, made.as_many_seeds, union),
        "nmse": figures.errors(made.errors),
        **training.pictures(made),
        "traces": motion.paths(arm, traces),
        "stacked": motion.paths(arm, stacked),
    }
