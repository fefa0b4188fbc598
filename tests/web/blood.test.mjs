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
  await page.getByRole('button', { name: 'Next stage' }).click();
  await page.getByRole('list', { name: 'Results' }).getByText(/^blood lost: \d+\.\d ml$/).waitFor({ timeout: kPatience });
  assert.equal(await page.evaluate(() => window.trocar.replica.mismatches), 0);
  assert.deepEqual(page.faults, []);
  hand.kill();
  suction.kill();
  await close(page);
});

// How green the picture is for its red, at the places on the canvas (0 to 1) where blood covers the organ
// when it is shown; the median.
const greenness = (page, places) => page.evaluate(async places => {
  await new Promise(resolve => requestAnimationFrame(resolve));
  window.trocar.picture().draw(performance.now());
  const canvas = document.querySelector('.stage canvas'), copy = new OffscreenCanvas(canvas.width, canvas.height), context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const all = places.map(([x, y]) => context.getImageData(Math.floor(x * canvas.width), Math.floor(y * canvas.height), 1, 1).data)
    .map(([r, g]) => g / Math.max(1, r)).sort((a, b) => a - b);
  return all[all.length >> 1];
}, places);

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
  // Where most light is lost in blood, on the side that is seen.
  const places = await page.evaluate(() => {
    const { replica } = window.trocar, picture = window.trocar.picture(), lips = replica.lips(), normals = replica.normals(), positions = replica.positions();
    const camera = picture.panes[0].camera, out = [];
    for (let i = 0; i < lips.length / 4; i++) {
      if (lips[i * 4 + 3] < 110) continue;
      const [x, y, z] = positions.subarray(i * 3), at = camera.position.clone().set(x, y, z), towards = camera.position.clone().sub(at).normalize();
      if (towards.x * normals[i * 3] + towards.y * normals[i * 3 + 1] + towards.z * normals[i * 3 + 2] < 0.4) continue;
      at.project(camera);
      out.push([(at.x + 1) / 2, (1 - at.y) / 2]);
    }
    return out;
  });
  assert.ok(places.length > 20, `${places.length} wet places`);
  const wet = await greenness(page, places);
  await seek(0);
  assert.equal(await blood(page).then(now => now?.shedMl ?? 0), 0);
  assert.equal(await covered(page), 0);
  await panel(page).waitFor({ state: 'detached', timeout: kPatience });
  const dry = await greenness(page, places);
  // Blood reflects a fifth of the green, for its red, that parenchyma does.
  assert.ok(wet < 0.8 * dry, `wet ${wet}, dry ${dry}`);
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
