-- Copyright 2026 abdf1_ros maintainers
--
-- Licensed under the Apache License, Version 2.0 (the "License");
-- you may not use this file except in compliance with the License.
-- You may obtain a copy of the License at
--
--     http://www.apache.org/licenses/LICENSE-2.0
--
-- Unless required by applicable law or agreed to in writing, software
-- distributed under the License is distributed on an "AS IS" BASIS,
-- WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
-- See the License for the specific language governing permissions and
-- limitations under the License.
--
-- DF1 and PCCC for Wireshark: the files of "sniff --pcapng" (link type USER0).
--
-- Copy it to the personal Lua plugins folder (Help, About, Folders), or give it to tshark with
-- -X lua_script:abdf1.lua. A packet is one symbol of DF1 as it stood on the line, after four
-- bytes: version, direction, check and verdict of sniff. All else is worked out here.

-- generated: tables

local SYMBOLS = {
  [0x01] = 'SOH',
  [0x02] = 'STX',
  [0x03] = 'ETX',
  [0x04] = 'EOT',
  [0x05] = 'ENQ',
  [0x06] = 'ACK',
  [0x10] = 'DLE',
  [0x15] = 'NAK',
}

local WITH_FNC = {[0x06] = true, [0x07] = true, [0x0F] = true}

local COMMANDS = {
  [0x0000] = 'protected write',
  [0x0001] = 'unprotected read',
  [0x0002] = 'protected bit write',
  [0x0003] = 'physical write',
  [0x0004] = 'physical read',
  [0x0005] = 'unprotected bit write',
  [0x0600] = 'echo',
  [0x0601] = 'read diagnostic counters',
  [0x0602] = 'set variables',
  [0x0603] = 'diagnostic status',
  [0x0604] = 'set timeout',
  [0x0605] = 'set NAKs',
  [0x0606] = 'set ENQs',
  [0x0607] = 'reset diagnostic counters',
  [0x0608] = 'set data table size',
  [0x0609] = 'read link parameters',
  [0x060A] = 'set link parameters',
  [0x0700] = 'disable outputs',
  [0x0701] = 'enable outputs',
  [0x0703] = 'enable scan',
  [0x0704] = 'enter download mode',
  [0x0705] = 'exit download or upload mode',
  [0x0706] = 'enter upload mode',
  [0x0008] = 'unprotected write',
  [0x000A] = 'connected CIP message',
  [0x000B] = 'unconnected CIP message',
  [0x0F00] = 'word range write',
  [0x0F01] = 'word range read',
  [0x0F02] = 'bit write',
  [0x0F03] = 'file write',
  [0x0F04] = 'file read',
  [0x0F05] = 'download request',
  [0x0F06] = 'upload request',
  [0x0F07] = 'shut down',
  [0x0F08] = 'physical write',
  [0x0F09] = 'physical read',
  [0x0F0A] = 'restart',
  [0x0F11] = 'get edit resource',
  [0x0F12] = 'return edit resource',
  [0x0F17] = 'read bytes physical',
  [0x0F18] = 'write bytes physical',
  [0x0F26] = 'read-modify-write',
  [0x0F29] = 'read section size',
  [0x0F3A] = 'set CPU mode',
  [0x0F41] = 'disable forces',
  [0x0F50] = 'download all',
  [0x0F52] = 'download completed',
  [0x0F53] = 'upload all',
  [0x0F55] = 'upload completed',
  [0x0F57] = 'initialize memory',
  [0x0F5E] = 'modify compatibility file',
  [0x0F67] = 'typed write',
  [0x0F68] = 'typed read',
  [0x0F79] = 'read-modify-write N',
  [0x0F80] = 'change mode',
  [0x0F81] = 'open file',
  [0x0F82] = 'close file',
  [0x0F88] = 'execute command list',
  [0x0F8F] = 'apply port configuration',
  [0x0F94] = 'read file information',
  [0x0FA1] = 'protected typed logical read',
  [0x0FA2] = 'protected typed logical read',
  [0x0FA3] = 'read of words by physical address',
  [0x0FA7] = 'protected typed file read',
  [0x0FA9] = 'protected typed logical write',
  [0x0FAA] = 'protected typed logical write',
  [0x0FAB] = 'masked write',
  [0x0FAF] = 'protected typed file write',
}

