// The page in Firefox, spoken to by WebDriver BiDi: the same picture, the same CRC, the same
// buttons as in Chromium, and a recording.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import { after, before, test } from 'node:test';
import { base, endAll, kPatience, link, startPrograms, until, world } from './browser.mjs';

const { TROCAR_CRCS, TROCAR_FIREFOX, TROCAR_WORK, TROCAR_PICTURES } = process.env;
const kLimit = { timeout: 150_000 };
let firefox;

// https://www.w3.org/TR/webdriver-bidi, as much of it as is needed here.
class Firefox {
  faults = [];
  #answers = new Map();
  #id = 0;
  static async launch() {
    const one = new Firefox(), profile = `${TROCAR_WORK}/profile`;
    fs.mkdirSync(profile);
    // It has WebGL in a window alone, and refuses it to a rasteriser unless told otherwise.
    fs.writeFileSync(`${profile}/user.js`, 'user_pref("webgl.force-enabled", true);\n');
    one.process = spawn(TROCAR_FIREFOX, ['--no-remote', '--profile', profile, '--remote-debugging-port', '0'],
      { stdio: ['ignore', 'ignore', 'pipe'], env: { ...process.env, HOME: profile } });
    let text = '';
    one.process.stderr.on('data', data => { text += data; });
    const [, address] = await until('Firefox', () => /WebDriver BiDi listening on (ws:\S+)/.exec(text));
    one.socket = new WebSocket(`${address}/session`);
    one.socket.onmessage = event => one.#take(JSON.parse(event.data));
    await new Promise((resolve, reject) => { one.socket.onopen = resolve; one.socket.onerror = reject; });
    await one.send('session.new', { capabilities: {} });
    await one.send('session.subscribe', { events: ['log.entryAdded'] });
    one.context = (await one.send('browsingContext.getTree', {})).contexts[0].context;
    await one.send('browsingContext.setViewport', { context: one.context, viewport: { width: 1280, height: 720 } });
    return one;
  }
  #take(message) {
    if (message.method === 'log.entryAdded' && message.params.level === 'error') this.faults.push(message.params.text);
    this.#answers.get(message.id)?.(message);
    this.#answers.delete(message.id);
  }
  async send(method, params) {
    const id = ++this.#id, answer = new Promise(resolve => this.#answers.set(id, resolve));
    this.socket.send(JSON.stringify({ id, method, params }));
    const message = await answer;
    if (message.type === 'error') throw new Error(`${method}: ${message.message}`);
    return message.result;
  }
  open(url) { return this.send('browsingContext.navigate', { context: this.context, url, wait: 'complete' }); }
  // Of plain data: it comes as JSON.
  async evaluate(expression) {
    const { type, result, exceptionDetails } = await this.send('script.evaluate', { expression: `(async () => JSON.stringify(await (${expression})))()`, awaitPromise: true,
      target: { context: this.context } });
    if (type !== 'success') throw new Error(exceptionDetails.text);
    return result.type === 'string' ? JSON.parse(result.value) : undefined;
  }
  press(name) { return until(name, () => this.evaluate(`(b => (b?.click(), !!b))([...document.querySelectorAll('button')].find(b => b.textContent === ${JSON.stringify(name)}))`)); }
  says(text) { return until(text, () => this.evaluate(`document.body.innerText.includes(${JSON.stringify(text)})`)); }
  live() { return until('a picture', () => this.evaluate('document.querySelector("canvas[data-drawn]") !== null')); }
  async picture(name) {
    if (!TROCAR_PICTURES) return;
    const { data } = await this.send('browsingContext.captureScreenshot', { context: this.context });
    fs.writeFileSync(`${TROCAR_PICTURES}/firefox-${name}.png`, Buffer.from(data, 'base64'));
  }
}

