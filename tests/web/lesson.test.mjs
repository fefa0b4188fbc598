// A lesson in headless Chromium, against the real programs: what an instructor does on the page, what
// others see of it, and that the recording of it verifies.
import assert from 'node:assert/strict';
import { copyFile, readFile, writeFile } from 'node:fs/promises';
import { after, before, test } from 'node:test';
import { close, endAll, kPatience, launch, live, openBrowser, portOf, sleep, until } from './browser.mjs';

const { TROCAR_ROOT, TROCAR_WORK, TROCAR_PICTURES } = process.env;
const kTest = { timeout: 120_000 };
let browser, context, server, web, hand, ivy, olga;

async function openPage(role, name) {
  const page = await context.newPage();
  page.faults = [];
  page.on('pageerror', error => page.faults.push(error.message));
  await page.goto(`http://127.0.0.1:${web.port}/#${new URLSearchParams({ join: server.codes[role], role, name })}`);
  return page;
}
const sees = (page, text) => page.locator('.events').getByText(text).first().waitFor({ timeout: kPatience });
const press = (page, name, exact = true) => page.getByRole('button', { name, exact }).click({ timeout: kPatience });
const tip = page => page.evaluate(() => window.trocar.replica.tools()[0]?.hand);
const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
async function manage(name, what) {
  const row = ivy.locator('.people li', { has: ivy.getByText(name, { exact: true }) });
  const more = row.getByRole('button', { name: `Manage ${name}` });
  if (await more.getAttribute('aria-expanded') !== 'true') await more.click({ timeout: kPatience });
  await row.getByRole('button', { name: what, exact: true }).click({ timeout: kPatience });
}
const picture = async (page, name) => { if (TROCAR_PICTURES) await page.screenshot({ path: `${TROCAR_PICTURES}/${name}.png` }); };

// A lesson that ships, with a picture of another one.
async function writeLesson(file) {
  const lessons = `${TROCAR_ROOT}/common/lesson/lessons`, text = await readFile(`${lessons}/follow-the-point.toml`, 'utf8');
  await copyFile(`${lessons}/move-the-rings.jpg`, `${TROCAR_WORK}/rings.jpg`);
  await writeFile(file, text.replaceAll(/^goal = .*$/gm, '$&\npicture = "rings.jpg"'));
  return file;
}

before(async () => {
  browser = await openBrowser();
  context = await browser.newContext({ viewport: { width: 1280, height: 720 } });
  server = launch('trocar-server', ['--listen', '127.0.0.1:0', '--no-announce', '--lesson', await writeLesson(`${TROCAR_WORK}/lesson.toml`),
    '--journal', `${TROCAR_WORK}/lesson.mcap`, '--ready-file', `${TROCAR_WORK}/server.port`]);
  server.port = await portOf(server, `${TROCAR_WORK}/server.port`);
  await until('join codes', () => /observer\s+\S{19}/.test(server.text));
  server.codes = Object.fromEntries([...server.text.matchAll(/^ {2}(\w+) +(\S{19}) /gm)].map(m => [m[1], m[2]]));
  web = launch('trocar-web', ['--listen', '127.0.0.1:0', '--session', `127.0.0.1:${server.port}`, '--insecure-loopback',
    '--ready-file', `${TROCAR_WORK}/web.port`]);
  web.port = await portOf(web, `${TROCAR_WORK}/web.port`);
  ivy = await openPage('instructor', 'Ivy');
  await live(ivy);
  olga = await openPage('observer', 'Olga');
  await live(olga);
}, { timeout: 120_000 });
after(() => endAll(browser), { timeout: 30_000 });

test('a stage shows its picture', kTest, async () => {
  const image = olga.getByAltText('What to do, as a picture');
  await image.waitFor({ timeout: kPatience });
  await until('it is drawn', () => image.evaluate(shown => shown.naturalWidth > 100));
  await picture(olga, 'lesson-picture');
});

test('a tool that is frozen stays, and goes back when it is released', kTest, async () => {
  hand = launch('trocar-client', ['--server', `127.0.0.1:${server.port}`, '--name', 'Sam', '--no-render', '--join', server.codes.surgeon,
    '--script', `${TROCAR_ROOT}/deploy/scenes/palpate.toml`]);
  await until('a hand', () => tip(ivy));
  const begin = await tip(ivy);
  await until('it moves', async () => apart(await tip(ivy), begin) > 0.005);
  await manage('Sam', 'Freeze tools');
  await sees(olga, 'Ivy keeps the tools of Sam where they are');
  await olga.getByText('held still by Ivy').waitFor({ timeout: kPatience });
  // The picture follows the frames, by however long.
  const shown = () => olga.evaluate(() => window.trocar.replica.shownTick), passes = async ticks => {
    const from = await olga.evaluate(() => window.trocar.replica.newestTick);
    await until(`${ticks} ticks are shown`, async () => await shown() > from + ticks);
  };
  await passes(500);
  const frozen = await tip(olga);
  await passes(1500);
  assert.ok(apart(await tip(olga), frozen) < 1e-5, 'it moved while it was frozen');
  await picture(ivy, 'frozen');
  await manage('Sam', 'Release tools');
  await until('it moves again', async () => apart(await tip(olga), frozen) > 0.005);
  await manage('Sam', 'Make let go');
  await sees(olga, 'Ivy has taken away what Sam holds');
});

