"""HTML pages that are one file: everything is inside, nothing comes from the network."""

from html import escape
from pathlib import Path

_FRAME = Path(__file__).with_name("page.css")


def page(title: str, body: str, scripts: bool = False) -> str:
    """A whole HTML document of a plain title and a body in HTML; its browser loads nothing from outside.

    Nor does it run any script unless the page has its own.
    """
    allowed = "style-src 'unsafe-inline'; img-src data: blob:"
    allowed += "; script-src 'unsafe-inline'" if scripts else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; {allowed}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_FRAME.read_text(encoding='utf-8')}</style>\n"
        f"</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )
