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

"""What callers catch, the texts of the numbered messages, and how texts and numbers are shown."""

from collections.abc import Iterator
import copy
from importlib import import_module
from inspect import Parameter, signature
import pickle
from pkgutil import walk_packages
from typing import get_type_hints

import abdf1_ros
from abdf1_ros import errors
from abdf1_ros.counters import Counters, numbered
from abdf1_ros.messages import Event, Message, Severity
from abdf1_ros.numbers import decimal_number, two_readings, whole_number
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.text import age_text, by_number, cut, first, milliseconds, printable, utc_text
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import ANY_CHARACTER, for_all
from support.vectors import load_tables


def test_what_callers_can_catch() -> None:
    links = (errors.CommandTimeout, errors.StationInactive, errors.WrongCommandCode,
             errors.PortLost)
    others = (errors.FormatError, errors.RemoteError, Problem, ConfigurationError)
    assert all(issubclass(error, errors.Abdf1Error) for error in links + others)
    assert {error for error in links + others if issubclass(error, errors.LinkError)} == {*links}
    assert issubclass(errors.FormatError, ValueError)
    error = errors.RemoteError(0xF0, 0x00, 'no such place')
    assert (error.sts, error.ext_sts, str(error)) == (0xF0, 0x00, 'no such place')


@for_all(('error', 'text'), [
    (errors.CommandTimeout(), '2508 ERR_COMMAND_TIMEOUT: Command Timed Out'),
    (errors.StationInactive(9), '2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive'),
    (errors.WrongCommandCode(9, 0x41, 0x4F),
     '2505 ERR_BAD_FUNCTION_CODE: Response with wrong command code '
     '(slv=9, actual=65, expected=79)'),
    (errors.PortLost('unplugged'), 'port lost: unplugged')])
def test_link_error_reads_as_its_numbered_text(error: errors.LinkError, text: str) -> None:
    assert str(error) == text


def _exceptions() -> Iterator[type[Exception]]:
    """Yield all exceptions that a program may meet; a command keeps its own to itself."""
    for module in walk_packages(abdf1_ros.__path__, 'abdf1_ros.'):
        if module.name.split('.')[1] not in ('cli', 'conform', 'testing', '__main__'):
            yield from (kind for kind in vars(import_module(module.name)).values()
                        if isinstance(kind, type) and issubclass(kind, Exception)
                        and kind.__module__ == module.name)


def _example(kind: type[Exception], value: int) -> Exception:
    """Return an exception with an argument for each parameter; its type decides what it is."""
    known = {'str': f'text {value}', 'int': value, 'int | None': value, 'bool': False,
             'Place | str': Place('map.csv', value), 'tuple[object, ...]': (),
             'Message | None': Message.ERR_COMMAND_TIMEOUT,
             'list[Problem]': [Problem('a', f'{value}'), Problem(Place('b', 2), 'c')]}
    if issubclass(kind, errors.LinkError) and '__init__' not in vars(kind):
        places = 1 if 'words' in vars(kind) else kind.message.template.count('%')
        return kind(*[value] * places, sent=False, cause=known['Message | None'])
    if not hasattr(kind.__init__, '__code__'):  # the constructor of C takes anything
        return kind(f'text {value}')
    types = get_type_hints(kind.__init__)

    def made(one: Parameter) -> object:
        if one.annotation in known or one.default is not Parameter.empty:
            return known.get(one.annotation, one.default)
        return next(iter(types[one.name]))  # of an Enum

    wanted = [*signature(kind).parameters.values()]
    return kind(*[made(one) for one in wanted if one.kind is Parameter.POSITIONAL_OR_KEYWORD], **{
        one.name: made(one) for one in wanted if one.kind is Parameter.KEYWORD_ONLY})


def test_exceptions_survive_pickling_and_copies() -> None:
    """In ``multiprocessing.Pool`` ``get`` waited for ever for an error that did not."""
    kinds = {*_exceptions()}
    assert kinds >= {errors.RemoteError, errors.PortLost, Problem, ConfigurationError}
    for value, kind in enumerate(sorted(kinds, key=str)):
        error = _example(kind, value)
        if isinstance(error, errors.Abdf1Error):
            error.about, error.done = 'N7:0 of station 1', '; 1 of 2 packets were written'
        error.add_note('a note')
        for again in (pickle.loads(pickle.dumps(error)), copy.copy(error)):  # noqa: S301
            assert type(again) is kind
            assert (str(again), again.args) == (str(error), error.args)
            assert repr(vars(again)) == repr(vars(error))


@for_all('error', [
    errors.CommandTimeout(), errors.StationInactive(9), errors.WrongCommandCode(9, 0x41, 0x4F),
    errors.PortLost('unplugged')])