const panel = page => page.getByRole('region', { name: 'Follow the point' });
const says = (page, text) => panel(page).getByText(text).first().waitFor({ timeout: kPatience });
const target = page => page.evaluate(() => window.trocar.replica.lessonTarget());

test('the panel of the lesson says what to do, and an instructor leads through its stages', kTest, async () => {
  for (const page of [ivy, olga]) {
    await says(page, 'Stage 1 of 2');
    await says(page, 'Keep the tip within the ring');
    await says(page, /of 1:30/);
    await says(page, /0\.3 N/);
    await panel(page).getByRole('progressbar', { name: 'How far the goal is' }).waitFor({ timeout: kPatience });
  }
  const before = await target(olga);
  await until('the point moves', async () => apart(await target(olga), before) > 0.002);
  assert.equal(await panel(olga).getByRole('button').count(), 0);
  await picture(olga, 'panel');
  await press(ivy, 'Next stage');
  await says(olga, 'Stage 2 of 2');
  await says(olga, 'Along a line: not reached, 0 points');
  const late = await openPage('observer', 'Late');
  await live(late);
  await says(late, 'Stage 2 of 2');
  await close(late);
  await sleep(1100);
  await press(ivy, 'Restart lesson');
  await press(ivy, 'Restart');
  await says(olga, 'Stage 1 of 2');
  for (const stage of ['Stage 2 of 2', 'The lesson is over: 0 of 100 points']) {
    await sleep(1100);
    await press(ivy, 'Next stage');
    await says(olga, stage);
  }
  assert.equal(await target(olga), null);
  await picture(olga, 'results');
});

test('time stands still for all, and goes slower', kTest, async () => {
  const tick = page => page.evaluate(() => window.trocar.replica.newestTick);
  assert.equal(await olga.getByRole('button', { name: 'Pause all' }).count(), 0);
  await press(ivy, 'Pause all');
  await olga.getByText('Ivy has paused the session.').first().waitFor({ timeout: kPatience });
  await until('no more frames', async () => {
    const then = await tick(olga);
    await sleep(300);
    return await tick(olga) === then;
  });
  const paused = await tick(olga);
  const guest = await openPage('observer', 'Newcomer');
  await live(guest);
  await sees(olga, 'Newcomer has joined');
  await sleep(1500);
  assert.equal(await tick(olga), paused);
  assert.equal(await olga.locator('.stage.old').count(), 0, 'the picture is as new as it can be');
  await picture(ivy, 'paused');
  await close(guest);
  await press(ivy, 'Go on');
  await until('it goes on', async () => await tick(olga) > paused + 100);
  await ivy.getByLabel('Time', { exact: true }).selectOption('0.25');
  await olga.getByText('Time is slow, 25 %').waitFor({ timeout: kPatience });
  await picture(ivy, 'slow');
  await ivy.getByLabel('Time', { exact: true }).selectOption('1');
  await olga.getByText('Time is slow, 25 %').waitFor({ state: 'detached', timeout: kPatience });
});

test('marks have names, and the organ returns to each', kTest, async () => {
  for (const name of ['before', 'after']) {
    await sleep(1100);
    await press(ivy, 'Mark organ');
    await ivy.getByRole('textbox', { name: 'Name, or nothing' }).fill(name);
    await press(ivy, 'Mark');
    await sees(olga, `the instructor has marked the organ as it is: "${name}"`);
  }
  await sleep(1100);
  await ivy.getByLabel('Which mark').selectOption('after');
  await press(ivy, 'Return to mark');
  await press(ivy, 'Return');
  await sees(olga, 'the instructor has returned the organ to the mark "after"');
});

test('lines and notes are read by all, and an observer has no other buttons', kTest, async () => {
  for (const name of ['Note', 'Draw', 'End session', 'Close to newcomers']) assert.equal(await olga.getByRole('button', { name }).count(), 0, name);
  assert.equal(await olga.getByRole('button', { name: /^Manage/ }).count(), 0);
  await olga.getByRole('textbox', { name: 'A line for everybody' }).fill('Where is <b>the</b> vein?');
  await press(olga, 'Send');
  await sees(ivy, 'Olga: Where is <b>the</b> vein?');
  await ivy.getByRole('textbox', { name: 'A line for everybody' }).fill('Look at this cut later.');
  await press(ivy, 'Note');
  await sees(olga, 'note by Ivy: Look at this cut later.');
});

