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
from typing import Any

from abdf1_ros.counters import Counters
from abdf1_ros.df1.packet import Packet, PRIORITY_BIT
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.dialect import Request
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_address, served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.status import check_status
import pytest
from support.cases import for_all
from support.vectors import load_json

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
    """
    A command to a PLC of ``family`` and its reply.

    ``before`` and ``after`` are words of its files by address.
    """

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
    words = DataTable(family)
    for place, text in files.items():
        address, data = parse_address(place, family), bytes.fromhex(text)
        words.create(address, len(data) // 2)
        words.write(address, data)
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


@for_all('entry', [entry for entry in EXCHANGES if entry.reply.sts])
def test_our_end_takes_a_refusal_for_one(entry: Exchange) -> None:
    with pytest.raises(RemoteError) as raised:
        check_status(entry.reply)
    assert raised.value.sts == entry.reply.sts
    assert raised.value.ext_sts == (entry.reply.data[0] if entry.reply.data else None)


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
