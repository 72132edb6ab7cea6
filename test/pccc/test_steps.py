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

"""Steps with a station, what becomes of the answers, and STS and EXT STS in words."""

from itertools import product

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, PortLost, RemoteError
from abdf1_ros.pccc import plc2, plc3, slc
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_search import is_there
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import check_status, is_address_fault, Meanings, USUAL_MEANINGS
from abdf1_ros.pccc.steps import AddressedValues, echo, identify, read, write
from abdf1_ros.pccc.values import ValueType
import pytest
from support.cases import for_all

SLC = PlcType.SLC
FAULTED = FAMILIES[PlcType.PLC5].encode_identity(EmulatedProcessor(Setting.FAULT))


def reply(data: bytes = b'', sts: int = 0) -> Packet:
    return Packet(5, 1, 0x4F, sts, 7, data)


def requests_of(steps: Steps[object], *answers: Packet) -> list[str]:
    """Return the requests as bytes, when each has been answered."""
    found = [next(steps)]
    for answer in answers:
        try:
            found.append(steps.send(answer))
        except StopIteration:
            break
    return [data.hex(' ').upper() for _, data in found]


def test_packets_are_those_of_the_processor() -> None:
    for kind, processor, sizes in (
            ('int16', None, [236, 14]), ('int16', Processor.SLC_5_01, [82, 82, 82, 4]),
            ('int32', Processor.SLC_5_01, [80] * 6 + [20]),
            ('float32', Processor.ML1400, [204, 44])):
        length = sum(sizes) // (2 if kind == 'int16' else 4)
        values = AddressedValues.of('N7:0', SLC, length, ValueType(kind), processor=processor)
        found = requests_of(read(values), *(reply(bytes(size)) for size in sizes))
        assert [int(request.split()[1], 16) for request in found] == sizes


def test_values_across_elements_are_read_in_whole_elements() -> None:
    values = AddressedValues.of('T4:1.ACC', SLC, 3)
    assert requests_of(read(values), reply(bytes(12))) == ['A2 0C 04 86 01 00']
    steps = read(values)
    next(steps)
    with pytest.raises(StopIteration, match=r'\[1284, 1798, 2312\]'):  # words 2 to 4 of the six
        steps.send(reply(bytes(range(12))))
    for values, request in (
            (AddressedValues.of('T4:1.ACC', SLC), 'A2 02 04 86 01 02'),
            (AddressedValues.of('PD9:1.SP', PlcType.PLC5), '68 00 00 01 00 0E 09 01 02 01 00'),
            (AddressedValues.of('T4:1.ACC', PlcType.PLC5, 3, access=Access.WORD_RANGE),
             '01 00 00 06 00 06 04 01 0C')):
        assert requests_of(read(values)) == [request]


def test_refused_or_odd_reply_is_no_file_and_leaves_an_identity_as_it_was() -> None:
    values = AddressedValues.of('N7:0', SLC)
    for odd in (reply(b'\1'), reply(sts=0x10), reply(b'\x11', 0xF0), reply(b'\x12', 0xF0)):
        assert len(requests_of(is_there(values.address, values.dialect), odd)) == 1
        assert len(requests_of(identify(), reply(FAULTED), odd)) == 2  # an old PLC-5
    # A gateway has lost its PLC, no buffer, access denied, owned by another node.
    for refused in (reply(sts=0x02), reply(sts=0x90), reply(b'\x0B', 0xF0), reply(b'\x1A', 0xF0)):
        for steps in is_there(values.address, values.dialect), identify():
            with pytest.raises(RemoteError):
                requests_of(steps, refused)


def test_echo_is_what_was_sent() -> None:
    for told, expected in ((b'\1\2', StopIteration), (b'\1\3', FormatError), (b'', FormatError)):
        steps = echo(b'\1\2')
        next(steps)
        with pytest.raises(expected):
            steps.send(reply(told))


def test_write_stops_at_the_first_failure_and_tells_what_was_written_before() -> None:
    for done, error in product((0, 1), (None, PortLost('closed', sent=False))):
        steps = write(AddressedValues.of('N7:0', SLC, 250), [*range(250)])
        assert next(steps)[1][:2] == bytes((0xAA, 234))
        assert not done or steps.send(reply())
        with pytest.raises((RemoteError, PortLost)) as caught:
            steps.throw(error) if error else steps.send(reply(b'\x0B', 0xF0))
        assert error or 'EXT STS 0B: access denied' in str(caught.value)
        assert str(caught.value).endswith(' (after 1 of 3 packets were written)') == done
        assert getattr(caught.value, 'sent', done) == done


