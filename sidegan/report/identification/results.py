"""Files of an identification: tables, models, a machine-readable verdict, and an HTML report."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from markupsafe import Markup

from sidegan.base.arrays import Array
from sidegan.base.names import folder_name, plain
from sidegan.base.storage import write_bytes, write_json, write_mlmodel
from sidegan.identification.estimate import Score
from sidegan.identification.identified import CONSISTENT, EQUAL_WEIGHTS, IdentifiedArm
from sidegan.identification.model import TorqueModel
from sidegan.recording.checked import CheckedRecording
from sidegan.report.document import rendered
from sidegan.report.identification import content
from sidegan.report.identification.c_header import c_header
from sidegan.report.identification.content import Origin, advice, link_table, parameter_table
from sidegan.report.identification.files import file_errors
from sidegan.robot import write_mjcf, write_urdf

VERDICT, REPORT = "verdict.json", "report.html"
PARAMETERS = "parameters.json"  # the model in full
_TABLE, _LINKS = "parameters.csv", "links.csv"
_HEADER = "arm.h"
_CLASS, _SOURCE = "model.py", Path(__file__).with_name("arm_dynamics.py")  # copied, never imported
_RECORDINGS = 12  # most recordings in plots
_ROUNDING = 1e-12  # numbers below are shown as zero
_COMPARED = {"unweighted": EQUAL_WEIGHTS, "consistent": CONSISTENT}


def write_results(identified: IdentifiedArm, origin: Origin, folder: Path) -> None:
    """Write all results of an identification into a folder."""
    arm = identified.model.arm
    urdf, mjcf = f"{folder_name(arm.name)}.urdf", f"{folder_name(arm.name)}.xml"
    numbers = model_numbers(identified)
    names = [recording.name for recording in identified.training]
    write_checks(identified.recordings, folder)
    write_bytes(folder / _TABLE, parameter_table(identified).to_csv(index=False).encode())
    write_bytes(folder / _LINKS, link_table(identified).to_csv(index=False).encode())
    write_json(folder / PARAMETERS, numbers | {"mjcf": mjcf})
    write_urdf(arm, identified.links, folder / urdf, identified.drives("viscous", "coulomb"))
    drives = identified.drives("viscous", "coulomb", "rotor_inertia")
    write_mjcf(arm, identified.links, folder / mjcf, drives)
    write_bytes(folder / _CLASS, _SOURCE.read_bytes())
    files = file_errors(identified, folder / urdf, folder / mjcf, folder / _CLASS)
    errors = {"files": {name: _errors(score) for name, score in files.items()}}
    write_json(folder / VERDICT, verdict(identified) | errors)
    write_bytes(folder / _HEADER, c_header(arm, numbers, names, identified.quality.verdict))
    write_mlmodel(folder, loader_module=Path(_CLASS).stem, code=".", data=".")
    write_bytes(folder / REPORT, report_html(identified, origin, files))


def write_checks(recordings: list[CheckedRecording], folder: Path) -> Path:
    """Write the check of recordings to a file, and return its path."""
    path = folder / "check.json"
    write_json(path, [recording.as_json() for recording in recordings])
    return path


def report_html(identified: IdentifiedArm, origin: Origin, files: Mapping[str, Score]) -> bytes:
    """The report as an HTML document, with the errors of written files by name."""
    from sidegan.report.canvas import svg  # matplotlib takes a while to import
    from sidegan.report.identification import plots

    return rendered(
        Path(__file__).parent / "report.html.jinja",
        {"number": format_number},
        identified=identified,
        origin=origin,
        files=files,
        title=f"Identification of {identified.model.arm.name}",
        content=content,
        settings=yaml.safe_dump(dict(origin.settings), sort_keys=False, allow_unicode=True),
        drawn=[*identified.validation, *identified.training][:_RECORDINGS],
        plots=plots,
        svg=lambda *drawn: Markup(svg(*drawn)),
    )


def format_number(value: float, digits: int = 4) -> str:
    """A number as text: ``1.234``, ``1.2e-5``, or a dash if it is not finite."""
    if not math.isfinite(value):
        return "—"
    return plain(value if abs(value) > _ROUNDING else 0.0, f".{digits}g")


def verdict(identified: IdentifiedArm) -> dict[str, Any]:
    """The verdict as JSON values, for programs that decide on a model; lists are in the order of joints."""
    quality = identified.quality
    chosen = identified.chosen
    use = identified.use
    arm = identified.model.arm
    return {
        "robot": arm.name,
        "joints": list(arm.joint_names),
        "method": chosen.method,
        "use": use,
        "advice": advice(identified),
        "verdict": quality.verdict,
        "reasons": quality.reasons,
        "recordings": [recording.name for recording in identified.training],
        "validation": {
            "kind": identified.kind,
            "recordings": [recording.name for recording in identified.validation],
            **_all_errors(identified.tested, use, chosen.method),
            "description": _errors(quality.nominal_score),
        },
        "training": _all_errors(identified.trained, use, chosen.method),
        "condition_number": _number(chosen.condition),
        "weak_parameters": list(quality.weak),
        "torque_deviation": _numbers(quality.torque_deviation),
        "effects": [
            {"joint": arm.joint_names[effect.joint], "kind": effect.kind, "error": _number(effect.error)}
            for effect in identified.effects
        ],
        "modelled": identified.modelled,
        "left_over": identified.left_over,
        "torque_bias": _numbers(identified.unmodelled.error),
        "unmodelled": [
            {"joint": arm.joint_names[lack.joint], "kind": lack.kind, "share": _number(lack.share)}
            for lack in identified.unmodelled.found
        ],
        "whiteness": _numbers(1 / chosen.inflation),
        "data": {recording.name: recording.warnings for recording in identified.recordings},
        "samples": chosen.samples,
    }


def _all_errors(errors: dict[str, Score], use: str, method: str) -> dict[str, Any]:
    """Errors of the recommended model, and of the compared methods by name."""
    compared = {name: _errors(errors[other]) for name, other in ({method: method} | _COMPARED).items()}
    return {**_errors(errors[use]), **compared}


def _errors(errors: Score) -> dict[str, Any]:
    return {
        "nmse": _numbers(errors.nmse),
        "nmse_mean": _number(errors.nmse_mean),
        "rmse": _numbers(errors.rmse),
    }


def model_numbers(identified: IdentifiedArm) -> dict[str, Any]:
    """The complete identified model as JSON values."""
    model, chosen = identified.model, identified.chosen
    return {
        "joints": list(model.arm.joint_names),
        "gravity": model.arm.gravity.tolist(),
        "names": list(chosen.names),
        "formulas": list(model.formulas),
        "parameters": chosen.parameters.tolist(),
        "certainty": chosen.certainty.tolist(),
        "rate": identified.training[0].grid.rate,
        "covariance": chosen.covariance.tolist(),
        "sign_width": model.terms.sign_width,
        "usual_load": [] if model.effects is None else model.effects.usual.tolist(),
        "consistent": _standard(model, identified.standard),
        "use": {"method": identified.use, **_standard(model, identified.used_standard)},
    }


def _standard(model: TorqueModel, standard: Array) -> dict[str, Any]:
    """Standard parameters (F,) as links and terms."""
    terms = {kind: standard[model.standard_slice(kind)].tolist() for kind in model.kinds}
    names = [] if model.effects is None else model.effects.names
    effects = dict(zip(names, standard[len(standard) - len(names) :].tolist()))
    return {"inertial_parameters": model.links_of(standard).tolist(), "terms": terms, "effects": effects}


def _numbers(values: Array) -> list[float | None]:
    return [_number(x) for x in values.tolist()]


def _number(value: float) -> float | None:
    """A number, or None if it is not finite, for JSON."""
    return value if math.isfinite(value) else None
