"""The command ``sidegan``, or ``python -m sidegan.run``: Hydra composes the settings of jobs, which run."""

import os
import shutil
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from sidegan.base.conf import CONF
from sidegan.pipeline.compose import explain
from sidegan.pipeline.run import BAD_CONFIG, FAILURE, INTERRUPTED, interrupts, run_job
from sidegan.pipeline.sweep import end_sweep

_UNNAMED = ("experiment", "outputs", "seed", "tracking", "publish", "parallel")  # left out of names of runs
_started: list[DictConfig] = []  # settings of the jobs that have begun


def main() -> int:
    """Exit code of the command: 0, 1 for a failure, 2 for a wrong configuration, 130 when interrupted."""
    os.environ.setdefault("HYDRA_FULL_ERROR", "1")  # Hydra's exceptions come here, and not as tracebacks
    # Heavy work runs in worker processes, which idle threads here would slow down. NumPy and torch read these
    # variables when they are imported.
    os.environ.update({f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")})
    # SIGTERM, a scheduler's notice, is like an interrupt: work can be resumed, and MLflow's run is closed.
    interrupts.clear()
    _started.clear()
    for one in (signal.SIGINT, signal.SIGTERM):
        signal.signal(one, _interrupt)
    code, words = 0, ""
    if "hydra/launcher=slurm" in sys.argv and shutil.which("srun") is None:
        sys.stderr.write(
            "error: hydra/launcher=slurm is for a machine that submits to SLURM: there is no srun\n"
        )
        return FAILURE
    if not all(word.startswith("-") for word in sys.argv[1:]):  # --help alone needs none, and answers at once
        from sidegan.pipeline.settings import offer

        offer()
    try:
        _command()
        sys.stdout.flush()  # here and not at the interpreter's end, which would print a traceback
    except KeyboardInterrupt:
        end_sweep("KILLED")
        code, words = INTERRUPTED, "\nstopped; the same command continues where it stopped"
    except (HydraException, OmegaConfBaseException, ValueError) as error:  # ValueError: of null for a group
        if _started and not isinstance(error, HydraException | OmegaConfBaseException):
            raise  # from a job, and not from its command
        code = BAD_CONFIG
        words = f"error: {explain(error)}"
    except BrokenPipeError:  # whoever read what is printed has seen enough, as in --help | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILURE
    except OSError as error:  # from Hydra, which makes the run's folder
        code = FAILURE
        words = f"error: the outputs cannot be written: {error}"
    finally:
        end_sweep("FAILED")
    if words:
        sys.stderr.write(f"{words}\n")
    return code


@hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")
def _command(cfg: DictConfig) -> None:
    _started.append(cfg)
    job = HydraConfig.get()
    overrides: Any = OmegaConf.to_container(job.overrides.task)
    given: Any = OmegaConf.to_container(cfg)  # as it was given: what leads nowhere is refused later, by name
    name = run_name(given.get("experiment"), overrides, given.get("seed"))
    code = run_job(cfg, Path(job.runtime.output_dir), name, overrides)
    # In a sweep the other jobs go on; the callback leaves with the worst code.
    if code and job.mode == RunMode.RUN:
        sys.exit(code)


def run_name(experiment: Any, overrides: list[str], seed: Any) -> str:
    """Name of a run for people, e.g. ``exp1 gan=eigen seed=1``, from what the command line overrides."""
    words = [override.lstrip("+") for override in overrides]
    named = [word for word in words if word.partition("=")[0].partition(".")[0] not in _UNNAMED]
    return f"{' '.join([str(experiment), *named])[:180]} seed={seed}"


def _interrupt(number: int, frame: FrameType | None) -> None:
    interrupts.append(number)
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
