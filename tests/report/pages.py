"""What a browser makes of a page."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Tags in order, identifiers, references to elsewhere, shown text, and what scripts with a name hold.

    What opens has to be closed in order.
    """

    def __init__(self, html):
        super().__init__()
        self.tags, self.ids, self.links, self.held, self._open, self._shown = [], [], [], {}, [], []
        self.feed(html)
        assert not self._open

    @property
    def text(self):
        return " ".join(" ".join(self._shown).split())

    def handle_starttag(self, tag, attributes):
        known = dict(attributes)
        self.tags.append(tag)
        self.ids += [known["id"]] if "id" in known else []
        self.links += [known[key] for key in ("src", "href") if key in known]
        if tag not in ("meta", "input", "br"):
            self._open.append((tag, known.get("id")))

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self._open.pop()

    def handle_endtag(self, tag):
        assert self._open.pop()[0] == tag

    def handle_data(self, data):
        tag, name = self._open[-1] if self._open else ("", None)
        if tag == "script":
            self.held[name] = data
        elif tag != "style":
            self._shown.append(data)
