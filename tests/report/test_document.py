from html.parser import HTMLParser
from types import SimpleNamespace

import pandas as pd
import plotly.graph_objects as go
import pytest
from jinja2 import UndefinedError
from markdown_it import MarkdownIt

from sidegan.errors import ArtifactError, StorageError
from sidegan.report.canvas import blank
from sidegan.report.document import table_text, write_page
from sidegan.report.web import write_html

VOID = {"meta", "img", "br", "hr", "link", "input"}
TABLE = pd.DataFrame(
    {"a|b": ["1 ± 2", None], "note": ["<b>", "x\ny"]}, index=pd.Index(["p", "q"], name="set")
)
TEMPLATE = """# Results & verdicts

What **holds** with {{ known.share | number(".0%") }} in {{ 0.0014 | seconds }}.

## First

One `code`.

- two

{% if "t" in tables %}
{{ table("t", "Table I: nMSE*.") }}

{% endif %}
{{ figure("line", "A [line] & more.") }}

### Part

## Second
"""


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
def written(tmp_path):
    """The page ``docs/some report.md`` and its text."""
    template = tmp_path / "page.md.j2"
    template.write_text(TEMPLATE, encoding="utf-8")
    figure = blank(1, 1)
    figure.subplots().plot([0, 1])
    path = tmp_path / "docs" / "some report.md"
    known = SimpleNamespace(share=0.5)
    return path, write_page(template, path, {"t": TABLE}, {"line": figure}, known=known)


def test_markdown_has_all_parts_in_order(written):
    path, text = written
    assert path.read_text(encoding="utf-8") == text
    parts = ("# Results & verdicts", "What **holds** with 50% in 1.4 ms.", "## First", "One `code`.", "- two")
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "| p | 1 ± 2 | <b> |" in text and "| q | — | x y |" in text
    assert "![A (line) & more.](some%20report/figures/line.png)" in text and "*A [line] & more.*" in text
    assert "*Table I: nMSE\\*.*" in text
    html = MarkdownIt("commonmark").enable("table").render(text)
    assert html.count("<table>") == 1 and '<img src="some%20report/figures/line.png"' in html
    assert {file.name for file in path.with_suffix("").rglob("*.*")} == {"t.csv", "t.md", "line.png"}


def test_a_page_has_all_parts_and_needs_nothing_else(written):
    path, text = written
    write_html(text, path.with_suffix(".html"))
    content = path.with_suffix(".html").read_text(encoding="utf-8")
    page = Page(content)
    assert not page.open
    for part in ("Results & verdicts", "What holds with 50%", "Table I: nMSE*.", "<b>", "A [line] & more."):
        assert part in page.words
    assert len(page.links) == 3 and {link.removeprefix("#") for link in page.links} < set(page.ids)
    assert len(page.ids) == len(set(page.ids))
    assert all(source.startswith("data:image/png;base64,") for source in page.sources) and page.sources
    assert "default-src 'none'" in content  # the browser loads nothing, whatever the page asks for
    assert len(content) < 100_000  # the plotting library is not in it
    assert content.count("<section>") == 2 and content.index("Part</h3>") < content.index("</section>")
    assert page.classes.count("caption") == 2


def test_an_interactive_figure_stands_in_place_of_its_image(written):
    path, text = written
    write_html(text, path.with_suffix(".html"), {"line": go.Figure(go.Scatter(y=[0, 1]))})
    page = Page(path.with_suffix(".html").read_text(encoding="utf-8"))
    assert not page.sources and "plotly-graph-div" in page.classes and "line" in page.ids


def test_markup_in_the_words_is_shown_and_not_obeyed(tmp_path):
    bad = "<script>alert(1)</script>"
    table = table_text(pd.DataFrame({bad: [bad]}), bad)
    write_html(f"# {bad}\n\n{bad} [x](javascript:{bad})\n\n## {bad}\n\n{table}", tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text and 'href="javascript' not in text


def test_signs_are_dots_that_every_font_has(tmp_path):
    write_html("| a | b |\n| --- | --- |\n| 🟢 holds | 🔴 <not> |", tmp_path / "x.html")
    text = (tmp_path / "x.html").read_text(encoding="utf-8")
    assert text.count("●</span>") == 2 and "🟢" not in text
    assert "&lt;not&gt;" in text and Page(text).open == []


def test_the_index_of_a_table_is_its_first_column_where_it_has_a_name():
    frame = pd.DataFrame({"a": [1.5, None]})
    assert table_text(frame, "c").splitlines()[2:] == ["| a |", "| ---: |", "| 1.5 |", "| — |"]
    assert table_text(TABLE, "c").splitlines()[2] == r"| set | a\|b | note |"


def test_a_template_that_names_what_is_not_there_is_refused(tmp_path):
    template = tmp_path / "x.md.j2"
    template.write_text("{{ nothing }}")
    with pytest.raises(UndefinedError, match="nothing"):
        write_page(template, tmp_path / "x.md", {}, {})
    assert not (tmp_path / "x.md").exists()


def test_a_missing_figure_is_refused(tmp_path):
    with pytest.raises(ArtifactError, match=r"no figure .*none\.png"):
        write_html("![None.](none.png)", tmp_path / "x.html")
    assert not (tmp_path / "x.html").exists()


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "x.md.j2").write_text("x")
    with pytest.raises(StorageError):
        write_page(tmp_path / "x.md.j2", tmp_path / "file" / "x.md", {}, {})
    with pytest.raises(StorageError):
        write_html("x", tmp_path / "file" / "x.html")
