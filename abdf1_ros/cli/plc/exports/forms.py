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
The known forms of files: headings, words for types, and what is special in each.

KEPServerEX: columns as Kepware ("CSV Import/Export") and PTC list them; data types and addresses
as in the help of its driver for Allen-Bradley DF1. RSView32 names the PLC in the column Node
Name, FactoryTalk View by a shortcut before the address, [PLC1]N7:0.
"""

from __future__ import annotations

import re

from abdf1_ros.cli.plc.exports.form import Form, Role, squeezed, Unusable

# Addresses in A files count characters, two in a word; a string has its length after "/".
_CHARACTERS = re.compile(r'A(?P<file>\d{1,3}):(?P<first>\d{1,5})(?:/(?P<count>\d{1,3}))?',
                         re.IGNORECASE)
_INPUT_OR_OUTPUT = re.compile(r'[IO]\d*:', re.IGNORECASE)


def _of_kepserver(address: str, kind: str | None,
                  length: str) -> tuple[str, str | None, str]:
    match = _CHARACTERS.fullmatch(address)
    if match is None:
        return address, kind, length
    first, count = int(match['first']), int(match['count'] or 0)
    word = f'A{match["file"]}:{first // 2}'
    if kind == 'string' and count and not first % 2 and not count % 2:
        return word, kind, str(count // 2)
    raise Unusable(f'{match[0]} counts characters, two in a word; read {word} as uint16 instead'
                   + (', or an even number of characters from an even one on' if count else ''))


_PLC = {role: words.split() for role, words in {  # of people's own columns in an export, too
    Role.PLC: 'plc plcname plcid plcno plcnumber plctype controller controllername cpu cpuname '
              'processor processorname device devicename deviceid deviceno iodevice iodevicename '
              'node nodename nodeid nodeno nodenumber nodeaddress connection connectionname '
              'channel channelname driver drivername topic topicname ddetopic accessname '
              'accesspath shortcut shortcutname server servername opcserver ioserver host '
              'hostname ip ipaddress network port comport slave slaveid slaveaddress unitid rtu '
              'provider devicegroup steuerung steuerungsname sps spsname gerät geraet gerätename '
              'automate autómata automata plcdevice source datasource target stationname '
              'remotenode remotestation destination',
    Role.PLACE: 'machine machinename cell cellname area areaname line linename plant site system '
                'systemname equipment skid maschine anlage linie zone ligne',
    Role.STATION: 'station stationnumber stationno stationaddress stationnr plcstation stationid '
                  'stationsnummer'}.items()}

KEPSERVER = Form(
    'tags of KEPServerEX (File, Export CSV)',
    [{'tagname', 'address', 'datatype', 'clientaccess'}], _PLC | {
        Role.TAG: ['tagname'], Role.ADDRESS: ['address'], Role.TYPE: ['datatype'],
        Role.ACCESS: ['clientaccess'], Role.PERIOD: ['scanrate'], Role.SCALING: ['scaling'],
        Role.RAW_LOW: ['rawlow'], Role.RAW_HIGH: ['rawhigh'], Role.LOW: ['scaledlow'],
        Role.HIGH: ['scaledhigh'], Role.CLAMP_LOW: ['clamplow'], Role.CLAMP_HIGH: ['clamphigh'],
        Role.NEGATE: ['negatevalue'], Role.DESCRIPTION: ['description'],
        Role.UNIT: ['engunits', 'engineeringunits'],
        Role.UNUSED: ['respectdatatype', 'scaleddatatype']},
    lambda text: {
        'default': '', 'boolean': 'bool', 'short': 'int16', 'word': 'uint16', 'long': 'int32',
        'dword': 'uint32', 'float': 'float32', 'bcd': 'bcd16', 'string': 'string',
    }.get(text.lower().removesuffix(' array')),
    adapt=_of_kepserver, folders='.', has_clear_slots=False)


def _tag_of_factorytalk(cells: dict[str, str]) -> str | None:
    if cells['tagtype'].upper() == 'F':
        return ''  # a folder
    if cells['tagtype'].upper() != 'A':  # the numbers of analog tags say nothing here
        cells |= dict.fromkeys(('scale', 'offset', 'minanalog', 'maxanalog'), '')
    return None if cells.get('datasource', '').upper() == 'D' else \
        'tags without a PLC (memory and system)'


FACTORYTALK = Form(
    'tags of RSView32 or FactoryTalk View', [{'tagtype', 'tagname', 'datasource'}], _PLC | {
        Role.TAG: ['tagname'], Role.ADDRESS: ['address'], Role.TYPE: ['nativetype'],
        Role.READ_ONLY: ['readonly'], Role.UNIT: ['units'],
        Role.PLC: [name for name in ('nodename', *_PLC[Role.PLC]) if name != 'datasource'],
        Role.DESCRIPTION: ['tagdescription'], Role.SCALE: ['scale'], Role.OFFSET: ['offset'],
        Role.MIN: ['minanalog'], Role.MAX: ['maxanalog'],
        Role.UNUSED: ['tagtype', 'datasource', 'security*', 'alarm*', 'datalogged', 'valuetype',
                      'initial*', 'deadband', '*label*', 'length*', 'scanclass', 'retentive']},
    lambda text: {
        '': '', 'd': '', 'i': 'int16', 'u': 'uint16', 'l': 'int32', 'f': 'float32', '3': 'bcd12',
        '4': 'bcd16'}.get(text.lower()),
    prepare=_tag_of_factorytalk, comments=(';',), folders='\\')

# Sections of tags in a PLC; all other sections have memory, groups and servers.
_IN_PLC = ('iodisc', 'ioint', 'ioreal', 'iomsg')


def _tag_of_intouch(cells: dict[str, str]) -> str | None:
    section = next(iter(cells), '')
    if section in _IN_PLC:
        if cells.get('itemusetagname', '').lower() == 'yes':
            cells['itemname'] = cells[section]
        return None
    return '' if section in ('', 'modeask', 'ioaccess', 'alarmgroup') else \
        'tags without a PLC (memory, groups, trends)'


def _of_intouch(address: str, kind: str | None,
                length: str) -> tuple[str, str | None, str]:
    if _INPUT_OR_OUTPUT.match(address):
        raise Unusable(
            'in items of InTouch, I and O may count bits in octal, and words through the image in '
            'place of slots; the file does not say which: write this row by hand')
    return address, kind, length


INTOUCH = Form(
    'tags of InTouch (DBDump)', [{section} for section in _IN_PLC], {
        Role.TAG: _IN_PLC, Role.ADDRESS: ['itemname'], Role.PLC: ['accessname'],
        Role.READ_ONLY: ['readonly'], Role.DESCRIPTION: ['comment'], Role.UNIT: ['engunits'],
        Role.SCALING: ['conversion'], Role.RAW_LOW: ['minraw'], Role.RAW_HIGH: ['maxraw'],
        Role.LOW: ['mineu'], Role.HIGH: ['maxeu'], Role.MIN: ['mineu'], Role.MAX: ['maxeu'],
        Role.INVERT: ['dconversion'], Role.UNUSED: ['*']},
    prepare=_tag_of_intouch, adapt=_of_intouch, mark=':')


def _tag_of_ignition(cells: dict[str, str]) -> str | None:
    return None if cells['valuesource'] == 'opc' else 'tags that are not of a PLC'


# It has the types of the values in Ignition, not of the words in the PLC.
IGNITION = Form(
    'tags of Ignition (Export Tags, JSON)', [{'valuesource', 'opcitempath', 'scalemode'}], {
        Role.TAG: ['name'], Role.ADDRESS: ['opcitempath'], Role.READ_ONLY: ['readonly'],
        Role.DESCRIPTION: ['documentation'], Role.UNIT: ['engunit'], Role.SCALING: ['scalemode'],
        Role.RAW_LOW: ['rawlow'], Role.RAW_HIGH: ['rawhigh'], Role.LOW: ['scaledlow'],
        Role.HIGH: ['scaledhigh'], Role.UNUSED: ['valuesource']},
    prepare=_tag_of_ignition, path='ns=1;s=[PLC]N7:0')

# Symbols of RSLogix have no row of names. A line is: address, perhaps scope, symbol, description.
RSLOGIX = Form(
    'symbols of RSLogix 500 or 5 (rows of address, scope, symbol)', (),
    {Role.ADDRESS: ['address'], Role.TAG: ['symbol'],
     Role.DESCRIPTION: [f'line{number}' for number in range(5)]},
    says_access=False, names_all=False)


_TYPES = {word: kind for kind, words in {
    '': ' default timer counter control pid message',
    'bool': 'bool boolean bit discrete digital binary booleano booléen booleen logisch',
    'int16': 'short int integer i2 int2 ganzzahl entier entero intero',
    'uint16': 'word uint ui2 ushort unsignedshort',
    'int32': 'long dint i4 int4 longint longinteger doubleint doubleinteger',
    'uint32': 'dword udint ui4 ulong unsignedlong',
    'float32': 'float real single r4 real4 float4 float32 real32 32bitfloat 32bitreal ieee '
               'floatingpt32 floatpt32 '
               'floatingpoint 32bitfloatingpoint gleitkomma réel reel',
    'bcd16': 'bcd bcd16 4digitbcd bcd4 bcdint16 16bitbcd', 'bcd12': 'bcd12 3digitbcd bcd3',
    'string': 'string str text asciistring'}.items() for word in words.split(' ')}
_SIZED = re.compile(
    r'(?:(?P<first>16|32)bit)?(?P<sign>u|unsigned|s|signed)?(?P<int>int|integer|i)?'
    r'(?P<after>signed|unsigned)?(?P<last>16|32)?(?:bits?)?')


def _type_of(text: str) -> str | None:
    """Return the Type that a word of any program means, such as Signed_int_16; None if unknown."""
    word = squeezed(text)
    if word in _TYPES:
        return _TYPES[word]
    match = _SIZED.fullmatch(word)
    if match is None or bool(match['first']) == bool(match['last']):
        return None
    signs = {sign[0] for sign in (match['sign'], match['after']) if sign}
    if len(signs) > 1 or not (signs or match['int']):
        return None
    return f'{"u" * (signs == {"u"})}int{match["first"] or match["last"]}'


LIST = Form(
    'a list with a row that names its columns (--tag COLUMN --address COLUMN)', (), _PLC | {
        role: words.split() for role, words in {
            Role.TAG: 'tagname tag symbol symbolname devicetag tagpath name *tagname variable '
                      'varname variablename signal signalname point pointname tagno tagnr '
                      'tagnumber aliasname alias nom variablenname nombre nome etiqueta repère '
                      'repere mnemonic bmk',
            Role.ADDRESS: 'address plcaddress deviceaddress tagaddress dataaddress ioaddress '
                          'itemname opcitempath itempath item adresse operand addr '
                          'dirección direccion indirizzo endereço adres *address *adresse',
            Role.TYPE: 'datatype type datentyp typ typededonnées typededonnee tipo tipodedato '
                       'tipodedatos tipodati rawdatatype rawtype vartype variabletype tagtype '
                       'devicedatatype nativetype',
            Role.DESCRIPTION: '*description* desc *comment* beschreibung* bemerkung* kommentar* '
                              'libellé* libelle* documentation* descripción* descripcion* '
                              'descrizione* descrição* bezeichnung* désignation* '
                              'designation* bedeutung service remark* note* tooltip',
            Role.ACCESS: 'access command lectureécriture lesenschreiben clientaccess '
                         'accessrights accessright accessmode accesstype '
                         'attribute attributes readwrite rw zugriff zugriffsrecht zugriffsart '
                         'accès acces acceso accesso acesso permission permissions rights',
            Role.READ_ONLY: 'readonly ro nurlesen schreibgeschützt lectureseule sololectura '
                            'writeprotected isreadonly',
            Role.WRITABLE: 'write writable writeable iswritable writeaccess writeenable '
                           'writeenabled canwrite allowwrite schreibbar beschreibbar inscriptible',
            Role.BIT: 'bit bitnumber bitno bitnr bitposition bitpos bitindex subelement',
            Role.LENGTH: 'length elements numberofelements elementcount noofelements arraysize '
                         'arraylength arrayelements array arraycount count länge laenge anzahl '
                         'longueur',
            Role.WORD_ORDER: 'wordorder byteorder wordswap swap swapwords byteswap endian '
                             'endianness firstword firstwordlow wordsequence',
            Role.INVERT: 'invert inverted inverse reverse reversed negate negated negatevalue '
                         'negative dconversion invertieren invertiert inverser activelow',
            Role.SCALING: 'scaling scalemode scalingtype scaletype scalingmode conversion '
                          'linearization linearisation',
            Role.SCALE: 'scale scalefactor scalingfactor factor faktor gain multiplier slope '
                        'skalierung skalierungsfaktor facteur decimal',
            Role.OFFSET: 'offset intercept bias versatz décalage',
            Role.RAW_LOW: 'rawlow rawmin minraw rawminimum rawzero rawzeroscale lowraw rawlo '
                          'rawscalelow rawscalemin inlo inlow',
            Role.RAW_HIGH: 'rawhigh rawmax maxraw rawmaximum rawfull rawfullscale highraw rawhi '
                           'rawscalehigh rawscalemax inhi inhigh',
            Role.LOW: 'scaledlow scaledmin minscaled englow engmin mineng mineu eumin eulow '
                      'engzero engzeroscale engineeringlow engscalelow engscalemin outlo outlow',
            Role.HIGH: 'scaledhigh scaledmax maxscaled enghigh engmax maxeng maxeu eumax euhigh '
                       'engfull engfullscale engineeringhigh engscalehigh engscalemax outhi '
                       'outhigh',
            Role.MIN: 'min minimum minvalue valuemin lowlimit lowerlimit minanalog minwert',
            Role.MAX: 'max maximum maxvalue valuemax highlimit upperlimit maxanalog maxwert',
            Role.PERIOD: 'period scanrate updaterate pollrate pollingrate scaninterval '
                         'updateinterval pollinterval',
            Role.UNIT: 'engunits engunit engineeringunits engineeringunit units egu uom einheit '
                       'unité unite unidad unit',
            Role.UNUSED: 'no nr # id row lfdnr group groupname taggroup folder path scope '
                         'scanclass scangroup logged datalogged eventlogged logging log history '
                         'historyenabled alarm* security* retentive* initial* deadband offlabel* '
                         'onlabel* respectdatatype page sheet rung wire* drawing location cabinet '
                         'terminal revision author date created modified version usedin usage '
                         'crossreference* value currentvalue actualvalue quality timestamp '
                         'displayname lengthstring label'}.items()},
    _type_of, comments=('#', ';', 'sep=', '//'), is_open=True, has_clear_slots=False,
    names_all=False)
