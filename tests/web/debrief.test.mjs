// A recording in headless Chromium: what a person does with it besides playing.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import { base, kPatience, live, openPage, prepare, test, until, world } from './browser.mjs';

const { TROCAR_BUILD, TROCAR_MODULES, TROCAR_RECORDING, TROCAR_WORK, TROCAR_PICTURES } = process.env;
prepare(null, ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`]);

const keyOf = () => world.web.text.match(/#recordings=(\w+)/)[1];
const open = async (name, more = '') => {
  const page = await openPage(`${base()}#recordings=${keyOf()}&file=${name}${more}`);
  await live(page);
  return page;
};
const button = (page, name) => page.getByRole('button', { name });
const tick = page => page.evaluate(() => window.trocar.player.tick);

test('a recording verifies, and a changed one is told by its reason', async () => {
  const folder = `${TROCAR_WORK}/recordings`, longAgo = new Date(Date.now() - 3_600_000);
  fs.utimesSync(`${folder}/lesson.mcap`, longAgo, longAgo); // as one that is written no more
  const broken = fs.readFileSync(`${folder}/lesson.mcap`);
  for (let i = 0; i < 64; i++) broken[(broken.length >> 1) + i] ^= 0x5a;
  fs.writeFileSync(`${folder}/broken.mcap`, broken);
  fs.utimesSync(`${folder}/broken.mcap`, longAgo, longAgo);
  let page = await open('lesson.mcap');
  await button(page, 'Verify recording').click();
  await page.locator('.check').getByText(/It is being checked, for \d+ s so far/).waitFor({ timeout: kPatience });
  // The check has the lowest priority: a browser that draws in software would take its time.
  await page.close();
  const said = (name, what) => until(name, async () => {
    const answer = await (await fetch(`${base()}recordings/${name}/${what}`, { headers: { Authorization: `Bearer ${keyOf()}` } })).json();
    return ['waiting', 'running'].includes(answer.state) ? null : answer;
  });
  assert.equal((await said('lesson.mcap', 'checked')).state, 'verified');
  const brokenSaid = await said('broken.mcap', 'check');
  assert.ok(['unknown', 'different'].includes(brokenSaid.state) && brokenSaid.text.length > 10, JSON.stringify(brokenSaid));
  assert.equal((await fetch(`${base()}recordings/lesson.mcap/check`)).status, 403);
  page = await open('lesson.mcap');
  await page.locator('.check').getByText(/Verified: \d+ ticks/).waitFor({ timeout: kPatience }); // it is kept
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('the events of the overview are those of the recording, and little is loaded for them', async () => {
  const page = await open('lesson.mcap');
  await page.locator('.events').getByText(/incise cuts/).first().waitFor({ timeout: kPatience });
  const counts = await page.evaluate(async () => {
    let known = 0, end = 0;
    for await (const overview of window.trocar.recording.overviews()) {
      known += overview.claim.length;
      end = Number(overview.firstTick) + overview.bins * overview.binTicks;
    }
    let all = 0;
    for await (const item of window.trocar.recording.survey(-1)) if (item.topic === '/claims') all++;
    return { known, end, all, last: window.trocar.recording.lastTick };
  });
  assert.ok(counts.known >= counts.all && counts.all > 0, JSON.stringify(counts));
  assert.ok(counts.end >= counts.last, JSON.stringify(counts));
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('a recording of two servers plays on where the second one went on', async () => {
  const program = name => `${TROCAR_BUILD}/bin/${name}`, at = name => `${TROCAR_WORK}/${name}`;
  const serve = (...more) => spawn(program('trocar-server'), ['--insecure-loopback', '--listen', '127.0.0.1:0', '--no-announce', ...more], { stdio: 'ignore' });
  const ended = server => new Promise(resolve => server.on('exit', resolve));
  const first = serve('--organ', 'elastic-liver', '--journal', at('first.mcap'), '--ready-file', at('first.ready'));
  await until('the server', () => fs.existsSync(at('first.ready')));
  await new Promise(resolve => setTimeout(resolve, 2500));
  first.kill('SIGKILL');
  await ended(first);
  assert.equal(await ended(serve('--resume', at('first.mcap'), '--journal', at('second.mcap'), '--seconds', '2')), 0);
  execFileSync(program('trocar-journal'), ['merge', at('first.mcap'), at('second.mcap'), at('recordings/merged.mcap')]);
  const { joins: [join] } = JSON.parse(execFileSync(program('trocar-journal'), ['info', at('recordings/merged.mcap'), '--json']));
  const page = await open('merged.mcap');
  await page.locator('.events').getByText('Another server went on here').waitFor({ timeout: kPatience });
  await page.evaluate(tick => window.trocar.player.seek(tick), join - 500);
  await page.evaluate(() => { window.trocar.player.play(); });
  // The surface moves on with the time: frames come every 16 ticks.
  const { late } = await until('the end', async () => {
    const { tick, last, frame } = await page.evaluate(() => ({ tick: window.trocar.player.tick, last: window.trocar.recording.lastTick, frame: window.trocar.replica.newestFrame }));
    return tick >= last ? { late: tick - 16 * frame } : null;
  });
  assert.ok(late <= 16, `the surface is ${late} ticks behind`);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('a range is played again and again', async () => {
  const page = await open('lesson.mcap', '&t=3&speed=4');
  await page.evaluate(() => document.querySelector('header button').focus());
  await page.keyboard.press('i');
  await page.evaluate(() => window.trocar.player.seek(4000));
  await page.keyboard.press('o');
  await button(page, /^Loop 0:03.0 to 0:04.0/).waitFor({ timeout: kPatience });
  await button(page, 'Play').click();
  for (let i = 0, before = await tick(page); i < 2;) {
    const now = await tick(page);
    assert.ok(now <= 4300, `tick ${now}`);
    if (now < before) i++;
    before = now;
    await page.waitForTimeout(20);
  }
  await page.keyboard.press('x');
  assert.equal(await page.evaluate(() => window.trocar.player.range), null);
  await page.close();
});

test('bookmarks stay in the browser and go on as a link; a link opens time and view', async () => {
  const page = await open('lesson.mcap', '&t=2&view=0.1,0.2,0.3,0,0,0&speed=2');
  assert.equal(await page.evaluate(() => window.trocar.player.speed), 2);
  const eye = await page.evaluate(() => window.trocar.picture().view().eye);
  assert.ok(Math.hypot(eye[0] - 0.1, eye[1] - 0.2, eye[2] - 0.3) < 1e-3, eye.join());
  await page.getByRole('textbox', { name: 'Name of the bookmark' }).fill('The <b>cut</b>');
  await button(page, 'Add here').click();
  await page.locator('.bookmarks').getByText('The <b>cut</b>').waitFor({ timeout: kPatience });
  await page.reload();
  await live(page);
  await page.locator('.bookmarks').getByText('The <b>cut</b>').waitFor({ timeout: kPatience });
  await button(page, 'Remove The <b>cut</b>').click();
  await page.locator('.bookmarks').getByText('The <b>cut</b>').waitFor({ state: 'detached', timeout: kPatience });
  await page.close();
  const other = await open('lesson.mcap', `&bookmarks=${encodeURIComponent('[[5,"Late"]]')}`);
  await other.locator('.bookmarks').getByText('Late').click();
  await until('it is there', async () => Math.abs(await tick(other) - 5000) < 1);
  await other.close();
  const wrong = await open('lesson.mcap', '&bookmarks=nonsense&view=1,2&speed=77');
  await wrong.getByRole('alert').getByText('These are no bookmarks').waitFor({ timeout: kPatience });
  assert.equal(await wrong.evaluate(() => window.trocar.player.speed), 1);
  await wrong.close();
});

const saved = async (page, name) => {
  const [file] = await Promise.all([page.waitForEvent('download', { timeout: kPatience }), button(page, name).click()]);
  return fs.readFileSync(await file.path());
};

test('picture, clip and tables are files that say what the page shows', async () => {
  const page = await open('lesson.mcap', '&t=5');
  await page.locator('.events').getByText(/incise cuts/).first().waitFor({ timeout: kPatience });
  await page.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
  const png = await saved(page, 'Picture');
  assert.equal(png.subarray(1, 4).toString(), 'PNG');
  const colours = await page.evaluate(async bytes => {
    const image = await createImageBitmap(new Blob([new Uint8Array(bytes)])), canvas = new OffscreenCanvas(image.width, image.height);
    canvas.getContext('2d').drawImage(image, 0, 0);
    const seen = canvas.getContext('2d').getImageData(0, 0, image.width, image.height).data;
    return new Set(Array.from({ length: seen.length >> 4 }, (_, i) => seen[i * 16] * 256 + seen[i * 16 + 1])).size;
  }, [...png]);
  assert.ok(colours > 100, `${colours} colours: the organ is there`);
  const forces = (await saved(page, 'Forces as a table')).toString().trim().split('\n');
  assert.equal(forces[0].replace('\ufeff', ''), 'time_s,tool,name,force_n,speed_mm_s,path_mm,verb,has_claim');
  const greatest = Math.max(...forces.slice(1).map(row => Number(row.split(',')[3])));
  const known = await page.evaluate(async () => {
    let most = 0;
    for await (const overview of window.trocar.recording.overviews()) for (const tool of overview.tool) most = Math.max(most, ...tool.forceMn);
    return most / 1000;
  });
  assert.ok(known > 0.1 && Math.abs(known - greatest) < 1e-3, `${known} ${greatest}`);
  assert.ok(forces.some(row => /"incise"/.test(row)), forces.slice(0, 3).join());
  const events = (await saved(page, 'Events as a table')).toString();
  assert.match(events, /\d+\.\d{3},grant,"incise cuts/);
  await button(page, 'Clip').click();
  await button(page, 'Play').click();
  await page.waitForTimeout(2000);
  const clip = await saved(page, 'End the clip');
  assert.equal(clip.readUInt32BE(0), 0x1a45dfa3); // EBML
  assert.ok(clip.length > 5000, `${clip.length} bytes`);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('distances and areas are those of the clicked places', async () => {
  const page = await open('lesson.mcap', '&t=2');
  const box = await page.locator('canvas[data-drawn]').boundingBox(), middle = [box.x + box.width / 2, box.y + box.height / 2];
  await button(page, 'Distance').click();
  await page.locator('.measure .hint').waitFor({ timeout: kPatience });
  await page.mouse.click(middle[0] - 40, middle[1]);
  await page.mouse.click(middle[0] + 40, middle[1]);
  const said = page.locator('.measure [role=status]');
  await said.getByText(/^\d+\.\d mm$/).waitFor({ timeout: kPatience });
  const wanted = await page.evaluate(width => {
    const p = window.trocar.picture(), a = p.pick(0.5 - 40 / width, 0.5), b = p.pick(0.5 + 40 / width, 0.5);
    return 1000 * Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  }, box.width);
  const mm = Number((await said.textContent()).split(' ')[0]);
  assert.ok(wanted > 5 && Math.abs(mm - wanted) < 1, `${mm} mm, by rays ${wanted} mm`);
  await button(page, 'Area').click();
  await page.mouse.click(middle[0], middle[1] + 30);
  await said.getByText(/^\d+ mm²$/).waitFor({ timeout: kPatience });
  await button(page, 'Remove the last').click();
  await page.waitForFunction(() => document.querySelector('.measure [role=status]').textContent === '');
  // With keys: the place in the middle. A drag turns the view and takes none.
  await page.mouse.move(...middle);
  await page.mouse.down();
  await page.mouse.move(middle[0] + 60, middle[1], { steps: 5 });
  await page.mouse.up();
  assert.equal(await said.textContent(), '');
  await page.locator('canvas[data-drawn]').focus();
  await page.keyboard.press('Enter');
  await said.getByText(/^\d+ mm²$/).waitFor({ timeout: kPatience });
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('plots are of force, speed, way and holds; ways of tips are on the picture', async () => {
  const page = await open('lesson.mcap', '&t=6');
  await page.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
  for (const [what, label] of [['speed', /^Speed of the tip over time. Greatest: .*incise [\d.]+ mm\/s/], ['path', /^Way of the tip over time. Greatest: .*incise \d+(\.\d)? mm/], ['force', /^Force over time. Greatest: .*incise [\d.]+ N/]]) {
    await page.getByRole('combobox', { name: 'Over time' }).selectOption(what);
    await page.getByRole('img', { name: label }).waitFor({ timeout: kPatience });
  }
  await page.getByRole('combobox', { name: 'Over time' }).selectOption('holds');
  const hold = page.getByRole('button', { name: /^retract holds, 0:\d/ }).first();
  await hold.waitFor({ timeout: kPatience });
  await hold.focus();
  await page.keyboard.press('Enter');
  await until('it is there', async () => await tick(page) < 6000);
  await page.evaluate(() => window.trocar.player.seek(6000));
  const inked = () => page.evaluate(() => {
    const canvas = document.querySelector('canvas.sketch');
    return canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.filter((_, i) => i % 4 === 3).reduce((sum, a) => sum + (a > 0 ? 1 : 0), 0);
  });
  assert.equal(await inked(), 0);
  await button(page, 'Show').click();
  await until('ways are drawn', async () => await inked() > 100);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('a report for paper has events, plots, and pictures of bookmarks', async () => {
  const page = await open('lesson.mcap', `&t=1&bookmarks=${encodeURIComponent('[[2,"First"],[5,"<i>Later</i>"]]')}`);
  await page.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
  await button(page, 'Report for paper').click();
  const report = page.getByRole('dialog', { name: 'Report' });
  await report.waitFor({ timeout: kPatience });
  await report.getByText('<i>Later</i>').waitFor({ timeout: kPatience });
  assert.equal(await report.locator('.shots img').count(), 2);
  const urls = await report.locator('.shots img').evaluateAll(images => images.map(image => image.src.length));
  assert.ok(urls.every(length => length > 5000), urls.join());
  assert.equal(await report.locator('figure svg[role=img]').count(), 3);
  await report.getByText('incise cuts').waitFor({ timeout: kPatience });
  const paper = await page.pdf({ format: 'A4', preferCSSPageSize: true, ...(TROCAR_PICTURES ? { path: `${TROCAR_PICTURES}/report.pdf` } : {}) });
  assert.equal(paper.subarray(0, 4).toString(), '%PDF');
  assert.ok(paper.length > 20_000, `${paper.length} bytes`);
  await page.keyboard.press('Escape');
  await report.waitFor({ state: 'detached', timeout: kPatience });
  assert.equal(await tick(page), 1000);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('another recording stands beside, on one clock or by an event of each', async () => {
  const page = await open('lesson.mcap', '&t=2'), ticks = () => page.evaluate(() => [window.trocar.player.tick, window.trocarBeside.player.tick]);
  await page.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
  await page.getByRole('combobox', { name: 'Recording', exact: true }).selectOption('lesson.mcap');
  await page.locator('.half + .half canvas[data-drawn]').waitFor({ timeout: kPatience });
  await page.evaluate(() => window.trocar.player.seek(4000));
  await until('both are there', async () => (await ticks()).every(t => t === 4000));
  await until('both surfaces are equal', () => page.evaluate(() => window.trocar.replica.crc === window.trocarBeside.replica.crc));
  await button(page, 'Play').click();
  await until('both play', async () => (await ticks()).every(t => t > 5000));
  await button(page, 'Pause').click();
  await page.locator('.aligned summary').click();
  const choose = async (label, text) => {
    const choice = page.getByRole('combobox', { name: label, exact: true }), value = await choice.locator('option', { hasText: text }).first().getAttribute('value');
    await choice.selectOption(value);
    return page.evaluate(text => { // its tick
      for (const button of document.querySelectorAll('.events button')) if (button.textContent.includes(text)) button.click();
      return window.trocar.player.tick;
    }, text);
  };
  const here = await choose('Where the first has', 'retract has a grasp'), there = await choose('this one has', 'incise stopped cutting');
  await page.evaluate(tick => window.trocar.player.seek(tick), here + 100);
  await until('events come together', async () => { const [first, second] = await ticks(); return first === here + 100 && Math.abs(second - there - 100) <= 16; });
  await page.locator('.beside').getByRole('button', { name: 'Close' }).click();
  await page.locator('.half + .half').waitFor({ state: 'detached', timeout: kPatience });
  assert.deepEqual(page.faults, []);
  await page.close();
});

// The recording again, with what `change` makes of each message; null leaves it out.
async function rewritten(change) {
  const require = createRequire(`${TROCAR_MODULES}/`), { McapIndexedReader, McapWriter } = require('@mcap/core'), { decompress } = require('fzstd');
  const from = fs.readFileSync(TROCAR_RECORDING), parts = [];
  const readable = { size: async () => BigInt(from.length), read: async (at, size) => new Uint8Array(from.subarray(Number(at), Number(at + size))) };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: (packed, size) => decompress(packed, new Uint8Array(Number(size))) } });
  let length = 0;
  const writer = new McapWriter({ writable: { position: () => BigInt(length), write: async bytes => { parts.push(Buffer.from(bytes)); length += bytes.length; } } }), channels = new Map();
  await writer.start({ profile: 'trocar', library: 'test' });
  for await (const metadata of reader.readMetadata()) await writer.addMetadata(metadata);
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId), to = change(channel.topic, message);
    if (to === null) continue;
    if (!channels.has(channel.id)) channels.set(channel.id, await writer.registerChannel({ topic: channel.topic, messageEncoding: channel.messageEncoding, schemaId: 0, metadata: channel.metadata }));
    await writer.addMessage({ ...message, ...to, channelId: channels.get(channel.id) });
  }
  await writer.end();
  return Buffer.concat(parts);
}
const dropped = async bytes => {
  const page = await openPage(base());
  await page.locator('input[type=file]').setInputFiles({ name: 'made.mcap', mimeType: 'application/octet-stream', buffer: bytes });
  return page;
};

test('an older recording without overview is read itself; a wrong overview or time is one sentence', async () => {
  const older = await dropped(await rewritten(topic => (topic === '/overview' ? null : {})));
  await older.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
  await older.locator('.events').getByText('incise cuts').waitFor({ timeout: kPatience });
  await older.getByRole('img', { name: /^Force over time. Greatest: .*incise [1-9][\d.]* N/ }).waitFor({ timeout: kPatience });
  assert.deepEqual(older.faults, []);
  await older.close();
  for (const data of [Buffer.from([0x10, 0x80, 0x02, 0x18, 0x88, 0x27]), Buffer.alloc(300, 0xff)]) { // 5,000 bins; no message
    const page = await dropped(await rewritten(topic => (topic === '/overview' ? { data } : {})));
    await page.getByRole('alert').getByText('The overview of this recording cannot be read.').waitFor({ timeout: kPatience });
    await live(page);
    assert.deepEqual(page.faults, []);
    await page.close();
  }
  const late = await dropped(await rewritten((topic, message) => (topic === '/overview' ? { logTime: message.logTime + 10n ** 17n } : {})));
  await late.getByRole('alert').getByText(/This file is no whole Trocar recording/).waitFor({ timeout: kPatience });
  await late.close();
});