def test_copy_of_a_link_error_says_whether_the_command_was_sent(error: errors.LinkError) -> None:
    for is_sent in (True, False):  # as driver/job_tasks.py makes it
        copy = type(error)(*error.args, sent=is_sent)
        assert (str(copy), copy.sent) == (str(error), is_sent)


@for_all(('place', 'text'), [
    (Place('net.csv', 2, 1, 'Station'), 'net.csv:2:1 (Station)'),
    (Place('net.csv', 2, None, 'Station'), 'net.csv:2 (Station)'),
    (Place('net.csv', 2, 1), 'net.csv:2:1'), (Place('net.csv', 2), 'net.csv:2'),
    (Place('a (b):3'), 'a (b):3')])
def test_place_in_words(place: Place, text: str) -> None:
    assert str(place) == text
    assert str(Problem(place, 'this')) == f'{text}: this'
    assert Problem(text, 'this').place == Place(text)


def test_problem_shows_place_number_and_advice() -> None:
    place = Place('net.csv', 2, 1)
    problem = Problem(place, 'write 0 to 254', Message.CRT_BAD_STATION_ID, ('x', 255))
    assert str(problem) == (
        'net.csv:2:1: 2552 CRT_BAD_STATION_ID: Invalid station number (x) must be less than '
        '255; write 0 to 254')
    assert (problem.place, problem.text) == (place, 'write 0 to 254')
    assert problem.message is Message.CRT_BAD_STATION_ID


def test_problem_is_one_line_whatever_the_file_holds() -> None:
    problem = Problem('a\x1b[2J.csv:2:1', '"N7\n0" is wrong', Message.ERR_ADDRESS_SYNTAX,
                      (1, 'N7\n0'))
    assert str(problem) == (
        r'a\x1b[2J.csv:2:1: 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax (N7\n0); '
        r'"N7\n0" is wrong')


def test_configuration_error_shows_every_problem() -> None:
    problems = [Problem('a:1:1', 'this'), Problem('a:1:2', 'that')]
    error = ConfigurationError(problems)
    assert error.problems == problems
    assert str(error) == 'a:1:1: this\na:1:2: that'


SPECIFIED: list[tuple[int, str, str]] = [tuple(row) for row in load_tables()['messages']]
COUNTERS = [(number, name) for number, name in load_tables()['counters']]


def test_exactly_the_specified_messages_exist() -> None:
    assert sorted((entry.number, entry.name) for entry in Message) == [
        (number, name) for number, name, _ in SPECIFIED]
    assert len(SPECIFIED) == 32


@for_all(('number', 'name', 'text'), SPECIFIED)
def test_text_is_that_of_the_specification(number: int, name: str, text: str) -> None:
    message = Message[name]
    assert message.number == number
    assert message.template == text


@for_all('message', Message)
def test_severity_follows_the_mnemonic(message: Message) -> None:
    prefix = {Severity.CRITICAL: 'CRT', Severity.ERROR: 'ERR', Severity.NOTICE: 'NTC'}
    assert message.name.startswith(prefix[message.severity] + '_')


@for_all('message', Message)
def test_text_takes_as_many_arguments_as_it_has_places(message: Message) -> None:
    args = tuple(range(message.template.count('%')))
    assert '%' not in message.text(*args)
    if message.has_choices:
        assert message.text(*args, 'TOY') == f'{message.text(*args)}, TOY'
    else:
        with pytest.raises(TypeError):
            message.text(*args, 1)
    if args:
        with pytest.raises(TypeError):
            message.text(*args[1:])


@for_all(('shown', 'text'), [
    (age_text(5.0, 4.9), '0.0 s'), (cut('abcdef', 2), '..'), (milliseconds(0.0), '0 ms'),
    (cut('abcde', 5), 'abcde'),
    (utc_text(1.5), '1970-01-01T00:00:01.500+00:00'),
    (Message.ERR_BAD_CRC.text(0x0A, 0xFF, 0, 1),
     'Response with wrong CRC (actual=0x0aff, expected=0x0001)'),
    (Message.ERR_WRONG_MESSAGE.text(1, 0x20, 0x2A),
     'Wrong Message Received Src:0x01, Dst:0x20, Tns:0x002a'),
    (Message.CRT_BAD_STATION_ID.text('abc', 255),  # as a user typed it
     'Invalid station number (abc) must be less than 255'),
    (Message.ERR_COMMAND_TIMEOUT.entry(), '2508 ERR_COMMAND_TIMEOUT: Command Timed Out'),
    (Event(Message.NTC_ACK_EXPECTED, (0x15,), 7),
     '2515 NTC_ACK_EXPECTED: ACK Expected (last symbol received was 0x15) [station 7]'),
    (Event(Message.ERR_COMMAND_TIMEOUT, (), 0),
     '2508 ERR_COMMAND_TIMEOUT: Command Timed Out [station 0]'),
    (Event(Message.NTC_NAK_RETRY, (2, 2515)),
     '2521 NTC_NAK_RETRY: NAK Retry #2, due to error 2515')])
