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

"""Fuzz target: the commands that are served, of every family, from two kinds of table."""

from abdf1_ros.df1.frames import MAX_LINK_DATA
from abdf1_ros.df1.packet import Packet, REPLY_BIT
from abdf1_ros.driver.served import Served
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.status import EXTENDED
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows
from support.mappings import make_mapping

_STATION = 5
_WORDS = 60


def _table(plc_type: PlcType) -> DataTable:
    """Return a table with a file of every type that the family has."""
    table = DataTable(plc_type)
    for number, kind in enumerate(FileType):
        is_fixed = kind in (FileType.OUTPUT, FileType.INPUT, FileType.STATUS)
        text = f'{kind.value}:0' if is_fixed else f'{kind.value}{number + 20}:0'
        try:
            table.create(parse_address(text, plc_type), _WORDS)
        except ValueError:
            continue  # the family has no such files
    return table


class _Plc:
    """A server, whose table is as new before each command."""

    def __init__(self, plc_type: PlcType) -> None:
        table = _table(plc_type)
        self.server = Server(table)
        self.words = table.words
        self._new = {area: bytes(store) for area, store in self.words.items()}

    def begin(self) -> None:
        """Forget what has been written."""
        for area, store in self._new.items():
            self.words[area][:] = store

    @property
    def is_unchanged(self) -> bool:
        """Tell whether nothing has been written."""
        return self.words == self._new

    @property
    def has_its_size(self) -> bool:
        """Tell whether there are the same files, each as long as it was."""
        return {area: len(store) for area, store in self.words.items()} == {
            area: len(store) for area, store in self._new.items()}


class _Own:
    """Three mapped words, and what is told of them."""

    def __init__(self, plc_type: PlcType) -> None:
        self.mapping = make_mapping(
            'N7:2', 'Serve', plc=plc_type.value, station=_STATION, length=3)
        self.served = Served(plc_type, Rows([self.mapping]), self._take)
        self.told = 0

    def _take(self, mapping: Mapping, words: bytes) -> None:
        assert mapping is self.mapping and len(words) == 6
        self.told += 1

    def begin(self) -> None:
        """Forget what has been written."""
        self.told = 0
        self.served.store(self.mapping, [0, 0, 0])

    @property
    def store(self) -> bytes:
        """Return the file in which the words lie, as long as it has been made."""
        return bytes(self.served.table.words[self.mapping.address.area])


_PLCS = [_Plc(plc_type) for plc_type in FAMILIES]
_OWN = [_Own(plc_type) for plc_type in (PlcType.PLC5, PlcType.SLC)]


def one_input(data: bytes) -> None:
    """Check the reply to a command: CMD, and what stands after TNS."""
    if not data:
        return
    command = Packet(_STATION, 1, data[0] & ~REPLY_BIT, 0, 0x0102, data[1:MAX_LINK_DATA - 5])
    for plc in _PLCS:
        plc.begin()
        reply = plc.server.serve(command)
        _check_reply(reply, command)
        assert plc.has_its_size
        assert reply.sts == 0 or plc.is_unchanged
    for own in _OWN:
        own.begin()
        reply = own.served.serve(command)
        _check_reply(reply, command)
        assert len(own.store) == 10 and not any(own.store[:4])
        assert own.told == 0 or reply.sts == 0
        assert own.told == 1 or not any(own.store)


def _check_reply(reply: Packet, command: Packet) -> None:
    assert reply.answers(command) and reply.cmd == command.cmd | REPLY_BIT
    assert len(reply.encode()) <= MAX_LINK_DATA
    assert (reply.sts == EXTENDED) is (reply.sts != 0 and len(reply.data) == 1)
    assert reply.sts == 0 or len(reply.data) <= 1
