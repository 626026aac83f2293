"""The settings of a command, composed by Hydra from ``conf/``."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from sidegan.base.names import folder_name
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
    """The settings that a command with these overrides would have; within a run, by its own search path."""
    from sidegan.pipeline.settings import validate  # and with it every room

    if GlobalHydra.instance().is_initialized():
        return validate(hydra.compose("config", overrides=list(overrides)))
    with hydra.initialize_config_dir(str(CONF), version_base="1.3"):
        return validate(hydra.compose("config", overrides=list(overrides)))
