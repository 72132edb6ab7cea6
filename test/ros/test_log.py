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

"""Numbered events in the log: real rclpy loggers, read where they write."""

from collections.abc import Callable, Iterator
import re

from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.ros.diagnostics.log import (
    ERROR,
    EventLog,
    INFO,
    LimitedLog,
    MOST_ENTRIES,
    NodeLog,
    UnreadableRows,
    WARN,
)
from abdf1_ros.settings.mapping import Mapping
import pytest
from rclpy.logging import get_logger, LoggingSeverity
from support.cases import for_all
from support.clock import Clock
from support.mappings import make_mapping

LINE = re.compile(r'\[(\w+)\] \[[0-9.]+\] \[log_test\]: (.*)')

ROUTINE = (Message.NTC_REPLY_MSG_RCVD, Message.NTC_NAK_RETRY, Message.NTC_ENQ_RETRY,
           Message.NTC_ACK_EXPECTED, Message.NTC_EOT_STX_EXPECTED)
LEVELS = {Severity.CRITICAL: 'FATAL', Severity.ERROR: 'ERROR', Severity.NOTICE: 'INFO'}

Lines = list[tuple[str, str]]
Logged = Callable[[], Lines]


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def log(clock: Clock) -> EventLog:
    return EventLog(get_logger('log_test'), clock)


@pytest.fixture
def logged(capfd: pytest.CaptureFixture[str]) -> Iterator[Logged]:
    """Return level and text of all that has been logged since the last call."""
    def read() -> Lines:
        output = ''.join(capfd.readouterr())
        return [match.groups() for match in map(LINE.fullmatch, output.splitlines()) if match]
    yield read
    assert not read(), 'more was logged than looked at'


def event(message: Message, station: int | None = 2) -> Event:
    return Event(message, (1,) * len(re.findall('%', message.template)), station)


@for_all('message', [entry for entry in Message if entry not in ROUTINE])
def test_every_message_has_the_level_of_its_table(
        log: EventLog, logged: Logged, message: Message) -> None:
    log.add(event(message))
    ((level, text),) = logged()
    assert level == LEVELS[message.severity]
    assert text.startswith(f'{message.number} {message.name}: ')
    assert text.endswith(' [station 2]')


def test_cause_is_news_after_a_quiet_minute_and_its_repetitions_are_counted(
        log: EventLog, clock: Clock, logged: Logged) -> None:
    text = '2508 ERR_COMMAND_TIMEOUT: Command Timed Out [station 2]'
    log.add(event(Message.ERR_COMMAND_TIMEOUT))
    for _ in range(3):
        clock.now += 59.5
        log.add(event(Message.ERR_COMMAND_TIMEOUT))
    assert logged() == [('ERROR', text)]
    clock.now += 60.0
    log.add(event(Message.ERR_COMMAND_TIMEOUT))
    assert logged() == [('ERROR', f'{text} (3 more like it were not logged)')]
    clock.now += 1.0
    log.add(event(Message.ERR_COMMAND_TIMEOUT))
    assert logged() == []


def test_cause_that_lasts_is_logged_again_every_ten_minutes(
        log: EventLog, clock: Clock, logged: Logged) -> None:
    for _ in range(1201):
        log.add(event(Message.ERR_BAD_CRC))
        clock.now += 1.0
    first, *later = (text for _, text in logged())
    assert first.endswith('[station 2]')
    assert later == [f'{first} (599 more like it were not logged)'] * 2


def test_station_that_comes_and_goes_does_not_fill_the_log(
        log: EventLog, clock: Clock, logged: Logged) -> None:
    for _ in range(60):
        log.forget(2)
        log.add(event(Message.NTC_NAK_LIMIT_EXCEEDED))
        clock.now += 1.0
    assert len(logged()) == MOST_ENTRIES
    log.add(event(Message.NTC_NAK_LIMIT_EXCEEDED))
    ((_, text),) = logged()
    assert text.endswith('[station 2] (50 more like it were not logged)')


def test_forgetting_a_station_makes_its_causes_news(log: EventLog, logged: Logged) -> None:
    def happen() -> list[tuple[str, str]]:
        log.add(event(Message.ERR_BAD_CRC, 1))
        log.add(event(Message.ERR_COMMAND_TIMEOUT, 1))
        log.add(event(Message.ERR_BAD_CRC, 2))
        log.add(event(Message.ERR_BAD_CRC, None))
        return [(text[:4], text[text.rfind('['):]) for _, text in logged()]

    assert len(happen()) == 4
    assert happen() == []
    log.forget(1)
    again = '[station 1] (1 more like it were not logged)'
    assert happen() == [('2506', again), ('2508', again)]
    log.forget(77)
    assert happen() == []


def test_routine_is_for_debugging_only(
        clock: Clock, logged: Logged, request: pytest.FixtureRequest) -> None:
    logger = get_logger('log_test')
    quiet = EventLog(logger, clock)
    for message in ROUTINE:
        quiet.add(event(message))
    assert logged() == []
    request.addfinalizer(lambda: logger.set_level(LoggingSeverity.INFO))
    logger.set_level(LoggingSeverity.DEBUG)
    talkative = EventLog(logger, clock)
    for message in ROUTINE:
        talkative.add(event(message))
        talkative.add(event(message))
    assert [(level, text[:4]) for level, text in logged()] == [
        ('DEBUG', str(message.number)) for message in ROUTINE for _ in range(2)]


