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
Let our node and our simulator exchange values with programs of others, and tell what came of it.

Every value of ``cases.py`` is read by the client, written by the client, read again, and looked
at on the other side. All that passes the line is kept as a capture. ``README.md`` tells how the
counterparts are had. The exit status is 0 when every value that the counterpart can handle was
right.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
import json
import os
from pathlib import Path
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty
from typing import Any, Protocol

_HERE = Path(__file__).resolve().parent
sys.path[:0] = map(str, Path(__file__).resolve().parents[:4])

from abdf1_ros.df1.checksum import Checksum  # noqa: E402
from abdf1_ros.df1.packet import Packet  # noqa: E402
from abdf1_ros.pccc.access import Access  # noqa: E402
from abdf1_ros.pccc.data_table import DataTable  # noqa: E402
from abdf1_ros.pccc.families import dialect_of  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType  # noqa: E402
from abdf1_ros.pccc.server import Server  # noqa: E402
from abdf1_ros.pccc.values import ValueType  # noqa: E402
from cases import AB_SERVER_CASES, Case, CASES, ETHERNET_CASES, same, Values  # noqa: E402
from ethernet import ask, DuplexLine, EthernetPlc, serve  # noqa: E402
from ours import (  # noqa: E402
    codec_of,
    End,
    NodeEnd,
    OURS,
    PlainEnd,
    PlcEnd,
    Setup,
    THEIRS,
    VIA,
    wanted,
    wired,
)
from plain import PlainLine  # noqa: E402
from shared import crowd, OWN, share, Tally  # noqa: E402
from support.ethernet_ip import EthernetClient  # noqa: E402
from support.odd_device import OddDevice  # noqa: E402
from support.ros import Process  # noqa: E402

PATIENCE = 60.0  # s for an answer of a player


