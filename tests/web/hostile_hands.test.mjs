// Attacks of who holds instruments by the page's socket, beside people who play by the rules: each ends for
// its sender, or does nothing, and the others go on.
import assert from 'node:assert/strict';
import net from 'node:net';
import { prepare, sleep, test, until, world } from './browser.mjs';
import { envelope, grows, join, kGuestMessage, Watcher } from './sockets.mjs';

prepare(['--organ', 'liver', '--return-seconds', '20'], ['--insecure-loopback']);

const float = value => { const bytes = Buffer.alloc(4); bytes.writeFloatLE(value); return bytes; };
const floats = (...values) => values.flatMap((value, i) => [(i + 1) << 3 | 5, ...float(value)]);
const part = (field, body) => [field << 3 | 2, body.length, ...body];
// A ToolSample: which tool, where (m), how it is turned, what it does.
const sample = ({ tool = 0, at = [0.4, 0.2, 0.2], turn = [0, 0, 0, 1], verb = 0, number = 1 } = {}) =>
  envelope(1, 8, tool, 16, ...varint(number), ...part(3, floats(...at)), ...part(4, floats(...turn)), 40, verb);
const varint = value => value < 128 ? [value] : [value % 128 | 128, ...varint(Math.floor(value / 128))];
// A ToolChange to a shape of these lengths: radius, length, reach, half width, friction, grip, edge.
const change = (...lengths) => envelope(43, 8, 0, ...part(2, floats(...lengths)));
const hold = (name, more = {}) => new Watcher({ name, code: world.server.codes.surgeon, role: 'surgeon', tools: ['grasper', 'scalpel'], ...more }).joined();
// Somebody who plays by the rules beside all of it.
async function honest(name) {
  const watcher = await hold(name);
  let number = 0;
  watcher.timer = setInterval(() => watcher.send(sample({ number: ++number })), 30).unref();
  return watcher;
}
const leave = watcher => { clearInterval(watcher.timer); watcher.socket.close(1000); };

test('one who holds instruments and breaks a rule of theirs is out, and the others go on', async () => {
  const good = await honest('Good');
  for (const [name, attack] of [
    ['Flood of hands', w => { for (let i = 0; i < 6000; i++) w.send(sample({ number: i + 1 })); }],
    ['Kilobytes', w => { for (let i = 0; i < 40; i++) w.send(new Uint8Array([0x2a, ...varint(60_000), 0x7a, ...varint(59_996), ...new Uint8Array(59_996)])); }],
    ['No number', w => w.send(sample({ at: [NaN, 0, 0] }))],
    ['Far away', w => w.send(sample({ at: [3, 0, 0] }))],
    ['Not turned', w => w.send(sample({ turn: [0, 0, 0, 2] }))],
    ['Third tool', w => w.send(sample({ tool: 2 }))],
    ['New verb', w => w.send(sample({ verb: 99 }))],
    ['Needle', w => w.send(change(NaN, 0.3, 0.01))],
    ['Hello again', w => w.send(envelope(16, 8, 1))],
    ['As a server', w => w.send(envelope(17, 8, 1))],
    ['As a carrier', w => w.send(envelope(kGuestMessage, 8, 1))],
    ['Large', w => w.send(new Uint8Array(100_000))],
    ['Noise', w => w.send(new Uint8Array([0xff, 0xff, 0xff, 0xff, 0x0f, 1, 2, 3]))],
  ]) {
    const attacker = await hold(name);
    assert.ok(attacker.isWelcome, `${name}: ${attacker.goodbye}`);
    attack(attacker);
    await until(`${name} is out`, () => attacker.isClosed || attacker.goodbye !== '');
    attacker.close();
  }
  await grows(good);
  leave(good);
});

