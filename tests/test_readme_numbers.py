"""README's sentences on results have the numbers of its tables."""

import re
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest

from sidegan.base.conf import CONF
from sidegan.design.selection import Selection

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = README.partition("\n## What it shows\n")[2].partition("\n## ")[0]
SCALES = ("quick", "paper")  # with numbers such as that of the seeds
USUAL = {"95", str(Selection().count)}  # per cent of intervals, and trajectories of a set
NUMBER = (
    r"(?<![\w.])(\d{1,3}(?:,\d{3})+|\d+(?:\.\d+)?)(?=((?: to [\d.]+)? %)?)"  # and whether per cent follows
)
MARKUP = re.compile(r"!?\[([^\]]*)\]\([^)]*\)|`[^`]*`")  # links, of which the words stay, and code


def numbers(text: str) -> list[tuple[str, bool]]:
    """Every number, and whether it is per cent."""
    return [(number.replace(",", ""), bool(share)) for number, share in re.findall(NUMBER, text)]


def unfounded(section: str) -> list[tuple[str, str]]:
    """Numbers in sentences that no setting and no table of the section has, and their sentences.

    Those of tables may be rounded, and shares may be in per cent.
    """
    lines = section.splitlines()
    tables = "\n".join(line for line in lines if line.startswith("|"))
    prose = "\n".join(line for line in lines if not line.startswith("|"))
    plain = [float(number) for number, _ in numbers(tables)]
    shares = [100 * x if x <= 1 else x for x in plain]
    settings = set(USUAL)
    for name in SCALES:
        settings |= dict(numbers((CONF / "scale" / f"{name}.yaml").read_text(encoding="utf-8"))).keys()
    found = []
    for sentence in re.split(r"(?<=[.:;])\s+|\n\n", MARKUP.sub(r"\1", prose)):
        for number, share in numbers(sentence):
            digits = len(number.partition(".")[2])
            known = {f"{x:.{digits}f}" for x in (shares if share else plain)}
            if number not in settings | known:
                found.append((number, " ".join(sentence.split())))
    return found


KINDS = {  # of claims, by the words of README
    "what trainings end in": "learned",
    "errors of identified models": "identified",
    "robots, judged on simulated ones": "simulated robot",
    "mathematics": "mathematics",
    "speed, of this software": "speed",
}


def test_the_score_is_that_of_the_page():
    table = README.partition("\n| claims about")[2].partition("\n\n")[0]
    shown = pd.read_csv(StringIO(table), sep=r"\s*\|\s*", engine="python", skiprows=2, header=None)
    found = pd.read_csv(ROOT / "docs" / "reproduction" / "tables" / "claims.csv")
    verdict, again = (found[name].str.partition(" ")[2] for name in ("ours", "ours_again"))
    decided = {each: verdict == each for each in ("holds", "does not hold")}
    columns = {"number": verdict.notna()}
    for each, marked in decided.items():
        columns |= {each: marked, f"{each}, confirmed": marked & (again == each)}
    columns["undecided"] = ~verdict.isin(decided)
    counts = pd.DataFrame(columns).groupby(found.Kind).sum()
    score = {KINDS[row[1]]: [int(x) for x in row[2:8]] for row in shown.to_numpy().tolist()}
    assert score == dict(zip(counts.index, counts.to_numpy().tolist()))


@pytest.mark.parametrize("section", RESULTS.split("\n### "))
def test_numbers_in_sentences_are_those_of_the_tables(section):
    assert section.count("\n| ") > 5 and unfounded(section) == []


@pytest.mark.parametrize(
    ("number", "sentence"), [("8412", "It is 8,412 of them."), ("12.3", "Of these 12.3 % remain.")]
)
def test_a_number_of_no_table_is_told_with_its_sentence(number, sentence):
    table = "\n| share |\n| --- |\n| 0.124 ± 0.1 |\n| 8,413 |\n"
    told = unfounded(f"{table}\nA share of 0.12, 10 to 12.4 %, of 8,413.\n\n{sentence}\n")
    assert told == [(number, sentence)]
