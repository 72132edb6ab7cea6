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

"""A bridge in Mode Listen beside a master that was written here, byte by byte."""

from dataclasses import replace
import os
from pathlib import Path
import select
import threading
import time

from abdf1_ros.driver import overheard
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.diagnostics.status import ERROR, OK
import pytest
from std_msgs.msg import Int16MultiArray
from std_srvs.srv import SetBool, Trigger
from support.odd_device import frame
from support.ptys import Pty
from support.ros import details, Observer, ros_args, until_status, write_csv

NET = 'Mode,Com_Port,Listen_Port,Baud'
MAP = 'Tag,Command,Address,Station,PLC_Type,Length,Period'


class ForeignMaster(threading.Thread):
    """
    Another master and its SLC, station 1: two words from N7:0 are read 20 times a second.

    What the master says goes to ``theirs``, the rest to ``far``: the same where one wire carries
    both. In full duplex there are no polls. It writes one byte at a time.
    """

    def __init__(self, theirs: Pty, far: Pty, *, is_full: bool) -> None:
        super().__init__(daemon=True)
        self.count = 0
        self.is_over = threading.Event()
        self._theirs, self._far, self._is_full = theirs, far, is_full

    def run(self) -> None:
        while not self.is_over.wait(0.05):
            self.count = (self.count + 1) % 100 + 0x20
            tns = bytes((self.count, 0x33))
            ask = b'\x01\x00\x0F\x00' + tns + b'\xA2\x04\x07\x89\x00\x00'
            answer = b'\x00\x01\x4F\x00' + tns + bytes((self.count, 0, 0x2A, 0))
            if self._is_full:
                self._say(self._theirs, frame(ask))
                self._say(self._far, b'\x10\x06')
            else:
                self._say(self._theirs, frame(ask, 1))
                self._say(self._far, b'\x10\x06')
                self._say(self._theirs, b'\x10\x05\x01\xFF')
            self._say(self._far, frame(answer))
            self._say(self._theirs, b'\x10\x06')

    @staticmethod
    def _say(pty: Pty, data: bytes) -> None:
        for byte in data:
            pty.write(bytes((byte,)))
        time.sleep(0.002)


@pytest.mark.parametrize('is_full', [False, True])
def test_values_come_from_the_traffic_of_another_master(
        tmp_path: Path, ptys: list[Pty], is_full: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overheard, 'SILENT_AFTER', 4.0)
    with Observer('observer') as ros:
        listen(ros, tmp_path, ptys, is_full=is_full)


def listen(ros: Observer, tmp_path: Path, ptys: list[Pty], *, is_full: bool) -> None:
    """Let a bridge listen, and look at all that it tells."""
    second = str(ptys[1].name) if is_full else ''
    net = write_csv(tmp_path / 'net.csv', NET, [f'Listen,{ptys[0].name},{second},19200'])
    rows = write_csv(tmp_path / 'map.csv', MAP, [
        'levels,Read,N7:0,1,SLC,2,100', 'unread,Read,N7:50,1,SLC,1,100'])
    master = ForeignMaster(ptys[0], ptys[1] if is_full else ptys[0], is_full=is_full)
    master.start()
    levels = ros.listen(Int16MultiArray, '/abdf1/read/levels')
    diagnostics = ros.diagnostics(ptys[0].name)
    bridge = BridgeNode(context=ros.context, use_global_arguments=False, cli_args=ros_args(
        f'net_file:={net}', f'map_file:={rows}', 'diagnostics_period:=0.2',
        f'trace_file:={tmp_path / "line.cap"}'))
    ros.run(bridge)
    try:
        message = levels.until(lambda message: message.data[1] == 42, 'a value')
        assert 0x20 <= message.data[0] <= 0x84
        link = until_status(diagnostics, 'link', OK, lambda status: any(
            value.key.startswith('heard of station 1') for value in status.values))
        shown = details(link)
        assert any(key == 'heard of station 1: protected typed logical read N7:0, 2 words'
                   for key in shown)
        if is_full:  # it takes 4 s
            until_status(  # on a busy host levels is stale at times
                diagnostics, 'mappings', ERROR, lambda status: 'levels' not in details(status)
                and 'no other node reads it' in details(status).get('unread', ''))
        answer = ros.call(Trigger, '/abdf1/read_link_counters', Trigger.Request())
        assert (answer.success, answer.message) == (False, 'Mode Listen: nothing is sent')
        master.is_over.set()
        until_status(diagnostics, 'mappings', ERROR,
                     lambda status: details(status).get('levels', '').startswith('stale'))
        if not is_full:  # it takes 4 s
            until_status(diagnostics, 'link', ERROR, lambda status:
                         'none of 1 stations is heard' in status.message)
        answer = ros.call(SetBool, '/abdf1/polling', SetBool.Request(data=False))
        assert answer.success
        before, now = {*bridge.publishers}, bridge.session.configuration
        bridge.hand_over(replace(now, network=replace(now.network, listen_port='/.')))
        assert len(before - {*bridge.publishers}) == 2  # perhaps there are other PLCs
    finally:
        master.is_over.set()
        ros.end(bridge)
    for pty in ptys:
        assert not select.select([pty.fileno()], [], [], 0.1)[0], os.read(pty.fileno(), 100)
    capture = (tmp_path / 'line.cap').read_text()
    assert '# check' in capture and '# duplex: auto' in capture  # sniff finds that out
    directions = {line.split()[1] for line in capture.splitlines() if not line.startswith('#')}
    assert directions == ({'>', '<'} if is_full else {'?'})
