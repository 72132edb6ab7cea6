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
A program of somebody else, driven through lines of JSON.

A player runs under the Python that has the other product installed, so it imports nothing of this
package. Each request is one line: ``{"do": "read", "address": "N7:0", "count": 4}`` or
``{"do": "write", "address": "N7:0", "values": [1, 2]}``. The answer is one line:
``{"values": [...]}``, ``{"done": true}``, ``{"error": "..."}`` where the other end refused or was
silent, or ``{"cannot": "..."}`` where the product has no way to say this.
"""

from __future__ import annotations

from collections.abc import Callable
import json
import os
import sys

# What the product prints goes to stderr, from the moment this is imported.
_ANSWERS = os.fdopen(os.dup(1), 'w')
os.dup2(2, 1)


class Cannot(Exception):
    """The product has no way to do this; the text says why."""


def play(read: Callable[[str, int], object], write: Callable[[str, object], None]) -> None:
    """Answer requests until standard input ends."""
    def answer(fields: dict[str, object]) -> None:
        print(json.dumps(fields), file=_ANSWERS, flush=True)

    answer({'ready': True})
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if request['do'] == 'read':
                answer({'values': read(request['address'], request['count'])})
            else:
                write(request['address'], request['values'])
                answer({'done': True})
        except Cannot as error:
            answer({'cannot': str(error)})
        except Exception as error:  # whatever the product raises is its answer
            answer({'error': f'{type(error).__name__}: {error}'})
