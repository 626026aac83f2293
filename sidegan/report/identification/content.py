"""Content of the report of an identification: plain arrays and tables, from the identified arm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
import torch
import yaml

from sidegan.identification.identified import CONSISTENT, EQUAL_WEIGHTS, IdentifiedArm
from sidegan.identification.measurements import SAMPLES_AT_ONCE
from sidegan.identification.score import shown
from sidegan.recording.check import CheckedRecording

Numbers = np.ndarray[Any, np.dtype[np.floating[Any]]]
Level = Literal["good", "fair", "poor"]

_LEVELS: dict[str, Level] = {"good": "good", "usable": "fair"}
_NAMES = {EQUAL_WEIGHTS: "equal weights"}  # of methods, for people
_METHODS = {
    "weighted": "least squares in which each joint's torques count by their noise",
    EQUAL_WEIGHTS: "least squares in which all torques count alike: large joints outweigh small ones",
    "rls": "least squares one sample after another, as while an arm runs",
    CONSISTENT: "links that can exist, pulled towards the description as far as the data leaves them open",
    "description": "the description's own links, with friction and rotors fitted to the data",
}
_CURVE = 101  # points of a friction curve
_CLOUD = 4000  # samples beside it


class Finding(NamedTuple):
    """Something that the check of the data says."""

    level: Literal["ok", "warning", "error"]  # how bad it is
    where: str  # the recording, or the joint
    text: str  # a sentence


class Signals(NamedTuple):
    """Torques of one recording [N·m or N]; a row of NaN breaks the line."""

    name: str  # of the recording
    role: Literal["training", "validation"]  # what it was used for
    time: Numbers  # [s], (S,)
    measured: Numbers  # (S, J)
    predicted: Numbers  # of the same states by the identified model, (S, J)

    @property
    def residual(self) -> Numbers:
        """Measured less predicted torque, (S, J)."""
        return self.measured - self.predicted


class Friction(NamedTuple):
    """Friction of each joint."""

    velocity: Numbers  # of the curve [rad/s or m/s], (J, K)
    torque: Numbers  # identified friction with offset [N·m or N], (J, K)
    measured_velocity: Numbers  # of samples, (N, J)
    measured: Numbers  # their torque less that of the rigid body, (N, J)


@dataclass(frozen=True, eq=False)
class Report:
    """Content of the report of an identification, in the order in which it is shown."""

    title: str  # the arm
    verdict: str  # whether to trust the model, in a sentence
    level: Level  # of the verdict
    advice: str  # which model to use, in a sentence
    reasons: Sequence[str]  # for the verdict, a sentence each
    facts: Mapping[str, str]  # what → how much, shown large
    joint_names: Sequence[str]  # of the J joints
    torque_units: Sequence[str]  # of each joint's torque or force
    methods: Mapping[str, str]  # what each of the compared models is, a sentence each
    findings: Sequence[Finding]  # of the check of the data
    errors: pd.DataFrame  # a row per joint, in order, with columns nmse_ and rmse_ of training and validation
    signals: Sequence[Signals]  # one per recording
    parameters: pd.DataFrame  # of ``results.parameter_table``
    covariance: Numbers  # of the parameters' errors in their order, (P, P)
    condition_number: float  # of the weighted regressor
    friction: Friction | None  # curves and samples; None of a model without any
    links: pd.DataFrame  # consistent inertial parameters, of ``results.link_table``
    left_over: Sequence[str]  # of the torques: what it is, a sentence for each joint that shows something
    recommendations: Sequence[str]  # what to do next, a sentence each
    settings: str  # as text
    files: Mapping[str, str]  # what → name of a file beside the report
    command: str  # that made it


def correlation_of(covariance: Numbers) -> Numbers:
    """Correlation (P, P) of a covariance; a parameter without variance is correlated with none."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    correlation = covariance / scale / scale[:, None]
    np.fill_diagonal(correlation, 1.0)
    return np.clip(correlation, -1.0, 1.0)


