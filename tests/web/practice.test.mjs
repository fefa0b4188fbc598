// Practice alone: a hall with room for one session, a page that gives it to whoever comes first, and a
// queue for the next.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { after, before } from 'node:test';
import { base, breaksNoRule, endAll, kPatience, launch, live, openBrowser, openPage, portOf, sleep, startWeb, test, until, world } from './browser.mjs';

const { TROCAR_WORK } = process.env;
const kIdle = 15;
let link = '', key = '', hall = null, port = 0;
const ports = first => `${first}, ${first + 1}`;
before(async () => {
  world.browser = await openBrowser();
  world.context = await world.browser.newContext({ viewport: { width: 900, height: 600 } });
  const first = 20_000 + 8 * (process.pid % 1000);
  port = first + 4;
  fs.writeFileSync(`${TROCAR_WORK}/hall.toml`, `listen = "127.0.0.1:${port}"\nkey = "${TROCAR_WORK}/hall.key"\nrecordings = "${TROCAR_WORK}/kept"\n` +
    `state = "${TROCAR_WORK}/hall-state"\nports = [${ports(first)}]\nfigures-ports = [${ports(first + 2)}]\nmost-sessions = 1\n\n[[offer]]\nname = "press"\nlesson = "find-the-lump"\n`);
  hall = launch('trocar-hall', ['--config', `${TROCAR_WORK}/hall.toml`]);
  await until('a hall', async () => hall.hasEnded || await fetch(`http://127.0.0.1:${port}/healthz`).then(r => r.ok, () => false));
  assert.ok(!hall.hasEnded, hall.text);
  world.web = await startWeb(0, ['--insecure-loopback', '--practice', 'press', '--hall', `127.0.0.1:${port}`, '--hall-key', `${TROCAR_WORK}/hall.key`,
    '--practice-idle', String(kIdle), '--practice-minutes', '7']);
  link = world.web.text.match(/practice +(\S+)/)[1];
  key = link.match(/practice=(\w+)/)[1];
}, { timeout: 120_000 });
after(async () => {
  hall?.kill('SIGTERM');
  await hall?.ended;
  await endAll(world.browser);
}, { timeout: 30_000 });

const sessions = async () => (await (await fetch(`http://127.0.0.1:${port}/sessions`)).json()).sessions;
async function begin(name) {
  const page = await openPage(link);
  await page.getByLabel('Your name').fill(name);
  await page.getByRole('button', { name: 'Begin' }).click();
  return page;
}
// A hand that moves by itself, however slow the machine is, until it is told to rest.
const moves = page => page.evaluate(() => { window.moving = setInterval(() => Object.assign(window.trocar.hands().input, { isOverScene: true, x: 200 + 100 * Math.random(), y: 200 }), 300); });
const rests = page => page.evaluate(() => clearInterval(window.moving));

test('the first has a session at once, the next sees how long it takes, and gets it after idleness', async () => {
  const first = await begin('Ann');
  await live(first);
  await first.locator('.tray').waitFor({ timeout: kPatience });
  await moves(first);
  await first.getByRole('heading', { name: 'Find the lump' }).waitFor({ timeout: kPatience });
  assert.equal((await sessions()).length, 1);
  const second = await begin('Ben');
  await second.getByText('You are next. It takes 7 minutes at most.').waitFor({ timeout: kPatience });
  await breaksNoRule(second, 'practice-waits');
  // Who does something keeps the session.
  await sleep(1.3 * 1000 * kIdle);
  assert.equal(await first.locator('.tray').count(), 1);
  await rests(first);
  await first.getByText('You did nothing for 15 seconds').waitFor({ timeout: kPatience });
  await breaksNoRule(first, 'practice-over');
  await live(second);
  await until('a place', () => second.evaluate(() => window.trocar.hands()?.own != null));
  assert.deepEqual(second.faults, []);
  // Each has a session of their own.
  const [one] = await sessions();
  assert.equal(one.people, 1);
  await second.close();
});

test('without the key of the link nobody gets a session', async () => {
  const ask = headers => fetch(`${base()}practice`, { headers }).then(answer => answer.status);
  assert.equal(await ask({}), 403);
  assert.equal(await ask({ authorization: `Bearer ${key.slice(1)}0` }), 403);
  assert.equal(await ask({ authorization: `Bearer ${key}` }), 200);
});

test('when the page ends its sessions end, too', async () => {
  world.web.kill('SIGTERM');
  await world.web.ended;
  await until('the hall is empty', async () => (await sessions()).length === 0);
});
