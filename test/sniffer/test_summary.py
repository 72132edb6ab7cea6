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

"""What all the traffic comes to."""

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.summary import Summary
import pytest

OUT, IN = Direction.OUT, Direction.IN
REPLY = Packet(5, 1, 0x4F, 0, 1)
REFUSAL = Packet(5, 1, 0x4F, 0x50, 1)


def test_entries_are_counted_for_the_line_and_for_their_station() -> None:
    summary = Summary()
    for entry in (
            Entry(0, OUT, Kind.POLL, station=1, valid=True),
            Entry(0, OUT, Kind.POLL, station=2, valid=False),
            Entry(0, IN, Kind.REPLY, station=1, packet=REPLY, latency=0.25),
            Entry(0, IN, Kind.REPLY, station=1, packet=REFUSAL, latency=0.75,
                  marks=(Mark.DUPLICATE,)),
            Entry(0, IN, Kind.DAMAGED, station=2, valid=False),
            Entry(0, IN, Kind.NOISE, size=7)):
        summary.add(entry)
    every, one, two = summary.all, summary.stations[1], summary.stations[2]
    assert (every.kinds[Kind.POLL], one.kinds[Kind.POLL], two.kinds[Kind.POLL]) == (2, 1, 1)
    assert (every.errors, one.errors, two.errors) == (1, 1, 0)
    assert (every.damaged, one.damaged, two.damaged) == (2, 0, 2)
    assert (every.noise, one.noise) == (7, 0)
    assert one.marks[Mark.DUPLICATE] == 1
    assert (one.latency.mean, one.latency.longest) == (0.5, 0.75)
    assert two.latency.count == 0
    assert sorted(summary.stations) == [1, 2]


def _heard(summary: Summary) -> Summary:
    summary.take(Chunk(10.0, OUT, bytes(300)))
    summary.take(Chunk(11.0, IN, bytes(180)))
    return summary


@pytest.mark.parametrize(('baud', 'duplex', 'load'), [
    (9600, Duplex.HALF, 0.5), (9600, Duplex.FULL, 0.3125), (9600, None, 0.5),
    (4800, Duplex.HALF, 1.0), (1200, Duplex.HALF, None), (None, Duplex.HALF, None)])
def test_load_is_known_where_baud_and_duplex_are(
        baud: int | None, duplex: Duplex | None, load: float | None) -> None:
    summary = _heard(Summary(baud))
    assert summary.load(duplex) == load
    assert summary.seconds == 1.0
    assert summary.bytes == {OUT: 300, IN: 180}


def test_recordings_one_after_the_other() -> None:
    summary = _heard(_heard(Summary(9600)))
    assert summary.seconds == 2.0
    assert summary.load(Duplex.HALF) == 0.5
