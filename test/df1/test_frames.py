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

"""Headers, frames and checks: every vector both ways, and a decoder that takes any bytes."""

from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import (
    ACK,
    Code,
    Control,
    Damaged,
    Duplex,
    ENQ,
    EOT,
    Frame,
    FrameDecoder,
    FrameFault,
    master_frame,
    MAX_LINK_DATA,
    MAX_WAITING,
    message_frame,
    NAK,
    NOISE,
    Poll,
    poll_frame,
    Symbol,
    Unknown,
)
from abdf1_ros.df1.packet import begins_good_reply, Packet
from abdf1_ros.errors import FormatError
import pytest
from support.cases import for_all
from support.vectors import CAPTURED, Captured, MESSAGES, Vector, VECTORS

HALF, FULL, CRC, BCC = Duplex.HALF, Duplex.FULL, Checksum.CRC, Checksum.BCC
DATA = bytes.fromhex('01 00 0F 00 01 06 A2 02 07 89 00 00')


def drain(decoder: FrameDecoder) -> list[Symbol]:
    """Return all symbols that are ready."""
    return [*iter(decoder.next_symbol, None)]


def decode(data: bytes, checksum: Checksum = CRC, duplex: Duplex = HALF,
           chunk: int | None = None) -> list[Symbol]:
    """Return the symbols of ``data``, fed ``chunk`` bytes at a time."""
    decoder = FrameDecoder(checksum, duplex)
    symbols = []
    for at in range(0, len(data), chunk or len(data)):
        decoder.feed(data[at:at + (chunk or len(data))])
        symbols += drain(decoder)
    return symbols


def expected_symbols(entry: Vector) -> list[Symbol]:
    """Return what a vector says about its frame."""
    if entry.kind == 'symbol':
        return [Control(Code.EOT)]
    if entry.kind == 'poll':
        assert entry.station is not None
        return [Poll(entry.station, True)]
    received = int.from_bytes(entry.frame[-entry.checksum.size:], 'little')
    fault, expected = None, received
    if not entry.valid:
        assert entry.expected is not None
        fault, expected = FrameFault.BAD_CHECK, entry.expected
    elif len(entry.link_data) < 6:
        fault = FrameFault.TOO_SHORT
    frame = Frame(entry.link_data, entry.station, fault, received, expected,
                  entry.has_embedded_response)
    inside = {'embedded_ack': [Control(Code.ACK)], 'embedded_nak': [Control(Code.NAK)]}
    return [*inside.get(entry.name, []), frame]


@for_all('chunk', [None, 1, 3])
@for_all('entry', VECTORS)
def test_frame_of_a_vector_is_decoded_in_any_portions(entry: Vector, chunk: int | None) -> None:
    assert decode(entry.frame, entry.checksum, entry.duplex, chunk) == expected_symbols(entry)


@for_all('entry', [entry for entry in MESSAGES if entry.valid and not entry.has_embedded_response])
def test_message_of_a_vector_is_encoded_to_its_frame(entry: Vector) -> None:
    if entry.station is not None:
        frame = master_frame(entry.station, entry.link_data, entry.checksum)
    else:
        frame = message_frame(entry.link_data, entry.checksum)
    assert frame == entry.frame


@for_all('entry', CAPTURED)
def test_captured_frame_decodes_and_encodes(entry: Captured) -> None:
    (symbol,) = decode(entry.frame, entry.checksum, FULL, 1)
    if len(entry.frame) == 2:
        assert symbol == Control(Code(entry.frame[1]))
        return
    assert isinstance(symbol, Frame)
    assert symbol.fault is (FrameFault.TOO_SHORT if entry.checksum is BCC else None)
    assert message_frame(symbol.data, entry.checksum) == entry.frame


def test_master_frame_is_none_in_full_duplex() -> None:
    symbols = decode(master_frame(7, DATA, CRC), duplex=FULL)
    assert symbols[0] == Unknown(0x01)
    assert all(getattr(symbol, 'fault', 1) is not None for symbol in symbols)


@for_all('byte', [0x00, 0x03, 0x07, 0x7F, 0xFF])
def test_unknown_symbol_tells_its_byte(byte: int) -> None:
    assert decode(bytes((0x10, byte)), chunk=1) == [Unknown(byte)]


@for_all('noise', [b'\x55\xAA', b'\x10\x10', b'\x55\x10\x10'])
@for_all('chunk', [None, 1])
def test_noise_since_the_last_message_is_told_before_an_enq(noise: bytes,
                                                            chunk: int | None) -> None:
    ack, enq, frame = Control(Code.ACK), Control(Code.ENQ), message_frame(DATA, CRC)
    assert decode(ENQ + noise + ACK + ENQ + ENQ + noise + frame + ENQ, CRC, FULL, chunk) == [
        enq, ack, NOISE, enq, enq, *decode(frame), enq]
    assert decode(noise + poll_frame(7), CRC, HALF, chunk) == [Poll(7, True)]


