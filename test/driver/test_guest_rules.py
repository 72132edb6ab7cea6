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

"""The right that a command of a guest needs, by what it addresses; all bytes by hand."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.guest_rules import GuestRules, ShareAccess
from abdf1_ros.pccc.describe import describe, known_commands, targets_of
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.targets import Partner, Target
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from hypothesis import given
from hypothesis import strategies as st
from support.captures import CAPTURES
from support.cases import for_all
from support.mappings import make_mapping

READ, WRITE, ALL = ShareAccess
ROWS = {'SLC': 'N7:0', 'PLC5': 'N7:0', 'PLC3': 'N7:0', 'PLC2': '020'}


def needed(text: str, families: Sequence[str], told: Processor | None = None,
           processors: Sequence[str] = (), sender: int = 9) -> ShareAccess:
    """Return the right for a command to station 1, which has a row of each family."""
    rows = [make_mapping(ROWS[plc], plc=plc) for plc in families]
    rows += [make_mapping('N7:0', plc='SLC', processor=name) for name in processors]
    rules = GuestRules(Network(station=sender), Rows(rows), lambda station: told)
    data = bytes.fromhex(text)
    return rules.right_needed(Packet(1, 9, data[0], 0, 1, data[1:]))


# The families of the rows, the command, and the right that it needs.
@for_all('entry', [
    # PLC-5 N7:0 and T4:1.ACC: as addresses of a PLC-3 too short, and file 2 of another context.
    *(((*families,), '0F 01 00 00 01 00 06 07 00 02', READ)
      for families in ((), ('PLC5',), ('SLC',), ('PLC5', 'PLC3'))),
    (('PLC3',), '0F 01 00 00 01 00 06 07 00 02', ALL),
    *((families, '0F 00 00 00 01 00 0E 04 01 02 11 22', WRITE)
      for families in ((), ('PLC5',), ('PLC3',))),
    # A PLC-5 knows no element 13 of a status section, a PLC-3 does.
    (('PLC5',), '0F 00 00 00 01 00 0E 04 0D 02 11 22', WRITE),
    ((), '0F 00 00 00 01 00 0E 04 0D 02 11 22', ALL),
    ((), '0F 01 00 00 01 00 0E 04 0D 02 02', READ),
    # All levels of a PLC-5 address; area 0 of a PLC-3 is its system status.
    (('PLC5',), '0F 01 00 00 01 00 0F 00 04 01 02 02', READ),
    ((), '0F 01 00 00 01 00 0F 00 04 01 02 02', ALL),
    # E3.1.8.10.0.0 of a PLC-3, its status E3.1.13.0.0.2, its program E4.1.1.0.0.0; no section 11.
    (('PLC3',), '0F 00 00 00 01 00 2C 08 0A 00 11 22', WRITE),
    ((), '0F 00 00 00 01 00 2C 08 0A 00 11 22', WRITE),
    (('PLC5',), '0F 00 00 00 01 00 2C 08 0A 00 11 22', ALL),
    (('PLC3',), '0F 01 00 00 01 00 2C 0D 00 02 02', READ),
    (('PLC3',), '0F 00 00 00 01 00 2C 0D 00 02 11 22', ALL),
    (('PLC3',), '0F 01 00 00 01 00 2D 04 01 00 00 02', ALL),
    (('PLC3',), '0F 01 00 00 01 00 2C 0B 00 00 02', ALL),
    *((('PLC3',), f'0F 01 00 00 01 00 2C {section} 00 00 02', READ)
      for section in ('06', '0A', '0C')),
    # ASCII: "$N7:0", "$S:1", and a symbol.
    *(((*families,), '0F 01 00 00 01 00 00 24 4E 37 3A 30 00 02', READ)
      for families in ((), ('PLC5',), ('SLC',))),
    (('PLC3',), '0F 01 00 00 01 00 00 24 4E 37 3A 30 00 02', ALL),
    (('PLC5',), '0F 01 00 00 01 00 00 24 53 3A 31 00 02', READ),
    (('PLC5',), '0F 00 00 00 01 00 00 24 53 3A 31 00 11 22', ALL),
    (('PLC5',), '0F 01 00 00 01 00 00 41 42 43 00 02', ALL),
    # The clock: S:18 to S:23 of a PLC-5, S:37 to S:42 of an SLC, as six words and as one.
    (('PLC5',), '0F 67 00 00 06 00 06 02 12 99 09 0D 42' + 6 * ' 01 00', WRITE),
    (('PLC5',), '0F 00 05 00 06 00 06 02 12 11 22', WRITE),
    (('PLC5',), '0F 00 06 00 07 00 06 02 12 11 22', ALL),
    (('PLC5',), '0F 02 06 02 17 01 00 02 00', WRITE),
    (('PLC5',), '0F 26 06 02 12 FF FF 01 00 06 02 18 FF FF 01 00', ALL),
    (('PLC5',), '0F 02 06 02 25 01 00 02 00', ALL),
    (('SLC',), '0F AA 0C 02 84 25 00 01 00 02 00 03 00 04 00 05 00 06 00', WRITE),
    (('SLC',), '0F AA 0E 02 84 25 00 01 00 02 00 03 00 04 00 05 00 06 00 07 00', ALL),
    (('SLC',), '0F AA 02 02 84 24 00 01 00', ALL),
    (('SLC',), '0F A9 02 02 84 2A 01 00', WRITE),
    (('SLC',), '0F AB 02 02 84 25 05 00 FF 01 00', WRITE),
    (('SLC',), '0F AB 02 02 84 25 06 00 FF 01 00', ALL),
    (('SLC',), '0F 67 00 00 01 00 06 02 25 42 01 00', WRITE),
    ((), '0F 67 00 00 01 00 06 02 25 42 01 00', ALL),
    (('PLC5', 'SLC'), '0F 67 00 00 01 00 06 02 12 42 01 00', ALL),
    # S:29, the number of the fault routine (CVE-2017-14469).
    *((('SLC',), text, ALL) for text in (
        '0F AA 02 02 84 1D 00 03 00', '0F AA 04 02 84 1C 00 00 00 03 00',
        '0F A9 02 02 84 1D 03 00', '0F AB 02 02 84 1D 00 FF FF 03 00',
        '0F 67 00 00 01 00 06 02 1D 42 03 00', '0F 00 00 00 01 00 06 02 1D 03 00')),
    # Read-modify-write N as the manual has it: the length of the masks after each address.
    (('PLC5',), '0F 79 01 06 07 00 02 FF FF 01 00', WRITE),
    (('PLC5',), '0F 79 02 06 07 00 04 FF FF FF FF 01 00 00 00 06 09 00 02 FF FF 01 00', WRITE),
    (('PLC5',), '0F 79 02 06 07 00 02 FF FF 01 00 06 02 01 02 FF FF 01 00', ALL),
    (('PLC5',), '0F 79 01 06 02 16 04 FF FF FF FF 01 00 00 00', WRITE),
    (('PLC5',), '0F 79 01 06 02 17 04 FF FF FF FF 01 00 00 00', ALL),
    (('PLC5',), '0F 79 01 06 07 00 03 FF FF FF 01 00 00', ALL),
    (('PLC5',), '0F 79 00', ALL), (('PLC5',), '0F 79 01 06 07 00 02 FF FF 01 00 01', ALL),
    # A file is known by its number, whatever type the command names.
    (('SLC',), '0F AA 02 02 89 01 00 00 20', ALL), (('SLC',), '0F AA 02 07 84 01 00 00 20', ALL),
    (('SLC',), '0F AA 02 00 89 01 00 00 20', ALL), (('SLC',), '0F AA 02 00 8B 01 00 00 20', WRITE),
    (('SLC',), '0F AA 02 01 83 01 00 00 20', WRITE), (('SLC',), '0F A2 02 01 82 01 00', ALL),
    (('SLC',), '0F AA 02 FF FF 00 89 01 00 00 20', WRITE),
    (('SLC',), '0F AA 02 FF 02 01 89 01 00 00 20', ALL),  # file 258
    (('PLC5',), '0F 00 00 00 01 00 06 FF E8 03 00 11 22', ALL),  # file 1000
    # All types of data files.
    *((('SLC',), f'0F A{"A" if is_write else "2"} 02 09 {code:02X} 00 00' + ' 11 22' * is_write,
       WRITE if is_write else READ) for is_write in (False, True)
      for code in (0x85, 0x86, 0x87, 0x88, 0x89, 0x8A, 0x8D, 0x8E, 0x8F, 0x91, 0x92, 0x93)),
    # Function files may be read, and nothing else that is no data file.
    *((('SLC',), f'0F A2 02 00 {code:02X} 00 00',
       READ if code in (0x48, 0x4A, 0x6A, 0xE0, 0xE2, 0xE3, 0xE4, 0xE5, 0xE6, 0xEC, 0xED, 0xEE)
       else ALL) for code in (*range(3, 0x82), *range(0x94, 256))),
    *((('SLC',), f'0F AA 02 00 {code:02X} 00 00 11 22', ALL)
      for code in (*range(0x82), *range(0x94, 256))),
    # What cannot be read.
    (('SLC',), '0F AA 02 07 89 00 00 11 22 33', ALL), (('SLC',), '0F AA 04 07 89 00 00 11', ALL),
    (('SLC',), '0F A2 02 07', ALL), (('SLC',), '0F A2 02 07 89 00 00 00', READ),  # it is padded
    (('SLC',), '0F A2 02 07 89 00 00 01', ALL), (('PLC5',), '0F 29 06 07 00 01', ALL),
    (('SLC',), '06 03 01', ALL), (('SLC',), '06 01 00 00 0A 01', ALL), (('SLC',), '06 09', ALL),
    (('PLC5',), '0F 67 00 00 01 00 06 07 00 FF', ALL),
    (('PLC5',), '0F 02 06 07 00 01 00 01 00', ALL), (('PLC2',), '05 00 00 01', ALL)])
def test_address_decides_and_rows_tell_its_family(
        entry: tuple[Sequence[str], str, ShareAccess]) -> None:
    families, text, right = entry
    assert needed(text, families) is right


def test_no_other_command_needs_less_than_all_whatever_follows_it() -> None:
    """What a manual does not name, as CVE-2021-33012 and CVE-2017-7924 are about."""
    named = {0x06: bytes.fromhex('00 01 03 09'), 0x07: b'', 0x0F: bytes.fromhex(
        '00 01 02 03 04 26 29 67 68 79 A1 A2 A9 AA AB')}
    bodies = ('', '00', '02 07 89 00 00', '02 07 89 00 00 11 22', '00 00 01 00 06 07 00 02')
    for body in bodies:
        for cmd in set(range(256)) - {0, 1, 2, 5, 8, *named}:
            if not cmd & 0x60:  # a priority command counts as any other, and a reply is none
                assert needed(f'{cmd:02X} {body}', ('SLC',)) is ALL
        for cmd, functions in named.items():
            for function in set(range(256)) - {*functions}:
                assert needed(f'{cmd:02X} {function:02X} {body}', ('SLC',)) is ALL


@for_all('entry', [
    (None, (), {1, 2}), (Processor.SLC_5_05, (), {1}), (None, ('5/03',), {1}),
    (Processor.ML1100, (), {2}), (Processor.ML1400, (), {3}), (None, ('ML1400',), {3}),
    (None, ('ML1400', 'ML1100'), {1, 2}), (Processor.ML1400, ('5/03',), {3}),
    (Processor.SLC_5_01, (), set()), (Processor.ML1000, (), set())])
def test_list_of_files_is_file_0_of_the_type_of_this_processor(
        entry: tuple[Processor | None, Sequence[str], set[int]]) -> None:
    told, processors, types = entry
    for code in range(4):
        right = READ if code in types else ALL
        for text in (f'0F A2 50 00 {code:02X} 00 00', f'0F A1 50 00 {code:02X} 22'):
            assert needed(text, (), told, processors) is right
        assert needed(f'0F A2 50 01 {code:02X} 00 00', (), told, processors) is ALL
        assert needed(f'0F AA 02 00 {code:02X} 00 00 11 22', (), told, processors) is ALL


@for_all('entry', [
    (2, ('PLC5',), ALL), (2, (), ALL), (2, ('SLC',), WRITE), (2, ('PLC2',), WRITE),
    (2, ('PLC3',), WRITE), (3, ('PLC5',), WRITE), (9, (), WRITE)])
def test_plc2_write_goes_to_the_file_of_our_number_in_a_plc5(
        entry: tuple[int, Sequence[str], ShareAccess]) -> None:
    sender, families, right = entry
    for text in ('00 02 00 11 22', '08 02 00 11 22', '02 02 00 01 00', '05 02 00 01 00'):
        assert needed(text, families, sender=sender) is right
    assert needed('01 02 00 02', families, sender=sender) is READ


def test_recorded_programs_need_all_for_modes_settings_and_status_words_alone() -> None:
    """Seven other drivers, which read and write as an HMI does: vectors/captures."""
    others = set()
    for capture in CAPTURES:
        row = make_mapping(ROWS[capture.family.value], plc=capture.family.value)
        for exchange in capture.exchanges():
            command = exchange.command
            rules = GuestRules(Network(station=command.src), Rows([row]), lambda station: None)
            if rules.right_needed(command._replace(dst=row.station)) is ALL:
                others.add(describe(command).partition(' = ')[0])
    assert others == {
        'read file information 06 80 07', 'set NAKs 03', 'set CPU mode 02', 'change mode 06',
        'disable forces', 'typed write S2:10', 'word range write S2:10',
        'protected typed logical write S2:10', 'masked write S2:10 mask FFFF',
        'read-modify-write, elements of N run from 0 to 1999: '
        '26 00 24 4E 37 3A 39 39 39 39 00 EF FF 01 80'}


@given(st.sampled_from([*known_commands()]), st.binary(max_size=20),
       st.frozensets(st.sampled_from([PlcType.PLC2, PlcType.PLC3, PlcType.PLC5, PlcType.SLC])))
def test_command_has_no_target_that_its_form_does_not_name(
        code: tuple[int, int | None], data: bytes, families: frozenset[PlcType]) -> None:
    cmd, function = code
    parameters = b'' if function is None else bytes((function,))
    found = targets_of(Packet(1, 9, cmd, 0, 1, parameters + data), Partner(families))
    assert found <= {*known_commands()[code].reach.kinds, Target.OTHER}
    assert targets_of(Packet(1, 9, cmd, 1, 1, parameters + data), Partner(families)) == {
        Target.OTHER}
