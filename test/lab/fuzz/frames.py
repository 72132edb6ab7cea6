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

"""Fuzz target: the frame decoders, half and full duplex, with BCC and with CRC."""

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import (
    Duplex,
    Frame,
    FrameDecoder,
    master_frame,
    MAX_LINK_DATA,
    message_frame,
    Symbol,
)

_KINDS = [(checksum, duplex) for checksum in Checksum for duplex in Duplex]


def one_input(data: bytes) -> None:
    """Check that any chunks give the same symbols, and that good frames encode back."""
    for checksum, duplex in _KINDS:
        whole = FrameDecoder(checksum, duplex)
        whole.feed(data)
        symbols = _drain(whole)
        bytewise = FrameDecoder(checksum, duplex)
        one_by_one: list[Symbol] = []
        for byte in data:
            bytewise.feed(bytes((byte,)))
            one_by_one += _drain(bytewise)
        assert symbols == one_by_one
        assert (whole.noise, whole.in_message, whole.begun, whole.last_byte) == (
            bytewise.noise, bytewise.in_message, bytewise.begun, bytewise.last_byte)
        for symbol in symbols:
            if isinstance(symbol, Frame):
                _check_frame(symbol, checksum, duplex)


def _drain(decoder: FrameDecoder) -> list[Symbol]:
    symbols = []
    while (symbol := decoder.next_symbol()) is not None:
        symbols.append(symbol)
    assert len(decoder.waiting) <= 2 and len(decoder.link_data) <= MAX_LINK_DATA + 1
    return symbols


def _check_frame(frame: Frame, checksum: Checksum, duplex: Duplex) -> None:
    assert len(frame.data) <= MAX_LINK_DATA + 1
    if frame.fault is not None:
        return
    if frame.station is None:
        line = message_frame(frame.data, checksum)
    else:
        assert duplex is Duplex.HALF
        line = master_frame(frame.station, frame.data, checksum)
    decoder = FrameDecoder(checksum, duplex)
    decoder.feed(line)
    assert _drain(decoder) == [frame._replace(has_response=False)]
