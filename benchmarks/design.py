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
from sidegan.base.storage import write_bytes
from sidegan.controllers import Course, csv_text
from sidegan.designer import Design, Situation
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.validity import Box, Plane

_DEADLINES = (5, 8, 12, 20, 50)  # [ms]
_QUANTILES = (0.1, 0.5, 0.9)
_RATE = 1000.0  # [Hz]
_FOLDER = Path("docs")
_SEED, _MANY_SEED = 999, 77
LIBRARY, RANDOM, AS_IS = "library, polished", "random, optimised", "nearest of the library, as it is"
COLUMNS = (LIBRARY, RANDOM, AS_IS)


@dataclass(frozen=True)
class Answered:
    """What came of one question."""

    group: str  # of the situation
    number: int
    who: str
    deadline: int  # [ms]
    condition: float  # infinite where there is no answer
    spent: float  # CPU time [ms]
    design: Design

    @property
    def row(self) -> dict[str, Any]:
        """What is kept in the table."""
        return {k: x for k, x in vars(self).items() if k != "design"}


@dataclass(frozen=True)
class Page:
    """The measurements that the page tells."""

    setting: Setting
    count: int  # situations

    @cached_property
    def bench(self) -> Bench:
        """The designer and its library."""
        return Bench(self.setting)

    @cached_property
    def library_seconds(self) -> float:
        """CPU time that the library takes [s]."""
        began = time.process_time()
        _ = self.bench.starts
        return time.process_time() - began

    @cached_property
    def situations(self) -> dict[str, list[Situation]]:
        """Situations by group."""
        problem, each = self.setting.problem, max(1, self.count // 8)
        return {
            "mixed": Draw(problem, _SEED).mixed(each),
            "several obstacles": Draw(problem, _MANY_SEED).several(max(1, self.count // 4)),
        }

    @cached_property
    def answers(self) -> list[Answered]:
        """Everybody's answers to every situation; columns take turns."""
        _ = self.library_seconds
        ours, theirs = self.bench.designer(), self.bench.designer(starts=False)
        for one in (ours, theirs):
            one.ask(deadline=0.05)
        found = []
        for group, situations in self.situations.items():
            for number, situation in enumerate(situations):
                for deadline in _DEADLINES:
                    for who, one in ((LIBRARY, ours), (RANDOM, theirs)):
                        design = one.ask(situation, deadline=deadline / 1e3)
                        found.append(self._answered(group, number, who, deadline, design))
                design = ours.ask(situation, evaluations=1)
                found.append(self._answered(group, number, AS_IS, 0, design))
        return found

    def _answered(self, group: str, number: int, who: str, deadline: int, design: Design) -> Answered:
        spent = 1e3 * design.spent.seconds
        return Answered(group, number, who, deadline, self.bench.condition(design), spent, design)

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
            for _, part in some[some.who == name].groupby("deadline")
        ]
        return markdown(pd.DataFrame(sorted(cells, key=lambda one: (float(one["ms"]), one["from"]))))

    def checked(self) -> dict[str, Any]:
        """The independent check of what the designer returned at the last deadline."""
        last = [x for x in self.answers if x.who == LIBRARY and x.deadline == _DEADLINES[-1]]
        some = [x.design for x in last if x.design.coefficients is not None]
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 0 where everything that was returned is valid."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.design", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="situations (default 200)")
    parser.add_argument("--folder", type=Path, default=_FOLDER, help="where the page goes")
    parser.add_argument("--small", action="store_true", help="next to nothing: does everything run?")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    setting = Setting(quick=options.small, repeats=3)
    page = Page(setting, options.count)
    sys.stderr.write("library …\n")
    taken = page.library_seconds
    sys.stderr.write("situations …\n")
    tables = {group: page.quantiles(group) for group in page.situations}
    sys.stderr.write("independent check …\n")
    checked = page.checked()
    costs = {name: getattr(rows, name)(setting) for name in ("design_evaluation", "design_setup")}
    following = rows.design_next(setting)
    text = template(Path(__file__).with_name("design.md.j2")).render(
        situations={group: len(some) for group, some in page.situations.items()},
        tables=tables,
        columns=COLUMNS,
        last=_DEADLINES[-1],
        checked=checked,
        library={"seconds": taken, "count": len(page.bench.starts), "bytes": page.bench.size},
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
