// The module decodes what the native replica does: every frame of a recording with a cut.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import { test } from 'node:test';

const need = createRequire(`${process.env.TROCAR_MODULES}/`);
const { McapIndexedReader } = need('@mcap/core');
const { decompress } = need('fzstd');
const kFields = { '/topology': 18, '/topology/change': 8, '/surface/key': 2, '/surface/delta': 2 };

async function loadModule() {
  const wasi = new Proxy({}, { get: (_, name) => () => { if (name === 'proc_exit') throw new Error('the module ended'); return 52; } });
  const bytes = fs.readFileSync(`${process.env.TROCAR_BUILD}/web/replica_module.wasm`);
  const { instance } = await WebAssembly.instantiate(bytes, { wasi_snapshot_preview1: wasi });
  instance.exports._initialize();
  instance.exports.restart();
  return instance.exports;
}

function put(module, bytes) {
  const at = module.input(bytes.length);
  new Uint8Array(module.memory.buffer, at, bytes.length).set(bytes);
}

function textAt(module, at) {
  const memory = Buffer.from(module.memory.buffer);
  return memory.toString('utf8', at, memory.indexOf(0, at));
}

test('each frame of a recording has the CRC of the native replica', async () => {
  const file = fs.readFileSync(process.env.TROCAR_RECORDING);
  const readable = { size: async () => BigInt(file.length), read: async (at, size) => file.subarray(Number(at), Number(at + size)) };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: (b, size) => decompress(b, new Uint8Array(Number(size))) } });
  const native = fs.readFileSync(process.env.TROCAR_CRCS, 'utf8').trim().split('\n').map(line => line.split(' '));
  const module = await loadModule();
  const own = [];
  let hasKey = false, last = -1, changes = 0, ms = 0;
  for await (const m of reader.readMessages({ topics: Object.keys(kFields) })) {
    const topic = reader.channelsById.get(m.channelId).topic, isKey = topic === '/surface/key';
    if (hasKey && (isKey || topic === '/topology')) continue;
    hasKey ||= isKey;
    changes += topic === '/topology/change' ? 1 : 0;
    put(module, m.data);
    const begin = process.hrtime.bigint();
    assert.equal(module.receive_bare(kFields[topic], m.data.length, 0), 1, topic);
    ms += Number(process.hrtime.bigint() - begin) / 1e6;
    const frame = module.newest_frame();
    if (frame < 0 || frame === last) continue;
    last = frame;
    own.push([String(frame), String(module.newest_tick()), (module.own_crc() >>> 0).toString(16).padStart(8, '0')]);
  }
  assert.deepEqual(own, native);
  assert.equal(module.mismatches(), 0);
  assert.ok(changes > 0, 'nothing was cut');
  console.log(`${own.length} frames, ${changes} changes of the surface, ${(ms * 1000 / own.length).toFixed(1)} us for each`);
});

test('what is no message is refused, and the module goes on', async () => {
  const module = await loadModule();
  for (const bytes of [Buffer.alloc(0), Buffer.from([0xff, 0xff, 0xff]), Buffer.from('<html>'), Buffer.alloc(70_000, 0x12)]) {
    put(module, bytes);
    assert.equal(module.receive(bytes.length, 0), 0);
    assert.match(textAt(module, module.error()), /\w/);
  }
  assert.equal(module.input(17 * 1024 * 1024), 0);
  module.restart();
  assert.equal(module.update(10, 1000, 1), 0);
});
