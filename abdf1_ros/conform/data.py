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
Cases of the commands, which slaves, full-duplex nodes and radio modem nodes answer alike.

Statuses come from M 8-2 to 8-4. The commands are written out byte by byte, as M 7-17 (SLC 500 and
MicroLogix), 7-20 and 7-28 to 7-30 (PLC-5) have them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from abdf1_ros.conform.case import case, Permission, Target
from abdf1_ros.conform.codec import has_10_in_check, HEADER_SIZE, message, REPLY_BIT
from abdf1_ros.conform.ends import AskingEnd, MOST_TRIES, Words
from abdf1_ros.conform.wire import Failed, Skipped

_ANSWERING = (Target.SLAVE, Target.PEER, Target.RADIO)

_ECHO = 0x06
_TYPED = 0x0F
_ILLEGAL = 0x10  # STS: command code, sub-code, length or format not accepted (M 8-2)
_EXTENDED = 0xF0  # STS: an EXT STS follows (M 8-3)
_BEYOND = 9999  # an element that no integer file has
_INTEGER, _ARRAY = 4, 9  # types of a PLC-5's data (M 7-29)

# Sizes (bytes) of an echo that every product accepts. SLC 5/01 and 5/02 accept up to 95 bytes, a
# PLC-5 up to 243.
_ECHO_SIZES = (0, 1, 2, 64, 95)
_LARGE_ECHO_SIZES = (243, 236, 200, 128, 112)

# All byte values with a meaning on the line, and their neighbours.
_NASTY = bytes.fromhex('10 10 03 10 02 10 05 10 06 10 15 03 02 01 00 FF 10')


def _data(reply: bytes) -> bytes:
    """Return the data of a reply without an error; raises Failed."""
    if reply[3]:
        raise Failed('STS 00', f'STS {reply[3]:02X} {reply[HEADER_SIZE:].hex(" ")}'.rstrip())
    return reply[HEADER_SIZE:]


def _refused(reply: bytes, allowed: tuple[int, ...]) -> None:
    if reply[3] not in allowed:
        raise Failed(' or '.join(f'STS {sts:02X}' for sts in allowed), f'STS {reply[3]:02X}')


def _echoed(end: AskingEnd, data: bytes, tns: int | None = None) -> None:
    got = _data(end.ask(_ECHO, b'\x00' + data, tns))
    if got != data:
        raise Failed(f'the data of the echo: {data.hex(" ")}', got.hex(' '))


@case('A data byte 10 is doubled on the line and single in the message.',
      'M 2-7, 5-4', *_ANSWERING)
def stuffing(end: AskingEnd) -> None:
    _echoed(end, _NASTY)


@case('A check byte of 10 is not doubled.', 'M 5-5', *_ANSWERING)
def check_not_doubled(end: AskingEnd) -> None:
    def as_reply(command: bytes) -> bytes:
        reply = bytes((command[1], command[0], command[2] | REPLY_BIT, 0)) + command[4:6]
        return message(reply, end.wire.check)

    for frame_of in (end.frame, as_reply):
        command = end.command()
        while not has_10_in_check(frame_of(command), end.wire.check):
            command = end.command()
        end.carry_out(command)
        end.wire.expect_silence('the reply has ended')


@case('The check of a reply is right for every value of a byte.', 'M 5-2 to 5-7', *_ANSWERING)
def check_of_all_bytes(end: AskingEnd) -> None:
    for start in range(0, 256, 64):
        _echoed(end, bytes(range(start, start + 64)))


@case('An echo sends back what it was given, of any length up to the packet.',
      'M 7-3', *_ANSWERING)
def echo_sizes(end: AskingEnd) -> None:
    for size in _ECHO_SIZES:
        _echoed(end, bytes(range(size)))


@case('An echo of up to 243 bytes is sent back whole or refused, never cut.', 'M 7-3', *_ANSWERING)
def largest_packet(end: AskingEnd) -> None:
    for size in _LARGE_ECHO_SIZES:
        data = bytes(range(size))
        reply = end.attempt(end.command(_ECHO, b'\x00' + data))
        if reply is None or reply[3]:
            continue  # too long for this product
        if reply[HEADER_SIZE:] != data:
            raise Failed(f'{size} bytes, or an STS', f'{len(reply) - HEADER_SIZE} bytes')
        return
    raise Skipped(f'an echo of {size} bytes is refused: packets of this product are smaller')


