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

"""Messages in portions: what may stand beside an embedded response (M 4-3)."""

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Control, Duplex, Frame, FrameDecoder, message_frame, NAK
from abdf1_ros.df1.outgoing import Outgoing
from hypothesis import given
from hypothesis import strategies as st
import pytest

CHAR_TIME = 10 / 9600


def portions(frame: bytes, checksum: Checksum, response: bytes, at: int) -> list[bytes]:
    """Return what goes out of a message, with a response as soon as it may after ``at``."""
    outgoing = Outgoing(checksum, CHAR_TIME)
    said, now = [outgoing.put(frame, 0.0)], 0.0
    is_embedded = False
    while True:
        if len(said) > at and not is_embedded and outgoing.can_embed:
            said.append(response)
            is_embedded = True
        if outgoing.due is None:
            break
        assert outgoing.due >= now
        now = outgoing.due
        said.append(outgoing.next(now))
    assert outgoing.size == 0
    return said if is_embedded else [*said, response]


@given(st.lists(st.sampled_from((0x00, 0x03, 0x10, 0x55)), min_size=6, max_size=261),
       st.sampled_from(Checksum), st.sampled_from((ACK, NAK)), st.integers(0, 8))
def test_message_and_response_both_arrive(data: list[int], checksum: Checksum, response: bytes,
                                          at: int) -> None:
    decoder = FrameDecoder(checksum, Duplex.FULL)
    symbols = []
    for part in portions(message_frame(bytes(data), checksum), checksum, response, at):
        decoder.feed(part)
        while (symbol := decoder.next_symbol()) is not None:
            symbols.append(symbol)
    assert Frame in map(type, symbols)
    frame, = (symbol for symbol in symbols if isinstance(symbol, Frame))
    assert (frame.data, frame.fault) == (bytes(data), None)
    assert [symbol for symbol in symbols if isinstance(symbol, Control)] == [
        Control(response[1])]  # type: ignore[arg-type]
    assert decoder.noise == 0


@pytest.mark.parametrize('checksum', Checksum)
def test_line_never_waits_for_the_next_portion_nor_runs_far_ahead(checksum: Checksum) -> None:
    frame = message_frame(bytes(range(250)), checksum)
    outgoing = Outgoing(checksum, CHAR_TIME)
    busy_until = 5.0 + len(outgoing.put(frame, 5.0)) * CHAR_TIME
    while outgoing.due is not None:
        now = outgoing.due
        assert 0.01 < busy_until - now < 0.02
        busy_until += len(outgoing.next(now)) * CHAR_TIME
        assert busy_until - now < 0.06
    assert busy_until == pytest.approx(5.0 + len(frame) * CHAR_TIME)


def test_last_data_and_etx_with_its_check_are_not_divided() -> None:
    for size in range(6, 120):
        frame = message_frame(b'\x10' * size, Checksum.CRC)
        outgoing = Outgoing(Checksum.CRC, CHAR_TIME)
        last = outgoing.put(frame, 0.0)
        while outgoing.due is not None:
            last = outgoing.next(outgoing.due)
        assert last.endswith(frame[-6:])


@pytest.mark.parametrize('char_time', [0.0, 10 / 115200])
def test_message_that_is_gone_in_a_moment_goes_out_whole(char_time: float) -> None:
    frame = message_frame(bytes(200), Checksum.CRC)
    outgoing = Outgoing(Checksum.CRC, char_time)
    assert outgoing.put(frame, 0.0) == frame
    assert (outgoing.due, outgoing.can_embed) == (None, False)
