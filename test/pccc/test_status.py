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

"""STS and EXT STS in words."""

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import RemoteError
from abdf1_ros.pccc import plc2, plc3, slc
from abdf1_ros.pccc.status import (
    check_status,
    is_address_fault,
    Meanings,
    status_text,
    USUAL_MEANINGS,
)
import pytest


def reply(sts: int, data: bytes = b'') -> Packet:
    """Return a reply with this status."""
    return Packet(0, 1, 0x4F, sts, 1, data)


def failure(sts: int, data: bytes = b'') -> RemoteError:
    """Return the error that a reply with this status is."""
    with pytest.raises(RemoteError) as caught:
        check_status(reply(sts, data))
    return caught.value


@pytest.mark.parametrize(('sts', 'data', 'ext_sts', 'text'), [
    (0x10, b'', None, 'STS 10: illegal command, format or length, or the file does not exist'),
    (0x50, b'\x01', None, 'STS 50: address not there, or memory protected'),
    (0x05, b'', None, 'STS 05: no reply in time (application timeout)'),
    (0x15, b'', None, 'STS 15: illegal command, format or length, or the file does not exist; '
                      'no reply in time (application timeout)'),
    (0xF0, b'\x17', 0x17, 'STS F0 EXT STS 17: type mismatch'),
    (0xF0, b'\x06\x00', 0x06, 'STS F0 EXT STS 06: address does not point to something usable'),
    (0xF2, b'\x07', 0x07, 'STS F2 EXT STS 07: file has the wrong size'),
    (0xF0, b'\x1A\x07', 0x1A, 'STS F0 EXT STS 1A: file is open, owned by another node (7)'),
    (0xF0, b'\x1B\x1F', 0x1B, 'STS F0 EXT STS 1B: program is owned by another node (31)'),
    (0xF0, b'\x1B', 0x1B, 'STS F0 EXT STS 1B: program is owned by another node'),
    (0x50, b'\x1B\x1F', None, 'STS 50: address not there, or memory protected'),
    (0xF0, b'\x00', 0x00, 'STS F0 EXT STS 00: unknown code'),
    (0xF0, b'\xEE', 0xEE, 'STS F0 EXT STS EE: unknown code'),
    (0xF0, b'', None, 'STS F0: extended status missing from the reply'),
    (0xD0, b'', None, 'STS D0: unknown code'),
    (0x0F, b'', None, 'STS 0F: unknown code'),
])
def test_failure_in_words(sts: int, data: bytes, ext_sts: int | None, text: str) -> None:
    error = failure(sts, data)
    assert (error.sts, error.ext_sts, str(error)) == (sts, ext_sts, text)


def test_extended_codes_with_words_are_those_of_the_manual() -> None:
    """M 8-4."""
    assert [code for code in range(0x100) if 'unknown code' not in str(
        failure(0xF0, bytes((code,))))] == [*range(0x01, 0x1C), 0x1E, 0x1F, 0x22, 0x23, 0x24]


@pytest.mark.parametrize(('sts', 'data'), [
    (0x10, b''), (0x50, b''), *((0xF0, bytes((code,))) for code in (
        1, 2, 3, 4, 5, 6, 7, 9, 10, 0x13, 0x17, 0x1E))])
def test_refusal_of_the_address(sts: int, data: bytes) -> None:
    assert is_address_fault(failure(sts, data))


@pytest.mark.parametrize(('sts', 'data'), [
    (0x05, b''), (0x60, b''), (0x70, b''), (0xF0, b''), (0xF0, b'\x0B'), (0xF0, b'\x1F')])
def test_refusal_for_another_reason(sts: int, data: bytes) -> None:
    assert not is_address_fault(failure(sts, data))


@pytest.mark.parametrize(('meanings', 'sts', 'ext_sts', 'meaning'), [
    (plc2.MEANINGS, 0x80, None, 'protected commands are inhibited'),
    (plc2.MEANINGS, 0x70, None, 'processor is in program mode'),
    (plc3.MEANINGS, 0x30, None, 'a shutdown was requested'),
    (plc3.MEANINGS, 0xF0, 0x09, 'past the end of the file'),
    (slc.MEANINGS, 0xF0, 0x0B, 'access denied'),
    (slc.MEANINGS, 0xF0, 0x0E, 'command cannot be executed'),
    (USUAL_MEANINGS, 0xF0, 0x0D, 'condition exists already, resource is already available'),
    (USUAL_MEANINGS, 0xF0, 0x0B, 'no access: privilege missing')])
def test_meanings_of_a_family(meanings: Meanings, sts: int, ext_sts: int | None,
                              meaning: str) -> None:
    """M 8-4, and M 8-5..8-10 for those that differ."""
    assert status_text(sts, ext_sts, meanings).endswith(f': {meaning}')
    data = b'' if ext_sts is None else bytes((ext_sts,))
    with pytest.raises(RemoteError, match=f': {meaning}$'):
        check_status(Packet(5, 1, 0x4F, sts, 1, data), meanings)
