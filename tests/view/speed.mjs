// SPDX-License-Identifier: Apache-2.0
// Measures the page of `diorama view` on a large dataset in Chromium. See browser.sh.
import { spawn } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [program, dataset] = process.argv.slice(2);
const began = performance.now();
const since = () => `${Math.round(performance.now() - began)} ms`;
const server = spawn(program, [...(process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean), 'view', dataset, '--no-browser'],
  { stdio: ['ignore', 'pipe', 'inherit'] });
const address = await new Promise((resolve, reject) => {
  server.stdout.once('data', (bytes) => resolve(String(bytes).trim()));
  server.on('exit', (code) => reject(new Error(`view ended with ${code}`)));
});
console.log(`program is ready      ${since()}`);
const memory = () => `${Math.round(Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server.pid}/status`, 'utf8'))[1]) / 1024)} MiB`;
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
const page = await browser.newPage({ viewport: { width: 1366, height: 820 } });
const opened = performance.now();
const sinceOpened = () => `${Math.round(performance.now() - opened)} ms`;
await page.goto(address);
await page.waitForFunction(() => document.querySelector('.card img')?.naturalWidth > 0);
console.log(`page shows ${await page.textContent('.total')} with pictures ${sinceOpened()} after it was opened`);
await page.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 600000 });
console.log(`all labels are there  ${sinceOpened()} after it was opened, program ${memory()}`);

/** Frames of the screen while `act` goes on: how many, and the longest pause between two. */
async function frames(what, act) {
  await page.evaluate(() => {
    const times = (window.frameTimes = [performance.now()]);
    const tick = () => {
      times.push(performance.now());
      if (window.frameTimes === times) requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  });
  await act();
  const pauses = await page.evaluate(() => {
    const times = window.frameTimes;
    window.frameTimes = null;
    return times.slice(1).map((time, i) => time - times[i]).sort((a, b) => a - b);
  });
  const at = (share) => Math.round(pauses[Math.floor((pauses.length - 1) * share)]);
  console.log(`${what.padEnd(38)} ${pauses.length} frames, pauses between them: median ${at(0.5)}, 95 % ${at(0.95)}, longest ${at(1)} ms`);
}
await frames('scrolling by the wheel', async () => {
  await page.mouse.move(800, 400);
  for (let i = 0; i < 60; ++i) {
    await page.mouse.wheel(0, 400);
    await page.waitForTimeout(25);
  }
});
await frames('dragging the scroll bar to the end', async () => {
  for (let i = 1; i <= 40; ++i) {
    await page.evaluate((share) => {
      const grid = document.querySelector('.grid');
      grid.scrollTop = grid.scrollHeight * share;
    }, i / 40);
    await page.waitForTimeout(30);
  }
});
await page.waitForTimeout(500);
const clicks = [];
for (const name of await page.locator('.facets .name').all().then((all) => all.slice(1, 6))) {  // the first is in every capture
  const start = performance.now();
  const total = await page.textContent('.total b');
  await name.click();
  await page.waitForFunction((before) => document.querySelector('.total b').textContent !== before, total).catch(() => undefined);
  clicks.push(Math.round(performance.now() - start));
  await page.getByRole('button', { name: 'Clear all filters' }).first().click();
}
console.log(`a click on a class shows what is left after ${clicks.join(', ')} ms`);
console.log(`program at the end    ${memory()}, page ${Math.round((await page.evaluate(() => performance.memory?.usedJSHeapSize ?? 0)) / 2 ** 20)} MiB of objects`);
await browser.close();
server.removeAllListeners('exit');
server.kill('SIGTERM');
