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

"""Generated tables, pages and rules of tools leave nothing out; the drawing shows the arrows."""

from pathlib import Path
import re

from abdf1_ros.counters import numbered
from abdf1_ros.driver.write import Outcome
from abdf1_ros.messages import Message
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.values import types_of
import pytest
from support.cases import for_all

from tools import drawing, reference, tables
from tools.explanations import COUNTERS, MESSAGES, OUTCOMES
from tools.rooms import Room, room_of, ROOMS


def rows(text: str) -> list[list[str]]:
    """Return the cells of a table without its head."""
    return [[cell.strip() for cell in line.strip('|').split(' | ')]
            for line in text.splitlines()[2:]]


@for_all('plc_type', FAMILIES)
def test_every_file_type_of_every_family_is_shown(plc_type: PlcType) -> None:
    shown = {parse_address(examples[plc_type], plc_type).file_type
             for _, examples in tables.PLACES if plc_type in examples}
    assert shown == set(FAMILIES[plc_type].file_types) - {FileType.PWM}  # which is as PTO


@for_all(('label', 'examples'), tables.PLACES)
def test_places_of_one_row_have_the_same_types(label: str, examples: dict[PlcType, str]) -> None:
    kinds = {types_of(parse_address(text, plc_type)) for plc_type, text in examples.items()}
    assert len(kinds) == 1, label


def test_an_address_leads_to_its_message() -> None:
    found = {row[0]: row for row in rows(tables.addresses())}
    assert found['N integer'] == [
        'N integer', '`N7:0`', '`N7:0`', '`N7:0`', '', 'int16',
        'uint16, bcd16, bcd12, int32, uint32, float32, string', 'Int16MultiArray']
    assert found['a bit'][4:] == ['`110/17`', 'bool', '', 'UInt8MultiArray']


def test_bars_in_cells_do_not_end_them() -> None:
    assert tables.table(('a',), [('b | c',)]) == '| a |\n| --- |\n| b \\| c |'


def test_members_tell_what_is_only_read_and_packets_their_limits() -> None:
    timer = next(row for row in rows(tables.members()) if row[:2] == ['PLC-5', 'T'])
    assert timer == ['PLC-5', 'T', '(CON) PRE ACC', 'EN TT DN']
    found = {row[0]: row[1:] for row in rows(tables.packets())}
    assert found['SLC, Processor 5/01'] == ['41', '41', 'F ST A D L HSC PTO PWM STI EII']
    assert found['PLC-5'] == ['110', '110', '']
    assert {'F', 'ST', 'A'} <= set(found['SLC, Processor ML1000'][2].split())


def test_numbers_of_messages_are_links() -> None:
    crc = next(row for row in rows(tables.counters()) if row[1] == 'CNT_CRC_ERRORS')
    assert crc == ['2547', 'CNT_CRC_ERRORS', 'frames received with a wrong CRC',
                   'See [2506](messages.md#2506).']


def test_every_message_counter_and_outcome_is_explained() -> None:
    assert (list(MESSAGES), list(COUNTERS), list(OUTCOMES)) == (
        list(Message), [entry.name for entry in numbered()], list(Outcome))
    assert all(COUNTERS.values()) and all(OUTCOMES.values())
    assert [entry for entry in MESSAGES.values() if not entry.cause or not entry.cure] == []


def test_numbers_2501_to_2561_are_all_documented() -> None:
    folder = reference.ROOT / reference.REFERENCE
    text = ''.join((folder / name).read_text(encoding='utf-8')
                   for name in ('messages.md', 'counters.md'))
    rows = [line for line in text.splitlines() if line.startswith('| ')]
    for number in range(2501, 2562):
        assert sum(row.startswith((f'| {number} ', f'| <a id="{number}"></a>{number} '))
                   for row in rows) == 1, number


def test_part_goes_between_its_markers_and_a_missing_one_is_named() -> None:
    text = 'a\n<!-- generated: x -->\nold\n<!-- end: x -->\nb\n'
    assert reference.filled(text, 'x', 'new') == \
        'a\n<!-- generated: x -->\n\nnew\n\n<!-- end: x -->\nb\n'
    assert reference.filled(reference.filled(text, 'x', 'new'), 'x', 'old') == \
        reference.filled(text, 'x', 'old')
    with pytest.raises(LookupError, match='no markers "generated: y"'):
        reference.filled('text', 'y', 'new')


