// SPDX-License-Identifier: Apache-2.0
// The page of a run of many writers: of each dataset the grid, every overlay that it has, every facet, a picture with its
// probe, the 3-D view, statistics; light and dark judged by axe; all by keyboard. In Chromium. See browser.sh.
import { spawn } from 'node:child_process';
import { mkdirSync, readFileSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [program, run, pictures, work] = process.argv.slice(2);
mkdirSync(pictures, { recursive: true });
const axe = readFileSync(`${work}/node_modules/axe-core/axe.min.js`, 'utf8');
let failures = 0;
function check(holds, what) {
  console.log(`${holds ? 'ok    ' : 'FAILED'} ${what}`);
  if (!holds) ++failures;
}
const server = spawn(program, [...(process.env.DIORAMA_OPTIONS ?? '').split(' ').filter(Boolean), 'view', run, '--no-browser'],
  { stdio: ['ignore', 'pipe', 'inherit'], env: { ...process.env, XDG_CACHE_HOME: work } });
const address = await new Promise((resolve, reject) => {
  server.stdout.once('data', (bytes) => resolve(String(bytes).trim()));
  server.once('exit', (code) => reject(new Error(`view ended with ${code}`)));
});
const site = new URL(address).origin;
const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
const faults = [];
async function newPage(scheme) {
  const context = await browser.newContext({ viewport: { width: 1366, height: 768 }, colorScheme: scheme });
  const page = await context.newPage();
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  await page.goto(address);
  await page.waitForSelector('.card');
  return page;
}
const hashOf = (page) => page.evaluate(() => location.hash);
const isRead = (page) => page.waitForFunction(() => document.querySelector('.status')?.hidden, null, { timeout: 60000 });

/** What an outside judge of accessibility says of what is shown. */
async function judge(page, where) {
  await page.evaluate(axe + ';0');
  const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ['violations'] }));
  check(violations.length === 0, `accessible: ${where}` +
    violations.map((one) => `\n         ${one.id}: ${one.help}: ${one.nodes[0].html.slice(0, 120)}`).join(''));
}

