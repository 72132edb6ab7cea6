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
Maps made of exports of other programs, and of lists.

``records.py`` reads cells, ``table.py`` finds the columns, ``form.py`` makes rows, ``imported.py``
a map. A form is data in ``forms.py``: headings by role, words for types, and its own rules.

A row that cannot become a mapping stays in the map as a comment, and is reported with its line. A
row may write to the PLC only if the file says so, and if everything in the row is understood.
"""
