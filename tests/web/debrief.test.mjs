// A recording in headless Chromium: what a person does with it besides playing.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { base, kPatience, live, openPage, prepare, test, until, world } from './browser.mjs';

const { TROCAR_WORK } = process.env;
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
  const folder = `${TROCAR_WORK}/recordings`, long_ago = new Date(Date.now() - 3_600_000);
  fs.utimesSync(`${folder}/lesson.mcap`, long_ago, long_ago); // as one that is written no more
  const broken = fs.readFileSync(`${folder}/lesson.mcap`);
  for (let i = 0; i < 64; i++) broken[(broken.length >> 1) + i] ^= 0x5a;
  fs.writeFileSync(`${folder}/broken.mcap`, broken);
  fs.utimesSync(`${folder}/broken.mcap`, long_ago, long_ago);
  const page = await open('lesson.mcap');
  await button(page, 'Check it').click();
  await page.locator('.check').getByText(/Verified: \d+ ticks/).waitFor({ timeout: kPatience });
  await page.reload();
  await page.locator('.check').getByText(/Verified: \d+ ticks/).waitFor({ timeout: kPatience }); // it is kept
  const said = await page.evaluate(async key => {
    for (;;) {
      const answer = await (await fetch('recordings/broken.mcap/check', { headers: { Authorization: `Bearer ${key}` } })).json();
      if (!['waiting', 'running'].includes(answer.state)) return answer;
      await new Promise(resolve => setTimeout(resolve, 200));
    }
  }, keyOf());
  assert.ok(['unknown', 'different'].includes(said.state), JSON.stringify(said));
  assert.ok(said.text.length > 10, JSON.stringify(said));
  assert.equal(await page.evaluate(async () => (await fetch('recordings/lesson.mcap/check')).status), 403);
  assert.deepEqual(page.faults.filter(text => !/403/.test(text)), []);
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
    for await (const { item } of window.trocar.recording.survey(-1)) if (item?.topic === '/claims') all++;
    return { known, end, all, last: window.trocar.recording.lastTick };
  });
  assert.ok(counts.known >= counts.all && counts.all > 0, JSON.stringify(counts));
  assert.ok(counts.end >= counts.last, JSON.stringify(counts));
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
