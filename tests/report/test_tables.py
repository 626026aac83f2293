"""Tables of results, in pages, files and on the terminal."""

import pandas as pd
import pytest
from jinja2 import UndefinedError

from sidegan.report.canvas import blank
from sidegan.report.document import write_page
from sidegan.report.export import markdown, read_tables, show
from sidegan.report.tables import spread


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], "—"),
        ([0.123456, None], "0.123"),
        ([1, 3], "2 ± 1.4"),
        ([0.001, 0.001], "0.001 ± 0"),
        ([1e-7, 3e-7], "2e-7 ± 1.4e-7"),
        ([84.4, 270.4], "180 ± 130"),  # no more digits than the deviation has
        ([187.1, 189.1], "188 ± 1.4"),
        ([-0.3, 0.76], "0.23 ± 0.75"),
        ([60.4882, 60.8134], "60.7 ± 0.23"),  # rounded once
        ([-90.0, 98.0], "0 ± 130"),
    ],
)
def test_a_spread_is_the_mean_and_the_sample_deviation(values, expected):
    assert spread(pd.Series(values, dtype=float)) == expected


TABLE = pd.DataFrame(
    {"a|b": ["1 ± 2", None], "note": ["<b>", "x\ny"]}, index=pd.Index(["p", "q"], name="set")
)
TEMPLATE = """# Results & verdicts

What **holds** with {{ share | number(".0%") }}.

{% if "t" in tables %}
{{ table("t", "Table I: nMSE*.") }}

{% endif %}
{{ figure("line", "A [line] & more.") }}
"""


def test_markdown_has_all_parts_in_order_and_their_files(tmp_path):
    (tmp_path / "page.md.j2").write_text(TEMPLATE, encoding="utf-8")
    figure, path = blank(1, 1), tmp_path / "docs" / "some report.md"
    figure.subplots().plot([0, 1])
    write_page(tmp_path / "page.md.j2", path, {"t": TABLE}, {"line": figure}, share=0.5)
    text = path.read_text(encoding="utf-8")
    parts = (
        "# Results & verdicts", "What **holds** with 50%.", "*Table I: nMSE\\*.*",
        "| p | 1 ± 2 | <b> |", "| q | — | x y |",
        "![A (line) & more.](some%20report/figures/line.png)", "*A [line] & more.*",
    )  # fmt: skip
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    beside = {file.name: file for file in path.with_suffix("").rglob("*.*")}
    assert beside.keys() == {"t.csv", "t.md", "line.png"}
    assert pd.read_csv(beside["t.csv"]).note.tolist() == TABLE.note.tolist()
    assert beside["t.md"].read_text("utf-8") == f"Table I: nMSE*.\n\n{markdown(TABLE.reset_index())}\n"


def test_a_page_that_needs_an_unknown_value_is_refused_and_not_written(tmp_path):
    (tmp_path / "page.md.j2").write_text("{{ nothing }}")
    with pytest.raises(UndefinedError, match="nothing"):
        write_page(tmp_path / "page.md.j2", tmp_path / "a.md", {}, {})
    assert not (tmp_path / "a.md").exists()


def test_tables_align_numbers_right_and_dash_missing_values():
    frame = pd.DataFrame({"n": ["1.5e-3 ± 0.1", None], "a|b": ["a\xa01", "2|\n3"]})
    lines = [r"| n | a\|b |", "| ---: | --- |", "| 1.5e-3 ± 0.1 | a\xa01 |", r"| — | 2\| 3 |"]
    assert markdown(frame).split("\n") == lines


def test_tables_of_a_page_read_back():
    table = pd.DataFrame({"arm": ["a|c", "b"], "valid": ["0.5", None]})
    text = f"# Page\n\n{markdown(table)}\n\nWords.\n\n{markdown(table[['valid']])}"
    first, second = read_tables(text)
    assert first.arm.tolist() == ["a|c", "b"] and first.valid.tolist() == ["0.5", None]
    assert second.columns.tolist() == ["valid"] and second.valid.tolist() == ["0.5", None]


def test_a_table_is_printed_in_full(capsys):
    show(TABLE.rename(columns={"note": "time [s]"}), "Table [I]")
    out, err = capsys.readouterr()
    assert all(text in out for text in ("Table [I]", "time [s]", "a|b", "set", "q", "1 ± 2", "<b>"))
    assert not err and "\x1b" not in out


def test_a_wide_table_is_printed_in_parts_with_whole_numbers_and_words(capsys):
    cells = {f"column of set {k}": ["1.234 ± 0.56", f"word {k} " * 9] for k in range(12)}
    show(pd.DataFrame(cells, index=pd.Index(["first-row", "second-row"], name="name")), "Wide")
    lines = capsys.readouterr().out.splitlines()[1:]
    assert max(map(len, lines)) <= 150 and all(
        line[0] + line[-1] in ("┏┓", "┃┃", "┡┩", "││", "└┘") for line in lines
    )
    parts = sum("first-row" in line for line in lines)
    assert parts > 1 and sum("second-row" in line for line in lines) == parts
    words = " ".join(lines).split()
    assert words.count("±") == 12 and words.count("1.234") == words.count("0.56") == 12
    assert {f"{k}" for k in range(12)} <= {*words}
