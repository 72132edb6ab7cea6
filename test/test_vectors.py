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

"""The data set of vectors/: schema, manifest and files agree, and what is wrong is found."""

from collections.abc import Callable
import json
from pathlib import Path
import re
import runpy
import shutil
from typing import Any

import pytest
from support.vectors import VECTOR_FOLDER

VERIFY = runpy.run_path(str(VECTOR_FOLDER / 'verify.py'))


def faults(folder: Path) -> list[str]:
    """Return what the verifier says of a folder."""
    return list(VERIFY['faults'](folder))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of the data set."""
    return Path(shutil.copytree(VECTOR_FOLDER, tmp_path / 'vectors'))


def change(path: Path, edit: Callable[[Any], object]) -> None:
    """Edit the content of a JSON file."""
    content = json.loads(path.read_text(encoding='utf-8'))
    edit(content)
    path.write_text(json.dumps(content), encoding='utf-8')


def test_data_set_is_what_it_says() -> None:
    assert faults(VECTOR_FOLDER) == []


def test_verifier_shares_no_code_with_the_package() -> None:
    source = (VECTOR_FOLDER / 'verify.py').read_text(encoding='utf-8')
    assert not re.search(r'^\s*(?:import|from) abdf1_ros', source, re.MULTILINE)


@pytest.mark.long
@pytest.mark.parametrize(('edit', 'fault'), [
    (lambda frame: frame.update(verdict='wrong check'), 'the verdict is good'),
    (lambda frame: frame.update(verdict='right'), "'right' is not one of"),
    (lambda frame: frame.update(check='BCC'), 'the verdict is wrong check'),
    (lambda frame: frame.update(bytes='10 0'), 'does not match'),
    (lambda frame: frame.update(colour='red'), 'colour is not known'),
    (lambda frame: frame.pop('origin'), 'origin is missing'),
    (lambda frame: frame['decoded'].update(tns=70000), '70000 is out of range'),
    (lambda frame: frame['decoded'].update(src=99), 'src is 0, not 99'),
    (lambda frame: frame['decoded'].update(tns='1'), 'is not of type integer'),
    (lambda frame: frame.update(origin={'how': 'printed', 'source': 'a manual'}),
     'a printed frame needs its page')])
def test_wrong_frame_is_found(copy: Path, edit: Callable[[Any], object], fault: str) -> None:
    def edit_one(content: Any) -> None:
        edit(next(frame for frame in content['frames']
                  if frame['name'] == 'slc_A2_N7_0_req_fd_crc'))
    change(copy / 'frames.json', edit_one)
    found = faults(copy)
    assert 'manifest.json: frames.json differs' in found
    assert any('slc_A2_N7_0_req_fd_crc' in text and fault in text for text in found)


@pytest.mark.long
@pytest.mark.parametrize(('field', 'value'), [
    ('reply', '05 01 41 00 02 04'), ('verdict', 'refused'),
    ('command', '01 05 01 10 01 04 04 00 04')])
def test_wrong_exchange_is_found(copy: Path, field: str, value: str) -> None:
    change(copy / 'exchanges.json', lambda content: content['exchanges'][0].update({field: value}))
    assert any(text.startswith('exchanges.json: plc2_read: ') for text in faults(copy))


@pytest.mark.long
@pytest.mark.parametrize(('number', 'change_of_line', 'fault'), [
    (1, {'says': 'reply'}, 'at 0 is command, not reply'), (2, {'at': 2000}, '0 comes too late'),
    (1, {'we': '10 05 11 EE'}, 'at 0 is damaged poll, not command'),
    (0, {'asks': '11 05 0F 00 03 01 A2'}, 'at 0 is no reply to a command'),
    (0, {'shouts': '10 06'}, 'shouts is not known')])
def test_wrong_conversation_is_found(copy: Path, number: int, change_of_line: dict[str, Any],
                                     fault: str) -> None:
    change(copy / 'conversations.json', lambda content: content['conversations'][0]['lines'][
        number].update(change_of_line))
    assert any('master_transaction' in text and fault in text for text in faults(copy))


def test_file_that_is_missing_or_more_is_found(copy: Path) -> None:
    (copy / 'captures/pydf1_client_crc_slc.cap').unlink()
    (copy / 'captures/new.cap').write_text('')
    assert faults(copy) == [
        'manifest.json: captures/new.cap differs',
        'manifest.json: captures/pydf1_client_crc_slc.cap differs',
        'captures: new is not in both places',
        'captures: pydf1_client_crc_slc is not in both places']


def test_update_writes_the_hashes(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (copy / 'README.md').write_text('changed')
    assert VERIFY['main'](copy) == 1
    assert capsys.readouterr().out == 'manifest.json: README.md differs\n'
    assert VERIFY['main'](copy, update=True) == 0
    assert capsys.readouterr().out == 'all good\n'
