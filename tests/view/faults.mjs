// SPDX-License-Identifier: Apache-2.0
// What the page makes of masks that overlap, of a capture whose reader throws and of a dataset that cannot be opened, in
// Chromium. See browser.sh.
import { spawn } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [program, pictures, work] = process.argv.slice(2);
mkdirSync(pictures, { recursive: true });
let failures = 0;
function check(holds, what) {
  console.log(`${holds ? 'ok    ' : 'FAILED'} ${what}`);
  if (!holds) ++failures;
}
mkdirSync(`${work}/scripts`);
writeFileSync(`${work}/scripts/boxes.py`, `
import numpy as np
from diorama.plugins import Camera, Capture, Frame, Instance, Reader, Stored, param


class Boxes(Reader):
    """Three captures, of which the second cannot be read."""

    patterns = ["*.boxes"]
    count = param(3, "Captures.", least=1)

    def open(self, folder):
        if (folder / "bad.boxes").exists():
            raise ValueError("its table is <b>gone</b>")
        return Opened(self.count)


class Opened(Stored):
    format, holds, cameras = "boxes", ["color", "instance_id", "instances", "labels", "tight_boxes"], ["eye"]

    def __init__(self, count):
        self.captures = range(count)

    def read(self, place, wanted):
        if place == 1:
            return {}["<img src=x onerror=alert(1)>"]
        channels, masks, instances = {}, {}, []
        if "color" in wanted:
            channels["color"] = np.full((120, 160, 4), 120 + 20 * place, np.uint8)
        for i, (a, b, c, d) in enumerate([(20, 20, 100, 80), (60, 40, 140, 110), (70, 50, 90, 70)]):
            instances.append(Instance(i + 1, f"/{i}", {"class": ["plate", "cup", "spoon"][i]}, box=(a, b, c, d)))
            if "instance_id" in wanted:
                masks[i + 1] = ((a, b, c, d), np.ones((d - b, c - a), np.uint8))
        return Capture(place, frames=[Frame("eye", Camera(160, 120), instances=instances, channels=channels, masks=masks)])
`);
for (const name of ['good', 'bad']) {
  mkdirSync(`${work}/run/${name}`, { recursive: true });
  writeFileSync(`${work}/run/${name}/${name}.boxes`, '');
}
const server = spawn(program, [...(process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean), 'view', `${work}/run`, '--no-browser'],
  { stdio: ['ignore', 'pipe', 'inherit'], env: { ...process.env, DIORAMA_PYTHON_PATH: `${work}/scripts`, XDG_CACHE_HOME: work } });