local STS = {
  [0x01] = 'destination has no buffer space',
  [0x02] = 'destination does not acknowledge, delivery not guaranteed',
  [0x03] = 'duplicate token holder seen',
  [0x04] = 'local port is disconnected',
  [0x05] = 'no reply in time (application timeout)',
  [0x06] = 'duplicate node address',
  [0x07] = 'station is off line',
  [0x08] = 'hardware fault',
  [0x10] = 'illegal command, format or length, or the file does not exist',
  [0x20] = 'host has a problem and does not communicate',
  [0x30] = 'remote host is missing, disconnected or shut down',
  [0x40] = 'hardware fault in the host',
  [0x50] = 'address not there, or memory protected',
  [0x60] = 'function disallowed by a protection setting',
  [0x70] = 'processor is in program mode',
  [0x80] = 'compatibility file missing, or communication zone problem',
  [0x90] = 'remote node cannot buffer the command',
  [0xA0] = 'wait for acknowledge (buffer full)',
  [0xB0] = 'problem because of a download',
  [0xC0] = 'wait for acknowledge (buffer full)',
  [0xF0] = 'extended status missing from the reply',
}

local EXT_STS = {
  [0x01] = 'a field has an illegal value',
  [0x02] = 'fewer address levels than this needs',
  [0x03] = 'more address levels than the system has',
  [0x04] = 'symbol not found',
  [0x05] = 'symbol is badly formed',
  [0x06] = 'address does not point to something usable',
  [0x07] = 'file has the wrong size',
  [0x08] = 'situation has changed since the transaction began',
  [0x09] = 'data or file too large',
  [0x0A] = 'transaction size plus word address too large',
  [0x0B] = 'no access: privilege missing',
  [0x0C] = 'condition cannot be produced, resource not available',
  [0x0D] = 'condition exists already, resource is already available',
  [0x0E] = 'command cannot be executed',
  [0x0F] = 'histogram overflow',
  [0x10] = 'no access',
  [0x11] = 'data type does not fit the request',
  [0x12] = 'bad parameter or data',
  [0x13] = 'address points into a deleted area',
  [0x14] = 'failed for an unknown reason',
  [0x15] = 'data conversion error',
  [0x16] = 'scanner cannot reach the rack adapter',
  [0x17] = 'type mismatch',
  [0x18] = 'bad response from the module',
  [0x19] = 'duplicate label',
  [0x1A] = 'file is open, owned by another node',
  [0x1B] = 'program is owned by another node',
  [0x1E] = 'data table element is protected',
  [0x1F] = 'temporary internal problem',
  [0x22] = 'remote rack fault',
  [0x23] = 'timeout on the way to the remote rack',
  [0x24] = 'unknown error',
}

local PLC5_FILES = {
  [0x00] = {name = 'O', octal = true, members = {}},
  [0x01] = {name = 'I', octal = true, members = {}},
  [0x02] = {name = 'S2', members = {}},
  [0x03] = {name = 'B3', members = {}},
  [0x04] = {name = 'T4', members = {[1] = '.PRE', [2] = '.ACC'}},
  [0x05] = {name = 'C5', members = {[1] = '.PRE', [2] = '.ACC'}},
  [0x06] = {name = 'R6', members = {[1] = '.LEN', [2] = '.POS'}},
  [0x07] = {name = 'N7', members = {}},
  [0x08] = {name = 'F8', members = {}},
}

local PLC5_TYPES = {
  [0x0301] = 'A',
  [0x0354] = 'ST',
  [0x050A] = 'T',
  [0x0606] = 'C',
  [0x0706] = 'R',
  [0x0804] = 'F',
  [0x1002] = 'D',
  [0x15A4] = 'PD',
  [0x1670] = 'MG',
  [0x1D06] = 'SC',
}

