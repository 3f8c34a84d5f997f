"""A device, a line and a disk on which everything goes wrong when told, in a time of their own.

`Device` makes the bytes and knows where each frame stands among them. `World` plays them to
`imufit.devices.record.record` through the real transport, and notes what was read. What ought to be in a log follows
from the bytes alone: a frame counts if all of it was read, unaltered, from a place where a frame can begin.
"""

import errno
import itertools
import os
import random
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import serial
from imufit import InputError, _imufit, read
from imufit.devices.record import journal, part, reception, record, recorder, recover, transport
from imufit.log import Log

STEP = 0.01
"""Time between two samples, s."""
ANNOUNCED = 0.4
"""Time between two announcements, s: a schedule is shorter than a life."""
CHANNELS = [(name, 0.001, 0.0, 0.0) for name in ("acc_x", "acc_y", "acc_z")]
STREAMS = [(100.0, "i16", b"", CHANNELS), (100.0, "i32", b"", [("number", 1.0, 0.0, 0.0)])]


class KilledError(BaseException):
    """The recorder is no more: nothing of it runs on."""


@dataclass
class Frame:
    """A frame, where it stands among the bytes (`begin` < 0: not at all), and whether it was left as it was."""

    start: int
    number: int | None
    begin: int
    end: int
    unaltered: bool = True


@dataclass
class Event:
    """Something that happens at a time: bytes that come, or a word."""

    at: float
    kind: str
    data: bytes = b""
    amount: float = 0.0


@dataclass
class Device:
    """Makes frames, and the events of a schedule."""

    start: int = 1
    now: float = 0.0
    began: float = 0.0
    announce_at: float = 0.0
    count: int = 0
    plugged: bool = True
    wire: bytearray = field(default_factory=bytearray)
    frames: list[Frame] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    encoder: object = None

    def __post_init__(self):
        self.encoder = _imufit.WireEncoder("mine", 1000, STREAMS, self.start)

    def put(self, data):
        """Bytes on the line; nobody sees them while it is unplugged."""
        if self.plugged and data:
            self.wire += data
            if self.events and self.events[-1].kind == "bytes" and self.events[-1].at == self.now:
                self.events[-1].data += data
            else:
                self.events.append(Event(self.now, "bytes", bytes(data)))

    def frame(self, data, number, *, sent=None):
        """One frame; `sent` is what becomes of its bytes."""
        sent = data if sent is None else sent
        begin = len(self.wire) if self.plugged and sent else -1
        self.put(sent)
        self.frames.append(Frame(self.start, number, begin, len(self.wire), sent == data))

    def next(self, change=lambda data: data, *, before=b""):
        """Take a sample after one more step of time, with an announcement before it where one is due."""
        self.now += STEP
        if self.now >= self.announce_at:
            self.frame(self.encoder.announce(), None)
            self.announce_at = self.now + ANNOUNCED
        stamp = np.array([round(1e6 * (self.now - self.began)) % 2**32], np.uint32)
        data, _ = self.encoder.samples(stamp, np.array([[0.0, 0.0, 9.8, self.count]]))
        if before:
            self.put(before)
        self.frame(data, self.count, sent=change(data))
        self.count += 1

    def tell(self, kind, amount=0.0):
        """Something happens now."""
        self.events.append(Event(self.now, kind, amount=amount))

    def reset(self, silence):
        """Begin anew."""
        self.now += silence
        self.start, self.began, self.announce_at = (self.start + 1) % 256, self.now, self.now
        self.encoder = _imufit.WireEncoder("mine", 1000, STREAMS, self.start)


@dataclass
class Taken:
    """What one recorder read: from `begin` to `end` among the bytes, how it ended, and when which bytes were read."""

    begin: int
    end: int
    ended: str = ""
    reads: list[tuple[float, int]] = field(default_factory=list)
    opened: list[int] = field(default_factory=list)
    writes: list[tuple[float, int]] = field(default_factory=list)
    ended_at: float = 0.0


class Disk:
    """Stands for `os` where parts are written: it has room for so many bytes more."""

    def __init__(self):
        self.room = None

    def write(self, descriptor, data):
        if self.room is not None:
            data = data[: self.room]
            self.room -= len(data)
            if not len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(descriptor, data)

    def __getattr__(self, name):
        return getattr(os, name)


