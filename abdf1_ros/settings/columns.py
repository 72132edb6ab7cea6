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

"""The columns of the map CSV and their contents."""

from __future__ import annotations

from typing import NamedTuple


class Column(NamedTuple):
    """
    One column of the map CSV.

    ``default`` says what an empty cell means; it is None where the cell must not be empty.
    """

    name: str
    default: str | None
    description: str


MAP_COLUMNS = (
    Column('Tag', None, 'unique name'),
    Column('Command', None,
           'Read, Write, ReadWrite; Serve: words of ours that PLCs read and write; Heartbeat: a '
           'word that counts while its conditions hold'),
    Column('Address', None, 'PLC address of the first element'),
    Column('Station', None,
           '0-254; of a Write also 255, all stations, none of which confirms; of a Serve our own'),
    Column('PLC_Type', None, 'PLC2, PLC3, PLC5 or SLC; a MicroLogix is SLC'),
    Column('Length', '1',
           'elements: bits, words, floats; of timers, counters and control their words; of a '
           'string in N or A words the words'),
    Column('Type', 'natural type of the file',
           'bool, int16, uint16, int32, uint32, float32, bcd16 or string'),
    Column('Topic', 'Tag', 'name below ~/read/ and ~/write/'),
    Column('Period', 'parameter default_period',
           'ms between reads; 0: as often as the line allows; of a Serve the longest time '
           'between two writes of the PLC; of a Heartbeat 100-60000, default 1000'),
    Column('Publish', 'Always',
           'Always: after every good read. Change: only new values, and the first after an '
           'outage'),
    Column('Min', 'none', 'least value that may be written, in the unit of the topic'),
    Column('Max', 'none', 'greatest value that may be written, in the unit of the topic'),
    Column('Word_Order', 'Low',
           'Low or High: which word of an int32, uint32 or float32 over 16-bit words comes first'),
    Column('Scale', '1',
           'with Scale or Offset the topic is float32: raw value x Scale + Offset; not for bool '
           'and string'),
    Column('Offset', '0', 'see Scale'),
    Column('Access', 'the first of them',
           'how words are reached. PLC5: Typed, WordRange. SLC: Slot, Flat. PLC2: Unprotected, '
           'Protected, CIF. Serve: Read, so that the other end cannot write'),
    Column('Processor', '5/03',
           'of an SLC: 5/01, 5/02, 5/03, 5/04, 5/05, ML1000, ML1100, ML1200, ML1400 or ML1500; it '
           'limits packets and files; the same in all rows of a station'),
    Column('Fallback', 'none',
           'of a Write or Serve: values, separated by spaces, that are written when no good '
           'message has come for Fallback_After; of a bool 0'),
    Column('Fallback_After', 'none', 'ms, 200-60000'),
    Column('Requires', 'none',
           'of a Heartbeat: write topics, separated by spaces, that must have messages'),
    Column('Requires_Timeout', 'none', 'ms that the last good message of each may be old'),
    Column('Publish_While', 'none',
           'of a Read: RUN, or the tag of a counter that the program of the PLC runs; values are '
           'published only while it holds'),
    Column('Heartbeat_Timeout', 'none',
           'ms that the counter of Publish_While may stay unchanged'),
    Column('Confirms', 'none',
           'of a Read of the one bit "ROS in control": the tag of the Heartbeat row it goes with'),
    Column('Via', 'Station',
           'with Mode Master: the station of a gateway on this line (KF2, KF3, KE) behind which '
           'Station is'),
    Column('Description', 'none', 'what it is in the plant, to be read'),
)

COLUMNS = tuple(column.name for column in MAP_COLUMNS)

NEEDED = tuple(column.name for column in MAP_COLUMNS if column.default is None)
