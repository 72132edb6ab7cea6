# Copyright 2026 abdf1_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A plant on a virtual clock: drivers, their PLCs, publishers, and all that goes wrong between them.

Everything but ROS itself; a seed and a commit replay a run to the byte. What is done goes through
the ``World``, and what came of it is in its lists, with the time it came. Each value that is
published is another one, so what a PLC executes tells who asked for it, and when::

    world = World(Plant('Message', stations=2), seed=1)
    speed = world.rows['w0_1']                  # the first output of station 1
    world.run(2.0)
    world.publish(speed)
    world.run(0.5)
    assert world.results[-1].outcome is Outcome.WRITTEN
    world.fall_silent(1)                        # or kill, unplug, download, ask (a guest), ...
    world.run(10.0)
    world.mend()
    print([entry for entry in world.executed if entry.tag == 'w0_1'], world.reads[-1])

In Mode Slave a master polls us and the PLCs, which are nodes of one wire. A ladder of the page
about heartbeats runs in each PLC where the plant has a ``scan``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
import hashlib
from itertools import count
import math
from random import Random
from typing import NamedTuple, Protocol

from abdf1_ros.ages import Ages, HostClock, most_ahead
from abdf1_ros.df1.frames import ACK, DLE, Duplex, SOH, stuff, STX
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.guests import Guest, GuestCommand
from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import WriteResult
from abdf1_ros.errors import FormatError, LinkError, PortLost
from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, LONGEST_END, TIME_BASE, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.ladder import Ladder, Lamp
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from support.devices import Device, Filter, link_of, symbol_by_symbol
from support.driver_bench import DriverBench, Kept
from support.forms import Forms, MASKED_SLC, Meant, SAFE, value_of_bit
from support.losses import AirLosses, Losses, Lost
from support.mappings import make_mapping
from support.multidrop import MasterNode
from support.virtual_line import Noise, QUIET, VirtualLine

STEP = 0.05  # s
GUESTS = range(33_000, 33_600)  # what only guests write: more than a heartbeat counts to
OTHERS = 34_000  # what comes into a word from another network
FOREIGN = 34_100  # what another program writes once into the word of a heartbeat
LARGEST = 31_000  # of what is published
_LEAST_COMMAND = 10  # bytes: no poll
_HEADER = 6  # bytes before the data of a command
_FIFO = 16  # bytes that come together; a longer reply shows before Timeout that it comes
_PRESSED_EVERY = 1.0  # s
_MASTER_RESTS = 0.005  # s, of one that polls us, before all that it sends
SLAVE_PRESET = 1000  # of a watchdog where none is printed, in units of 10 ms
_ALL = 255  # stations
_WRITES = (b'\x67', b'\xAA', b'\x26', MASKED_SLC)  # functions of a typed write, and of bits
_REPLY = 0x40  # in the command of a reply
_MASKED = 0x0F  # command of a write that names single words
_TICKS = 30_000
_FAR = 1  # what a VirtualLine calls the far end
SMALL = Noise(lost=0.0005, flipped=0.001, inserted=0.0005)
GREAT = Noise(lost=0.005, flipped=0.01, inserted=0.005)  # of which some is more than all retries
MODES: dict[str, dict[str, str]] = {
    'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
    'Radio': {'mode': 'Radio'}, 'Gateway': {}, 'Standard gateway': {'polling': 'Standard'},
    'Slave': {'mode': 'Slave', 'plc_type': 'PLC5'}}
POLLED = ('Standard', 'Standard gateway', 'Slave')  # polls go on all the time
OURS, OTHER_BRIDGE, MASTER = 200, 201, 9  # stations
GATEWAY = 5  # the station on the line, behind which the PLC is
DAMAGED = b'ZZZZ'  # what the line does not carry: only guests send it

USUAL: tuple[Filter, Filter] = bytes, bytes

# The words of each PLC: outputs, a row without Fallback after them, its program's own, heartbeat.
OUTPUTS, FREE, CLOCK, COUNTER, BEAT = 'N7:0', 'N7:20', 'N9:0', 'N9:4', 'N10:0'
# Words of our own table: that the master only reads, and those that it writes.
SERVED, TAKEN, TAKEN_WORDS = 'N7:50', 'N7:51', 2
HELD = 'N7:0'  # from here all words of messages are read, and what follows


