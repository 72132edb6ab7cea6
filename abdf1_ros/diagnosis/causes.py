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
The table of causes: from the traces of a line to one cause and one next step.

The first rule that holds gives the cause. A rule whose cause is not sure names the question that
decides. docs/troubleshooting.md prints the table, with the ``example`` of each rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.radio import RADIO
from abdf1_ros.df1.slave_link import SLAVE
from abdf1_ros.df1.stations import MOST_IN_VAIN
from abdf1_ros.diagnosis.traces import Traces


class Decider(Enum):
    """A question that decides between causes; no question writes to a PLC."""

    POLL = 'one poll of the station'
    HALF_DUPLEX = 'one poll, as in half duplex'
    OTHER_CHECK = 'one command with another check'
    NEIGHBOUR = 'one poll of another station'
    LATER = 'one second more for the reply'
    ECHOES = 'echoes with and without the bytes 11, 13 and FF hex'


@dataclass(frozen=True, slots=True)
class Rule:
    """
    A cause, and the traces that show it.

    - ``seen``: these traces in words; ``holds`` tells whether a line has shown them.
    - ``cause`` and ``step``: texts with fields of ``Traces`` as ``t``.
    - ``example``: traces for which this is the first rule that holds.
    - ``asks``: the question that decides whether it is this cause, None if that is sure.
    - ``is_of_all``: the cause is the same for all settings that were tried.
    """

    seen: str
    holds: Callable[[Traces], bool]
    cause: str
    step: str
    example: Traces = field(repr=False)
    asks: Decider | None = None
    is_of_all: bool = False


_COMES_BACK, _CABLE = COMES_BACK.split('; ')
_OTHER_SETTINGS = '"plc detect" tries other settings; another parity only with --parity'
_NOISE = ('check shield (grounded at one end), ground, terminators and motor cables; then use a '
          'lower baud rate')
_ONE, _TWO = b'\x10\x06', b'\x10\x15'

