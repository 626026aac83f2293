"""Paths of the settings and of the makers' versions: next to the package in a clone, inside it in a wheel."""

from pathlib import Path

_HERE = Path(__file__).resolve().parents[1]
CONF = next((path for path in (_HERE / "conf", _HERE.parent / "conf") if path.is_dir()), _HERE / "conf")
VERSIONS = CONF.with_name("params.yaml")
