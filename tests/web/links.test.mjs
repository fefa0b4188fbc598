// A lesson by link: one program is started, and people come with nothing but the links that it prints and
// that an instructor hands out.
import assert from 'node:assert/strict';
import fs from 'node:fs';
import { after, before } from 'node:test';
import { breaksNoRule, close, endAll, kPatience, launch, live, openBrowser, openPage, portOf, test, until, world } from './browser.mjs';

const { TROCAR_WORK } = process.env;
let links = {};
before(async () => {
  world.browser = await openBrowser();
  world.context = await world.browser.newContext({ viewport: { width: 900, height: 900 } });
  const ready = `${TROCAR_WORK}/server.port`;
  world.server = launch('trocar-server', ['--lesson', 'find-the-lump', '--listen', '127.0.0.1:0', '--browser-listen', '127.0.0.1:0', '--no-announce',
    '--journal', 'none', '--ready-file', ready]);
  await portOf(world.server, ready);
  await until('links', () => /\n {2}observer +http/.test(world.server.text));
  links = Object.fromEntries([...world.server.text.matchAll(/^ {2}(\w+) +(http\S+)$/gm)].map(m => [m[1], m[2]]));
}, { timeout: 120_000 });
after(() => endAll(world.browser), { timeout: 30_000 });

// Links as the page asks for them, with a code.
const ask = code => fetch(new URL('links', links.observer.split('#')[0]), { headers: { authorization: `Bearer ${code}` } });
const codeOf = role => links[role].match(/join=([^&]+)/)[1];

test('an instructor hands out links, and who has one needs a name and nothing else', async () => {
  assert.deepEqual(Object.keys(links), ['surgeon', 'assistant', 'instructor', 'observer']);
  assert.equal((await ask(codeOf('instructor'))).status, 403, 'nobody leads yet');
  const lead = await openPage(`${links.instructor}&name=Ivy`);
  await live(lead);
  await lead.getByRole('button', { name: 'Links for others' }).click();
  await lead.getByRole('img', { name: "QR code of the surgeon's link" }).waitFor({ timeout: kPatience });
  await breaksNoRule(lead, 'links');
  const shown = await lead.locator('.invite .link').textContent();
  assert.equal(shown, links.surgeon);
  await lead.getByRole('button', { name: 'observer', exact: true }).click();
  assert.equal(await lead.locator('.invite .link').textContent(), links.observer);
  const told = await (await ask(codeOf('instructor'))).json();
  assert.deepEqual(told.map(one => one.url), Object.values(links));
  for (const one of told) {
    assert.equal(one.modules.length, one.width ** 2);
    // The corners of the code, and the line of every second module between two of them.
    const row = i => one.modules.slice(i * one.width, (i + 1) * one.width), last = one.width - 7;
    assert.deepEqual([row(0).slice(0, 7), row(0).slice(last), row(one.width - 1).slice(0, 7)], Array(3).fill('1111111'));
    assert.match(row(6).slice(6, last + 1), /^(10)+1$/);
  }
  assert.equal((await ask(codeOf('surgeon'))).status, 403);
  const page = await openPage(shown);
  await page.getByLabel('Your name').fill('Sue');
  await page.getByRole('button', { name: 'Join' }).click();
  await live(page);
  await page.locator('.tray').waitFor({ timeout: kPatience });
  await lead.getByRole('button', { name: 'Manage Sue' }).waitFor({ timeout: kPatience });
  assert.deepEqual([...lead.faults, ...page.faults], []);
  await close(page);
  await close(lead);
  await until('who has left has no links', async () => (await ask(codeOf('instructor'))).status === 403);
});

test('the page ends with the session, and a page that cannot begin ends the start with what to do', async () => {
  const taken = launch('trocar-server', ['--listen', '127.0.0.1:0', '--no-announce', '--browser-listen', new URL(links.observer).host,
    '--journal', `${TROCAR_WORK}/none.mcap`]);
  assert.equal(await taken.ended, 5);
  assert.match(taken.text, /Address already in use[^]*--browser: .*--browser-listen names another port/);
  assert.ok(!fs.existsSync(`${TROCAR_WORK}/none.mcap`));
  world.server.kill('SIGINT');
  assert.equal(await world.server.ended, 0);
  await assert.rejects(ask(codeOf('observer')));
});
