"""What the growth curves tell: medians, exponents, pictures, and the page docs/growth/README.md."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from benchmarks.growth_curves import CURVES, Curve
from benchmarks.pictures import logarithmic, picture
from sidegan.base.storage import write_bytes
from sidegan.report.canvas import Line, band
from sidegan.report.document import figure_text, table_text
from sidegan.report.style import colours

_FITTED = 4  # largest points that an exponent is fitted to
_LEAD = """How costs grow, as measured by

```sh
python -m benchmarks.growth
```

on one thread of a machine whose two cores had other work at the same time. So the costs are CPU time, and
medians of repeats that took turns with the other points (lines; bands are their range; the CSV files
beside this page hold every single one). Even so a busy neighbour takes caches and clock: read exponents and
ratios here, and take absolute times from `python -m benchmarks.run`. An exponent k says that the cost grows
as nᵏ over the four largest points, with the standard error of the fit."""


class Exponent(NamedTuple):
    """Power with which a cost grows, and its standard error."""

    value: float
    error: float

    def __str__(self) -> str:
        return f"{self.value:.2f} ± {self.error:.2f}"


def exponent(curve: Curve, rows: pd.DataFrame, column: str) -> Exponent:
    """Power with which the total cost grows at the largest points."""
    from scipy import stats

    found = rows.groupby("at")[column].median().tail(_FITTED)
    fit = stats.linregress(np.log(found.index.to_numpy(float)), np.log(found.to_numpy()))
    return Exponent(float(fit.slope) + curve.share, float(np.nan_to_num(fit.stderr)))


def draw(curve: Curve, rows: pd.DataFrame, path: Path) -> None:
    """A picture of the medians with their ranges, logarithmic both ways; memory beside it where it counts."""
    labels = [curve.unit, *(["peak memory of the process [MB]"] if curve.memory else [])]
    with picture(path, curve.varied, *labels) as panels:
        for (column, name), shade in zip(curve.shown.items(), colours(curve.shown).values()):
            band(panels[0], _line(rows, column), name, shade, marker="o")
        if curve.memory:
            band(panels[1], _line(rows, "peak_mb"), "memory", "#7f7f7f", marker="o")
        for axes in panels:
            logarithmic(axes, rows["at"].unique().tolist())
        if curve.memory:
            panels[1].set_yscale("linear")
            panels[1].set_ylim(0, 1.2 * rows["peak_mb"].max())


def write_page(folder: Path) -> None:
    """Write ``README.md`` of a folder: a section for each curve whose table is there."""
    there = {name: curve for name, curve in CURVES.items() if (folder / f"{name}.csv").exists()}
    blocks = ["# Growth", _LEAD]
    for name, curve in there.items():
        blocks += [f"## {curve.title}", *_blocks(name, curve, folder)]
    if (folder / "soak.csv").exists():
        blocks += ["## Memory over time", *_soak(folder)]
    text = "\n\n".join(block.strip() for block in blocks)
    write_bytes(folder / "README.md", f"{text}\n".encode())


def _blocks(name: str, curve: Curve, folder: Path) -> Iterator[str]:
    rows = pd.read_csv(folder / f"{name}.csv")
    yield curve.about
    yield figure_text(Path(f"{name}.png"), f"{curve.unit} over {curve.varied}")
    yield _table(curve, rows)
    powers = {words: exponent(curve, rows, column) for column, words in curve.shown.items()}
    yield f"Exponents of {'the total' if curve.share else 'the cost'}: {_listed(powers)}."
    if name == "long":
        yield _about_the_paper(rows, curve)


def _table(curve: Curve, rows: pd.DataFrame) -> str:
    columns = {**curve.shown, **({"peak_mb": "peak memory [MB]"} if curve.memory else {})}
    middle = rows.groupby("at")[list(columns)].median().rename(columns=columns).map(_number)
    counts = rows.groupby("at").size().rename("repeats")
    middle.index = pd.Index([f"{at:,}" for at in middle.index], name=curve.varied)
    return table_text(middle.assign(repeats=counts.to_numpy()), f"{curve.unit}, medians")


def _about_the_paper(rows: pd.DataFrame, curve: Curve) -> str:
    """What was measured of the paper's argument for short trajectories."""
    power = {column: exponent(curve, rows, column) for column in ("fitness_s", *curve.shown)}
    last = rows.groupby("at").median().iloc[-1]
    n, times = int(rows["at"].max()), last["one_long_s"] / last["many_short_s"]
    sweeps = last["sweep_long_s"] / last["sweep_short_s"]
    return (
        "The paper argues for short trajectories with “the O(n³) complexity computing YᵀY”, n the length. "
        "That is not what was measured: YᵀY is a sum over samples of matrices whose size does not depend on "
        f"n. With the roll-out and the spectrum it grows with the power {power['fitness_s']}, and an "
        f"evaluation with {power['evaluation_s']}; only the roll-out, samples times coefficients, tends to "
        "n². The argument holds for what is done with evaluations. A long trajectory has n times as many "
        f"coefficients, so a sweep grows with the power {power['sweep_long_s']}, and at {n} periods costs "
        f"{sweeps:.0f} times as much as sweeps of {n} short ones. A cube follows where the number of sweeps "
        "grows with n as well, which was not measured. With gradients, 200 evaluations grow with the power "
        f"{power['one_long_s']}, and at {n} periods the long trajectory took {times:.1f} times as long as "
        "the short ones together. These went as one batch, which spreads what each call costs, and they "
        "could go to as many workers as there are; the long one could not. The long one ended with a "
        f"condition number of {last['one_long_condition']:.0f}, a short one with "
        f"{last['many_short_condition']:.0f} in the median: what {n} of them do together is another "
        "question, to which Table I is the answer."
    )


def _soak(folder: Path) -> list[str]:
    """The soak run, which has a command of its own."""
    from benchmarks.soak import read, slope_of, told

    samples = read(folder / "soak.csv")
    about = (
        "`python -m benchmarks.soak` repeats the library's work at a small size in one process: seeds, a "
        "generator trained on them, its library filtered, written part by part and read again, the "
        "selection, the identification. Its exit code is 1 when memory grows."
    )
    drawn = figure_text(Path("soak.png"), "resident memory between two rounds of the same work")
    return [about, drawn, f"{told(samples, slope_of(samples))}."]


def _listed(powers: dict[str, Exponent]) -> str:
    return ", ".join(f"{words} {power}" for words, power in powers.items())


def _line(rows: pd.DataFrame, column: str) -> Line:
    groups = rows.groupby("at")[column]
    found = (groups.median(), groups.min(), groups.max())
    return Line(found[0].index.to_numpy(), *(x.to_numpy() for x in found))


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
