"""The command ``python -m sidegan.run``: compose the configuration, check it, run its stages in order."""

import errno
import gc
import logging
import os
import re
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import hydra
from hydra._internal.hydra import Hydra
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sidegan.base.parallel import engine
from sidegan.base.progress import duration
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError, SideganError, StorageError
from sidegan.pipeline.callbacks import PARENT, STATUS, end_sweep
from sidegan.pipeline.compose import CONF
from sidegan.pipeline.stages import STAGES
from sidegan.pipeline.store import Store
from sidegan.pipeline.tracking import Tracker

if TYPE_CHECKING:
    from sidegan.pipeline.settings import Config

log = logging.getLogger(__name__)

FAILURE, BAD_CONFIG, INTERRUPTED = 1, 2, 130  # exit codes

_RENAMED = {"goal.wanted": "goal.objective"}
_MODE = ("hydra.mode", "hydra.searchpath", "--config-", "-cd", "-cp", "-cn")  # of a command that may set it
EVERYTHING = "--help-all"
# What names of runs leave out.
_UNNAMED = ("experiment", "outputs", "seed", "tracking", "publish", "parallel", "hydra")
_PLUGINS = {"joblib": "sweep", "submitit": "slurm"}  # extras that bring Hydra's launchers

_interrupts: list[int] = []  # signals that this command got
_STORAGE = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EEXIST}


def run_stages(config: "Config", run_folder: Path, name: str, overrides: Sequence[str] = ()) -> None:
    """Run the configured stages in order, tracked as one run.

    Args:
        config: the settings of the run.
        run_folder: where logs and tables of this run go.
        name: of the run, for people.
        overrides: of the command, from which other conditions are composed.

    Raises:
        SideganError: whatever a stage refuses; ConfigError before any work.
    """
    from sidegan.pipeline.stage import refuse, run_stage
    from sidegan.pipeline.stages import stage
    from sidegan.pipeline.task import Task

    _check(config)
    for one in config.stages:
        stage(one)  # is imported
    _collect_garbage()
    task = Task(config, Store(Path(config.outputs), run_folder), tuple(overrides))
    for one in config.stages:
        refuse(stage(one), task)
    tracking, parent = config.tracking, os.environ.get(PARENT)
    where = task.store.root, run_folder, config.experiment, name, tracking.uri, tracking.enabled
    tracker = Tracker(*where, parent, 0.0 if parent else tracking.patience)
    with tracker, engine(config.parallel.backend, config.parallel.scheduler):
        tracker.log_params(config.plain())
        if config.has("robot"):
            task.tell_arm()
        if config.has("workspace", "trajectory"):
            task.tell_checks()
        for one in config.stages:
            log.info("%s …", one)
            began = time.monotonic()
            run_stage(one, stage(one), task, tracker)
            seconds = time.monotonic() - began
            log.info("%s: done in %s", one, duration(seconds))
            tracker.log_metrics({f"stage seconds/{one}": seconds})


def run_job(cfg: DictConfig, run_folder: Path, name: str, overrides: Sequence[str] = ()) -> int:
    """Exit code of one job; its outcome is logged and left in its folder.

    Args:
        cfg: the composed configuration.
        run_folder: where logs and tables of this job go.
        name: of the job, for people.
        overrides: of its command.
    """
    from sidegan.pipeline.settings import validate

    try:
        run_stages(validate(cfg), run_folder, name, overrides)
    except KeyboardInterrupt:
        _leave(run_folder, INTERRUPTED, "interrupted")
        raise
    except Exception as error:
        if _interrupts:  # whoever was at work lost the exception, and failed at what it left undone
            _leave(run_folder, INTERRUPTED, "interrupted")
            raise KeyboardInterrupt from error
        code = BAD_CONFIG if isinstance(error, ConfigError) else FAILURE
        if isinstance(error, SideganError) or getattr(error, "errno", None) in _STORAGE:
            log.error("error: %s", error)
        else:
            log.exception("error: unexpected %s", type(error).__name__)
        _leave(run_folder, code, f"{type(error).__name__}: {error}")
        return code
    _leave(run_folder, 0, None)
    return 0


def run_name(experiment: str, overrides: list[str], groups: Mapping[str, Any], seed: Any) -> str:
    """Name of a run for people, e.g. ``eigen seed=1``, from what was overridden on the command line.

    Chosen stages come first, since lists of runs show only the beginning; they are lists of one experiment,
    whose name stands where nothing was overridden.
    """
    stages, parts = [], []
    for override in overrides:
        key, _, value = override.lstrip("+").partition("=")
        if key == "stages":
            stages.append(value.strip("[]"))
        elif key.partition(".")[0] not in _UNNAMED:
            parts.append(value if key in groups else f"{key}={value}")
    return " ".join([*([*stages, *parts] or [experiment]), f"seed={seed}"])[:200]


