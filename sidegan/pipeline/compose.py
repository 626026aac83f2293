"""The settings of a command, composed by Hydra from ``conf/``."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf

from sidegan.base.names import folder_name
from sidegan.errors import ConfigError
from sidegan.pipeline.stages import STAGES

if TYPE_CHECKING:
    from sidegan.pipeline.settings import Config

_HERE = Path(__file__).resolve().parents[1]
CONF = next((path for path in (_HERE / "conf", _HERE.parent / "conf") if path.is_dir()), _HERE / "conf")


def times(*factors: Any) -> float | None:
    """A product; null where a factor is no number, which is then refused by its own name too."""
    return math.prod(factors) if all(isinstance(x, int | float) for x in factors) else None


OmegaConf.register_new_resolver("folder_name", folder_name, replace=True)
OmegaConf.register_new_resolver("times", times, replace=True)
_STAGES = "\n".join(f"  {name:<16}{text}" for name, text in STAGES.items())
OmegaConf.register_new_resolver("stages", lambda: _STAGES, replace=True)


def composed(*overrides: str) -> "Config":
    """The settings that a command with these overrides would have; within a run, by its own search path.

    Raises:
        ConfigError: when an override names what is not there, or a value is refused.
    """
    from sidegan.pipeline.settings import validate  # and with it every room

    try:
        return validate(_compose(overrides))
    except HydraException as error:
        raise ConfigError(str(error).partition("\n")[0]) from error


def _compose(overrides: Sequence[str]) -> DictConfig:
    if GlobalHydra.instance().is_initialized():
        return hydra.compose("config", overrides=list(overrides))
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return hydra.compose("config", overrides=list(overrides))
