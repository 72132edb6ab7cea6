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
A plant on a virtual clock: a driver, its PLCs, publishers, and all that goes wrong between them.

Everything but ROS itself; a seed and a commit replay a run to the byte. What is done goes through
the ``World``, and what came of it is in its lists, with the time it came. Each value that is
published is another one, so what a PLC executes tells who asked for it, and when.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
import hashlib
from random import Random

from abdf1_ros.df1.frames import stuff
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.guests import Guest, GuestCommand, ShareAccess
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import WriteResult
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, Heartbeat, PublishWhile
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.virtual_line import Noise, QUIET

STEP = 0.05  # s
SAFE = 32_000  # the fallback of every row
GUESTS = range(33_000, 33_600)  # what only guests write: more than a heartbeat counts to
OTHERS = 34_000  # what comes into a word from another network
LARGEST = 31_000  # of what is published
_LEAST_COMMAND = 10  # bytes: no poll
_ALL = 255  # stations
_WRITES = (b'\x67', b'\xAA')  # functions of a typed write
_TICKS = 30_000
_FAR = 1  # what a VirtualLine calls the far end
SMALL = Noise(lost=0.0005, flipped=0.001, inserted=0.0005)
MODES: dict[str, dict[str, str]] = {
    'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'},
    'Radio': {'mode': 'Radio'}, 'Gateway': {}, 'Standard gateway': {'polling': 'Standard'}}
GATEWAY = 5  # the station on the line, behind which the PLC is
DAMAGED = b'ZZZZ'  # what the line does not carry: only guests send it

# The words of each PLC: outputs, a row without Fallback after them, its program's own, heartbeat.
OUTPUTS, FREE, CLOCK, COUNTER, BEAT = 'N7:0', 'N7:20', 'N9:0', 'N9:4', 'N10:0'


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

    @classmethod
    def drawn(cls, dice: Random, mode: str = '') -> Plant:
        """Return any plant."""
        common = [name for name in MODES if 'Standard' not in name]
        mode = mode or dice.choice([*MODES, *3 * common])
        stations = 1 if mode == 'Peer' or 'ateway' in mode else dice.choice([1, 1, 1, 2, 3])
        return cls(
            mode, stations, dice.choice([1, 2, 2, 3]), dice.choice(['PLC5', 'SLC']),
            dice.choice([600, 1000, 2000]), dice.choice([500, 1000, 2000]),
            dice.choice([None, None, 800, 1500]), dice.choice([9600, 19200, 38400]),
            dice.choice([1, 2]), dice.choice([0.5, 2.0]), dice.random() < 0.04)

    @property
    def network(self) -> Network:
        """Return the settings of its line."""
        return Network(
            station=200, baud=self.baud, timeout=100, cmd_timeout=500, nak_retries=self.retries,
            enq_retries=self.retries, **MODES[self.mode])  # type: ignore[arg-type]

    @property
    def gateway(self) -> int | None:
        """Return the station behind which the PLC is, None where it is on the line itself."""
        return GATEWAY if 'ateway' in self.mode else None

    @property
    def counts_within(self) -> int:
        """Return the Heartbeat_Timeout of the counter; by radio reads take longer."""
        return 20_000 if self.mode == 'Radio' else 3500

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
                add(f'N7:{number}', 'Write', f'w{number}', fallback=fallback)
            add(FREE, 'Write', 'free')
            needed = (f'w0_{station}',) if self.requires else ()
            add(BEAT, 'Heartbeat', 'beat', period=self.period,
                heartbeat=Heartbeat(needed, self.requires))
            add(CLOCK, 'Read', 'clock', length=2, period=1000)
            add('N9:2', 'Read', 'running', period=1000, publish_while=PublishWhile(None, None))
            add(COUNTER, 'Read', 'counter', period=1000)
            add('N9:3', 'Read', 'counted', period=1000,
                publish_while=PublishWhile(f'counter_{station}', self.counts_within))
        return found


@dataclass(frozen=True, slots=True)
class Executed:
    """
    A word that a PLC has taken from the line.

    ``sent`` is when its command was put on the line first; ``driver`` counts the drivers there
    were. ``before`` was in the word. ``is_late`` tells that a gateway had kept it.
    """

    when: float
    sent: float
    station: int
    tag: str
    value: int
    driver: int
    before: int
    is_late: bool = False


