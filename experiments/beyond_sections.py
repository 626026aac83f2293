"""The sections of the page on exact physics, each from the evidence alone."""

from pathlib import Path

import pandas as pd

from experiments import beyond_goals, beyond_tables
from experiments.beyond_evidence import GOOD, NEAR, Evidence
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.plan import RANDOM, SEEDS
from sidegan.report.document import Block, Section, Table, illustrate
from sidegan.report.export import write_table
from sidegan.report.panels import Panel, panels

_SHARE = "success"
_CROWDED = 1.2  # wall time over CPU time, from which on it is told
_METRICS = {
    "success": ("valid share without filtering", False),
    "condition": ("median cond(YᵀY)", True),
    "distance": ("mean distance of coefficients", False),
    "rank": ("effective rank of coefficients", False),
}


def goals(evidence: Evidence, assets: Path) -> Section:
    """The goals, met or not."""
    task = evidence.task
    alone = [name for name, settings in task.cfg.gan.items() if not settings.seeded]
    found = {name: beyond_goals.goals(evidence, name) for name in [*alone, plan_beyond.POLISHED]}
    met = [
        f"{sum(goal.met for goal in judged)} of {len(judged)} are met by {beyond_tables.title(name)}"
        for name, judged in found.items()
    ]
    words = (
        f"{'; '.join(met)} ({task.cfg.beyond.finish} gradient steps on each of {task.cfg.seeds.count} "
        "generated ones); all by the mean over trainings."
    )
    words += (
        f" The seeds keep {task.cfg.seeds.reserve or 0:.0%} of every limit free, so that what learns from "
        "them stays valid, and exact variants use nearly all: part of what they gain is that. The rows of "
        f"trajectories optimised with {task.cfg.beyond.reserve:.0%} of reserve tell how much."
    )
    frame = beyond_goals.table(found)
    return Section(
        "Goals for exact physics",
        [words, _table(assets, "goals", frame, "Mean ± standard deviation over trainings")],
    )


def quality(evidence: Evidence, assets: Path) -> Section:
    """What each way makes, and how its training went."""
    task = evidence.task
    count = min(task.cfg.scale.evaluation, task.cfg.seeds.count, task.cfg.library.count)
    caption = (
        "Valid share of all that is drawn or started; the rest of at most "
        f"{task.cfg.scale.evaluation} valid ones of each ({count} of the seeds). Best: of the whole pool"
    )
    seeds = evidence.pools[evidence.pools.name == SEEDS].iloc[0]
    wanted = [
        Panel(key, label, log, {SEEDS: float(seeds[key])}, key == _SHARE)
        for key, (label, log) in _METRICS.items()
    ]
    drawn = panels(
        evidence.progress,
        "seconds",
        wanted,
        "variant",
        "training",
        x_label="seconds from nothing",
        log_x=True,
    )
    words = (
        "Time from nothing: seeds and surrogates come before the trainings that need them. Wall times as "
        "recorded when the artifacts were made, each training on one core of this machine; of the exact "
        "variants CPU times." + _crowded(evidence)
    )
    return Section(
        "What each way makes",
        [
            _table(assets, "pools", beyond_tables.pools(evidence), caption),
            words,
            illustrate(
                assets,
                "progress",
                drawn,
                "True physics after every epoch, a line for each training; dashed, the optimised seeds",
            ),
        ],
    )


def _crowded(evidence: Evidence) -> str:
    """How much longer trainings took than they would alone, where that is known and much."""
    known = evidence.first.dropna(subset=["cpu"])
    ratio = float((known.wall / known.cpu).mean()) if len(known) else 1.0
    if ratio < _CROWDED:
        return ""
    return f" Other work ran beside those: they took {ratio:.1f} × as long."


def first(evidence: Evidence, assets: Path) -> Section:
    """How long the first set takes."""
    count = evidence.task.cfg.selection.count
    caption = (
        "Seeds, surrogates (with the vanilla GAN that they learn from) and training in wall time as "
        "recorded, the set itself in CPU time of one core. Training, CPU: what it takes where nothing else "
        "runs, from the time of some of its steps; where it is known, it is what counts. One more: a further "
        "valid trajectory, drawn and checked"
    )
    return Section(
        f"Seconds to the first {count} valid trajectories",
        [
            f"Everything from nothing. The optimiser makes {count} seeds and no more in the row of optimised "
            "seeds, and in that with little reserve; the variants that learn from seeds learn from all.",
            _table(assets, "first", beyond_tables.first(evidence), caption),
        ],
    )