local SLC_FILES = {
  [0x84] = {name = 'S', members = {}},
  [0x85] = {name = 'B', members = {}},
  [0x86] = {name = 'T', members = {[1] = '.PRE', [2] = '.ACC'}},
  [0x87] = {name = 'C', members = {[1] = '.PRE', [2] = '.ACC'}},
  [0x88] = {name = 'R', members = {[1] = '.LEN', [2] = '.POS'}},
  [0x89] = {name = 'N', members = {}},
  [0x8A] = {name = 'F', members = {}},
  [0x8B] = {name = 'O', slots = true, members = {}},
  [0x8C] = {name = 'I', slots = true, members = {}},
  [0x8D] = {name = 'ST', members = {}},
  [0x8E] = {name = 'A', members = {}},
  [0x8F] = {name = 'D', members = {}},
  [0x91] = {name = 'L', members = {}},
  [0x92] = {name = 'MG', members = {[1] = '.1', [2] = '.2', [3] = '.3', [4] = '.4', [5] = '.RBL', [6] = '.LBN', [7] = '.RBN', [8] = '.CHN', [9] = '.NOD', [10] = '.MTO', [11] = '.11', [12] = '.12', [13] = '.TFN', [14] = '.ELE', [15] = '.15', [16] = '.16', [17] = '.17', [18] = '.ERR', [19] = '.19', [20] = '.20', [21] = '.21', [22] = '.22', [23] = '.23', [24] = '.24'}},
  [0x93] = {name = 'PD', members = {[1] = '.1', [2] = '.SPS', [3] = '.KC', [4] = '.TI', [5] = '.TD', [6] = '.6', [7] = '.MAXS', [8] = '.MINS', [9] = '.9', [10] = '.10', [11] = '.CVH', [12] = '.CVL', [13] = '.13', [14] = '.SPV', [15] = '.15', [16] = '.CVP', [17] = '.17', [18] = '.18', [19] = '.19', [20] = '.20', [21] = '.21', [22] = '.22'}},
}

local PLC3_SECTIONS = {
  [0x01] = {name = 'O', octal = true, bare = true},
  [0x02] = {name = 'I', octal = true, bare = true},
  [0x03] = {name = 'T', words = {'CTL', 'PRE', 'ACC'}, bare = true},
  [0x04] = {name = 'C', words = {'CTL', 'PRE', 'ACC'}, bare = true},
  [0x05] = {name = 'N'},
  [0x07] = {name = 'D'},
  [0x08] = {name = 'B'},
  [0x09] = {name = 'A'},
  [0x0D] = {name = 'S', bare = true},
}

-- end: tables

local VERSION = 1
local DLE, STX, ETX, ENQ, SOH = 0x10, 0x02, 0x03, 0x05, 0x01
local DIRECTIONS = {[0] = '?', [1] = '>', [2] = '<'}
local OPPOSITE = {['>'] = '<', ['<'] = '>'}
local CHECKS = {[1] = 'BCC', [2] = 'CRC'}

