// What tests of the page share: the real programs, headless Chromium, and patience that ends. Whatever
// hangs ends as a failure with a name: each test and each hook has a limit.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';
import { after, afterEach, before, test as nodeTest } from 'node:test';

const { TROCAR_MODULES, TROCAR_BUILD, TROCAR_ROOT, TROCAR_WORK, TROCAR_CHROMIUM, TROCAR_RECORDING, TROCAR_PICTURES } = process.env;
const need = createRequire(`${TROCAR_MODULES}/`), { chromium } = need('playwright-core');
const kTags = ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice'];
export const kPatience = 60_000;
const kTestMs = 150_000, kStartMs = 120_000, kEndMs = 30_000;
const children = new Set();
export const world = { browser: null, context: null, server: null, web: null };

export const test = (name, run) => nodeTest(name, { timeout: kTestMs }, run);
export const sleep = ms => new Promise(resolve => setTimeout(resolve, ms));
export async function until(what, condition, patience = kPatience) {
  const end = Date.now() + patience;
  for (;;) {
    const value = await condition();
    if (value) return value;
    if (Date.now() > end) throw new Error(`${what}: has not come about within ${patience / 1000} s`);
    await sleep(100);
  }
}

export function launch(name, args) {
  const child = spawn(`${TROCAR_BUILD}/bin/${name}`, args, { stdio: ['ignore', 'pipe', 'pipe'] });
  child.text = '';
  child.ended = new Promise(resolve => child.on('exit', code => { child.hasEnded = true; children.delete(child); resolve(code); }));
  for (const stream of [child.stdout, child.stderr]) stream.on('data', data => { child.text += data; });
  children.add(child);
  return child;
}
export async function portOf(child, file) {
  await until(`${file} of ${child.spawnfile}`, () => fs.existsSync(file) || child.hasEnded);
  if (!fs.existsSync(file)) throw new Error(child.text);
  return Number(fs.readFileSync(file, 'utf8'));
}
async function startServer(name, more) {
  const ready = `${TROCAR_WORK}/${name}.port`, child = launch('trocar-server', ['--listen', '127.0.0.1:0', '--no-announce',
    '--journal', `${TROCAR_WORK}/${name}.mcap`, '--summary', `${TROCAR_WORK}/${name}.json`, '--ready-file', ready, ...more]);
  child.port = await portOf(child, ready);
  await until('join codes', () => /observer\s+\S{19}/.test(child.text));
  child.codes = Object.fromEntries([...child.text.matchAll(/^ {2}(\w+) +(\S{19}) /gm)].map(m => [m[1], m[2]]));
  child.hand = (hand, scene) => launch('trocar-client', ['--server', `127.0.0.1:${child.port}`, '--name', hand, '--no-render',
    '--join', child.codes.surgeon, '--script', `${TROCAR_ROOT}/deploy/scenes/${scene}.toml`]);
  return child;
}
export async function startWeb(port, more = []) {
  const ready = `${TROCAR_WORK}/web.port`, sessions = world.server ? ['--session', `127.0.0.1:${world.server.port}`] : [];
  fs.rmSync(ready, { force: true });
  const child = launch('trocar-web', ['--listen', `127.0.0.1:${port}`, '--ready-file', ready, ...sessions, ...more]);
  child.port = await portOf(child, ready);
  await until('links', () => /\n {2}(observer|practice)/.test(child.text));
  return child;
}
export const base = () => `http://127.0.0.1:${world.web.port}/`;
export const link = (code, role, name) => `${base()}#${new URLSearchParams({ join: code, role, name })}`;
export async function openPage(url) {
  const page = await world.context.newPage();
  page.faults = [];
  page.on('pageerror', error => page.faults.push(error.message));
  page.on('console', message => { if (message.type() === 'error') page.faults.push(message.text()); });
  await page.goto(url);
  return page;
}
export const live = page => page.waitForSelector('canvas[data-drawn]', { timeout: kPatience });
// Says goodbye, and waits until it was heard: a page that is closed at once takes it with it, and its
// name is then kept for a while.
export const close = async page => {
  await page.evaluate(() => new Promise(resolve => {
    const session = window.trocar?.session, socket = session?.socket;
    if (!socket || socket.readyState === WebSocket.CLOSED) return resolve();
    socket.addEventListener('close', resolve);
    window.setTimeout(resolve, 10_000);
    return session.leave();
  }));
  await page.close();
};

export const picture = async (page, name) => { if (TROCAR_PICTURES) await page.screenshot({ path: `${TROCAR_PICTURES}/${name}.png` }); };
// Fails with a line for each place that breaks a rule of axe-core.
export async function breaksNoRule(page, screen) {
  await picture(page, screen);
  await page.evaluate(fs.readFileSync(need.resolve('axe-core/axe.min.js'), 'utf8'));
  const found = await page.evaluate(async tags => {
    const result = await window.axe.run(document, { runOnly: tags });
    return result.violations.flatMap(v => v.nodes.map(n => `${v.id} (${v.impact}): ${n.target.join(' ')} ${n.any.concat(n.all, n.none).map(c => c.message).join('; ')}`));
  }, kTags);
  assert.deepEqual(found, [], `${screen}:\n${found.join('\n')}`);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
  assert.ok(wide <= 0, `${screen}: it is ${wide} pixels wider than the window`);
}

export const openBrowser = () => chromium.launch({ executablePath: TROCAR_CHROMIUM, timeout: kPatience, args: ['--no-sandbox', '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--disable-dev-shm-usage'] });
// The programs first: a browser that hangs must not keep them.
export async function endAll(browser) {
  for (const child of children) child.kill('SIGKILL');
  await browser?.close();
}

// trocar-web with a folder of recordings that holds one, and, unless `session` is null, a server with
// these arguments.
export async function startPrograms(session, web) {
  if (session) world.server = await startServer('lesson', session);
  fs.mkdirSync(`${TROCAR_WORK}/recordings`);
  fs.copyFileSync(TROCAR_RECORDING, `${TROCAR_WORK}/recordings/lesson.mcap`);
  world.web = await startWeb(0, web);
}
// Before the tests of a file: a browser and the programs.
export function prepare(session, web) {
  before(async () => {
    world.browser = await openBrowser();
    world.context = await world.browser.newContext({ viewport: { width: 900, height: 600 } });
    await startPrograms(session, web);
  }, { timeout: kStartMs });
  // What a failed test leaves would take the processor from the next one.
  afterEach(async () => {
    for (const context of world.browser?.contexts() ?? []) for (const page of context.pages()) await page.close();
  }, { timeout: kEndMs });
  after(() => endAll(world.browser), { timeout: kEndMs });
}
// However this process ends, no program outlives it.
process.on('exit', () => { for (const child of children) child.kill('SIGKILL'); });
