"""Canvas, axes, legends and files of all matplotlib figures."""

import re
import warnings
from collections.abc import Mapping, Sequence
from html import escape
from io import StringIO
from pathlib import Path
from string import ascii_lowercase
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from sidegan.base.names import plain
from sidegan.base.storage import replacing

_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))  # removed from files
_LEAST, _MOST = 0.7, 1.2  # width in a page relative to the figure's
_VECTORS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib: the same widths everywhere
    "path.simplify_threshold": 0.5,  # [pt]: a long recording has more points than a screen can show
    "text.parse_math": False,  # names may contain a dollar sign
}


def blank(width: float, height: float) -> Figure:
    """An empty figure of this size [inch], without screen or global state."""
    return Figure(figsize=(width, height), layout="constrained")


def tidy(axis: Axes, grid: Literal["both", "x", "y"] = "both") -> None:
    """Draw a light grid behind the data and small ticks; remove the right and top frame."""
    axis.grid(axis=grid, alpha=0.25)
    axis.set_axisbelow(True)
    axis.tick_params(which="both", labelsize=8)
    axis.spines[["right", "top"]].set_visible(False)


def letter(axes: Sequence[Axes] | NDArray[Any]) -> None:
    """Name panels a, b, c and so on, unless there is only one."""
    for name, axis in zip(ascii_lowercase, axes if len(axes) > 1 else ()):
        axis.set_title(name, loc="left", fontsize=10, fontweight="bold")


def logarithmic(axis: Axes, which: Literal["x", "y"] = "y") -> None:
    """Set a logarithmic axis with plain numbers at its ticks."""
    axis.set(**{f"{which}scale": "log"})
    ticks = getattr(axis, f"{which}axis")
    decades = np.ptp(np.log10(ticks.get_view_interval())) * (3 if which == "x" else 1)  # words are wide
    ticks.set_major_locator(
        LogLocator(subs=range(1, 10) if decades < 1 else (1, 2, 5) if decades < 4 else (1,))
    )
    ticks.set_major_formatter(FuncFormatter(lambda value, _: plain(value, "g")))
    ticks.set_minor_formatter(NullFormatter())


def from_zero(axis: Axes, shares: pd.Series) -> None:
    """Set a logarithmic y axis for shares, linear from 0 to the decade of the least positive one."""
    least = 10.0 ** np.floor(np.log10(1.001 * shares.where(shares > 0, 1.0).min()))
    axis.set_yscale("symlog", linthresh=least, linscale=0.3)
    axis.set_ylim(-0.2 * least)
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: plain(value, "g")))


def legend(figure: Figure, handles: Mapping[str, Any]) -> None:
    """Draw a common legend below all panels; none without handles."""
    if handles:
        rows = -(-len(handles) // int(figure.get_figwidth() // 1.7))
        columns = -(-len(handles) // rows)
        style: dict[str, Any] = {"ncols": columns, "fontsize": 9, "frameon": False, "markerscale": 1.6}
        figure.legend(list(handles.values()), list(handles), loc="outside lower center", **style)


def save(figure: Figure, path: Path) -> Path:
    """Write ``path``.png; equal figures give equal bytes, so that a repeated run changes no file."""
    final = path.with_name(f"{path.name}.png")
    with replacing(final) as draft:
        figure.savefig(draft, format="png", dpi=150, metadata={"Software": None})
    return final


def svg(figure: Figure, name: str, label: str) -> str:
    """The figure as an SVG element for HTML, with text as text; equal figures give equal bytes.

    ``name`` must be unique in a page; screen readers read ``label``.
    """
    text = StringIO()
    with rc_context(_VECTORS | {"svg.hashsalt": name}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # browsers have other fonts
        for words in figure.findobj(Text):
            words.set_parse_math(False)
        figure.savefig(text, format="svg", metadata=_METADATA, transparent=True)
    drawn = re.sub(r'<g id="[^"]*"', "<g", text.getvalue().partition("<defs>")[2])
    drawn = re.sub(r' (d|x|y)="[^"]*"', lambda numbers: re.sub(r"(\.\d\d)\d+|\n", r"\1", numbers[0]), drawn)
    width, height = figure.get_size_inches()
    box = f"0 0 {72 * width:g} {72 * height:g}"
    style = f"min-width: {_LEAST * width:g}in; max-width: {_MOST * width:g}in"
    head = f'id="{name}" role="img" aria-label="{escape(label)}" viewBox="{box}" style="{style}"'
    return f"<svg {head}><defs>{drawn}"
