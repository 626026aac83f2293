"""A document of words, tables, figures and claims, written as Markdown and as one HTML page."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from sidegan.errors import ConfigError

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

VERDICTS = ("holds", "holds in part", "does not hold", "not tested")


@dataclass(frozen=True)
class Text:
    """Paragraphs and lists in Markdown; HTML in it is shown and not obeyed."""

    markdown: str


@dataclass(frozen=True)
class Table:
    """A table of cells that are formatted already; a nameless range as the index is left out."""

    frame: pd.DataFrame
    caption: str

    @property
    def flat(self) -> pd.DataFrame:
        """The table with its index as its first columns, all cells text."""
        nameless = isinstance(self.frame.index, pd.RangeIndex) and self.frame.index.name is None
        flat = self.frame if nameless else self.frame.reset_index()
        text = flat.astype(object).where(flat.notna(), "—").astype(str)
        return text.map(lambda cell: " ".join(cell.split()))


@dataclass(frozen=True)
class Picture:
    """A figure as a PNG file; on the page the interactive one in its place, where there is one."""

    path: Path
    caption: str
    interactive: "go.Figure | None" = None


@dataclass(frozen=True)
class Claim:
    """What the paper says and what was found.

    Attributes:
        text: the claim.
        paper: the paper's figure.
        ours: ours ± spread.
        verdict: one of ``VERDICTS``.
        why: one sentence.
    """

    text: str
    paper: str
    ours: str
    verdict: str
    why: str = ""

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise ConfigError(f"a verdict is one of {', '.join(VERDICTS)}, got {self.verdict!r}")


@dataclass(frozen=True)
class Claims:
    """A table of claims."""

    claims: Sequence[Claim]
    caption: str = ""

    @property
    def counts(self) -> dict[str, int]:
        """Number of claims by verdict, in the order of ``VERDICTS``; those that do not occur are left out."""
        found = Counter(claim.verdict for claim in self.claims)
        return {verdict: found[verdict] for verdict in VERDICTS if found[verdict]}


Block = str | Text | Table | Picture | Claims


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it; ``level`` 3 is a part of the section before."""

    title: str
    blocks: Sequence[Block]
    level: int = 2


@dataclass(frozen=True)
class Document:
    """A title, a first paragraph in Markdown, and sections."""

    title: str
    lead: str
    sections: Sequence[Section] = field(default_factory=tuple)


def illustrate(
    folder: Path, name: str, figure: "Figure", caption: str, interactive: "go.Figure | None" = None
) -> Picture:
    """A picture whose PNG and SVG are written now, as ``folder``/``name``.

    Raises:
        StorageError: when the folder cannot be written or is full.
    """
    from sidegan.report.canvas import save

    return Picture(save(figure, folder / name)[0], caption, interactive)


def verdicts(counts: dict[str, int]) -> str:
    """How many claims hold and how many do not, in words."""
    plural = {"holds": "hold", "holds in part": "hold in part", "does not hold": "do not hold"}
    words = {verdict: plural.get(verdict, verdict) if n > 1 else verdict for verdict, n in counts.items()}
    return ", ".join(f"{number} {words[verdict]}" for verdict, number in counts.items())
