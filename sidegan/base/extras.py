"""Optional packages, which come with extras."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from sidegan.errors import ConfigError


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Context for imports of packages from an extra.

    Raises:
        ConfigError: when a package is not installed; says how to install it.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"{error.name} is not installed; it comes with pip install 'sidegan[{name}]'"
        ) from None


def installed(package: str) -> bool:
    """Whether an optional package is installed, without importing it."""
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:
        return False


def require(name: str, package: str) -> None:
    """Check early that a package from an extra is installed, without importing it, which may take seconds.

    Raises:
        ConfigError: when it is not installed; says how to install it.
    """
    if not installed(package):
        with extra(name):
            raise ModuleNotFoundError(name=package)