local df1 = Proto('abdf1', 'Allen-Bradley DF1 and PCCC')
local f = {
  direction = ProtoField.string('abdf1.direction', 'Direction'),
  kind = ProtoField.string('abdf1.kind', 'Kind'),
  check = ProtoField.string('abdf1.check', 'Check'),
  valid = ProtoField.bool('abdf1.valid', 'Check is right, says sniff'),
  computed = ProtoField.bool('abdf1.computed', 'Check is right'),
  station = ProtoField.uint8('abdf1.station', 'STN'),
  dst = ProtoField.uint8('abdf1.dst', 'DST'),
  src = ProtoField.uint8('abdf1.src', 'SRC'),
  cmd = ProtoField.uint8('abdf1.cmd', 'CMD', base.HEX),
  sts = ProtoField.uint8('abdf1.sts', 'STS', base.HEX),
  tns = ProtoField.uint16('abdf1.tns', 'TNS', base.HEX),
  fnc = ProtoField.uint8('abdf1.fnc', 'FNC', base.HEX),
  ext_sts = ProtoField.uint8('abdf1.ext_sts', 'EXT STS', base.HEX),
  code = ProtoField.string('abdf1.code', 'Command code'),
  command = ProtoField.string('abdf1.command', 'Command'),
  address = ProtoField.string('abdf1.address', 'Address'),
  status = ProtoField.string('abdf1.status', 'Status'),
  data = ProtoField.bytes('abdf1.data', 'After TNS'),
  request = ProtoField.framenum('abdf1.request', 'Answers', base.NONE, frametype.REQUEST),
  reply = ProtoField.framenum('abdf1.reply', 'Answered in', base.NONE, frametype.RESPONSE),
  copy_of = ProtoField.framenum('abdf1.copy_of', 'Sent on, or again: is that of'),
  latency = ProtoField.relative_time('abdf1.latency', 'After its command'),
}
df1.fields = {}
for _, field in pairs(f) do table.insert(df1.fields, field) end
local bad_check = ProtoExpert.new('abdf1.check.bad', 'Wrong check', expert.group.CHECKSUM,
                                  expert.severity.ERROR)
local refused = ProtoExpert.new('abdf1.refused', 'The command was refused',
                                expert.group.RESPONSE_CODE, expert.severity.WARN)
df1.experts = {bad_check, refused}

-- Commands that wait for their reply, and what was found at the first pass, by packet.
local open, found = {}, {}
-- By radio modem there are no symbols: messages by their bytes, and whether a symbol was seen.
local heard, has_symbols = {}, false
-- The last message of each path, and of each direction: one that comes again is a repetition.
-- And the time of the packet before.
local said, last, before = {}, {}, 0
local MEMORY = 10  -- s after which a reply comes too late, and the same message is another
function df1.init()
  open, found, heard, has_symbols, said, last, before = {}, {}, {}, false, {}, {}, 0
end

-- How a message repeats the last of its path; it is that of its direction now.
local function repetition(path, whole, from_master, direction)
  local mine, other = path .. tostring(from_master), path .. tostring(not from_master)
  local mark
  if said[mine] and said[mine].whole == whole then
    mark = said[mine].acknowledged and 'duplicate' or 'retransmission'
  else
    said[mine] = {whole = whole}
    if said[other] and said[other].whole == whole then mark = 'relayed' end
  end
  last[direction] = said[mine]
  return mark
end

-- Take the bytes of a message out of what stood on the line (from index at): STN, link data, the
-- check bytes, and whether DLE ETX was there.
local function unstuffed(bytes, at)
  local station
  if bytes[at + 1] == SOH then
    at = at + 2
    station = bytes[at]
    at = at + (station == DLE and 2 or 1)
  end
  at = at + 2  -- DLE STX
  local data, check = {}, {}
  while at <= #bytes do
    if bytes[at] ~= DLE then
      table.insert(data, bytes[at])
      at = at + 1
    elseif bytes[at + 1] == DLE then
      table.insert(data, DLE)
      at = at + 2
    elseif bytes[at + 1] == ETX then
      for n = at + 2, #bytes do table.insert(check, bytes[n]) end
      return station, data, check, true
    else
      break
    end
  end
  return station, data, check, false
end

local function bcc(station, data)
  local sum = station or 0
  for _, byte in ipairs(data) do sum = sum + byte end
  return {(256 - sum % 256) % 256}
end

-- M 5-6, 5-7: over STN and STX of a master's message, the data, and ETX.
local function crc(station, data)
  local value = 0
  local function add(byte)
    value = bit.bxor(value, byte)
    for _ = 1, 8 do
      local low = value % 2
      value = (value - low) / 2
      if low == 1 then value = bit.bxor(value, 0xA001) end
    end
  end
  if station then add(station) add(STX) end
  for _, byte in ipairs(data) do add(byte) end
  add(ETX)
  return {value % 256, math.floor(value / 256)}
end

local function same(one, other)
  if #one ~= #other then return false end
  for n, value in ipairs(one) do if other[n] ~= value then return false end end
  return true
end

