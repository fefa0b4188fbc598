// Measures the page with a recording of an hour: node hour.mjs, with the variables of run_web.sh and
// TROCAR_HOUR, the recording (trocar-sim makes it from hour.toml). Seeks by HTTP ranges, then plays the
// whole of it at 16 times and looks at the memory meanwhile. Writes hour.md into TROCAR_WORK.
import fs from 'node:fs';
import { endAll, live, openBrowser, sleep, startWeb, world } from './browser.mjs';

const { TROCAR_HOUR, TROCAR_WORK } = process.env;
const kSeeks = 20, kSpeed = 16, kSampleMs = 15_000;
const kPlayMs = Number(process.env.TROCAR_SECONDS ?? 225) * 1000; // an hour at 16 times
const mb = bytes => (bytes / 1e6).toFixed(1);
const of = (values, share) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(values.length * share))];

const folder = `${TROCAR_WORK}/recordings`;
fs.mkdirSync(folder, { recursive: true });
fs.linkSync(TROCAR_HOUR, `${folder}/hour.mcap`);
const browser = await openBrowser();
try {
  world.web = await startWeb(0, ['--insecure-loopback', '--recordings', folder]);
  const key = world.web.text.match(/#recordings=(\w+)/)[1];
  const page = await (await browser.newContext({ viewport: { width: 900, height: 600 } })).newPage(), cdp = await page.context().newCDPSession(page);
  await cdp.send('Performance.enable');
  const heap = async () => {
    await cdp.send('HeapProfiler.collectGarbage');
    const { metrics } = await cdp.send('Performance.getMetrics');
    return metrics.find(m => m.name === 'JSHeapUsedSize').value;
  };
  const begin = performance.now();
  await page.goto(`http://127.0.0.1:${world.web.port}/#recordings=${key}&file=hour.mcap`);
  await live(page);
  const openMs = performance.now() - begin, early = await page.evaluate(() => window.trocar.traffic.bytes);
  const seekAll = () => page.evaluate(async count => {
    const { player, recording, traffic } = window.trocar, out = [];
    let seed = 11;
    for (let i = 0; i < count; i++) {
      seed = (seed * 16807) % 2147483647;
      const before = { ...traffic };
      await player.seek(recording.firstTick + (seed / 2147483647) * (recording.lastTick - recording.firstTick));
      out.push({ ms: player.seekMs, bytes: traffic.bytes - before.bytes, requests: traffic.requests - before.requests });
    }
    return out;
  }, kSeeks);
  const seeks = await seekAll(), times = seeks.map(s => s.ms);
  const samples = [];
  await page.evaluate(async speed => {
    const { player, recording } = window.trocar;
    await player.seek(recording.firstTick);
    player.speed = speed;
    player.play();
  }, kSpeed);
  const start = performance.now();
  while (performance.now() - start < kPlayMs) {
    await sleep(kSampleMs);
    samples.push({ minute: await page.evaluate(() => window.trocar.player.tick / 60_000), heap: await heap(), module: await page.evaluate(() => window.trocar.replica.memoryBytes) });
  }
  const wrong = await page.evaluate(() => window.trocar.replica.mismatches), last = samples.at(-1);
  const lines = ['| figure | measured |', '|---|---|',
    `| recording | ${mb(fs.statSync(TROCAR_HOUR).size)} MB |`,
    `| from link to picture | ${openMs.toFixed(0)} ms, ${mb(early)} MB read |`,
    `| ${kSeeks} seeks by HTTP ranges, median | ${of(times, 0.5).toFixed(0)} ms |`,
    `| the same, 95 % | ${of(times, 0.95).toFixed(0)} ms |`,
    `| bytes of a seek, median | ${(of(seeks.map(s => s.bytes), 0.5) / 1000).toFixed(0)} kB |`,
    `| JavaScript heap after ${samples[0].minute.toFixed(0)} min played at ${kSpeed} times | ${mb(samples[0].heap)} MB |`,
    `| the same after ${last.minute.toFixed(0)} min | ${mb(last.heap)} MB |`,
    `| memory of the module then | ${mb(last.module)} MB |`,
    `| frames whose checksum was wrong | ${wrong} |`];
  fs.writeFileSync(`${TROCAR_WORK}/hour.md`, `${lines.join('\n')}\n`);
  console.log(lines.join('\n'));
  console.log(samples.map(s => `${s.minute.toFixed(1)} min ${mb(s.heap)} MB`).join(', '));
} finally {
  await endAll(browser);
}
