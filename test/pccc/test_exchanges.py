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
Every command of every family, at both ends: the bytes of vectors/exchanges.json.

They begin at DST; frames around such bytes are those of vectors/frames.json.
"""

from dataclasses import dataclass
import traceback
from typing import Any

from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet, PRIORITY_BIT
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_address, served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Refusal, Server
from abdf1_ros.pccc.status import check_status
import pytest
from support.cases import for_all
from support.tables import counting, table
from support.vectors import load_json, pair

_WITH_FUNCTION = (0x06, 0x0F)


@dataclass(frozen=True, slots=True)
class Call:
    """What makes our end send the command: a method of a dialect and its arguments."""

    plc_type: PlcType
    access: Access
    method: str
    address: Address
    arguments: tuple[Any, ...]

    def request(self) -> Request:
        """Return what the dialect makes of it."""
        method = getattr(dialect_of(self.plc_type, self.access), self.method)
        request: Request = method(self.address, *self.arguments)
        return request


@dataclass(frozen=True, slots=True)
class Exchange:
    """A command to a PLC of ``family`` and its reply; ``before``, ``after``: words of files."""

    name: str
    family: PlcType
    meaning: str
    command: Packet
    reply: Packet
    before: dict[str, str]
    after: dict[str, str]
    call: Call | None

    @property
    def code(self) -> tuple[int, int | None]:
        """Return CMD, and FNC where there is one."""
        cmd = self.command.cmd & ~PRIORITY_BIT
        return cmd, self.command.data[0] if cmd in _WITH_FUNCTION else None


def _packet(text: str) -> Packet:
    return Packet.decode(bytes.fromhex(text))


def _call(plc_type: str, access: str, method: str, arguments: list[Any]) -> Call:
    family, way = PlcType(plc_type), Access(access)
    address = parse_address(arguments[0], family, way)
    rest = tuple(bytes.fromhex(value) if isinstance(value, str) else value
                 for value in arguments[1:])
    return Call(family, way, method, address, rest)


EXCHANGES = tuple(
    Exchange(
        entry['name'], PlcType(entry['family']), entry['meaning'], _packet(entry['command']),
        _packet(entry['reply']), entry['before'], entry.get('after', entry['before']),
        _call(**entry['client']) if 'client' in entry else None)
    for entry in load_json('exchanges.json')['exchanges'])
CALLS = tuple(entry for entry in EXCHANGES if entry.call)


def plc(family: PlcType, files: dict[str, str]) -> tuple[DataTable, Server]:
    """Return a PLC with these words in its files, and with counters that are all 0."""
    words = table(family, **files)
    return words, Server(words, counters=served_counters(Counters(), family, 'Slave'))


@for_all('entry', CALLS)
def test_our_end_sends_the_command(entry: Exchange) -> None:
    assert entry.call
    assert entry.call.request() == (entry.command.cmd, entry.command.data)


@for_all('entry', [entry for entry in CALLS if entry.call and entry.call.method == 'read'])
def test_our_end_takes_the_words_off_the_reply_and_nothing_else(entry: Exchange) -> None:
    assert entry.call
    dialect, (words,) = dialect_of(entry.call.plc_type, entry.call.access), entry.call.arguments
    address, data = entry.call.address, check_status(entry.reply)
    assert len(data) == dialect.reply_size(address, words)
    assert dialect.read_data(address, words, data).hex(' ').upper() in entry.before.values()
    for wrong in (data[:-1], data[:-2], data + b'\1', data + b'\1\0'):
        with pytest.raises(FormatError):
            dialect.read_data(address, words, wrong)


@for_all('entry', EXCHANGES)
def test_the_command_is_understood(entry: Exchange) -> None:
    assert describe(entry.command) == entry.meaning


@for_all('entry', EXCHANGES)
def test_the_other_end_executes_the_command_and_replies(entry: Exchange) -> None:
    words, server = plc(entry.family, entry.before)
    assert server.serve(entry.command) == entry.reply
    for place, text in entry.after.items():
        address = parse_address(place, entry.family)
        assert words.read(address, len(bytes.fromhex(text)) // 2) == bytes.fromhex(text)


@for_all('family', FAMILIES)
def test_no_command_that_a_family_serves_is_left_out(family: PlcType) -> None:
    _, server = plc(family, {})
    served = {(cmd, None) for cmd in server.family.basic_commands} | set(server.commands)
    assert {entry.code for entry in EXCHANGES if entry.family == family} == served


def test_no_request_that_a_dialect_makes_is_left_out() -> None:
    ways = [(family, access) for family in FAMILIES for access in FAMILIES[family].accesses]
    methods = {(*way, method) for way in ways for method in ('read', 'write', 'write_bits')
               if method != 'write_bits' or dialect_of(*way).writes_bits}
    assert {(entry.call.plc_type, entry.call.access, entry.call.method)
            for entry in CALLS if entry.call} == methods


@pytest.mark.parametrize('bit', [0x10, 0x40, 0x80])
def test_other_bits_of_cmd_make_another_command(bit: int) -> None:
    entry = next(entry for entry in EXCHANGES if entry.name == 'slc_read')
    _, server = plc(entry.family, entry.before)
    command = entry.command._replace(cmd=entry.command.cmd | bit)
    assert server.serve(command) == command.reply(sts=0x10)


def test_every_family_refuses_once() -> None:
    assert {entry.family for entry in EXCHANGES if entry.reply.sts} == set(FAMILIES)


PLC5, SLC = PlcType.PLC5, PlcType.SLC
TEN = '64 00 FF FF 00 00 FF 7F 00 80 10 00 10 10 05 00 06 00 07 00'
HELLO = '05 00 45 48 4C 4C 00 4F' + ' 00' * 76


@for_all(('name', 'words'), [
    ('plc5_typed_read_N7_0x10', table(PLC5, N7_0=TEN)),
    ('plc5_typed_read_N7_30_1_short', table(PLC5, N7_30='D2 04')),
    ('plc5_typed_read_F8', table(PLC5, F8_0='00 00 7A 44 00 00 C0 BF')),
    ('plc5_typed_read_ascii', table(PLC5, N10_360='FE FF')),
    ('plc5_typed_read_multi_1', table(PLC5, N7_0=counting(150))),
    ('plc5_typed_read_multi_2', table(PLC5, N7_0=counting(150))),
    ('plc5_typed_write_badtype', table(PLC5, F8_0='00 00 00 00' * 6)),
    ('plc5_rmw', table(PLC5, B3_4='FF 00')), ('slc_A2_N7_0', table(SLC, N7_0=TEN)),
    ('slc_A2_T4_0_whole', table(SLC, T4_0='00 E0 64 00 2A 00')),
    ('slc_A2_F8', table(SLC, F8_0='00 00 7A 44')), ('slc_A2_ST9', table(SLC, ST9_0=HELLO)),
    ('slc_A2_O0_slot', table(SLC, O_2_0='03 00')), ('slc_A2_I1_slot', table(SLC, I_1_0='10 00')),
    ('slc_A2_max_5_03', table(SLC, N7_0='00' * 236)),
    ('slc_AA_F8', table(SLC, F8_1='00 00 00 00')),
    ('slc_AA_T4_PRE', table(SLC, T4_0='00 00 00 00 00 00')), ('slc_AB', table(SLC, B3_4='08 00')),
    ('slc_err_address', table(SLC, N7_0='00 00')),
])
def test_reply_of_the_vectors(name: str, words: DataTable) -> None:
    command, reply = pair(name)
    assert Server(words).serve(command) == reply


def contents(words: DataTable) -> list[bytes]:
    """Return all words of a table."""
    return [bytes(words.words[area]) for area in words]


@for_all('family', FAMILIES)
@for_all('sts', [0x01, 0x10, 0xF0])
def test_command_with_a_status_is_not_executed(family: PlcType, sts: int) -> None:
    words = table(family, **FILES[family])
    before = contents(words)
    for cmd, data in ((0x00, '00 00 11 11'), (0x08, '00 00 11 11'), (0x05, '00 00 FF 00'),
                      (0x0F, 'AA 02 07 89 00 00 11 11')):
        command = Packet(1, 5, cmd, sts, 7, bytes.fromhex(data))
        assert Server(words).serve(command) == command.reply(sts=0x10)
    assert contents(words) == before


@for_all('family', FAMILIES)
@for_all('tns', [0x0000, 0x0100, 0x1234])
def test_command_that_lost_its_leading_00_changes_nothing(family: PlcType, tns: int) -> None:
    """Station 0 is asked; what stands where SRC should is CMD, and the command becomes 00."""
    words = table(family, **FILES[family])
    before = contents(words)
    dialect = dialect_of(family)
    for text in ['010'] if family == PlcType.PLC2 else ['N7:1', 'N7:0']:
        place = parse_address(text, family)
        for cmd, body in (dialect.read(place, 2), dialect.write(place, b'\1\2\3\4'),
                          dialect.write_bits(place, 0xFFFF, 0x0F0F)):
            moved = Packet.decode(Packet(0, 5, cmd, 0, tns, body).encode()[1:])
            assert Server(words).serve(moved).sts
    assert contents(words) == before


FOUR = '00 00' * 4
FILES = {
    PlcType.PLC2: {'000': FOUR},
    PlcType.PLC3: {'N7_0': FOUR, 'T_0_CTL': '00 00' * 6, 'I5_0': FOUR, 'B10_0': FOUR},
    PLC5: {'N7_0': FOUR, 'T4_0': '00 00' * 6, 'F8_0': FOUR, 'ST9_0': '00 00' * 42,
           'I_0': '00 00', 'O_1': '00 00', 'N5_0': FOUR},
    SLC: {'N7_0': FOUR, 'T4_0': '00 00' * 6, 'F8_0': FOUR, 'N9_0': FOUR, 'ST10_0': '00 00' * 42,
          'I_0': '00 00', 'O_1': '00 00'}}


@for_all(('family', 'data'), [
    (PLC5, '68 00 00 01 00 07 00 09 00 01 00'), (PLC5, '68 00 00 01 00 07 00 07 04 01 00'),
    (SLC, 'A2 02 09 89 00 00'), (SLC, 'A2 02 07 85 00 00'), (SLC, 'A2 02 07 89 04 00')])
def test_refusals_leave_nothing_behind(family: PlcType, data: str) -> None:
    depths = []

    class Spied(Server):

        def _execute(self, command: Packet) -> bytes:
            try:
                return super()._execute(command)
            except Refusal as refusal:
                depths.append(len(list(traceback.walk_tb(refusal.__traceback__))))
                raise

    server = Spied(table(family, N7_0='00 00'))
    for _ in range(10):
        server.serve(Packet(1, 5, 0x0F, 0, 7, bytes.fromhex(data)))
    assert depths == [depths[0]] * 10
