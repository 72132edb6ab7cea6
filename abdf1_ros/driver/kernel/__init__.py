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
The decision what may be written to the PLCs of a line (docs/heartbeats.md).

``kernel`` takes the events; ``gate`` is the only way to the line. The other modules answer
questions:

- ``flights``: each write from its turn on: what may still land, and what stands.
- ``waiting``: the messages that wait for the line; ``reasons``: why a message is not taken.
- ``rows``: the heartbeats and fallbacks of the line; ``turns``: which of them goes first.
- ``plc``: the rows of one station; ``heartbeat``, ``fallback``: one row each, with its rules;
  ``own``: what they share; ``end``: the orderly end.
"""
