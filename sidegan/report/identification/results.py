"""What an identification leaves: tables, a URDF, a verdict for machines and a report for people."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.names import folder_name
from sidegan.base.storage import write_bytes, write_json
from sidegan.identification.identified import CONSISTENT, EQUAL_WEIGHTS, IdentifiedArm
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import Score
from sidegan.identification.trust import certainty
from sidegan.recording.check import CheckedRecording
from sidegan.report.export import show
from sidegan.report.identification.content import Origin, advice, content
from sidegan.report.identification.mlmodel import MLMODEL, mlmodel_text
from sidegan.report.identification.page import write_report
from sidegan.robot import write_mjcf, write_urdf
from sidegan.robot.consistency import about_the_centre

CHECK, VERDICT, REPORT = "check.json", "verdict.json", "report.html"
PARAMETERS = "parameters.json"  # the model in full
_TABLE, _LINKS = "parameters.csv", "links.csv"
_CLASS, _SOURCE = "model.py", Path(__file__).with_name("torque_model.py")  # copied, never imported
_COMPARED = {"unweighted": EQUAL_WEIGHTS, "consistent": CONSISTENT}
_UPPER = {"Ixx": (0, 0), "Ixy": (0, 1), "Iyy": (1, 1), "Ixz": (0, 2), "Iyz": (1, 2), "Izz": (2, 2)}
_UNITS = {
    **dict.fromkeys(("mx", "my", "mz"), "kg·m"),
    **{"m": "kg", "I": "kg·m²", "Ia": "kg·m²"},
    **{"fv": "N·m·s/rad", "fc": "N·m", "fo": "N·m", "fs": "N·m"},
}


def write_checks(recordings: list[CheckedRecording], folder: Path) -> Path:
    """Write what the check of recordings says; the file's path."""
    write_json(folder / CHECK, [recording.as_json() for recording in recordings])
    return folder / CHECK


def show_checks(recordings: Sequence[CheckedRecording]) -> None:
    """Print what the check says, as tables."""
    show(_sampling(recordings), "Recordings")
    show(_joints(recordings), "Joints [rad, m, N·m, N, A]")
    show(_excitation(recordings), "Share of each base parameter that no other can stand in for")


