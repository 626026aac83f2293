"""Pages in Markdown, and tables as files and on the terminal."""

from types import SimpleNamespace

import pandas as pd

from sidegan.report.canvas import blank
from sidegan.report.document import write_page
from sidegan.report.export import markdown, show, write_table

TABLE = pd.DataFrame(
    {"a|b": ["1 ± 2", None], "note": ["<b>", "x\ny"]}, index=pd.Index(["p", "q"], name="set")
)
NUMBERS = pd.DataFrame({"time [s]": ["16", "560"], "a|b": ["1|2", "3"]}, index=["seeds", "long"])
NUMBERS = NUMBERS.rename_axis("set")
TEMPLATE = """# Results & verdicts

What **holds** with {{ known.share | number(".0%") }}.

{% if "t" in tables %}
{{ table("t", "Table I: nMSE*.") }}

{% endif %}
{{ figure("line", "A [line] & more.") }}
"""


def test_markdown_has_all_parts_in_order_and_their_files(tmp_path):
    (tmp_path / "page.md.j2").write_text(TEMPLATE, encoding="utf-8")
    figure, path = blank(1, 1), tmp_path / "docs" / "some report.md"
    figure.subplots().plot([0, 1])
    known = SimpleNamespace(share=0.5)
    write_page(tmp_path / "page.md.j2", path, {"t": TABLE}, {"line": figure}, known=known)
    text = path.read_text(encoding="utf-8")
    parts = (
        "# Results & verdicts", "What **holds** with 50%.", "*Table I: nMSE\\*.*",
        "| p | 1 ± 2 | <b> |", "| q | — | x y |",
        "![A (line) & more.](some%20report/figures/line.png)", "*A [line] & more.*",
    )  # fmt: skip
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert {file.name for file in path.with_suffix("").rglob("*.*")} == {"t.csv", "t.md", "line.png"}


def test_a_table_has_numbers_on_the_right_and_dashes_for_what_is_unknown():
    frame = pd.DataFrame({"n": ["1.5e-3 ± 0.1", None], "a|b": ["a\xa01", "2|\n3"]})
    lines = [r"| n | a\|b |", "| ---: | --- |", "| 1.5e-3 ± 0.1 | a\xa01 |", r"| — | 2\| 3 |"]
    assert markdown(frame).split("\n") == lines


def test_a_table_is_written_as_csv_and_markdown(tmp_path):
    write_table(NUMBERS, tmp_path / "new" / "table1", "Table I")
    read = pd.read_csv(tmp_path / "new" / "table1.csv", dtype=str)
    pd.testing.assert_frame_equal(read, NUMBERS.reset_index().astype(str), check_dtype=False)
    text = (tmp_path / "new" / "table1.md").read_text(encoding="utf-8")
    assert text == f"Table I\n\n{markdown(NUMBERS.reset_index())}\n"


def test_a_shown_table_is_whole_on_standard_output(capsys):
    show(NUMBERS, "Table [I]")
    out, err = capsys.readouterr()
    assert all(text in out for text in ("Table [I]", "time [s]", "a|b", "seeds", "long", "560", "1|2"))
    assert not err and "\x1b" not in out
