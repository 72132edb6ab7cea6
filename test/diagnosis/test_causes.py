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

"""The table of causes, and what the bytes of a line show."""

from collections.abc import Iterable
from dataclasses import replace
from string import Formatter

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.master import MASTER
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.slave_link import SLAVE
from abdf1_ros.diagnosis.causes import Decider, diagnose, Rule, RULES
from abdf1_ros.diagnosis.traces import has_modbus, Traces, traces_of, without_echo
from abdf1_ros.sniffer.capture import Chunk, Direction
import pytest
from support.cases import for_all
from support.odd_device import ACK, ENQ, EOT, frame, NAK


@for_all('rule', RULES)
def test_first_rule_that_holds_for_its_example(rule: Rule) -> None:
    found = diagnose(rule.example)
    assert found.rule is rule
    assert '{' not in str(found) and not found.cause.endswith('.')
    assert RULES[found.rank] is rule


def test_texts_use_traces_only_and_each_question_is_asked() -> None:
    names = {name for rule in RULES for text in (rule.cause, rule.step)
             for _, name, _, _ in Formatter().parse(text) if name}
    assert all(name.startswith('t.') for name in names)
    assert {rule.asks for rule in RULES} == {None, *Decider}


def seen(*parts: tuple[str, bytes], mode: LineMode = MASTER, check: Checksum = Checksum.CRC,
         station: int = 1, gateway: int | None = None, echoes: bool = False,
         step: float = 0.01) -> Traces:
    """Return the traces of bytes that go out (">") and come in ("<"), ``step`` s apart."""
    chunks = [Chunk(number * step, Direction(way), data)
              for number, (way, data) in enumerate(parts)]
    return traces_of(chunks, Traces(mode, check, 5, station, gateway), 1.0, echoes=echoes)


def poll(station: int) -> bytes:
    return ENQ + bytes((station, -station & 0xFF))


COMMAND = bytes.fromhex('01 05 06 00 21 00 00')  # an echo, from 5 to 1
REPLY = bytes.fromhex('05 01 46 00 21 00')


def names(traces: Traces, *fields: str) -> tuple[object, ...]:
    return tuple(getattr(traces, field) for field in fields)


def test_answers_are_counted_by_what_they_answer() -> None:
    half = seen(('>', poll(1)), ('<', EOT), ('>', frame(COMMAND, 1)), ('<', ACK), ('>', poll(1)),
                ('<', frame(REPLY)), ('>', ACK), ('>', poll(1)), ('<', NAK))
    assert names(half, 'polls', 'polls_answered', 'acks', 'naks_to_polls', 'replies') == (
        3, 2, 1, 1, 1)
    full = seen(('>', frame(COMMAND)), ('<', NAK), ('>', ENQ), ('<', NAK), ('>', ENQ), ('<', ACK),
                mode=PEER)
    assert names(full, 'naks', 'enquiries', 'acks', 'characters', 'first') == (
        1, 2, 0, 6, NAK + NAK + ACK)


def test_answers_of_another_station_are_not_those_of_the_station() -> None:
    line = ('>', poll(2)), ('<', EOT), ('>', frame(COMMAND, 2)), ('<', ACK), ('>', poll(1))
    assert names(seen(*line), 'polls', 'polls_answered', 'acks') == (1, 0, 0)
    assert names(seen(*line, station=7, gateway=2), 'polls', 'polls_answered', 'acks') == (1, 1, 1)


def test_polls_and_messages_of_another_master_are_known_by_their_direction() -> None:
    polls = ('>', poll(1)), ('<', EOT), ('<', poll(2)), ('<', frame(COMMAND, 1))
    assert names(seen(*polls), 'masters', 'foreign_polls', 'polls_answered') == ((1, 2), 2, 1)
    assert seen(*polls[:3]).masters == ()  # noise may look like a single one
    unasked = seen(('>', frame(COMMAND, 2)), ('<', poll(2)), ('<', EOT), station=2)
    assert unasked.masters == (2,)  # we have sent no poll, so a slow master may have sent one
    assert diagnose(unasked).cause.startswith('another master polls station 2 of this line')
    assert seen(('<', poll(5)), mode=SLAVE).polled and not seen(('<', poll(3)), mode=SLAVE).polled


@for_all('mode', [MASTER, PEER])
def test_late_reply_is_told_with_its_time(mode: LineMode) -> None:
    sent = frame(COMMAND, 1 if mode is MASTER else None)
    late = seen(('>', sent), ('<', ACK), *[('>', poll(1)), ('<', EOT)] * (mode is MASTER),
                ('<', frame(REPLY)), mode=mode, step=0.7)
    assert late.replies == 0 and late.late == pytest.approx(2.8 if mode is MASTER else 1.4)


def test_replies_that_are_not_for_us_are_foreign() -> None:
    for_0 = bytes.fromhex('00 01 4F 00 77 33 01 00')
    assert seen(('<', ACK), ('<', frame(for_0)), mode=PEER).foreign == 0
    assert seen(('>', frame(COMMAND)), ('<', ACK), ('<', frame(REPLY)), mode=PEER).foreign is None


