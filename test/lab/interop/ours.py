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

"""Our two ends of an exchange: the node, as client or as server, and the simulated PLC."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import sys
import time
from typing import Any, Protocol, TypeVar

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import Machine, Procedure
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import Codec, types_of, ValueType
from abdf1_ros.ports.endpoints import SerialEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ros.topics.messages import MESSAGES, values_of, write_qos
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from cases import Case, same, Values
from plain import decoded, encoded, PlainLine, PlainPlc, SIZES, split
from std_msgs.msg import String
from support.odd_device import OddDevice, Wiring
from support.ros import Inbox, latched_qos, Observer, Process, ros_args, write_csv

Device = TypeVar('Device', bound=OddDevice)

OURS, THEIRS = 5, 1  # stations of the node, and of what answers it
BESIDE, VIA = 2, 7  # a second station on the line, and a gateway
PATIENCE = 5.0  # s until a value has to be there
BAUD = 19200
BEAT = Case('N7:240', [0], [0])  # the heartbeat of a node that shares its line
BEAT_TIME = 0.2  # s between two beats, its Period
CLOCK = Case('N7:250', [0], [0])  # the milliseconds of the PLC, as far as a word goes
_CLOCK_TURN = 0x8000


@dataclass(frozen=True, slots=True)
class Setup:
    """
    What a run is about.

    ``access`` is the cell Access of the node's rows; ``serves`` tells that they are Serve.
    ``share`` is the cell Share: guests have these ``rights``, and the node has a heartbeat.
    ``via`` is the gateway of the stations. In Mode Master there is a second station. ``is_paced``
    tells that the line is as slow as BAUD makes it.
    """

    family: PlcType
    check: Checksum
    port: str
    cases: Sequence[Case]
    folder: Path
    access: str = ''
    serves: bool = False
    mode: str = 'Peer'
    share: str = ''
    rights: str = 'Write'
    via: int | None = None
    is_paced: bool = False


class End(Protocol):
    """One of our ends."""

    def give(self, case: Case, values: Values) -> None:
        """Put values at the address of a case: into our words, or into the other's."""

    def take(self, case: Case, expected: Values) -> Values | None:
        """Return what is there, at the latest after PATIENCE, earlier when it is as expected."""

    def close(self) -> None:
        """End it."""


def codec_of(case: Case, family: PlcType) -> tuple[Address, Codec]:
    """Return the address of a case and what makes its values of words."""
    address = parse_address(case.address, family)
    return address, Codec(types_of(address)[0], case.count, address.bit or 0)


class PlcEnd:
    """The simulated PLC at the end of a line, as station 1."""

    def __init__(self, setup: Setup) -> None:
        self._family = setup.family
        table = DataTable(setup.family)
        for case in setup.cases:
            address, codec = codec_of(case, setup.family)
            table.create(address, codec.words)
        self._plc = SimulatedPlc(THEIRS, table, setup.check, time.monotonic, setup.via)
        other = SimulatedPlc(BESIDE, DataTable(setup.family), setup.check, time.monotonic,
                             setup.via)
        for case in setup.cases:  # other values at the same addresses
            address, codec = codec_of(case, setup.family)
            other.table.create(address, codec.words)
            other.table.write(address, b'\x55' * 2 * codec.words)
        is_peer = setup.mode == 'Peer'
        if is_peer:
            self._plc.be_full_duplex()

        def run(machine: Machine) -> Procedure:
            peer = FullDuplexPeer(
                machine, LinkSettings(station=None, checksum=setup.check), ActiveStationList(),
                self._plc.serve)
            return peer.run(self._plc)

        machine = Machine(run if is_peer else multidrop(
            stations_of([self._plc, other], setup.check)), checksum=setup.check,
                          duplex=Duplex.FULL if is_peer else Duplex.HALF,
                          counters=self._plc.counters)
        self._link = LinkThread(machine, SerialEndpoint(PortSettings(setup.port, BAUD)).open)
        self._link.start()

    def give(self, case: Case, values: Values) -> None:
        """Put values into the PLC's table."""
        address, codec = codec_of(case, self._family)
        if codec.type is not ValueType.BOOL:
            self._plc.table.write(address, codec.encode(wanted(values, codec.type)))
            return
        assert not isinstance(values, str)
        for change in codec.bit_changes(address, values):
            self._plc.table.write_bits(*change)

    def take(self, case: Case, expected: Values) -> Values:
        """Return what is in the PLC's table."""
        address, codec = codec_of(case, self._family)
        values = codec.decode(self._plc.table.read(address, codec.words))
        return values if isinstance(values, str) else list(values)

    def close(self) -> None:
        """End it."""
        self._link.stop()


