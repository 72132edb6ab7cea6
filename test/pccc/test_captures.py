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

"""What real processors and other programs have said, and what we make of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Control, Duplex, Frame, FrameDecoder
from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc import families
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Mode
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import ADDRESSING, BY_CODE
from abdf1_ros.pccc.word_range import commands as word_range
import pytest
from support.captures import Capture, CAPTURES
from support.cases import for_all, long_unless
from support.vectors import commands, Exchange, exchanges, ML1400, PROCESSORS, Vector, without_area


def place_of(command: Packet) -> tuple[Address, int] | None:
    """Return what a typed logical read asks for, None where we do not know the type."""
    if (command.cmd, command.data[:1]) != (0x0F, b'\xA2'):
        return None
    request = slc.LogicalRead.read(Reader(command.data[1:]))
    at, code = request.address, request.address.type_code
    flat = slc.BY_FLAT_CODE.get(code)
    kind = flat or BY_CODE.get(code)
    if kind is None:
        return None
    start = Address(ADDRESSING, kind, at.file, at.element, is_flat=flat is not None)
    return start.at_offset(start.offset + (at.sub_element or 0)), request.size // 2


KNOWN = [(*place, exchange) for exchange in ML1400 if (place := place_of(exchange.command))]


def test_every_command_is_told_as_what_it_is() -> None:
    for processor in PROCESSORS:
        for exchange in exchanges(processor['name']) if 'exchanges' in processor else ():
            assert describe(exchange.command) == exchange.meaning
    assert len(ML1400) == 73


def test_kinds_of_files_that_were_read() -> None:
    assert {place.file_type.value for place, _, _ in KNOWN} == {
        'O', 'I', 'S', 'B', 'T', 'C', 'R', 'N', 'F', 'HSC', 'PTO', 'PWM', 'STI', 'EII'}


@for_all(('place', 'words', 'exchange'), KNOWN)
def test_our_read_is_the_command_that_was_accepted(place: Address, words: int,
                                                   exchange: Exchange) -> None:
    dialect = families.dialect_of(PlcType.SLC, None, Processor.ML1400)
    assert words <= dialect.max_read(place.file_type)
    cmd, data = dialect.read(place, words)
    asked, sent = (slc.LogicalRead.read(Reader(raw[1:])) for raw in (exchange.command.data, data))
    # Their programming software counts words after element 0, also past the first element.
    assert (cmd, asked.size, asked.address.file, asked.address.type_code) == (
        0x0F, sent.size, sent.address.file, sent.address.type_code)
    assert sent.address.element * place.layout.words + (sent.address.sub_element or 0) == \
        asked.address.element * place.layout.words + (asked.address.sub_element or 0)
    assert dialect.read_data(place, words, exchange.reply.data) == exchange.reply.data


def test_values_of_function_files() -> None:
    data = {place.file_type.value: exchange.reply.data for place, _, exchange in reversed(KNOWN)}
    for text, value in (('HSC:0.HIP', 0x7FFFFFFF), ('HSC:0.LOP', -0x80000000),
                        ('HSC:0.ACC', 0), ('EII:5.IS', 5), ('STI:0.SPM', 0), ('PWM:0.OUT', -1)):
        place = families.parse_address(text, PlcType.SLC)
        at = 2 * place.offset
        found = data[place.file_type.value][at:at + 2 * place.layout.value_words(place.word)]
        assert int.from_bytes(found, 'little', signed=True) == value, text


@pytest.mark.parametrize(('mode', 'known', 'remarks'), [
    (0x26, Mode.REMOTE_RUN, ()), (0x21, Mode.REMOTE_PROGRAM, ()),
    (0x66, Mode.REMOTE_RUN, ('forces installed',))])
def test_identity_of_a_micrologix_1400(mode: int, known: Mode, remarks: tuple[str, ...]) -> None:
    reply = next(exchange.reply for exchange in ML1400
                 if exchange.command.cmd == 6 and exchange.reply.data[18] == mode)
    identity = families.decode_identity(reply.data)
    assert (identity.model, identity.processor) == ('MicroLogix 1400', Processor.ML1400)
    assert (identity.series, identity.revision, identity.name) == ('B', '4', '1766-LEC')
    assert (identity.mode, identity.faults, identity.remarks) == (known, (), remarks)
    assert len(reply.data) == 25


def simulated(setting: Setting) -> bytes:
    """Return the reply of a simulated MicroLogix 1400 to 06/03."""
    return families.FAMILIES[PlcType.SLC].encode_identity(EmulatedProcessor(
        setting, is_full_duplex=True, processor=Processor.ML1400))


@pytest.mark.parametrize(('setting', 'mode'), [(Setting.REMOTE, 0x26), (Setting.PROGRAM, 0x21)])
def test_simulated_identity_has_the_bytes_of_the_real_one(setting: Setting, mode: int) -> None:
    real = next(exchange.reply.data for exchange in ML1400
                if exchange.command.cmd == 6 and exchange.reply.data[18] == mode)
    # Its own are port, release, program, memory, and the byte that no manual knows.
    own = {2, 4, 20, 21, 22}
    ours = simulated(setting)
    assert [(at, ours[at]) for at in range(24) if at not in own] == [
        (at, real[at]) for at in range(24) if at not in own]


def test_simulated_data_files_answer_the_same() -> None:
    table = DataTable(PlcType.SLC)
    data_files = [entry for entry in KNOWN if not entry[0].file_type.is_function]
    for place, words, exchange in data_files:
        start = place if not place.is_flat else families.parse_address(
            f'{place.file_type.value}:0.0', PlcType.SLC)
        table.create(start, words)
        table.write(start, exchange.reply.data)
    server = Server(table, EmulatedProcessor(processor=Processor.ML1400))
    for _, _, exchange in data_files:
        assert server.serve(exchange.command) == exchange.reply, exchange.meaning


def test_masked_write_of_two_words_has_one_mask_and_spares_the_other_bits() -> None:
    # Recorded on the words of forced inputs, which nobody else has; the same in an N file here.
    masked = [exchange.command.data for exchange in ML1400 if exchange.command.data[:1] == b'\xAB']
    assert len(masked) == 4
    table = DataTable(PlcType.SLC)
    start = families.parse_address('N7:0', PlcType.SLC)
    table.create(start, 2)
    table.write(start, b'\0\0\xFF\xFF')
    server, words = Server(table), []
    for data in masked:
        command = Packet(1, 0, 0x0F, 0, 7, data[:2] + b'\x07\x89' + data[4:])
        assert server.serve(command) == command.reply()
        words.append(table.read(start, 2).hex(' ').upper())
    # As the polls after each write show: OR word 0020, 0021, 0001, and the AND word unchanged.
    assert words == ['20 00 FF FF', '21 00 FF FF', '01 00 FF FF', '00 00 FF FF']


def test_frames_of_a_serial_line_are_an_ack_and_a_good_message() -> None:
    frames = [frame for processor in PROCESSORS for frame in processor.get('frames', ())]
    assert len(frames) == 4
    for frame in frames:
        decoder = FrameDecoder(Checksum.CRC, Duplex.FULL)
        decoder.feed(bytes.fromhex(frame['bytes']))
        assert decoder.next_symbol() is Control.ACK
        message = decoder.next_symbol()
        assert isinstance(message, Frame)
        assert message.fault is None
    identity = families.decode_identity(bytes.fromhex(frames[2]['bytes'])[10:-4])
    assert (identity.model, identity.mode, identity.remarks) == (
        'MicroLogix 1100', Mode.REMOTE_RUN, ())


OURS = [capture for capture in CAPTURES if capture.client == 'ours: node, Mode Peer']
_READ: dict[tuple[int, int], Callable[[Reader], Any]] = {
    (plc5.CMD, plc5.TYPED_READ): plc5.TypedRead.read,
    (plc5.CMD, plc5.TYPED_WRITE): plc5.TypedWrite.read,
    (plc5.CMD, plc5.READ_MODIFY_WRITE): plc5.ReadModifyWrite.read,
    (word_range.CMD, word_range.READ):
        lambda reader: word_range.WordRangeRead.read(reader, plc5.SystemAddress.read),
    (word_range.CMD, word_range.WRITE):
        lambda reader: word_range.WordRangeWrite.read(reader, plc5.SystemAddress.read),
    (slc.CMD, slc.LOGICAL_READ): slc.LogicalRead.read,
    (slc.CMD, slc.LOGICAL_WRITE): slc.LogicalWrite.read,
    (slc.CMD, slc.MASKED_WRITE): slc.MaskedWrite.read}
_DIAGNOSTICS = 0x06  # what a processor says of itself depends on its state


@pytest.mark.parametrize('capture', long_unless(
    lambda capture: CAPTURES.index(capture) % 2, zip(CAPTURES)), ids=lambda case: case.name)
def test_our_server_answers_as_it_was_answered(capture: Capture) -> None:
    server = Server(capture.table(), EmulatedProcessor(is_full_duplex=True),
                    families.served_counters(Counters(), capture.family, 'Peer'))
    compared = 0
    for exchange in capture.exchanges():
        reply = server.serve(exchange.command)
        if exchange.command.cmd == _DIAGNOSTICS:
            continue
        if exchange.reply.sts:  # our codes have become better than those on record
            assert reply.sts or capture.replies == 'form', exchange.text
        elif capture.replies == 'bytes':
            assert reply == exchange.reply, exchange.text
        else:
            told, ours = (describe(one, exchange.command) for one in (exchange.reply, reply))
            assert len(told.split()) == len(ours.split()), f'{exchange.text}: {told}'
        compared += 1
    assert compared


@for_all('capture', OURS)
def test_what_they_have_accepted_of_ours_is_what_we_would_send(capture: Capture) -> None:
    compared = 0
    for exchange in capture.exchanges():
        function, *parameters = exchange.command.data
        read = _READ.get((exchange.command.cmd, function))
        if read is not None and not exchange.reply.sts:
            assert read(Reader(bytes(parameters))).encode() == exchange.command.data, exchange.text
            compared += 1
    assert compared


# Logical ASCII and the memory area are read, and written as logical binary without it.
@for_all('entry', commands(*(fnc for _, fnc in _READ if fnc > word_range.FILE_READ)))
def test_command_of_every_vector_is_read_and_made_again(entry: Vector) -> None:
    data = entry.packet.data
    command = _READ[entry.packet.cmd, data[0]](Reader(data[1:]))
    again = command.encode()
    assert _READ[entry.packet.cmd, data[0]](Reader(again[1:])) == command
    assert again == without_area(data) or b'\0$' in data