const address = await new Promise((resolve, reject) => {
  server.stdout.once('data', (bytes) => resolve(String(bytes).trim()));
  server.once('exit', (code) => reject(new Error(`view ended with ${code}`)));
});
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
try {
  const page = await browser.newPage({ viewport: { width: 1366, height: 768 } });
  const faults = [];
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('dialog', (dialog) => {
    faults.push('a text of the dataset ran');
    void dialog.dismiss();
  });
  await page.goto(address);
  await page.waitForFunction(() => document.querySelectorAll('.card').length === 3 && document.querySelector('.status')?.hidden);
  await page.waitForTimeout(800);
  check((await page.textContent('.faults')).includes('its table is <b>gone</b>'), 'a dataset that cannot be opened is named');
  check((await page.locator('.card').nth(1).locator('.bad').count()) === 1, 'the card of a lost capture says so');
  await page.keyboard.press('m');
  await page.waitForTimeout(900);
  await page.screenshot({ path: `${pictures}/faults_grid.png` });
  await page.locator('.card a.picture').first().click();
  await page.waitForSelector('.object');
  await page.keyboard.press('b');
  await page.waitForTimeout(600);
  const canvas = page.locator('.capture:not([hidden]) canvas.big');
  const drawn = () => canvas.evaluate((element) => element.toDataURL());
  const masked = await drawn();
  await page.screenshot({ path: `${pictures}/faults_masks.png` });
  await page.keyboard.press('m');
  await page.waitForTimeout(300);
  check((await drawn()) !== masked, 'masks that overlap are drawn');
  await page.keyboard.press('m');
  const box = await canvas.boundingBox();
  const scale = Math.min(box.width / 160, box.height / 120);
  const at = (x, y) => [box.x + box.width / 2 + (x - 80) * scale, box.y + box.height / 2 + (y - 60) * scale];
  await page.mouse.move(...at(80, 60));
  await page.waitForTimeout(200);
  const probe = await page.textContent('.capture:not([hidden]) .probe');
  check(/object spoon/.test(probe) && /below cup, plate|below plate, cup/.test(probe), `the probe names all three there: ${probe}`);
  const seen = new Set();
  for (let i = 0; i < 3; ++i) {
    await page.keyboard.press('ArrowDown');
    await page.waitForTimeout(150);
    seen.add(/object=(\d+)/.exec(await page.evaluate(() => location.hash))?.[1]);
  }
  check(seen.size === 3, 'arrow down goes through the three that overlap');
  await page.screenshot({ path: `${pictures}/faults_probe.png` });
  await page.keyboard.press('Escape');
  await page.keyboard.press('ArrowRight');
  await page.waitForFunction(() => /KeyError/.test(document.querySelector('.capture:not([hidden]) .objects')?.textContent ?? ''));
  check(true, 'a lost capture says why');
  await page.screenshot({ path: `${pictures}/faults_lost.png` });
  await page.keyboard.press('ArrowRight');
  await page.waitForSelector('.object');
  check((await page.locator('.object').count()) === 3, 'and the next one is there');
  await page.getByRole('button', { name: 'Findings', exact: true }).click();
  await page.locator('.page:not([hidden]) button.main').click();
  await page.waitForSelector('.page:not([hidden]) .bad');
  const words = await page.textContent('.page:not([hidden])');
  check(words.includes('KeyError') && words.includes('its table is <b>gone</b>'), 'findings have both');
  await page.screenshot({ path: `${pictures}/faults_findings.png` });
  await page.getByRole('button', { name: 'Statistics' }).click();
  await page.waitForSelector('.page:not([hidden]) table');
  check(/pictures\s*2|2\s*pictures/.test(await page.textContent('.page:not([hidden])')), 'statistics are of the others');
  // While brightness comes in, a click that takes long is a click.
  const busy = await browser.newPage({ viewport: { width: 1366, height: 768 } });
  await busy.addInitScript(() => {
    const real = window.fetch.bind(window);
    window.fetch = (path, options) => /\/brightness\//.test(String(path))
      ? Promise.resolve(new Response(JSON.stringify({ from: 0, captures: 0, brightness: [] }), { status: 200 })) : real(path, options);
  });
  await busy.goto(address);
  await busy.waitForFunction(() => document.querySelector('.facets .name') && document.querySelector('.status')?.hidden);
  await busy.locator('.facets .name').first().hover();
  await busy.mouse.down();
  await busy.waitForTimeout(4000);
  await busy.mouse.up();
  await busy.waitForTimeout(300);
  check((await busy.evaluate(() => location.hash)).includes('f.class'), 'a slow click filters while the page is still reading');
  await busy.close();
  // Something as far away as numbers go must not make a grid of as many lines.
  const far = await browser.newPage({ viewport: { width: 1366, height: 768 } });
  await far.addInitScript(() => {
    const real = window.fetch.bind(window);
    window.fetch = async (path, options) => {
      const answer = await real(path, options);
      if (/\/info$/.test(String(path))) {
        const info = await answer.json();
        return new Response(JSON.stringify({ ...info, holds: [...info.holds, 'camera_pose', 'boxes_3d'] }), { status: 200 });
      }
      if (!/\/capture\/\d+$/.test(String(path)) || !answer.ok) return answer;
      const labels = await answer.json();
      labels.frames[0].world_from_camera = [1, 0, 0, 2, 0, 1, 0, 3, 0, 0, 1, 4];
      labels.frames[0].objects.forEach((object, i) => {
        object.id = 4294967295 - i;
        object.bounds = [[0, 0, 0], [1, 1, 1]];
        object.world_from_node = [1, 0, 0, 10 ** (5 * i), 0, 1, 0, -(10 ** (6 * i)), 0, 0, 1, 0];
      });
      return new Response(JSON.stringify(labels), { status: 200 });
    };
  });
  far.on('pageerror', (error) => faults.push(error.message));
  await far.goto(address);
  await far.waitForSelector('.card a.picture');
  await far.locator('.card a.picture').first().click();
  await far.waitForSelector('.object');
  await far.keyboard.press('s');
  const drawnFar = far.waitForFunction(() => /3-D view of 3 objects/.test(document.querySelector('canvas.space')?.getAttribute('aria-label') ?? ''), null, { timeout: 20000 })
    .then(() => far.waitForTimeout(300)).then(() => true, () => false);
  const isDrawn = await Promise.race([drawnFar, new Promise((resolve) => setTimeout(() => resolve(false), 22000))]);
  check(isDrawn, 'objects a million kilometres apart are shown in space');
  if (isDrawn) {
    await far.screenshot({ path: `${pictures}/faults_far.png` });
    // Ids may be as large as 32 bits are.
    await far.keyboard.press('ArrowDown');
    await far.reload();
    await far.waitForSelector('.object[aria-pressed=true]', { timeout: 5000 }).catch(() => undefined);
    check((await far.locator('.object[aria-pressed=true]').count()) === 1, 'an object of a large id stands in the address');
    await far.close();
  }
  check(faults.length === 0, 'no fault in the page' + (faults.length ? ': ' + faults.join(' | ') : ''));
} catch (error) {
  check(false, error.message);
} finally {
  await browser.close();
  server.removeAllListeners('exit');
  server.kill('SIGTERM');
}
process.exit(failures === 0 ? 0 : 1);