@dataclass(frozen=True, slots=True)
class Plant:
    """
    What there is: PLCs of a ``kind``, each with ``rows`` outputs; times in ms.

    The heartbeat requires a message of the first output within ``requires``, None for nothing.
    """

    mode: str
    stations: int = 1
    rows: int = 2
    kind: str = 'PLC5'
    after: int = 1000
    period: int = 500
    requires: int | None = None
    baud: int = 19200
    retries: int = 1
    write_timeout: float = 2.0
    is_read_only: bool = False
    scan: int = 0  # ms of the ladder, 0 for none
    may_store: bool = False  # the port, while another client has the line
    held: int = 0  # words from the first output on that are read

    @classmethod
    def drawn(cls, dice: Random, mode: str = '') -> Plant:
        """Return any plant."""
        mode = mode or dice.choice([*MODES, *3 * [name for name in MODES if name not in POLLED]])
        stations = 1 if mode == 'Peer' or 'ateway' in mode else dice.choice([1, 1, 1, 2, 3])
        rows = dice.choice([1, 2, 2, 3])
        if mode == 'Slave':  # the polls of its master leave room for three outputs in all
            stations = min(stations, 2)
            rows = min(rows, 3 // stations)
        plant = cls(
            mode, stations, rows, dice.choice(['PLC5', 'SLC']),
            dice.choice([600, 1000, 2000]), dice.choice([500, 1000, 2000]),
            dice.choice([None, None, 800, 1500]),
            dice.choice([4800, 4800, 9600] if 'Standard' in mode else
                        [19200, 38400] if mode == 'Slave' else [9600, 19200, 38400]),
            dice.choice([1, 2]), dice.choice([0.5, 2.0]), dice.random() < 0.06,
            dice.choice([0, 0, 50, 100]), dice.random() < 0.4)
        is_held = mode in ('Message', 'Peer', 'Gateway') and dice.random() < 0.5
        # Of a fast line in two packets; of a slow one in a reply that takes longer than Timeout.
        held = 140 if plant.baud > 19200 else 100 if plant.baud < 19200 else 21
        return replace(plant, held=held if is_held else 0)

    @property
    def network(self) -> Network:
        """Return the settings of its line."""
        return Network(
            station=OURS, baud=self.baud, timeout=100, cmd_timeout=500, nak_retries=self.retries,
            enq_retries=self.retries, **MODES[self.mode])  # type: ignore[arg-type]

    @property
    def gateway(self) -> int | None:
        """Return the station behind which the PLC is, None where it is on the line itself."""
        return GATEWAY if 'ateway' in self.mode else None

    @property
    def counts_within(self) -> int:
        """Return the While_Timeout of the counter; where polls have the line it is longer."""
        return 20_000 if self.mode in ('Radio', *POLLED) else 3500

    def mappings(self) -> list[Mapping]:
        """Return its rows; their tags end with the number of the station."""
        found: list[Mapping] = []
        for station in range(1, self.stations + 1):
            def add(text: str, command: str, name: str, station: int = station,
                    **others: object) -> None:
                found.append(make_mapping(
                    text, command, station=station, plc=self.kind, tag=f'{name}_{station}',
                    via=self.gateway, **others))  # type: ignore[arg-type]

            fallback = Fallback((SAFE,), self.after)
            for number in range(self.rows):
                add(f'N7:{number}', 'Write', f'w{number}', fallback=fallback,
                    single_publisher=True)
            add(FREE, 'Write', 'free')
            needed = (f'w0_{station}',) if self.requires else ()
            add(BEAT, 'Heartbeat', 'beat', period=self.period,
                condition=While(needed, self.requires) if needed else None)
            add(CLOCK, 'Read', 'clock', length=2, period=1000)
            add('N9:2', 'Read', 'running', period=1000, condition=While(('RUN',)))
            add(COUNTER, 'Read', 'counter', period=1000)
            add('N9:3', 'Read', 'counted', period=1000,
                condition=While((f'counter_{station}',), self.counts_within))
            if self.held:
                add(HELD, 'Read', 'held', length=self.held, period=1000)
        if self.mode == 'Slave':
            found.append(make_mapping(SERVED, 'Serve', station=OURS, tag='served',
                                      is_read_only=True, fallback=Fallback((SAFE,), self.after)))
            found.append(make_mapping(TAKEN, 'Serve', station=OURS, tag='taken',
                                      length=TAKEN_WORDS))
        return found


class Sent(NamedTuple):
    """
    A packet with words of a row, from ``at`` of it on, that the driver has sent to a PLC.

    ``is_again``: it is sent once more.
    """

    when: float
    station: int
    tag: str
    value: int
    is_again: bool
    at: int = 0


@dataclass(frozen=True, slots=True)
class Executed:
    """
    What a PLC has taken from the line into a row: a bit, or words from ``at`` of it on.

    ``driver`` is the number of the driver that has sent it. ``before`` was in the word.
    ``is_late`` tells that a gateway had kept it, ``is_told`` that the PLC has replied.
    """

    when: float
    station: int
    tag: str
    value: int
    driver: int
    before: int
    is_late: bool = False
    is_told: bool = True
    at: int = 0


class Shown(NamedTuple):
    """Words from an offset of a file on, that a PLC has read out for a command."""

    when: float
    area: Area
    offset: int
    words: bytes

    def word(self, area: Area, offset: int) -> int | None:
        """Return one of them, None where it is none of them."""
        at = 2 * (offset - self.offset)
        return int.from_bytes(self.words[at:at + 2], 'little') \
            if self.area == area and 0 <= at < len(self.words) else None


class Message(NamedTuple):
    """A message on its way: when it was published, what its stamp says, and its number."""

    row: Mapping
    value: int
    published: float
    stamp: float
    number: int


class Said(NamedTuple):
    """What the master has written to our table; ``sts`` is None where it got no reply."""

    value: int
    is_right: bool  # the others name a word that it must not write
    sts: int | None


@dataclass(slots=True)
class WatchedPlc:
    """A PLC, and what it does with what comes."""

    plc: SimulatedPlc
    rows: dict[str, Mapping]  # that we write, by tag
    refuses: bool = False  # everything but heartbeats
    refuses_messages: bool = False  # but takes fallbacks
    swallows_replies: bool = False  # to messages, which are executed, and to some heartbeats
    other: int = 0  # what another writer has put into the word of the heartbeat
    stopped: float = 0.0  # when its program stopped last
    ran_again: float = 0.0  # and when it ran after that
    saved: dict[str, int] = field(default_factory=dict)
    brought: float = -math.inf  # when a download has brought them back last
    preset: float = 0.0  # s, of the watchdog of its ladder, 0 where it has none
    # What the lamps of its ladder showed, with the time, and which of them are on.
    lamps: list[tuple[float, Lamp, bool]] = field(default_factory=list)
    shown: deque[Shown] = field(default_factory=lambda: deque(maxlen=1000))
    gone: dict[str, Mapping] = field(default_factory=dict)  # rows of files before
    place_of: Callable[[str], Address] = field(init=False)

    def __post_init__(self) -> None:
        self.place_of = cache(partial(parse_address, plc_type=self.plc.table.plc_type))

    @property
    def places(self) -> dict[str, str]:
        """Return the address of each row."""
        return {tag: str(row.address) for tag, row in self.rows.items()}

    def take_rows(self, rows: dict[str, Mapping]) -> None:
        """Take other rows; one that is left is known as gone while no other row has its words."""
        left = self.gone | {f'gone_{tag}': row for tag, row in self.rows.items()}
        self.rows = rows
        self.gone = {tag: row for tag, row in left.items()
                     if not any(row.extent.meets(other.extent) for other in rows.values())}

    def lacks(self, command: Packet) -> bool:
        """Tell whether it refuses a masked write, as processors do that may lack it."""
        return command.data[:1] == MASKED_SLC and any(
            row.may_rewrite for row in self.rows.values())

    def held(self, row: Mapping) -> int:
        """Return what it holds in a row; of words that differ the first that is not safe."""
        words = self.plc.table.read(row.address, row.codec.words)
        if row.address.bit is not None:
            return value_of_bit(row, int.from_bytes(words, 'little') >> row.address.bit & 1)
        values = [int.from_bytes(words[at:at + 2], 'little') for at in range(0, len(words), 2)]
        return next((value for value in values if value != SAFE), SAFE)

    def changes(self, address: Address, data: bytes,
                meant: Meant | None) -> Iterator[tuple[str, int, int, int]]:
        """
        Yield tag, value, value before and first word of each row that words would change.

        Of bits these are the row that is ``meant``, and those that become another one.
        """
        for tag, row in (self.rows | self.gone).items():
            at = max(0, address.offset - row.extent.first)
            skipped = row.extent.first + at - address.offset
            if address.area != row.extent.area or 2 * skipped >= len(data) \
                    or row.extent.first + at >= row.extent.end:
                continue
            found = self.plc.table.read(row.address.at_offset(row.extent.first + at), 1)
            word, before = (int.from_bytes(each, 'little')
                            for each in (data[2 * skipped:][:2], found))
            if (bit := row.address.bit) is None:
                yield tag, word, before, at
            elif (word ^ before) >> bit & 1 or meant is not None and meant.tag == tag:
                yield (tag, value_of_bit(row, word >> bit & 1),
                       value_of_bit(row, before >> bit & 1), at)

    def word(self, text: str) -> int:
        return int.from_bytes(self.plc.table.read(self.place_of(text), 1), 'little')

    def set(self, text: str, *words: int) -> None:  # noqa: A003
        """Change words of its table."""
        self.plc.table.write(self.place_of(text),
                             b''.join(word.to_bytes(2, 'little') for word in words))

    def run_program(self, now: float) -> None:
        """Let the program tell the time, so that each value that is read tells when it was."""
        if self.plc.is_running:
            self.set(CLOCK, *5 * (ticks(now),))

    def set_mode(self, setting: Setting, now: float) -> None:
        """Turn the key."""
        self.run_program(now)
        was_running = self.plc.is_running
        self.plc.set_mode(setting)
        if was_running and not self.plc.is_running:
            self.stopped = now
        elif self.plc.is_running and not was_running:
            self.ran_again = now

    def ran(self, now: float) -> float:
        """Return when its program ran last."""
        return now if self.plc.is_running else self.stopped

    def answered(self, place: Address, offset: int, until: float) -> tuple[float, int] | None:
        """Return when it read out a word last until then, and which it was."""
        for shown in reversed(self.shown):
            word = shown.word(place.area, offset) if shown.when <= until else None
            if word is not None:
                return shown.when, word
        return None

    def last_showed(self, tick: int, now: float) -> float:
        """Return until when its program showed a tick, a time long ago for never."""
        if tick == ticks(self.stopped):  # it stood so until it ran again
            return self.ran_again if self.plc.is_running else now
        return min(now, (now // STEP - (ticks(now) - tick) % _TICKS + 1) * STEP)


class Execute(Protocol):
    """Executes a command in a PLC; ``is_late`` if a gateway has kept it."""

    def __call__(self, command: Packet, *, is_late: bool = False) -> Packet: ...


PassOn = Callable[[WatchedPlc, Execute, Packet], Packet]


def is_write(command: Packet) -> bool:
    """Tell whether a command is a typed write."""
    return command.data[:1] in _WRITES


def ticks(now: float) -> int:
    """Return what the program of a PLC tells of a time."""
    return int(now // STEP) % _TICKS


# A lead that a stamp has shown is remembered for so long (s) at least (rule 7).
LEAD_IS_KNOWN = 5.0

# A longer standstill of the process is seen. For so long (s) after it, messages count as old (7).
STILL_IS_SEEN, STILL_COUNTS = 0.25, 0.5


def _written(value: int, is_right: bool) -> tuple[int, bytes]:
    """Return how the master writes to our table; a wrong command names a third word last."""
    place = parse_address(TAKEN, PlcType.PLC5)
    word = value.to_bytes(2, 'little')
    if is_right:
        return dialect_of(PlcType.PLC5).write(place, TAKEN_WORDS * word)
    elements = *(place.element + at for at in range(TAKEN_WORDS)), \
        parse_address(SERVED, PlcType.PLC5).element
    return _MASKED, b'\x26' + b''.join(
        bytes((7, 0, place.area.file, element, 0, 0)) + word for element in elements)


class Clocks:
    """
    The clocks of the publishers, and of the host, and what the process knows of them.

    That of the publishers is ``lead`` s ahead. ``counted`` has of each message that was not too
    old the tag, when it was published, and from when its age counts.
    """

    def __init__(self, patience: float, messages: Sequence[Mapping],
                 rows: Sequence[Mapping]) -> None:
        self.lead = 0.0
        self.allowed = {row.tag: most_ahead(row.topic, rows) for row in messages}
        self.counted: list[tuple[str, float, float]] = []
        self._patience = patience
        self._set_by, self._set_at = 0.0, -math.inf
        self.forget()

    def forget(self) -> None:
        """Begin like a process that has just started."""
        self._shown: dict[str, float] = {}  # when a stamp of a topic was too far ahead
        self._still: list[tuple[float, float]] = []  # ends of standstills, and their seconds
        self.host_clock = HostClock(self._patience)
        self._ages = {tag: Ages(self._patience, self.host_clock, allowed)
                      for tag, allowed in self.allowed.items()}

    def set(self, seconds: float, now: float) -> None:  # noqa: A003
        """Set the clock of the host, by which its publishers go."""
        self._set_by, self._set_at = seconds, now

    def stand_still(self, seconds: float, until: float) -> None:
        """Record that the process stands still until then."""
        self._still.append((until, seconds))

    def look(self, now: float) -> None:
        """Look at the clock of the host, as the main thread does."""
        self.host_clock.look(now, now + self._set_by)

    def stamp(self, published: float) -> float:
        """Return the stamp of a message that was published then."""
        return published + self.lead + (self._set_by if published >= self._set_at else 0.0)

    def age(self, tag: str, stamp: float, now: float) -> float:
        """Return from when the age of a message counts, or raise FormatError."""
        wall = now + self._set_by
        allowed = self.allowed[tag]
        if allowed is not None and stamp - wall > allowed:
            self._shown[tag] = now
        return self._ages[tag].of([stamp, wall], wall, now)

    def is_unknowable(self, tag: str, published: float, stamp: float, age: float,
                      now: float) -> bool:
        """
        Tell whether a clock was ahead or set back, and nothing that the process knows shows it.

        A message that was late on its way for longer than its clock is ahead looks like a new one.
        So does one from before the clock was set back, once that is forgotten, after write_timeout
        at the earliest. What the process knows is that its age is at least the time for which it
        stood still. This is judged by the true time, not by what the process has seen of it.
        """
        allowed = self.allowed[tag]
        lead = stamp - published - (self._set_by if published >= self._set_at else 0.0)
        is_ahead = allowed is not None and lead > allowed \
            and now - self._shown.get(tag, -math.inf) > LEAD_IS_KNOWN
        is_forgotten = published < self._set_at < now - self._patience
        return (is_ahead or is_forgotten) and age >= max(
            (seconds for until, seconds in self._still
             if seconds > STILL_IS_SEEN and until <= now < until + STILL_COUNTS), default=0.0)


class World(DriverBench):
    """
    A plant, and all that may happen to it.

    ``sent``, ``executed``, ``results`` and ``reads`` only grow. ``published`` tells when each
    message was, by tag and value; a message may be older than the moment in which it comes.
    ``change`` returns what becomes of the rows of the plant.
    """

    odd: tuple[Filter, Filter] = USUAL  # what PLCs hear, and say
    # Rows whose replies to reads never pass, from when on that is known, and until when it was.
    odd_rows: frozenset[str] = frozenset()
    odd_known, odd_last = math.inf, -math.inf
    _damage: Filter = bytes

    def __init__(self, plant: Plant, seed: int,
                 change: Callable[[list[Mapping]], list[Mapping]] = list) -> None:
        self.plant, self.seed = plant, seed
        self.dice = Random(seed)
        # Killed or replaced so far; the number of the first driver of this process.
        self.drivers = self.process = 0
        self._killed: list[Driver] = []
        self.others: dict[int, OtherBridge] = {}  # by the station of the PLC
        self.killed_at = self.opened = 0.0  # when a driver, and the port, were last
        self.ended = self._dead_until = -math.inf  # when an orderly end began last; after a kill
        rows = change(plant.mappings())
        settings = DriverSettings(
            write_timeout=plant.write_timeout, read_only=plant.is_read_only, processor_period=0.0,
            may_store=plant.may_store, first_tns=self.dice.randrange(0x10000))
        super().__init__(rows, network=plant.network, settings=settings, start=False, chunk=_FIFO)
        self._take_rows(rows)
        # Words that PLCs have taken; and all that they have executed, as station and command.
        self.executed, self.commands = list[Executed](), list[tuple[float, int, Packet]]()
        self.published: dict[tuple[str, int], float] = {}
        self.keys: list[tuple[str, int]] = []  # of all messages; their results have the number
        self.counts_from: dict[int, float] = {}  # from when the age of each that came counts
        self._guests = [Guest(f'pty:{number}', ShareAccess.ALL)
                        for number in range(self.dice.choice([1, 2, 16]))]
        self.asked: list[Packet] = []  # by the guest
        self.answered: list[Packet] = []
        # When a guest sent a value last; what this driver has said, where it is the only master.
        self.asked_at, self.said = dict[int, float](), bytearray()
        self.came: dict[str, float] = {}  # when a message of a row came last
        self.youngest: dict[str, float] = {}  # when the last of a row was published
        # When a second publisher of a row came and went, infinite until it goes.
        self.crowds: dict[str, list[tuple[float, float]]] = {}
        self.gaps: dict[str, float] = {}  # from when the topic was missing last that is required
        self.clocks = Clocks(plant.write_timeout, self.messages, rows)
        self.is_alive = True  # the executor
        self.away = 0.0  # until when the process stands still
        self.ill: dict[int, float] = dict.fromkeys(range(plant.stations + 1), 0.0)
        self.overwritten: dict[str, float] = {}  # when another network has written to an output
        self.holds = 0.0  # how often the gateway keeps a write for a while
        # What becomes of a command that has come to a PLC, or to the gateway before it.
        self.pass_on: PassOn = self._keep_some
        # Tells whether a gateway keeps a write of another value to a row, by its tag.
        self.may_land: Callable[[str, int], bool] = lambda tag, value: False
        self.losses: Losses | None = None
        self.wire = hashlib.sha256()
        self._values = dict.fromkeys(self.rows, 0)
        self.is_silent = self.is_queued = self.has_ended = False  # queued: behind another client
        self.deaf_since, self.heard_again = math.inf, -math.inf  # when the wire to us broke
        self.plcs = {station: self._watch(station) for station in range(1, plant.stations + 1)}
        self.far.hear, self.far.say = self._hear, self._say
        self.master: MasterNode | None = None
        # What it read of our own table, and when. What it did to the words that it may write, in
        # that order, and what it read there.
        self.served, self.taken = list[tuple[float, int]](), list[Said | tuple[int, ...]]()
        if plant.mode == 'Slave':
            self._put_a_master()
        self.sent: list[Sent] = []
        self._last_sent: dict[int, bytes] = {}  # by station
        self._senders: dict[tuple[str, int], int] = {}  # which driver sent a value last, by tag
        self.line.on_send = self._note_sent
        self.line.random = Random(seed)
        self.executor_ran = 0.0
        self.open()

    @property
    def longest_patience(self) -> float:
        """Return after how long (s) at most all guarded values of a stopped PLC are withheld."""
        return max(point.patience for mapping, point in self.driver.points.items()
                   if mapping.is_guarded) + 2 * self.longest

    @property
    def results(self) -> list[WriteResult]:
        """Return all results so far."""
        return self.listener.results

    @property
    def reads(self) -> list[tuple[float, Mapping, Kept]]:
        """Return all that was published so far."""
        return self.listener.reads

    def _watch(self, station: int) -> WatchedPlc:
        plc = self.plc(station, self.plant.kind, ('N7:0', max(80, self.plant.held)), ('N9:0', 8),
                       ('N10:0', 1))
        watched = WatchedPlc(plc, self._written(station))
        if self.plant.scan:
            self._run_ladder(watched)
        serve = plc.serve

        def execute(command: Packet, *, is_late: bool = False) -> Packet:
            return self.execute(watched, command, serve, is_late)

        def come(command: Packet) -> Packet:
            return self.pass_on(watched, execute, command)

        plc.serve = come  # type: ignore[method-assign]
        plc.slave = HalfDuplexSlave(LinkSettings(
            station=self.plant.gateway or station, checksum=self.network.checksum), come)
        return watched

    def _written(self, station: int) -> dict[str, Mapping]:
        return {row.tag: row for row in self.rows.values()
                if row.station == station and row.changes}

    def _run_ladder(self, watched: WatchedPlc) -> None:
        """Let its ladder run, and somebody who presses its button all the time."""
        beat = self.rows[f'beat_{watched.plc.station}']
        bound = next(bound for bound in self.report.times.bounds() if bound.mapping is beat)
        preset = bound.presets[0] if bound.presets else SLAVE_PRESET
        ladder = Ladder(watched.plc.table, preset, lambda *lamp: watched.lamps.append(lamp),
                        self.plant.scan / 1000)
        watched.plc.run_ladder(ladder)
        watched.preset = preset * TIME_BASE

        def press() -> None:
            watched.plc.advance()
            if not ladder.is_on(Lamp.IN_CONTROL):
                ladder.press_reset()
            self.at(self.line.now + _PRESSED_EVERY, press)

        press()

    def _put_a_master(self) -> None:
        """Let a master poll us and the PLCs, pass on what we send, and read what we serve."""
        network = self.network
        stations = OURS, *range(1, self.plant.stations + 1)
        self.master = master = MasterNode(
            replace(network.line, station=MASTER), self.clock, PollingSettings(stations),
            numbers=stations, timing=replace(network.timing, tx_delay=_MASTER_RESTS))
        self.line = VirtualLine(self.driver.machine, self.far, master.machine,
                                baud=network.baud, chunk=_FIFO)
        master.machine.start(self.line.now, self.line.outlet(master.machine))
        place = self.rows['served'].address
        dialect = self.rows['served'].dialect
        words, numbers = 1 + TAKEN_WORDS, count(1)

        def take(reply: Packet | None, _: Said) -> None:
            if reply is not None and not reply.sts:
                data = dialect.read_data(place, words, reply.data)
                first, *rest = (int.from_bytes(data[at:at + 2], 'little')
                                for at in range(0, 2 * words, 2))
                self.served.append((self.line.now, first))
                self.taken.append((*rest,))

        def take_end(reply: Packet | None, said: Said) -> None:
            self.taken.append(said._replace(sts=None if reply is None else reply.sts))

        def ask() -> None:
            if all(task.result is not None for task in master.all[-2:]):
                self._ask_us(master, *dialect.read(place, words), take)
                value = next(numbers)
                if value % 2:
                    is_right = value % 4 == 1
                    self._ask_us(master, *_written(value, is_right), take_end,
                                 Said(value, is_right, None))
            self.at(self.line.now + 0.5, ask)

        ask()

    def _ask_us(self, master: MasterNode, cmd: int, data: bytes,
                take: Callable[[Packet | None, Said], None],
                said: Said = Said(0, False, None)) -> None:  # noqa: B008
        """Let the master send a command for our own table, and take its end."""
        task = master.add(Packet(OURS, MASTER, cmd, 0, len(master.all), data))
        told, failed = task.reply, task.fail

        def reply(packet: Packet) -> None:
            told(packet)
            take(packet, said)

        def fail(error: LinkError) -> None:
            failed(error)
            take(None, said)

        task.reply, task.fail = reply, fail  # type: ignore[method-assign]

    def _keep_some(self, watched: WatchedPlc, execute: Execute, command: Packet) -> Packet:
        """Let the gateway keep a write for a while, and say that it has not delivered it."""
        if not is_write(command) or self.network.duplex is not Duplex.HALF \
                or self.dice.random() >= self.holds:
            return execute(command)
        late = self.dice.uniform(0.0, self.held_for - STEP)
        self.at(self.line.now + late, partial(execute, command, is_late=True))
        return command.reply(sts=0x02)

    @property
    def held_for(self) -> float:
        """Return for how long (s) a gateway may keep a write."""
        return 2 * self.network.line.cmd_timeout

    def execute(self, watched: WatchedPlc, command: Packet,
                serve: Callable[[Packet], Packet], is_late: bool) -> Packet:
        """Execute a command, unless it is refused; keep what it has written."""
        watched.run_program(self.line.now)
        now = watched.plc.clock()
        self.commands.append((now, watched.plc.station, command))
        if not is_write(command):
            return self._read_out(watched, command, serve)
        station = watched.plc.station
        if watched.lacks(command):
            self.forms.meant(station, command.data)
            return command.reply(sts=0x10)
        meant = None if is_late else self.forms.meant(station, command.data)
        written: list[tuple[str, int, int, int]] = []
        table = watched.plc.table
        write = table.write

        def note(address: Address, data: bytes) -> None:
            written.extend(watched.changes(address, data, meant))
            write(address, data)

        table.write = note  # type: ignore[method-assign]
        saved = {area: bytes(words) for area, words in table.words.items()} \
            if watched.refuses or watched.refuses_messages else {}
        reply = serve(command)
        del table.write
        values = {value for tag, value, *_ in written if not tag.startswith('beat')}
        is_message = any(value != SAFE and value not in GUESTS for value in values)
        if values and (watched.refuses or watched.refuses_messages and is_message):
            for area, words in saved.items():
                table.words[area][:] = words
            return command.reply(sts=0x10)
        is_told = not watched.swallows_replies or not is_message and (
            bool(values) or self.dice.random() < 0.5)
        self.executed += [
            Executed(now, station, tag, value, self._senders.get((tag, value), self.drivers),
                     before, is_late, is_told, at)
            for tag, value, before, at in written]
        if not is_told:
            return reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for
        return reply

    def _read_out(self, watched: WatchedPlc, command: Packet,
                  serve: Callable[[Packet], Packet]) -> Packet:
        """Execute a command that is no write; keep the words that it has read."""
        table, now = watched.plc.table, self.line.now
        read, found = table.read, list[tuple[int, Area, int]]()

        def note(address: Address, words: int) -> bytes:
            data = read(address, words)
            watched.shown.append(Shown(now, address.area, address.offset, data))
            found.extend((watched.plc.station, address.area, address.offset + at)
                         for at in range(words))
            return data

        table.read = note  # type: ignore[method-assign]
        reply = serve(command)
        del table.read
        if self.odd_rows and any(map(self._is_odd, found)):
            self._damaged.add((watched.plc.station, command.tns))
        return reply

    def _is_odd(self, place: tuple[int, Area, int]) -> bool:
        """Tell whether an odd row has a word."""
        station, area, offset = place
        return any(row.station == station and row.address.area == area
                   and 0 <= offset - row.address.offset < row.length
                   for row in map(self.rows.__getitem__, self.odd_rows))

    def _break_check(self, data: bytes) -> bytes:
        """Damage a message that is a reply of an odd row."""
        link = link_of(data)
        is_odd = link and link[2] & _REPLY and (
            link[1], int.from_bytes(link[4:6], 'little')) in self._damaged
        return data[:-1] + bytes((data[-1] ^ 1,)) if is_odd else data

    def _note_sent(self, data: bytes, start: float, receiver: int) -> None:
        if receiver == _FAR and not self.master:
            self.said += data
        if receiver != _FAR or len(data) < _LEAST_COMMAND or \
                self.master and data.removeprefix(ACK).startswith(SOH):
            return  # a master that polls us passes on what we have sent
        begun = data.find(STX) + len(STX)
        if begun < len(STX):
            return  # responses: after a pause some go out together
        station, tail = data[begun], data[begun:]
        if tail[1] != OURS:
            return  # a message that we pass on for a slave
        meant = self.forms.meant(station, tail.replace(stuff(DLE), DLE)[_HEADER:])
        if meant is not None:
            is_again = tail == self._last_sent.get(station)
            self._last_sent[station] = tail
            self._senders[meant.tag, meant.value] = self.drivers
            self.sent.append(
                Sent(start, station, meant.tag, meant.value, is_again, meant.at))

    def _hear(self, data: bytes) -> bytes:
        self.wire.update(b'%f>' % self.line.now + data)
        data = self.losses.hear(data) if self.losses else data
        data = self.odd[0](data)
        return b'' if self.is_silent or self.is_queued else data.replace(DAMAGED, b'ZYZZ')

    def _say(self, data: bytes) -> bytes:
        self.wire.update(b'%f<' % self.line.now + data)
        data = self.odd[1](self.losses.say(data) if self.losses else data)
        if self.odd_rows:
            data = self._damage(data)
        return b'' if self.is_unheard else data

    def _breathe(self) -> None:
        """Let the executor run, as it does while nothing holds it up."""
        if self.line.now >= self.away:
            self.clocks.look(self.line.now)
        if self.is_alive and self.line.now >= self.away:
            self.executor_ran = self.line.now
            self.driver.kernel.executor_ran(self.line.now)

    # What people and programs do

    def publish(self, row: Mapping, late: float = 0.0, *, is_equal: bool = False) -> None:
        """
        Publish a value that nobody has published before, or an equal one, ``late`` s ago.

        It waits for a process that stands still. Its stamp is of the clock of the publisher. A
        row of one bit has no other value.
        """
        is_new = not is_equal and row.type is not ValueType.BOOL
        value = self._values.get(row.tag, 0) or 1
        if is_new:
            value = self._values.get(row.tag, 0) % LARGEST + 1
        self._values[row.tag] = value
        now, published = self.line.now, self.line.now - late
        self.published[row.tag, value] = max(
            published, self.published.get((row.tag, value), -math.inf))
        self.came[row.tag] = now
        if now < self._dead_until:  # nothing is kept for it
            return
        self.keys.append((row.tag, value))
        message = Message(row, value, published, self.clocks.stamp(published), len(self.keys) - 1)
        if now < self.away:
            self.at(self.away, partial(self._take, self.drivers, message))
        else:
            self._take(self.drivers, message)

    def _take(self, driver: int, message: Message) -> None:
        """Take a message as the node does, unless the driver has ended that it was for."""
        if driver != self.drivers:
            return
        row, value, published, stamp, number = message
        now, values = self.line.now, row.length * [value]
        try:
            age = self.clocks.age(row.tag, stamp, now)
        except FormatError as error:
            self.driver.refuse([row], str(error), values, str(number))
            return
        if not self.clocks.is_unknowable(row.tag, published, stamp, age, now):
            self.clocks.counted.append((row.tag, published, now - age))
        self.counts_from[number] = now - age
        is_last = self.published[row.tag, value] == published
        self.published[row.tag, value] = now - age if is_last else max(
            now - age, self.published[row.tag, value])
        missing = self.youngest.get(row.tag, 0.0) + (self.plant.requires or 0) / 1000
        if not any(now - age <= until for _, until in self.crowds.get(row.tag, ())):
            if now - age > missing:
                self.gaps[row.tag] = missing
            self.youngest[row.tag] = max(now - age, self.youngest.get(row.tag, -math.inf))
        self.driver.write([row], values, now - age, str(number))
        self.line.wake(self.driver.machine)

    def crowd(self, row: Mapping, *, is_told: bool = True) -> None:
        """Let a second one publish on the topic of a row, too; the link is woken if it is told."""
        self.crowds.setdefault(row.tag, []).append((self.line.now, math.inf))
        self._set_crowd(row.tag, math.inf)
        if is_told:
            self.line.wake(self.driver.machine)

    def part(self) -> None:
        """Let nobody publish beside another one any more."""
        for tag, spans in self.crowds.items():
            begun, until = spans[-1]
            if until == math.inf:
                spans[-1] = begun, self.line.now
                self._set_crowd(tag, self.line.now)
        self.line.wake(self.driver.machine)

    def _set_crowd(self, tag: str, until: float) -> None:
        crowd = Crowd('more than one publisher', until)
        self.driver.kernel.crowd(self.rows[tag].topic, crowd)

    def ask(self, station: int, text: str) -> None:
        """Let a guest write a value of its own to a word, of all stations, or what none knows."""
        dice, value = self.dice, self.next_of_guests
        address = self.plcs[station].place_of(text)
        cmd, data = dialect_of(address.plc_type).write(address, value.to_bytes(2, 'little'))
        if dice.random() < 0.2:
            cmd, data = dice.choice([(0x06, DAMAGED * 50), (0x0F, b'\x68\0\0'), (0x0F, b'\x3A')])
        elif dice.random() < 0.2 and self.network.mode == 'Master':
            station = _ALL
        self.command(station, cmd, data)

    def command(self, station: int, cmd: int, data: bytes) -> None:
        """Let a guest send a command; a value of its own is the next of GUESTS."""
        command = Packet(station, 9, cmd, 0, len(self.asked), data)
        self.asked_at[self.next_of_guests] = self.line.now
        self.asked.append(command)
        self.driver.guests.put(GuestCommand(
            self.dice.choice(self._guests), command, self.line.now, self.answered.append))
        self.line.wake(self.driver.machine)

    @property
    def next_of_guests(self) -> int:
        """Return the value that a guest writes next."""
        return GUESTS[len(self.asked) % len(GUESTS)]

    # What goes wrong

    @property
    def is_deaf(self) -> bool:
        """Tell whether nothing reaches us, while all of ours reaches the PLCs."""
        return self.deaf_since < math.inf

    @property
    def is_unheard(self) -> bool:
        """Tell whether nothing reaches us."""
        return self.is_silent or self.is_queued or self.is_deaf

    def damage_rows(self, tags: Iterable[str]) -> None:
        """Let the replies with words of some rows never pass, as of bytes that something eats."""
        if self.odd_rows:
            self.odd_last = self.line.now
        self.odd_rows, self.odd_known = frozenset(tags), math.inf
        self._damaged = set[tuple[int, int]]()  # their replies, by station and TNS
        self._damage = symbol_by_symbol(self._break_check)

    @property
    def is_divided(self) -> bool:
        """Tell whether rows may not be read together because of rows that are or were odd."""
        return bool(self.odd_rows) or self.odd_last > self.opened

    def break_wire(self) -> None:
        """Let nothing reach us any more."""
        self.deaf_since = self.line.now

    def fall_silent(self, station: int, is_silent: bool = True) -> None:
        """Let a PLC answer nothing; of a full-duplex line or a modem all of them."""
        if self.network.duplex is Duplex.HALF:
            self.plcs[station].plc.faults.silent = is_silent
        else:
            self.is_silent = is_silent

    def kill(self, pause: float) -> None:
        """Kill the driver; another one begins after a pause."""
        self._begin_anew()
        self.process = self.drivers
        self._killed.append(self.driver)  # so that no end of its generators says anything
        self.restart(self.dice.randrange(0x10000))
        self.hold_up(pause)
        self._dead_until = self.away
        self.clocks.forget()
        self.executor_ran = self.line.now

    def _begin_anew(self) -> None:
        """Record that another driver begins."""
        self.drivers += 1
        self.has_ended = False
        self.killed_at = self.opened = self.line.now
        self.said.clear()

    def hold_up(self, seconds: float) -> None:
        """Let the process of the driver stand still."""
        self.line.pause(self.driver.machine, seconds)
        self.away = self.line.now + seconds
        self.clocks.stand_still(seconds, self.away)

    def behave_oddly(self, device: Device) -> None:
        """Let all PLCs behave like an odd but legal device."""
        self.odd = device.filters()
        self.line.chunks[0] = min(device.chunk, _FIFO)

    def lose_frames(self) -> None:
        """Let the line lose frames, but never more in a row than the settings repeat."""
        dice, network = self.dice, self.network
        what = dice.choice([(True, True), (True, False), (False, True)])
        lost = Lost(network.mode, nak_retries=network.nak_retries,
                    enq_retries=network.enq_retries, lost=dice.choice([0.2, 0.5, 1.0]),
                    lose_commands=what[0], lose_replies=what[1], seed=dice.randrange(1 << 30))
        self.losses = (AirLosses if network.mode == 'Radio' else Losses)(lost, self.clock)
        self.losses.is_due = True

    def unplug(self) -> None:
        """Lose the port for a moment."""
        self.lose_port()
        self.open()
        self.opened = self.line.now

    def unplug_for(self, seconds: float) -> None:
        """Lose the port for a while."""
        self.lose_port()

        def plug() -> None:
            if not self.driver.is_online and not self.has_ended:
                self.open()
                self.opened = self.line.now

        self.at(self.line.now + seconds, plug)

    def be_queued(self) -> None:
        """Connect again to a device server that another client has the line of."""
        self.unplug()
        self.is_queued = True

    def add_bridge(self, station: int) -> None:
        """Put another bridge on a port of its own of a PLC; it counts in the same word."""
        self.others[station] = OtherBridge(self, station)

    def write_heartbeat(self, station: int) -> None:
        """Let another writer count in the word of the heartbeat."""
        watched = self.plcs[station]
        watched.other = watched.other % 30_000 + 7
        watched.set(BEAT, watched.other)

    def write_foreign(self, station: int) -> None:
        """Let another program write once to the word of the heartbeat."""
        self.plcs[station].set(BEAT, FOREIGN)

    def overwrite(self, station: int) -> None:
        """Let another network write to the first output."""
        self.overwritten[f'w0_{station}'] = self.line.now
        self.plcs[station].set(OUTPUTS, OTHERS)

    def download(self, station: int) -> None:
        """Bring old words back; the PLC is in PROGRAM from now on."""
        watched = self.plcs[station]
        watched.set_mode(Setting.PROGRAM, self.line.now)
        watched.brought = self.line.now
        for place, value in watched.saved.items():
            watched.set(place, value)

    def save(self, station: int) -> None:
        """Upload: keep the words for a download."""
        watched = self.plcs[station]
        watched.saved = {place: watched.word(place) for place in watched.places.values()}

    def run(self, seconds: float) -> None:
        """Let time pass; each line has a clock of its own, and none is far ahead."""
        end = self.line.now + seconds
        while (left := end - self.line.now) > 0.0:
            self._breathe()
            super().run(min(left, STEP) if left > 1.5 * STEP else left)
            for other in self.others.values():
                other.run(self.line.now - other.line.now)
        for watched in self.plcs.values():
            if watched.preset:
                watched.plc.advance()

    def mend(self) -> None:
        """End all that is wrong."""
        for station, watched in self.plcs.items():
            self.fall_silent(station, False)
            watched.refuses = watched.refuses_messages = watched.swallows_replies = False
            watched.set_mode(Setting.RUN, self.line.now)
        self.part()
        self.is_alive, self.is_queued = True, False
        if self.is_deaf:
            self.heard_again = self.line.now
        self.deaf_since = math.inf
        self.line.noise = QUIET
        self.losses = None
        self.odd = USUAL
        self.damage_rows(())
        self.line.chunks[0] = _FIFO
        self.holds = self.clocks.lead = 0.0
        self.clocks.set(0.0, self.line.now)

    def wind_down(self, limit: float = LONGEST_END) -> None:
        """Write what an end writes, and wait for it, as the node does (rule 5)."""
        interlocks = self.driver.kernel
        self.ended = self.line.now
        interlocks.end.wind_down()
        self.line.wake(self.driver.machine)
        give_up = self.line.now + limit
        while self.line.now < give_up \
                and interlocks.end.has_to_wait(is_open=self.driver.is_online):
            self.run(STEP / 10)

    def end(self) -> None:
        """End in order, and stay ended for as long as a gateway keeps."""
        self.wind_down()
        self.driver.machine.stop(PortLost('the end'), self.line.now)
        self.has_ended = True
        self.run(self.held_for)

    def begin(self) -> None:
        """Start a process in the place of one that has ended; some rows have a new Length."""
        self._read_files(self._rows_read_again())
        self.process = self.drivers
        self.restart()

    def reload(self) -> None:
        """Go on with files that were read again, after ``wind_down``."""
        self.use(self._rows_read_again())

    def use(self, rows: Sequence[Mapping]) -> None:
        """Let a driver of these rows go on, which knows what the driver before it knows."""
        self._read_files(rows)
        self.hand_over(rows, self.dice.randrange(0x10000))

    def _rows_read_again(self) -> list[Mapping]:
        """Return a new row for each row; some have another Length."""
        lengths = {row.tag: row.length for row in self.plant.mappings()
                   if row.tag.startswith(('clock', 'held'))}
        return [replace(row, length=self.dice.choice([lengths[tag], lengths[tag] // 2])
                        if tag in lengths else row.length) for tag, row in self.rows.items()]

    def _read_files(self, rows: Sequence[Mapping]) -> None:
        self._take_rows(rows)
        self.mappings = rows
        for watched in self.plcs.values():
            watched.take_rows(self._written(watched.plc.station))
        self._begin_anew()

    def _take_rows(self, rows: Sequence[Mapping]) -> None:
        self.rows = {row.tag: row for row in rows}
        self.messages = [row for row in rows if row.tag[0] in 'wfs']
        self.report = make_report(self.network, rows, self._settings.default_period,
                                  max(0.01, self.plant.scan / 1000))
        self.bounds = {bound.mapping.tag: bound.seconds for bound in self.report.times.bounds()}
        self.longest = self.report.times.longest  # s
        self.forms = Forms(row for row in rows if row.changes and not row.serves)

    def rows_of(self, station: int, tags: Sequence[str] = ('w',)) -> list[Mapping]:
        """Return rows of a PLC whose tags begin so; of outputs those with Fallback."""
        return [row for row in self.rows.values()
                if row.station == station and row.tag.startswith(tuple(tags))
                and (row.fallback or row.tag[0] != 'w')]


class OtherBridge(DriverBench):
    """
    Another bridge, at another port of a PLC of a world: two on one line have one master.

    It has a Heartbeat row for the same word, and lives. Its tag begins with ``other``.
    """

    def __init__(self, world: World, station: int) -> None:
        plant, first = world.plant, world.plcs[station]
        row = make_mapping(BEAT, 'Heartbeat', station=station, plc=plant.kind,
                           tag=f'other_{station}', period=world.dice.choice([plant.period, 700]))
        super().__init__(
            [row], network=Network(station=OTHER_BRIDGE, baud=19200, timeout=100, cmd_timeout=500),
            settings=DriverSettings(processor_period=0.0,
                                    first_tns=world.dice.randrange(0x10000)),
            start=False, chunk=_FIFO)
        self.line.now = world.line.now
        plc = SimulatedPlc(station, first.plc.table, self.network.checksum, self.clock,
                           processor=first.plc.processor)
        watched = WatchedPlc(plc, {row.tag: row})
        serve = plc.serve

        def execute(command: Packet) -> Packet:
            return world.execute(watched, command, serve, is_late=False)

        plc.serve = execute  # type: ignore[method-assign]
        plc.slave = HalfDuplexSlave(
            LinkSettings(station=station, checksum=self.network.checksum), execute)
        self.connect(plc)
        self._breathe()
        self.open()

    def _breathe(self) -> None:
        self.driver.kernel.executor_ran(self.clock())
        self.at(self.clock() + STEP, self._breathe)
