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

"""Remarks about settings that are valid, but may have unexpected effects."""

from __future__ import annotations

from collections.abc import Iterator
import math

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import MIN_RESPONSE_TIME
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.address_range import names_word
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc5.address import USUAL_LAST_ELEMENT
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.structures import elements_text, value_addresses
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.problems import Problem
from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.described import described_otherwise
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.names import in_ascii
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import share_places, share_remarks
from abdf1_ros.settings.station_lists import octal_remarks
from abdf1_ros.text import shown

_ACK_SIZE = 2
_SHORT_PERIOD = 10  # ms; a smaller number was probably meant as seconds
_LONG_TIMEOUT = 10_000  # ms

# The effect of a write, by file type; for timers and counters, the effect of a write to a bit.
_WRITTEN = {
    FileType.INPUT: 'is an input: the PLC overwrites what is written there with its next scan',
    FileType.STATUS: 'is in the status file: a write may change how the processor runs',
    FileType.TIMER: 'is set anew by the instruction of the timer with each scan',
    FileType.COUNTER: 'is set anew by the instruction of the counter with each scan'}


def network_remarks(network: Network) -> Iterator[str]:
    """Yield remarks on the settings of a line."""
    yield from map(str, network.remarks)
    if network.data_bits < 8:
        yield (f'Data_Bits {network.data_bits}: DF1 sends bytes of 8 bits; with less the check of '
               'nearly every message fails')
    mode = network.line_mode
    if mode.waits_for_acks:
        yield from _time_remarks(network)
    is_radio = mode.duplex is Duplex.RADIO
    for column, is_idle, right in (
            ('Polling', not mode.is_master and network.polling != Network().polling, 'Master'),
            ('Store_Forward', not is_radio and network.store_forward, 'Radio'),
            ('Collision_Avoidance', not is_radio and network.collision_avoidance, 'Radio'),
            ('Listen_Port', not mode.only_listens and network.listen_port, 'Listen')):
        if is_idle:
            yield f'{column} is for Mode {right}; in Mode {network.mode} it has no effect'
    if is_radio and network.station in network.line.store_forward:
        yield (f'Store_Forward names our own Station {network.station}; it is for nodes that hear '
               'each other only through us')
    if network.share_access != Network().share_access and not network.share:
        yield 'Share_Access is for a line with Share; it has no effect without Share'
    yield from share_remarks(share_places(network.share))
    if network.share and network.share_access == 'All':
        yield 'Share_Access All: guests may change programs, passwords, modes and settings, too'


def _time_remarks(network: Network) -> Iterator[str]:
    least = (MIN_RESPONSE_TIME + _ACK_SIZE * network.timing.char_time) * 1000
    if network.timeout < least:
        yield (f'Timeout {network.timeout} ms: an ACK takes {least:.0f} ms on this line, '
               f'{MIN_RESPONSE_TIME * 1000:.0f} ms until a station answers and two characters at '
               f'{network.baud} baud; answers may come too late')
    if network.timeout > _LONG_TIMEOUT:
        yield (f'Timeout {network.timeout} is in ms: the line stands still for '
               f'{network.timeout / 1000:.0f} s whenever an answer gets lost')
    # TX_Delay passes before the command, and in half duplex also before the poll for the reply.
    times = 1 if network.duplex is Duplex.FULL else 2
    if times * network.tx_delay >= network.cmd_timeout:
        yield (f'TX_Delay {network.tx_delay} ms comes {"once" if times == 1 else "twice"} before '
               f'a reply can come, which is all of Cmd_Timeout {network.cmd_timeout} ms')


