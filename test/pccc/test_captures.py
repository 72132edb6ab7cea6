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

"""What others and we have said to each other, said again: vectors/captures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from abdf1_ros.counters import Counters
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.families import served_counters
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.word_range import commands as word_range
import pytest
from support.captures import Capture, CAPTURES
from support.cases import for_all

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


def server_of(capture: Capture) -> Server:
    """Return a server that has the words of the capture's server."""
    return Server(
        capture.table(), EmulatedProcessor(is_full_duplex=True),
        served_counters(Counters(), capture.family, 'Peer'))


@pytest.mark.parametrize('capture', CAPTURES, ids=lambda capture: capture.name)
def test_our_server_answers_as_it_was_answered(capture: Capture) -> None:
    server = server_of(capture)
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


@pytest.mark.parametrize('capture', OURS, ids=lambda capture: capture.name)
def test_what_they_have_accepted_of_ours_is_what_we_would_send(capture: Capture) -> None:
    compared = 0
    for exchange in capture.exchanges():
        function, *parameters = exchange.command.data
        read = _READ.get((exchange.command.cmd, function))
        if read is not None and not exchange.reply.sts:
            encoded = read(Reader(bytes(parameters))).encode()
            assert encoded == exchange.command.data, exchange.text
            compared += 1
    assert compared


@for_all('capture', CAPTURES)
def test_every_command_has_words(capture: Capture) -> None:
    for exchange in capture.exchanges():
        assert 'unknown' not in describe(exchange.command), exchange.command
