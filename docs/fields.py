"""Comments on the fields of dataclasses, as the API reference shows them: an extension of griffe."""

from itertools import takewhile

import griffe


class Fields(griffe.Extension):
    """Adds a table of fields to a class that has a docstring, by the comments beside or above them."""

    def on_class(self, *, cls: griffe.Class, **_) -> None:
        """Add the table once a package is read."""
        if "dataclass" not in cls.labels or not cls.docstring:
            return
        source = cls.filepath.read_text(encoding="utf-8").splitlines()
        own = (x for x in cls.attributes.values() if cls.lineno < x.lineno <= cls.endlineno)
        told = cls.docstring.value  # which may describe some itself
        fields = [
            x for x in own if x.is_public and "property" not in x.labels and f"\n    {x.name}: " not in told
        ]
        if rows := [f"    {field.name}: {_comment(source, field)}" for field in fields]:
            cls.docstring.value += "\n\nAttributes:\n" + "\n".join(rows)


def _comment(source: list[str], field: griffe.Attribute) -> str:
    beside = source[field.endlineno - 1].partition("  # ")[2]
    above = takewhile(lambda line: line.startswith("#"), map(str.strip, source[field.lineno - 2 :: -1]))
    return beside or " ".join(line.strip("# ") for line in reversed(list(above))) or "…"
