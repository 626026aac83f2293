import pytest

from sidegan.base.memory import require_room
from sidegan.errors import ConfigError


def test_what_no_memory_holds_is_refused_with_both_numbers():
    require_room(1e6, "library.count")
    with pytest.raises(ConfigError, match=r"library\.count takes 8e\+06 GB in memory, this machine has"):
        require_room(1e15, "library.count")