test('a surgeon does not do what an instructor does', async () => {
  const surgeon = await honest('Sue'), watcher = await join('Olga');
  // Ends the session, pauses, closes the door, puts out, marks, returns, points, goes to the next stage, takes a
  // blade of 190 mm.
  for (const request of [envelope(37, 8, 9), envelope(37, 8, 15), envelope(37, 8, 7), envelope(37, 8, 4, ...part(3, [...Buffer.from('Olga')]), ...part(4, [...Buffer.from('out')])),
    envelope(24, 8, 1), envelope(24, 8, 2), envelope(35, ...part(1, floats(0, 0, 0))), envelope(61, 8, 1),
    change(0.005, 0.3, 0.01, 0, 0.2, 0, 0.19)]) {
    const rebel = await hold('Rebel');
    assert.ok(rebel.isWelcome, rebel.goodbye);
    rebel.send(request);
    await sleep(300);
    leave(rebel);
    await sleep(100);
  }
  await grows(watcher);
  await grows(surgeon);
  assert.ok(!watcher.isClosed && !surgeon.isClosed);
  watcher.close();
  leave(surgeon);
});

test('a token of somebody else, of somebody who is there, or of one who has left opens nothing', async () => {
  const ann = await honest('Ann'), ben = await honest('Ben');
  assert.match(ann.token, /^[0-9a-f]{32}$/);
  const wrong = ann.token.slice(0, -1) + (ann.token.endsWith('0') ? '1' : '0');
  for (const [what, name, token] of [['a changed one', 'Ann', wrong], ['of another', 'Ann', ben.token]]) {
    const thief = await hold(name, { token });
    assert.ok(!thief.isWelcome, what);
    thief.close();
  }
  await grows(ann);
  leave(ann);
  await until('Ann has left', () => ann.isClosed);
  await sleep(500);
  // It is a new participant, who needs a code: with a watcher's there is none with hands.
  const late = await hold('Ann', { token: ann.token, code: world.server.codes.observer });
  assert.ok(!late.isWelcome && late.goodbye !== '');
  await grows(ben);
  leave(ben);
});

test('who holds instruments and is silent, or does not read, holds up nobody', async () => {
  const good = await honest('Steady'), silent = await hold('Silent');
  silent.send(sample({ verb: 2 }));
  const stalled = net.connect(world.web.port, '127.0.0.1');
  stalled.on('error', () => undefined);
  stalled.write(`GET /session HTTP/1.1\r\nHost: 127.0.0.1:${world.web.port}\r\nOrigin: http://127.0.0.1:${world.web.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n`);
  await new Promise((resolve, reject) => stalled.once('data', resolve).once('close', () => reject(new Error('closed'))));
  stalled.pause();
  const text = JSON.stringify({ code: world.server.codes.surgeon, name: 'Stalled', role: 'surgeon', tools: ['grasper'], more: 'x'.repeat(100) });
  stalled.write(Buffer.concat([Buffer.from([0x81, 0xfe, text.length >> 8, text.length & 255, 0, 0, 0, 0]), Buffer.from(text)]));
  await grows(good, 250);
  stalled.destroy();
  silent.close();
  leave(good);
});

test('who joins is what the code says, with instruments of the table alone', async () => {
  for (const [what, more] of [
    ['an observer\'s code', { code: world.server.codes.observer }],
    ['an assistant\'s code', { code: world.server.codes.assistant }],
    ['a surgeon who would lead', { role: 'instructor', tools: [] }],
    ['a role that is none', { role: 'king' }],
    ['three tools', { tools: ['grasper', 'grasper', 'grasper'] }],
    ['a tool that is none', { tools: ['chainsaw'] }],
    ['tools that are no list', { tools: 'grasper' }],
    ['tools of an observer', { role: 'observer', code: world.server.codes.observer }],
    ['a token that is none', { token: 'ff' }],
  ]) {
    const somebody = await hold('Mallory', more);
    assert.ok(!somebody.isWelcome && somebody.goodbye !== '', what);
    assert.doesNotMatch(somebody.goodbye, /too many/, what);
    somebody.close();
  }
});
