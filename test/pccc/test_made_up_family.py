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

"""
A sixth family, made up in this file: nothing else has to know it but one line of ``FAMILIES``.

It counts words in hexadecimal (``W1F``, ``W1F/3``) and has a read, a write and a bit write. The
test runs this file as a program: the line comes before the rest of the package is imported, as in
``families``.
"""

import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, Addressing, AddressSyntaxError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialect import Dialect, Request, Transfer
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.fields import Reader, word
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.link_counters import RECEIVED, SENT
from abdf1_ros.pccc.notation import Effect, KnownCommand
from abdf1_ros.pccc.serving import BasicCommands, Codes, Commands

TOY = PlcType('TOY')
CMD, READ, WRITE, BITS = 0x0F, 0xE0, 0xE1, 0xE2
COUNTERS = (SENT, RECEIVED)


class ToyAddressing(Addressing):
    """Words in hexadecimal."""

    plc_type = TOY
    title = 'Toy'
    files = {FileType.BINARY: Layout()}

    def parse(self, text: str, access: Access | None = None) -> Address:
        match = re.fullmatch(r'W([0-9A-F]{1,2})(?:/([0-9A-F]))?', text.strip().upper())
        if match is None:
            raise AddressSyntaxError('write W and a hexadecimal number, as in W1F or W1F/3')
        bit = int(match[2], 16) if match[2] else None
        return Address(self, FileType.BINARY, 0, int(match[1], 16), 0, bit)

    def show(self, address: Address) -> str:
        return f'W{address.element:X}' + ('' if address.bit is None else f'/{address.bit:X}')

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        return 0xFF


ADDRESSING = ToyAddressing()


class ToyDialect(Dialect):
    """What is said to it."""

    def max_read(self, file_type: FileType) -> int:
        return 20

    max_write = max_read

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        return CMD, bytes((READ, address.element, words))

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        return CMD, bytes((WRITE, address.element)) + data

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        return CMD, bytes((BITS, address.element)) + word(mask) + word(bits)


class ToyCommands:
    """What it answers."""

    no_such_file: Codes = 0x50, None
    out_of_range: Codes = 0x50, None
    protected: Codes = 0x60, None

    def __init__(self, table: DataTable, processor: EmulatedProcessor) -> None:
        self._table = table
        self.basic_commands: BasicCommands = {}
        self.commands: Commands = {
            (CMD, READ): self._read, (CMD, WRITE): self._write, (CMD, BITS): self._write_bits}

    def _read(self, reader: Reader) -> bytes:
        return self._table.read(self._place(reader), reader.byte())

    def _write(self, reader: Reader) -> bytes:
        self._table.write(self._place(reader), reader.rest())
        return b''

    def _write_bits(self, reader: Reader) -> bytes:
        self._table.write_bits(self._place(reader), reader.word(), reader.word())
        return b''

    @staticmethod
    def _place(reader: Reader) -> Address:
        return Address(ADDRESSING, FileType.BINARY, 0, reader.byte())


def decode(data: bytes) -> Identity | None:
    if data[1] != 0x77:
        return None
    mode = Mode.RUN if data[0] else Mode.PROGRAM
    return Identity(TOY, 'Toy', mode=mode, mode_text=mode.value, counter_layout=COUNTERS)


def encode(emulated: EmulatedProcessor) -> bytes:
    return bytes((emulated.mode.is_running, 0x77))


FAMILY = Family(
    ADDRESSING, {Access.TYPED: ToyDialect()}, ToyCommands, decode, encode,
    {(CMD, READ): KnownCommand(
        'toy read', Effect.READS, Reader.rest, lambda data: f'W{data[0]:X}')},
    served_counters=lambda mode: COUNTERS)


def main() -> None:
    """See that everybody knows the family."""
    FAMILIES[TOY] = FAMILY  # the line

    from abdf1_ros.cli.check import main as check
    from abdf1_ros.cli.plc.parser import make_parser
    from abdf1_ros.driver.settings import DriverSettings
    from abdf1_ros.driver.write import Outcome
    from abdf1_ros.pccc.describe import describe
    from abdf1_ros.problems import ConfigurationError
    from abdf1_ros.settings.network import load_network, Network
    from support.driver_bench import DriverBench, stored
    from support.mappings import load_text

    assert describe(Packet(1, 5, CMD, 0, 1, bytes((READ, 0x1F, 2)))) == 'toy read W1F'
    rows = 'Tag,Command,Address,Station,PLC_Type,Length\n'
    mappings, problems = load_text(
        rows + 'words,ReadWrite,w1f,1,toy,50\nbit,ReadWrite,W3/A,1,TOY,\n')
    assert problems == [], problems
    _, (problem,) = load_text(rows + 'bad,Read,N7:0,1,TOY,\n')
    assert 'write W and a hexadecimal number' in str(problem)
    _, (problem,) = load_text(rows + 'bad,Read,W0,1,TOYS,\n')
    assert 'PLC Type (TOYS) should be one of PLC2, PLC3, PLC5, SLC, TOY;' in str(problem)
    with tempfile.TemporaryDirectory() as folder:
        net, plan = Path(folder, 'net.csv'), Path(folder, 'map.csv')
        net.write_text('PLC_Type,Com_Port\ntoy,/dev/ttyUSB0\n', encoding='utf-8')
        plan.write_text(rows + 'words,Read,W0,1,TOY,9\n', encoding='utf-8')
        assert load_network(str(net)).plc_type == 'TOY'
        wrong = Path(folder, 'wrong.csv')
        wrong.write_text('PLC_Type\nTOYS\n', encoding='utf-8')
        try:
            load_network(str(wrong))
        except ConfigurationError as error:
            assert 'should be one of PLC2, PLC3, PLC5, SLC, TOY' in str(error.problems[0])
        else:
            raise AssertionError('a wrong PLC_Type was taken')
        assert check([str(net), str(plan)]) == 0
    assert make_parser('').parse_args(['read', 'W0', '--plc-type', 'toy']).plc_type == 'TOY'

    words, bit = mappings
    bench = DriverBench(mappings, network=Network(baud=19200, timeout=200, plc_type='TOY'),
                        settings=DriverSettings(processor_period=0.5))
    plc = bench.plc(1, 'TOY', ('W0', 256))
    bench.run(1.0)
    bench.driver.checks.request_counters(1)
    bench.write(words, [*range(50)])
    bench.write(bit, [1], run=2.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN] * 2, bench.listener.outcomes()
    assert bench.listener.values(words)[-1] == [*range(50)]
    assert stored(plc, 'W3') == b'\x00\x04'
    health = bench.driver.checks.known(1)
    assert health.identity is not None and health.identity.plc_type == TOY
    assert health.counters.keys() == {SENT, RECEIVED}


def test_everybody_knows_a_family_that_one_line_registers() -> None:
    root = Path(__file__).resolve().parents[2]
    environment = os.environ | {'PYTHONPATH': os.pathsep.join((str(root), str(root / 'test')))}
    assert subprocess.call([sys.executable, __file__], env=environment, timeout=60) == 0


if __name__ == '__main__':
    main()
