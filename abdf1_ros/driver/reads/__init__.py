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
The reads: which blocks are due, and which values are published or withheld.

- ``readings``: takes the words of each block and gives them to the points of its rows.
- ``point``: the last value of one row, and its freshness.
- ``job``: one block; ``queue``: the order of all blocks.
- ``silent``: the reads of stations that do not answer.
- ``guards``: withhold values while the program of a PLC does not run.
"""