@case('A reply has the TNS of its command, whatever its bytes are.', 'M 6-7', *_ANSWERING)
def tns_returned(end: AskingEnd) -> None:
    for tns in (0x0010, 0x1010, 0xFFFF, 0x0310, 0x0000):
        _echoed(end, b'', tns)


@case('A command code that is not known gets STS 10.', 'M 8-2', *_ANSWERING)
def unknown_command(end: AskingEnd) -> None:
    for body in _empty_and_read(end):
        _refused(end.ask(0x0C, body), (_ILLEGAL,))


@case('A function code that is not known gets STS 10.', 'M 8-2', *_ANSWERING)
def unknown_function(end: AskingEnd) -> None:
    for body in _empty_and_read(end):
        _refused(end.ask(_TYPED, b'\xE7' + body[1:]), (_ILLEGAL, _EXTENDED))


def _empty_and_read(end: AskingEnd) -> list[bytes]:
    """Return an empty body, and the body of a read if the family is known."""
    return [b'', *([_read_body(end.words, 1)] if end.words.family else [])]


@case('Diagnostic status tells what the processor is.', 'M 7-3', *_ANSWERING)
def identity(end: AskingEnd) -> None:
    if not _data(end.ask(_ECHO, b'\x03')):
        raise Failed('some bytes of diagnostic status', 'none')


def _words_of(end: AskingEnd) -> Words:
    if not end.words.family:
        raise Skipped('needs --family PLC5 or SLC')
    if end.words.why_not:
        raise Skipped(end.words.why_not)
    return end.words


def why_no_words(end: AskingEnd) -> str:
    """Return why the words of the target can be neither read nor written, empty if they can."""
    words = end.words
    if not words.family or end.ask(_TYPED, _read_body(words, 1))[3] != _ILLEGAL:
        return ''
    return (f'STS 10 for a typed read of {words.address}: the target does not have the typed '
            f'commands of --family {words.family}, or not this file (--words)')


def _number(value: int) -> bytes:
    """Return a level of an address: a byte below 255, else FF and two bytes (M 13-10 to 13-15)."""
    return bytes((value,)) if value < 255 else b'\xFF' + value.to_bytes(2, 'little')


def _read_body(words: Words, count: int) -> bytes:
    """Return FNC and the rest of a command that reads integers."""
    place = _number(words.file), _number(words.element)
    if words.family == 'SLC':
        return bytes((0xA2, 2 * count)) + place[0] + b'\x89' + place[1] + b'\x00'
    size = count.to_bytes(2, 'little')
    return b'\x68\x00\x00' + size + b'\x06' + place[0] + place[1] + size


