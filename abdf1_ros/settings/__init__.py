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
The two CSV files: the settings of the line, its mappings, and the values in their cells.

``network`` reads the net file and has a field for each column. ``map_file`` reads the map file,
``map_row`` one row of it. ``columns`` lists the values that each column allows, and the rows that
may have it. A checked row is a ``mapping``, and ``rows`` has all mappings, in groups.
``csv_table`` reads CSV files as spreadsheets write them. ``hints`` explains wrong cells,
``remarks`` unusual ones.

Every fault has file, line and column. All faults of a file are found at once. No module here opens
a port or makes the plan of a line.
"""

# The specification's list, and 300 and 600 baud: a MicroLogix 1000 has them (its manual, D-6).
BAUD_RATES = (300, 600, 1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200)
PARITIES = ('None', 'Even', 'Odd')
