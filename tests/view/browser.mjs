// SPDX-License-Identifier: Apache-2.0
// Tries the page of `diorama view` in Chromium. See browser.sh.
import { spawn } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [program, dataset, pictures, report, other] = process.argv.slice(2);
mkdirSync(pictures, { recursive: true });
let failures = 0;
function check(holds, what) {
  console.log(`${holds ? 'ok    ' : 'FAILED'} ${what}`);
  if (!holds) ++failures;
}

const server = spawn(program, [...(process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean), 'view', dataset, ...(other ? [other] : []), '--no-browser'],
  { stdio: ['ignore', 'pipe', 'inherit'] });
const address = await new Promise((resolve, reject) => {
  let text = '';
  server.stdout.on('data', (bytes) => {
    text += bytes;
    if (text.includes('\n')) resolve(text.trim());
  });
  server.on('exit', (code) => reject(new Error(`view ended with ${code}`)));
});
// Nobody asks this one.
const idle = spawn(program, [...(process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean), 'view', dataset, '--no-browser', '--idle-minutes', '1'],
  { stdio: 'ignore' });
const idleEnd = new Promise((resolve) => idle.on('exit', resolve));
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
const faults = [];
async function newPage(scheme = 'light') {
  const context = await browser.newContext({ viewport: { width: 1366, height: 820 }, colorScheme: scheme });
  const page = await context.newPage();
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  page.on('request', (request) => {
    const url = request.url();
    if (!/^(http:\/\/127\.0\.0\.1[:/]|file:|data:|blob:)/.test(url)) faults.push('asked elsewhere: ' + url);
  });
  page.on('dialog', (dialog) => {
    faults.push('a text of the dataset ran');
    void dialog.dismiss();
  });
  return page;
}

const hashOf = (page) => page.evaluate(() => location.hash);
const captureOf = async (page) => Number(/#\/capture\/(\d+)/.exec(await hashOf(page))[1]);

/** Cameras of a rig are close to each other: every name is to be read all the same, from wherever they are looked at. */
async function namesInSpace(page) {
  await page.evaluate(() => {
    const { fillText } = CanvasRenderingContext2D.prototype;
    window.namesDrawn = [];
    CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
      if (this.canvas.matches('.space')) window.namesDrawn.push({ text, left: x, right: x + this.measureText(text).width, y });
      fillText.call(this, text, x, y);
    };
  });
  const cameras = await page.locator('[aria-label="Cameras"] [role="tab"]').allTextContents();
  let overlaps = 0;
  let names = [];
  for (const key of ['ArrowRight', 'ArrowUp', 'ArrowUp', 't', 'ArrowLeft']) {
    await page.evaluate(() => (window.namesDrawn = []));
    await page.keyboard.press(key);
    names = await page.evaluate(() => window.namesDrawn);
    for (const [i, a] of names.entries()) {
      overlaps += names.slice(i + 1).filter((b) => Math.abs(a.y - b.y) < 12 && a.left < b.right && b.left < a.right).length;
    }
  }
  const isThere = cameras.every((camera) => names.some(({ text }) => text === camera));
  check(isThere && overlaps === 0, `names in space can be read (${names.length} of them, ${cameras.length} cameras)`);
}

/** Whoever opens the address of a page sees the same: what `read` says of it. */
async function sameElsewhere(page, read, what) {
  // Addresses follow four times a second.
  await page.waitForTimeout(600);
  const expected = await read(page);
  const twin = await newPage();
  await twin.goto(address);
  await twin.waitForSelector('.card');
  await twin.goto(page.url());
  await twin.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 120000 });
  await twin.waitForTimeout(800);
  const found = await read(twin);
  check(found === expected, `${what} stands in the address: ${expected}` + (found === expected ? '' : `, elsewhere ${found}`));
  await twin.close();
}