def _milliseconds() -> int:
    return int(time.monotonic() * 1000) % _CLOCK_TURN


def wired(kind: type[Device], setup: Setup) -> Device:
    """Return a device that is station 1, beside another, or with it behind a gateway."""
    if setup.mode == 'Peer':
        return kind(Wiring.FULL, THEIRS)
    nodes = THEIRS, BESIDE
    device = kind(Wiring.HALF, THEIRS if setup.via is None else setup.via, nodes)
    if setup.via is None:
        device.stations = device.nodes
    return device


class PlainEnd:
    """A PLC that shares no code with the package at the end of a line, as station 1."""

    def __init__(self, setup: Setup) -> None:
        self._plc = wired(PlainPlc, setup)
        self._plc.is_plc5 = setup.family is PlcType.PLC5
        for case in setup.cases:  # the other station has other values at the same addresses
            number, at = self._plc.place(case.address)
            self._plc.files[BESIDE][number][at:at + 84] = 84 * b'\x55'
        self._line = PlainLine(setup.port, self._plc, 10 / BAUD if setup.is_paced else 0.0)

    def run_clock(self) -> None:
        """Keep the milliseconds of this host in CLOCK."""
        self._plc.scan = lambda: self.give(CLOCK, [_milliseconds()])

    def give(self, case: Case, values: Values) -> None:
        """Put values into the PLC's files."""
        letters, _, _, _, bit = split(case.address)
        number, at = self._plc.place(case.address)
        file = self._plc.files[THEIRS][number]
        if bit is None:
            data = encoded(letters, values)
            file[at:at + len(data)] = data
            return
        byte = at + bit // 8
        file[byte] = file[byte] & ~(1 << bit % 8) | bool(values[0]) << bit % 8

    def take(self, case: Case, expected: Values) -> Values:
        """Return what is in the PLC's files."""
        letters, _, _, _, bit = split(case.address)
        number, at = self._plc.place(case.address)
        file = self._plc.files[THEIRS][number]
        if bit is not None:
            return [file[at + bit // 8] >> bit % 8 & 1]
        size = SIZES[letters] if letters in ('ST', 'F', 'L') else 2
        return decoded(letters, bytes(file[at:at + size * case.count]))

    def close(self) -> None:
        """End it."""
        self._line.close()


def wanted(values: Values, kind: ValueType) -> Values:
    """Return values as their type has them: a word with or without sign."""
    if kind is ValueType.INT16 and not isinstance(values, str):
        return [(int(value) & 0xFFFF ^ 0x8000) - 0x8000 for value in values]
    return values


class RowAge:
    """How old (s) the newest value of CLOCK has become: as ``promised``, and as was ``seen``."""

    def __init__(self, promised: float) -> None:
        self.promised = promised
        self.seen = 0.0
        self.messages = 0
        self._read_at: float | None = None

    def take(self, value: int) -> None:
        """Take a value that comes now: until now the last one was the newest."""
        now = time.monotonic()
        if self._read_at is not None:
            self.seen = max(self.seen, now - self._read_at)
        self._read_at = now - (_milliseconds() - value) % _CLOCK_TURN / 1000
        self.messages += 1


class NodeEnd:
    """The node, in Mode Peer as a rule; its rows are Serve, or it asks station 1."""

    def __init__(self, setup: Setup) -> None:
        self._cases = {case.address: f'v{number}' for number, case in enumerate(setup.cases)}
        self._family = setup.family
        self._serves = setup.serves
        rows, via = list[str](), '' if setup.via is None else setup.via
        for case, tag in zip(setup.cases, self._cases.values()):
            command, station = ('Serve', OURS) if setup.serves else (
                'Read' if case.is_structure else 'ReadWrite', THEIRS)
            rows.append(f'{tag},{command},{case.address},{station},{setup.family.value},'
                        f'{case.count},{"" if setup.serves else 500},{setup.access},{via}')
        if setup.share:
            rows.append(
                f'beat,Heartbeat,{BEAT.address},{THEIRS},{setup.family.value},,200,,{via}')
        if setup.mode == 'Master':
            rows.append(f'beside,Read,N7:0,{BESIDE},{setup.family.value},,1000,,{via}')
        net = write_csv(
            setup.folder / 'net.csv',
            'Mode,Station,PLC_Type,Error_Code,Com_Port,Baud,Timeout,Cmd_Timeout,Share,'
            'Share_Access',
            [f'{setup.mode},{OURS},{setup.family.value},{setup.check.value},{setup.port},{BAUD},'
             f'500,5000,{setup.share},{setup.rights}'])
        table = write_csv(
            setup.folder / 'map.csv',
            'Tag,Command,Address,Station,PLC_Type,Length,Period,Access,Via', rows)
        self._observer = Observer('interop')
        self._results = self._observer.results()
        self._node = Process('node', *ros_args(f'net_file:={net}', f'map_file:={table}'))
        self._inboxes: dict[str, Inbox] = {}
        self._publishers: dict[str, Any] = {}
        try:
            self._find_topics(setup)
        except AssertionError:
            self.close()
            raise

    def _find_topics(self, setup: Setup) -> None:
        """Wait for the topics of all rows."""
        self._node.wait_for(': open')
        for case in setup.cases:
            tag = self._cases[case.address]
            kind = MESSAGES[codec_of(case, setup.family)[1].type]
            self._inboxes[case.address] = self._observer.listen(kind, f'/abdf1/read/{tag}')
            if case.is_structure and not setup.serves:
                continue  # its control word belongs to the processor
            publisher = self._observer.node.create_publisher(
                kind, f'/abdf1/write/{tag}', write_qos())
            self._observer.until(publisher.get_subscription_count, f'a subscriber of {tag}')
            self._publishers[case.address] = publisher

    def give(self, case: Case, values: Values) -> None:
        """Publish values to the write topic."""
        kind = codec_of(case, self._family)[1].type
        message = MESSAGES[kind]()
        message.data = wanted(values, kind)
        self._publishers[case.address].publish(message)
        if not self._serves:
            result = self._results.until(lambda result: True, f'result of {case.address}')
            if result.message != 'written':
                print(f'{case.address}: {result.message}', file=sys.stderr)
            self._results.clear()
        self._spin(0.3)

    def take(self, case: Case, expected: Values) -> Values | None:
        """Return the newest value of the read topic."""
        inbox = self._inboxes[case.address]
        inbox.clear()
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and not (inbox and same(expected, self._values(inbox))):
            self._spin(0.05)
        return self._values(inbox) if inbox else None

    def watch_age(self) -> RowAge:
        """Return the age of the row CLOCK from now on, as this process gets it."""
        topic = f'/abdf1/read/{self._cases[CLOCK.address]}'
        publisher, = self._observer.node.get_publishers_info_by_topic(topic)
        age = RowAge(publisher.qos_profile.deadline.nanoseconds / 1e9)
        self._observer.node.create_subscription(
            MESSAGES[ValueType.INT16], topic, lambda message: age.take(message.data[0]),
            latched_qos())
        return age

    @staticmethod
    def _values(inbox: Inbox) -> Values:
        message = inbox[-1]
        return message.data if isinstance(message, String) else list(values_of(message))

    def until_there(self, place: Path) -> None:
        """Wait until a guest can connect."""
        self._observer.until(place.exists, f'the place {place}')

    def _spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._observer.executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        """End it."""
        try:
            self._node.end()
        finally:
            self._observer.__exit__()
