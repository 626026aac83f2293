"""The command ``python -m benchmarks.loop``: what a closed loop saves, as the page docs/loop.md.

Plants in MuJoCo are identified after each trajectory. Some ways to choose the next one listen to what is
known by then, others were fixed before. What counts is the motion until the wanted standard
deviation is reached.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
import yaml

from sidegan.base.storage import write_bytes
from sidegan.base.typed import build
from sidegan.design.information import information_of
from sidegan.design.optimal import d_optimal
from sidegan.design.prediction import Prediction
from sidegan.designer import Designer, DesignerSettings, begin_designed
from sidegan.identification import TorqueModel
from sidegan.motion.trajectory import Motion
from sidegan.pipeline.run import CONF, composed
from sidegan.pipeline.stages.worth import constraints
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.plant.varied import VariedPlant
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.seeds import Gradient
from sidegan.worth import Judge, Truth, WorthSettings, legs
from sidegan.worth.contenders import aim_of, exact, make_set
from sidegan.worth.intervals import true_parameters
from sidegan.worth.loop import Designed, Listed, Picked, Predicted, Way, closed
from sidegan.worth.orders import Order
from sidegan.worth.session import Session

FIXED, RANDOM, POOL = "a fixed set, D-optimal (excite's)", "random", "D-optimal from a pool"
DESIGNED, ASKED = "the designer, log det", "the designer, σ on the tasks"
VARIANCE, PREDICTED = "a set's search, σ on the tasks", "prediction"
WAYS = (RANDOM, FIXED, POOL, DESIGNED, ASKED, VARIANCE, PREDICTED)
REGIMES = ("noise", "misfit")
_FOLDER = Path("docs")
_PERIOD, _HARMONICS = 8.0, 6  # of every trajectory [s]
_EVALUATIONS = 120  # of the designer for each
_STEPS, _RESERVE = 60, 0.05  # evaluations of each of the pool's, share of limits kept free
_POOL = 4  # times as many as are executed
_MOVES = 6  # held-out tasks of each kind
_TARGETS = (0.0075, 0.005)  # standard deviations of torque on tasks, as shares of it
_SEED = 7


@dataclass(frozen=True)
class Study:
    """Plants, and the ways that are compared on them."""

    arm: str
    plants: int
    count: int  # trajectories that each executes
    regimes: tuple[str, ...] = REGIMES
    scale: str = "quick"

    @cached_property
    def task(self) -> Task:
        """The settings of the study of motions, for this arm."""
        overrides = ["+experiment=worth", f"scale={self.scale}", f"robot={self.arm}", "tracking=off"]
        overrides += ["workspace=free"] if self.arm.startswith("planar") else []
        cfg = composed(*overrides)
        return Task(cfg, Store(Path(cfg.outputs)))

    @property
    def settings(self) -> WorthSettings:
        """Plants, sensors, tasks and what is identified."""
        return self.task.cfg.worth

    @cached_property
    def judge(self) -> Judge:
        """Who identifies the plants."""
        return Judge(self.settings, TorqueModel(self.order(0).constraints.body, self.settings.model))

    @cached_property
    def place(self) -> Any:
        """The arm in its workspace, accelerations limited."""
        return constraints(self.task)

    def order(self, number: int) -> Order:
        """What random sets are made for, and what is known of the tasks; for one plant."""
        one = next(x for x in self.settings.contenders.values() if x.maker == "random")
        one = replace(one, period=_PERIOD, harmonics=_HARMONICS)
        seed = np.random.SeedSequence([_SEED, number])
        home = tuple(self.task.trajectory.home or ())
        return Order(self.place, home, self.settings, one, self.count, seed)

    @cached_property
    def designer(self) -> Designer:
        """The designer, from random points."""
        values = yaml.safe_load((CONF / "designer" / "default.yaml").read_text(encoding="utf-8"))
        return Designer(self.place, self.order(0).family(), build(DesignerSettings, values))

    @cached_property
    def pool(self) -> torch.Tensor:
        """Trajectories of a small condition number, which excite picks from."""
        method = Gradient(_STEPS, 5, _RESERVE)
        return method.optimise(
            self.order(0).problem(), _POOL * self.count, np.random.SeedSequence(_SEED)
        ).coefficients

    def way(self, name: str, number: int) -> Way:
        """One of the ways, anew for a plant."""
        order, model = self.order(number), self.judge.model
        family = order.family()
        if name == RANDOM:
            return Listed(make_set(order).coefficients)
        if name == FIXED:
            information = information_of(model.body, family, self.pool)
            return Listed(self.pool[d_optimal(information, min(self.count, len(self.pool)))])
        if name == POOL:
            return Picked(model, family, self.pool)
        if name in (DESIGNED, ASKED):
            return Designed(model, self.designer, _EVALUATIONS, self.tasks if name == ASKED else None)
        search, generator = self.settings.search, order.generator
        if name == VARIANCE:
            return Predicted(order.problem(), aim_of(exact(order), Prediction), search, generator)
        begin = begin_designed(self.settings.designer, self.settings.begun)
        return Predicted(order.problem(), aim_of(order, Prediction), search, generator, begin)

    @cached_property
    def tasks(self) -> torch.Tensor:
        """Mean YᵀY over squared torques of the tasks that are designed for, (P, P)."""
        return aim_of(self.order(0), Prediction).tasks

    @cached_property
    def moves(self) -> list[Motion]:
        """Held-out tasks."""
        random = torch.Generator().manual_seed(_SEED)
        kinds = [replace(one, count=min(_MOVES, one.count)) for one in self.settings.tasks.values()]
        return [m for one in kinds for m in legs(self.place, one, self.settings.plant.rate, random)]

    @cached_property
    def plants_made(self) -> dict[tuple[int, str], tuple[VariedPlant, Truth]]:
        """Plants that were made already, and what they do on the held-out tasks."""
        return {}

    def plant(self, number: int, regime: str) -> tuple[VariedPlant, Truth]:
        """A plant, and what it does on the held-out tasks."""
        if (number, regime) not in self.plants_made:
            self.plants_made[number, regime] = self._plant(number, regime)
        return self.plants_made[number, regime]

    def _plant(self, number: int, regime: str) -> tuple[VariedPlant, Truth]:
        seed = np.random.SeedSequence([_SEED, number])
        form = self.settings.regimes[regime].form
        made = VariedPlant(self.place.arm, self.settings.plant, form, seed)
        return made, self.judge.truth(made, self.moves)

    def rows(self, number: int, regime: str, name: str) -> list[dict[str, Any]]:
        """What is known of a plant after each trajectory of a way."""
        (plant, truth), model = self.plant(number, regime), self.judge.model
        true = true_parameters(plant, model) if plant.law.form == "linear" else None
        session = Session(self.judge, plant, self.settings.regimes[regime], number)
        family, way = self.order(number).family(), self.way(name, number)
        steps = closed(session, way, family, self.count, self.tasks, truth, true)
        key = {"plant": number, "regime": regime, "way": name, "floor": float(truth.floor())}
        return [key | {k: x for k, x in step._asdict().items() if k != "known"} for step in steps]

    def measure(self, path: Path) -> pd.DataFrame:
        """All rows; what a file has already is not made again, and it is written after each way."""
        frame = pd.read_csv(path) if path.exists() else pd.DataFrame()
        keys = ["plant", "regime", "way"]
        done = set(map(tuple, frame[keys].to_numpy().tolist())) if len(frame) else set()
        for regime, number, way in product(self.regimes, range(self.plants), WAYS):
            if (key := (number, regime, way)) not in done:
                sys.stderr.write(f"plant {key[0]}, {key[1]}, {key[2]} …\n")
                frame = pd.concat([frame, pd.DataFrame(self.rows(*key))], ignore_index=True)
                write_bytes(path, frame.to_csv(index=False, float_format="%.6g").encode())
        asked = frame.plant.isin(range(self.plants)) & frame.regime.isin(self.regimes)
        return frame[asked]


def reached(frame: pd.DataFrame, target: float) -> pd.Series:
    """Seconds of motion until the deviation is at most a target, by regime, way and plant, or infinite."""
    keys = ["regime", "way", "plant"]
    first = frame[frame.deviation <= target].groupby(keys).seconds.min().astype(float)
    everyone = frame.groupby(keys).seconds.max().index
    return first.reindex(everyone, fill_value=np.inf)


def table(frame: pd.DataFrame, regime: str, targets: Sequence[float]) -> pd.DataFrame:
    """A row per way: motion until each target, and what is known half-way and at the end."""
    some, rows = frame[frame.regime == regime], {}
    end = float(some.seconds.max())
    times = [min(some.seconds.unique(), key=lambda t: abs(t - share * end)) for share in (0.5, 1.0)]
    for way in dict.fromkeys(some.way):
        own = some[some.way == way]
        row = {f"s to σ ≤ {100 * target:g} %": _spread(reached(own, target).to_numpy()) for target in targets}
        for time in times:
            at = own[own.seconds == time]
            row[f"σ after {time:g} s [%]"] = f"{100 * at.deviation.median():.3g}"
            row[f"error over the floor after {time:g} s"] = f"{(at.error / at.floor).median():.3g}"
        if own.covered.notna().any():
            row["95 % intervals that hold [%]"] = f"{100 * own.covered.mean():.0f}"
        row["design [CPU s]"] = f"{own.design.median():.2g}"
        rows[way] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("the next trajectory")


def _spread(values: np.ndarray) -> str:
    """The median over plants, and the least and the most."""
    words = [
        f"{x:g}" if np.isfinite(x) else "never"
        for x in (np.quantile(values, 0.5, method="higher"), values.min(), values.max())
    ]
    return words[0] if len(set(words)) == 1 else f"{words[0]} ({words[1]} – {words[2]})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page and its numbers; exit code of the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loop", description=__doc__)
    parser.add_argument("--arm", default="kuka_lwr4", help="a name of conf/robot")
    parser.add_argument("--plants", type=int, default=3, help="randomised plants (default 3)")
    parser.add_argument("--count", type=int, default=12, help="trajectories that each executes (default 12)")
    parser.add_argument("--regimes", nargs="+", default=REGIMES, choices=REGIMES, help="default: both")
    parser.add_argument("--scale", default="quick", help="of the study of motions, whose settings are used")
    parser.add_argument("--folder", type=Path, default=_FOLDER, help="where the page goes")
    parser.add_argument("--kept", action="store_true", help="go on with loop.csv, of the same options")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    numbers = options.folder / "loop.csv"
    study = Study(options.arm, options.plants, options.count, tuple(options.regimes), options.scale)
    if not options.kept:
        numbers.unlink(missing_ok=True)
    frame = study.measure(numbers)
    made = {regime: frame[frame.regime == regime] for regime in frame.regime.unique()}
    judged = {regime: reached(some, _TARGETS[0]) for regime, some in made.items()}
    text = template(Path(__file__).with_name("loop.md.j2")).render(
        options=options,
        plants={regime: some.plant.nunique() for regime, some in made.items()},
        count=int(frame.seconds.max() / _PERIOD),
        period=_PERIOD,
        pool=_POOL,
        evaluations=_EVALUATIONS,
        settings=study.settings,
        tables={regime: markdown(table(frame, regime, _TARGETS).reset_index()) for regime in made},
        first={regime: _ranked(one) for regime, one in judged.items()},
        target=_TARGETS[0],
    )
    write_bytes(options.folder / "loop.md", text.encode())
    return 0


def _ranked(seconds: pd.Series) -> list[tuple[str, float]]:
    """Ways from the soonest on, with their median seconds."""
    medians = seconds.groupby("way").quantile(0.5, interpolation="higher")
    return [(str(way), float(x)) for way, x in medians.sort_values(kind="stable").items()]


if __name__ == "__main__":
    sys.exit(main())
