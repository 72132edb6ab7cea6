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

"""Package description for colcon (ament_python) and for pip."""

from glob import glob
from pathlib import Path
import sys
from xml.etree import ElementTree

from setuptools import find_packages, setup

PACKAGE = 'abdf1_ros'

# Authors, maintainer and addresses are filled in there alone; a release counts up both versions.
MANIFEST = ElementTree.parse(Path(__file__).resolve().parent / 'package.xml').getroot()
MAINTAINER = MANIFEST.find('maintainer')

# ROS finds all commands in lib/abdf1_ros, each with the interpreter of the build in its first
# line. On the PATH of pip are only names that no other program has.
COMMANDS = ('node', 'lines', 'monitor', 'demo', 'simulator', 'sniff', 'check', 'plc', 'conform')
EXAMPLES = tuple(Path(name).stem for name in sorted(glob('examples/*.py')))
IS_FOR_ROS = bool({'install', 'develop'} & {*sys.argv})  # colcon asks for these, pip never does

setup(
    name=PACKAGE,
    version='0.1.0',
    description='Bridge between Allen-Bradley PLCs and ROS topics over DF1',
    long_description=(Path(__file__).resolve().parent / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    classifiers=[
        'Development Status :: 4 - Beta',
        'Environment :: Console',
        'Intended Audience :: Manufacturing',
        'Operating System :: POSIX :: Linux',
        'Programming Language :: Python :: 3 :: Only',
        'Topic :: Communications',
        'Topic :: Scientific/Engineering :: Interface Engine/Protocol Translator',
        'Topic :: System :: Hardware',
        'Typing :: Typed',
    ],
    keywords=['DF1', 'PCCC', 'Allen-Bradley', 'PLC', 'PLC-5', 'SLC 500', 'MicroLogix', 'ROS'],
    url=MANIFEST.find('url[@type="repository"]').text,
    author=MAINTAINER.text,
    author_email=MAINTAINER.get('email'),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    license='Apache-2.0',
    python_requires='>=3.11',
    packages=find_packages(include=[PACKAGE, f'{PACKAGE}.*']),
    package_data={PACKAGE: ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'share/{PACKAGE}/config', sorted(glob('config/*.*'))),
        (f'share/{PACKAGE}/config/sros2', sorted(glob('config/sros2/*.xml'))),
        (f'share/{PACKAGE}/deploy', sorted(glob('deploy/*.*') + ['deploy/Dockerfile'])),
        (f'share/{PACKAGE}/examples', sorted(glob('examples/*.*'))),
        (f'share/{PACKAGE}/examples/testing', sorted(glob('examples/testing/*.py'))),
        (f'share/{PACKAGE}/launch', sorted(glob('launch/*.py'))),
        (f'share/{PACKAGE}/wireshark', ['wireshark/abdf1.lua']),
    ],
    zip_safe=False,
    install_requires=['setuptools', 'pyserial', 'PyYAML'],
    # Not tests_require: newer setuptools ignores it, and colcon test would then run no pytest.
    extras_require={'test': ['hypothesis', 'pytest', 'pytest-timeout']},
    entry_points={
        'console_scripts': [
            f'abdf1 = {PACKAGE}.__main__:main',
            *(f'{name} = {PACKAGE}.cli.main:{name}'
              for name in (COMMANDS if IS_FOR_ROS else ('plc',))),
            *(f'{name} = {PACKAGE}.cli.examples:{name}'
              for name in (EXAMPLES if IS_FOR_ROS else ())),
        ],
    },
)
