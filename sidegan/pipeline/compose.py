"""Compose a command's settings from ``conf/`` with Hydra, and explain errors in a command."""

import math
import re
from contextlib import nullcontext
from shlex import quote
from typing import TYPE_CHECKING, Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sidegan.base.conf import CONF, options
from sidegan.base.names import folder_name
from sidegan.errors import ConfigError

if TYPE_CHECKING:
    from sidegan.pipeline.settings import Config


def product_of(*factors: Any) -> float | None:
    """A product; null if a factor is not a number, which validation then reports by its own name."""
    return math.prod(factors) if all(isinstance(x, int | float) for x in factors) else None


OmegaConf.register_new_resolver("folder_name", folder_name, replace=True)
OmegaConf.register_new_resolver("times", product_of, replace=True)
_PLUGINS = {"joblib": "sweep", "submitit": "slurm"}  # extras that bring Hydra's launchers
_FOREIGN = re.compile(r"(?<=[=:,\[{])[^=:,\[\]{}]*[^\x00-\x7f][^,\[\]{}]*")  # a value that is not ASCII


def composed(*overrides: str) -> "Config":
    """The settings of a command with these overrides; within a run, with that run's search path."""
    from sidegan.pipeline.settings import offer, validate  # imports every room

    offer()
    within = GlobalHydra.instance().is_initialized()
    try:
        with nullcontext() if within else hydra.initialize_config_dir(str(CONF), version_base="1.3"):
            cfg = hydra.compose("config", overrides=list(overrides))
    except (HydraException, ValueError) as error:  # ValueError: of null for a group
        raise ConfigError(explain(error)) from error
    return validate(cfg)


def explain(error: Exception) -> str:
    """Error message for a command, reworded where Hydra's advice would mislead."""
    text = str(error)
    if isinstance(error, OmegaConfBaseException):  # an unresolvable interpolation
        from sidegan.pipeline.settings import dangling

        return dangling(error)
    if isinstance(error, OverrideParseException) and not ('"' in error.override or error.override.isascii()):
        quoted = quote(_FOREIGN.sub(r'"\g<0>"', error.override))
        return f"{error.override}: characters beyond ASCII need double quotes around the value: {quoted}"
    unknown = re.search(r"Could not override '([^']+)'", text)
    if unknown and "No match in the defaults list" not in text:
        cause = error.__cause__
        parent = getattr(cause, "parent_node", None)
        return _unknown(unknown[1], getattr(cause, "full_key", None) or unknown[1], parent)
    plugin = re.search(r"'hydra/launcher/(joblib|submitit)\w*'", text)
    if plugin and "Could not" in text:
        return f"this launcher needs a plugin: pip install 'sidegan[{_PLUGINS[plugin[1]]}]'"
    lines = text.partition("\nConfig search path:")[0].splitlines()
    return "\n".join(line for line in lines if not line.startswith("\t_"))  # private files of a group


def _unknown(key: str, inner: str, parent: Any) -> str:
    """Error message for a setting, or a key inside a setting, that this command does not have.

    ``parent`` is what was composed of its group.
    """
    from sidegan.base.typed import did_you_mean, names_in
    from sidegan.pipeline.settings import Config

    if inner != key and "." not in inner:  # the group itself is unknown
        inner, parent = key, None
    if re.match(r"gan\.(?!generator\b)\w+\.generator\.", inner):
        return f"{inner}: variants share their generator; set gan.{inner.split('.', 2)[2]}"
    # the schema has the shared generator in each variant
    *group, name = place = tuple(re.sub(r"^gan\.generator\b", "gan.*.generator", inner).split("."))
    if group == ["gan"] and inner != key:
        variants = ", ".join(str(one) for one in parent or () if one != "generator")
        return f"{inner}: gan has generator and the variants {variants}; others are chosen by gan=…"
    siblings = names_in(Config, group)
    groups = parent.items() if isinstance(parent, DictConfig) else ()
    below = [
        ".".join((*group, str(one), name))
        for one, held in groups
        if one != "usual" and OmegaConf.is_dict(held) and name in held
    ]
    near = f"; did you mean {' or '.join(below)}?" if below else did_you_mean(Config, place).replace(".*", "")
    if name in siblings:
        others = (
            f"or of another {group[0]}=…" if group and options(group[0]) else "choose one by +experiment=…"
        )
        return f"{inner}: this is a setting of other experiments, {others}"
    if inner != key and siblings:
        known = ", ".join(siblings)
        return f"{inner.rpartition('.')[0]}: {name} is not a setting of this group, which has {known}{near}"
    return f"{inner}: there is no such setting{near}"
