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
The numbered errors and notices of the driver, in one table.

Source: S0 (see ``abdf1_ros.df1``), tables "Critical Error Messages", "Error Messages" and "Notice
Messages". The texts are an interface: people search their logs for them.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

_CHOICE = ', %s'


class Severity(Enum):
    """The weight of a numbered message, named as the specification names its tables."""

    CRITICAL = 'critical'
    ERROR = 'error'
    NOTICE = 'notice'


class Message(Enum):
    """One numbered message: its name is the mnemonic, its value (number, severity, text)."""

    ERR_BAD_STATION = (
        2501, Severity.ERROR, 'Item: %d, Invalid station number (%d) must be less than %d')
    ERR_BAD_PLC_TYPE = (
        2502, Severity.ERROR,
        'Item: %d, Invalid or Unsupported PLC Type (%s) should be one of %s, %s, %s, %s')
    ERR_ADDRESS_SYNTAX = (2503, Severity.ERROR, 'Item: %d, Invalid Address Syntax (%s)')
    ERR_ADDRESS_RANGE = (2504, Severity.ERROR, 'Item: %d, Address is out of range (%s, len=%d)')
    ERR_BAD_FUNCTION_CODE = (
        2505, Severity.ERROR,
        'Response with wrong command code (slv=%d, actual=%d, expected=%d)')
    ERR_BAD_CRC = (
        2506, Severity.ERROR,
        'Response with wrong CRC (actual=0x%02x%02x, expected=0x%02x%02x)')
    ERR_BAD_BCC = (
        2507, Severity.ERROR,
        'Response with wrong BCC (actual=0x%02x%02x, expected=0x%02x%02x)')
    ERR_COMMAND_TIMEOUT = (2508, Severity.ERROR, 'Command Timed Out')
    ERR_INACTIVE_STATION = (2509, Severity.ERROR, 'Slave Station (%d) Inactive')
    ERR_WRONG_MESSAGE = (
        2510, Severity.ERROR, 'Wrong Message Received Src:0x%02x, Dst:0x%02x, Tns:0x%04x')
    ERR_RCVD_NAK_SYMBOL = (2511, Severity.ERROR, 'Received NAK Symbol')
    NTC_RCVD_MSG_TOO_LONG = (2512, Severity.NOTICE, 'Received Message Too Long (> %d bytes)')
    NTC_RCVD_MSG_TOO_SHORT = (2513, Severity.NOTICE, 'Received Message Too Short (< %d bytes)')
    NTC_INVALID_SYMBOL = (2514, Severity.NOTICE, 'Invalid Symbol received after DLE - (0x%02x)')
    NTC_ACK_EXPECTED = (2515, Severity.NOTICE, 'ACK Expected (last symbol received was 0x%02x)')
    NTC_EOT_STX_EXPECTED = (
        2516, Severity.NOTICE, 'EOT or STX Expected (last symbol received was 0x%02x)')
    NTC_RCVD_NAK_SYMBOL = (2517, Severity.NOTICE, 'Received NAK Symbol')
    NTC_NO_ETX_RCVD = (2518, Severity.NOTICE, 'Incomplete Message, No ETX received')
    NTC_NAK_LIMIT_EXCEEDED = (2519, Severity.NOTICE, 'NAK Retry Limit (%d) exceeded')
    NTC_ENQ_LIMIT_EXCEEDED = (2520, Severity.NOTICE, 'ENQ Retry Limit (%d) exceeded')
    NTC_NAK_RETRY = (2521, Severity.NOTICE, 'NAK Retry #%d, due to error %d')
    NTC_ENQ_RETRY = (2522, Severity.NOTICE, 'ENQ Retry #%d, due to error %d')
    NTC_REPLY_MSG_RCVD = (2523, Severity.NOTICE, 'Reply Message received from Slave %d')
    NTC_DUPLICATE_MSG_RCVD = (2524, Severity.NOTICE, 'Duplicate Message received from Slave %d')
    CRT_BAD_STATION_ID = (
        2552, Severity.CRITICAL, 'Invalid station number (%d) must be less than %d')
    CRT_BAD_DRIVER_MODE = (
        2553, Severity.CRITICAL, 'Invalid Driver Mode (%s), should be one of %s, %s, or %s')
    CRT_UNSUPPORTED_MODE = (
        2554, Severity.CRITICAL, 'Unsupported Driver Mode (%d), Supported Mode(s): %s')
    CRT_BAD_PLC_TYPE = (
        2555, Severity.CRITICAL,
        'Invalid or Unsupported PLC Type (%s) should be one of %s, %s, %s, %s')
    CRT_BAD_ERROR_CODE = (
        2556, Severity.CRITICAL, 'Invalid Error Code (%s), should be either %s, or %s')
    CRT_BAD_NAK_RETRIES = (
        2557, Severity.CRITICAL, 'Invalid NAK Retries (%d) should be in range [0, %d]')
    CRT_BAD_ENQ_RETRIES = (
        2558, Severity.CRITICAL, 'Invalid ENQ Retries (%d) should be in range [0, %d]')
    CRT_BAD_CMD_TIMEOUT = (
        2559, Severity.CRITICAL, 'Invalid Cmd Timeout (%d) should be in range [%d, %d]')

    def __init__(self, number: int, severity: Severity, template: str) -> None:
        self.number = number
        self.severity = severity
        self.template = template

    @property
    def has_choices(self) -> bool:
        """Tell whether the text ends with a list."""
        return self.template.endswith(_CHOICE * 2)

    def text(self, *args: object) -> str:
        """
        Return the text with ``args`` in its places.

        A ``%d`` place also takes text, because a number that a user mistyped ("abc" as a station)
        has to be shown as it was typed. A list of choices at the end gets one place for each
        choice.
        """
        text = self.template.replace('%d', '%s')
        if self.has_choices:
            text += _CHOICE * (len(args) - text.count('%s'))
        return text % args

    def entry(self, *args: object) -> str:
        """Return number, mnemonic and text, as logs and diagnostics show them."""
        return f'{self.number} {self.name}: {self.text(*args)}'


class Event(NamedTuple):
    """
    One occurrence of a numbered message while the driver runs.

    ``station`` is the station (0-254) that it is about, None where that is not known.
    """

    message: Message
    args: tuple[object, ...] = ()
    station: int | None = None

    def __str__(self) -> str:
        """Return the numbered text, and the station if it is known."""
        where = '' if self.station is None else f' [station {self.station}]'
        return self.message.entry(*self.args) + where
