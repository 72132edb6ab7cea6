// Copyright 2026 abdf1_ros maintainers
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// Programs for Node.js that speak PCCC in EtherNet/IP: node-drivers and nodepccc.
//
// The protocol is that of player.py. Arguments: the folder node_modules, the product, and
// host:port of the far end.

import { createRequire } from 'node:module';
import path from 'node:path';
import readline from 'node:readline';
import { pathToFileURL } from 'node:url';

const [folder, product, place] = process.argv.slice(2);
const [host, port] = place.split(':');
const answer = (fields) => process.stdout.write(`${JSON.stringify(fields)}\n`);
console.log = console.error; // what a product prints is no answer

class Cannot extends Error {}

async function nodeDrivers() {
  const main = path.join(folder, 'node-drivers', 'src', 'index.js');
  const product = await import(pathToFileURL(main).href);
  const { TCP, CIP, PCCC } = product.default ?? product;
  const line = new TCP({ host, port: Number(port) });
  const plc = new PCCC(new CIP(line));

  const check = (address) => {
    if (address.startsWith('ST')) throw new Cannot('no strings');
    if (/^B/.test(address)) throw new Cannot('the type of B is unknown to it');
    if (address.includes('/')) throw new Cannot('no bits');
  };
  return {
    async read(address, count) {
      check(address);
      if (/^[TCR]\d+:\d+$/.test(address)) throw new Cannot('no single words of an element');
      const values = await plc.typedRead(address, count);
      return Array.isArray(values) ? values : [values];
    },
    async write(address, values) {
      check(address);
      if (/^[TCR]/.test(address)) throw new Cannot('2.0.2 fails by itself: BigInt and numbers');
      await plc.typedWrite(address, values.map(
        (value) => (address.startsWith('F') ? value : value & 0xFFFF)));
    },
    close: () => line.close(),
  };
}

async function nodePccc() {
  const NodePCCC = createRequire(import.meta.url)(path.join(folder, 'nodepccc'));
  const plc = new NodePCCC({ silent: true });
  await new Promise((resolve, reject) => {
    plc.initiateConnection({ host, port: Number(port) }, (error) => (
      error === undefined ? resolve() : reject(new Error(String(error)))));
  });
  const check = (address) => {
    if (/^[TCR]\d+:\d+$/.test(address)) throw new Cannot('no elements of three words');
  };
  const name = (address, count) => (count > 1 ? `${address},${count}` : address);
  return {
    read(address, count) {
      check(address);
      const item = name(address, count);
      plc.addItems(item);
      return new Promise((resolve, reject) => {
        plc.readAllItems((isBad, values) => {
          plc.removeItems(item);
          if (isBad) return reject(new Error('bad quality'));
          const value = values[item];
          if (typeof value === 'string') return resolve(value);
          return resolve([value].flat().map(Number));
        });
      });
    },
    write(address, values) {
      check(address);
      if (address.includes('.')) throw new Cannot('0.1.17 writes 6 bytes where 2 are meant');
      const list = typeof values === 'string' ? [values] : values.map(
        (value) => (/^[FL]/.test(address) ? value : (value << 16) >> 16));
      const wanted = address.includes('/') ? Boolean(list[0]) : list;
      return new Promise((resolve, reject) => {
        plc.writeItems(name(address, list.length), list.length > 1 ? wanted : [wanted].flat()[0],
          (isBad) => (isBad ? reject(new Error('bad quality')) : resolve()));
      });
    },
    close: () => plc.dropConnection(),
  };
}

const plc = await { 'node-drivers': nodeDrivers, nodepccc: nodePccc }[product]();
answer({ ready: true });
for await (const line of readline.createInterface({ input: process.stdin })) {
  const request = JSON.parse(line);
  try {
    if (request.do === 'read') {
      answer({ values: await plc.read(request.address, request.count) });
    } else {
      await plc.write(request.address, request.values);
      answer({ done: true });
    }
  } catch (error) {
    const text = error instanceof Error ? error.message : JSON.stringify(error);
    answer(error instanceof Cannot ? { cannot: text } : { error: text });
  }
}
plc.close();
setTimeout(() => process.exit(), 500);
