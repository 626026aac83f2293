"""The file by which MLflow loads an identified model from a run's folder, as a function of tables."""

import json
import platform
from collections.abc import Sequence

import yaml

MLMODEL = "MLmodel"
_INPUTS, _OUTPUTS = ("q", "dq", "ddq"), ("tau",)


def mlmodel_text(joint_names: Sequence[str], module: str) -> str:
    """The text of ``MLmodel`` for a folder with the Python class of an arm with these joints.

    Args:
        joint_names: of the arm, in its order.
        module: name of the class's module, which has ``_load_pyfunc``.
    """
    signature = {
        side: json.dumps(
            [
                {"type": "double", "name": f"{letter}_{joint}", "required": True}
                for letter in letters
                for joint in joint_names
            ]
        )
        for side, letters in (("inputs", _INPUTS), ("outputs", _OUTPUTS))
    }
    function = {
        "loader_module": module,
        "code": ".",
        "data": ".",
        "python_version": platform.python_version(),
    }
    return yaml.safe_dump({"flavors": {"python_function": function}, "signature": signature}, sort_keys=False)