-- A reader of fields; it answers nil after the end.
local function reader(data, at)
  local r = {at = at}
  function r.byte() r.at = r.at + 1 return data[r.at - 1] end
  function r.number()
    local value = r.byte()
    if value ~= 0xFF then return value end
    local low, high = r.byte(), r.byte()
    return high and low + 256 * high
  end
  return r
end

local function more(words)
  return words > 0 and string.format(' + %d word%s', words, words == 1 and '' or 's') or ''
end

local function octal(value, digits) return string.format('%0' .. digits .. 'o', value) end

-- M 13-10..13-15: 00 and text, or a mask and the levels it names. only_plc5: a command that a PLC-3
-- does not have. typed: what a write tells.
local function range_address(r, only_plc5, typed)
  local mask = r.byte()
  if mask == nil then return end
  if mask == 0 then
    local text = ''
    for byte in r.byte do
      if byte == 0 then break end
      text = text .. string.char(byte)
    end
    if text:match('^%$[A-Z]+%d*:%d+') then return text:sub(2) end
    return 'symbol ' .. text:gsub('^%$', '')
  end
  local level = {}
  for n = 0, 6 do
    if bit.band(mask, bit.lshift(1, n)) ~= 0 then
      level[n] = r.number()
      if level[n] == nil then return end
    end
  end
  if not only_plc5 and bit.band(mask, 0xF2) ~= 0x02 then  -- of a PLC-3
    local section, file = level[2] or 1, level[3] or 0
    local element, word = level[4] or 0, level[5] or 0
    local known = PLC3_SECTIONS[section]
    local name = known and known.name .. (file == 0 and known.bare and '' or file) .. ':'
    if known and known.words and known.words[word + 1] then
      return name .. element .. '.' .. known.words[word + 1]
    elseif known and not known.words and element == 0 then
      return name .. (known.octal and octal(word, 4) or word)
    end
    return string.format('E3.1.%d.%d.%d.%d', section, file, element, word)
  end
  local file, element, word = level[1] or 1, level[2] or 0, level[3]
  local known = PLC5_FILES[file]
  if not known and typed then
    local name = typed(r)
    known = name and {name = name .. file, members = {}}
  end
  if not known then
    local text = string.format('file %d:%d', file, element)
    return word and text .. '.' .. word or text
  end
  local place = known.octal and octal(element, 3) or tostring(element)
  local member = known.members[word]
  return known.name .. ':' .. place .. (member or more(word or 0))
end

-- M 7-28, 7-29: a flag, then type and size where they do not fit into it; an array holds another.
local function written_type(r)
  local kind, size
  repeat
    local flag = r.byte()
    if flag == nil then return end
    local function value(number, follows)
      if not follows then return number end
      local sum, scale = 0, 1
      for _ = 1, number do
        sum, scale = sum + (r.byte() or 0) * scale, scale * 256
      end
      return sum
    end
    kind = value(bit.band(bit.rshift(flag, 4), 7), flag >= 0x80)
    size = value(bit.band(flag, 7), bit.band(flag, 8) ~= 0)
  until kind ~= 9
  return PLC5_TYPES[kind * 256 + size]
end

-- M 7-17, 7-18: file, type, element and, but for A1 and A9, sub-element.
local function logical_address(r, is_short)
  local file, code, element = r.number(), r.byte(), r.number()
  local word = is_short and 0 or r.number()
  if word == nil or element == nil then return end
  local known = SLC_FILES[code]
  if not known then
    return string.format('file %d type %02X element %d%s', file, code, element, more(word))
  elseif known.slots then
    return string.format('%s:%d.%d', known.name, element, word)
  end
  return known.name .. file .. ':' .. element .. (known.members[word] or more(word))
end