def best(evidence: Evidence, assets: Path) -> Section:
    """What the best set of each pool is worth."""
    cfg = evidence.task.cfg
    blocks: list[Block] = [
        f"{cfg.selection.count} trajectories of each pool alone: {cfg.library.count} valid ones of each "
        f"generator and at random, {cfg.seeds.count} seeds and polished ones. Identified with the noise of "
        f"Table I, {cfg.beyond.repeats} draws of it each. Energy is ∫ Σ |τ dq| per trajectory, peak velocity "
        "the largest share of a joint's limit, means over the set."
    ]
    for pick, words in (
        (plan_beyond.OPTIMAL, "D-optimal pick"),
        (plan_beyond.GREEDY, "the paper's greedy pick"),
    ):
        frame = beyond_tables.best(evidence, pick)
        blocks.append(_table(assets, f"best_{pick.replace('-', '_')}", frame, f"The best set, {words}"))
    return Section(f"The best {cfg.selection.count}", blocks)


def polish(evidence: Evidence, assets: Path) -> Section:
    """What further gradient steps bring."""
    frame = evidence.polish
    name = "Polish: gradient steps on generated trajectories"
    if frame is None:
        return _missing(name, "polish")
    shown = frame.assign(milliseconds=1000 * frame.seconds, run=0)
    wanted = [Panel(key, label, log, share=key == _SHARE) for key, (label, log) in _METRICS.items()]
    drawn = panels(
        shown,
        "milliseconds",
        wanted,
        "start",
        "run",
        x_label="CPU time per valid trajectory [ms]",
        log_x=True,
        markers=True,
    )
    source = evidence.task.cfg.beyond.source
    return Section(
        name,
        [
            f"{evidence.task.cfg.beyond.polished} samples of `{source}`, and as many random starts of the "
            "seeds' optimiser with the same reserve. " + _polish_words(frame, source),
            illustrate(
                assets, "polish", drawn, f"Quality against cost: from `{source}`, and from random starts"
            ),
            _table(assets, "polish", beyond_tables.polish(frame), "The same"),
        ],
    )


def _polish_words(frame: pd.DataFrame, source: str) -> str:
    """How many milliseconds each start needs to the best that the other reaches at half its cost or less."""
    ours, theirs = (frame[frame.start == name].dropna(subset=["condition"]) for name in (source, RANDOM))
    if ours.empty or theirs.empty:
        return ""
    end = ours.sort_values("condition").iloc[0]
    level = float(end.condition)
    there = theirs[theirs.condition <= level]
    text = f"From `{source}`, {end.steps:g} steps reach a median of {level:.4g} "
    text += f"at {1000 * end.seconds:.3g} ms each; "
    if there.empty:
        return text + f"random starts reach {theirs.condition.min():.4g} at best."
    least = there.sort_values("seconds").iloc[0]
    return text + f"random starts reach {least.condition:.4g} at {1000 * least.seconds:.3g} ms."


def objectives(evidence: Evidence, assets: Path) -> Section:
    """Other objectives, of one trajectory and of sets."""
    name, frame = "Objectives", evidence.objectives
    if frame is None:
        return _missing(name, "objectives")
    wanted = evidence.task.cfg.objectives
    steps = {x.epochs * (x.steps or 1) for x in wanted.values()}
    words = (
        f"One training each of {', '.join(map(str, sorted(steps)))} steps, fewer than `exact` has: `brief` "
        "is the log condition number of each trajectory, as in `exact`; `determinant` D-optimality of each, "
        "`set` that of sixteen together, `variance` A-optimality of each, `diagonal` the ratio of its "
        "diagonal. "
    )
    return Section(
        name,
        [
            words + _objective_words(frame, evidence.best),
            _table(
                assets,
                "objectives",
                beyond_tables.objectives(frame),
                f"What each objective makes, and its best {evidence.task.cfg.selection.count}",
            ),
        ],
    )


def _objective_words(frame: pd.DataFrame, best: pd.DataFrame) -> str:
    """Which objective is best at what, and whether that is more than any other set of the page has."""
    others = best[best.pick == plan_beyond.OPTIMAL].groupby("name").log_det.mean()
    part = frame[frame.pick == plan_beyond.OPTIMAL].set_index("name")
    winners = {
        "smallest stacked condition number": part.condition.idxmin(),
        "largest log determinant": part.log_det.idxmax(),
        "smallest covariance norm": part.covariance_norm.idxmin(),
    }
    told = [f"the {what} is that of `{str(name).removeprefix('exact_')}`" for what, name in winners.items()]
    text = "By D-optimal pick, " + ", ".join(told) + ". "
    return text + (
        f"Of the pools above, the largest log determinant is {others.max():.4g} "
        f"({beyond_tables.title(str(others.idxmax()))}), against {part.log_det.max():.4g} here."
    )


