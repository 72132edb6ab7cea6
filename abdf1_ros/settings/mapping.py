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

"""A mapping: one PLC address that becomes a topic (S0, "Mapping")."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
import math

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, BITS
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import CIF_FILES, Processor
from abdf1_ros.pccc.steps import AddressedValues
from abdf1_ros.pccc.values import Codec, ValueType, WordOrder
from abdf1_ros.problems import Place, Problem
from abdf1_ros.settings.alarms import Alarm
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.scaling import Scaling

# Access of a Serve row whose words a PLC may only read.
READ_ONLY = 'Read'

# Period of a row that is read only when a call asks for it.
ON_DEMAND = 'on demand'


class Command(Enum):
    """The command of a mapping: read, write, serve or count."""

    READ = 'Read'
    WRITE = 'Write'
    READ_WRITE = 'ReadWrite'
    SERVE = 'Serve'
    HEARTBEAT = 'Heartbeat'


# Commands of rows that we poll, of rows that are published, and of rows that take messages.
POLLED = (Command.READ, Command.READ_WRITE)
PUBLISHED = (*POLLED, Command.SERVE)
MESSAGES = (Command.WRITE, Command.READ_WRITE, Command.SERVE)


class Publish(Enum):
    """The moment when a read value is published."""

    ALWAYS = 'Always'
    CHANGE = 'Change'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mapping:
    """
    One checked row; no two are equal, so a row can be a key.

    - ``item``: number of the data row, from 1; ``place``: file and line.
    - ``name``: the tag as a valid ROS name; ``topic``: the topic as a valid ROS name.
    - ``period``: ms between reads, 0 for as often as the line allows, None for the node's default.
    - ``is_on_demand``: the row has no period, and is read only by its service.
    - ``minimum``, ``maximum``: limits of written values, in the unit of the topic.
    - ``via``: gateway to the station, None for a station of the line itself.
    - ``is_read_only``: a PLC must not write the words of this Serve row.
    - ``alarm``, ``fallback``, ``condition``: None where the row has none.
    - ``deadband``: largest difference that is not published, in the unit of the topic.
    - ``max_silence``: ms after which an unchanged value is published again.
    - ``single_publisher``: no message is taken while the topic has more than one publisher.
    - ``write_again``: ms after which a value that the PLC holds is written again.
    - ``confirms``: tag of the heartbeat whose control the bit confirms, empty for none.
    - ``description``: free text; ``bits``: a name for each bit, or none at all.
    - ``remarks``: unusual settings of the row.
    """

    item: int
    place: Place
    tag: str
    name: str
    command: Command
    address: Address
    station: int
    plc_type: PlcType
    length: int = 1
    type: ValueType  # noqa: A003
    topic: str
    period: int | None = None
    is_on_demand: bool = False
    publish: Publish = Publish.ALWAYS
    minimum: float = -math.inf
    maximum: float = math.inf
    word_order: WordOrder = WordOrder.LOW
    scaling: Scaling | None = None
    access: Access | None = None
    processor: Processor | None = None
    is_read_only: bool = False
    via: int | None = None
    description: str = ''
    bits: tuple[str, ...] = ()
    fallback: Fallback | None = None
    condition: While | None = None
    confirms: str = ''
    alarm: Alarm | None = None
    deadband: float | None = None
    max_silence: int | None = None
    write_again: int | None = None
    single_publisher: bool = False
    remarks: tuple[Problem, ...] = ()
    # The codec and the dialect are made once: every read needs them.
    codec: Codec = field(init=False, repr=False)
    dialect: Dialect = field(init=False, repr=False)
    extent: Extent = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Make codec and extent, and find the dialect."""
        packed = self.type is ValueType.STRING \
            and self.address.file_type is not FileType.STRING
        codec = Codec(self.type, self.length, self.address.bit or 0, self.word_order, packed)
        object.__setattr__(self, 'codec', codec)
        object.__setattr__(self, 'dialect', dialect_of(self.plc_type, self.access, self.processor))
        first = self.address.offset
        object.__setattr__(self, 'extent', Extent(
            OUR_TABLE if self.serves else self.station, self.address.area, first,
            first + codec.words))

    @property
    def target(self) -> AddressedValues:
        """Return the values of the row in its PLC, as steps read and write them."""
        return AddressedValues(self.address, self.codec, self.dialect)

    @property
    def message_type(self) -> ValueType:
        """Return the type of the values on the topic."""
        return self.type if self.scaling is None else ValueType.FLOAT32

    @property
    def limits(self) -> tuple[float, float]:
        """Return the least and the greatest value that its type can hold, in the topic's unit."""
        return self.type.range if self.scaling is None else self.scaling.limits(self.type)

    def promise(self, stale_time: float) -> float:
        """
        Return the longest time (s) between two messages while values are good.

        Values are read at least every ``stale_time`` s. The time is infinite if the row promises
        none.
        """
        if self.is_on_demand:
            return math.inf
        if self.publish is Publish.ALWAYS:
            return stale_time
        return math.inf if self.max_silence is None else stale_time + self.max_silence / 1000

    @property
    def serves(self) -> bool:
        """Tell whether the words are ours, for the PLC to read and write."""
        return self.command is Command.SERVE

    @property
    def is_heartbeat(self) -> bool:
        """Tell whether the word is a counter that we write."""
        return self.command is Command.HEARTBEAT

    @property
    def is_guarded(self) -> bool:
        """Tell whether values are published only while a condition holds."""
        return self.reads and self.condition is not None

    @property
    def polls(self) -> bool:
        """Tell whether we read the words from the PLC."""
        return self.command in POLLED

    @property
    def reads(self) -> bool:
        """Tell whether values are published."""
        return self.command in PUBLISHED

    @property
    def writes(self) -> bool:
        """Tell whether values of messages are written."""
        return self.command in MESSAGES

    @property
    def changes(self) -> bool:
        """Tell whether we write the words, for messages or by ourselves."""
        return self.writes or self.is_heartbeat

    @property
    def may_rewrite(self) -> bool:
        """Tell whether parts of words may be changed by rewriting them after a refusal."""
        return self.type.is_part and self.processor is not None \
            and self.processor.may_lack_masked_write

    @property
    def is_alone(self) -> bool:
        """Tell whether no other row may write the words (rules 1 and 12)."""
        return self.is_heartbeat or self.fallback is not None

    @property
    def is_own(self) -> bool:
        """Tell whether we write the words of a PLC by ourselves."""
        return self.is_alone and not self.serves

    @property
    def is_planned(self) -> bool:
        """Tell whether we read the words from the PLC, to publish them or to compare them."""
        return self.polls or self.is_heartbeat

    @property
    def period_cell(self) -> str | int | None:
        """Return the value of the column Period."""
        return ON_DEMAND if self.is_on_demand else self.period

    @property
    def access_cell(self) -> str | Access | None:
        """Return the value of the column Access."""
        return READ_ONLY if self.is_read_only else self.access

    @property
    def needs_run(self) -> bool:
        """Tell whether values are published only while the PLC says that it is in RUN."""
        return self.condition is not None and self.condition.is_run

    def shares_words(self, other: Mapping) -> bool:
        """
        Tell whether both may have words of one PLC in common; for bits, the same bits.

        A broadcast has the words of every station.
        """
        if not self.extent.may_be_in(other.extent.station):
            return False
        if self.extent.area == other.extent.area and Access.CIF not in (self.access, other.access):
            return self._meets(other)
        # If the rows count words in different ways, it is unknown which words they share.
        return any(not mine.counts_like(theirs) or self._meets(other)
                   for mine in self._places() for theirs in other._places()
                   if mine.may_share_file(theirs))

    def may_share_file(self, other: Mapping) -> bool:
        """Tell whether words of both rows may be in one file, or slot, of one PLC."""
        return self.extent.may_be_in(other.extent.station) and any(
            mine.may_share_file(theirs)
            for mine in self._places() for theirs in other._places())

    def _places(self) -> list[Address]:
        """Return an address in each file that may have the words."""
        if self.access is not Access.CIF:
            return [self.address]
        return [parse_address(f'N{file}:0', PlcType.SLC) for file in sorted(CIF_FILES)]

    def _meets(self, other: Mapping) -> bool:
        """Tell whether both rows have a word, or for bits a bit, with the same number."""
        first = max(self.extent.first, other.extent.first)
        end = min(self.extent.end, other.extent.end)
        return first < end and any(mine & theirs for mine, theirs in zip(
            self._masks(first, end), other._masks(first, end), strict=True))

    def _masks(self, first: int, end: int) -> list[int]:
        return self.codec.masks()[first - self.extent.first:end - self.extent.first]

    def name_of(self, number: int) -> str:
        """Return the name of a bit of the row, counted from 0; empty if it has none."""
        return self.bits[number] if self.bits else ''

    def named_places(self) -> list[str]:
        """Return the name of each bit of the row, or the address of a value without a name."""
        return [self.name_of(number) or str(self.place_of(number))
                for number in range(self.length)]

    def place_of(self, number: int) -> Address:
        """Return the address of a value of the row, counted from 0."""
        address = self.address
        if address.bit is None:
            return address.at_offset(address.offset + number * self.codec.element_words)
        words, bit = divmod(address.bit + number, BITS)
        return address.at_offset(address.offset + words).with_bit(bit)
