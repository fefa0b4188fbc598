// Measures the page: node --experimental-websocket figures.mjs, with the variables of run_web.sh. Writes
// figures.json and figures.md into TROCAR_WORK. Takes five minutes; deploy/campaign page runs it.
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import zlib from 'node:zlib';

const { TROCAR_MODULES, TROCAR_BUILD, TROCAR_ROOT, TROCAR_WORK, TROCAR_CHROMIUM, TROCAR_RECORDING } = process.env;
const { chromium } = createRequire(`${TROCAR_MODULES}/`)('playwright-core');
const kSeconds = Number(process.env.TROCAR_SECONDS ?? 15);
const sleep = ms => new Promise(resolve => setTimeout(resolve, ms));
const children = new Set(), result = {};
const quantile = (values, share) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(values.length * share))];

function launch(name, args) {
  const child = spawn(`${TROCAR_BUILD}/bin/${name}`, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  child.text = '';
  for (const stream of [child.stdout, child.stderr]) stream.on('data', data => { child.text += data; });
  child.on('exit', () => { child.hasEnded = true; children.delete(child); });
  children.add(child);
  return child;
}
async function started(name, args) {
  const file = `${TROCAR_WORK}/${name}-${children.size}.port`;
  fs.rmSync(file, { force: true });
  const child = launch(name, [...args, '--ready-file', file]);
  while (!fs.existsSync(file)) { if (child.hasEnded) throw new Error(child.text); await sleep(50); }
  child.port = Number(fs.readFileSync(file, 'utf8'));
  await sleep(300);
  return child;
}
// CPU seconds so far, of a process or of its first thread, which is the server's for the network.
function cpu(child, thread = '') {
  const fields = fs.readFileSync(`/proc/${child.pid}${thread && `/task/${child.pid}`}/stat`, 'utf8').split(') ')[1].split(' ');
  return (Number(fields[11]) + Number(fields[12])) / 100;
}
function memoryMb(child) {
  return Number(fs.readFileSync(`/proc/${child.pid}/status`, 'utf8').match(/VmRSS:\s+(\d+)/)[1]) / 1024;
}

async function loadReplica() {
  const wasi = new Proxy({}, { get: () => () => 52 });
  const { instance } = await WebAssembly.instantiate(fs.readFileSync(`${TROCAR_BUILD}/web/replica_module.wasm`), { wasi_snapshot_preview1: wasi });
  instance.exports._initialize();
  instance.exports.restart();
  return instance.exports;
}
function varint(bytes, at) {
  let value = 0, shift = 1;
  for (;;) {
    const byte = bytes[at++];
    value += (byte & 127) * shift;
    if (byte < 128) return [value, at];
    shift *= 128;
  }
}
function encodeVarint(value) {
  const out = [];
  for (; value > 127; value = Math.floor(value / 128)) out.push((value % 128) | 128);
  return [...out, value];
}

// A watcher without a picture. With a replica it knows how old its newest frame is; without, it only
// acknowledges, for many of them.
class Watcher {
  frames = 0;
  bytes = 0;
  ages = [];
  constructor(port, code, name, replica, role = 'observer') {
    this.replica = replica;
    this.socket = new WebSocket(`ws://127.0.0.1:${port}/session`, { headers: { origin: `http://127.0.0.1:${port}` } });
    this.socket.binaryType = 'arraybuffer';
    this.socket.onopen = () => this.socket.send(JSON.stringify({ code, name, role, ...(role === 'surgeon' ? { tools: ['probe'] } : {}) }));
    this.socket.onmessage = event => this.take(new Uint8Array(event.data));
    this.timer = setInterval(() => this.ping(), 500);
    this.sampler = replica ? setInterval(() => this.sample(), 10) : null;
    this.offset = null;
    this.best = Infinity;
  }
  ping() {
    if (this.socket.readyState !== 1) return;
    const time = encodeVarint(Math.round(performance.now() * 1000));
    this.socket.send(new Uint8Array([0x2a, time.length + 1, 0x08, ...time]));
  }
  sample() {
    const published = this.replica.newest_server_us();
    if (this.offset !== null && published > 0) this.ages.push((performance.now() * 1000 + this.offset - published) / 1000);
  }
  take(bytes) {
    this.bytes += bytes.length;
    if (bytes[0] === 0x32) this.pong(bytes);
    if (bytes[0] === 0x12) this.frames++;
    if (this.replica) {
      const at = this.replica.input(bytes.length);
      new Uint8Array(this.replica.memory.buffer, at, bytes.length).set(bytes);
      this.replica.receive(bytes.length, performance.now());
      const size = this.replica.outbox_size(), out = new Uint8Array(this.replica.memory.buffer, this.replica.outbox(), size).slice();
      this.replica.outbox_clear();
      for (let i = 0; i < size;) {
        const length = new DataView(out.buffer).getUint32(i, true);
        this.socket.send(out.subarray(i + 4, i + 4 + length));
        i += 4 + length;
      }
    } else if (bytes[0] === 0x12) {
      let [, at] = varint(bytes, 1);
      const [frame] = bytes[at] === 8 ? varint(bytes, at + 1) : [0];
      const number = encodeVarint(frame);
      this.socket.send(new Uint8Array([0x22, number.length + 1, 0x08, ...number]));
    }
  }
  pong(bytes) {
    let at = varint(bytes, 1)[1], sent = 0, server = 0;
    while (at < bytes.length) {
      const key = bytes[at++], [value, next] = varint(bytes, at);
      at = next;
      if (key === 8) sent = value;
      if (key === 24) server = value;
    }
    const now = performance.now() * 1000, trip = now - sent;
    if (trip > this.best * 1.2 && this.offset !== null) return;
    this.best = Math.min(this.best, trip);
    this.offset = server - (now - trip / 2);
  }
  close() {
    clearInterval(this.timer);
    clearInterval(this.sampler);
    this.socket.close(1000);
  }
}

// One who holds an instrument, and moves it by a micrometre with each sample: where it comes back from
// the session says which sample that was, and so how long the hand took to the tissue and back.
class Holder extends Watcher {
  trips = [];
  sentMs = [];
  constructor(port, code, name, replica, row = 0) {
    super(port, code, name, replica, 'surgeon');
    this.y = 0.2 + 0.01 * row; // several do not take each other's instrument for their own
    this.mover = setInterval(() => this.move(), 8);
  }
  move() {
    if (this.socket.readyState !== 1 || this.frames === 0) return;
    const x = 0.4 + 1e-6 * this.sentMs.length, place = Buffer.alloc(17);
    place.set([0x1a, 15, 0x0d]);
    place.writeFloatLE(x, 3);
    place.set([0x15], 7);
    place.writeFloatLE(this.y, 8);
    place.set([0x1d], 12);
    place.writeFloatLE(0.2, 13);
    const one = Buffer.alloc(4);
    one.writeFloatLE(1);
    const orientation = Buffer.from([0x22, 5, 0x25, ...one]), number = encodeVarint(this.sentMs.length + 1);
    const sample = [0x10, ...number, ...place, ...orientation];
    this.socket.send(new Uint8Array([0x0a, sample.length, ...sample]));
    this.sentMs.push(performance.now());
  }
  sample() {
    super.sample();
    this.replica.update(performance.now(), 1000, 0);
    const at = this.replica.tools_at(), count = this.replica.tools();
    const tools = new Float32Array(this.replica.memory.buffer, at, 23 * count);
    for (let i = 0; i < tools.length; i += 23) {
      const number = Math.round((tools[i + 13] - 0.4) * 1e6);
      if (Math.abs(tools[i + 14] - this.y) > 1e-4 || number < 0 || number >= this.sentMs.length || number === this.seen) continue;
      this.seen = number;
      this.trips.push(performance.now() - this.sentMs[number]);
    }
  }
  close() {
    clearInterval(this.mover);
    super.close();
  }
}

async function measureSize() {
  const folder = `${TROCAR_BUILD}/web/page`, files = fs.readdirSync(folder).filter(name => !name.endsWith('.gz'));
  result.page = { bytes: 0, packed: 0, files: {} };
  for (const name of files) {
    const plain = fs.statSync(`${folder}/${name}`).size, packed = zlib.gzipSync(fs.readFileSync(`${folder}/${name}`), { level: 9 }).length;
    result.page.bytes += plain;
    result.page.packed += packed;
    result.page.files[name] = [plain, packed];
  }
}

async function measureBrowser(url, recordingUrl) {
  const args = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--disable-dev-shm-usage'];
  const browser = await chromium.launch({ executablePath: TROCAR_CHROMIUM, args });
  const firsts = [];
  for (let i = 0; i < 5; i++) {
    const page = await (await browser.newContext({ viewport: { width: 1280, height: 720 } })).newPage(), begin = performance.now();
    await page.goto(url + i);
    await page.waitForSelector('canvas[data-drawn]', { timeout: 60_000 });
    firsts.push(performance.now() - begin);
    if (i === 4) {
      await sleep(4000);
      const count = () => page.evaluate(() => [window.trocar.picture().pictures, performance.now(), window.trocar.picture().drawMs, window.trocar.replica.frames]);
      const [p0, t0, , f0] = await count();
      await sleep(8000);
      const [p1, t1, draw, f1] = await count();
      result.pictures = { perSecond: (p1 - p0) / (t1 - t0) * 1000, scriptMs: draw, framesPerSecond: (f1 - f0) / (t1 - t0) * 1000 };
    }
    await page.evaluate(() => window.trocar.session.leave());
    await page.context().close();
  }
  result.firstPictureMs = { median: quantile(firsts, 0.5), longest: Math.max(...firsts) };
  const page = await browser.newPage();
  await page.goto(recordingUrl);
  await page.waitForSelector('canvas[data-drawn]', { timeout: 60_000 });
  await sleep(3000);
  result.seeks = await page.evaluate(async () => {
    const { player, recording, traffic } = window.trocar, out = [];
    for (let i = 0; i < 40; i++) {
      const requests = traffic.requests;
      await player.seek(recording.firstTick + Math.random() * (recording.lastTick - recording.firstTick));
      out.push([player.seekMs, traffic.requests - requests]);
    }
    return out;
  });
  await browser.close();
}

async function measureNetworks(web, code) {
  result.networks = [];
  const replica = await loadReplica();
  const cases = [[0, 0, 0], [60, 1, 0], [60, 5, 0], [150, 1, 0], [150, 5, 0], [60, 1, 1000], [150, 5, 1000]];
  for (const [roundTrip, loss, rate] of cases) {
    const proxy = await started('trocar-impair', ['--listen', '127.0.0.1:0', '--to', `127.0.0.1:${web.port}`, '--delay', String(roundTrip / 2), '--loss', String(loss), ...(rate ? ['--rate', String(rate)] : [])]);
    replica.restart();
    const watcher = new Watcher(proxy.port, code, `Far ${roundTrip} ${loss} ${rate}`, replica);
    await sleep(6000);
    watcher.ages = [];
    const frames = watcher.frames, bytes = watcher.bytes;
    await sleep(kSeconds * 1000);
    result.networks.push({ roundTrip, loss, rate, median: quantile(watcher.ages, 0.5), p99: quantile(watcher.ages, 0.99), framesPerSecond: (watcher.frames - frames) / kSeconds, kbitPerSecond: (watcher.bytes - bytes) * 8e-3 / kSeconds, mismatches: replica.mismatches() });
    watcher.close();
    await sleep(300);
    proxy.kill();
  }
}

async function measureHands(web, code) {
  result.hands = [];
  const replica = await loadReplica();
  for (const [roundTrip, loss] of [[2, 0], [20, 0], [60, 0], [60, 1], [60, 5], [150, 0], [150, 1], [150, 5]]) {
    const proxy = await started('trocar-impair', ['--listen', '127.0.0.1:0', '--to', `127.0.0.1:${web.port}`, '--delay', String(roundTrip / 2), '--loss', String(loss)]);
    replica.restart();
    const holder = new Holder(proxy.port, code, `Hand ${roundTrip} ${loss}`, replica);
    await sleep(6000);
    holder.ages = [];
    holder.trips = [];
    await sleep(kSeconds * 1000);
    result.hands.push({ roundTrip, loss, trip: quantile(holder.trips, 0.5), trip99: quantile(holder.trips, 0.99), age: quantile(holder.ages, 0.5), age99: quantile(holder.ages, 0.99) });
    holder.close();
    await sleep(300);
    proxy.kill();
  }
}

// Bytes that the program has had from sessions so far.
async function sessionBytes(web) {
  const port = web.text.match(/figures at 127.0.0.1:(\d+)/)[1], text = await (await fetch(`http://127.0.0.1:${port}/metrics`)).text();
  return Number((text.match(/session_bytes_total (\d+)/) ?? text.match(/bytes_down_total (\d+)/))[1]);
}

async function measureWatchers(web, server, code) {
  result.watchers = [];
  for (const count of (process.env.TROCAR_WATCHERS ?? '1 20 100 200').split(' ').map(Number)) {
    const watchers = [];
    for (let i = 0; i < count; i++) {
      watchers.push(new Watcher(web.port, code, `Watcher ${count}-${i}`, null));
      await sleep(60);
    }
    await sleep(3000);
    const before = [cpu(web), cpu(server), watchers.map(w => w.frames), performance.now(), await sessionBytes(web), cpu(server, 'network')];
    await sleep(8000);
    const seconds = (performance.now() - before[3]) / 1000, rates = watchers.map((w, i) => (w.frames - before[2][i]) / seconds);
    result.watchers.push({ count, joined: watchers.filter(w => w.frames > 0).length, webCpu: (cpu(web) - before[0]) / seconds, serverCpu: (cpu(server) - before[1]) / seconds, networkCpu: (cpu(server, 'network') - before[5]) / seconds, framesPerSecond: quantile(rates, 0.5), least: Math.min(...rates), webMb: memoryMb(web), sessionMbit: (await sessionBytes(web) - before[4]) * 8e-6 / seconds });
    for (const watcher of watchers) watcher.close();
    await sleep(1000);
  }
}

// As many pages that hold an instrument, each over a connection of its own; the first and the last of
// them know how old their pictures are, and how long a hand takes to come back.
async function measureHolders(web, server, code) {
  result.holders = [];
  for (const count of (process.env.TROCAR_HOLDERS ?? '1 4 16').split(' ').map(Number)) {
    const holders = [];
    for (let i = 0; i < count; i++) {
      const knows = i === 0 || i === count - 1;
      holders.push(new Holder(web.port, code, `Holder ${count}-${i}`, knows ? await loadReplica() : null, i));
      await sleep(60);
    }
    await sleep(3000);
    const known = holders.filter(h => h.replica);
    for (const holder of known) holder.ages = [], holder.trips = [];
    const before = [cpu(web), cpu(server), cpu(server, 'network'), holders.map(h => h.frames), performance.now()];
    await sleep(kSeconds * 1000);
    const seconds = (performance.now() - before[4]) / 1000, rates = holders.map((h, i) => (h.frames - before[3][i]) / seconds);
    const ages = known.flatMap(h => h.ages), trips = known.flatMap(h => h.trips);
    result.holders.push({ count, joined: holders.filter(h => h.frames > 0).length, webCpu: (cpu(web) - before[0]) / seconds, serverCpu: (cpu(server) - before[1]) / seconds, networkCpu: (cpu(server, 'network') - before[2]) / seconds, framesPerSecond: quantile(rates, 0.5), least: Math.min(...rates), age: quantile(ages, 0.5), age99: quantile(ages, 0.99), trip: quantile(trips, 0.5), trip99: quantile(trips, 0.99) });
    for (const holder of holders) holder.close();
    await sleep(1000);
  }
}

function table() {
  const r = result, n = (value, digits = 0) => value.toFixed(digits);
  const lines = ['| figure | measured |', '|---|---|',
    `| page, all files | ${n(r.page.bytes / 1000)} kB, ${n(r.page.packed / 1000)} kB compressed |`,
    `| from link to picture, nothing cached | median ${n(r.firstPictureMs.median)} ms, longest of five ${n(r.firstPictureMs.longest)} ms |`,
    `| pictures per second, 1280x720, drawn in software | ${n(r.pictures.perSecond, 1)}; script ${n(r.pictures.scriptMs, 1)} ms each |`,
    `| seek in a recording by HTTP ranges | median ${n(quantile(r.seeks.map(s => s[0]), 0.5))} ms, longest of 40 ${n(Math.max(...r.seeks.map(s => s[0])))} ms |`, '',
    '| round trip | loss | rate | age, median | age, 99 % | frames per second |', '|---|---|---|---|---|---|',
    ...r.networks.map(c => `| ${c.roundTrip} ms | ${c.loss} % | ${c.rate ? `${c.rate / 1000} Mbit/s` : 'no cap'} | ${n(c.median)} ms | ${n(c.p99)} ms | ${n(c.framesPerSecond)} |`), '',
    '| round trip | loss | hand to tissue and back, median | 99 % | age, median | age, 99 % |', '|---|---|---|---|---|---|',
    ...r.hands.map(c => `| ${c.roundTrip} ms | ${c.loss} % | ${n(c.trip)} ms | ${n(c.trip99)} ms | ${n(c.age)} ms | ${n(c.age99)} ms |`), '',
    '| watchers | of the program, CPU | of the server, CPU | its network | from the session | frames per second, median | least | memory |', '|---|---|---|---|---|---|---|---|',
    ...r.watchers.map(w => `| ${w.joined} | ${n(w.webCpu * 100)} % | ${n(w.serverCpu * 100)} % | ${n(w.networkCpu * 100, 1)} % | ${n(w.sessionMbit, 1)} Mbit/s | ${n(w.framesPerSecond)} | ${n(w.least)} | ${n(w.webMb)} MB |`), '',
    '| pages with an instrument | of the program, CPU | for each page | of the server, CPU | its network | age, median | age, 99 % | hand to tissue and back, median | 99 % | frames per second, median | least |', '|---|---|---|---|---|---|---|---|---|---|---|',
    ...r.holders.map(h => `| ${h.joined} | ${n(h.webCpu * 100)} % | ${n(h.webCpu / h.count * 100, 2)} % | ${n(h.serverCpu * 100)} % | ${n(h.networkCpu * 100, 1)} % | ${n(h.age)} ms | ${n(h.age99)} ms | ${n(h.trip)} ms | ${n(h.trip99)} ms | ${n(h.framesPerSecond)} | ${n(h.least)} |`)];
  return lines.join('\n') + '\n';
}

const server = await started('trocar-server', ['--listen', '127.0.0.1:0', '--no-announce', '--journal', `${TROCAR_WORK}/figures.mcap`, ...(process.env.TROCAR_SERVER_OPTIONS ?? '--max-watchers 200').split(' ').filter(Boolean)]);
while (!/observer\s+\S{19}/.test(server.text)) await sleep(100);
const codes = Object.fromEntries([...server.text.matchAll(/^ {2}(\w+) +(\S{19}) /gm)].map(m => [m[1], m[2]]));
const hands = ['lift', 'press'].map(scene =>
  launch('trocar-client', ['--server', `127.0.0.1:${server.port}`, '--name', scene, '--no-render', '--join', codes.surgeon, '--script', `${TROCAR_ROOT}/deploy/scenes/${scene}.toml`]));
fs.mkdirSync(`${TROCAR_WORK}/recordings`, { recursive: true });
fs.copyFileSync(TROCAR_RECORDING, `${TROCAR_WORK}/recordings/lesson.mcap`);
const web = await started('trocar-web', ['--insecure-loopback', '--listen', '127.0.0.1:0', '--session', `127.0.0.1:${server.port}`, '--recordings', `${TROCAR_WORK}/recordings`, '--metrics', '127.0.0.1:0', '--max-connections-per-address', '400']);
const key = web.text.match(/#recordings=(\w+)/)[1], base = `http://127.0.0.1:${web.port}/`;
try {
  await measureSize();
  const only = process.env.TROCAR_ONLY ?? 'browser networks hands watchers holders';
  if (only.includes('browser')) await measureBrowser(`${base}#join=${codes.observer}&role=observer&name=Eve`, `${base}#recordings=${key}&file=lesson.mcap`);
  if (only.includes('networks')) await measureNetworks(web, codes.observer);
  if (only.includes('hands')) await measureHands(web, codes.surgeon);
  if (only.includes('watchers')) await measureWatchers(web, server, codes.observer);
  if (only.includes('holders')) {
    for (const hand of hands) hand.kill(); // there are 16 places for hands
    await measureHolders(web, server, codes.surgeon);
  }
} finally {
  for (const child of children) child.kill('SIGKILL');
  fs.writeFileSync(`${TROCAR_WORK}/figures.json`, JSON.stringify(result, null, 1));
}
if (result.networks && result.hands && result.watchers && result.holders && result.seeks) {
  fs.writeFileSync(`${TROCAR_WORK}/figures.md`, table());
  console.log(table());
} else console.log(JSON.stringify(result, null, 1));
