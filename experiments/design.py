"""A trajectory for each situation that is asked, as files, and a table of what it is worth and took."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import torch
import yaml

from experiments.pages import leave
from sidegan.base.names import folder_name, plain
from sidegan.base.storage import write_bytes
from sidegan.base.typed import build
from sidegan.controllers import POINTS, Course, csv_text
from sidegan.design.criteria import variance
from sidegan.design.prediction import with_terms
from sidegan.designer import Aim, Design, Designer, Situation, noise_at
from sidegan.designer.aim import Kind
from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.goals import usual_products
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.identification.uncertain import information_on, usual_torque
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.known import Known, known_model
from sidegan.pipeline.schema import Asked, Designs, Several
from sidegan.pipeline.stages import generator, starts
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.validity.home import refuse_degrees

FOLDER, RATE = "trajectories", 100.0  # [Hz] of the files


_SINGULAR = (
    "what is proven does not tell all parameters (cond ∞): give it a longer period, more room, or larger "
    "shares of velocity and torque"
)


@dataclass(frozen=True)
class Question:
    """What is asked of the designer."""

    name: str
    asked: Asked
    place: Situation
    aim: Aim


@dataclass(frozen=True)
class Answer:
    """What came of one situation."""

    question: Question
    design: Design
    rate: float  # at which torques are measured [Hz]

    @property
    def blocked(self) -> tuple[str, ...]:
        """What stands in the way of a proven trajectory that tells all parameters, beside what is known."""
        if self.design.coefficients is None:
            return self.design.blocked
        alone = self.question.aim.prior is None
        return (_SINGULAR,) if alone and not math.isfinite(self.design.criteria.condition) else ()


def check(task: Task) -> None:
    """Refuse what cannot be asked, before anything is made for it.

    Raises:
        ConfigError: as ``questions``.
        ShapeError: as ``questions``.
    """
    questions(task)


def collect(task: Task) -> list[Answer]:
    """The designer's answers, in the order of the questions."""
    cfg, asked = task.cfg, questions(task)
    begin = generator.load if cfg.design.starts == "generator" else starts.load
    designer = Designer(task.constraints, task.trajectory, cfg.designer, begin(task))
    answers = []
    for one in asked:
        try:
            design = designer.ask(one.place, one.aim, cfg.design.evaluations, cfg.design.deadline)
        except (ConfigError, ShapeError) as error:
            raise type(error)(f"{one.name}: {error}") from error
        answers.append(Answer(one, design, cfg.designer.rate))
    return answers


def questions(task: Task) -> list[Question]:
    """The configured situation, or those of the configured file.

    Raises:
        ConfigError: when the file cannot be read, holds none, or two of one name; when a situation is in
            degrees, or too fast for its table.
        ShapeError: when a home is not one position per joint.
    """
    cfg = task.cfg
    known = None if cfg.known is None else known_model(Path(cfg.known), task.arm)
    found = []
    for number, asked in enumerate(_asked(cfg.design), 1):
        name = folder_name(asked.name or f"situation-{number}")
        try:
            place, aim = _meant(asked, known, task.body, cfg.designer.rate)
            _refuse_impossible(task, place)
        except (ConfigError, ShapeError) as error:
            raise type(error)(f"{name}: {error}") from error
        found.append(Question(name, asked, place, aim))
    return found


def _asked(settings: Designs) -> list[Asked]:
    """The situations as they are written."""
    if settings.file is None:
        return [settings.ask]
    path = Path(settings.file).expanduser()
    if not path.is_file():
        raise ConfigError(f"there is no file design.file={settings.file}")
    try:
        values: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"design.file {settings.file}: {' '.join(str(error).split())}") from error
    if not isinstance(values, list) or not values:
        raise ConfigError(f"design.file {settings.file} holds no list of situations")
    asked = build(Several, {"situations": values}).situations
    names = [one.name for one in asked if one.name is not None]
    if len(set(names)) < len(names):
        raise ConfigError(f"design.file {settings.file} has situations of one name")
    return asked