def _sampling(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per recording: its clock, and what is kept of it."""
    rows = {}
    for recording in recordings:
        raw, grid, repeated = recording.statistics, recording.grid, recording.repeated
        rows[recording.name] = {
            "use": recording.role,
            "samples": raw.samples,
            "seconds": f"{raw.duration:.4g}",
            "rate [Hz]": f"{1 / raw.step:.4g}",
            "jitter": f"{raw.jitter:.1%}",
            "gaps": len(raw.gaps),
            "duplicates": raw.duplicates,
            "corrupt": len(raw.corrupt),
            "bandwidth [Hz]": f"{grid.bandwidth:.3g}",
            "cut-off [Hz]": f"{grid.cutoff:.3g}",
            "kept": recording.kept,
            "lag [ms]": f"{1e3 * recording.lag:.3g}",
            "repetitions": "—" if repeated is None else f"{sum(repeated.counts.values())}",
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")


def _joints(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per recording and joint: ranges, noise floor, saturation and sign."""
    rows = []
    for recording in recordings:
        signals = recording.statistics.signals
        load = "torque" if "torque" in signals else "current"
        position, effort = signals["position"], signals[load]
        fastest = torch.cat([segment.velocity for segment in recording.segments]).abs().amax(0)
        for j, name in enumerate(recording.joint_names):
            rows.append(
                {
                    "recording": recording.name,
                    "joint": name,
                    "position": f"{position.lower[j]:.3g} … {position.upper[j]:.3g}",
                    "fastest": f"{fastest[j]:.3g}",
                    load: f"{effort.lower[j]:.3g} … {effort.upper[j]:.3g}",
                    "noise floor": f"{effort.noise[j]:.2g}",
                    "between repetitions": "—" if recording.noise is None else f"{recording.noise[j]:.2g}",
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agrees with the description": f"{recording.agreement.sign[j]:.2f}",
                    "multiple of it": f"{recording.agreement.load.scale[j]:.2g}",
                }
            )
    return pd.DataFrame(rows).set_index(["recording", "joint"])


def _excitation(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per base parameter, a column per recording."""
    columns = {one.name: [f"{x:.1%}" for x in one.excitation.alone.tolist()] for one in recordings}
    names = list(recordings[0].excitation.names)
    return pd.DataFrame(columns, index=names).rename_axis("base parameter")


def write_results(identified: IdentifiedArm, origin: Origin, folder: Path) -> None:
    """Write all results of an identification into a folder."""
    arm = identified.model.arm
    parameters, links = parameter_table(identified), link_table(identified)
    urdf, mjcf = (f"{folder_name(arm.name)}.{end}" for end in ("urdf", "xml"))
    drives = identified.drives
    files = {
        "parameters with deviations": _TABLE,
        "parameters with covariance": PARAMETERS,
        "consistent links": _LINKS,
        "description with these links and friction": urdf,
        "the same for MuJoCo, with rotors": mjcf,
        f"the model to use ({identified.use}) as a Python class": _CLASS,
        "by which MLflow loads it from this folder": MLMODEL,
        "check of the recordings": CHECK,
        "verdict for machines": VERDICT,
    }
    write_checks(identified.recordings, folder)
    write_bytes(folder / _TABLE, parameters.to_csv(index=False).encode())
    write_bytes(folder / _LINKS, links.to_csv(index=False).encode())
    write_json(folder / PARAMETERS, model_numbers(identified) | {"mjcf": mjcf})
    write_json(folder / VERDICT, verdict(identified))
    write_urdf(arm, identified.links, folder / urdf, drives)
    write_mjcf(arm, identified.links, folder / mjcf, drives)
    write_bytes(folder / _CLASS, _SOURCE.read_bytes())
    write_bytes(folder / MLMODEL, mlmodel_text(arm.joint_names, Path(_CLASS).stem).encode())
    write_report(content(identified, origin, parameters, links, files), folder / REPORT)


def parameter_table(identified: IdentifiedArm) -> pd.DataFrame:
    """A row per identified parameter; relative_std is a share, urdf is NaN where nothing is known."""
    trust, chosen, model = identified.trust, identified.chosen, identified.model
    nominal = [x if i < model.rigid else math.nan for i, x in enumerate(model.nominal.tolist())]
    return pd.DataFrame(
        {
            "name": chosen.names,
            "formula": model.formulas,
            "unit": [_unit(name.rstrip("0123456789")) for name in chosen.names],
            "value": chosen.parameters.tolist(),
            "std": chosen.deviation.tolist(),
            "relative_std": chosen.relative_deviation.tolist(),
            "urdf": nominal,
            "consistent": identified.estimates[CONSISTENT].parameters.tolist(),
            "effect": trust.effect.tolist(),
            "weak": [name in trust.weak for name in chosen.names],
        }
    )


def _unit(kind: str) -> str:
    return _UNITS.get(kind, _UNITS.get(kind[:1], ""))


def link_table(identified: IdentifiedArm) -> pd.DataFrame:
    """Mass, centre of mass and inertia about it of every link of the consistent model."""
    arm, links = identified.model.arm, identified.links
    centre, inertia = about_the_centre(links)
    columns = {"m": links[:, 0], **dict(zip(("cx", "cy", "cz"), centre.T))}
    columns |= {name: inertia[:, i, j] for name, (i, j) in _UPPER.items()}
    columns["urdf_m"] = arm.inertial_parameters[:, 0]
    return pd.DataFrame({"link": arm.link_names, **{name: x.tolist() for name, x in columns.items()}})


def verdict(identified: IdentifiedArm) -> dict[str, Any]:
    """What a machine needs to decide whether to use the model; lists are in the order of the joints."""
    trust, chosen, use, arm = identified.trust, identified.chosen, identified.use, identified.model.arm
    return {
        "robot": arm.name,
        "joints": list(arm.joint_names),
        "method": chosen.method,
        "use": use,
        "advice": advice(identified),
        "verdict": trust.verdict,
        "reasons": trust.reasons,
        "recordings": [recording.name for recording in identified.training],
        "validation": {
            "kind": identified.kind,
            "recordings": [recording.name for recording in identified.validation],
            **_all_errors(identified.tests, use, chosen.method),
            "description": _errors(trust.nominal_score),
        },
        "training": _all_errors(identified.trained, use, chosen.method),
        "condition_number": _number(chosen.condition),
        "weak_parameters": list(trust.weak),
        "torque_deviation": _numbers(trust.torque_deviation),
        "left_over": identified.left_over,
        "torque_bias": _numbers(identified.lacks.error),
        "lacking": [
            {"joint": arm.joint_names[one.joint], "kind": one.kind.name, "share": _number(one.share)}
            for one in identified.lacks.found
        ],
        "whiteness": _numbers(1 / chosen.inflation),
        "data": {recording.name: recording.warnings for recording in identified.recordings},
        "samples": chosen.samples,
    }


def _all_errors(errors: dict[str, Score], use: str, method: str) -> dict[str, Any]:
    """Errors of the model to use, and by name those of the methods that were compared."""
    compared = {name: _errors(errors[other]) for name, other in ({method: method} | _COMPARED).items()}
    return {**_errors(errors[use]), **compared}


def _errors(errors: Score) -> dict[str, Any]:
    return {
        "nmse": _numbers(errors.nmse),
        "nmse_mean": _number(errors.nmse_mean),
        "rmse": _numbers(errors.rmse),
    }


def model_numbers(identified: IdentifiedArm) -> dict[str, Any]:
    """The identified model in full, for programs."""
    model, chosen = identified.model, identified.chosen
    return {
        "robot": model.arm.name,
        "joints": list(model.arm.joint_names),
        "links": list(model.arm.link_names),
        "method": chosen.method,
        "names": list(chosen.names),
        "formulas": list(model.formulas),
        "parameters": chosen.parameters.tolist(),
        "certainty": certainty(chosen).tolist(),
        "rate": identified.training[0].grid.rate,
        "rmse": identified.tests[identified.use].rmse.tolist(),
        "covariance": chosen.covariance.tolist(),
        "sign_width": model.terms.sign_width,
        "stribeck_velocity": None if model.stribeck is None else model.stribeck.tolist(),
        "consistent": _standard(model, identified.standard),
        "use": {"method": identified.use, **_standard(model, identified.used_standard)},
    }


def _standard(model: TorqueModel, standard: Tensor) -> dict[str, Any]:
    """Standard parameters (F,) as links and terms."""
    terms = {kind: standard[model.standard_slice(kind)].tolist() for kind in model.kinds}
    return {"inertial_parameters": model.links_of(standard).tolist(), "terms": terms}


def _numbers(values: Tensor) -> list[float | None]:
    return [_number(x) for x in values.tolist()]


def _number(value: float) -> float | None:
    """None in place of what is not finite, which JSON cannot say."""
    return value if math.isfinite(value) else None