async function tryDataset(page, place, name) {
  await page.goto(`${site}/#/grid?dataset=${place}`);
  await page.reload();
  await page.waitForSelector('.card');
  await isRead(page);
  const info = await page.evaluate((at) => fetch(`/api/${at}/info`).then((answer) => answer.json()), place);
  const holds = new Set(info.holds);
  const said = [];
  const wrong = [];
  const want = (isTrue, what) => (isTrue ? said : wrong).push(what);
  const total = async () => Number((await page.textContent('.total b')).replaceAll(',', ''));
  const all = await total();
  want(all === info.captures.length && all > 0, `${all} captures`);
  want((await page.locator('.card').first().locator('a.picture').count()) === Math.max(1, info.cameras.length), `cards of ${info.cameras.length} cameras`);
  if (holds.has('color')) {
    await page.waitForFunction(() => [...document.querySelectorAll('.card img')].slice(0, 4).every((image) => image.naturalWidth > 0));
  }
  // Each facet filters, and clears again.
  let facets = 0;
  for (const section of await page.locator('.facets section').all()) {
    const title = await section.locator('h2').evaluate((head) => head.firstChild.textContent);
    if (title === 'Findings of lint') continue;
    ++facets;
    if (await section.locator('svg.bars').count()) {
      const from = section.locator('.ends input').first();
      await from.fill(await section.locator('.ends input').last().inputValue());
      await from.press('Enter');
    } else {
      await section.locator('input').first().focus();
      await page.keyboard.press(' ');
    }
    if (!(await hashOf(page)).includes('f.') || (await total()) > all) wrong.push(`filter "${title}"`);
    await page.goto(`${site}/#/grid?dataset=${place}`);
    if ((await total()) !== all) wrong.push(`clearing "${title}"`);
  }
  said.push(`${facets} facets`);
  // By keyboard from the grid into a picture.
  await page.locator('.grid').focus();
  await page.keyboard.press('ArrowRight');
  const active = await page.getAttribute('.grid', 'aria-activedescendant');
  want(active !== null && (await page.locator(`#${active}.chosen`).count()) === 1, 'arrow keys choose a card');
  await page.screenshot({ path: `${pictures}/${name}_grid.png` });
  await page.keyboard.press('Enter');
  await page.waitForSelector('.capture:not([hidden]) .objects h2');
  want((await hashOf(page)).startsWith(`#/capture/${info.captures[Math.min(1, all - 1)]}/`), 'Enter opens it');
  const canvas = page.locator('.capture:not([hidden]) canvas.big');
  const drawn = async () => {
    await page.waitForTimeout(150);
    return canvas.evaluate((element) => element.toDataURL());
  };
  const layers = await page.locator('.tools button[data-tool]:not([data-tool=colour])').evaluateAll((buttons) =>
    buttons.map((button) => ({ layer: button.dataset.tool, key: button.querySelector('kbd').textContent })));
  for (const { layer, key } of layers) {
    if ((await page.getAttribute(`[data-tool="${layer}"]`, 'aria-pressed')) === 'true') await page.keyboard.press(key);
  }
  // Captures may show no object, so that nothing is to be drawn.
  const labels = await page.evaluate(([at, number]) => fetch(`/api/${at}/capture/${number}`).then((answer) => answer.json()),
    [place, Number(/capture\/(\d+)/.exec(await hashOf(page))[1])]);
  const boxes = labels.frames[0].objects.filter((object) => object.box);
  for (const { layer, key } of layers) {
    const bare = await drawn();
    await page.keyboard.press(key);
    let over = await drawn();
    for (let wait = 0; over === bare && wait < 14; ++wait) over = await drawn();
    const isEmpty = boxes.length === 0 || (layer === 'cube' && !labels.frames[0].objects.some((object) => object.edges));
    if (over === bare && !isEmpty) wrong.push(`overlay ${layer}`);
    else said.push(layer);
    await page.keyboard.press(key);
    await drawn();
  }
  // The probe, without a mouse: to the middle of the smallest box.
  if (boxes.length > 0) {
    const box = boxes.map((object) => object.box).sort((a, b) => (a[2] - a[0]) * (a[3] - a[1]) - (b[2] - b[0]) * (b[3] - b[1]))[0];
    const aim = [Math.floor((box[0] + box[2]) / 2), Math.floor((box[1] + box[3]) / 2)];
    const probe = () => page.textContent('.capture:not([hidden]) .probe');
    await canvas.focus();
    await page.keyboard.press('Shift+ArrowRight');
    for (let step = 0; step < 2000; ++step) {
      const [x, y] = /pixel (\d+), (\d+)/.exec(await probe()).slice(1).map(Number);
      if (x === aim[0] && y === aim[1]) break;
      await page.keyboard.press(`Shift+Arrow${x < aim[0] ? 'Right' : x > aim[0] ? 'Left' : y < aim[1] ? 'Down' : 'Up'}`);
    }
    await page.waitForTimeout(300);
    const words = await probe();
    want(/object (?!none)/.test(words) && boxes.some((object) => words.includes(object.class || object.path)), `probe: ${words.replace(/\s+/g, ' ')}`);
    if (holds.has('distance_to_image_plane') || holds.has('distance_to_camera')) want(/depth [\d.]+ m|depth nothing/.test(words), 'depth');
    await page.keyboard.press('b');
    await page.keyboard.press('Enter');
    want((await hashOf(page)).includes('object='), 'Enter chooses what is there');
    await page.screenshot({ path: `${pictures}/${name}_capture.png` });
    await page.locator('.object').first().focus();
    await page.keyboard.press('Enter');
    want(await page.evaluate(() => document.activeElement?.classList.contains('object')), 'focus stays on the object');
  }
  if (holds.has('camera_pose')) {
    await page.keyboard.press('s');
    await page.waitForTimeout(300);
    want(await page.locator('canvas.space').isVisible(), '3-D');
    // Ids may count from picture to picture: what is chosen in one is the same in space.
    for (let i = 0; i < boxes.length; ++i) {
      await page.keyboard.press('ArrowDown');
      await page.waitForTimeout(60);
      const chosen = await page.getAttribute('.object[aria-pressed=true]', 'title');
      const object = boxes.find((one) => one.path === chosen);
      if (!object?.bounds) continue;
      const label = await page.getAttribute('canvas.space', 'aria-label');
      if (!label.includes(`chosen: ${object.class || object.path};`)) wrong.push(`${chosen} chosen in space: ${label}`);
    }
    if (place === 0) await page.screenshot({ path: `${pictures}/${name}_space.png` });
  }
  await page.getByRole('button', { name: 'Statistics' }).click();
  await page.waitForSelector('.page:not([hidden]) .facts', { timeout: 60000 });
  want((await page.textContent('.page:not([hidden]) .facts')).includes(String(all)), 'statistics');
  check(wrong.length === 0, `${name} (${info.format}): ${said.join(', ')}` + (wrong.length ? `; NOT: ${wrong.join(', ')}` : ''));
}

