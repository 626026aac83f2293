"""Where the settings and the makers' versions lie: beside the package in a clone, within it in a wheel."""

from pathlib import Path

_HERE = Path(__file__).resolve().parents[1]
CONF = next((path for path in (_HERE / "conf", _HERE.parent / "conf") if path.is_dir()), _HERE / "conf")
VERSIONS = CONF.with_name("params.yaml")
