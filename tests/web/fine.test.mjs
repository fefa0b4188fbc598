// An organ's fine surface on the page in headless Chromium, against the real programs: drawn with its
// picture, cut with the organ, the same for who comes late, through a relay and in the recording.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { base, close, kPatience, launch, link, live, openPage, picture, portOf, prepare, startWeb, test, until, world } from './browser.mjs';
import { makeOrgan } from './fine_organ.mjs';

const { TROCAR_WORK } = process.env;
const organ = makeOrgan(TROCAR_WORK);
const kRecordings = ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`];
prepare(['--organ', organ.path], kRecordings);

// The surface as the page has it; null: there is none.
const fine = page => page.evaluate(() => {
  const now = window.trocar.replica.fine();
  return now && { triangles: now.triangles.length / 3, vertices: now.positions.length / 3, parted: now.parted, geometryVersion: now.geometryVersion, pictureVersion: now.pictureVersion };
});
// The places at rest of all triangles (0.1 mm), each from its least corner on, in order: how a surface
// came to be what it is decides how its vertices are numbered.
const places = page => page.evaluate(() => {
  const { rest, triangles } = window.trocar.replica.fine(), out = [];
  const place = v => [0, 1, 2].map(axis => Math.round(rest[v * 4 + axis] * 1e4)).join(' ');
  for (let i = 0; i < triangles.length; i += 3) {
    const all = [0, 1, 2].map(k => place(triangles[i + k])), first = all.indexOf([...all].sort()[0]);
    out.push([0, 1, 2].map(k => all[(first + k) % 3]).join(','));
  }
  return out.sort().join(';');
});
const arrives = page => until('the fine surface', () => page.evaluate(() => window.trocar.replica.fine() !== null));
const pictureIsLoaded = page => until('its picture', () => page.evaluate(() => window.trocar.picture().fine.hasPicture.value === 1));
// Counts pixels of the canvas that are more blue than red, as no tissue is, and half of the picture's squares.
const bluePixels = page => page.evaluate(async () => {
  await new Promise(resolve => requestAnimationFrame(resolve));
  window.trocar.picture().draw(performance.now());
  const canvas = document.querySelector('.stage canvas'), copy = new OffscreenCanvas(canvas.width, canvas.height), context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(canvas.width / 4, canvas.height / 4, canvas.width / 2, canvas.height / 2);
  let blue = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i + 2] > 1.3 * data[i] && data[i + 2] > 40) blue++;
  return blue / (data.length / 4);
});
let cut = null;

test('the fine surface is drawn with its picture, and cut with the organ; who comes late sees the same', async () => {
  const page = await openPage(link(world.server.codes.observer, 'observer', 'Olga'));
  await live(page);
  await arrives(page);
  assert.equal((await fine(page)).triangles, organ.triangles);
  assert.equal((await fine(page)).parted, 0);
  await pictureIsLoaded(page);
  const blue = await bluePixels(page);
  assert.ok(blue > 0.1, `${blue} of the middle is blue`);
  await picture(page, 'fine-before');
  const { pictureVersion } = await fine(page);
  const hands = [world.server.hand('Scalpel', 'incise'), world.server.hand('Assistant', 'retract')], begin = await page.evaluate(() => window.trocar.replica.newestTick);
  await until('it is parted', async () => (await fine(page)).parted > 20);
  assert.equal((await fine(page)).pictureVersion, pictureVersion, 'a cut leaves the picture alone');
  await until('the wound is drawn open', () => page.evaluate(tick => window.trocar.replica.newestTick > tick, begin + 6500));
  await picture(page, 'fine-open');
  for (const hand of hands) hand.kill();
  await until('the hands are gone', () => page.evaluate(() => window.trocar.replica.tools().length === 0));
  const late = await openPage(link(world.server.codes.observer, 'observer', 'Lea'));
  await live(late);
  await arrives(late);
  cut = await fine(page);
  assert.ok(cut.triangles > organ.triangles, 'parts and skirts are more triangles');
  await until('both are the same', async () => await places(late) === await places(page));
  await pictureIsLoaded(late);
  await picture(late, 'fine-cut');
  assert.ok(await bluePixels(late) > 0.1);
  assert.equal(await page.evaluate(() => window.trocar.replica.mismatches), 0);
  for (const one of [page, late]) assert.deepEqual(one.faults, []);
  await close(late);
  await close(page);
});

test('an instructor has it over a connection of his own', async () => {
  const page = await openPage(link(world.server.codes.instructor, 'instructor', 'Ivy'));
  await live(page);
  await arrives(page);
  await until('it is parted', async () => (await fine(page)).parted === cut.parted);
  await close(page);
});

test('who watches through a relay has it, too', async () => {
  const ready = `${TROCAR_WORK}/relay.port`;
  const relay = launch('trocar-relay', ['--to', `127.0.0.1:${world.server.port}`, '--code', world.server.codes.observer, '--listen', '127.0.0.1:0', '--ready-file', ready]);
  const port = await portOf(relay, ready);
  await until('its code', () => /\b\w{4}-\w{4}-\w{4}-\w{4}\b/.test(relay.text));
  const [code] = relay.text.match(/\b\w{4}-\w{4}-\w{4}-\w{4}\b/), before = world.web;
  world.web = await startWeb(0, ['--insecure-loopback', '--session', `127.0.0.1:${port}`]);
  const watches = async name => {
    const page = await openPage(`${link(code, 'observer', name)}&session=127.0.0.1:${port}`);
    await live(page);
    await arrives(page);
    await until('it is parted', async () => (await fine(page)).parted === cut.parted);
    assert.deepEqual(page.faults, []);
    return page;
  };
  const first = await watches('Rita'), second = await watches('Rolf'); // he comes late to the same connection
  assert.ok(await places(second) === await places(first), 'both are the same');
  await close(first);
  await close(second);
  world.web.kill();
  relay.kill();
  world.web = before;
});

test('a surface that cannot be drawn is named in a line, and the mesh is drawn', async () => {
  const page = await openPage(link(world.server.codes.observer, 'observer', 'Wim'));
  await live(page);
  await arrives(page);
  const start = () => page.evaluate(() => { window.trocar.picture().draw(performance.now()); return window.trocar.picture().organ.geometry.drawRange.start; });
  assert.ok(await start() > 0);
  await page.evaluate(() => window.trocar.replica.receiveFineSurface(new Uint8Array([0xff])));
  await page.getByRole('status').getByText('the organ is drawn without its fine surface: FineSurface: is malformed').waitFor({ timeout: kPatience });
  assert.equal(await fine(page), null);
  assert.equal(await start(), 0);
  assert.deepEqual(page.faults, []);
  await picture(page, 'fine-refused');
  await page.getByText('the organ is drawn without').click();
  await page.getByText('the organ is drawn without').waitFor({ state: 'detached', timeout: kPatience });
  await close(page);
});

test('its recording shows it, whole at the beginning and parted at the end', async () => {
  world.server.kill('SIGTERM');
  await world.server.ended;
  fs.copyFileSync(`${TROCAR_WORK}/lesson.mcap`, `${TROCAR_WORK}/recordings/fine.mcap`);
  const open = async name => {
    const page = await openPage(`${base()}#recordings=${world.web.text.match(/#recordings=(\w+)/)[1]}&file=${name}`);
    await live(page);
    return page;
  };
  const page = await open('fine.mcap');
  await arrives(page);
  assert.equal((await fine(page)).parted, 0);
  const seek = tick => page.evaluate(async at => {
    await window.trocar.player.seek(at ?? window.trocar.recording.lastTick);
    const { replica } = window.trocar;
    while (replica.shownTick !== replica.newestTick) await new Promise(resolve => requestAnimationFrame(resolve));
  }, tick);
  await seek(null);
  assert.equal((await fine(page)).parted, cut.parted);
  await pictureIsLoaded(page);
  await picture(page, 'fine-debrief');
  await seek(0);
  assert.equal((await fine(page)).parted, 0);
  assert.equal((await fine(page)).triangles, organ.triangles);
  assert.deepEqual(page.faults, []);
  await page.close();
  const plain = await open('lesson.mcap');
  await until('it was looked for', () => plain.evaluate(() => window.trocar.player.hasFine));
  assert.equal(await fine(plain), null);
  assert.equal(await plain.evaluate(() => window.trocar.replica.fineFault), '');
  await plain.close();
});
