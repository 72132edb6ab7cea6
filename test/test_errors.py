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

"""The exception tree: what callers catch, and the numbered texts."""

from abdf1_ros.errors import (
    Abdf1Error,
    CommandTimeout,
    FormatError,
    LinkError,
    PortLost,
    RemoteError,
    StationInactive,
    WrongCommandCode,
)
from abdf1_ros.messages import Message
from abdf1_ros.problems import ConfigurationError, Place, Problem
from support.cases import for_all


def test_what_callers_can_catch() -> None:
    links = (CommandTimeout, StationInactive, WrongCommandCode, PortLost)
    others = (FormatError, RemoteError, Problem, ConfigurationError)
    assert all(issubclass(error, Abdf1Error) for error in links + others)
    assert [issubclass(error, LinkError) for error in links + others] == 4 * [True] + 4 * [False]
    assert issubclass(FormatError, ValueError)
    error = RemoteError(0xF0, 0x06, 'no such place')
    assert (error.sts, error.ext_sts, str(error)) == (0xF0, 0x06, 'no such place')


@for_all(('error', 'text'), [
    (CommandTimeout(), '2508 ERR_COMMAND_TIMEOUT: Command Timed Out'),
    (StationInactive(9), '2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive'),
    (WrongCommandCode(9, 0x41, 0x4F),
     '2505 ERR_BAD_FUNCTION_CODE: Response with wrong command code '
     '(slv=9, actual=65, expected=79)'),
    (PortLost('unplugged'), 'port lost: unplugged'),
])
def test_link_error_reads_as_its_numbered_text(error: LinkError, text: str) -> None:
    assert str(error) == text


@for_all('error', [
    CommandTimeout(), StationInactive(9), WrongCommandCode(9, 0x41, 0x4F), PortLost('unplugged')])
def test_copy_of_a_link_error_says_whether_the_command_was_sent(error: LinkError) -> None:
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
