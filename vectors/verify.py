#!/usr/bin/env python3
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

# SPDX-License-Identifier: CC0-1.0
"""
Verify the DF1 and PCCC vectors of this folder: schema, hashes, checks, decoded fields.

Plain Python, nothing to install: ``python3 verify.py`` prints what is wrong and ends with 1.
``--update`` writes the hashes of the files into the manifest.
"""

import hashlib
import json
from pathlib import Path
import re
import sys

TYPES = {'object': dict, 'array': list, 'string': str, 'integer': int, 'number': int | float}
SYMBOLS = {'DLE ACK': 0x06, 'DLE NAK': 0x15, 'DLE ENQ': 0x05, 'DLE EOT': 0x04}


def check_schema(value, rule, rules, where):
    """Yield where a value breaks its rule; only what schema.json uses of JSON Schema is known."""
    if '$ref' in rule:
        rule = rules[rule['$ref'].removeprefix('#/$defs/')]
    if 'enum' in rule and value not in rule['enum']:
        yield f'{where}: {value!r} is not one of {rule["enum"]}'
    if 'type' not in rule:
        return
    if not isinstance(value, TYPES[rule['type']]):
        yield f'{where}: {value!r} is not of type {rule["type"]}'
    elif rule['type'] == 'object':
        more = rule.get('additionalProperties', True)
        yield from (f'{where}: {name} is missing' for name in rule.get('required', ())
                    if name not in value)
        for name, part in value.items():
            part_rule = rule.get('properties', {}).get(name, more)
            if part_rule is False:
                yield f'{where}: {name} is not known'
            elif part_rule is not True:
                yield from check_schema(part, part_rule, rules, f'{where}.{name}')
    elif rule['type'] == 'array':
        for number, part in enumerate(value):
            name = part.get('name', number) if isinstance(part, dict) else number
            yield from check_schema(part, rule.get('items', {}), rules, f'{where}[{name}]')
    elif rule['type'] == 'string' and not re.search(rule.get('pattern', ''), value):
        yield f'{where}: {value!r} does not match {rule["pattern"]}'
    elif rule['type'] == 'integer' and not (
            rule.get('minimum', value) <= value <= rule.get('maximum', value)):
        yield f'{where}: {value} is out of range'


def bcc(data):
    """Return the two's complement of the sum."""
    return bytes((-sum(data) & 0xFF,))


def crc(data):
    """Return CRC-16 with polynomial A001, begun with 0, low byte first."""
    value = 0
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return value.to_bytes(2, 'little')


def parse(frame):
    """Return STN (or None), link data, and the check that a message or poll ends with."""
    station, at, data = None, 2, bytearray()
    if frame[1] in (0x01, 0x05):  # DLE SOH or DLE ENQ: a station follows, doubled if it is DLE
        station, at = frame[2], 4 if frame[2:4] == b'\x10\x10' else 3
        if frame[1] == 0x05:
            return station, b'', frame[at:]
        at += 2  # DLE STX
    while frame[at:at + 2] != b'\x10\x03':
        if frame[at] == 0x10 and frame[at + 1] != 0x10:
            at += 2  # an embedded response of the other direction
            continue
        data.append(frame[at])
        at += 1 + (frame[at] == 0x10)
    return station, bytes(data), frame[at + 2:]


def right_check(kind, station, data):
    """Return the check of a message: STN and STX count in a frame of a master."""
    if kind == 'BCC':
        return bcc(data if station is None else bytes((station,)) + data)
    return crc((b'' if station is None else bytes((station, 0x02))) + data + b'\x03')


def header(data):
    """Return the fields of link data, as vectors show them."""
    if len(data) < 6:
        return {}
    fields = {'dst': data[0], 'src': data[1], 'cmd': f'{data[2]:02X}', 'sts': f'{data[3]:02X}',
              'tns': int.from_bytes(data[4:6], 'little')}
    if data[2] & 0x5F in (0x06, 0x07, 0x0F) and len(data) > 6:
        fields['fnc'] = f'{data[6]:02X}'
    return fields


def check_frame(entry):
    """Yield what is wrong with a frame."""
    frame, decoded = bytes.fromhex(entry['bytes']), entry['decoded']
    if entry['kind'] == 'symbol':
        if frame != bytes((0x10, SYMBOLS[decoded['symbol']])):
            yield 'is not that symbol'
        return
    station, data, check = parse(frame)
    right = bcc(bytes((station,))) if entry['kind'] == 'poll' \
        else right_check(entry['check'], station, data)
    verdict = 'wrong check' if check != right else \
        'too short' if entry['kind'] == 'message' and len(data) < 6 else 'good'
    if verdict != entry['verdict']:
        yield f'the verdict is {verdict}'
    found = {'station': station, 'link_data': data.hex(' ').upper() or None, **header(data),
             'right_check': right.hex(' ').upper() if check != right else None}
    for name in {**found, **decoded}:
        if found.get(name) != decoded.get(name):
            yield f'{name} is {found.get(name)!r}, not {decoded.get(name)!r}'
    origin = entry['origin']
    if origin['how'] == 'printed' and not re.search(r'\d-\d|ch\.', origin['source']):
        yield 'a printed frame needs its page'


