// Attacks by hand on the page's program, with sockets that do as they like beside people who watch: each
// ends for its sender, and for nobody else.
import assert from 'node:assert/strict';
import net from 'node:net';
import { launch, prepare, startWeb, test, until, world } from './browser.mjs';
import { envelope, grows, join, kFrame, kGuestMessage, Watcher } from './sockets.mjs';

prepare(['--organ', 'liver', '--return-seconds', '20'], ['--insecure-loopback', '--metrics', '127.0.0.1:0']);

async function metric(name) {
  const port = world.web.text.match(/figures at 127.0.0.1:(\d+)/)[1], text = await (await fetch(`http://127.0.0.1:${port}/metrics`)).text();
  return Number(text.match(new RegExp(`trocar_web_${name} (\\d+)`))[1]);
}

test('many who watch share one connection, and who comes late sees all at once', async () => {
  const hand = world.server.hand('Pat', 'palpate'), first = await join('First');
  await grows(first);
  const others = await Promise.all(Array.from({ length: 12 }, (_, i) => join(`Other ${i}`)));
  for (const other of others) await until('a frame', () => other.frames > 0);
  assert.equal(await metric('carriers'), 1);
  assert.equal(await metric('watchers'), 13);
  for (const one of [first, ...others]) one.close();
  await until('nobody is left', async () => await metric('carriers') === 0);
  const again = await join('Again');
  await grows(again);
  again.close();
  hand.kill();
});

test('a flood of messages, and messages of a server, a hand or a carrier, end their sender alone', async () => {
  const quiet = await join('Quiet'), ping = envelope(5, 8, 1);
  for (const [name, attack] of [
    ['Flood', w => { for (let i = 0; i < 6000; i++) w.send(ping); }],
    ['Guests', w => w.send(envelope(kGuestMessage, 8, 1))],
    ['Frames', w => w.send(envelope(kFrame, 8, 1))],
    ['Early', w => w.send(envelope(4, 8, 0xff, 0xff, 0x7f))],
    ['Twice', w => w.send(envelope(16, 8, 1))],
    ['Noise', w => w.send(new Uint8Array([0xff, 0xff, 0xff, 0xff, 0x0f, 1, 2, 3]))],
    ['Large', w => w.send(new Uint8Array(100_000))],
  ]) {
    const attacker = await join(name);
    attack(attacker);
    await until(`${name} is out`, () => attacker.isClosed);
  }
  await grows(quiet);
  quiet.close();
});

test('names that cannot be shown are refused by the session', async () => {
  for (const name of ['\u001b[31mred', 'a\u202eb', '', ' x', 'x'.repeat(33), 'line\nbreak']) {
    const somebody = await join(name);
    assert.ok(somebody.goodbye !== '' && !somebody.isWelcome, JSON.stringify(name));
  }
  const first = await join('Same'), second = await join('Same');
  assert.match(second.goodbye, /here|taken|name/i);
  await grows(first);
  first.close();
});

test('a hundred who open and say nothing are out in seconds, and keep nobody out', async () => {
  const silent = Array.from({ length: 100 }, () => new Watcher(null));
  await until('they are open', () => silent.every(w => w.isOpen));
  const honest = await join('Honest');
  await grows(honest);
  await until('they are out', () => silent.every(w => w.isClosed), 15_000);
  honest.close();
});

test('who does not read holds up nobody on the same connection', async () => {
  const reads = await join('Reads'), hand = world.server.hand('Sue', 'palpate'), stalled = [];
  for (let i = 0; i < 6; i++) {
    const socket = net.connect(world.web.port, '127.0.0.1');
    socket.on('error', () => undefined);
    socket.write(`GET /session HTTP/1.1\r\nHost: 127.0.0.1:${world.web.port}\r\nOrigin: http://127.0.0.1:${world.web.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n`);
    await new Promise((resolve, reject) => socket.once('data', resolve).once('close', () => reject(new Error('closed'))));
    socket.pause();
    const text = JSON.stringify({ code: world.server.codes.observer, name: `Stalled ${i}`, role: 'observer', more: 'x'.repeat(100) });
    socket.write(Buffer.concat([Buffer.from([0x81, 0xfe, text.length >> 8, text.length & 255, 0, 0, 0, 0]), Buffer.from(text)]));
    stalled.push(socket);
  }
  await until('they watch', async () => await metric('watchers') === 7);
  await grows(reads, 100);
  assert.equal(await metric('carriers'), 1);
  for (const socket of stalled) socket.destroy();
  reads.close();
  hand.kill();
});

test('a stolen link ends with its code, at once and for good; the others on the connection stay', async () => {
  const making = launch('trocar-server', ['--listen', `127.0.0.1:${world.server.port}`, '--new-code', 'observer']);
  assert.equal(await making.ended, 0, making.text);
  const code = making.text.match(/\b(\w{4}-\w{4}-\w{4}-\w{4})\b/)[1];
  const stays = await join('Stays');
  let thief = null;
  await until('the code is known', async () => {
    thief = await join('Thief', code);
    return thief.isWelcome;
  });
  await grows(thief);
  const revoking = launch('trocar-server', ['--listen', `127.0.0.1:${world.server.port}`, '--revoke', code, '--put-out']);
  assert.equal(await revoking.ended, 0, revoking.text);
  await until('the thief is out', () => thief.isClosed, 5000);
  assert.match(thief.goodbye, /revoked/);
  const again = await join('Thief', code);
  assert.match(again.goodbye, /revoked/);
  await grows(stays);
  assert.equal(await metric('carriers'), 1);
  stays.close();
});

test('guessed codes: another server never hears of its codes, and after five the address waits', async () => {
  const web = await startWeb(0, ['--insecure-loopback']), right = world.server.codes.observer;
  const other = right[0] === '2' ? `3${right.slice(1)}` : `2${right.slice(1)}`; // of another certificate
  const guess = await join('Guess', other, web);
  assert.match(guess.goodbye, /not of this session/);
  for (let i = 0; i < 4; i++) await join(`Guess ${i}`, `${right.slice(0, -1)}${right.endsWith('7') ? '8' : '7'}`, web);
  const last = await join('Guess', right, web);
  assert.match(last.goodbye, /too many wrong codes/);
  web.kill();
});
