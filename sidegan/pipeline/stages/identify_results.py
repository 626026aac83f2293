"""What an identification leaves: tables, a URDF, a verdict for machines and a report for people."""

import math
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.storage import write_bytes, write_json
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages.check import CHECK
from sidegan.pipeline.stages.identify_fit import Fitted, Tested
from sidegan.pipeline.stages.identify_report import report
from sidegan.report.identification import write_report
from sidegan.report.identification.data import LINKS
from sidegan.robot import write_urdf
from sidegan.robot.consistency import about_the_centre

VERDICT, REPORT = "verdict.json", "report.html"
PARAMETERS, LINK_TABLE = "parameters", "links.csv"
UNWEIGHTED, CONSISTENT = "ols", "consistent"
_UNITS = {"m": "kg", "I": "kg·m²", "Ia": "kg·m²", "fv": "N·m·s/rad", "fc": "N·m", "fo": "N·m", "fs": "N·m"}


def write_results(cfg: Config, fitted: Fitted, folder: Path) -> None:
    """Write everything that an identification found into a folder."""
    arm = fitted.model.arm
    parameters, links = parameter_table(fitted), link_table(fitted)
    urdf = f"{arm.name}.urdf"
    files = {
        "parameters with deviations": f"{PARAMETERS}.csv",
        "parameters with covariance": f"{PARAMETERS}.json",
        "consistent links": LINK_TABLE,
        "description with these links": urdf,
        "check of the recordings": CHECK,
        "verdict for machines": VERDICT,
    }
    write_bytes(folder / f"{PARAMETERS}.csv", parameters.to_csv(index=False).encode())
    write_json(folder / f"{PARAMETERS}.json", _all_numbers(fitted))
    write_bytes(folder / LINK_TABLE, links.to_csv(index=False).encode())
    write_urdf(arm, fitted.links, folder / urdf)
    write_json(folder / VERDICT, verdict(fitted))
    write_report(report(cfg, fitted, parameters, links, files), folder / REPORT)


def parameter_table(fitted: Fitted) -> pd.DataFrame:
    """A row per identified parameter."""
    trust, model, chosen = fitted.trust, fitted.model, fitted.chosen
    nominal = model.nominal.tolist()
    return pd.DataFrame(
        {
            "name": chosen.names,
            "formula": model.formulas,
            "unit": [_unit(name) for name in chosen.names],
            "value": chosen.parameters.tolist(),
            "std": chosen.deviation.tolist(),
            "relative_std": chosen.relative_deviation.tolist(),
            "urdf": [x if i < model.rigid else math.nan for i, x in enumerate(nominal)],
            "effect": trust.effect.tolist(),
            "weak": [name in trust.weak for name in chosen.names],
        }
    )


def link_table(fitted: Fitted) -> pd.DataFrame:
    """Mass, centre of mass and inertia about it of every link of the consistent model."""
    arm, links = fitted.model.arm, fitted.links
    centre, inertia = about_the_centre(links)
    upper = [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)]
    values = torch.cat([links[:, :1], centre, torch.stack([inertia[:, i, j] for i, j in upper], 1)], 1)
    order = ("link", "m", "cx", "cy", "cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
    frame = pd.DataFrame([[n, *row] for n, row in zip(arm.link_names, values.tolist())], columns=order)
    return frame[list(LINKS)].assign(urdf_m=arm.inertial_parameters[:, 0].tolist())


def verdict(fitted: Fitted) -> dict[str, Any]:
    """What a machine needs to decide whether to use the model; lists are in the order of the joints."""
    trust, held_out = fitted.trust, [one.name for one in fitted.validation]
    tests = {"unweighted": UNWEIGHTED, "consistent": CONSISTENT}
    return {
        "robot": fitted.model.arm.name,
        "joints": list(fitted.model.arm.joint_names),
        "method": fitted.method,
        "verdict": trust.verdict,
        "reasons": trust.reasons,
        "recordings": [one.name for one in fitted.training],
        "validation": {
            "kind": fitted.kind,
            "recordings": held_out,
            **_errors(fitted.tests[fitted.method]),
            **{name: _errors(fitted.tests[method]) for name, method in tests.items()},
            "description": _errors(Tested.of(trust.nominal_score)),
        },
        "training": {
            **_errors(fitted.trained[fitted.method]),
            **{name: _errors(fitted.trained[method]) for name, method in tests.items()},
        },
        "condition_number": _number(fitted.chosen.condition),
        "weak_parameters": list(trust.weak),
        "torque_deviation": _numbers(trust.torque_deviation),
        "whiteness": _numbers(1 / fitted.chosen.inflation),
        "next_trajectories": [] if trust.next_runs is None else trust.next_runs.indices.tolist(),
        "data": {one.name: one.findings.warnings for one in (*fitted.training, *fitted.validation)},
        "samples": fitted.chosen.samples,
    }


def _errors(tested: Tested) -> dict[str, Any]:
    return {
        "nmse": _numbers(tested.nmse),
        "nmse_mean": _number(float(tested.nmse.mean())),
        "rmse": _numbers(tested.rmse),
    }


def _all_numbers(fitted: Fitted) -> dict[str, Any]:
    """The identified model in full, for programs."""
    model, chosen = fitted.model, fitted.chosen
    terms = {kind: fitted.standard[model.standard_slice(kind)].tolist() for kind in model.kinds}
    return {
        "robot": model.arm.name,
        "joints": list(model.arm.joint_names),
        "links": list(model.arm.link_names),
        "method": fitted.method,
        "names": list(chosen.names),
        "formulas": list(model.formulas),
        "parameters": chosen.parameters.tolist(),
        "covariance": chosen.covariance.tolist(),
        "sign_width": model.terms.sign_width,
        "consistent": {"inertial_parameters": fitted.links.tolist(), "terms": terms},
    }


def _unit(name: str) -> str:
    kind = name.rstrip("0123456789")
    if kind in ("mx", "my", "mz"):
        return "kg·m"
    return _UNITS.get(kind, _UNITS.get(kind[:1], ""))


def _numbers(values: Tensor) -> list[float | None]:
    return [_number(x) for x in values.tolist()]


def _number(value: float) -> float | None:
    """None in place of what is not finite, which JSON cannot say."""
    return value if math.isfinite(value) else None