def row_remarks(row: Row, mapping: Mapping) -> Iterator[Problem]:
    """Yield remarks on a row of the map, each with its place."""
    yield from octal_remarks(row)
    yield from _name_remarks(row, mapping)
    yield from _useless_cells(row, mapping)
    address = mapping.address
    if mapping.plc_type is PlcType.SLC and not mapping.serves and mapping.processor is None \
            and not USUAL.has_file(address.file, address.file_type):
        yield _at(row, 'Address', f'{address}: a {USUAL.value}, the default of Processor, has no '
                                  f'such file; {having(address)} may have it')
    yield from _bcd_remarks(row, mapping)
    yield from described_otherwise(row, mapping)
    last = mapping.place_of(mapping.length - 1)
    if mapping.plc_type is PlcType.PLC5 and not mapping.serves \
            and last.element > USUAL_LAST_ELEMENT:
        yield _at(row, 'Address', f'{last}: files of most PLC-5 end with element '
                                  f'{USUAL_LAST_ELEMENT}; those of a 5/40 to 5/80 may have more')
    if not mapping.writes:
        return
    is_member = address.file_type.is_structure and address.bit is None
    if address.file_type in _WRITTEN and not mapping.serves and not is_member:
        yield _at(row, 'Command', f'{address} {_WRITTEN[address.file_type]}')
    if mapping.fallback is not None and mapping.processor and mapping.may_rewrite:
        yield _at(row, 'Fallback', f'{mapping.processor.value} may change bits by rewriting the '
                                   'whole word: what its program changes meanwhile is lost')
    low, high = mapping.limits
    if mapping.minimum < low and mapping.minimum != -math.inf:
        yield _at(row, 'Min', f'Min {mapping.minimum:.10g} is below {low:.10g}, the least that '
                              f'{mapping.type.value} can hold here')
    if mapping.maximum > high and mapping.maximum != math.inf:
        yield _at(row, 'Max', f'Max {mapping.maximum:.10g} is above {high:.10g}, the most that '
                              f'{mapping.type.value} can hold here')


def _bcd_remarks(row: Row, mapping: Mapping) -> Iterator[Problem]:
    address = mapping.address
    if address.file_type is FileType.BCD and not row.get('Type') and address.bit is None:
        yield _at(row, 'Type', f'{address} holds BCD, so an empty Type is {mapping.type.value}; '
                               'uint16 shows its words as they are')
    if mapping.plc_type is PlcType.PLC2 and mapping.type is ValueType.BCD16:
        yield _at(row, 'Type', f'{address}: a PLC-2 has three digits in a word, and status bits '
                               'above them: bcd12 reads and writes the digits alone')


def having(address: Address) -> str:
    """Return the names of the SLC and MicroLogix processors that may have such a file."""
    return ', '.join(processor.value for processor in Processor
                     if processor.has_file(address.file, address.file_type))


def _name_remarks(row: Row, mapping: Mapping) -> Iterator[Problem]:
    column = 'Topic' if row.get('Topic') else 'Tag'
    text = row.get(column)
    if text != mapping.topic:
        below = ', below ~/read/ and ~/write/' if text.startswith('/') else ''
        yield _at(row, column, f'{column} "{shown(text)}" becomes the topic '
                               f'{mapping.topic}{below}{_plain_advice(text)}')


def _plain_advice(text: str) -> str:
    """Return the advice for a text with letters that ROS does not allow, else empty."""
    plain = in_ascii(text)
    return f'; ROS takes A to Z, digits and _: {shown(plain)} in Topic reads better' \
        if plain != text else ''


def _useless_cells(row: Row, mapping: Mapping) -> Iterator[Problem]:
    """Yield cells that have no effect, or an effect that a newcomer does not expect."""
    for column in MAP_COLUMNS:
        name = column.name
        if mapping.command in column.idle and row.get(name) \
                and column.text(mapping) != column.default:
            yield _at(row, name, f'{name} has no effect in a {mapping.command.value} row')
    period = mapping.period or 0
    if 0 < period < _SHORT_PERIOD:
        yield _at(row, 'Period', f'Period {period} is in ms; {period} s would be {period * 1000}')
    address = mapping.address
    if address.file_type.is_structure and mapping.length == 1 and address.bit is None \
            and not names_word(row.get('Address')):
        yield _at(row, 'Address', f'{row.get("Address")} is the control word of the element; its '
                                  f'values are {", ".join(value_addresses(address))}')
    if control := _beyond_control(mapping):
        whole = elements_text(address, mapping.place_of(mapping.length - 1))
        yield _at(row, 'Length' if row.get('Length') else 'Address', (
            f'{mapping.length} words from {address} on are also the control word {control}'
            f'{whole and f"; whole elements are {whole}"}'))


def _beyond_control(mapping: Mapping) -> Address | None:
    """Return the control word that is among the values if they go on into the next element."""
    address = mapping.address
    if not address.file_type.is_structure or address.bit is not None or not address.word:
        return None
    last = mapping.place_of(mapping.length - 1)
    return None if last.element == address.element else \
        address.at_offset((address.element + 1) * address.layout.words)


def _at(row: Row, column: str, text: str) -> Problem:
    return Problem(row.where(column), text)
