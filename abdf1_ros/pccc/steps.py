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

"""Dialogues with a station, as steps: its identity, an echo, values read and written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, Request, Steps, Transfer
from abdf1_ros.pccc.families import decode_identity, dialect_of, FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.status import check_status, is_address_fault, STS_ILLEGAL_COMMAND
from abdf1_ros.pccc.structures import bits_fault, order_fault, type_fault, write_fault, wrong_type
from abdf1_ros.pccc.values import Codec, types_of, Values, ValueType, WordOrder
from abdf1_ros.text import counted

# From reports of libplctag's users about an SLC 5/05 and MicroLogix (its issues 121, 479 and 657).
_PERHAPS_FLAT = ('some SLC and MicroLogix have inputs and outputs with Access Flat only, by the '
                 'word of the whole image, as in I:5')


@dataclass(frozen=True, slots=True)
class AddressedValues:
    """Values in a PLC: their first address, their codec, and the dialect that moves them."""

    address: Address
    codec: Codec
    dialect: Dialect

    @classmethod
    def of(cls, text: str, plc_type: PlcType, length: int = 1, kind: ValueType | None = None, *,
           word_order: WordOrder = WordOrder.LOW, access: Access | None = None,
           processor: Processor | None = None) -> AddressedValues:
        """
        Return ``length`` values from the address ``text`` on; ``kind`` None: the natural type.

        Raises FormatError, saying what would be right.
        """
        address = parse_address(text, plc_type, access)
        kind = kind or types_of(address)[0]
        packed = kind is ValueType.STRING and address.file_type is not FileType.STRING
        codec = Codec(kind, length, address.bit or 0, word_order, packed)
        if fault := wrong_type(address, kind):
            raise FormatError(fault)
        if fault := order_fault(address, kind, word_order):
            raise FormatError(f'word order {fault}')
        if address.file_type is FileType.STRING and length != 1:
            raise FormatError('each string needs its own call, with length 1')
        if length < 1 or address.offset + codec.words > address.area_size:
            last = address.last_of_area
            what = counted(length, 'element') if kind.words < 2 else \
                f'{length} {kind.value} ({counted(codec.words, "word")})'
            raise FormatError(f'{what} {"does" if length == 1 else "do"} not fit at {address}; '
                              f'the last word there can be is {last}')
        if fault := bits_fault(address, kind, length) or type_fault(address, kind, length):
            raise FormatError(fault)
        return cls(address, codec, dialect_of(plc_type, access, processor))


def read(target: AddressedValues) -> Steps[Values]:
    """Return the values of a target; raises RemoteError, LinkError or FormatError."""
    address, words = target.address, target.codec.words
    first, count = address.offset, words
    if address.file_type.is_structure and not address.is_value(words):
        size = address.layout.words  # only whole elements can be read
        first -= first % size
        count = -(-(address.offset + words - first) // size) * size
    whole = Transfer(address.at_offset(first), count)
    most = _whole_values(target.dialect.max_read(address.file_type), target.codec)
    packets = (Transfer(address.at_offset(at), min(most, first + count - at))
               for at in range(first, first + count, most))
    data = yield from read_packets(packets, whole, target.dialect)
    skipped = 2 * (address.offset - first)
    return target.codec.decode(data[skipped:skipped + 2 * words])


def read_packets(packets: Iterable[Transfer], whole: Transfer, dialect: Dialect) -> Steps[bytes]:
    """Return the words of packets of a transfer; raises RemoteError, LinkError or FormatError."""
    data = b''
    for packet in packets:
        reply = yield dialect.read(packet.start, packet.words, whole)
        data += words_in(reply, packet.start, packet.words, dialect)
    return data


def words_in(reply: Packet, start: Address, words: int, dialect: Dialect) -> bytes:
    """Return the words in the reply to a read; raises RemoteError or FormatError."""
    try:
        data = data_of(reply, start)
    except RemoteError as error:
        if error.sts == STS_ILLEGAL_COMMAND and words > dialect.sure_read(start.file_type):
            raise RemoteError(error.sts, error.ext_sts, f'{error}, or too many words at once for '
                              'this processor: give its name as Processor') from None
        raise
    return dialect.read_data(start, words, data)


def data_of(reply: Packet, address: Address) -> bytes:
    """Return the data of a good reply; else raise RemoteError with the family's meaning."""
    if reply.sts == 0:
        return reply.data
    try:
        return check_status(reply, FAMILIES[address.plc_type].meanings)
    except RemoteError as error:
        if address.addressing.slot_of(address) is None or not is_address_fault(error):
            raise
        raise RemoteError(error.sts, error.ext_sts, f'{error}; {_PERHAPS_FLAT}') from None


