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

"""The list of all modes. Each mode is defined in the module of its link."""

from __future__ import annotations

from abdf1_ros.df1.listen import LISTEN
from abdf1_ros.df1.master import MASTER
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.polling import STANDARD
from abdf1_ros.df1.radio import RADIO
from abdf1_ros.df1.slave_link import SLAVE

MODES: list[LineMode] = [MASTER, STANDARD, SLAVE, PEER, RADIO, LISTEN]


def mode_of(name: str, polling: str) -> LineMode:
    """Return the mode that the columns Mode and Polling name."""
    return next(mode for mode in MODES if mode.name == name and mode.polling in ('', polling))
