// The page in headless Chromium, against the real programs. Rates are not asserted: a software
// rasteriser on a busy machine draws as it can.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import http from 'node:http';
import https from 'node:https';
import net from 'node:net';
import { base, close, kPatience, launch, link, live, openPage, picture, prepare, sleep, startWeb, test, until, world } from './browser.mjs';

const { TROCAR_CRCS, TROCAR_RECORDING, TROCAR_WORK } = process.env;
const kRecordings = ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`];
prepare(['--organ', 'liver'], kRecordings);

test('an instructor joins by a link, sees a cut, marks the organ and returns it', async () => {
  const page = await openPage(link(world.server.codes.instructor, 'instructor', '<b>Ivy</b> & "Co"'));
  await live(page);
  await page.locator('header').getByText('recorded', { exact: true }).waitFor({ timeout: kPatience });
  const hand = world.server.hand('Scalpel', 'incise');
  await page.getByRole('list').getByText('Scalpel', { exact: true }).first().waitFor({ timeout: kPatience });
  // Counts of vertices say nothing: a slow picture gets fewer.
  await until('a cut', () => page.evaluate(() => window.trocar.replica.rest().some((value, i) => i % 4 === 3 && value >= 1)));
  await page.locator('.events').getByText('Scalpel cuts').first().waitFor({ timeout: kPatience });
  // A name is text, whatever it holds.
  assert.equal(await page.locator('.people b', { hasText: '<b>Ivy</b> & "Co"' }).count(), 1);
  await page.getByRole('button', { name: 'Mark organ' }).click();
  await page.getByRole('button', { name: 'Mark', exact: true }).click();
  await page.locator('.events').getByText(/marked/i).first().waitFor({ timeout: kPatience });
  await sleep(1100); // at most one a second
  await page.getByRole('button', { name: 'Return to mark' }).click();
  await page.getByRole('button', { name: 'Return', exact: true }).click();
  await page.locator('.events').getByText(/return/i).first().waitFor({ timeout: kPatience });
  const state = await page.evaluate(() => ({ wrong: window.trocar.replica.mismatches, same: window.trocar.replica.crc === window.trocar.replica.ownCrc, age: window.trocar.session.shownAgeMs }));
  assert.equal(state.wrong, 0);
  assert.ok(state.same);
  assert.ok(state.age !== null && state.age > -50, `age ${state.age}`);
  assert.deepEqual(page.faults, []);
  hand.kill();
  await close(page);
});

test('an instructor hands what one person holds to another', async () => {
  const page = await openPage(link(world.server.codes.instructor, 'instructor', 'Ivy'));
  await live(page);
  const giver = world.server.hand('Anna', 'retract'), receiver = world.server.hand('Ben', 'palpate');
  await page.locator('.events').getByText('Anna has a grasp').first().waitFor({ timeout: kPatience });
  await page.locator('.events').getByText('Ben pushes').first().waitFor({ timeout: kPatience });
  await page.getByRole('button', { name: 'Manage Anna' }).click();
  const choice = page.getByLabel('Hand over an instrument of Anna');
  const option = await until('a receiver', () => choice.locator('option', { hasText: 'Ben' }).first().getAttribute('value').catch(() => null));
  await choice.selectOption(option);
  await page.locator('.events').getByText('Ivy hands an instrument of Anna to Ben').first().waitFor({ timeout: kPatience });
  await page.locator('.events').getByText('Ben has a grasp').first().waitFor({ timeout: kPatience });
  await picture(page, 'handed-over');
  assert.deepEqual(page.faults, []);
  for (const hand of [giver, receiver]) hand.kill();
  await close(page);
});

test('an instructor points, and others see where', async () => {
  const sees = await openPage(link(world.server.codes.observer, 'observer', 'Sees'));
  await live(sees);
  const page = await openPage(link(world.server.codes.instructor, 'instructor', 'Points'));
  await live(page);
  assert.equal(await sees.getByRole('button', { name: 'Point', exact: true }).count(), 0);
  await page.getByRole('button', { name: 'Point', exact: true }).click();
  const box = await page.locator('.stage canvas').boundingBox();
  const seen = await until('a pointer', async () => {
    await page.mouse.move(box.x + box.width / 2 + Math.random() * 4, box.y + box.height / 2);
    return sees.evaluate(() => window.trocar.replica.pointers()[0]);
  });
  assert.ok(Math.hypot(...seen.position) < 0.3, seen.position.join());
  await sees.locator('.label.pointer', { hasText: 'Points points here' }).waitFor({ timeout: kPatience });
  await page.getByRole('button', { name: 'Point', exact: true }).click();
  await until('no pointer', () => sees.evaluate(() => window.trocar.replica.pointers().length === 0));
  await close(page);
  await close(sees);
});

test('who watches sees through an endoscope, and turning the view ends that', async () => {
  const page = await openPage(link(world.server.codes.observer, 'observer', 'Olga'));
  await live(page);
  const hand = world.server.hand('Camera', 'endoscope');
  await page.getByLabel('See with').waitFor({ timeout: kPatience });
  const isRound = () => page.evaluate(() => window.trocar.picture().panes[0].isEndoscope);
  assert.equal(await isRound(), false);
  await page.locator('.stage canvas').press('t');
  await until('a round picture', isRound);
  assert.equal(await page.getByLabel('See with').evaluate(el => el.selectedOptions[0].text), 'the 30° endoscope of Camera');
  await page.locator('.stage canvas').press('ArrowLeft');
  await until('own eyes', async () => !(await isRound()));
  await until('the list says so', () => page.getByLabel('See with').evaluate(el => el.selectedOptions[0].text === 'own eyes'));
  hand.kill();
  await close(page);
});

test('wrong codes, and a role that the code does not give, are refused with a reason', async () => {
  const other = '0000-0000-0000-0000', right = world.server.codes.observer;
  for (const [code, role, words] of [[other, 'observer', /not of this session/], ['nonsense', 'observer', /join code/], [right, 'instructor', /role|instructor/]]) {
    const page = await openPage(link(code, role, 'Guest'));
    await page.getByRole('alert').getByText(words).waitFor({ timeout: kPatience });
    await page.close();
  }
});

test('a watcher who tries what an instructor may is put out by the server', async () => {
  const page = await openPage(link(world.server.codes.observer, 'observer', 'Olga'));
  await live(page);
  assert.equal(await page.getByRole('button', { name: 'Mark organ' }).count(), 0);
  await page.evaluate(() => window.trocar.session.mark(2, ""));
  const why = await page.getByRole('alert').innerText({ timeout: kPatience });
  assert.match(why, /may not|instructor|mark/i);
  await page.close();
});

test('messages that are too large or of another kind end that watcher, and nobody else', async () => {
  const quiet = await openPage(link(world.server.codes.observer, 'observer', 'Quiet'));
  await live(quiet);
  for (const [name, send] of [['Large', s => s.send(new Uint8Array(100_000))], ['Odd', s => s.send(new Uint8Array([0x0a, 2, 8, 0]))], ['Text', s => s.send('{}')]]) {
    const page = await openPage(link(world.server.codes.observer, 'observer', name));
    await live(page);
    // It comes back at once, by its token: the page notes that it was out.
    await page.evaluate(() => { setInterval(() => { if (window.trocar.session.state !== 'live') window.wasOut = true; }, 5); });
    await page.evaluate(`(${send})(window.trocar.session.socket)`);
    await until(`${name} is out`, () => page.evaluate(() => window.wasOut === true).catch(() => true));
    await close(page);
  }
  assert.equal(await quiet.evaluate(() => window.trocar.session.state), 'live');
  await close(quiet);
});

test('a page whose first connection breaks before it is let in tries again', async () => {
  const page = await world.context.newPage();
  await page.addInitScript(() => {
    const Real = window.WebSocket;
    let tries = 0;
    window.WebSocket = class extends Real {
      constructor(url) { super(++tries < 3 ? url.replace(/session$/, 'nothing') : url); }
    };
  });
  await page.goto(link(world.server.codes.observer, 'observer', 'Patient'));
  await live(page);
  await close(page);
});

test('who loses the connection comes back to the same place', async () => {
  const page = await openPage(link(world.server.codes.observer, 'observer', 'Bea'));
  await live(page);
  world.web.kill('SIGKILL');
  await page.locator('.stage.old').waitFor({ timeout: kPatience });
  await page.getByRole('alert').getByText('comes back by itself').waitFor();
  await world.web.ended;
  world.web = await startWeb(world.web.port, kRecordings);
  await until('back', () => page.evaluate(() => window.trocar.session.state === 'live'));
  const frames = await page.evaluate(() => window.trocar.replica.frames);
  await until('new frames', () => page.evaluate(n => window.trocar.replica.frames > n + 5, frames));
  await until('a new picture', async () => await page.locator('.stage.old').count() === 0);
  assert.equal(await page.locator('.people b', { hasText: 'Bea' }).count(), 1);
  await close(page);
});

// One request as no page would make it; the status, or null if the server closed.
function ask(path, headers = {}, from = base()) {
  const to = new URL(from);
  return new Promise(resolve => {
    const request = (to.protocol === 'https:' ? https : http).request({ host: to.hostname, port: to.port, path, headers, rejectUnauthorized: false }, answer => {
      let text = '';
      answer.on('data', data => { text += data; });
      answer.on('end', () => resolve({ status: answer.statusCode, headers: answer.headers, text }));
    });
    request.on('upgrade', answer => { request.destroy(); resolve({ status: answer.statusCode, headers: answer.headers, text: '' }); });
    request.on('error', () => resolve(null));
    request.on('close', () => resolve(null)); // also in the middle of an answer
    request.setTimeout(15_000, () => request.destroy());
    request.end();
  });
}
const kUpgrade = { Connection: 'Upgrade', Upgrade: 'websocket', 'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ==' };

test('pages of other sites, odd paths and requests without a key get nothing', async () => {
  const host = `127.0.0.1:${world.web.port}`, own = `http://${host}`;
  assert.equal((await ask('/session', { ...kUpgrade, Origin: own })).status, 101);
  for (const origin of [undefined, 'null', 'http://evil.example', `https://${host}`, `${own}.evil.example`, `http://evil.example:${world.web.port}`])
    assert.equal((await ask('/session', { ...kUpgrade, ...(origin ? { Origin: origin } : {}) })).status, 403, String(origin));
  const page = await ask('/');
  assert.equal(page.status, 200);
  assert.match(page.headers['content-security-policy'], /default-src 'none'/);
  assert.doesNotMatch(page.headers['content-security-policy'], /unsafe-inline/);
  assert.equal(page.headers['x-content-type-options'], 'nosniff');
  assert.equal((await ask('/main.js', { 'Accept-Encoding': 'gzip' })).headers['content-encoding'], 'gzip');
  for (const path of ['/../index.html', '/%2e%2e/index.html', '/index.html%00', '//etc/passwd', '/recordings.key', '/web-recordings.key', '/session/'])
    assert.equal((await ask(path)).status, 404, path);
  const key = world.web.text.match(/#recordings=(\w+)/)[1], bearer = { Authorization: `Bearer ${key}` };
  assert.equal((await ask('/recordings')).status, 403);
  assert.equal((await ask('/recordings', { Authorization: 'Bearer 00' })).status, 403);
  assert.equal((await ask('/recordings', bearer)).status, 200);
  for (const name of ['../lesson.mcap', '..%2flesson.mcap', '%2e%2e/state/web.key', 'lesson.mcap/', '.mcap', '', 'none.mcap'])
    assert.equal((await ask(`/recordings/${name}`, bearer)).status, 404, name);
  const part = await ask('/recordings/lesson.mcap', { ...bearer, Range: 'bytes=1-4' });
  assert.equal(part.status, 206);
  assert.equal(part.text, 'MCAP');
  assert.equal((await ask('/recordings/lesson.mcap', { ...bearer, Range: 'bytes=999999999999-' })).status, 416);
  assert.equal(await ask('/', { 'X-Long': 'x'.repeat(10_000) }).then(a => a?.status ?? null), null);
  assert.equal((await ask('/session', { ...kUpgrade, Origin: own })).status, 101);
});