test('what an instructor draws is on everybody\'s organ until it is wiped', kTest, async () => {
  await press(ivy, 'Draw');
  const box = await ivy.locator('.stage canvas').boundingBox();
  await ivy.mouse.move(box.x + box.width * 0.42, box.y + box.height * 0.5);
  await ivy.mouse.down();
  for (let i = 1; i <= 24; i++) await ivy.mouse.move(box.x + box.width * (0.42 + i * 0.006), box.y + box.height * (0.5 + 0.04 * Math.sin(i / 3)));
  await ivy.mouse.up();
  const triangles = page => page.evaluate(() => window.trocar.replica.drawing().positions.length / 9);
  await until('a line', async () => await triangles(olga) > 10);
  await until('both see the same', async () => await triangles(olga) === await triangles(ivy));
  await picture(ivy, 'drawn');
  const late = await openPage('observer', 'Late');
  await live(late);
  await until('a late one sees it', async () => await triangles(late) === await triangles(ivy));
  await close(late);
  await press(ivy, 'Draw');
  await press(ivy, 'Wipe');
  await until('it is wiped', async () => await triangles(olga) === 0);
});

test('the view that was given is followed', kTest, async () => {
  await manage('Ivy', 'Give the view');
  await press(olga, 'View of Ivy');
  await ivy.locator('.stage canvas').focus();
  for (let i = 0; i < 6; i++) await ivy.keyboard.press('ArrowLeft');
  const eye = page => page.evaluate(() => window.trocar.picture().view().eye);
  await until('it is the same view', async () => apart(await eye(ivy), await eye(olga)) < 1e-4);
  await manage('Ivy', 'End the view');
  await olga.getByRole('button', { name: 'View of Ivy' }).waitFor({ state: 'detached', timeout: kPatience });
});

test('a closed session lets in who is admitted, and a renamed one is seen by the new name', kTest, async () => {
  await press(ivy, 'Close to newcomers');
  const guest = await openPage('observer', 'Guest');
  await guest.getByRole('alert').getByText('closed to newcomers').waitFor({ timeout: kPatience });
  await press(ivy, 'Admit Guest');
  await sees(ivy, 'Ivy lets Guest in');
  await guest.reload();
  await live(guest);
  await manage('Guest', 'Rename');
  await ivy.getByRole('textbox', { name: 'New name' }).fill('Gustav');
  await press(ivy, 'Rename', true).catch(() => ivy.locator('.ask').getByRole('button', { name: 'Rename' }).click());
  await olga.locator('.people b', { hasText: 'Gustav' }).waitFor({ timeout: kPatience });
  await manage('Gustav', 'Put out');
  await picture(ivy, 'put-out');
  await ivy.getByRole('textbox', { name: /Reason/ }).fill('Come back after the break.');
  await ivy.locator('.ask').getByRole('button', { name: 'Put out' }).click();
  await guest.getByRole('alert').getByText('Come back after the break.').waitFor({ timeout: kPatience });
  await sees(olga, 'Ivy has put Gustav out: Come back after the break.');
  await guest.close();
});

test('the session ends in the instructor\'s words, and its recording verifies and tells of the lesson', kTest, async () => {
  if (TROCAR_PICTURES) {
    await ivy.setViewportSize({ width: 390, height: 844 });
    await sleep(500);
    await ivy.screenshot({ path: `${TROCAR_PICTURES}/phone.png`, fullPage: true });
    await ivy.setViewportSize({ width: 1280, height: 720 });
  }
  await press(ivy, 'End session');
  await press(ivy, 'End for everybody');
  await olga.getByRole('alert').getByText('Ivy has ended the session').waitFor({ timeout: kPatience });
  assert.equal(await server.ended, 0, server.text);
  assert.equal(await hand.ended, 0, hand.text);
  const verify = launch('trocar-journal', ['verify', `${TROCAR_WORK}/lesson.mcap`]);
  assert.equal(await verify.ended, 0, verify.text);
  await ivy.goto(`http://127.0.0.1:${web.port}/`);
  await ivy.reload();
  await ivy.locator('input[type=file]').setInputFiles(`${TROCAR_WORK}/lesson.mcap`);
  await live(ivy);
  for (const text of ['Ivy keeps the tools of Sam where they are', 'note by Ivy: Look at this cut later.', 'Ivy has paused the session', 'the instructor has marked the organ as it is: "before"', 'Stage 2 of 2: In depth', 'Ivy has ended the session']) await sees(ivy, text);
  // The panel says which stage was on at the time that is shown.
  const at = async tick => ivy.evaluate(to => window.trocar.player.seek(to), tick);
  const told = await ivy.evaluate(() => window.trocar.log.stages.map(({ tick, stage }) => ({ tick, name: stage.isOver ? 'over' : stage.stage + 1 })));
  const stages = told.filter((one, i) => one.name !== told[i - 1]?.name); // a hint is told, too
  assert.deepEqual(stages.map(one => one.name), [1, 2, 1, 2, 'over']);
  await at(stages[3].tick + 50);
  await says(ivy, 'Stage 2 of 2');
  await until('a point', async () => await target(ivy) !== null);
  await at(stages[2].tick + 50);
  await says(ivy, 'Stage 1 of 2');
  await at(stages[4].tick + 50);
  await says(ivy, 'The lesson is over');
  await until('no point', async () => await target(ivy) === null);
  await at(0);
  await panel(ivy).waitFor({ state: 'detached', timeout: kPatience });
  await picture(ivy, 'debrief');
  assert.deepEqual(ivy.faults, []);
});
