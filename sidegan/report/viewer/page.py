"""The page itself: the data, the 3D library and our scripts in one HTML file."""

import json
import zipfile
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import pandas as pd
from markupsafe import Markup

from sidegan.base.storage import write_bytes
from sidegan.errors import ArtifactError
from sidegan.report.document import web_page
from sidegan.report.viewer.content import View

Steps = Sequence[tuple[str, str]]
_ARCHIVE, _TEMPLATE = "templates/viewer.zip", "viewer.html.template"  # of trimesh, with three.js in it


def write_view(view: View, path: Path, table: pd.DataFrame | None = None, steps: Steps = ()) -> None:
    """Write a view as one HTML file that needs no network.

    Args:
        view: of the arm and its trajectories.
        path: of the file.
        table: a row per trajectory, what it asks of the arm.
        steps: what to do with them, a sentence and a command each.
    """
    head, arrays = view.packed()
    page = web_page(
        "viewer/viewer.html.jinja",
        title=f"Trajectories of {view.head['name']}",
        view=view.head,
        table=None if table is None else table.reset_index(),
        steps=steps,
        data=Markup(script_json(head)),
        arrays=Markup(arrays),
        library=Markup(three_js()),
    )
    write_bytes(path, page)


def script_json(value: object) -> str:
    """JSON that can stand inside a script element, whatever strangers' names hold."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


@cache
def three_js() -> str:
    """The library three.js with its licence, as trimesh's own viewer carries it.

    Raises:
        ArtifactError: when this trimesh has none.
    """
    try:
        package = find_spec("trimesh")  # which takes half a second to import
        folder = Path((package and package.origin) or "").parent
        archive = (folder / "resources" / _ARCHIVE).read_bytes()
        lines = zipfile.ZipFile(BytesIO(archive)).read(_TEMPLATE).decode().splitlines()
        script = next(k for k, line in enumerate(lines) if "<script>" in line)
        library = next(k for k, line in enumerate(lines) if ".THREE={}" in line)
    except (OSError, KeyError, StopIteration, zipfile.BadZipFile) as error:
        raise ArtifactError(
            "this version of trimesh has no three.js: pip install 'trimesh>=4.5,<6'"
        ) from error
    return "\n".join(lines[script : library + 1]).split("<script>", 1)[1]
