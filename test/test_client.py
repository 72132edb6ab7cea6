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

"""The blocking client on a line with simulated PLCs, and what it does without."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, ExitStack, suppress
import copy
from functools import partial
from inspect import signature
from itertools import count
import logging
import math
from pathlib import Path
import pickle
import re
import socket
import subprocess
import sys
import threading
from threading import Thread
import time
from types import FrameType
from typing import Any
from unittest.mock import Mock, patch

from abdf1_ros.cli.sniff import main as sniff
from abdf1_ros.client import Client
from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Frame, Symbol
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.master import MASTER
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.errors import FormatError, LinkError, PortLost, RemoteError, StationInactive
from abdf1_ros.open_line import kind_of, LOG, OpenLine, Pending
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.steps import identify
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import FIELDS, Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import numpy
import pytest
from support.cases import for_all
from support.counting import open_files
from support.driver_bench import simulated_plc, store, stored
from support.plc_line import machine_line, plc_line
from support.ptys import PATIENCE, wait_until

PlcPair = tuple[SimulatedPlc, SimulatedPlc]
FILES = (('N7:0', 250), ('B3:0', 4), ('F8:0', 8), ('T4:0', 9), ('ST9:0', 42), ('A10:0', 4))


@pytest.fixture
def plcs() -> PlcPair:
    return (simulated_plc(1, 'SLC', time.monotonic, *FILES, ('I:1.0', 2)),
            simulated_plc(2, 'PLC5', time.monotonic, *FILES))


@pytest.fixture
def port(tmp_path: Path, plcs: PlcPair) -> Iterator[str]:
    with plc_line(tmp_path / 'line', *plcs) as name:
        yield name


def client(port: str, station: int = 1, plc_type: str | None = None) -> Client:
    return Client(port, plc_type=plc_type, station=station, duplex='half', baud=115200,
                  timeout=1.0, cmd_timeout=1.0)


def line_with(port: str, timeout: float, logger: logging.Logger = LOG,
              retries: int = 3) -> OpenLine:
    """Return the line below a client, whose requests do not wait for their end."""
    return OpenLine(MASTER, LinkSettings(nak_retries=retries, timeout=timeout),
                    PortSettings(port, 115200), logger=logger)


def client_with(port: str, **more: Any) -> Client:
    return Client(port, plc_type='SLC', duplex='half', baud=115200, **more)


@pytest.mark.parametrize(('station', 'plc_type'), [(1, 'SLC'), (1, None), (2, 'plc5'), (2, None)])
def test_what_is_written_is_read(port: str, station: int, plc_type: str | None) -> None:
    with client(port, station, plc_type) as plc:
        plc.write('N7:0', [-1, 32767], 'int16')
        plc.write('N7:4', 70000, 'int32', word_order='High')
        plc.write('B3:0/1', True)
        plc.write('F8:1', 1.5)
        plc.write('T4:1.PRE', 500)
        for recipe in ('x' * 82, ''):
            plc.write('#st9:0', recipe, 'string')
            assert plc.read('ST9:0') == recipe
        plc.write('ST9:0', 'recipe 7')
        plc.write('A10:0', 'vwxyz', 'string')
        plc.write('A10:0', 'ab', 'string')
        plc.write('A10:2', '', 'string')
        before = plc.counters.commands_sent
        assert plc.read('N7:0') == -1
        assert plc.counters.commands_sent == before + 1  # it is known what the PLC is
        assert plc.read('N7:0', 3) == [-1, 32767, 0]
        assert plc.read('N7:0', 2, 'uint16') == [65535, 32767]
        assert plc.read('N7:4', kind='int32', word_order='High') == 70000
        assert plc.read('N7:4', 2) == [1, 4464]
        assert plc.read('B3:0/1') is True
        assert plc.read('B3:0/0', 3) == [False, True, False]
        assert plc.read('F8:0', 2) == [0.0, 1.5]
        plc.write(address='N7:8', values=numpy.array([3, 4], numpy.int16))
        plc.write('N7:10', numpy.float32(5.0))
        assert plc.read('N7:8', numpy.int64(3)) == [3, 4, 5]
        assert plc.read('N7:10', 1) == [5]
        assert plc.read('T4:1.PRE') == 500
        assert plc.read('T4:0.ACC', 4) == [0, 0, 500, 0]  # to T4:1.ACC, past a control word
        assert plc.read('ST9:0') == 'recipe 7'
        assert plc.read('A10:0', 3, 'string').rstrip('\0') == 'abxy'


def test_values_of_several_packets_are_written_and_read(port: str, plcs: PlcPair) -> None:
    with client(port) as plc:
        for station in (1, 2):
            values = [*range(-station, 250 - station)]
            plc.write('N7:0', values, station=station)
            assert plc.read('N7:0', 250, station=station) == values
            assert plc.read_many(['N7:0-249'], station=station) == {'N7:0-249': values}
    assert stored(plcs[1], 'N7:249') == (247).to_bytes(2, 'little')


def test_inputs_by_slot_and_flat(port: str, plcs: PlcPair) -> None:
    store(plcs[0], 'I:1.0', [7, 9])
    with client(port) as plc:
        assert plc.read('I:1.1') == 9
    with client_with(port, access='Flat') as plc:
        assert plc.read('I:0', 2) == plc.read_many(['I:0-1'])['I:0-1'] == [7, 9]
    with client_with(port, processor='5/02') as plc:
        assert len(plc.read('N7:0', 100)) == len(plc.read_many(['N7:0-99'])['N7:0-99']) == 100
        assert plc.counters.commands_sent == 6  # at most 82 bytes in a reply


def test_errors_are_those_of_the_bridge(port: str) -> None:
    with client(port, plc_type='SLC') as plc:
        with pytest.raises(RemoteError, match='^N7:250 of station 1: STS 50: address not there'):
            plc.read('N7:250')
        with pytest.raises(RemoteError, match='^N30:0 of station 1: STS 10: '):
            plc.write('N30:0', 1)
        with pytest.raises(FormatError, match='^N7:x of station 1: write type, file'):
            plc.read('N7:x')
        with pytest.raises(FormatError, match='station 300'):
            plc.read('N7:0', station=300)
    with client_with(port, timeout=0.1) as plc:
        for ask, place in ((lambda: plc.read('N7:0', station=9), 'N7:0 of station 9'),
                           (lambda: plc.write('N7:0', 1, station=0), 'N7:0 of station 0'),
                           (lambda: plc.identify(station=9), 'status of station 9')):
            with pytest.raises(LinkError, match=f'^{place}: 2509') as error:
                ask()
            assert error.value.words().startswith('2509')


def test_many_addresses_are_read_by_the_plan(port: str, plcs: PlcPair) -> None:
    store(plcs[0], 'N7:0', [*range(100, 120)])
    store(plcs[0], 'T4:1', [0, 7, 5])
    wanted = ['N7:9', 'B3:0/1', 'N7:0-2', 'F8:1-2', 'N7:12', 'T4:1.ACC', 'N7:5-5', 'T4:1-1']
    with client(port, plc_type='SLC') as plc:
        assert plc.read_many(wanted) == {
            'N7:9': 109, 'B3:0/1': False, 'N7:0-2': [100, 101, 102], 'F8:1-2': [0.0, 0.0],
            'N7:12': 112, 'T4:1.ACC': 5, 'N7:5-5': [105], 'T4:1-1': [0, 7, 5]}
        assert plc.counters.commands_sent == 4  # N7, B3, F8, T4
        assert list(plc.read_many(reversed(wanted))) == wanted[::-1]
        assert plc.read_many([]) == {}
        # What the PLC lacks is named, and does not take its neighbours along.
        with pytest.raises(RemoteError, match=r'^N7:250 \(N7:250 of station 1\): STS 50'):
            plc.read_many(['N7:248', 'N7:249', 'N7:250'])
        for wrong, text in ((['N7:0', 'N7:3-0'], '^N7:3-0 of station 1: the lower end comes'),
                            ('N7:0', "^addresses 'N7:0' should be a list of addresses")):
            with pytest.raises(FormatError, match=text):
                plc.read_many(wrong)


def test_partial_read_has_a_value_or_its_own_error_for_each_address(port: str) -> None:
    begun = time.time()
    with client(port, plc_type='SLC') as plc:
        plc.write('N7:0', [7, 8])
        found = plc.read_many(['N7:x', 'N7:0', 'N7:250', 'N7:0-1', 'N30:0', 'F8:0'], partial=True)
        assert list(found) == ['N7:x', 'N7:0', 'N7:250', 'N7:0-1', 'N30:0', 'F8:0']
        assert {text: reading.value for text, reading in found.items() if not reading.error} == {
            'N7:0': 7, 'N7:0-1': [7, 8], 'F8:0': 0.0}
        assert {text: str(reading.error)[:29] for text, reading in found.items()
                if reading.error} == {
            'N7:x': 'N7:x of station 1: write type', 'N7:250': 'N7:250 of station 1: STS 50: ',
            'N30:0': 'N30:0 of station 1: STS 10: i'}
        assert all(begun <= reading.time <= time.time() for reading in found.values())
        assert plc.read_many([], partial=True) == {}
        wrong: Any
        more: Any
        for wrong in 'N7:0', 7, [['N7:0']], [None], ['']:
            for more in {}, {'partial': True}:
                with pytest.raises(FormatError, match='should be a'):
                    plc.read_many(wrong, **more)
        with pytest.raises(FormatError, match='station 300'):
            plc.read_many(['N7:0'], station=300, partial=True)
    gone = plc.read_many(['N7:0', 'F8:0'], partial=True)
    assert [str(reading.error) for reading in gone.values()] == [
        f'{text} of station 1: port lost: closed by this program' for text in gone]


@pytest.mark.parametrize('plc_type', ['SLC', None])
def test_silent_plc_is_asked_once_for_all_that_is_wanted_of_it(
        port: str, plc_type: str | None) -> None:
    with Client(port, plc_type=plc_type, station=9, duplex='half', baud=115200, timeout=0.05,
                retries=2) as plc:
        for polls in 0, 1:  # after its retries a silent station gets one poll for each call
            found = plc.read_many(['N7:0', 'F8:0', 'B3:0'], partial=True)
            assert [str(reading.error).partition(';')[0] for reading in found.values()] == [
                f'{text} of station 9: 2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive'
                for text in ('N7:0', 'F8:0', 'B3:0')]
            assert (plc.counters.messages_sent, plc.counters.polls_sent) == (3, polls)
            sent = [reading.error.sent for reading in found.values()
                    if isinstance(reading.error, LinkError)]
            assert sent == [plc_type is not None and not polls, False, False]


def test_settings_are_named_while_nothing_fits_them(port: str) -> None:
    with Client(port, baud=115200, timeout=0.05, retries=0) as wrong, \
            pytest.raises(StationInactive, match=(
                'nothing that fits has come in full duplex at 115200 baud, parity None, check '
                'CRC: "plc detect" finds the settings of a line$')):
        wrong.read('N7:0')
    with Client(port, duplex='half', baud=115200, timeout=0.05, retries=0) as right:
        right.read('N7:0')
        with pytest.raises(StationInactive, match=r'\(9\) Inactive$'):
            right.read('N7:0', station=9)


def test_packets_that_were_written_before_a_silence_are_told(tmp_path: Path) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic, *FILES)
    handle = plc.handle

    def handle_first(symbol: Symbol) -> bytes:
        if isinstance(symbol, Frame):  # of a later packet, if the first has been executed
            plc.faults.silent = any(plc.table.read(parse_address('N7:0', PlcType.SLC), 1))
        return handle(symbol)

    plc.handle = handle_first  # type: ignore[method-assign]
    with plc_line(tmp_path / 'line', plc) as name, \
            Client(name, duplex='half', baud=115200, plc_type='SLC', timeout=0.05, retries=0,
                   cmd_timeout=0.5) as here, \
            pytest.raises(LinkError, match=r' \(after 1 of 2 packets were written\)$') as error:
        here.write('N7:0', 200 * [5])
    assert error.value.sent


def test_retries_trace_and_log_are_arguments(port: str, tmp_path: Path,
                                             caplog: pytest.LogCaptureFixture) -> None:
    trace = tmp_path / 'line.cap'
    caplog.set_level('DEBUG', 'abdf1_ros')
    with client_with(port, timeout=0.1, retries=1, trace=trace) as plc:
        plc.read_many(['N7:0', 'N7:4'])
        plc.identify()
        before = plc.counters.nak_retries  # on a busy host
        with pytest.raises(LinkError):
            plc.read('N7:0', station=9)
        assert plc.counters.nak_retries == before + 1
    logged = [record.getMessage() for record in caplog.records if record.name == 'abdf1_ros']
    events = [(record.levelname, record.getMessage()[5:8]) for record in caplog.records
              if record.getMessage()[:1] == '2']
    assert events == [('DEBUG', 'NTC')] * (len(events) - 1) + [('INFO', 'ERR')] != events[:1]
    timed = [text.rpartition(': ') for text in logged if text.endswith(' ms')]
    assert [place for place, _, ms in timed if 0.0 < float(ms.split()[0]) < 60_000] == [
        'N7:0, N7:4 of station 1', 'status of station 1']
    assert ' N7:0 of station 9: 2509 ERR_INACTIVE_STATION' in caplog.text.splitlines()[-1]
    wait_until(lambda: str(trace) not in {name for _, name in open_files()})
    assert sniff(['--summary', str(trace)]) == 0
    assert trace.read_text('ascii').splitlines()[2:6] == [
        f'# port: {port}', '# baud: 115200', '# check: CRC', '# duplex: half']
    with pytest.raises(ConfigurationError) as error:
        client_with(port, trace=__file__)
    client_with(port).close()  # it is free, though the error keeps what was made before
    assert str(error.value).startswith(f'{__file__}: exists and is not a capture')


def test_link_does_not_wait_for_a_handler_of_the_log(port: str) -> None:
    """One that writes to a pipe that is full, as for journald, stopped the line."""
    class Stuck(logging.Handler):

        def emit(self, record: logging.LogRecord) -> None:
            if not threads:
                threads.add(threading.current_thread())
                line.ask(1, identify())  # it may ask a PLC, too
            threads.add(threading.current_thread())

    threads: set[threading.Thread] = set()
    logger = logging.Logger('test', logging.DEBUG)
    logger.addHandler(Stuck())
    with line_with(port, 0.1, logger, retries=1) as line:
        assert line.start(9, identify()).wait(PATIENCE) and not threads
        line.ask(1, identify())
    assert threads == {threading.current_thread()}  # in ``close``


def test_entries_of_the_log_that_nothing_takes_are_counted(
        port: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr('abdf1_ros.open_line.MOST_ENTRIES', 2)
    told = []
    with line_with(port, 0.05, retries=2) as line:
        for station, level in (9, 'DEBUG'), (8, 'DEBUG'), (7, 'WARNING'):
            caplog.set_level(level, 'abdf1_ros')  # at the end none is lost
            assert line.start(station, identify()).wait(PATIENCE)
            line.settle()
            told += [re.sub(r'^2(?=\d).*|\d+ entr.* lost', '2', text) for text in caplog.messages]
            caplog.clear()
    assert told == 2 * ['2', '2', '2 here: nothing was asked meanwhile']
    line.close()
    assert not caplog.messages


@for_all(('address', 'arguments', 'text'), [
    ('N7', {}, 'an element is missing, as in N7:0'),
    ('F8:0', {'length': 300}, r'300 float32 \(600 words\) do not fit at F8:0; .* F8:255$'),
    ('N7:0', {'length': 0}, '^length 0 should be a whole number from 1 on$'),
    ('N7:0-2', {}, '^N7:0-2 of station 1: write N7:0, length=3$'),
    ('B3:0/0-B3:1/3', {}, 'bits of several words; write B3:0/0, length=20$'),
    ('T4:0.ACC-T4:2.ACC', {}, 'not neighbours; an address each for T4:0.ACC, T4:1.ACC, T4:2.ACC, '
     'or the whole elements with T4:0, length=9$'),
    ('ST9:0-1', {}, 'each string needs its own address: ST9:0, ST9:1'),
    (['N7:0'], {}, r"^address \['N7:0'\] should be one text; read_many reads several$"),
    ('N7:-1', {}, 'N7:-1 of station 1: write type, file, ":", element, as in N7:0'),
    ('F8:0', {'kind': 'int16'}, 'F8:0 can be float32'),
    ('N7:0', {'kind': 'int'}, "kind 'int' should be one of bool, int16"),
    ('N7:0', {'kind': 7}, 'kind 7 should be one of'), (None, {}, 'address None should be a text'),
    (Path('N7:0'), {}, 'address .* should be a text'),
    ('N7:0', {'length': 3.0}, '^length 3.0 should be a whole number from 1 on$'),
    ('N7:0', {'length': '3'}, "length '3' should be a whole number"),
    ('N7:0', {'station': '1'}, "station '1' should be"),
    ('N7:0', {'station': 5}, 'station 5 is own_station, so no PLC can answer as 5'),
    ('N7:0', {'word_order': None}, 'word_order None should be one of Low, High'),
    *((address, {'word_order': 'High', **more}, f'word order High is for int32, .* not for {kind}')
      for address, more, kind in (('N7:0', {'length': 4}, 'int16'), ('F8:0', {}, 'float32'),
                                  ('N7:0', {'values': [1, 2]}, 'int16'))),
    ('T4:0.PRE', {'length': 2, 'kind': 'string'}, 'T4:0.PRE can be int16, uint16'),
    *((address, {'values': values}, text) for address, values, text in (
        ('N7:0', 70000, 'value 70000 at index 0 is not a valid int16'),
        ('T4:0.CON', 1, 'T4:0 belongs to the processor'), ('ST9:0', 5, 'not a valid string'),
        ('N7:0', None, r'None should be a number \(int, float, bool\), a list of numbers, or a '
         r'text \(str\)$'),
        ('N7:0', [[1]], 'should be a'), ('N7:0', [], r'\[\] should be a number'),
        ('N7:0', {1: 2}, 'should be a'), ('ST9:0', bytearray(b'1'), 'should be a'),
        ('N7:0', b'1', 'should be a'), ('N7:0', [1, '1'], 'should be'))),
    ('N7:0', {'values': 1, 'kind': 2}, '^kind 2 should be a text; several values are one list$'),
    (('N7:0', 5), {'values': 1}, r"^address \('N7:0', 5\) should be one text")])
def test_what_is_wrong_in_a_call_is_told_before_anything_is_sent(
        port: str, address: Any, arguments: dict[str, Any], text: str) -> None:
    with client(port, plc_type='SLC') as plc:
        with pytest.raises(FormatError, match=text):
            (plc.write if 'values' in arguments else plc.read)(address, **arguments)
        assert plc.counters.chars_sent == 0


def test_arguments_of_the_line(tmp_path: Path) -> None:
    port = str(tmp_path / 'none')
    for wrong, text in (
            ({'plc_type': 's7'}, "plc_type 's7' should be one of PLC2, PLC3, PLC5, SLC"),
            ({'plc_type': 5}, 'plc_type 5 should be one of'),
            ({'duplex': 'both'}, "^duplex 'both' should be one of full, half, slave$"),
            ({'parity': 'mark'}, "^parity 'mark' should be one of None, Even, Odd$"),
            ({'check': 'CRC16'}, "check 'CRC16' should be one of BCC, CRC"),
            ({'station': 255}, 'station 255 should be a whole number from 0 to 254'),
            ({'station': '1'}, "station '1' should be a whole number"),
            ({'own_station': -1}, 'own_station -1'),
            ({'baud': '19200'}, "baud '19200' should be a whole number"),
            ({'baud': True}, 'baud True'), ({'baud': 0}, 'baud 0'),
            ({'baud': 14400}, 'baud 14400 should be one of 300, 600, 1200, '),
            ({'retries': 11}, 'retries 11 should be a whole number from 0 to 10'),
            ({'timeout': 60000}, ' 60000 should be seconds above 0, up to 60; 60 for 60000 ms'),
            ({'cmd_timeout': '1'}, "cmd_timeout '1' should be seconds above 0, up to 60$"),
            ({'timeout': 60001}, ' 60$'), ({'timeout': 0}, 'timeout 0 '),
            ({'timeout': math.nan}, 'timeout nan'),
            ({'processor': '5/02'}, 'processor needs plc_type'),
            ({'logger': 'mine'}, "^logger 'mine' should be a logging.Logger, as from "
             r"logging.getLogger\('mine'\)$"),
            ({'logger': None}, r'^logger None should be .*getLogger\(\)$')):
        with pytest.raises(FormatError, match=text):
            Client(port, **wrong)  # type: ignore[arg-type]
    for name, right in ((None, 'text'), (5, 'text'), ('', 'text'), *(
            (f'socket://host{end}', 'device path, socket') for end in ('', ':x', ':99999')), *(
            (name, f'device path, socket://host:port or rfc2217://host:port; {cure}$')
            for name, cure in (('192.168.1.5:4001', 'write socket://192.168.1.5:4001'),
                               ('COM3', '"plc ports" lists the devices'),
                               ('ttyUSB0', '"plc ports" lists the devices'),
                               ('socket://10.0.0.1:4001/', 'write socket://10.0.0.1:4001')))):
        with pytest.raises(FormatError, match=f'port {name!r} should be a {right}'):
            Client(name)  # type: ignore[arg-type]
    with pytest.raises(OSError, match='none'):
        Client(Path(port), parity='odd', timeout=60)


def test_arguments_of_the_line_and_gateways_reach_it(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []
    monkeypatch.setattr(OpenLine, '__init__', lambda self, *rest, **named: given.append(
        (*rest, named)))
    more: dict[str, Any] = {'trace': '/x/line.cap', 'logger': logging.Logger('other')}
    Client('/dev/x', baud=19200, parity='even', check='bcc', station=254, own_station=254,
           retries=10, timeout=0.25, cmd_timeout=0.75, duplex='HALF', **more)
    Client('/dev/x', parity=None)
    rows = 'Tag,Command,Address,Station,Via,PLC_Type\nfar,Read,N7:0,9,3,SLC\n' \
        'last,Read,N7:0,254,,SLC\nall,Write,N7:0,255,,SLC\n'
    assert [*Client.from_files(*files(tmp_path, '/dev/x', rows), **more).rows] == ['far', 'last']
    port = PortSettings('/dev/x', 19200, parity='Even')
    assert given[0] == (MASTER, LinkSettings(
        station=254, checksum=Checksum.BCC, timing=LineTiming(port.char_time), nak_retries=10,
        enq_retries=10, timeout=0.25, cmd_timeout=0.75), port, more)
    assert given[1][2].parity == PortSettings('/dev/x').parity
    *_, stations, plc_type, named = given[2]
    assert (stations.via(9), stations.via(8), str(plc_type), named) == (3, 8, 'SLC', more)


def test_forgotten_close_is_told_and_closed_client_refuses(
        port: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with client(port, plc_type='SLC') as plc, \
            pytest.raises(OSError, match=r'this program has it open already; is a close\(\) mis'):
        client(port)
    for _ in range(2):  # a call after the end ends at once
        with pytest.raises(LinkError, match='port lost: closed by this program') as error:
            plc.read('N7:0')
        assert not error.value.sent
        plc.close()
    with monkeypatch.context() as patch:
        patch.setattr(LinkThread, 'start', lambda thread: None)  # as if it had no turn yet
        early = client(port)
        early.close()
    with client(port, plc_type='SLC') as plc:
        assert plc.read('N7:0') == 0
    with closing(open_port(PortSettings(port))), pytest.raises(OSError, match='another program'):
        client(port)


def test_what_identify_returns_may_be_given(port: str) -> None:
    with client(port) as plc:
        found = plc.identify()
    for arguments in ({'plc_type': found.plc_type, 'processor': found.processor},
                      {'plc_type': 'SLC 500', 'processor': 'SLC 5/03'}):
        with Client(port, duplex='half', **arguments) as plc:  # type: ignore[arg-type]
            assert plc.read('N7:0') == 0


def test_client_shows_its_port_and_takes_no_setting_later(port: str) -> None:
    with client(port, plc_type='SLC') as plc:
        plc.read('N7:0')
        assert repr(plc) == f'<Client of {port}: open>'
        with pytest.raises(AttributeError, match='^a Client has no timeout that can be set; give'):
            plc.timeout = 5  # type: ignore[attr-defined]
        with patch.object(plc, 'read', return_value=7):
            assert plc.read('N7:0') == 7
        assert plc.read('N7:0') == 0
    assert repr(plc) == f'<Client of {port}: closed>'

    class Press(Client):

        def __init__(self) -> None:
            self.name = 'press'
            super().__init__(port, duplex='half')

    with Press() as press:
        press.timeout = 5  # type: ignore[attr-defined]
        assert (press.name, press.read('N7:0')) == ('press', 0)


def test_forgotten_close_is_a_warning_where_python_shows_it(port: str) -> None:
    program = ('import sys; from abdf1_ros import Client\n'
               'def forgets(): Client(sys.argv[1])\n'
               'def closes():\n with Client(sys.argv[1]): pass\n'
               'closes(); forgets()')
    said = subprocess.run([sys.executable, '-X', 'dev', '-c', program, port], text=True,
                          capture_output=True, timeout=PATIENCE, check=True)
    assert re.findall(r'^(\S+: ResourceWarning: unclosed <Client of \S+): ', said.stderr, re.M) \
        == [f'<string>:2: ResourceWarning: unclosed <Client of {port}']


def test_client_stays_in_its_process(port: str) -> None:
    with client(port, plc_type='SLC') as plc:
        for copied in pickle.dumps, copy.copy:
            with pytest.raises(TypeError, match='^a Client cannot be pickled or copied, because'):
                copied(plc)
    program = ('import os, sys; from abdf1_ros import Client\n'
               'with Client(sys.argv[1], duplex="half", plc_type="SLC") as plc:\n'
               ' if os.fork():\n'
               '  os.wait(); print(plc.read("N7:0"))\n'
               ' else:\n'
               '  try: plc.read("N7:0")\n'
               '  except Exception as error: print(error, error.sent, flush=True)\n'
               '  os._exit(0)')
    said = subprocess.run([sys.executable, '-c', program, port], text=True, capture_output=True,
                          timeout=PATIENCE, check=True)
    assert said.stdout.splitlines() == [
        'N7:0 of station 1: port lost: another process has opened it; each process needs a client '
        'of its own False', '0']


def test_call_in_the_last_moments_of_a_program_says_so(port: str) -> None:
    program = ('import sys; from abdf1_ros import Client\n'
               'class Last:\n'
               ' def __del__(self):\n'
               '  try: plc.read("N7:0")\n'
               '  except Exception as error: print(error)\n'
               'plc = Client(sys.argv[1], duplex="half", plc_type="SLC"); last = Last()')
    said = subprocess.run([sys.executable, '-c', program, port], text=True, capture_output=True,
                          timeout=PATIENCE, check=True)
    assert said.stdout == 'N7:0 of station 1: port lost: this program ends\n'


def test_close_in_another_thread_is_waited_for(
        port: str, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, may_end, stop = threading.Event(), threading.Event(), LinkThread.stop

    def slow(thread: LinkThread) -> None:
        begun.set()
        assert may_end.wait(PATIENCE)
        stop(thread)

    with monkeypatch.context() as patch, ThreadPoolExecutor() as pool:
        patch.setattr(LinkThread, 'stop', slow)
        closing = pool.submit(client(port, plc_type='SLC').close)
        assert begun.wait(PATIENCE)
        opening = pool.submit(client, port)
        with pytest.raises(TimeoutError):
            opening.result(0.3)
        may_end.set()
        closing.result(PATIENCE)
        opening.result(PATIENCE).close()


def test_other_thread_that_does_not_close_is_waited_for_as_long_as_a_transaction_takes(
        port: str) -> None:
    with ThreadPoolExecutor() as pool:
        with pool.submit(client_with, port, timeout=0.05, cmd_timeout=0.1, retries=0).result(), \
                pytest.raises(OSError, match='this program has it open already; is a close'):
            client(port)
        client(port).close()


def test_line_that_comes_back_is_used_again(
        tmp_path: Path, plcs: PlcPair, monkeypatch: pytest.MonkeyPatch) -> None:
    hours = count(0, 3600)
    monkeypatch.setattr('abdf1_ros.open_line.time', Mock(monotonic=lambda: next(hours)))
    name = tmp_path / 'line'
    with ExitStack() as first:
        port = first.enter_context(plc_line(name, *plcs))
        here = client_with(port, trace=tmp_path / 'line.cap')
        with here:
            here.write('N7:0', 5)
            assert here.counters.commands_sent == 1  # a device stores no commands
            first.close()
            with pytest.raises(LinkError):
                here.read('N7:0')
            with plc_line(name, *plcs):
                end = time.monotonic() + PATIENCE
                while time.monotonic() < end:
                    with suppress(LinkError):
                        assert here.read('N7:0') == 5
                        break
                    time.sleep(0.05)
                else:
                    raise AssertionError('the line did not come back')
    times = [float(line.split()[0]) for line in (tmp_path / 'line.cap').read_text().splitlines()
             if line[0].isdigit()]
    assert len(times) > 6 and times == sorted(times)  # they begin once


MAP = """\
Tag,Command,Address,Station,PLC_Type,Length,Scale,Min,Max,Period
speed,ReadWrite,N7:0,1,SLC,1,0.1,0,50,10
doors,Read,B3:0/0,2,PLC5,3,,,,
recipe,Write,N7:10,2,PLC5,2,,,,
name,ReadWrite,ST9:0,1,SLC,,,,,
far,Read,N7:9,1,SLC,2,0.5,,,60000
all,Write,N7:20,255,PLC5,1,,,,
alive,Heartbeat,N7:21,1,SLC,1,,,,
"""


def files(folder: Path, port: str, rows: str = MAP, more: str = '',
          timeout: int = 1000) -> tuple[Path, Path]:
    net, rows_file = folder / 'net.csv', folder / 'map.csv'
    net.write_text(
        'PLC_Type,Com_Port,Baud,Polling,Mode,Timeout\n'
        f'SLC,{port},115200,Standard,{more or "Master"},{timeout}\n', encoding='utf-8')
    rows_file.write_text(rows, encoding='utf-8')
    return net, rows_file


def test_rows_of_a_map_are_read_and_written_by_their_tags(
        port: str, tmp_path: Path, plcs: PlcPair) -> None:
    with Client.from_files(*files(tmp_path, port)) as plant:
        assert list(plant.rows) == ['speed', 'doors', 'recipe', 'name', 'far']
        with pytest.raises(TypeError):  # the rows are those of the map
            plant.rows['far'] = plant.rows['speed']  # type: ignore[index]
        plant.write('speed', 12.34)
        assert stored(plcs[0], 'N7:0') == (123).to_bytes(2, 'little')
        assert plant.read('speed') == pytest.approx(12.3)
        plant.write('recipe', (1, 2))
        assert stored(plcs[1], 'N7:11') == b'\2\0'
        plant.write('name', 'left')
        store(plcs[0], 'N7:9', [6, 8])
        store(plcs[1], 'B3:0', [5])
        assert (plant.read('name'), plant.read('doors')) == ('left', [True, False, True])
        before = plant.counters.commands_sent
        assert [*plant.read(['name', 'speed', 'doors', 'far']).items()] == [
            ('name', 'left'), ('speed', pytest.approx(12.3)), ('doors', [True, False, True]),
            ('far', [3.0, 4.0])]
        assert plant.counters.commands_sent - before == 3
        for call, text in (
                (lambda: plant.write('speed', 51), r'^speed \(N7:0 of .* 1\): value 51 .* Max 50'),
                (lambda: plant.read('recipe'), "'recipe' should be .* that is read: speed, doors"),
                (lambda: plant.write('doors', [1, 1, 1]), 'that is written: speed, recipe, name'),
                (lambda: plant.read(None), 'tag None should be a text'),
                (lambda: plant.read('N7:0'), "tag 'N7:0' should be that of a row")):
            with pytest.raises(FormatError, match=text):
                call()
        plcs[0].faults.status = (0x10,)
        for tags in 'far', ['far', 'name']:
            with pytest.raises(RemoteError, match=r'^far \(N7:9 of station 1\): STS 10'):
                plant.read(tags)


def test_partial_read_of_tags_costs_a_silent_plc_its_own_values_only(
        port: str, tmp_path: Path, plcs: PlcPair) -> None:
    store(plcs[0], 'N7:0', [123])
    rows = MAP + 'gone,Read,N7:0,9,SLC,1,,,,\ntoo,Read,F8:0,9,SLC,1,,,,\n'
    with Client.from_files(*files(tmp_path, port, rows, timeout=50)) as plant:
        assert plant.tags == ['speed', 'doors', 'name', 'far', 'gone', 'too']
        assert [*plant.rows] == ['speed', 'doors', 'recipe', 'name', 'far', 'gone', 'too']
        wanted = ['gone', 'sped', *plant.tags, 'recipe']
        found = plant.read(iter(wanted), partial=True)
        assert list(found) == [*dict.fromkeys(wanted)]
        values = {tag: reading.value for tag, reading in found.items() if not reading.error}
        assert values == {'speed': pytest.approx(12.3), 'doors': [False] * 3, 'name': '',
                          'far': [0.0, 0.0]}
        assert plant.read([*values]) == values
        errors = {tag: str(reading.error) for tag, reading in found.items() if reading.error}
        silent = '2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive'
        assert (errors['gone'], errors['too']) == (
            f'gone (N7:0 of station 9): {silent}', f'too (F8:0 of station 9): {silent}')
        for tag in 'sped', 'recipe':
            assert errors[tag].startswith(f"tag '{tag}' should be that of a row that is read: sp")
        assert plant.read('speed', partial=True)['speed'].value == values['speed']
        with pytest.raises(FormatError, match='tag None should be a text'):
            plant.read([None], partial=True)  # type: ignore[call-overload]


def test_map_without_such_rows_says_so(port: str, tmp_path: Path) -> None:
    with Client.from_files(*files(tmp_path, port, MAP[:MAP.index('speed')] + (
            'doors,Read,B3:0/0,2,PLC5,3,,,,\n'))) as plant, pytest.raises(
                FormatError, match="'doors' should be .* a row that is written: the map has none"):
        plant.write('doors', 1)


def test_names_of_a_client_are_those_of_the_library(port: str, tmp_path: Path) -> None:
    """Completion shows them."""
    everywhere = ['close', 'counters', 'read', 'stations', 'write']
    for made, more in (
            (partial(client, port), ['from_files', 'identify', 'read_many', 'station']),
            (partial(Client.from_files, *files(tmp_path, port)), ['rows', 'tags'])):
        with made() as here:
            assert sorted(everywhere + more) == [
                name for name in dir(here) if not name.startswith('_')]


def test_faults_of_the_files_are_told_before_the_port_is_opened(tmp_path: Path) -> None:
    rows = MAP + 'bad,Read,N7:x,1,SLC,1,,,,\nours,Read,N7:30,5,SLC,1,,,,\n'
    with pytest.raises(ConfigurationError) as error:
        Client.from_files(*files(tmp_path, '/dev/none', rows))
    assert [problem.place.line for problem in error.value.problems] == [9, 10]
    for map_file in str(tmp_path / 'map.csv'), 'nox.csv':
        with pytest.raises(ConfigurationError, match='^nix.csv: .*\n.*(map.csv:9|nox.csv)'):
            Client.from_files('nix.csv', map_file)
    with pytest.raises(ConfigurationError, match='^Mode: in Mode Listen nothing may be sent on'):
        Client.from_files(*files(
            tmp_path, '/dev/none', 'Tag,Command,Address,Station,PLC_Type,Period\n'
            'speed,Read,N7:0,1,SLC,9\n', 'Listen'))


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[str]:
    """Return the port of an SLC in full duplex."""
    plc = simulated_plc(1, 'SLC', time.monotonic, *FILES)
    plc.be_full_duplex()
    settings = Network(baud=9600, station=1).line
    machine = PEER.make_machine(settings, lambda: link.run(Nothing()), Counters())
    link = PEER.make_link(machine, settings, ActiveStationList(()), plc.serve, lambda event: None)
    with machine_line(tmp_path / 'line', machine) as name:
        yield name


def test_plc_without_diagnostic_status_needs_its_family(tmp_path: Path) -> None:
    plc = simulated_plc(1, 'SLC', time.monotonic, *FILES)
    plc.faults.status = (0x10,)
    with plc_line(tmp_path / 'line', plc) as name, Client(name, duplex='half') as here, \
            pytest.raises(FormatError, match=r'does not identify itself \(STS 10 .*name plc_type'):
        here.read('N7:0')
    with pytest.raises(FormatError, match='^it is "type 7", and its family is not known; say it$'):
        kind_of(lambda: Identity(None, 'type 7'), 'say it', 'it ')
    with pytest.raises(RemoteError):  # a gateway answers, and knows nothing of the PLC
        kind_of(Mock(side_effect=RemoteError(2, None, 'not there')), '')


@pytest.mark.parametrize('plc_type', ['SLC', None])
def test_write_through_a_device_server_follows_an_answer(
        plc_type: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('random.randrange', lambda end: end // 2)
    with socket.create_server(('127.0.0.1', 0)) as server, Client(
            f'socket://127.0.0.1:{server.getsockname()[1]}', plc_type=plc_type, timeout=0.1,
            retries=0) as here, server.accept()[0] as far:
        with pytest.raises(LinkError) as error:
            here.write('N7:0', 1)
        sent = far.recv(100)  # an echo or a status, and a TNS that begins anywhere
        assert (error.value.sent, sent[4], sent[7]) == (False, 0x06, 0x80)


def test_bug_in_the_thread_of_the_link_is_logged_and_ends_what_waits(port: str) -> None:
    class Broken(logging.Logger):

        def isEnabledFor(self, level: int) -> bool:  # noqa: N802
            return level == logging.CRITICAL or 1 // 0

    logger, log = Broken('broken'), list[str]()
    logger.addHandler(Mock(level=0, handle=lambda record: log.append(
        f'{record.levelname} {record.getMessage()} {record.exc_info[0].__name__}')))
    with line_with(port, 0.05, logger) as here, \
            pytest.raises(PortLost, match='^port lost: internal error, see the log$'):
        here.wait(here.start(9, identify()))
    assert log == ['CRITICAL internal error ZeroDivisionError']


def test_example_runs_in_full_duplex(peer: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = Path(__file__).parents[1] / 'docs' / 'library.md'
    example = page.read_text(encoding='utf-8').partition('```python\n')[2].partition('```')[0]
    names: dict[str, object] = {}
    exec(example.replace('/dev/ttyUSB0', peer), names)  # noqa: S102
    assert names['speeds'] == [0] * 10 and names['level'] == 0.0
    assert capsys.readouterr().out == 'SLC 5/03 series A revision 1, REM RUN\n'
    with Client(peer, own_station=1) as here:  # in full duplex both may have it
        here.write('N7:0', [1, 2])
        assert here.read('N7:0', 2) == [1, 2]
        assert here.identify().mode is Mode.REMOTE_RUN


@pytest.mark.parametrize('page', ['README.md', 'docs/library.md'])
def test_examples_of_the_pages_have_precise_types(page: str, tmp_path: Path) -> None:
    mypy = pytest.importorskip('mypy.api')
    text = (Path(__file__).parents[1] / page).read_text(encoding='utf-8')
    examples = re.findall('```python\n(.*?)```', text, re.DOTALL)
    assert examples
    source = tmp_path / 'example.py'
    source.write_text(examples[0] + """