def few(evidence: Evidence, assets: Path) -> Section:
    """How few seeds suffice."""
    name, frame = "How few seeds suffice", evidence.few
    if frame.empty:
        return _missing(name, "few_seeds")
    frame = frame.sort_values("seeds")
    wanted = [Panel(key, label, log, share=key == _SHARE) for key, (label, log) in _METRICS.items()]
    drawn = panels(frame, "seeds", wanted, "variant", "training", x_label="seeds", log_x=True, markers=True)
    sizes = {str(n): sorted(part.seeds.unique()) for n, part in frame.groupby("variant", sort=False)}
    told = "; ".join(f"`{n}` on {', '.join(map(str, known))}" for n, known in sizes.items())
    return Section(
        name,
        [
            f"Trained: {told}. Other sizes and variants were not. `exact` learns from none.",
            illustrate(assets, "few", drawn, "After the last epoch, against the number of seeds"),
            _table(
                assets, "few", beyond_tables.few(frame), "The same, mean ± standard deviation over trainings"
            ),
        ],
    )


def transfers(evidence: Evidence, assets: Path) -> Section:
    """From one arm, tool or desk to another."""
    name, frame = "Transfer", evidence.transfers
    if frame.empty:
        return _missing(name, "transfer")
    cfg = evidence.task.cfg.beyond
    blocks: list[Block] = [
        f"`{cfg.source}` for the {evidence.task.arm.name} goes on training elsewhere, beside trainings "
        f"from scratch: of {cfg.epochs * cfg.epoch} steps, and of {cfg.share:.0%} of that (`brief`), which "
        f"is what a transfer gets too, after the {_steps(evidence)} steps of its source. Another arm has the "
        "kinematics and limits that the Panda's maker publishes, and masses and shapes of about its size "
        "that are ours; a tool is a payload at the tip, which changes torques and no regressor; "
        f"a higher desk keeps the arm further away from it ({_targets(evidence)}). The same quality: "
        f"{GOOD:.0%} valid and a median within {NEAR - 1:.0%} of where the training from scratch ends.",
        _table(
            assets, "transfer", beyond_tables.transfers(frame), "Each way for each target, one training each"
        ),
    ]
    for target, part in frame.groupby("target", sort=False):
        shown = part[part.steps > 0].assign(run=0)
        wanted = [
            Panel(key, label, log, share=key == _SHARE) for key, (label, log) in list(_METRICS.items())[:2]
        ]
        drawn = panels(shown, "steps", wanted, "way", "run", x_label="steps", log_x=True)
        words = f"Training for {beyond_tables.called(str(target))}"
        blocks.append(illustrate(assets, f"transfer-{target}", drawn, words))
    return Section(name, blocks)


def _steps(evidence: Evidence) -> int:
    """Steps of the source's training."""
    settings = evidence.task.cfg.gan[plan_beyond.source(evidence.task)]
    return settings.epochs * (settings.steps or 1)


def _targets(evidence: Evidence) -> str:
    told = []
    for name, target in evidence.task.cfg.beyond.targets.items():
        told += [f"{beyond_tables.called(name)}: {target.payload:g} kg"] if target.payload else []
        told += [f"{beyond_tables.called(name)}: {target.desk:g} m"] if target.desk is not None else []
    return ", ".join(told)


def choices(evidence: Evidence) -> Section:
    """For whom each way is the right choice."""
    fixed = [
        "- **No description of the arm, or constraints that cannot be computed**: the surrogate variants. "
        "They learn from examples what is valid and what excites; exact physics needs the URDF.",
        "- **Trajectories like those that are there** (a house style, a certified family): "
        "`exact_adversarial`, whose discriminators see the seeds.",
    ]
    return Section(
        "For whom each is the right choice", ["\n".join([*beyond_goals.choices(evidence), *fixed])]
    )


def method(evidence: Evidence) -> Section:
    """How the page came about."""
    cfg = evidence.task.cfg
    return Section(
        "How this page was made",
        [
            "```\npython -m sidegan.pipeline.run +experiment=beyond scale=paper publish=docs\n```\n\n"
            f"{len(cfg.trainings)} trainings of each variant share the seeds and the surrogates. Objectives, "
            "few seeds and transfer are single trainings, so that small differences there mean nothing. "
            "Everything runs on the model: no torque was measured on a real arm."
        ],
    )


def _missing(name: str, stage: str) -> Section:
    return Section(name, [f"Not run for this page: stage `{stage}` makes it."])


def _table(assets: Path, name: str, frame: pd.DataFrame, caption: str) -> Table:
    """A table of the page that is also a file."""
    write_table(frame, assets.with_name("tables") / name, caption)
    return Table(frame, caption)