class Origin(NamedTuple):
    """How an identification was made."""

    command: str  # that made it
    excite: str  # command that designs trajectories for the arm
    settings: Mapping[str, Any]  # by group, plain values


def content(
    identified: IdentifiedArm,
    origin: Origin,
    parameters: pd.DataFrame,
    links: pd.DataFrame,
    files: Mapping[str, str],
) -> Report:
    """Content of the report of an identified arm."""
    trust, arm = identified.trust, identified.model.arm
    recordings, chosen = identified.recordings, identified.chosen
    error = identified.tests[identified.use].nmse_mean
    return Report(
        title=arm.name,
        verdict=f"{trust.verdict}: mean nMSE {shown(error)} ({identified.kind})",
        level=_LEVELS.get(trust.verdict, "poor"),
        advice=advice(identified),
        reasons=trust.reasons,
        facts=_facts(identified),
        joint_names=arm.joint_names,
        torque_units=["N" if slides else "N·m" for slides in arm.prismatic.tolist()],
        methods=_methods(chosen.method),
        findings=[finding for recording in recordings for finding in _findings(recording)],
        errors=_errors(identified),
        signals=[_signals(identified, recording) for recording in recordings],
        parameters=parameters,
        covariance=chosen.covariance.numpy(),
        condition_number=chosen.condition,
        friction=_friction(identified),
        links=links,
        left_over=identified.left_over,
        recommendations=_recommendations(identified, origin.excite),
        settings=yaml.safe_dump(dict(origin.settings), sort_keys=False, allow_unicode=True),
        files=files,
        command=origin.command,
    )


def advice(identified: IdentifiedArm) -> str:
    """Which model to use and why, and what the description is worth beside it, a sentence each."""
    error = shown(identified.trust.nominal_score.nmse_mean)
    described = f"The description's own links, with friction fitted to the data, have a mean nMSE of {error}"
    return f"{_use(identified)} {described} on {identified.trust.where}."


def _use(identified: IdentifiedArm) -> str:
    use, method, trust = identified.use, identified.chosen.method, identified.trust
    if trust.other_gravity:
        return "Use none of these models: their links are what makes up for a gravity that is another one."
    if not trust.judged.nmse_mean < 1:
        return "Use none of these models: none predicts better than the mean torque does."
    if use == CONSISTENT == method:
        return "Use the consistent model: the URDF, the MJCF and the Python class hold it."
    errors = {name: float(error.mean()) for name, error in identified.unseen.items()}
    if not errors:
        return (
            "Use the consistent model, whose bodies can exist: nothing was held out, and halves of the "
            "recordings tell too little to predict each other. URDF, MJCF and Python class hold it."
        )
    compared = f"mean nMSE {shown(errors[CONSISTENT])} against {shown(errors[method])} of the {method} one"
    compared += f", {identified.unseen_kind}"
    if use == CONSISTENT:
        return (
            "Use the consistent model: bodies that can exist predict as well or better "
            f"({compared}). The URDF, the MJCF and the Python class hold it."
        )
    return (
        f"Use the {method} model, which the Python class holds: no bodies that can exist predict as well "
        f"({compared}). The URDF and the MJCF hold the consistent one, since simulators refuse others."
    )


def _facts(identified: IdentifiedArm) -> dict[str, str]:
    """Numbers that are shown large."""
    trust, chosen, use = identified.trust, identified.chosen, identified.use
    errors = {name: shown(one.nmse_mean) for name, one in identified.tests.items()}
    names = {name: _NAMES.get(name, name) for name in (chosen.method, EQUAL_WEIGHTS, CONSISTENT)}
    return {
        **{f"nMSE, {name}" + " (use this)" * (key == use): errors[key] for key, name in names.items()},
        "nMSE, description": shown(trust.nominal_score.nmse_mean),
        "condition number": f"{chosen.condition:.3g}",
        "parameters": f"{identified.model.count}, {len(trust.weak)} weak",
        "samples": f"{chosen.samples}",
    }