/** What the probe says of the canvas's middle. */
async function middlePixel(page) {
  const box = await page.locator('.capture:not([hidden]) canvas.big').boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForTimeout(200);
  return /pixel \d+, \d+/.exec(await page.textContent('.capture:not([hidden]) .probe'))?.[0];
}

/** The number of the card that is first in sight. */
const firstCard = (page) => page.evaluate(() => {
  const top = document.querySelector('.grid').getBoundingClientRect().top;
  const cards = [...document.querySelectorAll('.card')].map((card) => [card.getBoundingClientRect(), card.getAttribute('aria-label')]);
  return cards.filter(([box]) => box.bottom > top + box.height / 2).sort(([a], [b]) => a.top - b.top || a.left - b.left)[0][1];
});

/** Clips play, by key and button, at speeds, and stand in the address. */
async function tryClip(page, drawn) {
  const time = () => page.textContent('.player .time');
  const frameNow = async () => Number(/frame (\d+) of/.exec(await time())[1]);
  await page.keyboard.press('Home');
  await page.waitForTimeout(300);
  check((await frameNow()) === 1, 'home is the first frame of the clip');
  const still = await drawn();
  await page.keyboard.press(' ');
  await page.waitForTimeout(2500);
  check((await hashOf(page)).includes('play=1'), 'playing stands in the address');
  const moving = await frameNow();
  await page.screenshot({ path: `${pictures}/clip_playing.png` });
  await page.keyboard.press(' ');
  const stopped = await frameNow();
  check(moving > 1 && stopped > 1 && (await drawn()) !== still, `space plays (frame ${moving}) and stops (frame ${stopped})`);
  check(!(await hashOf(page)).includes('play=1') && (await captureOf(page)) > 0, 'a clip that has stopped stands in the address with its frame');
  await page.waitForTimeout(400);
  check((await frameNow()) === stopped, 'and stays there');
  await page.keyboard.press(',');
  await page.waitForTimeout(200);
  check((await frameNow()) === stopped - 1, 'comma goes one frame back');
  await page.keyboard.press('.');
  await page.waitForTimeout(200);
  check((await frameNow()) === stopped, 'the full stop one on');
  await page.click('.player button[aria-label=Play]');
  await page.waitForTimeout(600);
  await page.click('.player button[aria-label=Pause]');
  check((await frameNow()) !== stopped, 'the buttons play and stop it, too');
  // The second time it comes from the page's own store, at the speed of the clip.
  const passed = async (ms) => {
    await page.keyboard.press('Home');
    await page.waitForTimeout(200);
    await page.keyboard.press(' ');
    await page.waitForTimeout(ms);
    const frame = await frameNow();
    await page.keyboard.press(' ');
    await page.waitForTimeout(150);
    return frame - 1;
  };
  await passed(2500);
  const usual = await passed(600);
  await page.keyboard.press('<');
  await page.keyboard.press('<');
  check((await hashOf(page)).includes('speed=0.25'), 'the speed stands in the address');
  const slow = await passed(600);
  check(slow > 0 && slow < usual * 0.5, `0.6 s are ${usual} frames, at a quarter of the speed ${slow}`);
  await page.selectOption('.player select', '2');
  check((await hashOf(page)).includes('speed=2'), 'and is chosen from a list');
  await page.selectOption('.player select', '1');
  await page.locator('.player input[type=range]').evaluate((input) => {
    input.value = '2';
    input.dispatchEvent(new Event('input'));
  });
  await page.waitForTimeout(300);
  check((await frameNow()) === 3, 'the slider goes to a frame');
  await page.screenshot({ path: `${pictures}/clip.png` });
  const address = page.url();
  await page.reload();
  await page.waitForSelector('.player:not([hidden])');
  await page.waitForTimeout(400);
  check((await frameNow()) === 3 && page.url() === address, 'its address opens at that frame');
  await page.goto(address + (address.includes('?') ? '&' : '?') + 'play=1');
  await page.waitForTimeout(1200);
  check((await frameNow()) !== 3, 'an address that plays begins to play');
  await page.keyboard.press(' ');
  await page.keyboard.press('Home');
  await page.waitForTimeout(300);
}

