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

"""The sniffer on what was recorded between our programs and those of others."""

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.sniffer.entries import Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
from support.captures import Capture, CAPTURES, FOLDER
from support.cases import for_all

_BAD = (Kind.DAMAGED, Kind.UNKNOWN, Kind.NOISE)


@for_all('capture', CAPTURES)
def test_everything_is_understood_and_the_check_is_found(capture: Capture) -> None:
    session = TrafficDecoder()
    entries = [entry for chunk in capture.chunks for entry in session.feed(chunk)]
    assert session.kind.checksum is capture.check
    by_radio = capture.name.startswith('radio')
    assert (session.kind.duplex is Duplex.RADIO) is by_radio
    bad = [entry for entry in entries if entry.kind in _BAD or entry.valid is False]
    assert len(bad) == (2 if by_radio else 0)


def test_who_sent_what_on_by_radio() -> None:
    capture, = (entry for entry in CAPTURES if entry.name.startswith('radio'))
    marked = {mark: [entry for entry in capture.entries if mark in entry.marks] for mark in Mark}
    assert {mark.name: len(found) for mark, found in marked.items() if found} == {
        'RETRANSMISSION': 5, 'FORWARDED': 38}  # one came before the mode was known
    for entry in marked[Mark.FORWARDED]:
        assert ', sent on by 9: ' in entry.text
    assert {entry.packet and entry.packet.src for entry in marked[Mark.RETRANSMISSION]} == {5}


def test_every_recorded_file_is_in_the_index() -> None:
    assert {path.stem for path in FOLDER.glob('*.cap')} == {entry.name for entry in CAPTURES}