class World:
    """Plays the events of a device to recorders, one after the other; it is their time, their chance and their line."""

    def __init__(self, device, folder):
        self.device, self.folder = device, folder
        self.now, self.place, self.offset = 0.0, 0, 0
        self.plugged, self.disk = True, Disk()
        self.log_fails = False
        self.taken = None
        self.rng = random.Random(len(device.wire))

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        """Between two reads: what was written since the last one is noted."""
        path = part.part_path(self.log)
        if path.exists() and (not self.taken.writes or self.taken.writes[-1][1] != path.stat().st_size):
            self.taken.writes.append((self.now, path.stat().st_size))
        due = self.device.events[self.place].at if self.place < len(self.device.events) else self.now
        self.now += max(seconds, min(due - self.now, 0.03))

    def uniform(self, low, high):
        return self.rng.uniform(low, high)

    @staticmethod
    def process_time():
        return 0.0

    def opened(self):
        if not self.plugged:
            self._follow()
        if not self.plugged:
            raise serial.SerialException(errno.ENOENT, "could not open port")
        self.taken.opened.append(self.offset)
        return self

    def close(self):
        pass

    @staticmethod
    def write(_request):
        """A device that does not listen: it announces itself when it likes."""

    def read(self, most):
        """What pyserial's read gives: bytes that have come, or an error."""
        data = self._follow(most)
        self.taken.end = self.offset
        if data:
            self.taken.reads.append((self.now, self.offset))
        elif not self.plugged:
            raise serial.SerialException("device disconnected")
        return data

    def _follow(self, most=0):
        """Let happen what is due; return bytes up to the next thing that is none."""
        found = b""
        while self.place < len(self.device.events) and self.device.events[self.place].at <= self.now:
            event = self.device.events[self.place]
            if event.kind == "bytes":
                if not most or len(found) >= most:
                    break
                # reads end anywhere, within a frame as well
                n = min(self.rng.randint(1, len(event.data)), most - len(found))
                found, event.data = found + event.data[:n], event.data[n:]
                self.offset += n
                if event.data:
                    break
                self.place += 1
                continue
            if found:
                break
            self.place += 1
            if event.kind in ("unplug", "plug"):
                self.plugged = event.kind == "plug"
                if not self.plugged:
                    break
            elif event.kind == "full":
                self.disk.room = int(event.amount)
                self.log_fails = event.amount % 2 == 0
            elif event.kind == "kill":
                self.taken.ended = "killed"
                raise KilledError
        return found

    @property
    def over(self):
        return self.place >= len(self.device.events)

    def recorded(self, number):
        """Run one recorder to its end; return what it read, its log or None, and what it said."""
        self.log = self.folder / f"log{number}.parquet"
        # nobody starts a recorder where nothing is plugged in
        while not self.plugged and not self.over:
            self.now = max(self.now, self.device.events[self.place].at)
            self._follow()
        self.taken = Taken(self.offset, self.offset)
        said = ""
        try:
            record("fake", self.log, form="binary" if number % 2 else "auto", stopped=lambda: self.over)
            self.taken.ended = "stopped"
        except KilledError:
            pass
        except InputError as error:
            said = str(error)
            self.taken.ended = "full" if self.disk.room is not None else "nothing"
        self.taken.ended_at = self.now
        self.disk.room = None
        self.log_fails = False
        return self.taken, said


@contextmanager
def patched(world):
    """Give the recorder the world's time, chance, disk and line."""

    def failing(log, path, real=Log.write):
        if world.log_fails:
            path.write_bytes(b"PAR1 and no more")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(log, path)

    swaps = [(module, "time", world) for module in (journal, part, reception, recorder, transport)]
    swaps += [(reception, "random", world), (part, "os", world.disk), (Log, "write", failing)]
    swaps += [(transport.Line, "_opened", lambda _line: world.opened())]
    kept = [(owner, name, getattr(owner, name)) for owner, name, _ in swaps]
    for owner, name, value in swaps:
        setattr(owner, name, value)
    try:
        yield
    finally:
        for owner, name, value in kept:
            setattr(owner, name, value)


def intact(device, taken):
    """Frames that a recorder read whole, in order."""
    breaks = {taken.begin, *taken.opened}
    found = []
    for frame in device.frames:
        inside = taken.begin <= frame.begin and frame.end <= taken.end
        if not (inside and frame.unaltered) or any(frame.begin < b < frame.end for b in breaks):
            continue
        if frame.begin in breaks or device.wire[frame.begin - 1] == 0:
            found.append(frame)
    return found


