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

"""What packets write, by bytes that were put down by hand."""

from support.forms import Forms, Meant, SAFE
from support.mappings import make_mapping

WORD = make_mapping('N7:20', 'Write', plc='SLC', tag='word')
LONG = make_mapping('N7:30', 'Write', plc='SLC', processor='5/01', length=42, tag='long')
BIT, NEXT_BIT = (make_mapping(f'N7:0/{bit}', 'Write', plc='SLC', processor='ML1000', tag=tag)
                 for bit, tag in ((4, 'bit'), (3, 'next')))
PLC5 = make_mapping('N7:20', 'Write', plc='PLC5', station=2, tag='five')


def test_packets_of_rows_are_told_apart() -> None:
    forms = Forms([WORD, LONG, BIT, NEXT_BIT, PLC5])
    for station, data, meant in (
            (1, 'AA 02 07 89 14 00 00 7D', Meant('word', SAFE)),
            (1, 'AA 52 07 89 1E 00' + 41 * ' 05 00', Meant('long', 5)),
            (1, 'AA 02 07 89 47 00 05 00', Meant('long', 5, 41)),
            (2, '67 00 00 01 00 06 07 14 93 09 42 09 00', Meant('five', 9)),
            (2, 'AA 02 07 89 14 00 00 7D', None),
            (1, 'AA 02 07 89 00 00 10 00', None),  # nobody has sent a masked write before
            (1, 'AB 02 07 89 00 00 10 00 10 00', Meant('bit', 1)),
            (1, 'AA 02 07 89 00 00 18 00', Meant('bit', 1)),
            (1, 'AB 02 07 89 00 00 08 00 00 00', Meant('next', 0)),
            (1, 'AA 02 07 89 00 00 10 00', Meant('next', 0))):
        assert forms.meant(station, bytes.fromhex(data)) == meant, data
    assert [forms.packets(row) for row in (WORD, LONG, BIT)] == [1, 2, 1]