@dataclass(slots=True)
class WatchedPlc:
    """A PLC, and what it does with what comes."""

    plc: SimulatedPlc
    places: dict[str, str]  # address by tag
    refuses: bool = False  # everything but heartbeats
    refuses_messages: bool = False  # but takes fallbacks
    swallows_replies: bool = False  # to messages, which are executed
    other: int = 0  # what another writer has put into the word of the heartbeat
    stopped: float = 0.0  # when its program stopped last
    ran_again: float = 0.0  # and when it ran after that
    saved: dict[str, int] = field(default_factory=dict)
    tags: dict[str, str] = field(init=False)  # by address

    def __post_init__(self) -> None:
        self.tags = {place: tag for tag, place in self.places.items()}

    def word(self, text: str) -> int:
        """Return a word of its table."""
        table = self.plc.table
        return int.from_bytes(table.read(place_of(text, table.plc_type), 1), 'little')

    def set(self, text: str, *words: int) -> None:  # noqa: A003
        """Change words of its table."""
        table = self.plc.table
        table.write(place_of(text, table.plc_type),
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

    def last_showed(self, tick: int, now: float) -> float:
        """Return until when its program showed a tick, a time long ago for never."""
        if tick == ticks(self.stopped):  # it stood so until it ran again
            return self.ran_again if self.plc.is_running else now
        age = (ticks(now) - tick) % _TICKS
        return min(now, (now // STEP - age + 1) * STEP)


place_of = cache(parse_address)


def ticks(now: float) -> int:
    """Return what the program of a PLC tells of a time."""
    return int(now // STEP) % _TICKS


class World(DriverBench):
    """
    A plant, and all that may happen to it.

    ``executed``, ``results`` and ``reads`` only grow. ``published`` tells when each message was,
    by tag and value; a message may be older than the moment in which it comes.
    """

    def __init__(self, plant: Plant, seed: int) -> None:
        self.plant = plant
        self.seed = seed
        self.dice = Random(seed)
        self.drivers = 0  # killed so far
        self.killed_at = 0.0
        self.opened = 0.0  # when the port was last
        rows = plant.mappings()
        settings = DriverSettings(
            write_timeout=plant.write_timeout, read_only=plant.is_read_only, processor_period=0.0,
            first_tns=self.dice.randrange(0x10000))
        super().__init__(rows, network=plant.network, settings=settings, start=False, chunk=64)
        self.rows = {row.tag: row for row in rows}
        self.messages = [row for row in rows if row.tag[0] in 'wf']
        self.executed: list[Executed] = []
        self.published: dict[tuple[str, int], float] = {}
        self.keys: list[tuple[str, int]] = []  # of all messages, in their order
        self._guests = [Guest(f'pty:{number}', ShareAccess.ALL)
                        for number in range(self.dice.choice([1, 2, 16]))]
        self.asked: list[Packet] = []  # by the guest
        self.answered: list[Packet] = []
        self.came: dict[str, float] = {}  # when a message of a row came last
        self.report = make_report(plant.network, rows, settings.default_period)
        self.bounds = {bound.mapping.tag: bound.seconds for bound in self.report.times.bounds()}
        self.longest = self.report.times.longest  # s
        self.is_alive = True  # the executor
        self.away = 0.0  # until when the process stands still
        self.ill: dict[int, float] = dict.fromkeys(range(plant.stations + 1), 0.0)
        self.overwritten: dict[str, float] = {}  # when another network has written to an output
        self.holds = 0.0  # how often the gateway keeps a write for a while
        self.wire = hashlib.sha256()
        self._values = dict.fromkeys(self.rows, 0)
        self.is_silent = False
        self.plcs = {station: self._watch(station) for station in range(1, plant.stations + 1)}
        self.far.hear, self.far.say = self._hear, self._say
        self._sent: deque[tuple[float, bytes]] = deque()  # what the driver has put on the line
        self._send, self.line._send = self.line._send, self._note_sent  # type: ignore[method-assign]
        self.line._random = Random(seed)
        self.executor_ran = 0.0
        self._breathe()
        self.open()

    @property
    def longest_patience(self) -> float:
        """Return after how long (s) at most all guarded values of a stopped PLC are withheld."""
        return max(point.patience for mapping, point in self.driver.points.items()
                   if mapping.publish_while) + 2 * self.longest

    @property
    def results(self) -> list[WriteResult]:
        """Return all results so far."""
        return self.listener.results

    @property
    def reads(self) -> list[tuple[float, Mapping, Values]]:
        """Return all that was published so far."""
        return self.listener.reads

    def _watch(self, station: int) -> WatchedPlc:
        plc = self.plc(station, self.plant.kind, ('N7:0', 24), ('N9:0', 8), ('N10:0', 1))
        places = {row.tag: str(row.address) for row in self.rows.values()
                  if row.station == station and (row.writes or row.heartbeat)}
        watched = WatchedPlc(plc, places)
        serve = plc.serve

        def execute(command: Packet, *, is_late: bool = False) -> Packet:
            return self._execute(watched, command, serve, is_late)

        plc.serve = execute  # type: ignore[method-assign]
        plc.slave = HalfDuplexSlave(
            LinkSettings(station=self.plant.gateway or station, checksum=self.network.checksum),
            partial(self._pass_on, execute))
        return watched

    def _pass_on(self, execute: Callable[..., Packet], command: Packet) -> Packet:
        """Let the gateway keep a write for a while, and say that it has not delivered it."""
        if command.data[:1] not in _WRITES or self.dice.random() >= self.holds:
            return execute(command)
        late = self.dice.uniform(0.0, self.held_for - STEP)
        self.at(self.line.now + late, partial(execute, command, is_late=True))
        return command.reply(sts=0x02)

    @property
    def held_for(self) -> float:
        """Return for how long (s) a gateway may keep a write."""
        return 2 * self.network.line.cmd_timeout

    def _execute(self, watched: WatchedPlc, command: Packet,
                 serve: Callable[[Packet], Packet], is_late: bool) -> Packet:
        """Execute a command, unless it is refused; keep what it has written."""
        watched.run_program(self.line.now)
        if command.data[:1] not in _WRITES:
            return serve(command)
        station = watched.plc.station
        written: list[tuple[str, int]] = []
        table = watched.plc.table
        write, by_address = table.write, watched.tags
        saved = {place: watched.word(place) for place in by_address}

        def note(address: object, data: bytes) -> None:
            if str(address) in by_address:
                written.append((by_address[str(address)], int.from_bytes(data, 'little')))
            write(address, data)  # type: ignore[arg-type]

        table.write = note  # type: ignore[method-assign]
        reply = serve(command)
        del table.write  # type: ignore[attr-defined]
        values = {value for tag, value in written if not tag.startswith('beat')}
        is_message = bool(values - {SAFE, *GUESTS})
        if values and (watched.refuses or watched.refuses_messages and is_message):
            for tag, _ in written:
                watched.set(watched.places[tag], saved[watched.places[tag]])
            return command.reply(sts=0x10)
        sent = self._first_sent(command)
        self.executed += [Executed(self.line.now, sent, station, tag, value, self.drivers,
                                   saved[watched.places[tag]], is_late)
                          for tag, value in written]
        if is_message and watched.swallows_replies:
            return reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for
        return reply

    def _note_sent(self, data: bytes, start: float, receiver: int) -> None:
        if receiver == _FAR and len(data) >= _LEAST_COMMAND:
            self._sent.append((start, data))
        self._send(data, start, receiver)

    def _first_sent(self, command: Packet) -> float:
        """Return when the driver has put a command on the line first, as far as it is known."""
        while self._sent[0][0] < self.line.now - 2 * self.longest:
            self._sent.popleft()
        wanted = stuff(command.tns.to_bytes(2, 'little') + command.data)
        return next((when for when, data in self._sent if wanted in data), self.line.now)

    def _hear(self, data: bytes) -> bytes:
        self.wire.update(b'%f>' % self.line.now + data)
        return b'' if self.is_silent else data.replace(DAMAGED, b'ZYZZ')

    def _say(self, data: bytes) -> bytes:
        self.wire.update(b'%f<' % self.line.now + data)
        return b'' if self.is_silent else data

    def _breathe(self) -> None:
        """Let the executor run, as it does while nothing holds it up."""
        if self.is_alive and self.line.now >= self.away:
            self.executor_ran = self.line.now
            self.driver.interlocks.executor_ran(self.line.now)
        self.at(self.line.now + STEP, self._breathe)

    # What people and programs do

    def publish(self, row: Mapping, late: float = 0.0) -> None:
        """Publish a value that nobody has published before, ``late`` s ago."""
        value = self._values[row.tag] = self._values[row.tag] % LARGEST + 1
        now = self.line.now
        self.published[row.tag, value] = now - late
        self.keys.append((row.tag, value))
        self.came[row.tag] = now
        self.driver.write([row], [value], now - late)
        if now >= self.away:
            self.line.wake(self.driver.machine)

    def ask(self, station: int, text: str) -> None:
        """Let a guest write a value of its own to a word, of all stations, or what none knows."""
        dice, value = self.dice, GUESTS[len(self.asked) % len(GUESTS)]
        address = place_of(text, self.plcs[station].plc.table.plc_type)
        cmd, data = dialect_of(address.plc_type).write(address, value.to_bytes(2, 'little'))
        if dice.random() < 0.2:
            cmd, data = dice.choice([(0x06, DAMAGED * 50), (0x0F, b'\x68\0\0'), (0x0F, b'\x3A')])
        elif dice.random() < 0.2 and self.network.mode == 'Master':
            station = _ALL
        command = Packet(station, 9, cmd, 0, len(self.asked), data)
        self.asked.append(command)
        self.driver.guests.put(GuestCommand(
            dice.choice(self._guests), command, self.line.now, self.answered.append))
        self.line.wake(self.driver.machine)

    # What goes wrong

    def fall_silent(self, station: int, is_silent: bool = True) -> None:
        """Let a PLC answer nothing; of a full-duplex line or a modem all of them."""
        if self.network.mode == 'Master':
            self.plcs[station].plc.faults.silent = is_silent
        else:
            self.is_silent = is_silent

    def kill(self, pause: float) -> None:
        """Kill the driver; another one begins after a pause."""
        self.drivers += 1
        self.killed_at = self.opened = self.line.now
        self._settings = replace(self._settings, first_tns=self.dice.randrange(0x10000))
        self.restart()
        self.hold_up(pause)
        self.executor_ran = self.line.now

    def hold_up(self, seconds: float) -> None:
        """Let the process of the driver stand still."""
        self.line.pause(self.driver.machine, seconds)
        self.away = self.line.now + seconds

    def unplug(self) -> None:
        """Lose the port for a moment."""
        self.lose_port()
        self.open()
        self.opened = self.line.now

    def write_heartbeat(self, station: int) -> None:
        """Let another writer count in the word of the heartbeat."""
        watched = self.plcs[station]
        watched.other = watched.other % 30_000 + 7
        watched.set(BEAT, watched.other)

    def overwrite(self, station: int) -> None:
        """Let another network write to the first output."""
        self.overwritten[f'w0_{station}'] = self.line.now
        self.plcs[station].set(OUTPUTS, OTHERS)

    def download(self, station: int) -> None:
        """Bring old words back; the PLC is in PROGRAM from now on."""
        watched = self.plcs[station]
        watched.set_mode(Setting.PROGRAM, self.line.now)
        for place, value in watched.saved.items():
            watched.set(place, value)

    def save(self, station: int) -> None:
        """Upload: keep the words for a download."""
        watched = self.plcs[station]
        watched.saved = {place: watched.word(place) for place in watched.places.values()}

    def mend(self) -> None:
        """End all that is wrong."""
        for station, watched in self.plcs.items():
            self.fall_silent(station, False)
            watched.refuses = watched.refuses_messages = watched.swallows_replies = False
            watched.set_mode(Setting.RUN, self.line.now)
        self.is_alive = True
        self.line.noise = QUIET
        self.holds = 0.0

    def end(self) -> None:
        """End in order (rule 5), within 2 s, and stay ended for as long as a gateway keeps."""
        interlocks = self.driver.interlocks
        interlocks.wind_down()
        self.line.wake(self.driver.machine)
        limit = self.line.now + 2.0
        while not interlocks.is_over and self.line.now < limit:
            self.run(STEP / 10)
        self.driver.machine.stop(PortLost('the end'))
        self.run(self.held_for)

    def reload(self) -> None:
        """Put another driver in the place of one that has ended."""
        self.drivers += 1
        self.killed_at = self.opened = self.line.now
        self.restart()

    def rows_of(self, station: int, tags: Sequence[str] = ('w',)) -> list[Mapping]:
        """Return rows of a PLC whose tags begin so."""
        return [row for row in self.rows.values()
                if row.station == station and row.tag.startswith(tuple(tags))]