def write(target: AddressedValues, values: Sequence[float] | str) -> Steps[None]:
    """
    Return the steps that write values; each packet is sent after the confirmation of the last.

    Raises FormatError at once if the values cannot or must not be written. The steps raise
    RemoteError if the PLC refuses a packet. If they raise LinkError, its ``sent`` tells whether
    the PLC may have executed a packet all the same. The text of both tells the packets before.
    """
    address, codec = target.address, target.codec
    if fault := write_fault(address, codec.type, codec.length):
        raise FormatError(fault)
    codec.check(values)
    return _confirmed(write_requests(address, codec, values, target.dialect), address)


def _confirmed(requests: Sequence[Request], address: Address) -> Steps[None]:
    for done, request in enumerate(requests):
        try:
            data_of((yield request), address)
        except (RemoteError, LinkError) as error:
            if done:
                error.done = written_before(done, len(requests))
                if isinstance(error, LinkError):
                    error.sent = True
            raise


def written_before(done: int, packets: int) -> str:
    """Return the end of the text about a write that ended after a part of its packets."""
    return f' (after {done} of {packets} packets were written)'


def write_requests(address: Address, codec: Codec, values: Sequence[float] | str,
                   dialect: Dialect) -> list[Request]:
    """Return the requests that write checked values."""
    if codec.type.is_part:
        assert not isinstance(values, str)
        return [dialect.write_bits(*change) for change in codec.bit_changes(address, values)]
    data = codec.encode(values)
    whole = Transfer(address, len(data) // 2)
    return [dialect.write(address.at_offset(address.offset + first),
                          data[2 * first:2 * (first + count)], whole)
            for first, count in _packets(address, codec, whole.words, dialect)]


def _whole_values(most: int, codec: Codec) -> int:
    """Return how many words of at most ``most`` a packet has, so that it divides no value."""
    return most - most % codec.element_words


def _packets(address: Address, codec: Codec, words: int,
             dialect: Dialect) -> list[tuple[int, int]]:
    """Return first word and number of words of each packet; no packet divides a value."""
    kind = address.file_type
    # Members of structures are written one by one: words between them may belong to the PLC.
    most = codec.element_words if kind.is_structure else dialect.max_write(kind)
    step = _whole_values(most, codec)
    return [(first, min(step, words - first)) for first in range(0, words, step)]


def identify() -> Steps[Identity]:
    """
    Ask a station for its identity; if its fault needs a second request, send this too.

    Raises LinkError, RemoteError, or FormatError for a reply too short to tell.
    """
    reply = yield diagnostics.CMD, diagnostics.STATUS_REQUEST
    identity = decode_identity(check_status(reply))
    inquiry = identity.inquiry
    if inquiry is None:
        return identity
    try:
        return inquiry.answered(check_status((yield inquiry.request)))
    except (RemoteError, FormatError):
        return identity  # an old PLC-5 without typed commands


def echo(data: bytes) -> Steps[None]:
    """Have a station send ``data`` back; FormatError when the reply differs."""
    reply = check_status((yield diagnostics.CMD, bytes((diagnostics.ECHO,)) + data))
    if reply != data:
        raise FormatError(f'the echo of {data.hex(" ")} came back as {reply.hex(" ")}')