def test_main_writes_what_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'page.md'
    file.write_text('<!-- generated: x -->\n<!-- end: x -->\n', encoding='utf-8')
    monkeypatch.setattr(reference, 'ROOT', tmp_path)
    monkeypatch.setattr(reference, 'PARTS', {('page.md', 'x'): lambda: 'new'})
    assert reference.main() == 0
    assert '\nnew\n' in file.read_text(encoding='utf-8')
    assert reference.main() == 0
    assert capsys.readouterr().out == 'page.md: x\n'


A, B, C = Room(('a.py',), ''), Room(('b.py',), ''), Room(('c.py',), '')


def test_what_a_longer_way_implies_is_left_out() -> None:
    assert drawing.reduced({A: {B, C}, B: {C}, C: set()}) == {A: {B}, B: {C}, C: set()}


@pytest.fixture(scope='module')
def found() -> dict[Room, set[Room]]:
    return drawing.arrows()


def test_arrows_are_the_imports(found: dict[Room, set[Room]]) -> None:
    assert room_of('pccc/address.py') in found[room_of('settings/mapping.py')]
    assert room_of('ports/link_thread.py') in found[room_of('ros/node.py')]
    assert found[room_of('messages.py')] == set()


def test_no_room_leads_back_to_itself(found: dict[Room, set[Room]]) -> None:
    for room in ROOMS:
        reached: set[Room] = set()
        waiting = [room]
        while waiting:
            for target in found[waiting.pop()] - reached:
                assert target is not room, room.name
                reached.add(target)
                waiting.append(target)


def test_drawing_names_every_room_once() -> None:
    text = drawing.mermaid()
    assert text in (Path(__file__).parents[2] / 'docs' / 'architecture.md').read_text('utf-8')
    labels = re.findall(r'\["(.*?)"\]', text)
    assert [label.replace('<br>', ', ') for label in labels] == [room.name for room in ROOMS]
    assert re.search(r'r\d+ --> r\d+', text)


ament = pytest.importorskip('tools.ament')

HEADER = Path(__file__).read_text(encoding='utf-8').partition('""')[0]


@for_all(('source', 'expected'), [
    ('x = 1\n', []),
    ('class Door:\n\n    def opened(self) -> None:\n        """Open it."""\n', []),
    ('class Door:\n    """A door."""\n\n    def shut(self) -> None:\n        pass\n', []),
    ('class Door:\n    def shut(self) -> None:\n        pass\n', ['CNL100']),
    ('class Door:\n\n    @final\n    def shut(self) -> None:\n        pass\n', []),
    ('class Door:\n\n    def open(self) -> None:\n        pass\n', ['A003']),
    ('class Door:\n\n    def open(self) -> None:  # noqa: A003\n        pass\n', []),
    ('class Door:\n    type = 3\n', ['A003']), ('class Door:\n    type: int\n', ['A003']),
    ("class Door:\n    __doc__ = 'a door'\n", []),
    ('import wall\nif TYPE_CHECKING:\n    import door\n', ['I300']),
    ('import wall\n\nx = 1\nif TYPE_CHECKING:\n    import door\n', ['I300']),
    ('import wall\n\nx = 1\nif TYPE_CHECKING:\n    import door  # noqa: I300\n', []),
    ('import typing\n\nif typing.TYPE_CHECKING:\n    import door\n', []),
    ('x = "it\'s" "b"\n', ['Q000']),
    ('x = "it\'s"\n', []), ('x = """a"""\n', []),
    ('def sent(x: int) -> None:\n    """Judge what is sent (rule 3)."""\n', ['D402']),
    ('def sent(x: int) -> None:\n    """Judge what goes out (rule 3)."""\n', [])])
def test_rule(source: str, expected: list[str]) -> None:
    assert [text.partition(':')[0] for _, text in ament.findings_in(HEADER + source)] == expected


def test_licence_header_is_needed_below_the_interpreter_at_most() -> None:
    assert [*ament.findings_in('#!/usr/bin/env python3\n' + HEADER)] == []
    assert [line for line, _ in ament.findings_in('x = 1\n')] == [1]
    assert [*ament.findings_in('')] == []
