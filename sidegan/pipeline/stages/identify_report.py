"""What the report of an identification is made from, put together from what was found."""

from collections.abc import Mapping
from dataclasses import asdict

import pandas as pd
import torch
import yaml

from sidegan.identification.gather import SAMPLES_AT_ONCE
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages.identify_fit import Fitted
from sidegan.pipeline.stages.identify_read import Examined
from sidegan.report.identification import Finding, Friction, Report, Signals
from sidegan.report.identification.data import Numbers

_LEVELS = {"good": "good", "usable": "fair"}
_CURVE = 101  # points of a friction curve
_CLOUD = 4000  # samples beside it


def report(
    cfg: Config, fitted: Fitted, parameters: pd.DataFrame, links: pd.DataFrame, files: Mapping[str, str]
) -> Report:
    """Everything that the report tells."""
    trust, arm = fitted.trust, fitted.model.arm
    everything = (*fitted.training, *fitted.validation)
    return Report(
        title=arm.name,
        verdict=f"{trust.verdict}: mean nMSE {fitted.tests[fitted.method].nmse.mean():.4f} ({fitted.kind})",
        level=_LEVELS.get(trust.verdict, "poor"),  # type: ignore[arg-type]
        reasons=trust.reasons,
        facts=_facts(fitted),
        joint_names=arm.joint_names,
        findings=[finding for one in everything for finding in _findings(one)],
        errors=_errors(fitted),
        signals=[_signals(fitted, one) for one in everything],
        parameters=parameters,
        covariance=fitted.chosen.covariance.numpy(),
        condition=fitted.chosen.condition,
        singular_values=_singular_values(fitted),
        friction=_friction(fitted),
        links=links,
        recommendations=_recommendations(cfg, fitted),
        settings=_settings(cfg),
        files=files,
        command=_command(cfg),
    )


def _facts(fitted: Fitted) -> dict[str, str]:
    """What is shown large."""
    tests = {name: one.nmse.mean() for name, one in fitted.tests.items()}
    return {
        f"nMSE, {fitted.method}": f"{tests[fitted.method]:.4f}",
        "nMSE, equal weights": f"{tests['ols']:.4f}",
        "nMSE, consistent": f"{tests['consistent']:.4f}",
        "nMSE, description": f"{fitted.trust.nominal_score.nmse.mean():.4f}",
        "condition number": f"{fitted.chosen.condition:.3g}",
        "parameters": f"{fitted.model.count}, {len(fitted.trust.weak)} weak",
        "samples": f"{fitted.chosen.samples}",
    }


def _findings(one: Examined) -> list[Finding]:
    """What the check of a recording found."""
    found, known = one.findings, one.findings.survey
    told = (
        f"{one.role}: {known.samples} samples in {known.duration:.4g} s at {1 / known.step:.4g} Hz; "
        f"{found.grid.statement}; {found.kept} samples of {found.moving:.4g} s in motion are used"
    )
    if found.derived:
        told += f"; {' and '.join(found.derived)} derived"
    noise = {name: signal.noise.max().item() for name, signal in known.signals.items()}
    floors = ", ".join(f"{name} {value:.2g}" for name, value in noise.items())
    return [
        Finding("ok", one.name, told),
        Finding("ok", one.name, f"largest noise floor of a joint (SI units): {floors}"),
        *(Finding("warning", one.name, warning) for warning in found.warnings),
    ]


def _errors(fitted: Fitted) -> pd.DataFrame:
    """A row per joint."""
    trained = fitted.trained[fitted.method]
    frame = pd.DataFrame({"nmse_training": trained.nmse.tolist(), "rmse_training": trained.rmse.tolist()})
    if fitted.tests is fitted.trained:
        return frame
    tested = fitted.tests[fitted.method]
    return frame.assign(nmse_validation=tested.nmse.tolist(), rmse_validation=tested.rmse.tolist())


def _signals(fitted: Fitted, one: Examined) -> Signals:
    """Measured and predicted torques, with a row of NaN between stretches."""
    theta, parts = fitted.chosen.parameters, []
    for segment in one.segments:
        states = (*segment[1:4], segment.sign)
        pieces = zip(*(x.split(SAMPLES_AT_ONCE) for x in states))
        predicted = torch.cat([fitted.model.torque(theta, *piece) for piece in pieces])
        parts.append(torch.cat([segment.time[:, None], segment.torque, predicted], 1))
        parts.append(torch.full_like(parts[-1][:1], torch.nan))
        parts[-1][0, 0] = segment.time[-1]
    rows = torch.cat(parts[:-1]).numpy()
    joints = fitted.model.joints
    torques = rows[:, 1 : joints + 1], rows[:, joints + 1 :]
    return Signals(one.name, one.role, rows[:, 0], *torques)


def _friction(fitted: Fitted) -> Friction | None:
    """The friction law of each joint, beside the torque that rigid bodies and rotors leave."""
    model, theta = fitted.model, fitted.chosen.parameters
    if not model.kinds:
        return None
    whole = [
        torch.cat(x) for x in zip(*(segment[1:5] for one in fitted.training for segment in one.segments))
    ]
    q, dq, ddq, torque = (x[:: max(1, len(whole[0]) // _CLOUD)] for x in whole)
    rest = torque - model.torque(theta, q, dq, ddq) + _rubbing(fitted, dq)
    velocity = torch.linspace(-1, 1, _CURVE, dtype=torch.float64)[:, None] * dq.abs().amax(0)
    curve = _rubbing(fitted, velocity)
    return Friction(*(x.numpy() for x in (velocity.T, curve.T, dq, rest)))


def _rubbing(fitted: Fitted, velocity: torch.Tensor) -> torch.Tensor:
    """Friction and offset [N·m or N], (S, J), at velocities (S, J)."""
    still = torch.zeros_like(velocity)
    y = fitted.model.regressor(still, velocity, still)
    return y[..., fitted.model.rigid :] @ fitted.chosen.parameters[fitted.model.rigid :]


def _singular_values(fitted: Fitted) -> Numbers:
    """Of the weighted regressor with columns scaled to one length, largest first, (P,)."""
    information = fitted.chosen.information
    scale = information.diagonal().sqrt()
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    return torch.linalg.eigvalsh(information / scale[:, None] / scale).clamp_min(0).sqrt().flip(0).numpy()


def _recommendations(cfg: Config, fitted: Fitted) -> list[str]:
    runs = fitted.trust.next_runs
    if runs is not None:
        pairs = zip(runs.indices.tolist(), runs.variance.tolist())
        return [
            f"run trajectory {index} of {cfg.identify.library}: the variance of what is weak falls to "
            f"{left:.0%}"
            for index, left in pairs
        ]
    if fitted.trust.weak:
        return [
            "excite what is weak: give a library of trajectories as identify.library, and those that help "
            "most are named here"
        ]
    return []


def _settings(cfg: Config) -> str:
    groups = {name: asdict(getattr(cfg, name)) for name in ("robot", "recording", "model", "identify")}
    return yaml.safe_dump(groups, sort_keys=False, allow_unicode=True)


def _command(cfg: Config) -> str:
    lists = {"recordings": cfg.recordings, "validation": cfg.validation}
    files = " ".join(f"'{name}=[{','.join(paths)}]'" for name, paths in lists.items() if paths)
    return f"python -m sidegan.pipeline.run +experiment=identify robot.name={cfg.robot.name} {files}"
