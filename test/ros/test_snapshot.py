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

"""All values of a map in one message, and who gets it when."""

from array import array
from collections.abc import Iterator
from datetime import datetime
from itertools import pairwise
from pathlib import Path
import time

from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.topics.snapshot import Snapshot
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.scaling import Scaling
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from support.cases import for_all
from support.mappings import make_mapping
from support.ros import BridgeCell, details, EVERYTHING, Inbox

OK, STALE, ERROR = DiagnosticStatus.OK, DiagnosticStatus.STALE, DiagnosticStatus.ERROR


def status_of(mapping: Mapping, values: array | str | None, *others: Mapping,
              age: float = 0.5, error: str | None = None) -> DiagnosticStatus:
    """Return the status of a row whose values are so old (s)."""
    now = line_time()
    points = {row: ReadPoint(row, 1.0, 3.0) for row in (mapping, *others)}
    if values is not None:
        points[mapping].raw, points[mapping].last_good = values, now - age
    if error == 'not in RUN':
        points[mapping].withhold(error, now)
    else:
        points[mapping].error = error
    return Snapshot(points).message(now).status[0]


def test_single_value_has_all_that_is_known_of_it() -> None:
    begun = time.time()
    status = status_of(make_mapping('N7:10', station=2, topic='speed', description='of belt 3'),
                       array('h', [1200]))
    ended = time.time()
    assert (status.level, status.hardware_id) == (OK, 'station 2 N7:10')
    assert status.message == 'OK: 1200, 0.5 s ago'
    values = details(status)
    assert begun - 0.51 < datetime.fromisoformat(values.pop('stamp')).timestamp() < ended - 0.49
    assert values == {'value': '1200', 'age_ms': '500', 'address': 'N7:10', 'type': 'int16',
                      'topic': 'speed', 'description': 'of belt 3'}


@for_all(('address', 'length', 'kind', 'values', 'keys'), [
    ('N7:10', 2, '', array('h', [1, 2]), ['value N7:10', 'value N7:11']),
    ('B3:0/15', 2, '', array('B', [1, 0]), ['value B3:0/15', 'value lamp']),
    ('N7:0', 2, 'int32', array('i', [1, 2]), ['value N7:0', 'value N7:2']),
    ('N7:0', 32, '', array('h', range(32)), [f'value N7:{number}' for number in range(32)]),
    ('N7:0', 33, '', array('h', range(33)), ['value']),
    ('ST9:0', 1, '', '', ['value'])])
def test_each_value_of_an_array_has_a_key(
        address: str, length: int, kind: str, values: array | str, keys: list[str]) -> None:
    row = make_mapping(address, length=length, kind=kind)
    others = (make_mapping('B3:1/0', tag='lamp'), make_mapping('N7:11', length=2, tag='pair'),
              make_mapping('N7:2', station=2, tag='there'))
    found = [key for key in details(status_of(row, values, *others)) if key.startswith('value')]
    assert found == keys


def test_names_of_bits_are_keys() -> None:
    row = make_mapping('B3:0/15', length=3, bits=('doors closed', '', 'odd\n'))
    found = {key: text for key, text in details(status_of(row, array('B', [1, 0, 1]))).items()
             if key.startswith('value')}
    assert found == {'value doors closed': '1', 'value B3:1/0': '0', r'value odd\n': '1'}
    many = make_mapping('B3:0/0', length=40, bits=tuple(f'bit {number}' for number in range(40)))
    assert 'value bit 39' in details(status_of(many, array('B', bytes(40))))


@for_all(('values', 'age', 'error', 'level', 'message'), [
    (array('h', [7]), 2.0, None, OK, 'OK: 7, 2.0 s ago'),  # late, and not stale yet
    (array('h', [7]), -0.04, None, OK, 'OK: 7, 0.0 s ago'),  # read while the snapshot is made
    (array('h', [7]), 9.0, None, STALE, 'STALE: 7, 9.0 s ago'),
    (array('h', [7]), 9.0, 'no reply', ERROR, 'ERROR: no reply; 7, 9.0 s ago'),
    (array('h', [7]), 9.0, 'not in RUN', ERROR, 'ERROR: not in RUN; 7, 9.0 s ago'),
    (None, 0.0, 'no reply', ERROR, 'ERROR: no reply'),
    (None, 0.0, None, STALE, 'STALE: waiting for the first read')])
def test_value_that_is_not_fresh_says_so(
        values: array | None, age: float, error: str | None, level: bytes, message: str) -> None:
    status = status_of(make_mapping('N7:0'), values, age=age, error=error)
    assert (status.level, status.message) == (level, message)
    assert details(status).get('age_ms', '0') == f'{1000 * max(age, 0):.0f}'


def test_value_within_the_deadband_is_as_new_as_its_age() -> None:
    row = make_mapping('N7:0', publish='Change', deadband=5.0, scaling=Scaling(0.5))
    point = ReadPoint(row, 1.0, 3.0)
    assert [point.update(words, 1.0) for words in (b'\x08\0', b'\x09\0')][1] is None
    assert Snapshot({row: point}).message(1.0).status[0].message == 'OK: 4.5, 0.0 s ago'


# On its topic


@pytest.fixture
def inbox(tmp_path: Path) -> Iterator[Inbox]:
    rows = 'Tag,Command,Address,Station,PLC_Type,Scale,Offset\n' \
        'speed,Read,N7:0,1,PLC5,0.5,1\norder,Write,N7:2,1,PLC5,,\n'
    with BridgeCell(tmp_path, 'Station,PLC_Type,Address,Length,Values\n1,PLC5,N7:0,4,7 8\n', rows,
                    'Baud,Timeout\n115200,100\n', 'snapshot_period:=0.2') as cell:
        yield cell.ros.listen(DiagnosticArray, '/abdf1/snapshot', EVERYTHING)


def test_snapshot_comes_to_who_subscribes(
        inbox: Inbox, monkeypatch: pytest.MonkeyPatch) -> None:
    message = inbox.until(lambda array: array.status[0].level == OK, 'the values')
    (status,) = message.status  # a row that is written alone has no value
    assert status.message.startswith('OK: 4.5, ')
    assert message.header.stamp.sec > 0
    made, original = list[float](), Snapshot.message
    monkeypatch.setattr(Snapshot, 'message', lambda snapshot, now: (
        made.append(now), original(snapshot, now))[1])
    inbox.observer.until(lambda: len(made) > 3, 'four more')
    assert min(later - now for now, later in pairwise(made)) >= 0.2  # its period


def test_snapshot_is_made_for_nobody(inbox: Inbox, monkeypatch: pytest.MonkeyPatch) -> None:
    inbox.first()
    observer, made = inbox.observer, list[float]()
    observer.forget(inbox)
    observer.until(lambda: not observer.node.count_subscribers('/abdf1/snapshot'), 'its end')
    monkeypatch.setattr(Snapshot, 'message', lambda snapshot, now: made.append(now))
    over = time.monotonic() + 0.5
    observer.until(lambda: time.monotonic() > over, 'half a second')
    assert not made
