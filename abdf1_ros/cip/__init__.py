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
EtherNet/IP and CIP, as far as a program needs it to send PCCC commands to one PLC.

Bytes and the time go in; bytes and PCCC commands come out. ``sessions`` has the sessions of one
place. The formats are from the CIP Networks Library, volume 1 (CIP) and volume 2 (EtherNet/IP), as
public stacks and clients use them.
"""
