"""The command ``python -m benchmarks.design``: what the designer is worth, as the page docs/design.md.

Situations are random ones that its library was not made for. Everything runs on one thread and by the CPU's
clock, since a machine is seldom idle; whoever is compared has the same kernels, and none the overhead of
others. What is returned is written at 1 kHz and checked by ``benchmarks.independent``.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from benchmarks import designer as rows
from benchmarks.designer import Bench
from benchmarks.independent import Facts, Robot, check_file
from benchmarks.setting import Setting
from benchmarks.situations import Draw
from sidegan.base.storage import read_json, write_bytes, write_json
from sidegan.controllers import Course, csv_text
from sidegan.design.excitation import excite
from sidegan.designer import Aim, Design, Designer, Generator, Situation, Starts
from sidegan.designer.descent import Penalties
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.validity import Box, Plane

_DEADLINES = (5, 8, 12, 20, 50)  # [ms]
_QUANTILES = (0.1, 0.5, 0.9)
_RATE = 1000.0  # [Hz]
_FOLDER = Path("docs")
_SEED, _MANY_SEED = 999, 77
LIBRARY, GENERATOR, RANDOM = "library, polished", "generator, polished", "random, optimised"
NEAREST, BEST = "nearest of the library, as it is", "best of 16 of the generator, as it is"
COLUMNS = (LIBRARY, GENERATOR, RANDOM, NEAREST, BEST)
_DRAWS = 16
_SHARES = (1.0, 0.93, 0.85, 0.75, 0.6, 0.4)  # of a draw that is made smaller
_KEPT = 0.005  # share of limits, and [m], that is kept free at samples


@dataclass(frozen=True)
class Answered:
    """What came of one question."""

    group: str  # of the situation
    number: int
    who: str
    deadline: int  # [ms]
    condition: float  # infinite where there is no answer
    spent: float  # CPU time [ms]
    design: Design | None

    @property
    def row(self) -> dict[str, Any]:
        """What is kept in the table."""
        return {k: x for k, x in vars(self).items() if k != "design"}


@dataclass(frozen=True)
class Draws:
    """Trajectories of the generator as they are, without a step."""

    bench: Bench

    @cached_property
    def designer(self) -> Designer:
        """Whose kernels and proofs are used."""
        return self.bench.designer(generator=True)

    def best(self, situation: Situation, count: int) -> tuple[float, float]:
        """Condition number of the best that is proven, and the CPU time that took [ms]."""
        began = time.process_time()
        scene, some = self._drawn(situation, count)
        penalties = Penalties(1.0, 0.0, 0.0, 0.0)
        descent, slope = self.designer.descents.descent(scene, Aim(), penalties), np.zeros_like(scene.size)
        goals = [descent.evaluate(self.designer.numbers.points(scene, c), slope)[0] for c in some]
        order = np.argsort(goals, kind="stable")
        proven = (some[k] for k in order if self.designer.prover.prove(scene, some[k]).valid)
        found = next(proven, None)
        spent = 1e3 * (time.process_time() - began)
        return self._condition(scene, found), spent

    def all(self, situation: Situation, settled: bool) -> tuple[float, np.ndarray]:
        """CPU seconds for one of each mode, and their condition numbers, infinite where it is not valid.

        Settled ones are made smaller until they violate nothing at the designer's samples.
        """
        began = time.process_time()
        scene, some = self._drawn(situation, len(self.bench.generator))
        if settled:
            some = self._settled(scene, some)
        taken = time.process_time() - began
        prove = self.designer.prover.prove
        valid = [c if prove(scene, c).valid else None for c in some]
        return taken, np.array([self._condition(scene, c) for c in valid])

    def _settled(self, scene: Scene, some: list[np.ndarray]) -> list[np.ndarray]:
        numbers, slope = self.designer.numbers, np.zeros_like(scene.size)
        descent = self.designer.descents.descent(scene, Aim(), Penalties(1.0, _KEPT, _KEPT, _KEPT))

        def clear(c: np.ndarray) -> bool:
            return descent.evaluate(numbers.points(scene, c), slope)[1] == 0

        smaller = ([share * c for share in _SHARES] for c in some)
        return [next(filter(clear, ways), ways[-1]) for ways in smaller]

    def _drawn(self, situation: Situation, count: int) -> tuple[Scene, list[np.ndarray]]:
        numbers, probes = self.designer.numbers, self.designer.probes
        scene = numbers.scene(situation)
        felt = probes.feel((*numbers.constraints.regions, *situation.regions))
        return scene, self.bench.generator.candidates(numbers, scene, felt, count)

    def _condition(self, scene: Scene, c: np.ndarray | None) -> float:
        if c is None:
            return float("inf")
        family = self.designer.numbers.family(scene)
        coefficients = torch.from_numpy(c).reshape(1, *family.shape)
        return float(excite(self.bench.setting.problem.body, family, coefficients, 100).eigenvalue_fitness[0])


@dataclass(frozen=True)
class Page:
    """The measurements that the page tells."""

    setting: Setting
    count: int  # situations
    most: int  # trajectories that are checked independently, which takes seconds for each

    @cached_property
    def bench(self) -> Bench:
        """The designer and its library."""
        return Bench(self.setting)

    @cached_property
    def situations(self) -> dict[str, list[Situation]]:
        """Situations by group."""
        problem, each = self.setting.problem, max(1, self.count // 8)
        return {
            "mixed": Draw(problem, _SEED).mixed(each),
            "several obstacles": Draw(problem, _MANY_SEED).several(max(1, self.count // 4)),
        }

    @cached_property
    def designers(self) -> dict[str, Designer]:
        """Who answers within a time."""
        bench = self.bench
        made = {
            LIBRARY: bench.designer(),
            GENERATOR: bench.designer(generator=True),
            RANDOM: bench.designer(starts=False),
        }
        for one in made.values():
            one.ask(deadline=0.05)
        return made

    @cached_property
    def answers(self) -> list[Answered]:
        """Everybody's answers to every situation; columns take turns."""
        found = []
        for group, situations in self.situations.items():
            for number, situation in enumerate(situations):
                found += self._answers(group, number, situation)
        return found

    def _answers(self, group: str, number: int, situation: Situation) -> list[Answered]:
        found = []

        def answered(who: str, deadline: int, design: Design) -> None:
            condition, spent = self.bench.condition(design), 1e3 * design.spent.seconds
            found.append(Answered(group, number, who, deadline, condition, spent, design))

        for deadline in _DEADLINES:
            for who, one in self.designers.items():
                answered(who, deadline, one.ask(situation, deadline=deadline / 1e3))
        answered(NEAREST, 0, self.designers[LIBRARY].ask(situation, evaluations=1))
        best = self.draws.best(situation, _DRAWS)
        return [*found, Answered(group, number, BEST, 0, *best, None)]

    @cached_property
    def draws(self) -> Draws:
        """What the generator gives as it is."""
        return Draws(self.bench)

    def bulk(self, group: str, settled: bool) -> dict[str, float]:
        """Milliseconds for a valid trajectory, the share of these, and their median cond(YᵀY)."""
        every = [self.draws.all(situation, settled) for situation in self.situations[group]]
        taken, conditions = sum(x[0] for x in every), np.concatenate([x[1] for x in every])
        valid = conditions[np.isfinite(conditions)]
        return {
            "each": 1e3 * taken / max(1, len(valid)),
            "valid": len(valid) / len(conditions),
            "condition": float(np.median(valid)) if len(valid) else float("inf"),
        }

    @cached_property
    def table(self) -> pd.DataFrame:
        """The answers as rows."""
        return pd.DataFrame([one.row for one in self.answers])

    def quantiles(self, group: str) -> str:
        """Quantiles of cond(YᵀY) by deadline and column, as a table."""
        some = self.table[self.table.group == group]
        cells: list[dict[str, str]] = [
            {"ms": f"{int(part.deadline.max()) or part.spent.median():.3g}", "from": name, **_summary(part)}
            for name in COLUMNS
            for _, part in some[some["who"] == name].groupby("deadline")
        ]
        return markdown(pd.DataFrame(sorted(cells, key=lambda one: (float(one["ms"]), one["from"]))))

    def checked(self) -> dict[str, Any]:
        """The independent check of what the designer returned, with library and generator, in the end."""
        last = [x for x in self.answers if x.who in (LIBRARY, GENERATOR) and x.deadline == _DEADLINES[-1]]
        designs = [x.design for x in last if x.design is not None and x.design.coefficients is not None]
        some = designs[:: max(1, -(-len(designs) // self.most))]
        return {"count": len(some), **_worst([independent(design) for design in some])}


def _summary(part: pd.DataFrame) -> dict[str, str]:
    """Quantiles of a column, and how many have no answer."""
    values = part.condition.to_numpy()
    shown = {f"quantile {q:g}": np.quantile(values, q, method="lower") for q in _QUANTILES}
    cells = {name: _number(float(x)) for name, x in shown.items()}
    return {**cells, "no answer": f"{100 * np.isinf(values).mean():.1f} %"}


def independent(design: Design) -> dict[str, Any]:
    """What the independent check says of a design at 1 kHz."""
    assert design.coefficients is not None and design.scene is not None  # it was proven
    arm, family = design.numbers.arm, design.trajectory
    motion = family.roll_out(design.coefficients[None], family.times(_RATE))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "1.csv"
        write_bytes(path, csv_text(Course.of(arm.joint_names, motion)).encode())
        return check_file(Robot(Path(arm.urdf), arm.joint_names, facts_of(design)), path)


def facts_of(design: Design) -> Facts:
    """What an independent check has to know of a situation."""
    constraints, arm = design.constraints, design.numbers.arm
    capsules, guarded = arm.capsules, {tuple(pair) for pair in constraints.guarded.tolist()}
    planes, boxes = [], []
    for number, region in enumerate(constraints.regions):
        names = [capsules.names[k] for k in range(len(capsules.names)) if (number, k) not in guarded]
        if isinstance(region, Plane):
            planes.append({"normal": region.unit, "offset": region.offset, "spared": names})
        elif isinstance(region, Box):
            boxes.append({"lower": region.lower, "upper": region.upper, "spared": names})
    exempt = [list(one.links) for one in constraints.exempt if one.why != "never touch"] or None
    limited = {"velocity": constraints.arm.velocity_limit, "effort": constraints.arm.torque_limit}
    limits = {kind: dict(zip(arm.joint_names, x.tolist())) for kind, x in limited.items()}
    return Facts(exempt=exempt, limits=limits, planes=planes, boxes=boxes)


def _worst(found: list[dict[str, Any]]) -> dict[str, Any]:
    """The worst of some checks, and how many found nothing wrong."""
    largest = {kind: max(one[kind] for one in found) for kind in ("position", "velocity", "effort")}
    return {
        "valid": sum(bool(one["valid"]) for one in found),
        "colliding": sum(one["colliding"] for one in found),
        "distance": min(one["distance"] for one in found),
        **largest,
    }


def _number(value: float) -> str:
    if np.isinf(value):
        return "—"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _made(page: Page, name: str, kind: type[Starts] | type[Generator], folder: Path | None) -> float:
    """Make what designs start from, or read it where it is kept; the CPU seconds that making it took."""
    numbers = ArmNumbers(page.setting.problem.constraints, page.setting.problem.trajectory)
    path = folder / f"{name}.pt" if folder is not None else None
    if path is not None and path.exists():
        vars(page.bench)[name] = kind.load(path, numbers)
        return float(read_json(path.with_suffix(".json"))["seconds"])
    began = time.process_time()
    made = getattr(page.bench, name)
    taken = time.process_time() - began
    if path is not None:
        write_json(path.with_suffix(".json"), {"seconds": taken})
        made.save(path, numbers)
    return taken


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 0 where everything that was returned is valid."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.design", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="situations (default 200)")
    parser.add_argument("--checked", type=int, default=500, help="trajectories that others check, at most")
    parser.add_argument("--kept", type=Path, help="folder where library and generator are kept and found")
    parser.add_argument("--folder", type=Path, default=_FOLDER, help="where the page goes")
    parser.add_argument("--small", action="store_true", help="next to nothing: does everything run?")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    setting = Setting(quick=options.small, repeats=3)
    page = Page(setting, options.count, options.checked)
    sys.stderr.write("library …\n")
    taken = _made(page, "starts", Starts, options.kept)
    sys.stderr.write("generator …\n")
    trained = _made(page, "generator", Generator, options.kept)
    rows.benches[setting] = page.bench
    sys.stderr.write("situations …\n")
    tables = {group: page.quantiles(group) for group in page.situations}
    sys.stderr.write("independent check …\n")
    checked = page.checked()
    costs = {name: getattr(rows, name)(setting) for name in ("design_evaluation", "design_setup")}
    following = rows.design_next(setting)
    text = template(Path(__file__).with_name("design.md.j2")).render(
        options=options,
        situations={group: len(some) for group, some in page.situations.items()},
        tables=tables,
        columns=COLUMNS,
        last=_DEADLINES[-1],
        checked=checked,
        library={"seconds": taken, "count": len(page.bench.starts), "bytes": page.bench.size},
        generator={"minutes": trained / 60, "modes": len(page.bench.generator), "draws": _DRAWS},
        bulk={(group, how): page.bulk(group, how) for group in page.situations for how in (False, True)},
        evaluation=costs["design_evaluation"],
        setup=costs["design_setup"],
        following=following,
    )
    write_bytes(options.folder / "design.md", text.encode())
    table = page.table.replace(np.inf, np.nan)
    write_bytes(options.folder / "design.csv", table.to_csv(index=False, float_format="%.5g").encode())
    return 0 if checked["valid"] == checked["count"] else 1


if __name__ == "__main__":
    sys.exit(main())