def test_noise_between_symbols_is_skipped_and_its_last_byte_kept() -> None:
    decoder = FrameDecoder(CRC, HALF)
    decoder.feed(b'\x55\xAA' + ACK + b'\x10\x10\x01\x77')
    assert drain(decoder) == [Control(Code.ACK)]
    decoder.feed(b'')
    assert (decoder.last_byte, decoder.noise) == (0x77, 5)
    decoder.feed(ENQ + b'\x10')
    assert drain(decoder) == []
    before = decoder.noise
    decoder.feed(Damaged(b'\x66'))
    assert (decoder.last_byte, decoder.noise) == (0x66, before + 2)
    decoder.feed(b'\x9A' + poll_frame(7))  # the rest of the damaged poll begins nothing
    assert drain(decoder) == [Poll(7, True)]


@for_all('station', [0, 1, 0x0F, 0x10, 0x11, 0x20, 0xF0, 0xFE])
@for_all('chunk', [None, 1])
def test_poll_of_any_station(station: int, chunk: int | None) -> None:
    assert decode(poll_frame(station), chunk=chunk) == [Poll(station, True)]
    assert poll_frame(0xF0) == bytes.fromhex('10 05 F0 10')  # a BCC is not doubled


@pytest.mark.parametrize('chunk', [None, 1])
def test_poll_of_a_master_that_does_not_double_station_10(chunk: int | None) -> None:
    assert decode(b'\x10\x05\x10\xF0' + poll_frame(1), chunk=chunk) == [
        Poll(0x10, True), Poll(1, True)]


@for_all('start', [b'\x10\x05', b'\x10\x01', b'\x10\x01\x07', b'\x10\x01\x07\x55'])
def test_symbol_breaks_into_a_multidrop_header(start: bytes) -> None:
    assert decode(start + ACK, chunk=1) == [Control(Code.ACK)]


@for_all('size', [0, 1, 5])
@for_all('checksum', Checksum)
def test_message_shorter_than_a_header(size: int, checksum: Checksum) -> None:
    (frame,) = decode(message_frame(bytes(size), checksum), checksum)
    assert isinstance(frame, Frame)
    assert (frame.data, frame.fault) == (bytes(size), FrameFault.TOO_SHORT)


@pytest.mark.parametrize('fill', [0x10, 0x55])
def test_longest_message_is_decoded_whatever_its_bytes_are(fill: int) -> None:
    data = bytes((fill,)) * MAX_LINK_DATA
    (frame,) = decode(message_frame(data, CRC))
    assert isinstance(frame, Frame)
    assert (frame.data, frame.fault) == (data, None)


@for_all('fill', [0x10, 0x55])
@for_all('size', [262, 263, 1000])
@for_all('checksum', Checksum)
@for_all('chunk', [None, 1])
def test_message_longer_than_the_longest_is_one_up_to_its_end(
        fill: int, size: int, checksum: Checksum, chunk: int | None) -> None:
    good = message_frame(DATA, checksum)
    line = message_frame(bytes((fill,)) * size, checksum) + good
    assert decode(line, checksum, chunk=chunk) == [
        Frame(bytes((fill,)) * 262, None, FrameFault.TOO_LONG), *decode(good, checksum)]


@pytest.mark.parametrize('chunk', [None, 1, 100])
def test_message_without_end_is_told_with_what_breaks_it_off(chunk: int | None) -> None:
    assert decode(b'\x10\x02' + bytes(1000), chunk=chunk) == []
    assert decode(b'\x10\x02' + bytes(1000) + EOT, chunk=chunk) == [
        Frame(bytes(262), None, FrameFault.NO_ETX, Code.EOT), Control(Code.EOT)]


@pytest.mark.parametrize('response', [ACK, NAK])
def test_embedded_response_is_one_in_full_duplex_only(response: bytes) -> None:
    good = message_frame(DATA, CRC)
    mixed = good[:5] + response + good[5:]
    (frame,) = decode(good)
    assert isinstance(frame, Frame)
    assert decode(mixed + good, duplex=FULL) == [
        Control(Code(response[1])), frame._replace(has_response=True), frame]
    for duplex in (HALF, Duplex.RADIO):
        assert decode(mixed, duplex=duplex)[:2] == [
            Frame(DATA[:3], None, FrameFault.NO_ETX, response[1]), Control(Code(response[1]))]


def test_reset_forgets_a_message_that_has_begun() -> None:
    decoder = FrameDecoder(CRC, HALF)
    decoder.feed(message_frame(DATA, CRC)[:-4] + b'\x10')
    assert (drain(decoder), decoder.in_message) == ([], True)
    decoder.reset()
    assert (decoder.in_message, decoder.last_byte, decoder.noise) == (False, 0, 2)
    decoder.feed(b'\x06' + message_frame(DATA, CRC))
    assert drain(decoder) == decode(message_frame(DATA, CRC))


def test_in_message_from_stx_to_the_last_check_byte() -> None:
    decoder = FrameDecoder(CRC, HALF)
    frame = master_frame(3, DATA, CRC)
    states = []
    for byte in frame:
        decoder.feed(bytes((byte,)))
        symbols = drain(decoder)
        states.append(decoder.in_message)
    assert states == [False] * 4 + [True] * (len(frame) - 5) + [False]
    assert len(symbols) == 1


