"""What a report of an identification is made from: plain arrays and tables, checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pandas as pd

from sidegan.errors import ShapeError

Numbers = np.ndarray[Any, np.dtype[np.floating[Any]]]

ERRORS = ("nmse_training", "nmse_validation", "rmse_training", "rmse_validation")
PARAMETERS = ("name", "formula", "unit", "value", "std", "relative_std", "urdf", "weak")
LINKS = ("link", "m", "cx", "cy", "cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
LEVELS = ("good", "fair", "poor")


@dataclass(frozen=True)
class Finding:
    """Something that the check of the data found.

    Attributes:
        level: how bad it is.
        where: the recording, or the joint.
        text: what was found, in a sentence.
    """

    level: Literal["ok", "warning", "error"]
    where: str
    text: str


@dataclass(frozen=True, eq=False)
class Signals:
    """Torques of one recording [N·m or N]; a row of NaN breaks the line.

    Attributes:
        name: of the recording.
        role: what it was used for.
        time: [s], (S,).
        measured: (S, J).
        predicted: of the same states by the identified model, (S, J).
    """

    name: str
    role: Literal["training", "validation"]
    time: Numbers
    measured: Numbers
    predicted: Numbers


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of each joint.

    Attributes:
        velocity: of the curve [rad/s or m/s], (J, K).
        torque: identified friction with offset [N·m or N], (J, K).
        measured_velocity: of samples, (N, J).
        measured: their torque less that of the rigid body, (N, J).
    """

    velocity: Numbers
    torque: Numbers
    measured_velocity: Numbers
    measured: Numbers


@dataclass(frozen=True, eq=False)
class Report:
    """All that the report of an identification tells, in the order in which it tells it.

    Attributes:
        title: the arm.
        verdict: whether to trust the model, in a sentence.
        level: of the verdict.
        reasons: for the verdict, a sentence each.
        facts: what → how much, shown large.
        joint_names: of the J joints.
        findings: of the check of the data.
        errors: a row per joint, in order, with any of the columns ``ERRORS``.
        signals: one per recording.
        parameters: a row per parameter with the columns ``PARAMETERS``; relative_std is a share, urdf
            is NaN where nothing is known.
        covariance: of the parameters' errors in their order, (P, P).
        condition: number of the weighted regressor.
        singular_values: of the same, (P,).
        friction: curves and samples.
        links: consistent inertial parameters about the centre of mass, with the columns ``LINKS``.
        recommendations: what to do next, a sentence each.
        settings: as text.
        files: what → name of a file beside the report.
        command: that made it.

    Raises:
        ShapeError: when a table lacks a column or sizes do not match.
    """

    title: str
    verdict: str
    level: Literal["good", "fair", "poor"]
    reasons: Sequence[str]
    facts: Mapping[str, str]
    joint_names: Sequence[str]
    findings: Sequence[Finding]
    errors: pd.DataFrame
    signals: Sequence[Signals]
    parameters: pd.DataFrame
    covariance: Numbers | None = None
    condition: float | None = None
    singular_values: Numbers | None = None
    friction: Friction | None = None
    links: pd.DataFrame | None = None
    recommendations: Sequence[str] = ()
    settings: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    command: str = ""

    def __post_init__(self) -> None:
        joints, count = len(self.joint_names), len(self.parameters)
        if self.level not in LEVELS:
            raise ShapeError(f"the verdict's level is {self.level!r}, expected one of {', '.join(LEVELS)}")
        _columns("parameters", self.parameters, PARAMETERS)
        if len(self.errors) != joints or not set(self.errors) & set(ERRORS):
            raise ShapeError(
                f"errors: {len(self.errors)} rows, expected {joints} with any of {', '.join(ERRORS)}"
            )
        for one in self.signals:
            _same(f"{one.name}: measured", one.measured, (len(one.time), joints))
            _same(f"{one.name}: predicted", one.predicted, (len(one.time), joints))
        if self.covariance is not None:
            _same("covariance", self.covariance, (count, count))
        if self.friction is not None:
            _same("friction: torque", self.friction.torque, (joints, self.friction.velocity.shape[-1]))
            _same("friction: velocity", self.friction.velocity, self.friction.torque.shape)
            _same(
                "friction: measured", self.friction.measured, (len(self.friction.measured_velocity), joints)
            )
            _same(
                "friction: measured velocity", self.friction.measured_velocity, self.friction.measured.shape
            )
        if self.links is not None:
            _columns("links", self.links, LINKS)


def _columns(name: str, table: pd.DataFrame, wanted: Sequence[str]) -> None:
    missing = [column for column in wanted if column not in table]
    if missing:
        raise ShapeError(f"{name} lack the columns {', '.join(missing)}")


def _same(name: str, array: Numbers, shape: tuple[int, ...]) -> None:
    if array.shape != shape:
        raise ShapeError(f"{name} is {array.shape}, expected {shape}")