// A text frame of a client, masked with zeros.
const frameOf = text => Buffer.concat([Buffer.from([0x81, 0xfe, text.length >> 8, text.length & 255, 0, 0, 0, 0]), Buffer.from(text)]);
const memoryKb = child => Number(fs.readFileSync(`/proc/${child.pid}/status`, 'utf8').match(/VmRSS:\s+(\d+)/)[1]);

test('a browser that does not read holds up nobody, and nothing piles up for it', async () => {
  const reads = await openPage(link(world.server.codes.observer, 'observer', 'Reads'));
  await live(reads);
  const before = memoryKb(world.web), stalled = [];
  for (let i = 0; i < 4; i++) {
    const socket = net.connect(world.web.port, '127.0.0.1');
    socket.on('error', () => undefined);
    socket.write(`GET /session HTTP/1.1\r\nHost: 127.0.0.1:${world.web.port}\r\nOrigin: http://127.0.0.1:${world.web.port}\r\n${Object.entries(kUpgrade).map(([k, v]) => `${k}: ${v}\r\n`).join('')}\r\n`);
    await new Promise((resolve, reject) => socket.once('data', resolve).once('close', () => reject(new Error('trocar-web has closed'))));
    socket.pause();
    socket.write(frameOf(JSON.stringify({ code: world.server.codes.observer, name: `Stalled ${i}`, role: 'observer', more: 'x'.repeat(100) })));
    stalled.push(socket);
  }
  const frames = await reads.evaluate(() => window.trocar.replica.frames);
  await sleep(6000);
  assert.ok(await reads.evaluate(n => window.trocar.replica.frames > n + 10, frames));
  assert.ok(memoryKb(world.web) < before + 30_000, `${before} kB, then ${memoryKb(world.web)} kB`);
  for (const socket of stalled) socket.destroy();
  await close(reads);
});