def test_bytes_that_nobody_reads_are_not_kept_without_end() -> None:
    decoder = FrameDecoder(CRC, Duplex.FULL)
    for symbol in 39 * [ENQ] + [ACK]:
        decoder.feed(symbol * 1000)
    assert len(decoder.waiting) == MAX_WAITING
    assert decoder.noise == 80_000 - MAX_WAITING
    assert drain(decoder) == [NOISE] + [Control(Code.ENQ)] * (MAX_WAITING // 2)
    decoder.feed(EOT)
    assert drain(decoder) == [Control(Code.EOT)]


# Characters that the UART has found damaged

# As in M 4-5: DLE STX, seven bytes, DLE ETX, and a check of one byte or two.
ECHO = bytes.fromhex('01 00 06 00 01 00 00')


@for_all(('checksum', 'at'), [(check, at) for check in Checksum for at in range(11 + check.size)])
def test_message_with_a_damaged_character_is_not_a_good_one(checksum: Checksum, at: int) -> None:
    decoder, message = FrameDecoder(checksum, FULL), message_frame(ECHO, checksum)
    decoder.feed(message)
    good = decoder.next_symbol()
    assert isinstance(good, Frame) and good.fault is None
    decoder.feed(message[:at])
    symbols = [decoder.next_symbol()]
    decoder.feed(Damaged(message[at:at + 1]))
    symbols.append(decoder.next_symbol())
    decoder.feed(message[at + 1:])
    symbols.append(decoder.next_symbol())
    # Without a byte 00 the BCC is right all the same.
    assert not [symbol for symbol in symbols if isinstance(symbol, Frame) and not symbol.fault]
    decoder.feed(message[:2])  # a message begins anew
    decoder.next_symbol()
    decoder.feed(message[2:])
    assert good in drain(decoder)


COMMAND = Packet(dst=17, src=5, cmd=0x2F, sts=0, tns=0x0102, data=b'\xA2')  # of priority


@for_all('vector', [entry for entry in MESSAGES if entry.header is not None])
def test_header_of_every_vector(vector: Vector) -> None:
    packet = vector.packet
    assert (packet.dst, packet.src, packet.cmd, packet.sts, packet.tns) == vector.header
    assert packet.data == vector.link_data[6:]
    assert packet.encode() == vector.link_data
    assert packet.is_reply is bool(vector.header is not None and vector.header[2] & 0x40)
    if vector.fnc is not None:
        assert packet.data[0] == vector.fnc


@for_all('size', range(6))
def test_less_than_a_header_is_a_format_error(size: int) -> None:
    with pytest.raises(FormatError, match=f'^{size} bytes'):
        Packet.decode(bytes(size))


def test_reply_swaps_the_addresses_and_copies_tns() -> None:
    assert COMMAND.reply(b'\x07', 0xF0) == Packet(5, 17, 0x6F, 0xF0, 0x0102, b'\x07')
    assert COMMAND.reply() == Packet(5, 17, 0x6F, 0, 0x0102)


@for_all(('change', 'answers'), [
    *((change, False) for change in (
        {'dst': 6}, {'src': 18}, {'tns': 0x0103}, {'tns': 0x0202}, {'cmd': 0x0F})),
    # The command code is left to the caller.
    ({'sts': 0x10, 'data': b'data'}, True), ({'cmd': 0x41}, True)])
def test_reply_answers_the_command_whose_ends_and_number_it_has(change: dict[str, Any],
                                                                answers: bool) -> None:
    assert COMMAND.reply()._replace(**change).answers(COMMAND) is answers


@for_all(('change', 'same'), [
    ({'src': 6}, False), ({'cmd': 0x0E}, False), ({'tns': 0x0103}, False),
    ({'tns': 0x0202}, False), ({'dst': 99, 'sts': 0x10, 'data': b'other'}, True)])
def test_duplicate_key_tells_messages_apart_by_src_cmd_and_tns(change: dict[str, Any],
                                                               same: bool) -> None:
    assert (COMMAND._replace(**change).duplicate_key == COMMAND.duplicate_key) is same


@for_all(('packet', 'size', 'begins'), [
    (COMMAND.reply(b'words'), 11, True), (COMMAND.reply(b'words'), 6, True),
    (COMMAND.reply(b'words'), 5, False), (COMMAND.reply(b'words'), 0, False),
    (COMMAND.reply(sts=0x10), 6, False), (COMMAND, 7, False)])
def test_header_of_a_good_reply_is_known_before_its_end(
        packet: Packet, size: int, begins: bool) -> None:
    assert begins_good_reply(packet.encode()[:size]) is begins


def test_command_whose_fields_have_moved_is_not_sound() -> None:
    for tns in range(1, 0x10000, 0x101):
        command = COMMAND._replace(dst=0, tns=tns)
        assert command.is_sound
        assert command.reply(sts=0xF0).is_sound
        assert not Packet.decode(command.encode()[1:]).is_sound  # its leading 00 is lost
        assert not Packet.decode(b'\0' + command.encode()).is_sound  # or has come twice
