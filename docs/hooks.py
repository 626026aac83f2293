"""Hooks of mkdocs: files of the repository that are pages of the site, and notebooks as pages."""

import json
import re
from base64 import b64decode
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
PAGES = {"README.md": "index.md", "CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
FILES = ("LICENSE", "CITATION.cff", *(str(path.relative_to(ROOT)) for path in ROOT.glob("examples/*.py")))


def on_files(files: Files, config, **_) -> None:
    """Add files of the repository that pages link to, as though they stood in docs/, and notebooks' pages."""
    for source, page in (PAGES | dict(zip(FILES, FILES))).items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / source)))
    for source in [file for file in files if file.src_uri.endswith(".ipynb")]:
        name = source.src_uri.removesuffix(".ipynb")
        text, pictures = _page(json.loads(source.content_string), Path(name).name)
        files.append(File.generated(config, f"{name}.md", content=text))
        for picture, content in pictures.items():
            files.append(File.generated(config, f"{Path(name).parent}/{picture}", content=content))


def on_page_markdown(markdown: str, page, **_) -> str:
    """The text of a page with links that hold on the site, where README.md is docs/index.md."""
    up = "../" * page.file.src_uri.count("/")
    markdown = re.sub(rf"\]\((?:docs/|{re.escape(up)}\.\./)", f"]({up}", markdown)
    for source, target in PAGES.items():
        markdown = markdown.replace(f"]({up}{source}", f"]({up}{target}")
    return re.sub(r"\]\(([\w/.]+)\.ipynb\)", r"](\1.md)", markdown)


def _page(notebook: dict[str, Any], name: str) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and the pictures in it by the names that it has for them."""
    parts, pictures = [], {}
    for cell in notebook["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        for output in cell.get("outputs", []):
            shown = {kind: "".join(value) for kind, value in output.get("data", {}).items()}
            if "image/png" in shown:
                picture = f"{name}-{len(pictures) + 1}.png"
                pictures[picture] = b64decode(shown["image/png"])
                parts.append(f"![]({picture})")
            elif "text/html" in shown:  # a table of pandas, without its style
                table = re.sub(r"(?s)<style.*?</style>", "", shown["text/html"])
                parts.append(re.sub(r'<table border="1" class="dataframe">', "<table>", table))
            else:
                text = shown.get("text/plain") or "".join(output.get("text", []))
                parts.append(f"```text\n{text.rstrip()}\n```")
    parts.append(f'<a href="../{name}.ipynb" download>This page as a notebook</a>')
    return "\n\n".join(parts), pictures
