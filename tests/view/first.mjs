// SPDX-License-Identifier: Apache-2.0
// How long it takes from starting the program to the first pictures of each dataset, in Chromium that runs. See browser.sh.
import { spawn } from 'node:child_process';
import { basename, resolve as absolute } from 'node:path';
import { chromium } from 'playwright-core';

const kMostMs = 2000;
const [program, cache, ...datasets] = process.argv.slice(2);
const options = (process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean);
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
let failures = 0;
for (const dataset of datasets) {
  const began = performance.now();
  const server = spawn(program, [...options, 'view', dataset, '--no-browser'],
    { stdio: ['ignore', 'pipe', 'ignore'], env: { ...process.env, XDG_CACHE_HOME: cache } });
  const address = await new Promise((resolve) => {
    server.stdout.once('data', (bytes) => resolve(String(bytes).trim()));
    server.once('exit', () => resolve(''));
  });
  const ready = Math.round(performance.now() - began);
  const context = await browser.newContext({ viewport: { width: 1366, height: 820 } });
  let first = NaN;
  let words = 'does not start';
  if (address) {
    const page = await context.newPage();
    await page.goto(address);
    // Formats without pictures show their captures' names instead.
    await page.waitForFunction(() => {
      const cards = [...document.querySelectorAll('.card')];
      return cards.length > 0 && (cards.some((card) => card.querySelector('img')?.naturalWidth > 0) || cards.every((card) => !card.querySelector('img')));
    }, null, { timeout: 120000 });
    first = Math.round(performance.now() - began);
    words = await page.textContent('.total');
    await page.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 600000 });
    words += `, all labels after ${((performance.now() - began) / 1000).toFixed(1)} s`;
  }
  const holds = first <= kMostMs;
  failures += holds ? 0 : 1;
  console.log(`${holds ? 'ok    ' : 'FAILED'} ${basename(absolute(dataset)).padEnd(16)} program ${String(ready).padStart(5)} ms, first pictures ${String(first).padStart(5)} ms; ${words}`);
  await context.close();
  server.kill('SIGTERM');
  await new Promise((resolve) => (server.exitCode !== null || server.signalCode !== null ? resolve() : server.once('exit', resolve)));
}
await browser.close();
process.exit(failures === 0 ? 0 : 1);