def _methods(chosen: str) -> dict[str, str]:
    """What each of the compared models is, the chosen one first."""
    names = (chosen, EQUAL_WEIGHTS, CONSISTENT, "description")
    return {_NAMES.get(name, name): _METHODS[name] for name in dict.fromkeys(names)}


def _findings(recording: CheckedRecording) -> list[Finding]:
    """What the check of a recording says."""
    raw, name = recording.statistics, recording.name
    use = (
        f"{recording.role}: {raw.samples} samples in {raw.duration:.4g} s at {1 / raw.step:.4g} Hz; "
        f"{'; '.join(recording.statements)}; {recording.kept} samples of {recording.moving:.4g} s in motion "
        "are used"
    )
    if recording.derived:
        use += f"; {' and '.join(recording.derived)} derived"
    floors = ", ".join(f"{signal} {one.noise.max().item():.2g}" for signal, one in raw.signals.items())
    return [
        Finding("ok", name, use),
        Finding("ok", name, f"largest noise floor of a joint (SI units): {floors}"),
        *(Finding("warning", name, warning) for warning in recording.warnings),
    ]


def _errors(identified: IdentifiedArm) -> pd.DataFrame:
    """A row per joint."""
    uses = {"training": identified.trained}
    if identified.tests is not identified.trained:
        uses["validation"] = identified.tests
    errors = {use: by_method[identified.use]._asdict() for use, by_method in uses.items()}
    return pd.DataFrame({f"{k}_{use}": x.tolist() for use, one in errors.items() for k, x in one.items()})


def _signals(identified: IdentifiedArm, recording: CheckedRecording) -> Signals:
    """Measured and predicted torques, with a row of NaN between stretches."""
    model, theta, parts = identified.model, identified.used.parameters, []
    for segment in recording.segments:
        pieces = zip(*(x.split(SAMPLES_AT_ONCE) for x in (*segment[1:4], segment.sign)))
        predicted = torch.cat([model.torque(theta, *piece) for piece in pieces])
        parts.append(torch.cat([segment.time[:, None], segment.torque, predicted], 1))
        parts.append(torch.full_like(parts[-1][:1], torch.nan))
        parts[-1][0, 0] = segment.time[-1]
    time, *torques = torch.cat(parts[:-1]).split([1, model.joints, model.joints], 1)
    return Signals(recording.name, recording.role, time[:, 0].numpy(), *(x.numpy() for x in torques))


def _friction(identified: IdentifiedArm) -> Friction | None:
    """The friction law of each joint, beside the torque that rigid bodies and rotors leave."""
    model, theta = identified.model, identified.used.parameters
    if not model.kinds:
        return None
    segments = [segment[1:5] for recording in identified.training for segment in recording.segments]
    whole = [torch.cat(x) for x in zip(*segments)]
    q, dq, ddq, torque = (x[:: max(1, len(whole[0]) // _CLOUD)] for x in whole)

    def friction(velocity: torch.Tensor) -> torch.Tensor:
        """Friction and offset [N·m or N], (S, J)."""
        still = torch.zeros_like(velocity)
        return model.regressor(still, velocity, still)[..., model.rigid :] @ theta[model.rigid :]

    rest = torque - model.torque(theta, q, dq, ddq) + friction(dq)
    velocity = torch.linspace(-1, 1, _CURVE, dtype=torch.float64)[:, None] * dq.abs().amax(0)
    return Friction(*(x.numpy() for x in (velocity.T, friction(velocity).T, dq, rest)))


def _recommendations(identified: IdentifiedArm, command: str) -> list[str]:
    """What to run next, a sentence each."""
    if identified.trust.other_gravity:
        return ["mend what the verdict names first: no motion helps as long as that is wrong"]
    same = "more motion of the same kind leaves the bias as it is"
    asked = [f"record {motion}: {same}" for motion in identified.helpful_motions]
    if not identified.trust.weak:
        return asked
    return [
        *asked,
        "record trajectories that are optimised for what these recordings left uncertain, in your workspace, "
        f"and identify from all of them: {command} known=FOLDER, with this report's own folder as FOLDER",
    ]
