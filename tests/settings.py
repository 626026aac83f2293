"""Settings of a room as `conf/` has them, with changes."""

from pathlib import Path

from omegaconf import OmegaConf

from sidegan.base.typed import build

CONF = Path(__file__).parents[1] / "conf"


def settings(kind, name, **changes):
    """Settings of a class from ``conf/<name>.yaml``, or from a section of it, ``<name>:<section>``.

    A changed group is given as a dictionary.

    Raises:
        ConfigError: when a change is out of range.
    """
    file, _, section = name.partition(":")
    values = OmegaConf.load(CONF / f"{file}.yaml")
    values = values[section] if section else values
    for base in values.pop("defaults", ()):
        if base != "_self_":
            values = OmegaConf.merge(OmegaConf.load(CONF / Path(name).parent / f"{base}.yaml"), values)
    return build(kind, OmegaConf.to_container(OmegaConf.merge(values, changes), resolve=True))
