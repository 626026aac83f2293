"""The errors that sidegan raises on purpose; anything else that escapes is a bug."""


class SideganError(Exception):
    """Base of every error that a user can cause or mend."""


class ConfigError(SideganError, ValueError):
    """A setting is unknown, of the wrong type, or impossible together with another."""


class RobotError(SideganError):
    """A robot description is missing, malformed, or of a kind that is not supported."""


class ShapeError(SideganError):
    """An array has the wrong shape, holds non-finite numbers, or does not fit the robot."""


class RecordingError(SideganError):
    """A recording is missing, malformed, in other units than declared, or tells nothing about the arm."""


class InfeasibleError(SideganError):
    """A requirement cannot be met: a home in collision, a start that never becomes valid."""


class ArtifactError(SideganError):
    """A stored file is truncated, of an unknown format, or made for something else."""


class StorageError(SideganError):
    """The output folder cannot be written, is full, or is in use by another run."""
