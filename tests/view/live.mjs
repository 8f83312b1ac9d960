// SPDX-License-Identifier: Apache-2.0
// Watches the page of a run of two shards that goes on, in Chromium. See browser.sh.
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [program, job, pictures, work] = process.argv.slice(2);
mkdirSync(pictures, { recursive: true });
let failures = 0;
function check(holds, what) {
  console.log(`${holds ? 'ok    ' : 'FAILED'} ${what}`);
  if (!holds) ++failures;
}
const options = (process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean);
const folder = `${work}/run`;
const start = (more, output) => spawn(program, [...options, ...more], { stdio: ['ignore', output, 'ignore'] });
const shards = [1, 2].map((shard) => start(['run', job, '--output', folder, '--shard', `${shard}/2`], 'ignore'));
const ends = shards.map((shard) => new Promise((resolve) => shard.on('exit', resolve)));
while (!existsSync(`${folder}/dataset.json`)) await new Promise((resolve) => setTimeout(resolve, 200));
let server;
let address = '';
// Formats may have nothing to read before the first captures are there.
while (address === '') {
  server = start(['view', folder, '--no-browser'], 'pipe');
  address = await new Promise((resolve) => {
    server.stdout.once('data', (bytes) => resolve(String(bytes).trim()));
    server.once('exit', () => resolve(''));
  });
}
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
try {
  const page = await browser.newPage({ viewport: { width: 1366, height: 820 } });
  const faults = [];
  page.on('pageerror', (error) => faults.push(error.message));
  await page.goto(address);
  await page.getByRole('button', { name: 'Run', exact: true }).click();
  const text = () => page.textContent('.page:not([hidden])');
  await page.waitForFunction(() => /captures a minute/.test(document.querySelector('.page:not([hidden])')?.textContent ?? ''), null, { timeout: 240000 });
  await page.waitForFunction(() => document.querySelector('.last img')?.naturalWidth > 0, null, { timeout: 60000 });
  await page.waitForFunction(() => /slowest: /.test(document.querySelector('.page:not([hidden])').textContent), null, { timeout: 60000 });
  const words = await text();
  await page.screenshot({ path: `${pictures}/live.png`, fullPage: true });
  check(/\d+ of \d+/.test(words), 'done');
  check(/[\d.]+ captures a minute, \d+ (min|s) left/.test(words), 'rate and time left');
  check(/slowest: \w+/.test(words), `slowest stage (${/slowest: ([a-z ]+)/.exec(words)?.[1]})`);
  check((words.match(/\d+ MiB/g) ?? []).length === 2, 'memory of both shards');
  check(/shard-1-of-2/.test(words) && /shard-2-of-2/.test(words), 'both shards are named');
  const done = Number(/(\d+) of \d+/.exec(words)[1]);
  const last = await page.getAttribute('.last a', 'title');
  await page.waitForFunction((before) => Number(/(\d+) of \d+/.exec(document.querySelector('.page:not([hidden])').textContent)?.[1]) > before, done, { timeout: 120000 });
  await page.waitForFunction((before) => document.querySelector('.last a')?.title !== before, last, { timeout: 120000 });
  check(true, 'last pictures follow');
  await page.getByRole('button', { name: 'Captures' }).click();
  const count = async () => Number(/of ([\d,]+)/.exec(await page.textContent('.total'))[1].replaceAll(',', ''));
  const before = await count();
  await page.waitForFunction((old) => Number(/of ([\d,]+)/.exec(document.querySelector('.total').textContent)[1].replaceAll(',', '')) > old, before, { timeout: 120000 });
  check(true, 'the grid grows with the run');
  // What is looked at stays while captures come.
  await page.waitForFunction(() => document.querySelector('.facets .name input'), null, { timeout: 60000 });
  await page.locator('.facets .name input').first().check();
  const card = await page.locator('.card').first().elementHandle();
  await page.evaluate(() => {
    window.least = Infinity;
    new MutationObserver(() => {
      const total = document.querySelector('.total b');
      if (total) window.least = Math.min(window.least, Number(total.textContent.replaceAll(',', '')));
    }).observe(document.querySelector('.facets'), { childList: true, subtree: true });
  });
  const filtered = await count();
  await page.waitForFunction((old) => Number(/of ([\d,]+)/.exec(document.querySelector('.total').textContent)[1].replaceAll(',', '')) > old, filtered, { timeout: 120000 });
  const least = await page.evaluate(() => window.least);
  check(least > 0 && least < Infinity && (await card.evaluate((element) => element.isConnected)), `a filter and its cards stay while captures come (${least} at least)`);
  const codes = await Promise.all(ends);
  check(codes.every((code) => code === 0), 'both shards end well');
  await page.getByRole('button', { name: 'Run', exact: true }).click();
  await page.waitForFunction(() => !document.querySelector('progress') && /captures/.test(document.querySelector('.page:not([hidden])').textContent), null, { timeout: 30000 });
  await page.screenshot({ path: `${pictures}/live_ended.png`, fullPage: true });
  check(true, 'the page sees the end');
  const end = await text();
  if (/\nviews:/.test(end)) check(/Refused for/.test(end), 'refusals by reason');
  check(/at rest at the end of/.test(end), 'settle verdicts');
  check(faults.length === 0, 'no fault in the page' + (faults.length ? ': ' + faults.join(' | ') : ''));
} catch (error) {
  check(false, error.message);
} finally {
  await browser.close();
  server.removeAllListeners('exit');
  for (const child of [server, ...shards]) child.kill('SIGTERM');
  await Promise.all(ends);
}
process.exit(failures === 0 ? 0 : 1);