def _refuse_impossible(task: Task, place: Situation) -> None:
    """Refuse a home in degrees or of another arm, and a period that is too short for its table."""
    if place.home is not None:
        refuse_degrees(task.arm, place.home, "home")
        place.home_of(task.arm.joints, ())
    harmonics = task.cfg.trajectory.harmonics
    period, least = place.period or task.cfg.trajectory.period, POINTS * harmonics / RATE
    if period < least:
        raise ConfigError(
            f"period is {period:g} s, expected {least:g} or more: tables of {RATE:g} Hz then have {POINTS} "
            f"points per period of the highest of trajectory.harmonics={harmonics}"
        )


def _meant(asked: Asked, known: Known | None, body: RigidBody, rate: float) -> tuple[Situation, Aim]:
    """Where to move, and for what; beside what is known, with torques measured at a rate [Hz]."""
    regions = [region.shape for region in asked.regions or ()]
    place = Situation(asked.home, regions, asked.velocity, asked.torque, asked.period, asked.clearance)
    kind: Kind = "variance" if asked.aim == "prediction" else asked.aim
    tasks = None
    if asked.aim == "prediction":
        model = TorqueModel(body, RIGID) if known is None else known.model
        tasks = usual_products(model, usual_torque(body)).mean(0).numpy()
    if known is None:
        return place, Aim(kind, None, asked.noise, asked.links, tasks=tasks)
    prior = information_on(known.covariance).numpy()
    noise = asked.noise or noise_at(rate, known.rate * known.certainty.square())
    return place, Aim(kind, prior, noise, asked.links, known.model, tasks)


def present(answers: list[Answer], folder: Path, tracker: Tracker) -> None:
    """Write each trajectory, and print, write and record the table."""
    found = [one for one in answers if not one.blocked]
    for one in found:
        write_bytes(folder / FOLDER / f"{one.question.name}.csv", _csv(one.design))
    rows = {one.question.name: _row(one) for one in answers}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("situation").fillna("—")
    which = f"{len(found)} of {len(answers)} situations"
    caption = f"Proven trajectories for {which}, at {RATE:g} Hz in {folder / FOLDER}"
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
    effort["time [ms]"] = plain(1e3 * spent.seconds)
    if one.blocked:
        return {"aim": one.question.asked.aim, **effort, "blocked by": "; ".join(one.blocked)}
    nearest = [design.margins[name] for name in ("collision", "keep_out") if name in design.margins]
    worth = {
        "period [s]": f"{design.trajectory.period:g}",
        "cond(YᵀY)": plain(design.criteria.condition, ".4g"),
        **_uncertain(one),
        "clearance [m]": f"{min(nearest) + design.constraints.clearance:.3f}" if nearest else "—",
    }
    return {"aim": one.question.asked.aim, **worth, **effort}


def _uncertain(one: Answer) -> dict[str, str]:
    """How uncertain predicted torques are with the trajectory, where that was the aim and noise is known."""
    aim, design = one.question.aim, one.design
    if aim.tasks is None or aim.noise is None or design.coefficients is None:
        return {}
    body, family = design.numbers.constraints.body, design.trajectory
    states = family.roll_out(design.coefficients[None], family.grid(round(family.period * one.rate)))[1:]
    q, dq, ddq = (x[0] for x in states)
    y = body.base_regressor(q, dq, ddq)
    if aim.model is not None:
        y = with_terms(aim.model, y, dq, ddq)
    y = y / q.new_tensor(aim.noise)[:, None]
    told, tasks = y.flatten(0, 1).T @ y.flatten(0, 1), variance(torch.from_numpy(aim.tasks))
    known = told.new_zeros(told.shape) if aim.prior is None else torch.from_numpy(aim.prior)
    before, after = (f"{math.exp(-float(tasks.value(x[None])) / 2):.2%}" for x in (known, known + told))
    return {"torques uncertain by": after if aim.prior is None else f"{after}, before {before}"}
