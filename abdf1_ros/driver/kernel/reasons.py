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


"""Why a message is not taken: all reasons, in the order in which they are looked for."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from abdf1_ros.driver.write import Outcome


def _reason(words: str, outcome: Outcome = Outcome.REFUSED) -> str:
    """Return a field for one reason; ``words`` name it on the page of topics."""
    found: str = field(default='', metadata={'words': words, 'outcome': outcome})
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class WriteReasons:
    """
    What is against a message; each reason is empty where it does not hold.

    The thread of the callbacks knows the first reasons, the thread of the link the later ones. The
    page docs/reference/topics.md prints the fields in their order.
    """

    age: str = _reason('the message is too old, or its time stamp is ahead')
    read_only: str = _reason('`read_only`')
    closed: str = _reason('the port is not open')
    ends: str = _reason('this node ends')
    crowded: str = _reason('too many writes wait')
    values: str = _reason('length or values are wrong')
    publishers: str = _reason('[more than one publisher](../heartbeats.md#a-single-publisher)')
    overruled: str = _reason('a `fallback` has gone out since, or the end has begun',
                             Outcome.NOT_SENT)
    put_off: str = _reason('a `fallback` is due, and the PLC is silent', Outcome.NOT_SENT)
    waited: str = _reason('it has waited for longer than `write_timeout`', Outcome.NOT_SENT)
    unheard: str = _reason('nothing has been heard on this connection', Outcome.NOT_SENT)

    @property
    def first(self) -> tuple[Outcome, str] | None:
        """Return the result of the first reason and its text, None if the message is taken."""
        return next(((outcome, text) for name, outcome in _OUTCOMES
                     if (text := getattr(self, name))), None)


_OUTCOMES: tuple[tuple[str, Outcome], ...] = tuple(
    (each.name, each.metadata['outcome']) for each in fields(WriteReasons))

IN_ORDER: tuple[str, ...] = tuple(each.metadata['words'] for each in fields(WriteReasons))
"""The words of all reasons for the page of topics."""
