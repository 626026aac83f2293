"""Coupled coordinates, as of motors behind gears, belts and differentials, or angles from the horizontal."""

from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.base.typed import Number
from sidegan.errors import ConfigError

# {joint: {column: factor}}: a joint is the sum of factors times columns, which are named like joints. A joint
# that is left out is the column of its own name.
Rows = dict[str, dict[str, Number]]


def coupling_matrix(name: str, rows: Rows | None, joint_names: Sequence[str]) -> Array:
    """The matrix C, (J, J), with which joints' values are C times those of the columns.

    Raises:
        ConfigError: when the setting, of this name, has a joint that the arm lacks, or C has no inverse.
    """
    given = rows or {}
    named = dict.fromkeys([*given, *(column for row in given.values() for column in row)])
    if unknown := [joint for joint in named if joint not in joint_names]:
        raise ConfigError(f"{name} names {listed(unknown)}; the arm has joints {', '.join(joint_names)}")
    matrix = np.array([[given.get(j, {j: 1.0}).get(k, 0.0) for k in joint_names] for j in joint_names])
    largest = np.abs(matrix).max(1, keepdims=True)
    if np.linalg.matrix_rank(matrix / np.where(largest > 0, largest, 1.0)) < len(matrix):
        raise ConfigError(f"{name} has no inverse: joints are made of too few independent columns")
    return matrix


def coupling_rows(matrix: Array, joint_names: Sequence[str]) -> Rows:
    """The setting that makes this matrix, (J, J)."""
    each = zip(joint_names, matrix.tolist())
    rows = {joint: {k: x for k, x in zip(joint_names, row) if x} for joint, row in each}
    return {joint: row for joint, row in rows.items() if row != {joint: 1.0}}
