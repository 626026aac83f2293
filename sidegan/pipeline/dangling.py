"""Complaint about a setting that refers to another one, which is not there."""

from omegaconf.errors import OmegaConfBaseException


def dangling(error: OmegaConfBaseException) -> str:
    """The setting and what is wrong with it, in one line."""
    reason = str(error.msg or error).splitlines()[0]
    return f"{error.full_key}: {reason}" if error.full_key else reason
