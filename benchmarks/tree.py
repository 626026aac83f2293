"""A copy of the project that stays as it is while a long benchmark runs."""

import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def copied(root: Path, tree: Path) -> Path:
    """Files that git knows of the project at ``root``, copied to ``tree`` unless it is there already."""
    if tree.exists():
        return tree
    files = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True)
    unfinished = tree.with_name(f".{tree.name}.tmp")
    shutil.rmtree(unfinished, ignore_errors=True)
    for name in files.stdout.splitlines():
        (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / name, unfinished / name)
    unfinished.rename(tree)
    return tree