before(async () => {
  await startPrograms(['--organ', 'liver'], ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`]);
  // The machine may have a Firefox that does not start, or without WebGL: that says nothing about the page.
  const why = await Firefox.launch().then(async one => {
    firefox = one;
    return await one.evaluate('document.createElement("canvas").getContext("webgl2") !== null') ? '' : 'Firefox has no WebGL 2 here';
  }, error => error.message);
  if (why !== '') {
    console.log(`SKIPPED: ${why}`);
    process.exit(77);
  }
}, { timeout: 120_000 });
after(async () => {
  firefox?.process.kill('SIGKILL');
  await endAll(null);
}, { timeout: 30_000 });
process.on('exit', () => firefox?.process.kill('SIGKILL'));

test('an instructor joins by a link, sees a cut, marks the organ and leaves', kLimit, async () => {
  await firefox.open(link(world.server.codes.instructor, 'instructor', 'Ivy'));
  await firefox.live();
  const hand = world.server.hand('Scalpel', 'incise');
  await until('a cut', () => firefox.evaluate('window.trocar.replica.rest().some((value, i) => i % 4 === 3 && value >= 1)'));
  await firefox.says('Scalpel cuts');
  await until('the barrier', () => firefox.evaluate('window.trocar.replica.crc === window.trocar.replica.ownCrc'));
  assert.equal(await firefox.evaluate('window.trocar.replica.mismatches'), 0);
  await firefox.press('Mark organ');
  await firefox.press('Mark');
  await firefox.says('the instructor has marked the organ as it is');
  await firefox.picture('watch');
  hand.kill();
  await firefox.press('Leave');
  await firefox.says('You have left the session.');
  assert.deepEqual(firefox.faults, []);
});

test('a surgeon presses the organ by pointer and key', kLimit, async () => {
  await firefox.open('about:blank');
  await firefox.open(link(world.server.codes.surgeon, 'surgeon', 'Sue'));
  await firefox.live();
  await until('a place in the session', () => firefox.evaluate('window.trocar.hands()?.own != null'));
  const [x, y] = await firefox.evaluate('(r => [Math.round(r.x + r.width / 2), Math.round(r.y + r.height * 0.45)])(document.querySelector(".stage canvas").getBoundingClientRect())');
  const act = (...actions) => firefox.send('input.performActions', { context: firefox.context, actions });
  const pointer = (...steps) => ({ type: 'pointer', id: 'mouse', actions: steps.map(([px, py]) => ({ type: 'pointerMove', x: px, y: py, duration: 50 })) });
  const tool = '(h => window.trocar.replica.tools().find(t => t.slot === 2 * h.own))(window.trocar.hands())';
  await act(pointer([x - 30, y], [x, y]));
  await until('a tool over the organ', () => firefox.evaluate(`${tool} !== undefined`));
  await act({ type: 'key', id: 'keys', actions: [{ type: 'keyDown', value: 'f' }] });
  await until('a force', () => firefox.evaluate(`(t => t.contactNodes > 0 && Math.hypot(...t.forceN) > 0.02)(${tool})`));
  await firefox.picture('hand');
  await firefox.send('input.releaseActions', { context: firefox.context });
  await firefox.press('Leave');
  await firefox.says('You have left the session.');
  assert.deepEqual(firefox.faults, []);
});

test('a recording is opened by its link, and each place in it has the CRC of the native replay', kLimit, async () => {
  const key = world.web.text.match(/#recordings=(\w+)/)[1];
  const crcs = new Map(fs.readFileSync(TROCAR_CRCS, 'utf8').trim().split('\n').map(line => { const [frame, , crc] = line.split(' '); return [frame, crc]; }));
  await firefox.open('about:blank'); // another fragment alone is no other page
  await firefox.open(`${base()}#recordings=${key}&file=lesson.mcap`);
  await firefox.live();
  for (const share of [0.9, 0.2, 0.6, 0.4, 0.8]) {
    const { frame, crc } = await firefox.evaluate(`window.trocar.player.seek(window.trocar.recording.lastTick * ${share}).then(() => (r => ({ frame: r.newestFrame, crc: r.ownCrc }))(window.trocar.replica))`);
    assert.equal(crc.toString(16).padStart(8, '0'), crcs.get(String(frame)), `frame ${frame}`);
  }
  await firefox.press('Play');
  const from = await firefox.evaluate('window.trocar.player.tick');
  await until('it plays', async () => await firefox.evaluate('window.trocar.player.tick') !== from);
  await firefox.picture('debrief');
  assert.deepEqual(firefox.faults, []);
});