def explained(frames):
    """Numbers of the samples among frames that an announcement explains by then, in order."""
    out, waiting, announced, last = [], [], None, None
    for frame in frames:
        if last is not None and frame.start != last and announced is not None:
            out, waiting = out + waiting, []
        last = frame.start
        if frame.number is None:
            out, waiting, announced = out + waiting, [], frame.start
        elif announced == frame.start:
            out.append(frame.number)
        else:
            waiting.append(frame.number)
    return out


def all_explained(frames):
    """Numbers of all samples once nothing more comes: any announcement explains them."""
    return [f.number for f in frames if f.number is not None] if any(f.number is None for f in frames) else []


def check_gaps(device, taken, log):
    """Where rows do not follow each other there is a gap, with its reason and what is missing; nowhere else."""
    place = {frame.number: k for k, frame in enumerate(device.frames) if frame.number is not None}
    numbers = log.covariates["number"].astype(int).tolist()
    good = {id(frame) for frame in intact(device, taken)}
    gaps = {gap["t_start"]: gap for gap in log.metadata.to_mapping()["recording"]["gaps"]}
    rows = dict(zip(log.t.tolist(), itertools.pairwise([*numbers, None]), strict=True))
    marked = {rows[t]: gap for t, gap in gaps.items() if rows[t][1] is not None}
    for pair in itertools.pairwise(numbers):
        before, *between, after = device.frames[place[pair[0]] : place[pair[1]] + 1]
        missing = [frame for frame in between if id(frame) not in good]
        opened = any(before.end <= b <= after.begin for b in taken.opened[1:])
        reset = before.start != after.start
        gap = marked.get(pair)
        assert (gap is not None) == bool(missing or opened or reset), (pair, gap, missing, opened, reset)
        if gap is None:
            continue
        assert gap["reason"] == ("unplugged" if opened else "reset" if reset else "lost frames"), (pair, gap)
        if not reset:
            assert gap["frames"] == len(missing), (pair, gap, missing)


def play(device, folder):
    """Record the whole schedule, with as many recorders as it takes; return what was checked, by the way of ending."""
    world = World(device, folder)
    seen = []
    with patched(world):
        while not world.over or not seen:
            taken, said = world.recorded(len(seen))
            check(device, world, taken, said)
            seen.append(taken.ended)
    return seen


def check(device, world, taken, said):
    """A recorder's log opens and has every intact frame once and in order, and its gaps are marked."""
    frames = intact(device, taken)
    log = world.log
    if taken.ended == "killed":
        _recovered(device, world, taken, _cut(world, taken))
    elif taken.ended == "full":
        if not log.exists() and part.parts_of(log):
            assert "imufit.devices.record.recover(" in said, said
            _recovered(device, world, taken, taken.ended_at)
        elif log.exists():
            _compared(device, taken, read(log), taken.ended_at)
        else:
            assert not _early(taken, frames, taken.ended_at), said
    elif taken.ended == "nothing":
        assert not all_explained(frames), said
        assert not log.exists()
        assert not part.parts_of(log)
    else:
        made = read(log)
        assert made.covariates["number"].astype(int).tolist() == all_explained(frames)
        check_gaps(device, taken, made)
    assert not part.parts_of(log)


def _cut(world, taken):
    """Return when the recorder was killed: now, or within its last write, of which only some is left then."""
    path = part.part_path(world.log)
    sizes = [size for _, size in taken.writes]
    if len(sizes) < 2 or world.rng.random() < 0.5 or path.stat().st_size != sizes[-1]:
        return taken.ended_at
    os.truncate(path, world.rng.randint(sizes[-2], sizes[-1] - 1))
    return taken.writes[-1][0]


def _early(taken, frames, ended_at):
    """Numbers that were read, and explained, so long before the end that they must have been written."""
    old = max((offset for t, offset in taken.reads if t < ended_at - journal.EVERY - 0.05), default=taken.begin)
    return explained([frame for frame in frames if frame.end <= old])


def _recovered(device, world, taken, ended_at):
    try:
        recover(part.part_path(world.log))
    except InputError:
        assert not _early(taken, intact(device, taken), ended_at)
        for path in part.parts_of(world.log):
            path.unlink()
        return
    _compared(device, taken, read(world.log), ended_at)


def _compared(device, taken, log, ended_at):
    """What was written is the beginning of what was read, all but the last moment of it."""
    frames = intact(device, taken)
    numbers = log.covariates["number"].astype(int).tolist()
    assert numbers == all_explained(frames)[: len(numbers)]
    early = _early(taken, frames, ended_at)
    assert len(numbers) >= len(early), (len(numbers), len(early))
    check_gaps(device, taken, log)