def _write_body(words: Words, data: bytes) -> bytes:
    """Return FNC and the rest of a command that writes integers."""
    place = _number(words.file), _number(words.element)
    if words.family == 'SLC':
        return bytes((0xAA, len(data))) + place[0] + b'\x89' + place[1] + b'\x00' + data
    count = (len(data) // 2).to_bytes(2, 'little')
    array = b'\x99\x09' + bytes((1 + len(data),)) + b'\x42'
    return b'\x67\x00\x00' + count + b'\x06' + place[0] + place[1] + array + data


def _masked_body(words: Words, mask: int, bits: int) -> bytes:
    """Return FNC and the rest of a command that changes the bits of ``mask`` in a word."""
    place = _number(words.file), _number(words.element)
    if words.family == 'SLC':
        return (b'\xAB\x02' + place[0] + b'\x89' + place[1] + b'\x00'
                + mask.to_bytes(2, 'little') + bits.to_bytes(2, 'little'))
    keep = (~mask & 0xFFFF).to_bytes(2, 'little')
    return b'\x26\x06' + place[0] + place[1] + keep + (bits & mask).to_bytes(2, 'little')


def _type_of(data: bytes) -> tuple[int, int, bytes]:
    """Return type and size of a PLC-5's data, and what follows them (M 7-28, 7-29)."""
    fields, rest = [], data[1:]
    for bits in (data[0] >> 4, data[0] & 0x0F) if data else (0, 0):
        more = bits & 0x07 if bits & 0x08 else 0
        fields.append(int.from_bytes(rest[:more], 'little') if bits & 0x08 else bits)
        rest = rest[more:]
    return fields[0], fields[1], rest


def _integers(reply: bytes, count: int, family: str) -> bytes:
    """Return ``count`` integers as bytes, without the type that a PLC-5 puts before them."""
    data = words = _data(reply)
    if family == 'PLC5':
        kind, size, words = _type_of(data)
        if kind == _ARRAY and not any(words[size:]):  # 00 may follow
            kind, size, words = _type_of(words[:size])
        if (kind, size) != (_INTEGER, 2):
            raise Failed(f'{count} integers after their type', data.hex(' '))
    if len(words) != 2 * count:
        raise Failed(f'{2 * count} bytes of data', words.hex(' '))
    return words


def _read(end: AskingEnd, count: int, words: Words | None = None) -> bytes:
    """Return ``count`` integers as bytes."""
    words = words or end.words
    return _integers(end.ask(_TYPED, _read_body(words, count)), count, words.family)


@contextmanager
def _kept(end: AskingEnd, count: int) -> Iterator[bytes]:
    """
    Read ``count`` words, and restore them after the block, however it ends.

    Raises Failed, and OSError with the values, if the words cannot be restored.
    """
    before = _read(end, count)
    try:
        yield before
    finally:
        try:
            _restore(end, before)
        except OSError as error:
            raise OSError(f'{error.strerror or error}; {end.words.address} may not hold '
                          f'{before.hex(" ")} any more') from error


def _restore(end: AskingEnd, before: bytes) -> None:
    """Write words, and read them back."""
    end.wire.allow(end.wire.restoring_time)
    got = ''
    for _ in range(MOST_TRIES):
        try:
            end.settle()
            end.ask(_TYPED, _write_body(end.words, before))
            now = _read(end, len(before) // 2)
        except Failed as failure:
            got = failure.got
            continue
        except Skipped as reason:
            got = got or str(reason)
            break
        if now == before:
            return
        got = now.hex(' ')
    raise Failed(f'{before.hex(" ")} in {end.words.address} again, as before the case', got)


def changes_nothing(end: AskingEnd, send: Callable[[bytes], object]) -> None:
    """
    Call ``send`` with a write command; raise Failed if a word then has its value.

    Raises Skipped if the words do not get the values by a good command either.
    """
    words = _words_of(end)
    with _kept(end, words.count) as before:
        written = bytes(byte ^ 0xFF for byte in before)
        send(end.command(_TYPED, _write_body(words, written)))
        end.settle()
        got = _read(end, words.count)
        if any(got[at:at + 2] == written[at:at + 2] for at in range(0, len(got), 2)):
            raise Failed(before.hex(' '), got.hex(' '))
        end.ask(_TYPED, _write_body(words, written))
        if _read(end, words.count) != written:
            raise Skipped('not judged: the target does not write these words anyway')


@case('A typed read returns the words that were asked for.', 'M 7-17, 7-28', *_ANSWERING)
def read_words(end: AskingEnd) -> None:
    _words_of(end)
    _read(end, 1)


def _address_forms(end: AskingEnd) -> list[bytes]:
    """Return all forms of the address of the words; raises Skipped if it is not a PLC-5's."""
    words = _words_of(end)
    if words.family != 'PLC5':
        raise Skipped('only a PLC-5 has these forms')
    place = bytes((words.file, words.element)) if max(words.file, words.element) < 255 else b''
    long = b''.join(b'\xFF' + level.to_bytes(2, 'little')
                    for level in (words.file, words.element))
    text = b'\x00$' + words.address.encode() + b'\x00'
    forms = [b'\x07\x00' + place, b'\x06' + place] if place else []
    return [*forms, b'\x06' + long, text]


def _ask_at(end: AskingEnd, address: bytes) -> bytes:
    """Return the reply of a PLC-5 to a read of one word."""
    return end.ask(_TYPED, b'\x68\x00\x00\x01\x00' + address + b'\x01\x00')


@case('A PLC-5 takes an address with and without its data table area, in long form, and as text.',
      'M 13-10 to 13-15', *_ANSWERING)
def address_forms(end: AskingEnd) -> None:
    for address in _address_forms(end):
        try:
            _data(_ask_at(end, address))
        except Failed as failure:
            raise Failed(f'STS 00 for the address {address.hex(" ")}', failure.got) from None


@case('A PLC-5 finds the same word by every form of its address that it takes.',
      'M 13-10 to 13-15', *_ANSWERING, permission=Permission.WRITE)
def address_forms_agree(end: AskingEnd) -> None:
    forms, wanted = _address_forms(end), b'\x34\x12'
    with _kept(end, 1):
        _data(end.ask(_TYPED, _write_body(end.words, wanted)))
        taken = {address: reply for address in forms if not (reply := _ask_at(end, address))[3]}
        for address, reply in taken.items():
            if (got := _integers(reply, 1, 'PLC5')) != wanted:
                raise Failed(f'{wanted.hex(" ")} at {address.hex(" ")}', got.hex(' '))
    if len(taken) < 2:
        raise Skipped('not tried: it takes one form only')


@case('An element that does not exist is refused, not answered with data.',
      'M 8-2 to 8-4', *_ANSWERING)
def element_too_high(end: AskingEnd) -> None:
    words = _words_of(end)
    _read(end, 1)  # so that the element is the reason, not the command
    beyond = Words(words.file, _BEYOND, family=words.family)
    _refused(end.ask(_TYPED, _read_body(beyond, 1)), (_ILLEGAL, 0x50, _EXTENDED))


@case('A read that goes beyond the last element of a file is refused as a whole.',
      'M 8-2 to 8-4', *_ANSWERING)
def end_of_file(end: AskingEnd) -> None:
    def read_at(element: int, count: int) -> bytes:
        return end.ask(_TYPED, _read_body(replace(words, element=element), count))

    words = _words_of(end)
    _read(end, 1)
    last, beyond = words.element, _BEYOND
    while beyond - last > 1:
        middle = (last + beyond) // 2
        last, beyond = (last, middle) if read_at(middle, 1)[3] else (middle, beyond)
    _read(end, 1, replace(words, element=last))
    _refused(read_at(last, 2), (_ILLEGAL, 0x50, _EXTENDED))


@case('What was written is what is read, bit by bit.',
      'M 7-18, 7-30', *_ANSWERING, permission=Permission.WRITE)
def write_and_read(end: AskingEnd) -> None:
    words = _words_of(end)
    with _kept(end, words.count):
        for pattern in (0x1010, 0x1234, 0x7FFF, 0x8000, 0x0000):
            wanted = b''.join((pattern ^ 0x0101 * number & 0xFFFF).to_bytes(2, 'little')
                              for number in range(words.count))
            _data(end.ask(_TYPED, _write_body(words, wanted)))
            if (got := _read(end, words.count)) != wanted:
                raise Failed(wanted.hex(' '), got.hex(' '))


@case('Words are written and read in the order of their elements.', 'M 7-18, 7-30', *_ANSWERING,
      permission=Permission.WRITE)
def word_order(end: AskingEnd) -> None:
    words = _words_of(end)
    if words.count < 2:
        raise Skipped('needs --count 2 or more')
    wanted = [(0x8001 + 0x0102 * number).to_bytes(2, 'little') for number in range(words.count)]
    with _kept(end, words.count):
        _data(end.ask(_TYPED, _write_body(words, b''.join(wanted))))
        for number, word in enumerate(wanted):
            one = replace(words, element=words.element + number)
            if (got := _read(end, 1, one)) != word:
                raise Failed(f'{word.hex(" ")} in {one.address}', got.hex(' '))


@case('A masked write changes the bits of its mask and no others.',
      'M 7-20', *_ANSWERING, permission=Permission.WRITE)
def masked_write(end: AskingEnd) -> None:
    words = _words_of(end)
    with _kept(end, min(words.count, 2)) as before:
        _data(end.ask(_TYPED, _write_body(words, b'\x55\xAA')))
        reply = end.ask(_TYPED, _masked_body(words, 0x8108, 0x0108))
        if reply[3] == _ILLEGAL:
            raise Skipped('STS 10: this processor has no masked write')
        _data(reply)
        wanted = b'\x5D\x2B' + before[2:]  # a following word belongs to us
        if (got := _read(end, len(before) // 2)) != wanted:
            raise Failed(wanted.hex(' '), got.hex(' '))
