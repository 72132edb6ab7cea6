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

from abdf1_ros.counters import Counters
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.link_counters import served_counters
from abdf1_ros.pccc.server import Server
import pytest
from support.captures import Capture, CAPTURES

_DIAGNOSTICS = 0x06  # what a processor says of itself depends on its state


def server_of(capture: Capture) -> Server:
    """Return a server that has the words of the capture's server."""
    return Server(
        capture.table(), EmulatedProcessor(capture.family, is_full_duplex=True),
        served_counters(Counters(), capture.family, is_full_duplex=True))


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


@pytest.mark.parametrize('capture', CAPTURES, ids=lambda capture: capture.name)
def test_every_command_has_words(capture: Capture) -> None:
    for exchange in capture.exchanges():
        assert 'unknown' not in describe(exchange.command), exchange.command