try {
  const page = await newPage('light');
  const names = await page.evaluate(() => fetch('/api/state').then((answer) => answer.json()).then((state) => state.datasets.map((one) => one.name)));
  for (const [place, name] of names.entries()) await tryDataset(page, place, name).catch((error) => check(false, `${name}: ${error.message}`));

  for (const scheme of ['light', 'dark']) {
    const judged = await newPage(scheme);
    await isRead(judged);
    await judge(judged, `grid, ${scheme}`);
    await judged.locator('.card a.picture').first().click();
    await judged.waitForSelector('.object');
    await judged.keyboard.press('ArrowDown');
    await judged.keyboard.press('s');
    await judged.waitForTimeout(500);
    await judge(judged, `picture, ${scheme}`);
    await judged.screenshot({ path: `${pictures}/${scheme}.png` });
    await judged.keyboard.press('?');
    await judge(judged, `keys, ${scheme}`);
    await judged.getByRole('button', { name: 'Close' }).click();
    for (const title of ['Compare', 'Statistics', 'Findings', 'Run']) {
      await judged.getByRole('button', { name: title, exact: true }).click();
      await judged.waitForTimeout(1200);
      await judge(judged, `${title}, ${scheme}`);
    }
    if (scheme === 'light') {
      // Findings lead to their places.
      await judged.getByRole('button', { name: 'Findings', exact: true }).click();
      await judged.locator('.page:not([hidden]) button.main').click();
      await judged.waitForSelector('.page:not([hidden]) .good, .page:not([hidden]) .bad', { timeout: 120000 });
      await judge(judged, 'what lint found');
      const jump = judged.locator('.page:not([hidden]) li button.link').first();
      if (await jump.count()) {
        const capture = /capture (\d+)/.exec(await jump.textContent())[1];
        await jump.click();
        await judged.waitForFunction((number) => location.hash.startsWith(`#/capture/${number}/`), capture);
        check(true, 'a finding leads to its capture');
      }
      await judged.getByRole('button', { name: 'Compare', exact: true }).click();
      await judged.waitForSelector('.capture:not([hidden]) h1');
      await judged.keyboard.press('2');
      await judged.waitForTimeout(300);
      const shown = () => judged.locator('.capture:not([hidden]) canvas.big').evaluate((element) => element.toDataURL());
      const before = await shown();
      for (let i = 0; i < 4; ++i) await judged.keyboard.press(',');
      check((await shown()) !== before, 'the divider of a comparison moves by keyboard');
      await judged.locator('.capture:not([hidden]) [data-head=next]').focus();
      await judged.keyboard.press('Enter');
      await judged.waitForTimeout(600);
      check(await judged.evaluate(() => document.activeElement?.dataset.head === 'next'), 'a button that is pressed keeps the focus');
    }
  }
  // Everything that can be used is reached by Tab, and shows that it is.
  const walked = await newPage('light');
  await isRead(walked);
  const wanted = await walked.evaluate(() => [...document.querySelectorAll('button, select, input, [tabindex="0"]')]
    .filter((one) => one.offsetParent !== null && !one.closest('dialog')).length);
  const reached = new Set();
  const unseen = new Set();
  for (let i = 0; i < wanted + 2; ++i) {
    await walked.keyboard.press('Tab');
    const [place, isSeen, tag] = await walked.evaluate(() => {
      const one = document.activeElement;
      return [[...document.querySelectorAll('*')].indexOf(one), getComputedStyle(one).outlineStyle !== 'none', one.tagName + '.' + one.className];
    });
    if (tag !== 'BODY.') reached.add(place);
    if (tag !== 'BODY.' && !isSeen) unseen.add(tag);
  }
  check(reached.size === wanted && unseen.size === 0, `Tab reaches ${reached.size} of ${wanted} controls` + (unseen.size ? `; unseen: ${[...unseen].join(', ')}` : ''));
  check(faults.length === 0, 'no fault in the page' + (faults.length ? ': ' + [...new Set(faults)].join(' | ') : ''));
} catch (error) {
  check(false, error.message);
} finally {
  await browser.close();
  server.removeAllListeners('exit');
  server.kill('SIGTERM');
}
process.exit(failures === 0 ? 0 : 1);
