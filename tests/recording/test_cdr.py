import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from sidegan.recording.cdr import FIELDS, layout_of

STORE = get_typestore(Stores.ROS2_HUMBLE)
STATE = STORE.types["sensor_msgs/msg/JointState"]
HEADER = STORE.types["std_msgs/msg/Header"]
STAMP = STORE.types["builtin_interfaces/msg/Time"]

NAMES = st.lists(st.text("abc_é", min_size=1, max_size=9), min_size=1, max_size=5, unique=True)


def message(names, frame, counts, seed, big=False):
    random = np.random.default_rng(seed)
    values = [random.normal(size=count) for count in counts]
    stamp = STAMP(sec=int(random.integers(2**31)), nanosec=int(random.integers(10**9)))
    state = STATE(HEADER(stamp, frame), names, *values)
    return state, bytes(STORE.serialize_cdr(state, STATE.__msgtype__, little_endian=not big))


@settings(max_examples=100, deadline=None)
@given(NAMES, st.text("xyz/", max_size=7), st.data())
def test_numbers_are_those_that_rosbags_reads(names, frame, data):
    counts = [data.draw(st.sampled_from([0, len(names)])) for _ in FIELDS]
    made = [message(names, frame, counts, seed) for seed in range(3)]
    layout = layout_of(made[0][1])
    assert all(layout.fits(raw) for _, raw in made)
    time, *fields = layout.read([raw for _, raw in made], [*names[::-1], "none"], FIELDS)
    for k, (state, _) in enumerate(made):
        stamp = state.header.stamp
        assert time[k, 0] == pytest.approx(stamp.sec + stamp.nanosec * 1e-9, abs=1e-6)
        for found, name, count in zip(fields, FIELDS, counts):
            expected = getattr(state, name)[::-1] if count else np.full(len(names), np.nan)
            np.testing.assert_array_equal(found[k], [*expected, np.nan])


def test_another_layout_does_not_fit():
    layout = layout_of(message(["a", "b"], "", [2, 2, 2], 0)[1])
    for names, counts in ((["a", "c"], [2, 2, 2]), (["a", "b"], [2, 2, 0]), (["a"], [1, 1, 1])):
        assert not layout.fits(message(names, "", counts, 0)[1])


def test_other_bytes_are_left_to_rosbags():
    assert layout_of(message(["a"], "", [1, 1, 1], 0, big=True)[1]) is None
