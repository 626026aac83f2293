"""A trajectory for each situation that is asked, as files, and a table of what it is worth and took."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from experiments.pages import leave
from sidegan.base.names import folder_name
from sidegan.base.storage import write_bytes
from sidegan.base.typed import build
from sidegan.controllers import Course, csv_text
from sidegan.designer import Aim, Design, Designer, Situation
from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.uncertain import rigid_information
from sidegan.pipeline.known import Known, known_model
from sidegan.pipeline.schema import Asked, Several
from sidegan.pipeline.stages import generator, starts
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker

FOLDER, RATE = "trajectories", 100.0  # [Hz] of the files


@dataclass(frozen=True)
class Answer:
    """What came of one situation."""

    name: str
    asked: Asked
    design: Design


def collect(task: Task) -> list[Answer]:
    """The designer's answers, in the order of the questions."""
    cfg = task.cfg
    known = None if cfg.known is None else known_model(Path(cfg.known), task.arm)
    begin = generator.load if cfg.design.starts == "generator" else starts.load
    designer = Designer(task.constraints, task.trajectory, cfg.designer, begin(task))
    answers = []
    for number, asked in enumerate(questions(task), 1):
        name = folder_name(asked.name or f"situation-{number}")
        try:
            what = _meant(asked, known, cfg.designer.rate)
            design = designer.ask(*what, cfg.design.evaluations, cfg.design.deadline)
        except (ConfigError, ShapeError) as error:
            raise type(error)(f"{name}: {error}") from error
        answers.append(Answer(name, asked, design))
    return answers


def questions(task: Task) -> list[Asked]:
    """The configured situation, or those of the configured file.

    Raises:
        ConfigError: when the file cannot be read, holds none, or two of one name.
    """
    settings = task.cfg.design
    if settings.file is None:
        return [settings.ask]
    try:
        values: Any = yaml.safe_load(Path(settings.file).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"design.file {settings.file}: {error}") from error
    if not isinstance(values, list) or not values:
        raise ConfigError(f"design.file {settings.file} holds no list of situations")
    asked = build(Several, {"situations": values}).situations
    names = [one.name for one in asked if one.name is not None]
    if len(set(names)) < len(names):
        raise ConfigError(f"design.file {settings.file} has situations of one name")
    return asked


def _meant(asked: Asked, known: Known | None, rate: float) -> tuple[Situation, Aim]:
    """Where to move, and for what; beside what is known, with torques measured at a rate [Hz]."""
    regions = [region.shape for region in asked.regions or ()]
    place = Situation(asked.home, regions, asked.velocity, asked.torque, asked.period, asked.clearance)
    if known is None:
        return place, Aim(asked.aim, None, asked.noise, asked.links)
    prior = rigid_information(known.model, known.covariance).numpy()
    noise = asked.noise or ((rate / known.rate) ** 0.5 / known.certainty).tolist()
    return place, Aim(asked.aim, prior, noise, asked.links)


def present(answers: list[Answer], folder: Path, tracker: Tracker) -> None:
    """Write each trajectory, and print, write and record the table."""
    for one in answers:
        if one.design.coefficients is not None:
            write_bytes(folder / FOLDER / f"{one.name}.csv", _csv(one.design))
    rows = {one.name: _row(one) for one in answers}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("situation").fillna("—")
    found = sum(one.design.coefficients is not None for one in answers)
    caption = (
        f"{found} of {len(answers)} situations have a proven trajectory, at {RATE:g} Hz in {folder / FOLDER}"
    )
    leave(folder, tracker, {"designs": (table, caption)})


def _csv(design: Design) -> bytes:
    """One period of a design."""
    assert design.coefficients is not None
    motion = design.trajectory.roll_out(design.coefficients[None], design.trajectory.times(RATE))
    return csv_text(Course.of(design.numbers.arm.joint_names, motion)).encode()


def _row(one: Answer) -> dict[str, str]:
    """What an answer is worth, or what stands in its way."""
    design, spent = one.design, one.design.spent
    effort = {"evaluations": f"{spent.evaluations}", "proofs": f"{spent.proofs}"}
    effort["time [ms]"] = f"{1e3 * spent.seconds:.3g}"
    if design.coefficients is None:
        return {"aim": one.asked.aim, **effort, "blocked by": "; ".join(design.blocked)}
    nearest = [design.margins[name] for name in ("collision", "keep_out") if name in design.margins]
    worth = {
        "period [s]": f"{design.trajectory.period:g}",
        "cond(YᵀY)": f"{design.criteria.condition:.4g}",
        "clearance [m]": f"{min(nearest) + design.constraints.clearance:.3f}" if nearest else "—",
    }
    return {"aim": one.asked.aim, **worth, **effort}
