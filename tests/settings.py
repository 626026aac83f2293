"""Settings of a room as `conf/` has them, with changes."""

from pathlib import Path

from omegaconf import OmegaConf

from sidegan.base.typed import build

CONF = Path(__file__).parents[1] / "conf"


def settings(kind, name, **changes):
    """Settings of a class from ``conf/<name>.yaml``; a changed group is given as a dictionary.

    Raises:
        ConfigError: when a change is out of range.
    """
    values = OmegaConf.load(CONF / f"{name}.yaml")
    for base in values.pop("defaults", ()):
        if base != "_self_":
            values = OmegaConf.merge(OmegaConf.load(CONF / Path(name).parent / f"{base}.yaml"), values)
    return build(kind, OmegaConf.to_container(OmegaConf.merge(values, changes), resolve=True))