def test_replies_from_another_number_or_to_other_commands_are_told_as_such() -> None:
    half = ('>', frame(COMMAND, 1)), ('<', ACK), ('>', poll(1))
    of_3 = bytes.fromhex('05 03 46 00 21 00')
    found = seen(*half, ('<', frame(of_3)))
    assert names(found, 'other_source', 'strays', 'replies') == (3, 0, 0)
    assert '--station 3' in diagnose(found).step
    other = seen(*half, ('>', poll(2)), ('<', frame(of_3)))
    assert other.other_source is None  # station 2 was polled
    old = bytes.fromhex('05 01 46 00 20 00')
    found = seen(('>', frame(COMMAND)), ('<', ACK), ('<', frame(old)), mode=PEER)
    assert names(found, 'other_source', 'strays', 'replies') == (None, 1, 0)
    assert 'none is to a command of ours' in diagnose(found).cause
    both = seen(*half, ('<', frame(old)), ('<', frame(REPLY)))
    assert names(both, 'strays', 'replies') == (1, 1)
    assert 'none is to' not in diagnose(both).cause


def test_symbols_alone_are_df1() -> None:
    storm = seen(*[('<', ENQ)] * 3, ('>', frame(COMMAND)), ('<', ENQ), ('>', NAK), mode=PEER)
    assert storm.is_df1 and storm.asked_again == 4
    assert 'DLE ENQ comes again and again' in diagnose(storm).cause
    only_eot = seen(('>', frame(COMMAND, 1)), ('<', EOT), ('>', frame(COMMAND, 1)), ('<', EOT))
    assert only_eot.is_df1 and diagnose(only_eot).rule.asks is Decider.OTHER_CHECK


def test_silence_behind_an_adapter_that_echoes_leads_to_the_station() -> None:
    line = ('>', poll(2)), ('<', poll(2)), ('>', poll(2)), ('<', poll(2))
    found = diagnose(seen(*line, station=2, echoes=True))
    assert 'station 2 is silent' in found.cause and 'Mode' not in found.step
    assert 'half duplex' in diagnose(seen(*line, mode=PEER, echoes=True)).step


def test_characters_are_counted_in_words() -> None:
    assert diagnose(Traces(characters=1, first=b'\xA7')).cause.startswith('1 character came, ')


def test_damaged_messages_that_fit_the_other_check_show_it() -> None:
    as_bcc = frame(REPLY)[:-2] + bytes((-sum(REPLY) & 0xFF,))
    line = ('>', frame(COMMAND)), ('<', as_bcc), ('>', NAK), ('<', as_bcc), ('>', NAK)
    assert seen(*line, mode=PEER).takes_other_check
    broken = frame(REPLY)[:-1] + b'\x99'
    assert seen(('>', frame(COMMAND)), ('<', broken), mode=PEER).takes_other_check is None


def test_own_bytes_that_come_back_are_left_out() -> None:
    line = (('>', poll(1)), ('<', poll(1)[:2]), ('<', poll(1)[2:] + EOT), ('>', poll(2)),
            ('<', poll(2) + EOT))
    echoed = seen(*line, echoes=True)
    assert names(echoed, 'characters', 'polls_answered', 'foreign_polls') == (4, 1, 0)
    chunks = [Chunk(0.0, Direction(way), data) for way, data in line]
    assert [chunk.data for chunk in without_echo(chunks)] == [poll(1), EOT, poll(2), EOT]


@for_all(('data', 'is_text', 'is_modbus'), [
    (b'TEMP 23.4 C\r\n', True, False), (b'login: ', True, False),
    (b'\x024006381333931\x03\r\n', True, False), (b'OK\r\n', False, False),
    (b'23.4\xB0C \r\n', False, False), (ACK + EOT + NAK, False, False),
    (bytes.fromhex('01 03 00 00 00 0A C5 CD'), False, True),
    (bytes.fromhex('01 83 02 C0 F1'), False, True),
    (bytes.fromhex('01 83 02 C0 F0'), False, False),
    (b'\xFF' + bytes.fromhex('01 83 02 C0 F1') + b'\x00', False, True),
    (bytes(range(64)), False, False), (bytes(64), False, False)])
def test_text_and_modbus_are_known(data: bytes, is_text: bool, is_modbus: bool) -> None:
    assert names(Traces(first=data), 'is_text', 'is_modbus') == (is_text, is_modbus)


def test_bytes_that_have_the_check_of_modbus_by_chance_are_not_modbus() -> None:
    heard = Traces(characters=8, first=bytes.fromhex('01 03 00 00 00 0A C5 CD'))
    assert 'Modbus' in diagnose(heard).cause
    assert 'Modbus' not in diagnose(replace(heard, replies=3, damaged=2)).cause


def test_no_message_of_df1_is_modbus() -> None:
    messages: Iterable[bytes] = (
        frame(bytes((1, 5, 15, 0, number & 255, number >> 8, 0xA2, 2, 7, 0x89, 0, 0)))
        for number in range(0, 0x10000, 0x101))
    assert not any(map(has_modbus, messages))


def test_first_bytes_are_shown_as_hex_and_text() -> None:
    assert Traces(first=b'TEMP 23.4 C\r\n').first_text == (
        '54 45 4D 50 20 32 33 2E 34 20 43 0D 0A "TEMP 23.4 C\\r\\n"')
    assert Traces(first=ACK + bytes(15)).first_text == (
        '10 06' + 14 * ' 00' + r' "\x10\x06' + 14 * r'\x00' + '" ...')
    assert Traces().first_text == ''