-- The first address of a command whose data begin (with FNC) at index 7 of the message.
local function address_of(cmd, fnc, data)
  if cmd == 0x0F then
    if fnc == 0x00 or fnc == 0x01 or fnc == 0x04 or fnc == 0x68 then
      return range_address(reader(data, 12), fnc == 0x68)
    elseif fnc == 0x67 then
      return range_address(reader(data, 12), true, written_type)
    elseif fnc == 0x02 or fnc == 0x26 then
      return range_address(reader(data, 8), fnc == 0x26)
    elseif fnc == 0xA1 or fnc == 0xA9 then
      return logical_address(reader(data, 9), true)
    elseif fnc == 0xA2 or fnc == 0xAA or fnc == 0xAB then
      return logical_address(reader(data, 9), false)
    end
  elseif cmd == 0x00 or cmd == 0x01 or cmd == 0x02 or cmd == 0x05 or cmd == 0x08 then
    if data[8] then
      local byte = data[7] + 256 * data[8]
      return string.format('%s (ADDR %d)', octal(math.floor(byte / 2), 3), byte)
    end
  end
end

local function hexadecimal(number, digits) return string.format('%0' .. digits .. 'X', number) end

local function status_text(sts, ext)
  if sts >= 0xF0 and ext then
    return string.format('STS %02X EXT STS %02X: %s', sts, ext, EXT_STS[ext] or 'unknown code')
  end
  local texts = {}
  for _, part in ipairs({sts - sts % 16, sts % 16}) do
    if part ~= 0 and STS[part] then table.insert(texts, STS[part]) end
  end
  local meaning = #texts > 0 and table.concat(texts, '; ') or 'unknown code'
  return string.format('STS %02X: %s', sts, meaning)
end

-- Show DST to the end of a message; returns its kind and what it says.
local function message(data, range, tree, pinfo, is_good, from_master, direction)
  local dst, src, cmd, sts = data[1], data[2], data[3], data[4]
  local tns = data[5] + 256 * data[6]
  tree:add(f.dst, range, dst)
  tree:add(f.src, range, src)
  tree:add(f.cmd, range, cmd)
  tree:add(f.sts, range, sts)
  tree:add(f.tns, range, tns)
  local rest = {}
  for n = 7, #data do table.insert(rest, hexadecimal(data[n], 2)) end
  if #rest > 0 then
    tree:add(f.data, ByteArray.new(table.concat(rest)):tvb('After TNS')())
  end
  local is_reply = bit.band(cmd, 0x40) ~= 0
  local plain = bit.band(cmd, 0x9F)
  local code, text = hexadecimal(plain, 2), ''
  local fnc = WITH_FNC[plain] and not is_reply and data[7] or nil
  if fnc then
    tree:add(f.fnc, range, fnc)
    code = code .. '/' .. hexadecimal(fnc, 2)
  end
  tree:add(f.code, range, code)
  if not is_reply then
    local name = COMMANDS[fnc and plain * 256 + fnc or plain]
    if name then tree:add(f.command, range, name) end
    local address = address_of(plain, fnc, data)
    if address then tree:add(f.address, range, address) end
    text = (name or 'command ' .. code) .. (address and ' ' .. address or '')
  elseif sts ~= 0 then
    local ext = sts >= 0xF0 and data[7] or nil
    if ext then tree:add(f.ext_sts, range, ext) end
    text = status_text(sts, ext)
    tree:add(f.status, range, text)
    tree:add_proto_expert_info(refused, text)
  end
  if is_good then
    local whole = table.concat(data, ' ')
    local first = not has_symbols and heard[whole]
    local mark
    if not pinfo.visited then
      local path = string.format('%d %d %s ', src, dst, is_reply)
      mark = repetition(path, whole, from_master, direction)
    end
    if not pinfo.visited and first and pinfo.abs_ts - first.time < MEMORY then
      found[pinfo.number] = {copy = first.number}
    elseif not pinfo.visited then
      heard[whole] = {number = pinfo.number, time = pinfo.abs_ts}
      local key = is_reply and string.format('%d %d %d', dst, src, tns)
        or string.format('%d %d %d', src, dst, tns)
      local command = open[key]
      if command and before - command.time > MEMORY then command = nil end
      if not is_reply then
        local again = command and mark and not (mark == 'duplicate' and command.answered)
        if not again and dst ~= 255 then  -- a repeated one is timed from its first transmission
          open[key] = {number = pinfo.number, time = pinfo.abs_ts, text = text, cmd = plain}
        end
      elseif command and command.cmd == plain then  -- a repeated reply has no latency
        found[pinfo.number] = {request = command.number, text = command.text,
          seconds = not command.answered and pinfo.abs_ts - command.time or nil}
        found[command.number] = found[command.number] or {reply = pinfo.number}
        command.answered = true
      end
    end
    local known = found[pinfo.number]
    if known and known.request then
      tree:add(f.request, range, known.request)
      if known.seconds then
        local s = math.floor(known.seconds)
        tree:add(f.latency, range, NSTime.new(s, math.floor((known.seconds - s) * 1e9)))
      end
      text = (text == '' and 'done, ' or text .. ', to ') .. known.text
    elseif known and known.reply then
      tree:add(f.reply, range, known.reply)
    elseif known and known.copy then
      tree:add(f.copy_of, range, known.copy)
      text = text .. (text == '' and '' or ', ') .. 'as packet ' .. known.copy
    end
  end
  return is_reply and 'reply' or 'command', string.format(
    '%d to %d, TNS %04X: %s', src, dst, tns, text)