test('guesses of codes from one address have to wait', async () => {
  const page = await openPage(base());
  const text = await page.evaluate(async () => {
    let last = '';
    for (let i = 0; i < 8; i++) {
      const socket = new WebSocket(`ws://${location.host}/session`);
      socket.binaryType = 'arraybuffer';
      last = await new Promise(resolve => {
        socket.onopen = () => socket.send(JSON.stringify({ code: 'nonsense', name: 'Guess', role: 'observer' }));
        socket.onmessage = event => resolve(new TextDecoder().decode(event.data));
        socket.onclose = () => resolve('closed');
      });
    }
    return last;
  });
  assert.match(text, /too many wrong codes/);
  await page.close();
});

test('a recording opens by its link, and 20 random times show what the native replay shows', async () => {
  const key = world.web.text.match(/#recordings=(\w+)/)[1];
  const crcs = new Map(fs.readFileSync(TROCAR_CRCS, 'utf8').trim().split('\n').map(line => { const [frame, , crc] = line.split(' '); return [frame, crc]; }));
  const list = await openPage(`${base()}#recordings=${key}`);
  await list.getByRole('button', { name: /lesson\.mcap/ }).click();
  await live(list);
  await list.close();
  const page = await openPage(`${base()}#recordings=${key}&file=lesson.mcap&t=4`);
  await live(page);
  assert.equal(await page.getByRole('slider', { name: 'Time' }).getAttribute('aria-valuetext'), '0:04.0');
  const seen = await page.evaluate(async () => {
    const { player, recording, replica } = window.trocar, out = [];
    let seed = 7;
    for (let i = 0; i < 20; i++) {
      seed = (seed * 16807) % 2147483647;
      await player.seek(recording.firstTick + (seed / 2147483647) * (recording.lastTick - recording.firstTick));
      out.push({ frame: String(replica.newestFrame), crc: replica.ownCrc.toString(16).padStart(8, '0'), ms: player.seekMs });
    }
    return out;
  });
  for (const { frame, crc } of seen) assert.equal(crc, crcs.get(frame), `frame ${frame}`);
  const times = seen.map(s => s.ms).sort((a, b) => a - b);
  console.log(`seeks: median ${times[10].toFixed(0)} ms, longest ${times[19].toFixed(0)} ms`);
  await page.locator('.events').getByText(/incise cuts/).first().click();
  await until('the event is shown', () => page.evaluate(() => !window.trocar.player.isSeeking && window.trocar.player.tick > 0));
  await page.getByRole('button', { name: 'Play' }).click();
  const tick = await page.evaluate(() => window.trocar.player.tick);
  await until('it plays', () => page.evaluate(t => window.trocar.player.tick > t + 200, tick));
  assert.equal(await page.evaluate(() => window.trocar.replica.mismatches), 0);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('a damaged file gives one clear sentence', async () => {
  const whole = fs.readFileSync(TROCAR_RECORDING), page = await openPage(base());
  const flipped = Buffer.from(whole);
  for (let i = 0; i < 64; i++) flipped[flipped.length - 4000 + i] ^= 0x5a;
  for (const [name, bytes] of [['half.mcap', whole.subarray(0, whole.length >> 1)], ['text.mcap', Buffer.from('hello')], ['empty.mcap', Buffer.alloc(0)], ['flipped.mcap', flipped]]) {
    await page.locator('input[type=file]').setInputFiles({ name, mimeType: 'application/octet-stream', buffer: Buffer.from(bytes) });
    const said = page.getByRole('alert');
    await said.waitFor({ timeout: kPatience });
    assert.match(await said.innerText(), /damaged|cut short/, name);
    await page.reload();
  }
  await page.locator('input[type=file]').setInputFiles({ name: 'whole.mcap', mimeType: 'application/octet-stream', buffer: whole });
  await live(page);
  await page.close();
});

test('a damaged place in a recording is said, and a seek to a good place shows it', async () => {
  const bytes = fs.readFileSync(TROCAR_RECORDING), middle = bytes.length >> 1, page = await openPage(base());
  for (let i = 0; i < 64; i++) bytes[middle + i] ^= 0x5a;
  await page.locator('input[type=file]').setInputFiles({ name: 'middle.mcap', mimeType: 'application/octet-stream', buffer: bytes });
  await live(page);
  const faults = await page.evaluate(async () => {
    const { player, recording } = window.trocar, said = [];
    for (let tick = recording.firstTick; tick < recording.lastTick; tick += 200) {
      await player.seek(tick);
      said.push(player.fault);
    }
    await player.seek(recording.firstTick);
    return { said, after: player.fault };
  });
  assert.ok(faults.said.some(fault => /damaged/.test(fault)), faults.said.join());
  assert.equal(faults.after, '');
  await page.close();
});

test('over TLS; a code that is revoked puts its watcher out; at the end all surfaces are equal', async () => {
  const secure = await startWeb(0), url = `https://127.0.0.1:${secure.port}/`;
  assert.match((await ask('/', {}, url)).headers['strict-transport-security'], /max-age/);
  const trusting = await world.browser.newContext({ ignoreHTTPSErrors: true, viewport: { width: 900, height: 600 } });
  const page = await trusting.newPage(), stays = await trusting.newPage();
  await page.goto(`${url}#${new URLSearchParams({ join: world.server.codes.observer, role: 'observer', name: 'Out' })}`);
  await stays.goto(`${url}#${new URLSearchParams({ join: world.server.codes.instructor, role: 'instructor', name: 'Stays' })}`);
  await live(page);
  await live(stays);
  const revoking = launch('trocar-server', ['--listen', `127.0.0.1:${world.server.port}`, '--revoke', 'observer', '--put-out']);
  assert.equal(await revoking.ended, 0, revoking.text);
  await page.getByRole('alert').waitFor({ timeout: kPatience });
  await page.reload();
  assert.match(await page.getByRole('alert').innerText({ timeout: kPatience }), /revoked/);
  await stays.evaluate(() => { const ended = setInterval(() => { if (window.trocar.barrier()) { window.atEnd = window.trocar.barrier(); clearInterval(ended); } }, 5); });
  world.server.kill('SIGTERM');
  await stays.getByRole('alert').waitFor({ timeout: kPatience });
  assert.equal(await stays.evaluate(() => window.atEnd ?? window.trocar.barrier()), 'same');
  assert.equal(await world.server.ended, 0, world.server.text);
  const summary = JSON.parse(fs.readFileSync(`${TROCAR_WORK}/lesson.json`, 'utf8'));
  assert.equal(summary.all_replicas_equal, true);
  await trusting.close();
});
