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


def require(name: str, package: str) -> None:
    """Check early that a package from an extra is installed, without importing it, which may take seconds.

    Raises:
        ConfigError: when it is not installed; says how to install it.
    """
    with extra(name):
        if find_spec(package) is None:
            raise ModuleNotFoundError(name=package)
