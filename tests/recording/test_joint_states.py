import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from sidegan.recording.joint_states import FIELDS, JointStates, layout_of

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


def decode(raw):
    return STORE.deserialize_cdr(raw, STATE.__msgtype__)


@settings(max_examples=100, deadline=None)
@given(NAMES, st.text("xyz/", max_size=7), st.booleans(), st.data())
def test_numbers_are_those_that_rosbags_reads(names, frame, big, data):
    counts = [data.draw(st.sampled_from([0, len(names)])) for _ in FIELDS]
    messages = [message(names, frame, counts, seed, big) for seed in range(3)]
    decoded = []
    states = JointStates([*names[::-1], "none"], FIELDS, lambda raw: decoded.append(raw) or decode(raw))
    concerned, numbers = states.read([raw for _, raw in messages])
    assert concerned.all() and len(decoded) == 1
    time, *fields = np.split(numbers, [1 + (len(names) + 1) * k for k in range(3)], 1)
    for k, (state, _) in enumerate(messages):
        stamp = state.header.stamp
        assert time[k, 0] == pytest.approx(stamp.sec + stamp.nanosec * 1e-9, abs=1e-6)
        for values, name, count in zip(fields, FIELDS, counts):
            expected = getattr(state, name)[::-1] if count else np.full(len(names), np.nan)
            np.testing.assert_array_equal(values[k], [*expected, np.nan])  # read, not computed


@pytest.mark.parametrize(
    ("names", "counts"),
    [(["a", "c"], [2, 2, 2]), (["a", "b"], [2, 2, 0]), (["a", "b"], [2, 0, 2]), (["a"], [1, 1, 1])],
)
def test_another_layout_does_not_fit(names, counts):
    state, raw = message(["a", "b"], "", [0, 2, 2], 0)
    layout = layout_of(raw, state)
    assert layout.fits(message(["a", "b"], "", [0, 2, 2], 1)[1])
    assert not layout.fits(message(names, "", counts, 0)[1])


def test_messages_without_the_arms_joints_are_marked():
    raws = [message(names, "", [1, 1, 1], 0)[1] for names in (["a"], ["finger"], ["b"])]
    concerned, _ = JointStates(["a", "b"], FIELDS, decode).read(raws)
    assert concerned.tolist() == [True, False, True]
