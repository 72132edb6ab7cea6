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
Run one fuzz target under atheris: ``fuzzer.py --target=NAME [options of libFuzzer] [folders]``.

libFuzzer passes over options with two dashes, and gives them to the processes it starts.
"""

import importlib
from pathlib import Path
import shlex
import sys

_TARGET = '--target='
_TESTS = Path(__file__).resolve().parents[2]


def main() -> None:
    """Fuzz until libFuzzer's options say that it is enough, or something is found."""
    try:
        import atheris
    except ImportError:
        sys.exit('fuzzing needs atheris: pip install -r requirements/fuzz.txt '
                 '(there are wheels for CPython on Linux x86-64 only)')
    sys.path[:0] = [str(_TESTS.parent), str(_TESTS), str(_TESTS / 'lab')]
    (name,) = (word.removeprefix(_TARGET) for word in sys.argv if word.startswith(_TARGET))
    with atheris.instrument_imports(include=['abdf1_ros']):
        target = importlib.import_module(f'fuzz.{name}')
    # A merge starts this anew.
    sys.argv[0] = shlex.join([sys.executable, str(Path(__file__).resolve())])
    atheris.Setup(sys.argv, target.one_input)
    atheris.Fuzz()


if __name__ == '__main__':
    main()