/** A page that is told of clips what no run writes */
async function oddPage(odd) {
  const page = await newPage();
  await page.addInitScript((kind) => {
    const real = window.fetch.bind(window);
    window.fetch = async (path, options) => {
      const answer = await real(path, options);
      const number = /\/capture\/(\d+)$/.exec(String(path))?.[1];
      if (number === undefined || !answer.ok) return answer;
      const labels = await answer.json();
      if (kind === 'none') delete labels.clip;
      if (kind === 'single') labels.clip = { clip: 0, frame: 0, frames: 1, fps: 30 };
      if (kind === 'fast') labels.clip = { clip: 0, frame: Number(number), frames: 1e6, fps: 1e30 };
      return new Response(JSON.stringify(labels), { status: 200 });
    };
  }, odd);
  await page.goto(address);
  await page.waitForSelector('.card a.picture');
  await page.locator('.card a.picture').first().click();
  await page.waitForSelector('.capture:not([hidden]) .objects h2');
  return page;
}

/** Datasets of others may state anything of their clips. */
async function tryOddClips() {
  for (const kind of ['none', 'single']) {
    const page = await oddPage(kind);
    const isStill = async () => !(await hashOf(page)).includes('play=1') &&
      !(await page.locator('.capture:not([hidden]) .objects').evaluate((panel) => panel.inert));
    await page.goto(page.url() + (page.url().includes('?') ? '&' : '?') + 'play=1');
    await page.reload();
    await page.waitForSelector('.capture:not([hidden]) .objects h2');
    await page.waitForTimeout(300);
    check(await isStill(), `an address that plays what is no clip shows it (${kind})`);
    await page.keyboard.press(' ');
    await page.waitForTimeout(100);
    await page.keyboard.press(' ');
    await page.waitForTimeout(300);
    check(await isStill(), `and space leaves its panel alive (${kind})`);
    await page.close();
  }
  const page = await oddPage('fast');
  await page.keyboard.press(' ');
  const answers = page.waitForTimeout(1500).then(() => page.keyboard.press(' ')).then(() => page.waitForTimeout(300)).then(() => hashOf(page));
  const late = new Promise((resolve) => setTimeout(() => resolve(null), 20000));
  const hash = await Promise.race([answers, late]);
  check(hash !== null && !hash.includes('play=1'), 'a clip of 1e30 frames a second plays, and stops');
  answers.catch(() => undefined);
  // A page that hangs does not close either.
  if (hash !== null) await page.close();
}

