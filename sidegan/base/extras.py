"""Packages that an installation may do without, each of which comes with an extra of ours."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from sidegan.errors import ConfigError


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Imports in this block are of packages that an extra brings.

    Raises:
        ConfigError: where one is not installed, with what installs it.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"{error.name} is not installed; it comes with pip install 'sidegan[{name}]'"
        ) from None


def require(name: str, package: str) -> None:
    """Refuse to begin without a package that an extra brings; it is not imported, which may take seconds.

    Raises:
        ConfigError: where it is not installed, with what installs it.
    """
    with extra(name):
        if find_spec(package) is None:
            raise ModuleNotFoundError(name=package)
