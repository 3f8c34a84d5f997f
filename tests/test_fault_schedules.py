"""Random schedules of what goes wrong on a line and a disk: every log opens and holds every intact frame once."""

import tempfile
from pathlib import Path

from fault_schedules import Device, play
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

SHARE = st.floats(0.0, 1.0, exclude_max=True)


class Schedule(RuleBasedStateMachine):
    """Steps of a schedule; it is played when it is complete."""

    def __init__(self):
        super().__init__()
        self.device = Device()

    @initialize(n=st.integers(0, 80))
    def begins(self, n):
        for _ in range(n):
            self.device.next()

    @rule(n=st.integers(1, 80))
    def samples(self, n):
        for _ in range(n):
            self.device.next()

    @rule(junk=st.binary(min_size=1, max_size=60))
    def garbage_between_frames(self, junk):
        self.device.next(before=junk)

    @rule(junk=st.binary(min_size=1, max_size=60), at=SHARE)
    def garbage_in_a_frame(self, junk, at):
        self.device.next(
            lambda data: data[: 1 + int(at * (len(data) - 1))] + junk + data[1 + int(at * (len(data) - 1)) :]
        )

    @rule(at=SHARE, bits=st.integers(1, 255), n=st.integers(1, 4))
    def damaged_byte(self, at, bits, n):
        def damaged(data):
            place = int(at * len(data))
            return data[:place] + bytes([data[place] ^ bits]) + data[place + 1 :]

        for _ in range(n):
            self.device.next(damaged)

    @rule(n=st.integers(1, 30))
    def dropped(self, n):
        for _ in range(n):
            self.device.next(lambda data: b"")

    @rule(at=SHARE, away=st.sampled_from([0, 3, 40, 300]))
    def unplugged_within_a_frame(self, at, away):
        self.device.next(lambda data: data[: int(at * len(data))])
        self.device.tell("unplug")
        self.device.plugged = False
        for _ in range(away):
            self.device.next()
        self.device.plugged = True
        self.device.tell("plug")

    @rule(silence=st.sampled_from([0.0, 0.2, 3.0]))
    def reset(self, silence):
        self.device.reset(silence)

    @rule()
    def killed(self):
        self.device.tell("kill")

    @rule(room=st.integers(0, 20_000))
    def disk_full(self, room):
        self.device.tell("full", room)

    def teardown(self):
        with tempfile.TemporaryDirectory() as folder:
            play(self.device, Path(folder))


Schedule.TestCase.settings = settings(
    max_examples=200,
    stateful_step_count=20,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestEverySchedule = Schedule.TestCase
