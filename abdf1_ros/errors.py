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

"""The exceptions of the package, in one tree."""

from __future__ import annotations

from abdf1_ros.messages import Message


class Abdf1Error(Exception):
    """
    Anything this package raises on purpose.

    ``about`` is the subject of the request, such as "N7:0 of station 1"; it is empty if unknown.
    ``done`` tells the part of the request that was carried out before, ``hint`` what may help.
    """

    about: str = ''
    done: str = ''
    hint: str = ''

    def __reduce__(self) -> tuple[object, ...]:
        """Let pickle and copy keep args and attributes, whatever the constructor takes."""
        return _made_again, (type(self), self.args), self.__dict__

    def words(self) -> str:
        """Return what is wrong."""
        return super().__str__()

    def __str__(self) -> str:
        """Return the subject, what is wrong with it, and what may help."""
        return f'{self.about and self.about + ": "}{self.words()}{self.done}{self.hint}'


def _made_again(kind: type[Abdf1Error], args: tuple[object, ...]) -> Abdf1Error:
    return kind.__new__(kind, *args)


class FormatError(Abdf1Error, ValueError):
    """Bytes or values that do not fit their format."""


class LinkError(Abdf1Error):
    """
    A transaction that ended without a reply.

    ``message`` is the numbered error, ``args`` fill its text. ``sent`` tells whether the
    command has been on the line, so that it may have been executed. ``cause`` is what was wrong
    with the last try, None if the command was taken and nothing came.
    """

    message = Message.ERR_COMMAND_TIMEOUT

    def __init__(self, *args: object, sent: bool = True, cause: Message | None = None) -> None:
        super().__init__(*args)
        self.sent = sent
        self.cause = cause

    def words(self) -> str:
        """Return the numbered text."""
        return self.message.entry(*self.args)


class CommandTimeout(LinkError):
    """The station is there, but its reply did not come within Cmd_Timeout (2508)."""


class ReplyHindered(LinkError):
    """The far end was busy all the time with sending another reply again (2508)."""


class StationInactive(LinkError):
    """The station does not answer (2509); the argument is its ``number``."""

    message = Message.ERR_INACTIVE_STATION

    def __init__(self, number: int, *, sent: bool = True, cause: Message | None = None) -> None:
        super().__init__(number, sent=sent, cause=cause)
        self.number = number


_NOTHING_CAME = 'no reply though acknowledged'
_NOT_WHOLE = {
    None: _NOTHING_CAME,
    Message.NTC_EOT_STX_EXPECTED: _NOTHING_CAME,
    Message.ERR_COMMAND_TIMEOUT: 'no reply',
    Message.NTC_ACK_EXPECTED: 'no command is acknowledged',
    Message.ERR_RCVD_NAK_SYMBOL: 'NAK to each command',
    Message.ERR_BAD_BCC: 'each reply has a wrong check',
    Message.ERR_BAD_CRC: 'each reply has a wrong check',
    Message.NTC_NO_ETX_RCVD: 'each reply breaks off',
    Message.NTC_RCVD_MSG_TOO_SHORT: 'each reply is too short for a message',
    Message.NTC_RCVD_MSG_TOO_LONG: 'each reply is too long for a message'}


class NoWholeReply(LinkError):
    """No whole reply came to the last tries of a command, though its station answers."""

    def words(self) -> str:
        """Return the reason; the specification has no number for it."""
        return _NOT_WHOLE[self.cause]


class WrongCommandCode(LinkError):
    """The reply to our transaction has the code of another command (2505)."""

    message = Message.ERR_BAD_FUNCTION_CODE


class LineReset(LinkError):
    """The master has made its slaves drop their messages (2511)."""

    message = Message.ERR_RCVD_NAK_SYMBOL


class NeverTaken(LinkError):
    """The master has not acknowledged a message (2519); the argument is the limit of retries."""

    message = Message.NTC_NAK_LIMIT_EXCEEDED


class CommandExpired(LinkError):
    """The command must not be sent any more, or repeated: it is too old, or for the argument."""

    def words(self) -> str:
        """Return this text; the specification has no number for it."""
        if self.args:
            return str(self.args[0])
        return 'too old to be sent once more' if self.sent else 'too old to be sent'


# Reasons of an end of the port: a bug, and our own close.
INTERNAL_ERROR = 'internal error, see the log'
CLOSED = 'closed by this program'


class PortLost(LinkError):
    """The port failed or was closed while the transaction ran; the argument says how."""

    def words(self) -> str:
        """Return what happened to the port; the specification has no number for it."""
        return f'port lost: {self.args[0]}'


class RemoteError(Abdf1Error):
    """
    A reply that says that the station did not execute the command.

    ``sts`` and ``ext_sts`` (None where the reply has none) are the codes of the reply.
    """

    def __init__(self, sts: int, ext_sts: int | None, text: str) -> None:
        super().__init__(text)
        self.sts = sts
        self.ext_sts = ext_sts
