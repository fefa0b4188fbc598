// Blood on the page in headless Chromium, against the real programs: what is drawn, and what is counted, in
// a lesson that bleeds and in its recording.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { base, breaksNoRule, close, kPatience, link, live, openPage, prepare, test, until, world } from './browser.mjs';

const { TROCAR_WORK } = process.env;
const kNanolitre = 1e-6; // ml: volumes are rounded down to it
const kBleeds = /^(It|A vessel) bleeds$/;
prepare(['--lesson', 'along-the-line'], ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`]);

const panel = page => page.getByRole('region', { name: 'Blood lost' });
const blood = page => page.evaluate(() => window.trocar.replica.blood());
const covered = page => page.evaluate(() => window.trocar.replica.lips().filter((value, i) => i % 4 === 3 && value > 0).length);
const openRecording = async (name, more = '') => {
  const page = await openPage(`${base()}#recordings=${world.web.text.match(/#recordings=(\w+)/)[1]}&file=${name}${more}`);
  await live(page);
  return page;
};
let lostMl = 0;

test('a cut bleeds, the panel counts what is lost, and the suction takes it', async () => {
  const page = await openPage(link(world.server.codes.instructor, 'instructor', 'Ivy'));
  await live(page);
  assert.equal(await covered(page), 0);
  assert.equal(await panel(page).count(), 0, 'nothing has bled');
  const hand = world.server.hand('Scalpel', 'incise');
  await panel(page).getByText(kBleeds).waitFor({ timeout: kPatience });
  await until('blood is drawn', async () => await covered(page) > 0);
  const suction = world.server.hand('Suction', 'suck');
  await until('some is sucked off', async () => (await blood(page)).suckedMl > 0.05);
  const now = await page.evaluate(() => {
    const { shedMl, onSurfaceMl, drippedMl, suckedMl } = window.trocar.replica.blood();
    return { shedMl, sumMl: onSurfaceMl + drippedMl + suckedMl };
  });
  lostMl = now.shedMl;
  assert.ok(Math.abs(now.shedMl - now.sumMl) <= 4 * kNanolitre, `${now.shedMl} ml are not ${now.sumMl} ml`);
  await panel(page).getByRole('heading', { name: /^Blood lost: \d+\.\d ml$/ }).waitFor({ timeout: kPatience });
  assert.match(await panel(page).getByRole('status').innerText(), kBleeds);
  assert.match(await panel(page).innerText(), /Sucked off\s+\d+\.\d ml/);
  for (const colorScheme of ['dark', 'light']) {
    await page.emulateMedia({ colorScheme });
    await breaksNoRule(page, `blood-${colorScheme}`);
  }
  await page.setViewportSize({ width: 390, height: 844 });
  await breaksNoRule(page, 'blood-phone');
  await page.setViewportSize({ width: 900, height: 600 });
  await page.getByRole('button', { name: 'Next stage' }).click();
  await page.getByRole('list', { name: 'Results' }).getByText(/^blood lost: \d+\.\d ml$/).waitFor({ timeout: kPatience });
  assert.equal(await page.evaluate(() => window.trocar.replica.mismatches), 0);
  assert.deepEqual(page.faults, []);
  hand.kill();
  suction.kill();
  await close(page);
});

// Colours of the picture at places of the canvas (0 to 1), as it is and as it would be without blood.
const colours = (page, places) => page.evaluate(async places => {
  await new Promise(resolve => requestAnimationFrame(resolve));
  const { replica } = window.trocar, lips = replica.lips;
  const drawn = () => {
    window.trocar.picture().draw(performance.now());
    const canvas = document.querySelector('.stage canvas'), copy = new OffscreenCanvas(canvas.width, canvas.height), context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    return places.map(([x, y]) => [...context.getImageData(Math.floor(x * canvas.width), Math.floor(y * canvas.height), 1, 1).data]);
  };
  const wet = drawn();
  replica.lips = () => lips.call(replica).map((value, i) => (i % 4 === 3 ? 0 : value));
  const dry = drawn();
  replica.lips = lips;
  return wet.map((colour, i) => [colour, dry[i]]);
}, places);
const greenness = ([red, green]) => green / Math.max(1, red);
// Where the organ is seen and blood stands from one depth on up to another (cube roots of shares of
// 5.1 mm, in parts of 127).
const placesOf = (page, least, most) => page.evaluate(([least, most]) => {
  const { replica } = window.trocar, picture = window.trocar.picture(), lips = replica.lips(), normals = replica.normals(), positions = replica.positions();
  const camera = picture.panes[0].camera, out = [];
  for (let i = 0; i < lips.length / 4; i++) {
    if (lips[i * 4 + 3] < least || lips[i * 4 + 3] > most) continue;
    const [x, y, z] = positions.subarray(i * 3), at = camera.position.clone().set(x, y, z), towards = camera.position.clone().sub(at).normalize();
    if (towards.x * normals[i * 3] + towards.y * normals[i * 3 + 1] + towards.z * normals[i * 3 + 2] < 0.4) continue;
    at.project(camera);
    out.push([(at.x + 1) / 2, (1 - at.y) / 2]);
  }
  return out;
}, [least, most]);

test('its recording has the same blood, at each time that is shown', async () => {
  world.server.kill('SIGTERM');
  await world.server.ended;
  fs.copyFileSync(`${TROCAR_WORK}/lesson.mcap`, `${TROCAR_WORK}/recordings/bled.mcap`);
  const page = await openRecording('bled.mcap');
  const seek = tick => page.evaluate(async at => {
    await window.trocar.player.seek(at ?? window.trocar.recording.lastTick);
    const { replica } = window.trocar;
    while (replica.shownTick !== replica.newestTick) await new Promise(resolve => requestAnimationFrame(resolve));
  }, tick);
  assert.equal(await covered(page), 0);
  assert.equal(await panel(page).count(), 0);
  await seek(null);
  const end = await blood(page);
  assert.ok(end.shedMl >= lostMl, `${end.shedMl} ml at its end, ${lostMl} ml before`);
  await panel(page).getByRole('heading', { name: `Blood lost: ${end.shedMl.toFixed(1)} ml` }).waitFor({ timeout: kPatience });
  await breaksNoRule(page, 'blood-debrief');
  const isChanged = ([as, without]) => as.join() !== without.join();
  const dry = await colours(page, await placesOf(page, 0, 0)), changed = dry.filter(isChanged).length;
  assert.ok(changed < 0.1 * dry.length, `${changed} of ${dry.length} dry places look otherwise than without blood`);
  // Tools and other tissue stand before some places.
  const seen = (await colours(page, await placesOf(page, 40, 127))).filter(isChanged);
  const redder = seen.filter(([as, without]) => greenness(as) < greenness(without)).length;
  assert.ok(seen.length > 20 && redder > 0.5 * seen.length, `${redder} of ${seen.length} places that blood covers are redder by it`);
  await seek(0);
  assert.equal(await blood(page).then(now => now?.shedMl ?? 0), 0);
  assert.equal(await covered(page), 0);
  await panel(page).waitFor({ state: 'detached', timeout: kPatience });
  assert.deepEqual(page.faults, []);
  await page.close();
});

test('a recording of a session that does not bleed has no blood', async () => {
  const page = await openRecording('lesson.mcap', '&t=8');
  assert.equal(await blood(page), null);
  assert.equal(await covered(page), 0);
  assert.equal(await panel(page).count(), 0);
  await page.close();
});
