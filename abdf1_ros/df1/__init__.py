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
The DF1 data-link layer, without clock, thread or port.

Sources are cited by publication and page: "M 5-2" is publication 1770-6.5.16 (October 1996, DF1
Protocol and Command Set Reference Manual), page 5-2; "KF2 4-31" is the user manual of the
1770-KF2, page 4-31; "1766-RM001" is the reference manual of the MicroLogix 1400. "S0" is the
specification of this driver: the documentation of the AB DF1 module, revision 0.1 of 7 August
2003. This driver has its fields, ranges, counters and numbered messages.
"""
