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
The read plan: which words are read together, the cost on the line, and the times.

- ``planner`` makes blocks of mappings, with ``partition`` and the costs of ``line_model``.
- ``forecast`` computes poll cycle, load and intervals.
- ``bounds`` computes which times heartbeats and fallback values can keep.
- ``report`` describes the plan and its times for ``check``.
- ``usable_rows`` leaves out rows that do not fit the line.
- ``refusals`` divides blocks that a PLC has refused.
- ``reading`` reads mappings once, for the library.

Nothing here asks a PLC. ``check`` prints the plan that the node carries out.
"""
