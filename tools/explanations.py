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
The cause and the cure of each numbered message and counter.

The same for each outcome of a write. docs/reference/ is made from this;
test/style/test_tables.py fails if an entry is missing.
"""

from __future__ import annotations

from typing import NamedTuple

from abdf1_ros.driver.write import Outcome
from abdf1_ros.messages import Message


class Cause(NamedTuple):
    """The cause of a numbered message, and its cure."""

    cause: str
    cure: str


MESSAGES: dict[Message, Cause] = {
    Message.ERR_BAD_STATION: Cause(
        'The cell Station of a map row is not a whole number from 0 to 254; 255: Write only.',
        'Correct the cell. A PLC-5 shows station numbers in octal: 17 there is 15 here.'),
    Message.ERR_BAD_PLC_TYPE: Cause(
        'The cell PLC_Type of a map row is not PLC2, PLC3, PLC5 or SLC.',
        'Correct the cell; SLC for every SLC 500 and MicroLogix.'),
    Message.ERR_ADDRESS_SYNTAX: Cause(
        'The cell Address of a map row is not an address of this family; the text after it '
        'describes a good address.',
        'Compare with the table of addresses. PLC-5 inputs and outputs are octal; SLC inputs and '
        'outputs have slot and word.'),
    Message.ERR_ADDRESS_RANGE: Cause(
        'The address of a map row, or the last of its Length elements, is above the highest '
        'address of the family.',
        'Correct Address or Length. The length of the file in this PLC is unknown until the first '
        'read: if the file is too short, the PLC refuses with an STS.'),
    Message.ERR_BAD_FUNCTION_CODE: Cause(
        'A reply carries our transaction number, but answers another kind of command.',
        'Look for a second master or a gateway that mixes up replies; record with `sniff`.'),
    Message.ERR_BAD_CRC: Cause(
        'A message arrived with a wrong CRC: noise, two stations with one address, or a PLC that '
        'sends BCC.',
        'If all messages are wrong: Error_Code, Parity and Data_Bits of both sides. If some are: '
        'shield, ground, terminators, length of the cable, a lower baud rate. If always the same '
        'rows are: flow control (XON/XOFF) or a telnet port of a device server.'),
    Message.ERR_BAD_BCC: Cause(
        'A message arrived with a wrong BCC: as with CRC, or a PLC that sends CRC.',
        'As for 2506. Prefer CRC on both sides: BCC does not find exchanged bytes.'),
    Message.ERR_COMMAND_TIMEOUT: Cause(
        'The PLC has acknowledged a command, but its reply did not come within Cmd_Timeout. It '
        'is busy, its scan is long, or the station is a gateway that waits for another PLC. Or '
        'each reply came with a wrong check: then 2506 or 2507 came, too.',
        'Compare with `plc ping`; raise Cmd_Timeout. In Mode Slave: is the master polling us, and '
        'does it pass messages on?'),
    Message.ERR_INACTIVE_STATION: Cause(
        'A station has not answered a command, or a poll, and all its repetitions.',
        'Power, cable, station number, baud rate, check; is the channel set to the duplex of '
        'Mode? `plc scan` lists the stations that answer. When the station answers again, the '
        'bridge uses it again by itself.'),
    Message.ERR_WRONG_MESSAGE: Cause(
        'A message that is neither a command for us nor a reply to our command. A reply came '
        'after we gave up its command, is for another master, or has a SRC other than the polled '
        'station. Or a command carries an STS. (A command for us without a Serve row is refused, '
        'and the status `link` names it.)',
        'Harmless once in a while, when Src and Dst are right. Often: Timeout or Cmd_Timeout is '
        'too short for this PLC, or a gateway holds replies back. If Dst is not our Station: a '
        'second master, or two devices with one station number. In Mode Peer also a gateway that '
        'puts its own number into Dst: give Station that number. Or a second device has the same '
        'port by a passive splitter: take it off, it may use Share.'),
    Message.ERR_RCVD_NAK_SYMBOL: Cause(
        'A station answered a message or a poll with DLE NAK; Allen-Bradley slaves never do. In '
        'Mode Peer: our message arrived damaged, or the PLC has no room.',
        'Slaves: is the slave set to full duplex, or of another make? The message is repeated.'),
    Message.NTC_RCVD_MSG_TOO_LONG: Cause(
        'More bytes came than the longest message has, but no DLE ETX: noise, or a lost DLE ETX.',
        'As for 2506; also check Data_Bits and Parity.'),
    Message.NTC_RCVD_MSG_TOO_SHORT: Cause(
        'A message with a good check has less than the six bytes of a header.',
        'Record with `sniff`; something on the line speaks another protocol.'),
    Message.NTC_INVALID_SYMBOL: Cause(
        'After a DLE came a byte that is not a control symbol: noise or a wrong baud rate.',
        'As for 2506. From the start and all the time: Baud, Parity, Data_Bits.'),
    Message.NTC_ACK_EXPECTED: Cause(
        'A command got no DLE ACK within Timeout; the text has the last symbol heard, or 0x00.',
        'Repeated by itself. Often: Timeout is too short, or the station too busy.'),
    Message.NTC_EOT_STX_EXPECTED: Cause(
        'A poll got neither a message nor DLE EOT.',
        'Repeated by itself. A PLC with EOT suppression never says EOT: switch that off.'),
    Message.NTC_RCVD_NAK_SYMBOL: Cause(
        'DLE NAK was received. In full duplex: our message arrived damaged, or the PLC has no '
        'room.',
        'Repeated by itself. Always: Error_Code differs. Often: noise towards the PLC, or '
        'max_outstanding is too high.'),
    Message.NTC_NO_ETX_RCVD: Cause(
        'A message broke off before its DLE ETX.',
        'As for 2506; also an RS-485 transmitter that switches off too early.'),
    Message.NTC_NAK_LIMIT_EXCEEDED: Cause(
        'A message was repeated NAK_Retries times without an answer; after our command 2509 '
        'follows.',
        'See 2509.'),
    Message.NTC_ENQ_LIMIT_EXCEEDED: Cause(
        'A poll (in full duplex: DLE ENQ) was repeated ENQ_Retries times without an answer; 2509 '
        'follows, but not after our reply.',
        'See 2509.'),
    Message.NTC_NAK_RETRY: Cause(
        'A command is sent again; the number in the text says why.',
        'None, unless CNT_NAK_RETRIES keeps growing.'),
    Message.NTC_ENQ_RETRY: Cause(
        'A poll is sent again; the number in the text says why.',
        'None, unless CNT_ENQ_RETRIES keeps growing.'),
    Message.NTC_REPLY_MSG_RCVD: Cause(
        'A reply has arrived: all is well. In the log with `--log-level debug` only.',
        'None.'),
    Message.NTC_DUPLICATE_MSG_RCVD: Cause(
        'A message arrived a second time, because our ACK was lost. It is acknowledged and '
        'dropped.',
        'None; often: noise towards the PLC.'),
    Message.CRT_BAD_STATION_ID: Cause(
        'Station of the net file is not a whole number from 0 to 254.',
        'A station number that no PLC on the line has.'),
    Message.CRT_BAD_DRIVER_MODE: Cause(
        'Mode of the net file is not Master, Slave, Peer, Radio or Listen.',
        'Master for half duplex, Peer for full duplex.'),
    Message.CRT_UNSUPPORTED_MODE: Cause(
        'Mode is known, but this version does not have it. (The present version has all modes.)',
        'Choose a mode that the text names.'),
    Message.CRT_BAD_PLC_TYPE: Cause(
        'PLC_Type of the net file is not PLC2, PLC3, PLC5 or SLC.',
        'The family that we emulate for PLCs that write to us; without Serve rows, leave the cell '
        'empty.'),
    Message.CRT_BAD_ERROR_CODE: Cause(
        'Error_Code of the net file is neither BCC nor CRC.',
        "The setting of the PLC's channel; CRC if you can choose."),
    Message.CRT_BAD_NAK_RETRIES: Cause(
        'NAK_Retries of the net file is not a whole number from 0 to 10.',
        'Leave the cell empty: 3.'),
    Message.CRT_BAD_ENQ_RETRIES: Cause(
        'ENQ_Retries of the net file is not a whole number from 0 to 10.',
        'Leave the cell empty: 3.'),
    Message.CRT_BAD_CMD_TIMEOUT: Cause(
        'Cmd_Timeout of the net file is not a whole number from 500 to 5000.',
        'Milliseconds, not seconds; leave the cell empty: 1000.'),
}

COUNTERS: dict[str, str] = {
    'messages_sent': 'Grows with every transaction. Much faster than CNT_CMD_MSGS_SENT: '
                     'repetitions.',
    'messages_received': 'Stays the same while commands are sent: no station answers.',
    'commands_sent': 'Transactions begun.',
    'commands_received': 'PLCs send by themselves: messages for `Serve` rows, or to be passed on.',
    'replies_sent': 'Our replies to these commands.',
    'replies_received': 'Should keep up with CNT_CMD_MSGS_SENT.',
    'polls_sent': 'Masters only. Many polls for one reply: the PLC is slow and costs line time.',
    'polls_received': 'Mode Slave only. Stays the same: the master does not poll us.',
    'naks_sent': 'Masters: one NAK for each 2508, where `nak_on_command_timeout` lets it go out. '
                 'Peer: damaged messages.',
    'naks_received': 'Peer: our messages arrive damaged, or the PLC has no room. Masters: 2511.',
    'acks_sent': 'Good messages that we have received.',
    'acks_received': 'Messages of ours that other nodes have received. In Mode Slave also ACKs '
                     'for other slaves.',
    'eots_sent': 'Mode Slave: polls when we had nothing to send.',
    'eots_received': 'Polls that came before the reply was ready.',
    'error_messages_sent': 'PLCs ask for words that no `Serve` row has.',
    'error_messages_received': "PLCs refuse commands: the mappings' status names tag and STS.",
    'nak_retries': 'A few a day are noise. A steady share of CNT_MSG_PACKETS_SENT: a bad line, or '
                   'Timeout is too short.',
    'nak_limit_exceeded': 'How often a station went silent (2519). Mode Slave: the master never '
                          'acknowledged.',
    'enq_retries': 'Like CNT_NAK_RETRIES, for polls; in full duplex for lost ACKs.',
    'enq_limit_exceeded': 'How often a station went silent at a poll (2520).',
    'command_timeouts': 'See 2508.',
    'bcc_errors': 'See 2507.',
    'crc_errors': 'See 2506.',
    'stale_messages': 'See 2510.',
    'duplicate_messages': 'See 2524.',
    'invalid_messages': 'See 2505, 2510, 2512, 2513 and 2518.',
    'read_errors': 'The adapter was unplugged, or the device server has closed the connection. '
                   'The port is opened again by itself.',
    'chars_sent': 'Stays the same: the port is closed, or there is nothing to send.',
    'chars_received': '0 while characters are sent: cable, power, or the wrong port. Grows '
                      'without messages: baud rate or parity.',
}
"""The meaning of a counter that grows or stays the same, by the name of its field."""

OUTCOMES: dict[Outcome, str] = {
    Outcome.WRITTEN: 'The PLC has confirmed it. Bits of an SLC without masked write (5/01, 5/02, '
                     'ML1000) are written `by reading the word and writing it back`, in three '
                     'commands. Changes by the program or another PLC in that word in between are '
                     'lost; writes of guests wait.',
    Outcome.STANDS: 'A row with [Write_Again](#values-that-need-not-be-written-again): the PLC '
                    'holds the value, so it is not written again. The times of the confirmation '
                    'and of the last read with the value follow.',
    Outcome.BROADCAST: 'Station 255. The write counts as accepted only: no station confirms it.',
    Outcome.SUPERSEDED: 'Words and floats: a newer message came while this one waited. Bits: '
                        'newer changes wait, and the line does not carry them all.',
    Outcome.REFUSED: 'Wrong length, outside Min and Max, not representable, `read_only`, port not '
                     'open, or `more than one publisher` of a row with Single_Publisher: nothing '
                     'was sent. The reason follows.',
    Outcome.NOT_SENT: 'The station is inactive, or its replies were too late before; the port was '
                      'lost; or the message waited longer than `write_timeout`. `fallback`: the '
                      'message was published before a fallback value went out. `more than one '
                      'publisher`: the message waited when a second publisher came.',
    Outcome.FAILED: "The PLC's own error follows, as STS and in words.",
    Outcome.PARTLY: 'A write of several packets failed after some of them. If a reply is missing, '
                    'the values are read back, as for the next outcome.',
    Outcome.UNKNOWN: 'Sent, but no reply came, or a node on the way has lost it. The message ends '
                     'with the result of the next read, within `write_timeout`: `read back: the '
                     'PLC holds the value`, `... another value`, or why nothing was read.',
    Outcome.FALLBACK: 'A fallback value, without a message. Reason: `timeout` (no message in '
                      'time), `start`, `return` of the station, its change to `run`, our own '
                      '`end`, or more than one of the `publishers`.',
}
"""The outcomes of a write with their meaning."""