def test_what_must_not_be_written_is_refused_before_the_first_step() -> None:
    with pytest.raises(FormatError, match='HSC:0.ACC belongs to the processor'):
        write(AddressedValues.of('HSC:0.ACC', SLC), [1])
    for text, length, fault in (('PD9:0.SP', 25, '25 float32 from PD9:0.SP reach to PD9:0.50'),
                                ('C5:3/UN', 6, 'bits of a structure end with their word'),
                                ('N7:0', 0, '0 elements do not fit at N7:0'),
                                ('F8:1999', 2, r'2 float32 \(4 words\) do not fit at F8:1999; '),
                                ('ST9:0', 2, 'each string needs its own call, with length 1')):
        with pytest.raises(FormatError, match=f'^{fault}'):
            AddressedValues.of(text, PlcType.PLC5, length)
    with pytest.raises(FormatError, match='2 values'):
        write(AddressedValues.of('N7:0', SLC), [1, 2])


@for_all(('text', 'length', 'access', 'sts', 'told'), [
    ('I:1.0', 1, None, 0x10, 'Access Flat'), ('O:2.0', 1, Access.SLOT, 0x50, 'Access Flat'),
    ('I:1.0', 1, None, 0x60, ''), ('I:5', 1, Access.FLAT, 0x10, ''),
    ('N7:0', 41, None, 0x10, ''), ('N7:0', 42, None, 0x50, ''),
    ('N7:0', 42, None, 0x10, 'too many words at once for this processor')])
def test_refused_inputs_by_slot_and_long_reads_lead_to_what_may_help(
        text: str, length: int, access: Access | None, sts: int, told: str) -> None:
    steps = read(AddressedValues.of(text, SLC, length, access=access))
    next(steps)
    with pytest.raises(RemoteError) as refusal:
        steps.send(reply(sts=sts))
    assert [text for text in ('Access Flat', 'too many words at once for this processor')
            if text in str(refusal.value)] == [*filter(None, [told])]


def failure(sts: int, data: bytes = b'', meanings: Meanings = USUAL_MEANINGS) -> RemoteError:
    """Return the error that a reply with this status is."""
    with pytest.raises(RemoteError) as caught:
        check_status(Packet(0, 1, 0x4F, sts, 1, data), meanings)
    return caught.value


@for_all(('sts', 'data', 'ext_sts', 'text'), [
    (0x50, b'\x01', None, 'STS 50: address not there, or memory protected'),
    (0x15, b'', None, 'STS 15: illegal command, format or length, or the file does not exist; '
                      'no reply in time (application timeout)'),
    (0xF0, b'\x06\x00', 0x06, 'STS F0 EXT STS 06: address does not point to something usable'),
    (0xF2, b'\x07', 0x07, 'STS F2 EXT STS 07: file has the wrong size'),
    (0xF0, b'\x1A\x07', 0x1A, 'STS F0 EXT STS 1A: file is open, owned by another node (7)'),
    (0xF0, b'\x1B\x1F', 0x1B, 'STS F0 EXT STS 1B: program is owned by another node (31)'),
    (0xF0, b'\x1B', 0x1B, 'STS F0 EXT STS 1B: program is owned by another node'),
    (0x50, b'\x1B\x1F', None, 'STS 50: address not there, or memory protected'),
    (0xF0, b'\x00', 0x00, 'STS F0 EXT STS 00: unknown code'),
    (0xF0, b'', None, 'STS F0: extended status missing from the reply'),
    (0xD0, b'', None, 'STS D0: unknown code'),
    (0x0F, b'', None, 'STS 0F: unknown code')])
def test_failure_in_words(sts: int, data: bytes, ext_sts: int | None, text: str) -> None:
    error = failure(sts, data)
    assert (error.sts, error.ext_sts, str(error)) == (sts, ext_sts, text)


def test_extended_codes_with_words_are_those_of_the_manual() -> None:
    """M 8-4."""
    assert [code for code in range(0x100) if 'unknown code' not in str(
        failure(0xF0, bytes((code,))))] == [*range(0x01, 0x1C), 0x1E, 0x1F, 0x22, 0x23, 0x24]