def check_exchange(entry):
    """Yield what is wrong with a command and its reply."""
    command, reply = bytes.fromhex(entry['command']), bytes.fromhex(entry['reply'])
    if reply[:3] != bytes((command[1], command[0], command[2] | 0x40)) \
            or reply[4:6] != command[4:6] or command[3]:
        yield 'is no reply to this command'
    fields, sts = header(command), reply[3]
    found = {'cmd': fields['cmd'], 'tns': fields['tns'], 'sts': f'{sts:02X}'}
    if 'fnc' in fields:
        found['fnc'] = fields['fnc']
    if sts & 0xF0 == 0xF0 and len(reply) > 6:
        found['ext_sts'] = f'{reply[6]:02X}'
    if found != entry['decoded'] or entry['verdict'] != ('refused' if sts else 'good'):
        yield f'says {found}'


def check_processor(entry):
    """Yield what is wrong with the frames and commands of a processor."""
    for frame in entry.get('frames', ()):
        content = bytes.fromhex(frame['bytes'])
        _, data, check = parse(content[2:])
        if content[:2] != b'\x10\x06' or check != right_check('CRC', None, data):
            yield f'{frame["bytes"]} is not DLE ACK and a message with CRC'
    for exchange in entry.get('exchanges', ()):
        if int(exchange['command'][:2], 16) & 0x40:
            yield f'{exchange["command"]} is no command'


def meaning(frame, kind):
    """Return what a whole frame says."""
    if len(frame) == 2:
        return next((name for name, code in SYMBOLS.items() if frame[1] == code), 'noise')
    station, data, check = parse(frame)
    if frame[1] == 0x05:
        return 'poll' if check == bcc(bytes((station,))) else 'damaged poll'
    if check != right_check(kind, station, data):
        return 'damaged'
    if not 6 <= len(data) <= 261:
        return 'too short' if len(data) < 6 else 'too long'
    return 'reply' if data[2] & 0x40 else 'command'


def check_conversation(entry):
    """Yield what is wrong with a conversation; frames in several lines are left out."""
    last, asked, begun = 0, [], {}
    for line in entry['lines']:
        if line['at'] < last or line.get('by', line['at']) < line['at']:
            yield f'{line["at"]} comes too late'
        last = line['at']
        says, side = line.get('says', '').removesuffix(' again'), 'we' if 'we' in line else 'they'
        is_whole = not begun.get(side) and ' + ' not in says
        if says:
            begun[side] = 'part of a message' in says
        if says and is_whole and says not in ('noise', 'part of a message'):
            found = meaning(bytes.fromhex(line[side]), entry['check'])
            if found != says:
                yield f'at {last} is {found}, not {says}'
        if 'asks' in line:
            asked.append(bytes.fromhex(line['asks']))
        reply = bytes.fromhex(line.get('gets', ''))
        if reply and not any(  # DST may be the number of a gateway (M 6-4)
                reply[1:3] == bytes((command[0], command[2] | 0x40))
                and reply[4:6] == command[4:6] for command in asked):
            yield f'at {last} is no reply to a command'


def hashes(folder):
    """Return the SHA-256 of every file of the data set by its name."""
    files = [*folder.glob('*.json'), *folder.glob('*.md'), *folder.glob('captures/*.*')]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(files) if path.name != 'manifest.json'}


def faults(folder):
    """Yield everything that is wrong."""
    def load(name):
        return json.loads((folder / name).read_text(encoding='utf-8'))

    rules, manifest, wrong = load('schema.json')['$defs'], load('manifest.json'), False
    for name in ('frames.json', 'exchanges.json', 'conversations.json', 'processors.json',
                 'captures/index.json'):
        for text in check_schema(load(name), rules[name], rules, name):
            wrong = True
            yield text
    known, found = manifest['files'], hashes(folder)
    yield from (f'manifest.json: {name} differs' for name in sorted(known.keys() | found.keys())
                if known.get(name) != found.get(name))
    captures = {path.stem for path in folder.glob('captures/*.cap')}
    yield from (f'captures: {name} is not in both places'
                for name in sorted(captures ^ load('captures/index.json').keys()))
    if wrong:
        return
    for name, check in (('frames', check_frame), ('exchanges', check_exchange),
                        ('conversations', check_conversation), ('processors', check_processor)):
        content = load(f'{name}.json')
        entries = content[name]
        if content['version'] != manifest['version']:
            yield f'{name}.json: version {content["version"]}'
        if len({entry['name'] for entry in entries}) < len(entries):
            yield f'{name}.json: a name stands twice'
        for entry in entries:
            yield from (f'{name}.json: {entry["name"]}: {text}' for text in check(entry))


def main(folder, update=False):
    """Print what is wrong; return the exit status."""
    if update:
        version = json.loads((folder / 'frames.json').read_text(encoding='utf-8'))['version']
        text = json.dumps({'version': version, 'license': 'CC0-1.0', 'files': hashes(folder)},
                          indent=1)
        (folder / 'manifest.json').write_text(text + '\n', encoding='utf-8')
    found = list(faults(folder))
    print('\n'.join(found) or 'all good')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main(Path(__file__).resolve().parent, '--update' in sys.argv[1:]))
