// Somebody holds instruments in headless Chromium, by mouse, keys and touch, in a session of the real
// programs; the recording of it verifies.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { close, kPatience, link, live, openPage, picture, prepare, sleep, test, until, world, breaksNoRule } from './browser.mjs';

const { TROCAR_BUILD, TROCAR_WORK } = process.env;
prepare(['--organ', 'liver'], ['--insecure-loopback']);

const toolOf = (page, slot) => page.evaluate(s => window.trocar.replica.tools().find(tool => tool.slot === s), slot);
async function middle(page) {
  const box = await page.locator('.stage canvas').boundingBox();
  return [box.x + box.width / 2, box.y + box.height * 0.45];
}
async function surgeon(name) {
  const page = await openPage(link(world.server.codes.surgeon, 'surgeon', name));
  await live(page);
  await until('a place in the session', () => page.evaluate(() => window.trocar.hands()?.own != null));
  return { page, slot: await page.evaluate(() => window.trocar.hands().own * 2) };
}

test('a surgeon at a page pushes, feels it, and changes instrument', async () => {
  const { page, slot } = await surgeon('Sue');
  const [x, y] = await middle(page);
  await page.mouse.move(x - 40, y);
  await page.mouse.move(x, y);
  await until('a tool over the organ', () => toolOf(page, slot));
  await page.keyboard.down('f');
  const pressed = await until('a force', async () => {
    const tool = await toolOf(page, slot);
    return tool && tool.contactNodes > 0 && Math.hypot(...tool.forceN) > 0.02 ? tool : false;
  });
  assert.equal(pressed.verb, 1);
  assert.ok(pressed.hasClaim);
  await picture(page, 'hand-pushes');
  await page.keyboard.up('f');
  await until('it lets go', async () => (await toolOf(page, slot)).verb === 0);
  await page.getByRole('button', { name: 'probe', exact: true }).click();
  await page.locator('.tray').getByText('right hand: probe').waitFor({ timeout: kPatience });
  await until('the session knows', () => page.evaluate(s => window.trocar.hands().hands[0].listed.endsWith(',1'), slot));
  await breaksNoRule(page, 'hand-page');
  assert.deepEqual(page.faults, []);
  await close(page);
});

test('the other hand cuts by the left button, and what is hidden lets go', async () => {
  const { page, slot } = await surgeon('Cut');
  const [x, y] = await middle(page);
  await page.mouse.move(x, y);
  await page.keyboard.press('g');
  await page.locator('.tray h2', { hasText: 'Your left hand' }).waitFor({ timeout: kPatience });
  await page.mouse.move(x - 60, y);
  await until('the left tool', () => toolOf(page, slot + 1));
  await page.mouse.down();
  await sleep(400);
  for (let i = 0; i <= 30; ++i) {
    await page.mouse.move(x - 60 + 4 * i, y);
    await sleep(30);
  }
  await until('a wound', () => page.evaluate(() => window.trocar.replica.rest().some((value, i) => i % 4 === 3 && value >= 1)));
  await picture(page, 'hand-cuts');
  // Another window comes to the front while the button is held.
  await page.evaluate(() => window.dispatchEvent(new Event('blur')));
  await page.locator('.tray').getByText('your instruments have let go').waitFor({ timeout: kPatience });
  await until('nothing is held', async () => (await toolOf(page, slot + 1)).verb === 0);
  await page.mouse.up();
  assert.deepEqual(page.faults, []);
  await close(page);
});

test('a grasp lifts tissue, and one who watches may hold nothing', async () => {
  const { page, slot } = await surgeon('Grasp');
  const [x, y] = await middle(page);
  await page.mouse.move(x - 80, y + 40);
  await page.mouse.down();
  await until('a grasp', async () => {
    const tool = await toolOf(page, slot);
    return tool && tool.verb === 2 && tool.hasClaim && tool.contactNodes > 0;
  });
  for (let i = 0; i < 15; ++i) {
    await page.mouse.move(x - 80, y + 40 - 3 * i);
    await sleep(30);
  }
  await until('it pulls', async () => Math.hypot(...(await toolOf(page, slot)).forceN) > 0.05);
  await picture(page, 'hand-lifts');
  await page.mouse.up();
  // Where somebody holds nobody else does, and is told who.
  await page.mouse.move(x - 80, y + 40);
  await sleep(500);
  await page.mouse.down();
  await until('a grasp again', async () => (await toolOf(page, slot)).hasClaim);
  const other = await surgeon('Other');
  await other.page.mouse.move(x - 80, y + 40);
  await until('another tool', () => toolOf(other.page, other.slot));
  await other.page.mouse.down();
  await other.page.locator('.banner', { hasText: 'Grasp' }).waitFor({ timeout: kPatience });
  await picture(other.page, 'hand-refused');
  await other.page.mouse.up();
  await page.mouse.up();
  await close(other.page);
  const watcher = await openPage(link(world.server.codes.observer, 'observer', 'Olga'));
  await live(watcher);
  assert.equal(await watcher.locator('.tray').count(), 0);
  // A page that says all the same that it holds a tool is put out.
  await watcher.evaluate(() => window.trocar.session.sample(0, { isDue: true, verb: 1, tip: [0, 0, 0], orientation: [0, 0, 0, 1] }));
  await until('its connection is cut', () => watcher.evaluate(() => window.trocar.session.awaySince > 0));
  await close(page);
});