def test_refusal_of_the_address_and_for_another_reason() -> None:
    extended = [(0xF0, bytes((code,))) for code in (1, 2, 3, 4, 5, 6, 7, 9, 10, 0x13, 0x17, 0x1E)]
    assert all(is_address_fault(failure(*of)) for of in [(0x10,), (0x50,), *extended])
    assert not any(is_address_fault(failure(*of)) for of in (
        (0x05,), (0x60,), (0x70,), (0xF0,), (0xF0, b'\x0B'), (0xF0, b'\x1F')))


@for_all(('meanings', 'of', 'codes'), [
    # M 8-2, 8-3
    (USUAL_MEANINGS, '', """
        01 buffer, 02 acknowledge, 03 token, 04 disconnected, 05 timeout, 06 duplicate,
        07 off line, 08 hardware, 10 illegal, 20 does not communicate, 30 missing, 40 in the host,
        50 memory protected, 60 protection setting, 70 program mode, 80 compatibility,
        90 cannot buffer, A0 buffer full, B0 download, C0 buffer full"""),
    # M 8-4
    (USUAL_MEANINGS, 'F0 EXT STS ', """
        01 illegal value, 02 fewer, 03 more, 04 not found, 05 badly formed, 06 usable,
        07 wrong size, 08 changed, 09 too large, 0A plus word address, 0B privilege,
        0C cannot be produced, 0D exists already, 0E executed, 0F histogram, 10 no access,
        11 data type, 12 parameter, 13 deleted, 14 unknown reason, 15 conversion, 16 rack adapter,
        17 type mismatch, 18 from the module, 19 label, 1A file is open, 1B program is owned,
        1E is protected, 1F temporary, 22 rack fault, 23 timeout, 24 unknown error"""),
    # M 8-5
    (plc2.MEANINGS, '', """
        20 verified, 30 attention, 40 between module and PLC, 50 window, 60 switch,
        70 program mode, 80 inhibited"""),
    (slc.MEANINGS, 'F0 EXT STS ', """
        07 memory module, 0B denied, 0C not available, 0E executed, 12 bad parameter,
        14 while it was, 19 label, 1A file is open, 1B program is owned"""),
    # M 8-6..8-10
    (plc3.MEANINGS, '', '30 shutdown, 40 backplane, 50 65535 words, 60 keyswitch, 70 program'),
    (plc3.MEANINGS, 'F0 EXT STS ', """
        04 symbol, 05 symbol, 06 file or word, 07 words of the transaction, 09 past the end,
        0A 65535, 1E is protected""")])
def test_meanings_of_the_manual(meanings: Meanings, of: str, codes: str) -> None:
    for code, words in (entry.split(' ', 1) for entry in ' '.join(codes.split()).split(', ')):
        number = int(code, 16)
        error = failure(0xF0, bytes((number,)), meanings) if of else failure(number, b'', meanings)
        assert str(error).startswith(f'STS {of}{code}: ')
        assert words in str(error)


def test_members_are_written_one_by_one_and_never_into_those_of_the_processor() -> None:
    preset = AddressedValues.of('T4:1.PRE', SLC, 2)
    assert requests_of(write(preset, [5, 6]), reply()) == [
        'AA 02 04 86 01 01 05 00', 'AA 02 04 86 01 02 06 00']
    with pytest.raises(FormatError, match='^T4:2 belongs to the processor; '):
        write(AddressedValues.of('T4:1.ACC', SLC, 2), [5, 6])


@for_all(('kind', 'sizes'), [(ValueType.INT32, [80, 4]), (ValueType.INT16, [82, 2])])
def test_no_packet_divides_a_value(kind: ValueType, sizes: list[int]) -> None:
    length = sum(sizes) // 2 // kind.words
    values = AddressedValues.of('N7:0', SLC, length, kind, processor=Processor.ML1000)
    found = requests_of(write(values, [0] * length), reply())
    assert [int(request.split()[1], 16) for request in found] == sizes


def test_access_of_a_target_chooses_its_command() -> None:
    values = AddressedValues.of('N7:0', PlcType.PLC5, 130, access=Access.WORD_RANGE)
    assert requests_of(read(values), reply(bytes(244)), reply(bytes(16))) == [
        '01 00 00 82 00 06 07 00 F4', '01 7A 00 82 00 06 07 00 10']
    assert [request[:23] for request in requests_of(write(values, [0] * 130), reply())] == [
        '00 00 00 82 00 06 07 00', '00 74 00 82 00 06 07 00']
