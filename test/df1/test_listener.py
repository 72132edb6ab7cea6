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

"""The decoder that finds out what is spoken on a line."""

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Code, Control, Duplex, Frame, FrameFault, Poll, Symbol
from abdf1_ros.df1.listener import LineKind, ListeningDecoder
from abdf1_ros.df1.packet import Packet
import pytest
from support.cases import for_all
from support.vectors import MESSAGES, Vector

COMMAND = Packet(1, 5, 0x0F, 0, 0x1234, b'\xa2\x02\x07\x89\x00\x00').encode()


def symbols(decoder: ListeningDecoder, data: bytes) -> list[Symbol]:
    """Return what the decoder makes of ``data``."""
    decoder.feed(data)
    return list(iter(decoder.next_symbol, None))


def frame(checksum: Checksum, tns: int = 0) -> bytes:
    return frames.message_frame(Packet(1, 5, 0x0F, 0, tns, b'\x01').encode(), checksum)


@for_all('vector', [
    vector for vector in MESSAGES if vector.valid and not vector.has_embedded_response])
def test_every_vector_is_read_without_being_told_its_check(vector: Vector) -> None:
    decoder = ListeningDecoder(LineKind())
    found = [*symbols(decoder, vector.frame), decoder.finish()]
    good = [symbol for symbol in found if isinstance(symbol, Frame)]
    assert [(symbol.data, symbol.station) for symbol in good] == [
        (vector.link_data, vector.station)]
    assert good[0].fault in (None, FrameFault.TOO_SHORT)
    assert decoder.checksum is vector.checksum


def test_one_good_crc_settles_the_check() -> None:
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    assert len(symbols(decoder, frame(Checksum.CRC))) == 1
    assert kind.checksum is Checksum.CRC
    damaged = bytearray(frame(Checksum.CRC))
    damaged[4] ^= 1
    (symbol,) = symbols(decoder, bytes(damaged))
    assert isinstance(symbol, Frame)
    assert symbol.fault is FrameFault.BAD_CHECK


def test_two_good_bccs_settle_the_check() -> None:
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    one, two, three = (frame(Checksum.BCC, tns) for tns in range(3))
    assert symbols(decoder, one) == []  # may become a CRC yet
    assert len(symbols(decoder, two)) == 1
    assert kind.checksum is None
    assert len(symbols(decoder, three)) == 2  # it settles it, and waits for nothing any more
    assert kind.checksum is Checksum.BCC
    assert decoder.finish() is None


def test_what_one_direction_has_found_holds_for_the_other() -> None:
    kind = LineKind()
    one, other = ListeningDecoder(kind), ListeningDecoder(kind)
    symbols(one, frame(Checksum.BCC, 1) + frame(Checksum.BCC, 2) + frames.ACK)
    assert kind.checksum is Checksum.BCC
    assert len(symbols(other, frame(Checksum.BCC, 3))) == 1


@pytest.mark.parametrize('data', [
    frames.poll_frame(3), frames.EOT, frames.master_frame(1, COMMAND, Checksum.CRC)])
def test_half_duplex_is_found(data: bytes) -> None:
    kind = LineKind()
    assert len(symbols(ListeningDecoder(kind), data)) == 1
    assert kind.duplex is Duplex.HALF


def test_poll_with_a_wrong_bcc_says_nothing_of_the_line() -> None:
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    poll = frames.poll_frame(3)
    assert symbols(decoder, poll[:-1] + bytes((poll[-1] ^ 1,))) == [Poll(3, False)]
    assert kind.duplex is None
    assert symbols(decoder, poll) == [Poll(3, True)]
    assert kind.duplex is Duplex.HALF


def test_full_duplex_is_found_by_a_message_that_nobody_has_polled_for() -> None:
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    symbols(decoder, frame(Checksum.CRC))
    assert kind.duplex is Duplex.FULL
    assert symbols(decoder, frames.ENQ + frames.NAK) == [Control(Code.ENQ), Control(Code.NAK)]
    whole = frame(Checksum.CRC)
    assert symbols(decoder, whole[:6] + frames.ACK + whole[6:])[0] == Control(Code.ACK)


def test_recording_that_begins_in_the_middle_is_half_duplex_after_all() -> None:
    kind = LineKind()
    decoder = ListeningDecoder(kind)
    symbols(decoder, frame(Checksum.CRC))
    command, poll = symbols(
        decoder, frames.master_frame(1, COMMAND, Checksum.CRC) + frames.poll_frame(1))
    assert kind.duplex is Duplex.HALF
    assert isinstance(command, Frame)
    assert (command.station, command.fault) == (1, None)
    assert poll == Poll(1, True)


@for_all('size', [1, 1000])
@for_all(('wrong', 'right', 'damaged'), [
    (Checksum.CRC, Checksum.BCC, 2), (Checksum.BCC, Checksum.CRC, 0)])
def test_a_guess_that_frames_contradict_is_changed(
        wrong: Checksum, right: Checksum, damaged: int, size: int) -> None:
    """Three right BCCs can be no chance, nor can one right CRC."""
    kind = LineKind(wrong)
    decoder = ListeningDecoder(kind)
    said = b''.join(frames.ACK + frame(right, tns) for tns in range(4))
    found = [symbol for at in range(0, len(said), size)
             for symbol in symbols(decoder, said[at:at + size]) if isinstance(symbol, Frame)]
    assert kind.checksum is right
    assert [symbol.fault for symbol in found] == (
        [FrameFault.BAD_CHECK] * damaged + [None] * (4 - damaged))


def test_a_check_that_is_certain_stays() -> None:
    kind = LineKind(Checksum.CRC, is_certain=True)
    decoder = ListeningDecoder(kind)
    symbols(decoder, b''.join(frames.ACK + frame(Checksum.BCC, tns) for tns in range(9)))
    assert kind.checksum is Checksum.CRC


def test_damaged_frames_change_no_guess() -> None:
    kind = LineKind(Checksum.CRC)
    decoder = ListeningDecoder(kind)
    for tns in range(300):
        damaged = bytearray(frame(Checksum.CRC, tns % 200))
        damaged[6] ^= 1 + tns % 2
        symbols(decoder, bytes(damaged))
    assert kind.checksum is Checksum.CRC
    for _ in range(3):  # twice in a row may be chance, however often
        symbols(decoder, frame(Checksum.CRC) + 2 * (frame(Checksum.BCC) + frames.ACK))
        assert kind.checksum is Checksum.CRC


def test_a_response_inside_a_message_is_kept_apart_from_it() -> None:
    decoder = ListeningDecoder(LineKind(Checksum.CRC, Duplex.FULL))
    message = frames.message_frame(COMMAND, Checksum.CRC)
    decoder.feed(b'\x55' + message[:7] + frames.ACK + message[7:])
    kept = []
    while decoder.next_symbol() is not None:
        kept.append(decoder.wire)
    assert kept == [frames.ACK, message]