words: list[int] = plc.read('N7:0', 10, 'int16')
word: int = plc.read('N7:0', kind='uint16')
height: float = plc.read('F8:0', kind='float32')
bits: list[bool] = plc.read('B3:0/0', 4, 'bool')
name: str = plc.read('ST9:0', kind='string')
natural: list[int] = plc.read('N7:0', 10)
both = sum(plc.read('N7:0', 10, 'int32')) + sum(natural)
many: dict[str, int] = plc.read_many(['N7:0', 'N7:5'])
with Client.from_files('net.csv', 'map.csv') as other:
    speed: float = other.read('speed')
    all_of: dict[str, float] = other.read(['speed', 'level'])
wrong: str = plc.read('N7:0', kind='int16')
""", encoding='utf-8')
    said, fault, _ = mypy.run(['--strict', '--no-error-summary', str(source)])
    *known, wrong = said.splitlines()
    assert (known, fault) == ([], '')
    assert 'expression has type "int", variable has type "str"' in wrong


def test_program_that_breaks_off_without_closing_ends(port: str) -> None:
    program = ('import sys; from abdf1_ros.client import Client; '
               'here = Client(sys.argv[1]); raise KeyboardInterrupt')
    said = subprocess.run([sys.executable, '-c', program, port], text=True, capture_output=True,
                          timeout=PATIENCE, check=False)
    assert said.stderr.endswith('KeyboardInterrupt\n')


class Nothing(TaskSource):
    """A node that has nothing to ask."""


def interrupt_after(lines: int) -> None:
    """Let KeyboardInterrupt come after so many lines of the standard library."""
    left = lines

    def trace(frame: FrameType, event: str, arg: object) -> Callable[..., Any]:
        nonlocal left
        left -= event == 'line' and 'abdf1_ros' not in frame.f_code.co_filename
        if left < 0:
            sys.settrace(None)
            raise KeyboardInterrupt
        return trace

    sys.settrace(trace)


def test_interrupt_while_a_result_is_awaited_keeps_no_lock_from_the_link() -> None:
    for lines in range(100):
        pending = Pending[int]()
        interrupt_after(lines)
        try:
            pending.wait(0.001)
            break
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(None)
        link = Thread(target=pending.succeed, args=(lines,), daemon=True)
        link.start()
        link.join(PATIENCE)
        assert pending.wait(-1.0) and pending.result() == lines  # it does not wait for more
    else:
        raise AssertionError('was always interrupted')


def test_our_address_is_that_of_a_net_file_that_names_none() -> None:
    """Not 0, which neither check protects (docs/connect.md)."""
    assert signature(Client).parameters['own_station'].default == FIELDS['station'].default == 5