def test_forged_senders_neither_fill_the_memory_nor_the_log(
        log: EventLog, clock: Clock, logged: Logged, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ros.diagnostics.log.MOST_CAUSES', 50)
    for number in range(70):
        log.add(event(Message.ERR_WRONG_MESSAGE, number))
    assert len(logged()) == 50
    clock.now += 59.0
    log.add(event(Message.ERR_WRONG_MESSAGE, 3))
    log.add(event(Message.ERR_BAD_CRC, 3))
    assert logged() == []
    clock.now += 1.0
    log.add(event(Message.ERR_BAD_CRC, 3))  # all but one of the others have been quiet
    assert [text[:4] for _, text in logged()] == ['2506']
    log.add(event(Message.ERR_WRONG_MESSAGE, 3))
    assert logged() == []


@pytest.fixture
def lines(clock: Clock) -> LimitedLog:
    return LimitedLog(get_logger('log_test'), clock)


@pytest.mark.parametrize('level', ['info', 'warning', 'error'])
def test_line_cannot_pass_for_another(lines: LimitedLog, logged: Logged, level: str) -> None:
    forged = 'tag\n[FATAL] [1.0] [log_test]: \x1b[31mall is lost\u2028'
    getattr(lines, level)('a', forged)
    ((_, text),) = logged()
    assert text == r'tag\n[FATAL] [1.0] [log_test]: \x1b[31mall is lost\u2028'


@pytest.mark.parametrize('level', ['info', 'warning', 'error'])
def test_only_a_few_lines_a_minute_are_about_one_thing(
        lines: LimitedLog, clock: Clock, logged: Logged, level: str) -> None:
    write = getattr(lines, level)
    for number in range(MOST_ENTRIES + 5):
        write('one\n', str(number))
        clock.now += 1.0
    write('other', 'word')
    assert [text for _, text in logged()] == [*map(str, range(MOST_ENTRIES)), 'word']
    clock.now += 60.0 - MOST_ENTRIES - 5
    write('one\n', 'first again')
    write('one\n', 'next')
    clock.now += 1.0
    write('one\n', 'last')
    assert [text for _, text in logged()] == [
        r'first again (5 more about one\n were not logged)',
        r'last (1 more about one\n were not logged)']


def test_same_files_read_again_are_one_line_and_few_of_them(clock: Clock, logged: Logged) -> None:
    log = NodeLog(get_logger('log_test'), clock)
    news = [(INFO, 'net.csv and map.csv'), (WARN, 'a\nb'), (ERROR, 'c')]
    for _ in range(1000):
        log.tell_files(news)
        clock.now += 0.01
    assert logged() == [
        ('INFO', 'net.csv and map.csv'), ('WARN', r'a\nb'), ('ERROR', 'c'),
        *MOST_ENTRIES * [('INFO', 'the files were read again: net.csv and map.csv '
                          '(and 2 other lines)')]]
    log.tell_files(news[:1])  # they have changed
    assert logged() == [('INFO', 'net.csv and map.csv')]
    for number in range(100):
        log.tell_files([(INFO, f'map{number}.csv')])
    assert len(logged()) == MOST_ENTRIES - 2


def test_rows_of_a_file_that_fail_for_one_reason_are_one_line(
        lines: LimitedLog, clock: Clock, logged: Logged) -> None:
    rows = UnreadableRows(lines)
    mappings: dict[tuple[str, int], Mapping] = {}
    for now, address, station, reason in (
            (0.0, 'N7:10', 1, 'no'), (0.9, 'N7:2', 1, 'no'), (1.0, 'N7:1', 2, 'no'),
            (1.1, 'N7:3', 1, 'never'), (1.25, 'N9:3', 1, 'no'), (1.25, 'N7:10', 1, 'no')):
        rows.look(now)
        mapping = mappings.setdefault(
            (address, station), make_mapping(address, station=station, tag=address))
        rows.add(now, mapping, reason)
    rows.look(2.2)
    assert logged() == []
    rows.look(2.25)
    assert [text for _, text in logged()] == [
        '2 rows from N7:2 to N7:10 at station 1 (N7:2, N7:10): no', 'N7:1 (N7:1 at station 2): no',
        'N7:3 (N7:3 at station 1): never', 'N9:3 (N9:3 at station 1): no']
    for tick in range(101):  # they never pause
        rows.add(10 + tick / 10, make_mapping('N7:0', tag='a'), f'{tick}')
        rows.look(10 + tick / 10)
        entries = logged()
        assert bool(entries) is (tick == 100)
    assert len(entries) == MOST_ENTRIES
    for number in range(10_001):  # one more than are kept
        rows.add(30.0, mapping, f'{number}')
    clock.now += 60.0
    rows.tell()
    clock.now += 60.0
    lines.error('N7:10', 'last')
    assert logged()[-1] == ('ERROR', 'last (9990 more about N7:10 were not logged)')
