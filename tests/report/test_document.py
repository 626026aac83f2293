from html.parser import HTMLParser

import pandas as pd
import pytest
from markdown_it import MarkdownIt
from matplotlib.figure import Figure

from sidegan.errors import ArtifactError, ConfigError, StorageError
from sidegan.report.document import (
    Claim,
    Claims,
    Document,
    Picture,
    Section,
    Table,
    Text,
    illustrate,
    verdicts,
)
from sidegan.report.interactive import timing
from sidegan.report.markdown import write_markdown
from sidegan.report.web import write_html

VOID = {"meta", "img", "br", "hr", "link", "input"}
TABLE = Table(
    pd.DataFrame({"a|b": ["1 ± 2", None], "note": ["<b>", "x\ny"]}, index=pd.Index(["p", "q"], name="set")),
    "Table I: nMSE.",
)
CLAIMS = Claims(
    [
        Claim("Success < 40 %", "< 40 %", "16 %", "holds", "No constraints in `vanilla`."),
        Claim("Fast", "1.4 ms", "0.1 ms", "holds"),
        Claim("More diverse", "yes", "no", "does not hold", "Better | seeds."),
    ]
)


class Page(HTMLParser):
    """Text, identifiers, links, classes, and whether what opens is closed in order."""

    def __init__(self, text):
        super().__init__()
        self.words, self.ids, self.links, self.classes, self.sources = "", [], [], [], []
        self.open = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        known = dict(attrs)
        self.ids += [known["id"]] if "id" in known else []
        self.links += [known["href"]] if "href" in known else []
        self.sources += [known["src"]] if "src" in known else []
        self.classes += (known.get("class") or "").split()
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.words += data


@pytest.fixture
def drawn(tmp_path):
    figure = Figure(figsize=(1, 1))
    figure.subplots().plot([0, 1])
    return illustrate(tmp_path / "docs" / "some figures", "line", figure, "A [line] & more.")


def document(*blocks):
    return Document("Results & verdicts", "What **holds**.", [Section("First", blocks)])


def test_markdown_has_all_parts_in_order(tmp_path, drawn):
    path = tmp_path / "docs" / "report.md"
    write_markdown(document("One.", Text("- two"), TABLE, drawn, CLAIMS), path)
    text = path.read_text(encoding="utf-8")
    places = [
        text.index(part) for part in ("# Results & verdicts", "What **holds**", "## First", "One.", "- two")
    ]
    assert places == sorted(places)
    assert "| p | 1 ± 2 | <b> |" in text and "| q | — | x y |" in text
    assert "![A (line) & more.](some%20figures/line.png)" in text
    assert "**2 hold, 1 does not hold**" in text
    assert "🔴\u00a0does\u00a0not\u00a0hold" in text and "Better \\| seeds." in text
    html = MarkdownIt("commonmark").enable("table").render(text)
    assert html.count("<table>") == 2 and '<img src="some%20figures/line.png"' in html


def test_a_page_has_all_parts_and_needs_nothing_else(tmp_path, drawn):
    bars = timing(pd.DataFrame({"what": ["seed"], "ours": [1.0], "paper": [2.0]}))
    interactive = Picture(drawn.path, "Bars.", bars)
    write_html(document("One `code`.", TABLE, drawn, interactive, CLAIMS), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert not page.open
    for part in (
        "Results & verdicts",
        "What holds.",
        "Table I: nMSE.",
        "<b>",
        "Bars.",
        "2 hold",
        "1 does not hold",
    ):
        assert part in page.words
    assert {"badge", "holds", "does-not-hold"} <= set(page.classes)
    assert page.links == ["#section-1"] and "section-1" in page.ids
    assert len(page.ids) == len(set(page.ids))
    assert all(source.startswith("data:image/png;base64,") for source in page.sources) and page.sources
    assert "default-src 'none'" in text  # the browser loads nothing, whatever the plotting library asks for


def test_the_plotting_library_comes_with_interactive_figures_alone(tmp_path, drawn):
    write_html(document(drawn), tmp_path / "small.html")
    assert (tmp_path / "small.html").stat().st_size < 100_000


def test_parts_of_a_section_stand_in_it(tmp_path):
    made = Document("T", "", [Section("A", []), Section("B", ["b"], level=3), Section("C", [])])
    write_html(made, tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert text.count("<section>") == 2
    assert text.index('<h3 id="section-2">B') < text.index("</section>")
    write_markdown(made, tmp_path / "x.md")
    assert (tmp_path / "x.md").read_text(encoding="utf-8") == "# T\n\n## A\n\n### B\n\nb\n\n## C\n"


def test_markup_in_the_words_is_shown_and_not_obeyed(tmp_path):
    bad = "<script>alert(1)</script>"
    claim = Claim(bad, bad, bad, "holds", bad)
    table = Table(pd.DataFrame({bad: [bad]}), bad)
    made = Document(bad, bad, [Section(bad, [bad, f"[x](javascript:{bad})", table, Claims([claim], bad)])])
    write_html(made, tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text and 'href="javascript' not in text


def test_numbers_line_up_on_the_right(tmp_path):
    frame = pd.DataFrame({"n": ["1.5e-3 ± 0.1", "—"], "word": ["a 1", "2"]}, index=pd.Index([1, 2], name="k"))
    write_html(document(Table(frame, "")), tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert '<th class="text">k</th><th>n</th><th class="text">word</th>' in text


def test_the_index_of_a_table_is_its_first_column_where_it_has_a_name():
    frame = pd.DataFrame({"a": [1.5, None]})
    assert list(Table(frame, "").flat.columns) == ["a"] and list(Table(frame, "").flat.a) == ["1.5", "—"]
    assert list(TABLE.flat.columns) == ["set", "a|b", "note"]


def test_verdicts_are_counted_in_words():
    assert CLAIMS.counts == {"holds": 2, "does not hold": 1}
    every = {"holds": 1, "holds in part": 2, "does not hold": 2, "not tested": 2}
    assert verdicts(every) == "1 holds, 2 hold in part, 2 do not hold, 2 not tested"


def test_an_unknown_verdict_is_refused():
    with pytest.raises(ConfigError, match=r"holds in part.*got 'maybe'"):
        Claim("a", "b", "c", "maybe")


def test_a_missing_figure_is_told(tmp_path):
    with pytest.raises(ArtifactError, match=r"no figure .*none\.png"):
        write_html(document(Picture(tmp_path / "none.png", "None.")), tmp_path / "x.html")
    assert not (tmp_path / "x.html").exists()


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    for write in (write_markdown, write_html):
        with pytest.raises(StorageError):
            write(document("x"), tmp_path / "file" / "x")
