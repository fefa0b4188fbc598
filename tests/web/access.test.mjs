// The page as people use it who see, hear or move otherwise: axe-core's rules on every screen, several
// views by keys alone, and what a phone shows.
import assert from 'node:assert/strict';
import { base, breaksNoRule as check, close, kPatience, link, live, prepare, test, until, world } from './browser.mjs';

const { TROCAR_WORK } = process.env;
prepare(['--lesson', 'along-the-line'], ['--insecure-loopback', '--recordings', `${TROCAR_WORK}/recordings`]);

async function open(url, width = 1280, height = 720, colorScheme = 'dark') {
  const context = await world.browser.newContext({ viewport: { width, height }, colorScheme, hasTouch: width < 600 });
  const page = await context.newPage();
  page.faults = [];
  page.on('pageerror', error => page.faults.push(error.message));
  await page.goto(url);
  return page;
}
const kSizes = [['desk', 1280, 720], ['phone', 390, 844]];

for (const scheme of ['dark', 'light'])
  for (const [size, width, height] of kSizes)
    test(`no rule of axe-core is broken: ${size}, ${scheme}`, async () => {
      const name = what => `${what}-${size}-${scheme}`;
      const start = await open(base(), width, height, scheme);
      await start.getByRole('heading').first().waitFor({ timeout: kPatience });
      await check(start, name('start'));
      await start.context().close();
      const page = await open(link(world.server.codes.instructor, 'instructor', `Ivy ${size} ${scheme}`), width, height, scheme);
      await live(page);
      const hand = world.server.hand(`Sam ${size} ${scheme}`, 'palpate');
      await page.getByRole('button', { name: /Manage Sam/ }).click({ timeout: kPatience });
      await page.getByRole('heading', { name: 'Cut along the line' }).waitFor({ timeout: kPatience });
      await check(page, name('lesson'));
      await page.getByRole('button', { name: 'End session' }).click();
      await check(page, name('asks'));
      await page.keyboard.press('Escape');
      hand.kill();
      await close(page);
      const key = world.web.text.match(/#recordings=(\w+)/)[1];
      const list = await open(`${base()}#recordings=${key}`, width, height, scheme);
      await list.getByRole('button', { name: /lesson\.mcap/ }).waitFor({ timeout: kPatience });
      await check(list, name('list'));
      await list.context().close();
      const debrief = await open(`${base()}#recordings=${key}&file=lesson.mcap&t=5`, width, height, scheme);
      await live(debrief);
      await debrief.locator('.take .none').waitFor({ state: 'detached', timeout: kPatience });
      await check(debrief, name('debrief'));
      await debrief.context().close();
    });

test('keys act wherever the focus is, H lists them, Esc leaves, and the colours are remembered', async () => {
  const page = await open(link(world.server.codes.instructor, 'instructor', 'Kay'));
  await live(page);
  const button = name => page.getByRole('button', { name, exact: true }), pressed = name => button(name).getAttribute('aria-pressed');
  await button('Leave').focus();
  await page.keyboard.press('l');
  await until('holds are hidden', async () => await pressed('Holds') === 'false');
  await page.keyboard.press('h');
  await page.getByRole('dialog', { name: 'Keys' }).getByText('who holds what').waitFor({ timeout: kPatience });
  await check(page, 'keys');
  await page.keyboard.press('Escape');
  await page.getByRole('dialog', { name: 'Keys' }).waitFor({ state: 'detached', timeout: kPatience });
  // What is typed is no key.
  await page.getByLabel('A line for everybody').fill('');
  await page.keyboard.type('lh');
  assert.equal(await pressed('Holds'), 'false');
  assert.equal(await page.getByRole('dialog').count(), 0);
  await button('Draw').click();
  await until('it draws', async () => await pressed('Draw') === 'true');
  await page.keyboard.press('Escape');
  await until('it draws no more', async () => await pressed('Draw') === 'false');
  const theme = () => page.evaluate(() => document.documentElement.dataset.theme);
  assert.equal(await theme(), 'dark');
  await button('Light').click();
  assert.equal(await theme(), 'light');
  await close(page);
  const again = await page.context().newPage();
  await again.goto(base());
  assert.equal(await again.evaluate(() => document.documentElement.dataset.theme), 'light');
  await again.context().close();
});

test('two and four views of one scene, by keys alone', async () => {
  const page = await open(link(world.server.codes.observer, 'observer', 'Olga'));
  await live(page);
  const hand = world.server.hand('Pat', 'palpate');
  await until('a hand', () => page.evaluate(() => window.trocar.replica.tools().length > 0));
  await page.locator('.stage canvas').focus();
  const shows = (what, count) => until(what, async () => await page.locator('.pane').count() === count);
  await page.keyboard.press('v');
  await shows('two views', 2);
  await page.keyboard.press('v');
  await shows('four views', 4);
  await check(page, 'four');
  // Each shows the organ: its part of the canvas has many colours.
  const colours = await page.evaluate(async () => {
    await new Promise(resolve => requestAnimationFrame(resolve));
    window.trocar.picture().draw(performance.now());
    const canvas = document.querySelector('.stage canvas'), copy = new OffscreenCanvas(canvas.width, canvas.height), context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    return [[0, 0], [1, 0], [0, 1], [1, 1]].map(([x, y]) => {
      const w = canvas.width >> 1, h = canvas.height >> 1, seen = context.getImageData(x * w, y * h, w, h).data;
      return new Set(Array.from({ length: seen.length >> 4 }, (_, i) => seen[i * 16] * 256 + seen[i * 16 + 1])).size;
    });
  });
  assert.ok(colours.every(n => n > 100), colours.join());
  // The keys move the one that was chosen, and no other.
  const places = () => page.evaluate(() => window.trocar.picture().places());
  await page.locator('.stage canvas').focus();
  await page.keyboard.press('3');
  const before = await places();
  await page.keyboard.press('ArrowLeft');
  const after = await places();
  assert.deepEqual(after.map((place, i) => place.join() === before[i].join()), [true, true, false, true]);
  // A view that goes along a tool moves with it.
  await page.getByRole('combobox', { name: 'View 2 shows' }).selectOption({ label: 'along the tool of Pat' });
  const from = (await places())[1];
  await until('it moves', async () => (await places())[1].join() !== from.join());
  await page.locator('.stage canvas').focus();
  await page.keyboard.press('v');
  await shows('one view', 0);
  assert.deepEqual(page.faults, []);
  hand.kill();
  await close(page);
});

test('on a phone there is one view', async () => {
  const page = await open(link(world.server.codes.observer, 'observer', 'Phil'), 390, 844);
  await live(page);
  await page.locator('.stage canvas').focus();
  await page.keyboard.press('v');
  assert.equal(await page.locator('.pane').count(), 0);
  assert.equal(await page.getByRole('combobox', { name: 'Views' }).count(), 0);
  await close(page);
});