try {
  const page = await newPage();
  const began = performance.now();
  await page.goto(address);
  await page.waitForSelector('.card img');
  await page.waitForFunction(() => document.querySelector('.card img')?.naturalWidth > 0);
  console.log(`       first card after ${Math.round(performance.now() - began)} ms`);
  const atOnce = await page.textContent('.total');
  await page.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 120000 });
  console.log(`       all labels read after ${Math.round(performance.now() - began)} ms`);
  check(!page.url().includes('token'), 'the token leaves the address');
  const total = await page.textContent('.total b');
  check(Number(total.replaceAll(',', '')) > 0, `the grid counts captures (${total})`);
  check(atOnce.startsWith(`${total} of`), `and has them all before labels are read (${atOnce})`);
  await page.waitForTimeout(800);
  await page.screenshot({ path: `${pictures}/grid.png` });
  check(await page.evaluate(() => [...document.querySelectorAll('.card')].every((card) => [...card.querySelectorAll('.picture, img')].every((part) =>
    part.getBoundingClientRect().bottom <= card.getBoundingClientRect().bottom + 1))), 'pictures lie whole in their cards');
  for (const key of ['c', 'l']) await page.keyboard.press(key);
  // The page itself knows its address at once; what watches it may hear later.
  check((await page.evaluate(() => location.hash)).includes('layers='), 'overlays stand in the address');
  await page.waitForTimeout(800);
  await page.screenshot({ path: `${pictures}/grid_overlays.png` });

  // What was scrolled to stands in the address, and is there when one comes back.
  const firstOfAll = await firstCard(page);
  await page.mouse.move(900, 500);
  for (let i = 0; i < 3; ++i) await page.mouse.wheel(0, 300);
  await page.waitForTimeout(400);
  if ((await firstCard(page)) !== firstOfAll) {
    await sameElsewhere(page, firstCard, 'the place in the grid');
    const place = await firstCard(page);
    // A click of the test's own would scroll to the card first.
    await page.evaluate(() => document.querySelector('.grid .card a.picture').click());
    await page.waitForSelector('.capture:not([hidden]) .objects h2');
    await page.goBack();
    await page.waitForTimeout(300);
    check((await firstCard(page)) === place, 'and who comes back finds it');
    await page.locator('.grid').focus();
    await page.keyboard.press('Home');
  } else {
    console.log('       the grid has nothing to scroll');
  }

  // A facet filters, and its count says how many stay.
  const first = page.locator('.facets section').first().locator('.name').first();
  await first.click();
  await page.waitForTimeout(300);
  const filtered = await page.textContent('.total b');
  check(Number(filtered.replaceAll(',', '')) <= Number(total.replaceAll(',', '')) && page.url().includes('f.class'),
    `a class filters (${total} to ${filtered})`);
  const same = await newPage();
  await same.goto(address);
  await same.waitForSelector('.card');
  await same.goto(page.url());
  await same.reload().catch(() => undefined);
  await same.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 120000 });
  check((await same.textContent('.total b')) === filtered, 'the address shows the same elsewhere');
  await same.close();
  await page.screenshot({ path: `${pictures}/grid_filtered.png` });
  await page.getByRole('button', { name: 'Clear all filters' }).first().click();
  const titles = await page.locator('.facets section h2').evaluateAll((heads) => heads.map((head) => head.firstChild.textContent));
  console.log(`       facets: ${titles.join(', ')}`);
  const number = async () => Number((await page.textContent('.total b')).replaceAll(',', ''));
  for (const section of await page.locator('.facets section:has(svg.bars)').all()) {
    const title = await section.locator('h2').evaluate((head) => head.firstChild.textContent);
    const bars = await section.locator('svg.bars').boundingBox();
    await section.scrollIntoViewIfNeeded();
    const place = await section.locator('svg.bars').boundingBox();
    await page.mouse.move(place.x + 2, place.y + bars.height / 2);
    await page.mouse.down();
    await page.mouse.move(place.x + bars.width * 0.45, place.y + bars.height / 2, { steps: 4 });
    await page.mouse.up();
    const left = await number();
    check((await hashOf(page)).includes('f.') && left <= Number(total.replaceAll(',', '')), `dragging filters by "${title}" (${left})`);
    await page.getByRole('button', { name: 'Clear all filters' }).first().click();
  }
  if (process.env.DIORAMA_VIEW_LINT !== 'no') {
    const lint = page.locator('.facets section', { hasText: 'Findings of lint' });
    await lint.getByRole('button', { name: 'Check the dataset' }).click();
    await lint.locator('.name').first().waitFor({ timeout: 300000 });
    const most = await lint.locator('.name').count();
    await lint.locator('.name').nth(most - 1).click();
    check((await hashOf(page)).includes('f.lint') && (await number()) > 0, `findings of lint filter (${await number()})`);
    await page.screenshot({ path: `${pictures}/grid_lint.png` });
    await page.getByRole('button', { name: 'Clear all filters' }).first().click();
  }

  await page.locator('.card a.picture').first().click();
  await page.waitForSelector('.capture .objects .object');
  await page.waitForTimeout(700);
  check(page.url().includes('#/capture/'), 'a card opens its picture');
  await page.locator('.object').first().click();
  await page.waitForSelector('.detail');
  const box = await page.locator('.capture:not([hidden]) canvas.big').boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.waitForTimeout(300);
  const probe = await page.textContent('.capture:not([hidden]) .probe');
  check(/pixel \d+, \d+/.test(probe), `the probe speaks: ${probe}`);
  await page.locator('.capture:not([hidden]) canvas.big').focus();
  await page.mouse.wheel(0, -2400);
  await page.waitForTimeout(300);
  await page.screenshot({ path: `${pictures}/capture_pixels.png` });
  check((await hashOf(page)).includes('object='), 'what is zoomed into leaves the chosen object');
  await sameElsewhere(page, middlePixel, 'the part of a picture');
  await page.keyboard.press('0');
  await page.waitForTimeout(600);
  check(!(await hashOf(page)).includes('view='), 'a whole picture has the short address');
  await page.screenshot({ path: `${pictures}/capture.png` });
  await page.keyboard.press('m');
  await page.waitForTimeout(500);
  await page.screenshot({ path: `${pictures}/capture_masks.png` });
  await page.keyboard.press('z');
  await page.waitForTimeout(300);
  await page.screenshot({ path: `${pictures}/capture_zoom.png` });
  await page.keyboard.press('0');
  await page.keyboard.press('m');
  await page.keyboard.press('d');
  await page.waitForTimeout(600);
  await page.screenshot({ path: `${pictures}/capture_depth.png` });
  await page.keyboard.press('d');
  // Every overlay that the dataset has changes the picture, by its key and by its button.
  const canvas = page.locator('.capture:not([hidden]) canvas.big');
  const drawn = async () => {
    await page.waitForTimeout(350);
    return canvas.evaluate((element) => element.toDataURL());
  };
  await page.keyboard.press('Escape');
  // The first frame of a clip has no flow back.
  await page.keyboard.press('ArrowRight');
  await page.waitForTimeout(300);
  const layers = await page.locator('.tools button[data-tool]:not([data-tool=colour])').evaluateAll((buttons) =>
    buttons.map((button) => ({ layer: button.dataset.tool, key: button.querySelector('kbd').textContent })));
  for (const { layer, key } of layers) {
    if ((await page.getAttribute(`[data-tool="${layer}"]`, 'aria-pressed')) === 'true') await page.keyboard.press(key);
  }
  const bare = await drawn();
  for (const { layer, key } of layers) {
    await page.keyboard.press(key);
    let over = await drawn();
    for (let wait = 0; over === bare && wait < 12; ++wait) over = await drawn();
    await page.screenshot({ path: `${pictures}/layer_${layer}.png` });
    await page.click(`[data-tool="${layer}"]`);
    check(over !== bare && (await drawn()) === bare, `overlay ${layer}: by key ${key} and by button`);
  }
  await page.keyboard.press('b');
  const byClass = await drawn();
  await page.keyboard.press('i');
  check((await drawn()) !== byClass && (await page.evaluate(() => location.hash)).includes('colour=instance'), 'colours by instance');
  await page.keyboard.press('i');
  if (layers.some(({ layer }) => layer === 'mask')) {
    await page.keyboard.press('m');
    const strong = await drawn();
    for (let i = 0; i < 4; ++i) await page.keyboard.press('[');
    check((await drawn()) !== strong && (await page.evaluate(() => location.hash)).includes('opacity=20'), 'opacity');
    for (let i = 0; i < 4; ++i) await page.keyboard.press(']');
    await page.keyboard.press('m');
  }
  if (await page.locator('.player:not([hidden])').count()) await tryClip(page, drawn);
  const before = page.url();
  await page.keyboard.press('ArrowRight');
  await page.waitForTimeout(400);
  check(page.url() !== before, 'arrow right goes to the next capture');
  await page.goBack();
  await page.waitForTimeout(400);
  check(page.url() === before, 'back goes back');
  await page.keyboard.press('ArrowDown');
  await page.waitForTimeout(200);
  check(page.url().includes('object='), 'arrow down goes through objects');
  if (await page.locator('button', { hasText: '3-D' }).last().isVisible()) {
    await page.keyboard.press('s');
    await page.waitForTimeout(700);
    await page.screenshot({ path: `${pictures}/space.png` });
    check(await page.locator('canvas.space').isVisible(), 'the 3-D view opens');
    check((await hashOf(page)).includes('space=1'), 'and stands in the address');
    await page.locator('canvas.space').focus();
    await namesInSpace(page);
    for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowLeft');
    await page.keyboard.press('+');
    await sameElsewhere(page, (one) => one.locator('canvas.space').evaluate((canvas) => canvas.toDataURL()).then((url) => `${url.length} bytes, ${[...url].reduce((sum, c) => (sum * 31 + c.charCodeAt(0)) | 0, 0)}`),
      'the place that space is looked at from');
    // From a place in space back to the object, or the camera, that lies there.
    const space = await page.locator('canvas.space').boundingBox();
    const here = await hashOf(page);
    let jumped = false;
    for (let y = 1; y < 12 && !jumped; ++y) {
      for (let x = 1; x < 12 && !jumped; ++x) {
        await page.mouse.click(space.x + (space.width * x) / 12, space.y + (space.height * y) / 12);
        jumped = (await hashOf(page)) !== here;
      }
    }
    check(jumped, 'a click in space goes to what is there');
    await page.keyboard.press('s');
  }
  await page.keyboard.press('?');
  await page.waitForTimeout(150);
  await page.screenshot({ path: `${pictures}/keys.png` });
  await page.getByRole('button', { name: 'Close' }).click();

  await page.getByRole('button', { name: 'Statistics' }).click();
  await page.waitForSelector('.page table', { timeout: 120000 });
  await page.locator('.page:not([hidden]) details summary').first().click();
  await page.waitForTimeout(200);
  await page.screenshot({ path: `${pictures}/stats.png` });
  await page.screenshot({ path: `${pictures}/stats_full.png`, fullPage: true });
  if (process.env.DIORAMA_VIEW_LINT !== 'no') {
    await page.getByRole('button', { name: 'Findings', exact: true }).click();
    await page.waitForSelector('.page:not([hidden]) .good, .page:not([hidden]) .bad', { timeout: 300000 });
    await page.screenshot({ path: `${pictures}/findings.png` });
  }
  await page.getByRole('button', { name: 'Run', exact: true }).click();
  await page.waitForSelector('.page:not([hidden]) h1');
  await page.waitForTimeout(400);
  await page.screenshot({ path: `${pictures}/run.png` });

  if (other) {
    await page.getByRole('button', { name: 'Compare', exact: true }).click();
    await page.waitForFunction(() => /of another colour|Every pixel is the same/.test(document.querySelector('.capture:not([hidden]) .objects')?.textContent ?? ''));
    await page.waitForFunction(() => /captures? differ|the same in the second/.test(document.querySelector('.capture:not([hidden]) .objects')?.textContent ?? ''), null, { timeout: 120000 });
    check(page.url().includes('#/compare/') && page.url().includes('other='), 'a comparison stands in the address');
    await page.waitForTimeout(500);
    await page.screenshot({ path: `${pictures}/compare_side.png` });
    const stage = await page.locator('.capture:not([hidden]) canvas.big').boundingBox();
    const shown = () => page.locator('.capture:not([hidden]) canvas.big').evaluate((canvas) => canvas.toDataURL());
    await page.keyboard.press('2');
    await page.waitForTimeout(300);
    const divided = await shown();
    await page.mouse.move(stage.x + stage.width / 2, stage.y + stage.height / 3);
    await page.mouse.down();
    await page.mouse.move(stage.x + stage.width / 4, stage.y + stage.height / 3, { steps: 4 });
    await page.mouse.up();
    check((await shown()) !== divided, 'the divider is dragged');
    await page.screenshot({ path: `${pictures}/compare_divider.png` });
    await page.waitForTimeout(400);
    check((await hashOf(page)).includes('divider=25'), 'and stands in the address');
    await page.keyboard.press('3');
    await page.waitForTimeout(300);
    await page.screenshot({ path: `${pictures}/compare_difference.png` });
    const place = page.url();
    await page.keyboard.press('ArrowRight');
    await page.waitForTimeout(500);
    check(page.url() !== place && page.url().includes('mode=difference'), 'arrow right goes to the next capture that differs');
    await page.reload();
    await page.waitForSelector('.capture:not([hidden]) .objects h2');
    check(page.url().includes('mode=difference'), 'the address of a comparison opens again');
    await page.keyboard.press('Escape');
    check(page.url().includes('#/grid'), 'escape leaves the comparison');
    await page.goBack();
    await page.waitForSelector('.capture:not([hidden]) .objects h2');
    check(page.url().includes('#/compare/'), 'and back comes back');
  }

  await tryOddClips();

  const dark = await newPage('dark');
  await dark.goto(address);
  await dark.waitForFunction(() => document.querySelector('.card img')?.naturalWidth > 0);
  await dark.waitForTimeout(500);
  await dark.screenshot({ path: `${pictures}/grid_dark.png` });
  await dark.locator('.card a.picture').first().click();
  await dark.waitForTimeout(900);
  await dark.screenshot({ path: `${pictures}/capture_dark.png` });

  // As the program opens the browser: from a file, which is another site.
  const opened = await newPage();
  writeFileSync(`${pictures}/open.html`, `<meta http-equiv='refresh' content='0;url=${address}'>`);
  await opened.goto(`file://${pictures}/open.html`);
  await opened.waitForSelector('.card');
  check(!opened.url().includes('token'), 'a file of the user opens the page');
  await opened.reload();
  await opened.waitForSelector('.card');
  check(true, 'which can be loaded anew');

  if (report) {
    const files = await newPage();
    await files.goto(`file://${report}/index.html`);
    await files.waitForFunction(() => document.querySelector('.card img')?.naturalWidth > 0);
    await files.locator('.card a.picture').first().click();
    await files.waitForSelector('.object');
    await files.keyboard.press('m');
    await files.waitForTimeout(700);
    await files.screenshot({ path: `${pictures}/report.png` });
    if (await files.locator('.player:not([hidden])').count()) {
      const time = () => files.textContent('.player .time');
      const before = await time();
      await files.keyboard.press(' ');
      await files.waitForTimeout(1500);
      check((await time()) !== before, 'clips play in a report');
      await files.keyboard.press(' ');
    }
    if (await files.locator('[data-tool=point]').count()) {
      await files.keyboard.press('k');
      await files.waitForTimeout(300);
      await files.screenshot({ path: `${pictures}/report_keypoints.png` });
    }
    await files.getByRole('button', { name: 'Statistics' }).click();
    await files.waitForSelector('.page table');
    check(true, 'a report opens without a server');
  }
  const code = await Promise.race([idleEnd, new Promise((resolve) => setTimeout(() => resolve('none'), 70000))]);
  check(code === 0, `what nobody asks ends by itself (exit code ${code})`);
  check(faults.length === 0, 'no fault in the page' + (faults.length ? ': ' + [...new Set(faults)].join(' | ') : ''));
} catch (error) {
  check(false, error.message);
  for (const fault of new Set(faults)) console.log('       ' + fault);
} finally {
  await browser.close();
  server.removeAllListeners('exit');
  server.kill('SIGTERM');
  idle.kill('SIGTERM');
}
process.exit(failures === 0 ? 0 : 1);