class Player:
    """A program of players/, as a process under an interpreter that has the product."""

    def __init__(self, interpreter: str, program: str, *args: str) -> None:
        name = program if '.' in program else f'{program}.py'
        self._process = subprocess.Popen(
            [interpreter, str(_HERE / 'players' / name), *args], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self._said: list[str] = []
        threading.Thread(target=self._listen, daemon=True).start()
        if not self._answer().get('ready'):
            raise RuntimeError(f'{program} does not start: {"".join(self._said)}')

    def _listen(self) -> None:
        assert self._process.stderr
        self._said.extend(self._process.stderr)

    def _answer(self) -> dict[str, Any]:
        timer = threading.Timer(PATIENCE, self._process.kill)
        timer.start()
        assert self._process.stdout
        line = self._process.stdout.readline()
        timer.cancel()
        answer: dict[str, Any] = json.loads(line) if line else {
            'error': f'it has ended: {"".join(self._said)[-500:]}'}
        return answer

    def _ask(self, **request: object) -> dict[str, Any]:
        assert self._process.stdin
        try:
            print(json.dumps(request), file=self._process.stdin, flush=True)
        except BrokenPipeError:
            return {'error': 'it has ended'}
        return self._answer()

    def read(self, case: Case) -> dict[str, Any]:
        """Let it read."""
        return self._ask(do='read', address=case.address, count=case.count)

    def write(self, case: Case, values: Values) -> dict[str, Any]:
        """Let it write."""
        return self._ask(do='write', address=case.address, values=values)

    def close(self) -> None:
        """End it."""
        assert self._process.stdin
        with suppress(BrokenPipeError):  # it has ended by itself
            self._process.stdin.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()


class Df1dLink:
    """What df1d receives, over its socket; ``serve`` makes a reply of a command (link data)."""

    def __init__(self, port: int, serve: Callable[[bytes], bytes]) -> None:
        self._serve = serve
        self._socket = socket.create_connection(('127.0.0.1', port))
        name = b'interop'
        self._socket.sendall(bytes((THEIRS, len(name))) + name)
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        """Take SOH, length, message; say ACK; send SOH, length, reply."""
        with self._socket.makefile('rb') as incoming:
            while byte := incoming.read(1):
                if byte != b'\1':
                    continue  # df1d tells that a message of ours was acknowledged
                size, = incoming.read(1)
                reply = self._serve(incoming.read(size))
                self._socket.sendall(b'\6\1' + bytes((len(reply),)) + reply)

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


class Df1dSlave(Df1dLink):
    """A PLC of ours that has df1d as its link."""

    def __init__(self, port: int, setup: Setup) -> None:
        self._family = setup.family
        self._table = DataTable(setup.family)
        for case in setup.cases:
            address, codec = codec_of(case, setup.family)
            self._table.create(address, codec.words)
        server = Server(self._table)
        super().__init__(port, lambda data: server.serve(Packet.decode(data)).encode())

    def read(self, case: Case) -> dict[str, Any]:
        """Return what is in the table."""
        address, codec = codec_of(case, self._family)
        values = codec.decode(self._table.read(address, codec.words))
        return {'values': values if isinstance(values, str) else list(values)}

    def write(self, case: Case, values: Values) -> dict[str, Any]:
        """Put values into the table."""
        address, codec = codec_of(case, self._family)
        if codec.type is not ValueType.BOOL:
            self._table.write(address, codec.encode(wanted(values, codec.type)))
        else:
            assert not isinstance(values, str)
            for change in codec.bit_changes(address, values):
                self._table.write_bits(*change)
        return {'done': True}


class EthernetWords:
    """The words of an EtherNet/IP server that takes one client, over the shim's connection."""

    def __init__(self, plc: EthernetPlc, setup: Setup) -> None:
        self._plc = plc
        self._family = setup.family
        self._dialect = dialect_of(setup.family, Access(setup.access) if setup.access else None)

    def read(self, case: Case) -> dict[str, Any]:
        """Return what is there."""
        address, codec = codec_of(case, self._family)
        request = self._dialect.read(address, codec.words)
        data = self._dialect.read_data(address, codec.words, self._execute(*request))
        values = codec.decode(data)
        return {'values': values if isinstance(values, str) else list(values)}

    def write(self, case: Case, values: Values) -> dict[str, Any]:
        """Put values there."""
        address, codec = codec_of(case, self._family)
        self._execute(*self._dialect.write(address, codec.encode(wanted(values, codec.type))))
        return {'done': True}

    def _execute(self, cmd: int, data: bytes) -> bytes:
        reply = self._plc.execute(bytes((cmd, 0, 0x34, 0x12)) + data)
        if reply[1]:
            raise ValueError(f'refused: {reply.hex(" ")}')
        return reply[4:]

    def close(self) -> None:
        """End the connection."""
        self._plc.close()


@contextmanager
def ab_server(program: str, family: PlcType) -> Iterator[EthernetPlc]:
    """Run ab_server; give the connection to it."""
    number = free_port()
    kind = {PlcType.SLC: 'SLC500', PlcType.PLC5: 'PLC/5'}[family]
    with subprocess.Popen(
            [program, f'--plc={kind}', f'--port={number}', '--tag=N7[300]', '--tag=F8[20]',
             '--tag=ST18[10]', '--tag=L19[20]'],
            stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        try:
            until_open(number)
            yield EthernetPlc('127.0.0.1', number)
        finally:
            process.terminate()


class ServedPlc(OddDevice):
    """A PLC on a line for which an EtherNet/IP server works; the other station is but read."""

    execute: Callable[[bytes], bytes]

    def answer(self, data: bytes) -> tuple[int, bytes]:
        """Return status and data of a reply."""
        if data[2] & 0x0F != 0x0F:
            return super().answer(data)
        if data[0] != THEIRS:
            return 0, b'\x55' * data[7]
        reply = self.execute(data[2:])
        return reply[1], reply[4:]


class ServerEnd:
    """
    ab_server at the end of a line, as station 1.

    With the program df1d, in full duplex, its frames are those of df1d, so all of it is by others;
    else they are those of OddDevice.
    """

    def __init__(self, program: str, df1d_program: str, setup: Setup) -> None:
        self._stack = ExitStack()
        plc = self._stack.enter_context(ab_server(program, setup.family))
        self._words = EthernetWords(plc, setup)
        self._stack.callback(self._words.close)
        if df1d_program:
            number = self._stack.enter_context(
                df1d(df1d_program, setup.port, setup.check, setup.folder))
            self._stack.callback(Df1dLink(
                number, lambda data: data[1::-1] + plc.execute(data[2:])).close)
            return
        device = wired(ServedPlc, setup)
        device.execute = plc.execute
        self._stack.callback(PlainLine(setup.port, device).close)

    def give(self, case: Case, values: Values) -> None:
        """Put values there."""
        self._words.write(case, values)

    def take(self, case: Case, expected: Values) -> Values:
        """Return what is there."""
        values: Values = self._words.read(case)['values']
        return values

    def close(self) -> None:
        """End it."""
        self._stack.close()


class Partner(Protocol):
    """What our end exchanges values with; an answer is what ``players/player.py`` describes."""

    def read(self, case: Case) -> dict[str, Any]: ...

    def write(self, case: Case, values: Values) -> dict[str, Any]: ...

    def close(self) -> None: ...


@contextmanager
def tapped(folder: Path, capture: Path | None) -> Iterator[tuple[str, str]]:
    """Give the names of both ends of a line, of which all is kept; ">" comes from the first."""
    first, second = (str(folder / name) for name in ('first', 'second'))
    save = capture or folder / 'line.cap'
    save.unlink(missing_ok=True)
    with Process('sniff', '--tap', f'pty:{first}', f'pty:{second}', '--save', str(save),
                 '--summary') as tap:
        tap.wait_for('listening')
        yield first, second


def free_port() -> int:
    """Return a TCP port of the loopback that nobody has."""
    with socket.socket() as trial:
        trial.bind(('127.0.0.1', 0))
        number: int = trial.getsockname()[1]
        return number


@contextmanager
def df1d(program: str, device: str, check: Checksum, folder: Path) -> Iterator[int]:
    """Run df1d on a device; give its TCP port."""
    port = free_port()
    config = folder / 'df1d.xml'
    config.write_text(
        f'<?xml version="1.0"?>\n<df1d_config><connection><name>interop</name>'
        f'<duplex>full</duplex><error_detect>{check.value.lower()}</error_detect>'
        f'<device>{device}</device><baud>19200</baud><port>{port}</port>'
        '<duplicate_detect>yes</duplicate_detect><max_nak>3</max_nak><max_enq>3</max_enq>'
        '<ack_timeout>1000</ack_timeout></connection></df1d_config>\n')
    with subprocess.Popen([program, '-f', str(config)], stderr=subprocess.DEVNULL) as process:
        try:
            until_open(port)
            yield port
        finally:
            process.terminate()


def until_open(port: int) -> None:
    """Wait until somebody listens."""
    end = time.monotonic() + 10
    while True:
        try:
            socket.create_connection(('127.0.0.1', port)).close()
            return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


@dataclass(frozen=True, slots=True)
class Run:
    """One exchange: who it is with, and what stands at our end."""

    name: str
    family: PlcType
    check: Checksum
    ours: str  # plc, node (Serve), client
    start: Callable[[Setup, str, ExitStack], Partner]
    only: tuple[str, ...] = ()  # addresses
    access: str = ''
    has_link: bool = True  # its frames on the line are its own
    reach: Callable[[str], Partner] | None = None  # starts it at the host:port of an eip: place

    @property
    def text(self) -> str:
        """Return the name of its capture."""
        role = {'plc': 'simulator', 'node': 'serve', 'client': 'node_client'}[self.ours]
        return f'{self.name}_{role}_{self.family.value}_{self.check.value}'.lower()


def carry_out(run: Run, save: Path | None) -> list[tuple[str, str, bool]]:
    """Return for each address what came of it, and whether that is good."""
    cases = [case for case in CASES if not run.only or case.address in run.only]
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        capture = save / f'{run.text}.cap' if save else None
        first, second = stack.enter_context(tapped(folder, capture))
        # The initiator has the first end, so that its bytes are those with ">".
        mine, theirs = (first, second) if run.ours == 'client' else (second, first)
        setup = Setup(run.family, run.check, mine, cases, folder, run.access, run.ours == 'node')
        # All words have their first values before anything is said, so a capture is complete.
        if run.ours == 'client':
            partner = run.start(setup, theirs, stack)
            stack.callback(partner.close)
            given = [partner.write(case, case.before) for case in cases]
            ours: End = NodeEnd(setup)
            stack.callback(ours.close)
            return [client_case(ours, partner, *entry) for entry in zip(cases, given)]
        ours = PlcEnd(setup) if run.ours == 'plc' else NodeEnd(setup)
        stack.callback(ours.close)
        for case in cases:
            ours.give(case, case.before)
        partner = run.start(setup, theirs, stack)
        stack.callback(partner.close)
        return [server_case(ours, partner, case) for case in cases]


@dataclass(frozen=True, slots=True)
class FarEnd:
    """
    What stands at the end of the line of a place.

    It has the words of ``cases`` by family, knows these checks and modes, and lacks the commands
    of the runs ``not_for``.
    """

    name: str
    start: Callable[[Setup], End]
    cases: dict[PlcType, tuple[Case, ...]]
    checks: tuple[Checksum, ...]
    modes: tuple[str, ...] = ('Peer', 'Master', 'Via')
    not_for: tuple[str, ...] = ()

    @classmethod
    def known(cls, server: str = '', link: str = '') -> Iterator[FarEnd]:
        """Yield all of them, those with the programs ab_server and df1d if they are there."""
        words = {family: CASES + ETHERNET_CASES[family.value]
                 for family in (PlcType.SLC, PlcType.PLC5)}
        yield cls('simulator', PlcEnd, words, tuple(Checksum))
        yield cls('plain', PlainEnd, words, (Checksum.CRC,))
        served = {PlcType.SLC: AB_SERVER_CASES}
        masked = ('pycomm3',)  # it writes with a mask (AB), which ab_server does not know
        if server:
            yield cls('ab_server', partial(ServerEnd, server, ''), served, (Checksum.CRC,),
                      not_for=masked)
        if server and link:
            yield cls('ab_server behind df1d', partial(ServerEnd, server, link), served,
                      tuple(Checksum), ('Peer',), masked)


def through_place(run: Run, mode: str, save: Path | None,
                  far: FarEnd) -> list[tuple[str, str, bool]]:
    """
    Let an EtherNet/IP client reach a PLC at a place of our node; return what came of it.

    In Mode Master a second station has other values at the same addresses; "Via" is Mode Master
    with both stations behind a gateway. ``far`` is the PLC.
    """
    cases = far.cases[run.family]
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        capture = save / f'{run.name}_place_{mode}_{run.check.value}.cap'.lower() if save else None
        first, second = stack.enter_context(tapped(folder, capture))
        number = free_port()
        setup = Setup(
            run.family, run.check, second, [*cases, OWN], folder,
            mode='Peer' if mode == 'Peer' else 'Master', via=VIA if mode == 'Via' else None,
            share=f'eip:127.0.0.1:{number}?station={THEIRS}', rights='All')
        plc = far.start(setup)
        stack.callback(plc.close)
        for case in cases:
            plc.give(case, case.before)
        node = NodeEnd(replace(setup, port=first, cases=(OWN,)))
        stack.callback(node.close)
        until_open(number)
        assert run.reach is not None
        partner = run.reach(f'127.0.0.1:{number}')
        stack.callback(partner.close)
        return [server_case(plc, partner, case) for case in cases]


def through_places(run: Run, options: argparse.Namespace) -> bool:
    """Let a client reach each far end in each mode; return whether all was good."""
    if run.ours != 'plc' or run.reach is None:
        return True
    all_good = True
    for far in FarEnd.known(options.ab_server, options.df1d):
        if run.check in far.checks and run.family in far.cases and run.name not in far.not_for:
            for mode in far.modes:
                all_good &= show(f'{run.text}, {mode}, {far.name}',
                                 through_place(run, mode, options.save, far))
    return all_good


def crowd_at_place(run: Run, mode: str, sessions: int, seconds: float) -> Tally:
    """Let many sessions of a product reach our PLC at one place of our node."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ends = stack.enter_context(tapped(folder, None))
        place = f'127.0.0.1:{free_port()}'
        setup = Setup(run.family, run.check, '', (), folder, mode=mode,
                      share=f'eip:{place}?station={THEIRS}')

        def reach(name: str) -> Partner:
            until_open(int(name.rpartition(':')[2]))
            assert run.reach is not None
            return run.reach(name)

        return crowd(setup, ends, place, reach, sessions, seconds, stack)


class OwnEthernetClient:
    """A client of our own at an eip: place, byte by byte."""

    def __init__(self, family: PlcType, name: str) -> None:
        self._family, self._dialect, self._tns = family, dialect_of(family), 0
        host, _, port = name.rpartition(':')
        self._client = EthernetClient(host, int(port), is_connected=True)

    def read(self, case: Case) -> dict[str, Any]:
        """Read."""
        address, codec = codec_of(case, self._family)
        answer = self._execute(*self._dialect.read(address, codec.words))
        if 'error' in answer:
            return answer
        values = codec.decode(self._dialect.read_data(address, codec.words, answer['data']))
        return {'values': values if isinstance(values, str) else list(values)}

    def write(self, case: Case, values: Values) -> dict[str, Any]:
        """Write words, or bits."""
        address, codec = codec_of(case, self._family)
        if codec.type is ValueType.BOOL:
            assert not isinstance(values, str)
            requests = [self._dialect.write_bits(*change)
                        for change in codec.bit_changes(address, values)]
        else:
            requests = [self._dialect.write(address, codec.encode(wanted(values, codec.type)))]
        answers = [self._execute(*request) for request in requests]
        return next((answer for answer in answers if 'error' in answer), {'done': True})

    def _execute(self, cmd: int, data: bytes) -> dict[str, Any]:
        self._tns = self._tns % 0xFFFF + 1
        reply = self._client.execute(bytes((cmd, 0)) + self._tns.to_bytes(2, 'little') + data)
        assert reply[2:4] == self._tns.to_bytes(2, 'little')
        return {'error': f'STS {reply[1]:02X}'} if reply[1] else {'data': reply[4:]}

    def close(self) -> None:
        """Hang up."""
        self._client.close()


def share_line(run: Run, mode: str, rounds: int) -> Tally:
    """Let two programs of a product share the line of our node."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ends = stack.enter_context(tapped(folder, None))
        setup = Setup(run.family, run.check, '', (), folder, mode=mode)
        return share(setup, ends, run.start, rounds, stack)


def judge(run: Run, case: str) -> None:
    """Let conform judge who answers us, by all of its cases or by one."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        mine, theirs = stack.enter_context(tapped(folder, None))
        cases = [entry for entry in CASES if not run.only or entry.address in run.only]
        partner = run.start(Setup(run.family, run.check, mine, cases, folder), theirs, stack)
        stack.callback(partner.close)
        for entry in cases:
            partner.write(entry, entry.before)
        subprocess.run(
            [sys.executable, '-m', 'abdf1_ros', 'conform', 'peer', '--port', mine, '--check',
             run.check.value, '--station', str(THEIRS), '--family', run.family.value, '--words',
             'N7:30', '--yes', '--answer-time', '4', *(('--only', case) if case else ())],
            check=False)


def server_case(ours: End, partner: Partner, case: Case) -> tuple[str, str, bool]:
    """Let the other end read, write and read words of ours."""
    told, good = [], True
    answer = partner.read(case)
    told.append(f'read {verdict(answer, case.before)}')
    good &= 'cannot' in answer or same(case.before, answer.get('values'))
    answer = partner.write(case, case.after)
    if 'cannot' in answer:
        told.append(f'write: cannot ({answer["cannot"]})')
    elif 'error' in answer:
        told.append(f'write {answer["error"]}')
        good = False
    else:
        there = ours.take(case, case.after)
        told.append('write good' if same(case.after, there) else f'write WRONG: {there}')
        good &= same(case.after, there)
        answer = partner.read(case)
        told.append(f'read {verdict(answer, case.after)}')
        good &= 'cannot' in answer or same(case.after, answer.get('values'))
    return case.address, '; '.join(told), good


def client_case(ours: End, partner: Partner, case: Case,
                answer: dict[str, Any]) -> tuple[str, str, bool]:
    """Read, write and read words of the other end."""
    told, good = [], True
    if 'cannot' in answer:
        return case.address, f'cannot ({answer["cannot"]})', True
    if 'error' in answer:
        return case.address, f'its own write: {answer["error"]}', False
    got = ours.take(case, case.before)
    told.append('read good' if same(case.before, got) else f'read WRONG: {got}')
    good &= same(case.before, got)
    if case.is_structure:
        return case.address, f'{told[0]}; write: cannot (belongs to the processor)', good
    ours.give(case, case.after)
    got = ours.take(case, case.after)
    answer = partner.read(case)
    told.append(f'write {verdict(answer, case.after)}')
    told.append('read good' if same(case.after, got) else f'read WRONG: {got}')
    return case.address, '; '.join(told), good and same(case.after, got) and same(
        case.after, answer.get('values'))


def verdict(answer: dict[str, Any], expected: Values) -> str:
    """Return what an answer to a read is worth."""
    if 'values' in answer:
        values = answer['values']
        return 'good' if same(expected, values) else f'WRONG: {values}, should be {expected}'
    return f'cannot ({answer["cannot"]})' if 'cannot' in answer else str(answer['error'])


def df1py3_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with df1py3, which knows CRC and SLC commands."""
    def start(setup: Setup, port: str, stack: ExitStack) -> Partner:
        return Player(options.python, 'df1py3_client', port)

    return [Run('df1py3', PlcType.SLC, Checksum.CRC, ours, start) for ours in ('plc', 'node')]


def libpccc_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with libpccc over df1d, and with a PLC of ours behind df1d."""
    def client(setup: Setup, port: str, stack: ExitStack) -> Partner:
        number = stack.enter_context(df1d(options.df1d, port, setup.check, setup.folder))
        return Player(options.python, 'libpccc_client', options.library, str(number))

    def slave(setup: Setup, port: str, stack: ExitStack) -> Partner:
        number = stack.enter_context(df1d(options.df1d, port, setup.check, setup.folder))
        return Df1dSlave(number, setup)

    return [
        *(Run('libpccc', PlcType.SLC, check, ours, client)
          for ours in ('plc', 'node') for check in Checksum),
        *(Run('df1d', family, check, 'client', slave)
          for family in (PlcType.SLC, PlcType.PLC5) for check in Checksum)]


def abdf1_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with AbDf1; its library is made for one check."""
    def player(port: str, own: int, station: int, cases: Sequence[Case]) -> Partner:
        return Player(options.python, 'abdf1_ioc', options.library, port, str(own),
                      str(station), *(f'{case.address} {case.count}' for case in cases))

    def client(setup: Setup, port: str, stack: ExitStack) -> Partner:
        return player(port, 0, OURS if setup.serves else THEIRS, setup.cases)

    def server(setup: Setup, port: str, stack: ExitStack) -> Partner:
        return player(port, THEIRS, THEIRS, setup.cases)

    check = Checksum(options.check)
    # It reads from its first to its last record of a file, so words between Serve rows matter;
    # what it serves it lets others write one element at a time.
    return [
        Run('abdf1', PlcType.PLC5, check, 'plc', client),
        Run('abdf1', PlcType.PLC5, check, 'node', client, ('N7:0', 'F8:0', 'S:10')),
        Run('abdf1', PlcType.PLC5, check, 'client', server,
            ('N7:30', 'N7:40/3', 'F8:6', 'S:10'))]


@contextmanager
def device_server(device: str) -> Iterator[int]:
    """Put a port behind a TCP port, as a raw device server does; give the number of that."""
    descriptor = os.open(device, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(descriptor)
    ended = threading.Event()

    def relay(listening: socket.socket) -> None:
        connection, _ = listening.accept()
        with connection:
            while not ended.is_set():
                ready, _, _ = select.select([descriptor, connection], [], [], 0.1)
                if descriptor in ready:
                    connection.sendall(os.read(descriptor, 4096))
                if connection in ready:
                    data = connection.recv(4096)
                    if not data:
                        return
                    os.write(descriptor, data)

    with socket.create_server(('127.0.0.1', 0)) as listening:
        thread = threading.Thread(target=relay, args=(listening,), daemon=True)
        thread.start()
        yield listening.getsockname()[1]
        ended.set()
        thread.join(1)
    os.close(descriptor)


def advancedhmi_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with AdvancedHMI's driver for DF1 over TCP, for an SLC and a PLC-5."""
    def start(setup: Setup, port: str, stack: ExitStack) -> Partner:
        number = stack.enter_context(device_server(port))
        return Player(options.python, 'advancedhmi_client', options.assembly, str(number),
                      setup.check.value, setup.family.value)

    return [Run('advancedhmi', family, check, ours, start)
            for family in (PlcType.SLC, PlcType.PLC5) for ours in ('plc', 'node')
            for check in Checksum]


def ethernet_player(program: str, interpreter: str, *args: str) -> Callable[[str], Partner]:
    """Return what starts an EtherNet/IP client that talks to a host:port."""
    def reach(name: str) -> Partner:
        return Player(interpreter, program, *(name if arg == 'HOST' else arg for arg in args))

    return reach


def ethernet_client(reach: Callable[[str], Partner]
                    ) -> Callable[[Setup, str, ExitStack], Partner]:
    """Return what starts an EtherNet/IP client with the shim before the line."""
    def start(setup: Setup, port: str, stack: ExitStack) -> Partner:
        line = DuplexLine(port, setup.check)
        stack.callback(line.close)
        listening = stack.enter_context(socket.create_server(('127.0.0.1', 0)))
        station = OURS if setup.serves else THEIRS
        threading.Thread(target=serve, daemon=True, args=(
            listening, lambda command: line.execute(command, 0, station))).start()
        return reach(f'127.0.0.1:{listening.getsockname()[1]}')

    return start


def pycomm3_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with pycomm3's driver for SLC and MicroLogix."""
    reach = ethernet_player('pycomm3_client', options.python, 'HOST')
    start = ethernet_client(reach)
    # It reads whole elements for their members, of which a Serve row may have one word only.
    rows = tuple(case.address for case in CASES if '.' not in case.address)
    return [Run('pycomm3', PlcType.SLC, check, ours, start, rows if ours == 'node' else (),
                reach=reach)
            for ours in ('plc', 'node') for check in Checksum]


def our_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with a client of our own, for eip: places alone."""
    return [Run('ourselves', PlcType.SLC, check, 'plc', _needs_place,
                reach=partial(OwnEthernetClient, PlcType.SLC)) for check in Checksum]


def _needs_place(setup: Setup, port: str, stack: ExitStack) -> Partner:
    raise SystemExit('a client of our own needs --place or --sessions')


def node_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with node-drivers, for a PLC-5, and nodepccc, for an SLC."""
    reach = {name: ethernet_player('node_client.mjs', options.node, options.modules, name, 'HOST')
             for name in ('node-drivers', 'nodepccc')}
    return [
        Run(name.replace('-', '_'), family, check, ours, ethernet_client(reach[name]),
            reach=reach[name])
        for name, family in (('node-drivers', PlcType.PLC5), ('nodepccc', PlcType.SLC))
        for ours in ('plc', 'node') for check in Checksum]


def libplctag_runs(options: argparse.Namespace) -> list[Run]:
    """Return the runs with libplctag as client, and with its ab_server."""
    names = {PlcType.SLC: 'slc500', PlcType.PLC5: 'plc5'}
    reach = {family: ethernet_player(
        'libplctag_client', options.python, options.library, 'HOST', name)
        for family, name in names.items()}
    runs = [
        Run('libplctag', family, check, ours, ethernet_client(reach[family]),
            reach=reach[family])
        for family in names for ours in ('plc', 'node') for check in Checksum]
    if not options.ab_server:
        return runs

    def server(setup: Setup, port: str, stack: ExitStack) -> Partner:
        plc = stack.enter_context(ab_server(options.ab_server, setup.family))
        line = DuplexLine(port, setup.check)
        ended = threading.Event()
        thread = threading.Thread(target=ask, args=(line, plc.execute, ended.is_set))
        thread.start()
        stack.callback(thread.join)
        stack.callback(ended.set)
        return EthernetWords(plc, setup)

    # As a PLC-5 it refuses libplctag's own writes of floats: one counts words, the other floats.
    return runs + [
        run for check in Checksum for run in (
            Run('ab_server', PlcType.SLC, check, 'client', server, ('N7:0', 'N7:20', 'F8:0'),
                has_link=False),
            Run('ab_server', PlcType.PLC5, check, 'client', server, ('N7:0', 'N7:20'),
                'WordRange', has_link=False))]


def show(name: str, told: list[tuple[str, str, bool]]) -> bool:
    """Print what came of a run; return whether all was good."""
    print(f'{name}:', flush=True)
    for address, text, good in told:
        print(f'  {"good" if good else "BAD "} {address:<10} {text}', flush=True)
    return all(good for _, _, good in told)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--save', type=Path, help='a folder for the captures')
    parser.add_argument('--python', default=sys.executable, help='that has the product')
    parser.add_argument('--conform', metavar='CASE', nargs='?', const='',
                        help='let conform judge those that answer us, by one case or all')
    parser.add_argument('--share', metavar='ROUNDS', type=int,
                        help='let two of them share the line of our node')
    parser.add_argument('--only', default='', help='only runs whose name has this in it')
    parser.add_argument('--place', action='store_true',
                        help='let those that speak EtherNet/IP reach our PLC through our node')
    parser.add_argument('--sessions', metavar='NUMBER', type=int,
                        help='let so many of them share one such place (16)')
    parser.add_argument('--seconds', metavar='S', type=float, default=600.0,
                        help='how long (600)')
    parser.add_argument('--ab-server', metavar='PROGRAM', default='',
                        help='ab_server of libplctag; with --place it is one more PLC')
    parser.add_argument('--df1d', metavar='PROGRAM', default='',
                        help='df1d of libpccc; with --place it is the link of ab_server')
    products = parser.add_subparsers(dest='product', required=True)
    products.add_parser('df1py3').set_defaults(runs=df1py3_runs)
    entry = products.add_parser('libpccc')
    entry.set_defaults(runs=libpccc_runs)
    entry.add_argument('--library', required=True, help='libpccc.so.1.1')
    entry = products.add_parser('abdf1')
    entry.set_defaults(runs=abdf1_runs)
    entry.add_argument('--library', required=True, help='libAbDf1.so')
    entry.add_argument('--check', choices=[check.value for check in Checksum], default='CRC',
                       help='the check that the library was made for')
    entry = products.add_parser('advancedhmi')
    entry.set_defaults(runs=advancedhmi_runs)
    entry.add_argument('--assembly', required=True, help='MfgControl.AdvancedHMI.Drivers.dll')
    products.add_parser('pycomm3').set_defaults(runs=pycomm3_runs)
    products.add_parser('ourselves').set_defaults(runs=our_runs)
    entry = products.add_parser('node')
    entry.set_defaults(runs=node_runs)
    entry.add_argument('--node', default='node', help='Node.js')
    entry.add_argument('--modules', required=True, help='node_modules with both products')
    entry = products.add_parser('libplctag')
    entry.set_defaults(runs=libplctag_runs)
    entry.add_argument('--library', required=True, help='libplctag.so')
    return parser.parse_args()


def main() -> int:
    """Carry out the runs with one product."""
    options = _options()
    if options.save:
        options.save.mkdir(parents=True, exist_ok=True)
    all_good = True
    for run in options.runs(options):
        if options.only not in run.text:
            continue
        if options.place:
            all_good &= through_places(run, options)
        elif options.sessions is not None:
            is_for_all = run.ours == 'plc' and run.reach and run.check is Checksum.CRC
            for mode in ('Peer', 'Master') if is_for_all else ():
                tally = crowd_at_place(run, mode, options.sessions, options.seconds)
                print(f'{run.text}, {mode}:\n{tally}', flush=True)
                all_good &= tally.is_good
        elif options.share is not None:
            for mode in ('Peer', 'Master') if run.ours == 'plc' else ():
                tally = share_line(run, mode, options.share)
                print(f'{run.text}, {mode}:\n{tally}', flush=True)
                all_good &= tally.is_good
        elif options.conform is None:
            all_good &= show(run.text, carry_out(run, options.save))
        elif run.ours == 'client':
            print(f'{run.text}:' if run.has_link else
                  f'{run.text}: not judged, as its frames are ours', flush=True)
            if run.has_link:
                judge(run, options.conform)
    return not all_good


if __name__ == '__main__':
    sys.exit(main())
