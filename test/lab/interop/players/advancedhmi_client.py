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

"""AdvancedHMI, an HMI for .NET: its driver for DF1 over TCP, under Mono."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import re
import sys
import tempfile
import time
from typing import Any

from player import Cannot, play
import pythonnet

SETTLE = 2.0  # s: it does not say when several values are written, and repeats commands after 1 s
TRIES = 3
LOST = {'C5:2.PRE': 'it asks for 4 bytes and returns nothing',
        'S:10': 'it asks for 84 bytes'}


def main() -> None:
    """Play through the assembly, a TCP port, a check and the PLC family in the arguments."""
    assembly, port, check, family = sys.argv[1:]
    driver = driver_of(Path(assembly).resolve(), port, check, family)

    def read(address: str, count: int) -> object:
        if is_structure(address):
            raise Cannot('no elements of three words')
        if address in LOST:
            raise Cannot(LOST[address])
        values = list(again(lambda: driver.Read(address, count)))
        if address.startswith('ST'):
            return values[0]
        return [number(value) for value in values]

    def write(address: str, values: object) -> None:
        if is_structure(address):
            raise Cannot('no elements of three words')
        texts = [values] if isinstance(values, str) else [text_of(value) for value in values]
        if len(texts) == 1:
            again(lambda: driver.Write(address, texts[0]))
        else:
            driver.BeginWrite(address, len(texts), texts)
            time.sleep(SETTLE)

    play(read, write)
    driver.Dispose()


def again(request: Callable[[], Any]) -> Any:
    """Return what a request returns; like an HMI, ask again after "no response"."""
    for _ in range(TRIES - 1):
        try:
            return request()
        except Exception as error:  # an exception of .NET, of which no module is known here
            print(type(error).__name__, file=sys.stderr)
    return request()


def driver_of(assembly: Path, port: str, check: str, family: str) -> object:
    """Return the driver of the assembly, at a TCP port, as node 0 towards node 1."""
    os.chdir(tempfile.gettempdir())  # for its log of errors
    pythonnet.load('mono')
    import clr
    clr.AddReference(str(assembly.with_suffix('')))
    from MfgControl.AdvancedHMI.Drivers import DF1overTcpForSLCMicroPLC5
    driver = DF1overTcpForSLCMicroPLC5()
    driver.IPAddress = '127.0.0.1'
    driver.Port = int(port)
    driver.CheckSumType = type(driver.CheckSumType)(0 if check == 'CRC' else 1)
    driver.TargetNode = 1
    driver.IsPLC5 = family == 'PLC5'
    return driver


def is_structure(address: str) -> bool:
    """Tell whether an address is a whole element of three words."""
    return bool(re.fullmatch(r'[TCR]\d+:\d+', address))


def number(text: str) -> float:
    """Return a value that it read, which is text; a bit is True or False."""
    if text in ('True', 'False'):
        return text == 'True'
    return int(text) if re.fullmatch(r'-?\d+', text) else float(text)


def text_of(value: float) -> str:
    """Return a value as it takes it: a word with its sign."""
    return str((value & 0xFFFF ^ 0x8000) - 0x8000) if isinstance(value, int) else repr(value)


main()