test('one finger holds and lifts, two turn the view', async () => {
  const touching = await world.browser.newContext({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  const page = await touching.newPage();
  await page.goto(link(world.server.codes.surgeon, 'surgeon', 'Tina'));
  await live(page);
  await until('a place in the session', () => page.evaluate(() => window.trocar.hands()?.own != null));
  const slot = await page.evaluate(() => window.trocar.hands().own * 2), [x, y] = await middle(page);
  const fingers = await touching.newCDPSession(page);
  const touch = (type, ...points) => fingers.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([px, py], id) => ({ x: px, y: py, id })) });
  await touch('touchStart', [x, y]);
  await until('a grasp', async () => {
    const tool = await toolOf(page, slot);
    return tool && tool.verb === 2 && tool.hasClaim;
  });
  await touch('touchMove', [x, y - 20]);
  await until('it pulls', async () => Math.hypot(...(await toolOf(page, slot)).forceN) > 0.02);
  await picture(page, 'hand-touches');
  await touch('touchEnd');
  await until('it lets go', async () => (await toolOf(page, slot)).verb === 0);
  const eye = () => page.evaluate(() => window.trocar.picture().view().eye), before = await eye();
  await touch('touchStart', [x, y], [x + 60, y]);
  for (let i = 1; i <= 5; ++i) await touch('touchMove', [x + 10 * i, y], [x + 60 + 10 * i, y]);
  await touch('touchEnd');
  await until('the view has turned', async () => (await eye()).some((value, i) => Math.abs(value - before[i]) > 0.005));
  await close(page);
  await touching.close();
});

test('a pose that is no number ends the session of who says it', async () => {
  const { page } = await surgeon('Nan');
  await page.evaluate(() => window.trocar.session.sample(0, { isDue: true, verb: 0, tip: [NaN, 0, 0], orientation: [0, 0, 0, 1] }));
  await page.locator('.fault', { hasText: 'ToolSample' }).waitFor({ timeout: kPatience });
  await page.close();
});

test('keys alone bring an instrument to the organ and press it', async () => {
  const { page, slot } = await surgeon('Kay');
  await page.keyboard.down('k');
  await sleep(200);
  await page.keyboard.up('k');
  await until('a tool over the organ', () => toolOf(page, slot));
  await page.keyboard.down('f');
  await until('a force', async () => {
    const tool = await toolOf(page, slot);
    return tool.contactNodes > 0 && Math.hypot(...tool.forceN) > 0.02;
  });
  await page.keyboard.up('f');
  assert.deepEqual(page.faults, []);
  await close(page);
});

test('a gamepad moves, uses and changes hands, and rumbles with the force', async () => {
  const { page, slot } = await surgeon('Pia');
  // An object of the shape that the Gamepad API gives: the standard mapping has 4 axes and 17 buttons.
  await page.evaluate(() => {
    const pad = { id: 'Pad (STANDARD GAMEPAD)', index: 0, connected: true, mapping: 'standard', timestamp: 0, axes: [0, 0, 0, 0],
      buttons: Array.from({ length: 17 }, () => ({ pressed: false, touched: false, value: 0 })), rumbles: [],
      vibrationActuator: { playEffect: async (kind, effect) => { pad.rumbles.push([kind, effect]); return 'complete'; } } };
    Object.assign(window, { pad });
    navigator.getGamepads = () => [null, pad, null, null];
  });
  const press = (button, value = 1) => page.evaluate(([i, v]) => { window.pad.buttons[i] = { pressed: v > 0.5, touched: v > 0, value: v }; }, [button, value]);
  const stick = (axis, value) => page.evaluate(([i, v]) => { window.pad.axes[i] = v; }, [axis, value]);
  await stick(0, -0.8);
  const before = await until('a tool over the organ', () => toolOf(page, slot));
  await until('it goes to the left', async () => (await toolOf(page, slot)).tip[0] < before.tip[0] - 0.005);
  await stick(0, 0.05);
  await press(7, 0.9);
  await until('a grasp', async () => (await toolOf(page, slot)).verb === 2 && (await toolOf(page, slot)).hasClaim);
  await stick(1, -0.5);
  await until('it pulls and rumbles', async () => Math.hypot(...(await toolOf(page, slot)).forceN) > 0.1 && await page.evaluate(() => window.pad.rumbles.length > 3));
  await stick(1, 0);
  const [kind, effect] = await page.evaluate(() => window.pad.rumbles.at(-1));
  assert.equal(kind, 'dual-rumble');
  assert.ok(effect.duration <= 250 && effect.strongMagnitude > 0 && effect.strongMagnitude <= 1);
  await picture(page, 'hand-pad');
  await press(7, 0);
  await until('it lets go', async () => (await toolOf(page, slot)).verb === 0);
  await press(6);
  await until('it pushes', async () => (await toolOf(page, slot)).verb === 1);
  await press(6, 0);
  await press(4);
  await page.locator('.tray').getByText('right hand: toothed').waitFor({ timeout: kPatience });
  await press(5);
  await page.locator('.tray h2', { hasText: 'Your left hand' }).waitFor({ timeout: kPatience });
  const eye = () => page.evaluate(() => window.trocar.picture().view().eye), from = await eye();
  await press(14);
  await until('the view turns', async () => Math.abs((await eye())[0] - from[0]) > 0.01);
  // A pad that is pulled out does nothing more.
  await page.evaluate(() => { navigator.getGamepads = () => [null, null, null, null]; });
  await until('it is forgotten', () => page.evaluate(() => window.trocar.hands().pad.name === ''));
  assert.deepEqual(page.faults, []);
  await close(page);
});

test('the recording of it verifies', async () => {
  world.server.kill('SIGINT');
  await world.server.ended;
  const said = execFileSync(`${TROCAR_BUILD}/bin/trocar-journal`, ['verify', `${TROCAR_WORK}/lesson.mcap`], { encoding: 'utf8' });
  assert.match(said, /verified/i);
});
