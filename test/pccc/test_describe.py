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

"""Commands and replies in words."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.describe import command_codes, command_name, describe, Effect, effect_of
from support.cases import for_all


def command(data: str, cmd: int = 0x0F) -> Packet:
    return Packet(1, 5, cmd, 0, 0x1234, bytes.fromhex(data))


@for_all(('data', 'text'), [
    ('A2 08 07 89 1E 00', 'protected typed logical read N7:30, 4 words'),
    ('A2 06 05 87 02 02', 'protected typed logical read C5:2.ACC, 3 words'),
    ('A2 0C 04 86 01 00', 'protected typed logical read T4:1, 2 elements'),
    ('A2 02 04 86 01 03', 'protected typed logical read T4:1 + 3 words, 1 word'),
    ('A2 08 08 8A 04 00', 'protected typed logical read F8:4, 2 elements'),
    ('A2 02 01 8C 01 03', 'protected typed logical read I:1.3, 1 word'),
    ('A2 54 09 8D 01 00', 'protected typed logical read ST9:1, 1 element'),
    ('A2 04 07 89 1E 02', 'protected typed logical read N7:30 + 2 words, 2 words'),
    ('A2 03 07 89 FF 00 01 00', 'protected typed logical read N7:256, 3 bytes'),
    ('A2 04 00 82 07 00', 'protected typed logical read file 0 type 82 element 7, 2 words'),
    ('AA 04 07 89 00 00 01 00 FF FF', 'protected typed logical write N7:0 = 1 -1'),
    ('AA 04 08 8A 00 00 00 00 AC 41', 'protected typed logical write F8:0 = 21.5'),
    ('AA 04 0A 91 00 00 90 EE FE FF', 'protected typed logical write L10:0 = -70000'),
    *((f'AA 02 {code} 02 01 F4 01', f'protected typed logical write {place} = 500')
      for code, place in (('04 86', 'T4:2.PRE'), ('05 87', 'C5:2.PRE'), ('06 88', 'R6:2.LEN'))),
    ('AA 02 05 87 02 00 00 20', 'protected typed logical write C5:2 = 2000'),
    ('AA 03 07 89 00 00 01 02 03', 'protected typed logical write N7:0 = 01 02 03'),
    ('AB 02 03 85 01 00 08 00 08 00', 'masked write B3:1 mask 0008 = 0008'),
    ('68 00 00 0A 00 07 00 07 00 0A 00', 'typed read N7:0, 10 elements'),
    ('68 00 00 01 00 0F 00 04 02 02 01 00', 'typed read T4:2.ACC, 1 element'),
    ('68 00 00 01 00 07 00 00 0A 01 00', 'typed read O:012, 1 element'),
    ('68 00 00 01 00 07 00 0A 05 01 00', 'typed read file 10:5, 1 element'),
    ('68 00 00 01 00 0F 00 0C 0A 00 01 00', 'typed read file 12:10.0, 1 element'),
    ('68 0A 00 1E 00 07 00 07 00 0A 00', 'typed read N7:0, 10 elements (from 10 of 30)'),
    ('67 00 00 02 00 07 00 07 05 95 09 42 01 00 FE FF', 'typed write N7:5 = 1 -2'),
    ('67 00 00 01 00 07 00 0A 05 99 09 06 94 08 00 00 AC 41', 'typed write F10:5 = 21.5'),
    ('67 00 00 01 00 07 00 07 00 42', 'typed write N7:0 = nothing (from 0 of 1)'),
    ('AA 00 07 89 00 00', 'protected typed logical write N7:0 = nothing'),
    ('67 00 00 01 00 07 00 03 05 93 09 42 10 00', 'typed write B3:5 = 0010'),
    ('26 07 00 03 01 F7 FF 08 00', 'read-modify-write B3:1 AND FFF7 OR 0008'),
    ('26 07 00 03 01 F7 FF 08 00 07 00 03 02 FF FF 01 00',
     'read-modify-write B3:1 AND FFF7 OR 0008, B3:2 AND FFFF OR 0001'),
    ('A2 02 07 89 1E 00 01 00', 'protected typed logical read, malformed (2 bytes too many): '
     'A2 02 07 89 1E 00 01 00'),
    ('A1 02 07 89 1E', 'protected typed logical read N7:30, 1 word'),
    ('A9 02 07 89 1E 05 00', 'protected typed logical write N7:30 = 5'),
    ('01 00 00 0A 00 07 00 07 00 14', 'word range read N7:0, 10 words'),
    ('01 72 00 56 01 2C 08 FF 04 01 00 E4',
     'word range read B260:0, 114 words (from 114 of 342)'),
    ('01 00 00 01 00 2C 06 02 03 02', 'word range read E3.1.6.2.0.3, 1 word'),
    ('01 00 00 01 00 00 50 55 4D 50 00 02', 'word range read symbol PUMP, 1 word'),
    ('01 00 00 01 00 00 24 50 55 4D 50 00 02', 'word range read symbol PUMP, 1 word'),
    ('00 00 00 01 00 00 50 55 4D 50 00 02 00', 'word range write symbol PUMP = 0002'),
    ('01 00 00 01 00 00 24 4E 37 3A 33 00 02', 'word range read N7:3, 1 word'),
    ('01 00 00 01 00 00 00 02', 'word range read, malformed (a symbol; an address in ASCII begins '
     'with "$"): 01 00 00 01 00 00 00 02'),
    ('01 00 00 01 00 2E 01 08 0A 00 02', 'word range read B10:0, 1 word'),
    ('01 00 00 01 00 34 03 04 02 02', 'word range read T:4.ACC, 1 word'),
    ('01 00 00 01 00 2C 03 00 02 02', 'word range read T:0.ACC, 1 word'),
    ('01 00 00 01 00 34 03 04 03 02', 'word range read E3.1.3.0.4.3, 1 word'),
    ('01 00 00 01 00 3C 08 0A 02 05 02', 'word range read E3.1.8.10.2.5, 1 word'),
    ('00 00 00 02 00 07 00 07 05 01 00 FF FF', 'word range write N7:5 = 0001 FFFF'),
    ('02 07 00 03 01 08 00 01 00', 'bit write B3:1 set 0008 reset 0001'),
    ('04 00 00 04 00 0C 08 0A 08', 'file read B10:0, 4 words'),
    ('68 00 00 01 00 0F 03 03 0A 00 01 00', 'typed read, memory area 3 is not the data table: '
     '68 00 00 01 00 0F 03 03 0A 00 01 00')])
def test_data_table_commands(data: str, text: str) -> None:
    assert describe(command(data)) == text
    assert describe(command(data, 0x2F)) == text  # with high priority


@for_all(('cmd', 'data', 'text'), [
    (0x01, '20 00 02', 'unprotected read 020 (ADDR 32), 2 bytes'),
    (0x08, '12 00 FF FF', 'unprotected write 011 (ADDR 18) = FFFF'),
    (0x08, '12 00', 'unprotected write 011 (ADDR 18) = nothing'),
    (0x00, '12 00 01 02 03', 'protected write 011 (ADDR 18) = 01 02 03'),
    (0x05, '20 00 08 01', 'unprotected bit write 020 (ADDR 32) low byte set 08 reset 01'),
    (0x02, '20 00 08 01 21 00 00 80', 'protected bit write 020 (ADDR 32) low byte set 08 '
     'reset 01, 020 (ADDR 33) high byte set 00 reset 80'),
    (0x06, '01 00 00 1C', 'read diagnostic counters at 0, 28 bytes'),
    (0x06, '07', 'reset diagnostic counters'), (0x0F, '3A 02', 'set CPU mode 02'),
    (0x07, '04', 'enter download mode'), (0x04, '01 02', 'physical read 01 02'),
    (0x06, '00 01 02', 'echo 01 02'), (0x06, '03', 'diagnostic status'),
    (0x0F, 'E7 01 02', 'command 0F/E7 01 02'), (0x0F, 'E7', 'command 0F/E7'),
    (0x0F, '', 'command 0F'), (0x0E, '01 02', 'command 0E 01 02')])
def test_command_without_fnc_is_described(cmd: int, data: str, text: str) -> None:
    assert describe(command(data, cmd)) == text


def test_codes_of_commands_are_those_of_the_manual() -> None:
    """M 7-2, 7-3; 0A and 0B: 1756-PM020F p. 75; 0F/94 and 0F/A3: practice."""
    expected = """
        00 protected write, 01 unprotected read, 02 protected bit write, 03 physical write,
        04 physical read, 05 unprotected bit write,
        06/00 echo, 06/01 read diagnostic counters, 06/02 set variables, 06/03 diagnostic status,
        06/04 set timeout, 06/05 set NAKs, 06/06 set ENQs, 06/07 reset diagnostic counters,
        06/08 set data table size, 06/09 read link parameters, 06/0A set link parameters,
        07/00 disable outputs, 07/01 enable outputs, 07/03 enable scan,
        07/04 enter download mode, 07/05 exit download or upload mode, 07/06 enter upload mode,
        08 unprotected write, 0A connected CIP message, 0B unconnected CIP message,
        0F/00 word range write, 0F/01 word range read, 0F/02 bit write, 0F/03 file write,
        0F/04 file read, 0F/05 download request, 0F/06 upload request, 0F/07 shut down,
        0F/08 physical write, 0F/09 physical read, 0F/0A restart, 0F/11 get edit resource,
        0F/12 return edit resource, 0F/17 read bytes physical, 0F/18 write bytes physical,
        0F/26 read-modify-write, 0F/29 read section size, 0F/3A set CPU mode,
        0F/41 disable forces, 0F/50 download all, 0F/52 download completed, 0F/53 upload all,
        0F/55 upload completed, 0F/57 initialize memory, 0F/5E modify compatibility file,
        0F/67 typed write, 0F/68 typed read, 0F/79 read-modify-write N, 0F/80 change mode,
        0F/81 open file, 0F/82 close file, 0F/88 execute command list,
        0F/8F apply port configuration, 0F/94 read file information,
        0F/A1 protected typed logical read, 0F/A2 protected typed logical read,
        0F/A3 read of words by physical address, 0F/A7 protected typed file read,
        0F/A9 protected typed logical write, 0F/AA protected typed logical write,
        0F/AB masked write, 0F/AF protected typed file write"""
    assert [f'{cmd:02X}' + ('' if fnc is None else f'/{fnc:02X}') + f' {name}'
            for (cmd, fnc), name in command_codes().items()] == \
        ' '.join(expected.split()).split(', ')


@for_all(('cmd', 'effect', 'functions'), [
    (0x06, Effect.READS, '00 01 03 09'), (0x06, Effect.WRITES, ''),
    (0x06, Effect.KEEPS, '02 04 05 06 07'), (0x0F, Effect.KEEPS, '06 11 12 53 55 81 82'),
    (0x07, Effect.READS, ''), (0x07, Effect.WRITES, ''),
    (0x0F, Effect.READS, '01 04 09 17 29 68 94 A1 A2 A3 A7'),
    (0x0F, Effect.WRITES, '00 02 03 26 67 79 A9 AA AB')])
def test_no_other_command_counts_as_a_read_or_as_a_write_alone(
        cmd: int, effect: Effect, functions: str) -> None:
    """What reads only may pass where writes must not; of all others anything may change."""
    assert [fnc for fnc in range(256) if effect_of(command(f'{fnc:02X} 00 00', cmd)) is effect] \
        == [*bytes.fromhex(functions)]


@for_all('data', [
    'A2', 'A2 08 07', 'A2 08 07 89 1E 00 01', 'AA 04 07 89 00 00 01', '68 00 00 01 00 10',
    '67 00 00 01 00 07 00 07 00 42 01', '26', 'A9 02 07 89 1E 05 00 01'])
def test_malformed_commands_are_given_as_bytes(data: str) -> None:
    text = describe(command(data))
    assert ', malformed (' in text
    assert text.endswith(f'): {data}')


READ_REPLIES = (  # the command's data, the reply's, and its words
    ('A2 04 07 89 00 00', '34 12 FE FF', '4660 -2'),
    ('A2 04 03 85 00 00', '34 12 FE FF', '1234 FFFE'),
    ('A2 04 08 8A 00 00', '00 00 AC 41', '21.5'),
    ('A2 03 07 89 00 00', '01 02 03', '01 02 03'),
    ('A1 06 04 86 01', '00 E0 64 00 2A 00', 'E000 0064 002A'),
    ('AA 02 07 89 00 00 01 00', '', 'done'),
    ('68 00 00 02 00 07 00 07 00 02 00', '95 09 42 34 12 FE FF', '4660 -2'),
    ('68 00 00 01 00 07 00 03 00 01 00', '93 09 42 34 12', '1234'),
    ('68 00 00 01 00 07 00 08 00 01 00', '99 09 06 94 08 00 00 AC 41', '21.5'),
    ('68 00 00 01 00 07 00 07 00 01 00', '95 09', '95 09'),
    ('01 00 00 02 00 07 00 07 00 04', '34 12 FE FF', '1234 FFFE'),
    ('00 00 00 01', '01 02', '01 02'), ('E7', '01 02', '01 02'))
STATUS_REPLIES = (  # to diagnostic status
    ('00 EE 34 49 22 35 2F 30 33 20 20 20 20 20 20 20 00 00 06 00 00 00 10 00',
     'SLC 5/03 series B revision 3, REM RUN'),
    ('40 EE 34 95 22 35 2F 30 39 20 20 20 20 20 20 20 16 01 01 20 00 00 10 00',
     '5/09 series B revision 3, REM PROG; major error 0x0116, processor halted; testing edits'),
    ('00 EE 34 49 22 4C 49 4E 45 20 34 20 20 20 20 20 00 00 06 00 00 00 10 00',
     'SLC 5/03 series B revision 3, REM RUN; name LINE 4'),
    ('08 BB 00 80 01 00 42 07 FD 00 0C 00 05 00 00 00 00',
     'PLC-5/15 series C revision C, PROG; major processor fault (word S:11 says which)'),
    ('00 EE 10 10 00 00 34 12 42', '1785-KA series C revision C'),
    ('00 99 01 02 03 04 05 06 07 08', '00 99 01 02 03 04 05 06 07 08'), ('00', '00'))


@for_all(('cmd', 'asked', 'data', 'text'), [
    *((0x0F, *case) for case in READ_REPLIES), *((0x06, '03', *case) for case in STATUS_REPLIES)])
def test_reply_is_described_by_what_was_asked(cmd: int, asked: str, data: str, text: str) -> None:
    request = command(asked, cmd)
    assert describe(request.reply(bytes.fromhex(data)), request) == text


def test_refusal_is_described_by_sts_and_ext_sts() -> None:
    assert describe(command('').reply(sts=0x50)) == \
        'STS 50: address not there, or memory protected'
    assert describe(command('').reply(b'\x06', 0xF0)) == \
        'STS F0 EXT STS 06: address does not point to something usable'


def test_name_of_a_command_has_cmd_and_fnc() -> None:
    assert command_name(command('A2 02')) == '0F/A2'
    assert command_name(command('A2 02', 0x2F)) == '0F/A2'
    assert command_name(command('A2 02').reply(b'\x01')) == '0F'
    assert command_name(command('00 02', 0x01)) == '01'
    assert command_name(command('')) == '0F'
