"""Settings in ``conf/``: where they are, the defaults that they begin with, and what a choice composes."""

import threading
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from sidegan.errors import ConfigError

_HERE = Path(__file__).resolve().parents[1]  # conf/ is next to the package in a clone, inside it in a wheel
CONF = next((path for path in (_HERE / "conf", _HERE.parent / "conf") if path.is_dir()), _HERE / "conf")
VERSIONS = CONF.with_name("params.yaml")  # of what makes artifacts
_composing = threading.Lock()  # Hydra's state is the process's


def options(group: str) -> list[str]:
    """Names of the options of a group, files that a command chooses from."""
    return sorted(path.stem for path in (CONF / group).glob("[!_]*.yaml"))


def defaults(kind: type) -> dict[str, Any]:
    """The defaults of a dataclass as plain values; fields without one are left out."""
    values = dict[str, Any]()
    for field in fields(kind):
        made = field.default if field.default_factory is MISSING else field.default_factory()
        if made is not MISSING:
            values[field.name] = asdict(made) if is_dataclass(made) and not isinstance(made, type) else made
    return values


def offer_defaults(kinds: Mapping[str, type]) -> None:
    """Offer the defaults of dataclasses to files in ``conf/``, as options of the group ``defaults``."""
    from hydra.core.config_store import ConfigStore

    for name, kind in kinds.items():
        ConfigStore.instance().store(name, defaults(kind), group="defaults", package=name)


def chosen(group: str, option: str, kinds: Mapping[str, type], *others: str) -> dict[str, Any]:
    """Plain settings of a group as ``group=option`` composes them, at scale quick.

    They may refer to the defaults of ``kinds``, as in ``offer_defaults``, and to further choices, such as
    ``defaults@gan.generator=generator``.

    Raises:
        ConfigError: when there is no such option; names those that there are.
    """
    from hydra import compose, initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from omegaconf import OmegaConf

    if option not in (known := options(group)):
        raise ConfigError(f"there is no {group}={option}, expected one of {', '.join(known)}")
    offer_defaults(kinds)
    words = [f"+{word}" for word in ("scale=quick", *others, f"{group}={option}")]
    with _composing:
        state = GlobalHydra.instance()
        outer, state.hydra = state.hydra, None  # of a command in which this is called
        try:
            with initialize_config_dir(str(CONF), version_base="1.3"):
                composed = compose(overrides=words)
        finally:
            state.hydra = outer
    values: Any = OmegaConf.to_container(composed[group], resolve=True)
    return values