RULES = (
    Rule('half duplex: our own bytes, and no others',
         lambda t: t.echoes and not t.characters and t.mode.is_master and not t.settings,
         'our own bytes come back, and nothing else: TX and RX are connected, or the adapter '
         'echoes and station {t.on_line} is silent',
         'take the cable off the PLC: if they still come, and the adapter has one pair of wires, '
         'look at station {t.on_line}: power, number, plug and settings; otherwise at the cable',
         Traces(echoes=True)),
    Rule('our own bytes, and no others',
         lambda t: t.echoes and not t.characters,
         _COMES_BACK, _CABLE, Traces(PEER, echoes=True)),
    Rule('polls, or messages to a station, that are not ours',
         lambda t: bool(t.masters),
         'another master polls {t.stations} of this line, and two masters destroy their messages',
         'end one of them, or only listen: "plc init" writes files for Mode Listen',
         Traces(masters=(1, 2))),
    Rule('Mode Slave: no poll of our number',
         lambda t: t.mode.is_polled and not t.polled,
         'no master has polled us, station {t.own}',
         '"plc detect" lists the stations that the master polls; give one of them with '
         '--own-station', Traces(SLAVE)),
    Rule('a message with the check of Modbus RTU',
         lambda t: t.is_modbus and not t.replies,  # noise may have its check
         'a device that speaks Modbus RTU is at the far end',
         'set the channel of the PLC to DF1, or find the right cable',
         Traces(characters=8, first=bytes.fromhex('01 03 00 00 00 0A C5 CD'))),
    Rule('printable text, and nothing else',
         lambda t: t.is_text,
         'text comes, and no DF1: the channel of the PLC is in User (ASCII) mode, or the far end '
         'is a reader, a scale, a modem, a login prompt or a web page',
         'set the channel to DF1, or find the right cable or TCP port',
         Traces(characters=13, first=b'TEMP 23.4 C\r\n')),
    Rule('replies to our commands, with another number in place of ours',
         lambda t: t.other_number is not None and t.gateway is None,
         'replies come to number {t.other_number}, not to ours: a gateway such as the 1770-KF2 '
         'and KF3 replies to its own number',
         'make it our Station: {t.other_number} in net.csv, or --own-station {t.other_number} of '
         '"plc"', Traces(PEER, acks=1, other_number=8)),
    Rule('full duplex: replies to commands that are not ours',
         lambda t: t.foreign is not None and t.mode.has_one_plc,
         'replies to number {t.foreign} come, to commands that are not ours: a second device has '
         'the same port, by a passive splitter',
         'take it off; it may use Share', Traces(PEER, foreign=0)),
    Rule('replies from a number that we have not asked',
         lambda t: t.other_source is not None and not t.replies,
         'replies come from number {t.other_source}, in place of {t.station}',
         '--station {t.other_source}, if that is the PLC; if {t.station} is a gateway, --via '
         '{t.station} --station {t.other_source}',
         Traces(station=2, acks=1, polls=9, polls_answered=9, other_source=3)),
    Rule('replies of the station, to commands that we have not sent',
         lambda t: t.strays > 0 and not t.replies and not t.late,
         'replies of station {t.station} come, and none is to a command of ours: another program '
         'asks with our number, {t.own}, or something on the way has kept old replies',
         'end that program; switch the device server or modem on the way off and on',
         Traces(PEER, acks=1, strays=1)),
    Rule('half duplex: polls are answered; commands are, but only with another check',
         lambda t: t.mode.is_master and t.takes_other_check is True,
         'station {t.on_line} answers polls, and takes commands with {t.other_check} only',
         'Error_Code is {t.other_check} in net.csv, --check {t.other_check} of "plc"',
         Traces(polls=1, polls_answered=1, takes_other_check=True)),
    Rule('full duplex: DLE NAK to all messages, but not with another check',
         lambda t: t.takes_other_check is True,
         'the PLC answers DLE NAK to all with {t.check.value}, and takes commands with '
         '{t.other_check}',
         'Error_Code is {t.other_check} in net.csv, --check {t.other_check} of "plc"',
         Traces(PEER, naks=4, takes_other_check=True)),
    Rule('an echo comes back whole, but not with the bytes 11 and 13 hex',
         lambda t: t.swallowed == b'\x11\x13',
         'bytes 11 and 13 hex do not pass: flow control (XON/XOFF) on the way, as of a device '
         'server, swallows them',
         'set its flow control to none', Traces(damaged=2, swallowed=b'\x11\x13')),
    Rule('an echo comes back whole, but not with the byte FF hex',
         lambda t: t.swallowed == b'\xFF',
         'byte FF hex does not pass: a telnet port is on the way, as of a device server',
         'use its raw TCP port', Traces(damaged=2, swallowed=b'\xFF')),
    Rule('replies of the station, none of them whole',
         lambda t: t.is_garbled and not t.replies,
         'station {t.station} replies, but each reply has a wrong check or breaks off: something '
         'on the way changes or drops bytes',
         'look for flow control, a telnet port and long messages, then for noise',
         Traces(damaged=4, is_garbled=True), Decider.ECHOES),
    Rule('full duplex: DLE NAK to all messages, whichever check they have',
         lambda t: not t.mode.is_master and t.naks > 0 and not t.acks
         and t.takes_other_check is False,
         'the PLC answers DLE NAK to all, with CRC and with BCC: it has no room for messages, or '
         'ours arrive damaged',
         'end other programs that use this PLC, also over its other ports; then ' + _NOISE,
         Traces(PEER, naks=4, takes_other_check=False)),
    Rule('full duplex: DLE NAK to all messages',
         lambda t: not t.mode.is_master and t.naks > 0 and not t.acks,
         'the PLC answers DLE NAK to all: is Error_Code right?',
         'try Error_Code {t.other_check}', Traces(PEER, naks=4), Decider.OTHER_CHECK),
    Rule('a reply after Cmd_Timeout',
         lambda t: t.late > 0,
         'station {t.station} takes commands, but does not reply in time: a reply came after '
         '{t.late:.1f} s',
         'set Cmd_Timeout in net.csv to more than that; "plc ping" shows how long answers take',
         Traces(acks=1, polls=9, polls_answered=9, late=1.4)),
    Rule(f'full duplex: DLE ACK to {MOST_IN_VAIN} commands in a row, and no reply',
         lambda t: t.is_left_alone and t.gateway is None,
         f'station {{t.station}} is not asked any more: {MOST_IN_VAIN} commands in a row were '
         'acknowledged and had no reply. Each may cost an SLC with passthru one of 30 buffers '
         'until it is switched off',
         'is the number right? A write, ~/read_now or a new start of the node asks again',
         Traces(PEER, acks=5, is_acknowledged=True, is_left_alone=True)),
    Rule('full duplex, or behind a gateway: DLE ACK, and no reply',
         lambda t: t.is_acknowledged and t.gateway is None,
         'commands to station {t.station} are acknowledged, and no reply comes: is the number '
         'right? An SLC with passthru, or a gateway, acknowledges commands for all stations',
         '"plc scan 0-63" shows which stations reply; if it is the PLC itself, raise Cmd_Timeout',
         Traces(PEER, acks=1, is_acknowledged=True), Decider.LATER),
    Rule('the same behind a gateway',
         lambda t: t.is_acknowledged,
         'gateway {t.gateway} acknowledges commands to station {t.station}, and no reply comes: '
         'is the number right?',
         '"plc scan 0-63 --via {t.gateway}" shows which stations reply',
         Traces(station=7, gateway=8, acks=1, polls=9, polls_answered=9, is_acknowledged=True)),
    Rule('whole messages and damaged messages',
         lambda t: t.damaged > 0 and t.replies + t.acks + t.polls_answered > t.damaged,
         'messages come, and {t.damaged} of them damaged: noise on the line',
         _NOISE, Traces(acks=4, replies=2, damaged=2), Decider.ECHOES),
    Rule('replies to some commands, and DLE ACK only to others',
         lambda t: 0 < t.replies < t.acks,
         'station {t.station} takes commands, but does not reply to all of them in time',
         'raise Cmd_Timeout in net.csv; "plc ping" shows how long answers take',
         Traces(acks=2, replies=1), Decider.LATER),
    Rule('replies to some commands, and nothing to others',
         lambda t: t.replies > 0,
         'station {t.station} answers now and then: noise, a loose joint, or two stations with '
         'one number', _NOISE, Traces(acks=1, replies=1)),
    Rule('half duplex: DLE ACK and DLE EOT, and no reply',
         lambda t: t.mode.is_master and t.acks > 0,
         'station {t.on_line} takes commands, but does not reply in time',
         'raise Cmd_Timeout in net.csv; "plc ping" shows how long answers take',
         Traces(acks=1, polls=9, polls_answered=9), Decider.POLL),
    Rule('DLE ACK, and no reply in time',
         lambda t: t.acks > 0,
         'station {t.station} takes commands, but does not reply in time',
         'raise Cmd_Timeout in net.csv; "plc ping" shows how long answers take',
         Traces(PEER, acks=1)),
    Rule('half duplex: polls are answered, commands are not, whichever check they have',
         lambda t: t.mode.is_master and t.polls_answered > 0 and t.takes_other_check is False,
         'station {t.on_line} answers polls, but no command, with CRC or with BCC: it has no '
         'room, or our messages, which are longer than polls, arrive damaged',
         _NOISE, Traces(polls=1, polls_answered=1, takes_other_check=False)),
    Rule('half duplex: polls are answered, commands are not',
         lambda t: t.mode.is_master and t.polls_answered > 0,
         'station {t.on_line} answers polls, but no command: is Error_Code right?',
         'try Error_Code {t.other_check}',
         Traces(polls=1, polls_answered=1), Decider.OTHER_CHECK),
    Rule('full duplex: DLE ENQ is answered, messages are not',
         lambda t: t.enquiries > 0 and not t.acks,
         'a full-duplex port answers, but takes no command for station {t.station}',
         '"plc scan 0-63 --peer" shows which stations reply; then try Error_Code '
         '{t.other_check}', Traces(PEER, enquiries=4, characters=8, first=_ONE)),
    Rule('half duplex: DLE NAK, which no slave sends',
         lambda t: t.mode.is_master and t.naks + t.naks_to_polls > 0,
         'DLE NAK comes, which no slave sends: the channel of the PLC is set to full duplex',
         'use Mode Peer, --peer of "plc"', Traces(naks=4, characters=8, first=_TWO)),
    Rule('Mode Slave: the master polls us, and no reply comes',
         lambda t: t.polled,
         'the master polls us, and no reply of station {t.station} comes: does it pass messages '
         'between slaves on, and poll that station?',
         'look at the poll list of the master', Traces(SLAVE, polled=True)),
    Rule('half duplex: nothing, but another station answers',
         lambda t: t.mode.is_master and t.neighbour_answers is True,
         'station {t.on_line} is silent, and station {t.neighbour} answers: port and settings are '
         'right',
         'look at station {t.on_line}: power, its number (a PLC-5 shows its own in octal), its '
         'plug and its settings', Traces(station=2, polls=1, neighbour=1, neighbour_answers=True)),
    Rule('nothing any more, after answers before',
         lambda t: t.was_heard,
         'station {t.station} has answered before, and is silent now',
         'look at its power, its plug, the port and the cable', Traces(was_heard=True)),
    Rule('"plc detect": bytes with some settings, and no DF1',
         lambda t: t.settings > 0 and t.characters > 0,
         'characters come with {t.noisy} of {t.settings} settings, and none of them is DF1: noise '
         '(an open line, no ground, A and B exchanged), or a device with another protocol',
         'look whether the channel of the PLC is set to DF1, and with which baud rate and parity; '
         'then ' + _NOISE, Traces(settings=32, noisy=22, characters=180, first=b'\xA7\x01'),
         is_of_all=True),
    Rule('"plc detect": nothing with any settings',
         lambda t: t.settings > 0,
         'not one character came: cable (data lines not crossed, the wrong port), port or power; '
         'or a station that was not asked (a PLC-5 shows its own in octal)',
         'look at the cable, then give other numbers with --stations', Traces(settings=32),
         is_of_all=True),
    Rule('full duplex: DLE ENQ again and again, and no message',
         lambda t: t.asked_again > 1,
         'DLE ENQ comes again and again, and no message: the far end speaks DF1, and waits for '
         'an answer that it does not get',
         'check the cable: is our TX connected to its RX?',
         Traces(PEER, asked_again=40, characters=80, first=b'\x10\x05\x10\x05', unasked=10)),
    Rule('bytes that came before we sent anything, and no DF1',
         lambda t: t.unasked > 0,
         'bytes come by themselves, and are no DF1: noise on a line that is open, without ground '
         'or with A and B exchanged, or a device with another speed or protocol',
         _NOISE, Traces(unasked=40, characters=90, first=b'\xA7\x01')),
    Rule('bytes, and no DF1',
         lambda t: t.characters > 0,
         '{t.came}, and no answer that makes sense: another baud rate or parity, noise, or '
         'another protocol',
         _OTHER_SETTINGS, Traces(characters=30, first=b'\xA7\x01')),
    Rule('half duplex: nothing, not from another station either',
         lambda t: t.mode.is_master and t.neighbour_answers is False,
         'not one character came, from station {t.on_line} or from station {t.neighbour}: cable '
         '(data lines not crossed, the wrong port), power, baud rate or parity',
         _OTHER_SETTINGS, Traces(station=2, polls=1, neighbour=1, neighbour_answers=False)),
    Rule('half duplex: nothing, not even to a poll',
         lambda t: t.mode.is_master and t.polls > 0,
         'not one character came, not even to a poll: no station {t.on_line} (a PLC-5 shows its '
         'own in octal); or cable, port, power, baud rate or parity',
         '"plc scan 0-31" shows whether other stations answer; ' + _OTHER_SETTINGS,
         Traces(polls=1), Decider.NEIGHBOUR),
    Rule('half duplex: nothing to a command',
         lambda t: t.mode.is_master,
         'not one character came: station {t.on_line} (a PLC-5 shows its own in octal), check, '
         'cable, port, power, baud rate or parity',
         _OTHER_SETTINGS, Traces(), Decider.POLL),
    Rule('full duplex: nothing, but a poll of half duplex is answered',
         lambda t: t.is_polled_port is True,
         'the port is silent in full duplex, and answers a poll: its channel is set to half '
         'duplex',
         'use Mode Master, "plc" without --peer', Traces(PEER, is_polled_port=True)),
    Rule('full duplex: nothing, not even to a poll of half duplex',
         lambda t: t.mode.has_one_plc and t.is_polled_port is False,
         'not one character came: cable (data lines not crossed, the wrong port), power, baud '
         'rate or parity; or a channel that is not DF1',
         _OTHER_SETTINGS, Traces(PEER, is_polled_port=False)),
    Rule('full duplex: nothing',
         lambda t: t.mode.has_one_plc,
         'not one character came: cable (data lines not crossed, the wrong port), power, baud '
         'rate or parity; or the channel is set to half duplex',
         _OTHER_SETTINGS, Traces(PEER), Decider.HALF_DUPLEX),
    Rule('radio modem: nothing',
         lambda t: True,
         'not one character came: no station {t.station}, or cable, power, baud rate or parity of '
         'the modem, or no way by air',
         'look at the lights of both modems', Traces(RADIO)),
)
"""The causes, in the order of their rank: the first that holds is the cause."""


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """The ``rule`` that holds for traces of a line; as text the cause and the next step."""

    rule: Rule
    traces: Traces

    def __str__(self) -> str:
        return f'{self.cause}{"" if self.cause.endswith("?") else "."} Next: {self.step}'

    @property
    def cause(self) -> str:
        """Return the cause."""
        return self.rule.cause.format(t=self.traces)

    @property
    def step(self) -> str:
        """Return the next step."""
        return self.rule.step.format(t=self.traces)

    @property
    def rank(self) -> int:
        """Return the place of the rule in the table: a lesser one says more."""
        return RULES.index(self.rule)


def diagnose(traces: Traces) -> Diagnosis:
    """Return the cause of traces, and the next step."""
    return Diagnosis(next(rule for rule in RULES if rule.holds(traces)), traces)