end

-- A response of the other direction may stand inside a message of a full-duplex line (M 4-3);
-- sniff gives it as a packet of its own.
function df1.dissector(tvb, pinfo, root)
  if tvb:len() < 6 or tvb(0, 1):uint() ~= VERSION then return 0 end
  local tree = root:add(df1, tvb())
  local direction = DIRECTIONS[tvb(1, 1):uint()] or '?'
  local check, verdict = CHECKS[tvb(2, 1):uint()], tvb(3, 1):uint()
  local range, bytes = tvb(4), {}
  for n = 0, range:len() - 1 do bytes[n + 1] = range(n, 1):uint() end
  local kind, text = 'unknown', ''
  tree:add(f.direction, tvb(1, 1), direction)
  local function verdicts(is_right)
    tree:add(f.check, tvb(2, 1), check or '')
    if verdict ~= 0 then tree:add(f.valid, tvb(3, 1), verdict == 1) end
    tree:add(f.computed, range, is_right)
    if not is_right then tree:add_proto_expert_info(bad_check) end
  end
  if bytes[1] == DLE and (bytes[2] == STX or bytes[2] == SOH) then
    local station, data, received, is_whole = unstuffed(bytes, 1)
    if station then tree:add(f.station, range, station) end
    local right = check == 'BCC' and bcc(station, data) or crc(station, data)
    local is_right = is_whole and same(received, right)
    if verdict ~= 0 then verdicts(is_right) end
    kind = 'damaged'
    if is_whole and #data >= 6 then
      local said
      said, text = message(data, range, tree, pinfo, is_right, bytes[2] == SOH, direction)
      if verdict == 1 then kind = said end
    end
  elseif bytes[1] == DLE and bytes[2] == ENQ and #bytes > 2 then
    kind = 'poll'
    tree:add(f.station, range, bytes[3])
    verdicts(bytes[#bytes] == bcc(bytes[3], {})[1])
    text = 'station ' .. bytes[3]
  elseif SYMBOLS[bytes[2]] then
    kind = SYMBOLS[bytes[2]]
    has_symbols = true
    local taken = last[OPPOSITE[direction] or direction]
    if bytes[2] == 0x06 and taken and not pinfo.visited then taken.acknowledged = true end
    if bytes[2] ~= ENQ and bytes[2] ~= 0x06 and bytes[2] ~= 0x15 and bytes[2] ~= 0x04 then
      kind = 'unknown'
    end
  end
  if not pinfo.visited then before = pinfo.abs_ts end
  tree:add(f.kind, range, kind)
  pinfo.cols.protocol = 'DF1'
  pinfo.cols.info = direction .. ' ' .. kind .. (text == '' and '' or ' ' .. text)
  tree:append_text(': ' .. kind .. ' ' .. text)
  return tvb:len()
end

DissectorTable.get('wtap_encap'):add(wtap.USER0, df1)