def test_entries_and_events(shown: str | Event, text: str) -> None:
    assert str(shown) == text


def test_by_mnemonic_shows_each_counter_under_its_own_name() -> None:
    counters = Counters()
    for entry in numbered():
        setattr(counters, entry.name, entry.metadata['number'])
    assert list(counters.by_mnemonic().items()) == [(name, number) for number, name in COUNTERS]


def test_counters_are_those_of_the_specification_each_described() -> None:
    assert COUNTERS == [
        (entry.metadata['number'], entry.metadata['mnemonic']) for entry in numbered()]
    descriptions = {entry.metadata['description'] for entry in numbered()}
    assert '' not in descriptions
    assert len(descriptions) == len(COUNTERS) == 29
    assert set(Counters().by_mnemonic().values()) == {0}
    with pytest.raises(AttributeError):
        setattr(Counters(), 'polls', 1)


def test_frames_are_damaged_whichever_check_is_wrong() -> None:
    assert Counters(bcc_errors=2, crc_errors=3).damaged_frames == 5


@for_all('text', ['', 'N7:0', 'Größe 5 °C', 'скорость', '速度', 'a "b" \\n'])
def test_what_can_be_seen_stays(text: str) -> None:
    assert printable(text) == text


@for_all(('text', 'shown'), [
    ('one\n[FATAL] two', r'one\n[FATAL] two'),
    ('one\r\ntwo', r'one\r\ntwo'),
    ('\x1b[2J', r'\x1b[2J'),          # a terminal would clear its screen
    ('a\x00b\x7fc\x9bd', r'a\x00b\x7fc\x9bd'),
    ('a\u2028b\u2029c\x85d', r'a\u2028b\u2029c\x85d'),  # line ends to some viewers
    ('\u202eabc\u2066', r'\u202eabc\u2066'),            # turns the direction of writing
    ('\u200b\ufeff\xad', r'\u200b\ufeff\xad'),          # shows nothing
    ('\udc80', r'\udc80'),            # what no encoding takes
    ('\U000e0001', r'\U000e0001')])
def test_what_cannot_be_seen_is_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(ANY_CHARACTER))
def test_any_text_is_one_visible_line(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable() and len(shown.splitlines()) <= 1
    assert shown.encode().decode() == shown
    assert printable(shown) == shown


def test_names_are_sorted_by_their_numbers() -> None:
    names = ['line10', 'line2', 'Line1', 'line2b', 'hall/3/press', 'hall/20/press', '7', 'x', '']
    assert sorted(names, key=by_number) == [
        '', '7', 'Line1', 'hall/3/press', 'hall/20/press', 'line2', 'line2b', 'line10', 'x']


def test_of_many_names_the_first_are_shown_and_the_others_counted() -> None:
    assert first(['a', 'b\n'], 2) == r'a, b\n'
    assert first(['a', 'b', 'c', 'd'], 2) == 'a, b and 2 more'


@for_all(('text', 'value'), [
    ('0', 0), ('-7', -7), ('+7', 7), ('007', 7), ('65535', 65535),
    ('', None), ('1.0', None), ('1e3', None), ('0x10', None), ('1 0', None), ('1_0', None),
    ('²', None), ('٣', None), ('-', None), ('5\n', None), ('9' * 5000, None)])
def test_whole_number_is_decimal_digits_with_a_sign_at_most(text: str, value: int | None) -> None:
    assert whole_number(text) == value


@for_all(('text', 'value'), [
    ('0', 0.0), ('-1.5', -1.5), ('+2', 2.0), ('.5', 0.5), ('5.', 5.0), ('1e3', 1000.0),
    ('2.5E-1', 0.25), ('007', 7.0), ('1e-400', 0.0)])
def test_decimal_number_is_read_as_people_write_it(text: str, value: float) -> None:
    assert decimal_number(text) == value


@for_all('text', [
    '', ' 1', '1 ', '1_000', '1_0.5', 'nan', 'inf', '-Infinity', '-1e999', '\u0661', '\uff11',
    '1,5', '1e', 'e3', '.', '0x10', '1.2.3', '--1', '1\n'])
def test_text_that_is_no_number_is_none(text: str) -> None:
    assert decimal_number(text) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_in_the_form_of_python(value: float) -> None:
    assert decimal_number(repr(value)) == value


@for_all(('text', 'right'), [
    ('1,000', '1000 or 1.000'), ('-12,500', '-12500 or -12.500'), ('1,5', ''), ('1,0000', ''),
    ('1000', ''), ('1.000', ''), ('', '')])
def test_comma_that_may_be_of_thousands(text: str, right: str) -> None:
    assert two_readings(text) == right
