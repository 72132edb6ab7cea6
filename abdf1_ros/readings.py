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

"""Several rows read at once: values alone, or for each row its value or its error."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
import copy
from dataclasses import dataclass
import time
from typing import TypeVar

from abdf1_ros.errors import Abdf1Error, LinkError
from abdf1_ros.open_line import OpenLine, PlcValue
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.planner import Planner
from abdf1_ros.plan.reading import read_each, read_planned
from abdf1_ros.settings.mapping import Mapping

_Result = TypeVar('_Result')


@dataclass(frozen=True, slots=True)
class Reading:
    """
    What a partial read has for one tag or address.

    ``value`` is None if there is an ``error``. ``time`` is the moment of the reply, or of the
    failure, in s since 1970.
    """

    value: PlcValue
    error: Abdf1Error | None
    time: float

    @classmethod
    def failed(cls, error: Abdf1Error, about: str = '') -> Reading:
        """Return the reading of an error now; ``about`` replaces the place of the error."""
        own = copy.copy(error)
        own.about = about or error.about
        return cls(None, own, time.time())


class _AskedOnce:
    """A line that asks a station no more after it has become silent, but fails at once."""

    def __init__(self, line: OpenLine) -> None:
        self._line = line
        self._silent: dict[int, LinkError] = {}

    def ask(self, station: int, work: Steps[_Result]) -> _Result:
        """Carry out a request and return its result; raises what its steps raise."""
        if station in self._silent:
            raise self._silent[station]
        try:
            return self._line.ask(station, work)
        except LinkError as error:
            if not self._line.stations[station].replies_in_time:
                self._silent[station] = copy.copy(error)
                self._silent[station].sent = False
            raise


def values_of_rows(line: OpenLine, rows: Iterable[Mapping]) -> dict[Mapping, Values]:
    """Return the values of each row; raises the first error."""
    return dict(read_planned(Planner(line.line_model, 1.0), rows, line))


def readings_of_rows(
        line: OpenLine, rows: Iterable[Mapping], place: Callable[[Mapping], str],
        shown: Callable[[Mapping, Values], PlcValue]) -> Iterator[tuple[str, Reading]]:
    """Yield the tag of each row with its reading; ``place`` names a row in its error."""
    for row, found in read_each(Planner(line.line_model, 1.0), rows, _AskedOnce(line)):
        if isinstance(found, Abdf1Error):
            reading = Reading.failed(found, place(row))
            line.log.debug('%s', reading.error)
        else:
            reading = Reading(shown(row, found), None, time.time())
        yield row.tag, reading