def main() -> int:
    """Exit code of the command: 0, 1 for a failure, 2 for a wrong configuration, 130 when interrupted."""
    gc.disable()  # imports leave none, and looking for it takes a fifth of their time
    # Hydra copies its store of configurations, of which there is one, for every group that --help lists.
    ConfigStore.__deepcopy__ = lambda store, memo: store  # type: ignore[attr-defined]
    # It composes everything a first time to read hydra.mode, which is set nowhere in our conf/.
    if not any(word in argument for argument in sys.argv for word in _MODE):
        Hydra.get_mode = lambda *arguments, **named: None  # type: ignore[method-assign]
    os.environ.setdefault("HYDRA_FULL_ERROR", "1")  # Hydra's exceptions come here, and not as tracebacks
    # A scheduler's notice ends it like an interrupt: files that can be resumed, and a closed run.
    _interrupts.clear()
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, _interrupt)
    if EVERYTHING in sys.argv:
        sys.argv = [sys.argv[0], "--help", "hydra/help=everything"]
    try:
        _hydra_main()
        sys.stdout.flush()  # here and not at the interpreter's end, which would print a traceback
    except KeyboardInterrupt:
        end_sweep("KILLED")
        sys.stderr.write("\nstopped; the same command again goes on where it was\n")
        return INTERRUPTED
    except OmegaConfBaseException as error:  # while Hydra composes: an interpolation that leads nowhere
        from sidegan.pipeline.settings import refused_value

        sys.stderr.write(f"error: {refused_value(error)}\n")
        return BAD_CONFIG
    except (HydraException, ValueError) as error:  # ValueError: a word that Hydra takes for another
        sys.stderr.write(f"error: {explain(error)}\n")
        return BAD_CONFIG
    except RuntimeError as error:
        if "srun" not in str(error):
            raise
        sys.stderr.write(f"error: hydra/launcher=slurm is for a machine that submits to SLURM: {error}\n")
        return FAILURE
    except BrokenPipeError:  # whoever read what is printed has seen enough, as in --help | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILURE
    except OSError as error:  # from Hydra, which makes the run's folder
        sys.stderr.write(f"error: the outputs cannot be written: {error}\n")
        return FAILURE
    finally:
        _collect_garbage()
        end_sweep("FAILED")
    return 0


def explain(error: Exception) -> str:
    """What is wrong with the command line, in our words where Hydra's advice leads astray."""
    text = str(error)
    unknown = re.search(r"Could not override '([^']+)'", text)
    if unknown and "No match in the defaults list" not in text:
        return _unknown(unknown[1], getattr(error.__cause__, "full_key", None) or unknown[1])
    listed = re.search(r"invalid literal for int\(\) with base 10: '([^']+)'", text)
    if listed:
        return f"{_argument(listed[1])}: what this would set is a list, and {listed[1]} names no entry of it"
    plugin = re.search(r"'hydra/launcher/(joblib|submitit)\w*'", text)
    if plugin and "Could not" in text:
        return f"this launcher needs a plugin: pip install 'sidegan[{_PLUGINS[plugin[1]]}]'"
    lines = text.partition("\nConfig search path:")[0].splitlines()
    return "\n".join(line for line in lines if not line.startswith("\t_"))  # private files of a group


def _argument(word: str) -> str:
    """The setting on the command line whose name has a word in it, else the word."""
    names = [argument.partition("=")[0].lstrip("+~") for argument in sys.argv[1:]]
    return next((name for name in names if word in name.split(".")), word)


def _unknown(key: str, inner: str) -> str:
    """What is wrong with a setting that this command does not have, or that is within the one it sets."""
    from sidegan.base.typed import settings_of, suggest
    from sidegan.pipeline.settings import Config

    if inner in _RENAMED:
        return f"{inner}: this setting is called {_RENAMED[inner]} now"
    group, _, name = inner.rpartition(".")
    beside = settings_of(Config, group)
    if inner != key and beside and name not in beside:
        near = suggest(Config, inner, beside)
        return f"{group}: {name} is no setting of this group, which has {', '.join(beside)}{near}"
    suggestion = suggest(Config, inner)
    if suggestion == f"; did you mean {inner}?":
        return f"{inner}: this is a setting of other experiments, choose one by +experiment=…"
    return f"{inner}: there is no such setting{suggestion}"


@hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")
def _hydra_main(cfg: DictConfig) -> None:
    job = HydraConfig.get()
    given: Any = OmegaConf.to_container(cfg)  # as it was given: what leads nowhere is refused later, by name
    overrides: Any = OmegaConf.to_container(job.overrides.task)
    name = run_name(str(given["experiment"]), overrides, job.runtime.choices, given["seed"])
    code = run_job(cfg, Path(job.runtime.output_dir), name, overrides)
    # In a sweep the other jobs go on; the callback leaves with the worst code.
    if code and job.mode == RunMode.RUN:
        sys.exit(code)


def _check(config: "Config") -> None:
    choices = ", ".join(STAGES)
    if not config.stages:
        raise ConfigError(f"there is nothing to run: give +experiment=…, or 'stages=[…]' of {choices}")
    for stage in config.stages:
        if stage not in STAGES:
            raise ConfigError(f"stages: there is no stage {stage!r}, expected some of {choices}")
    if config.parallel.backend == "dask" and find_spec("distributed") is None:
        raise ConfigError("parallel=dask needs Dask: pip install 'sidegan[dask]'")
    if config.device != "cpu":
        import torch

        try:
            torch.zeros(1, device=config.device)
        except (RuntimeError, AssertionError) as error:  # torch asserts that it was built for the device
            reason = str(error).split("\n", 1)[0]
            raise ConfigError(f"device is {config.device!r}, which is not there: {reason}") from error


def _interrupt(number: int, frame: FrameType | None) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def _collect_garbage() -> None:
    """Look for garbage from now on, but not among what was imported."""
    if not gc.isenabled():
        gc.freeze()
        gc.enable()


def _leave(run_folder: Path, code: int, error: str | None) -> None:
    with suppress(StorageError):  # when the disk is full, that is what is told
        write_json(run_folder / STATUS, {"code": code, "error": error})


if __name__ == "__main__":
    sys.exit(main())
