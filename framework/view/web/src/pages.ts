// SPDX-License-Identifier: Apache-2.0
// Statistics, findings, and what is known of the run.
import { App, datasetOf } from './app';
import { Finding, RunState, get, pictureAddress } from './data';
import { button, clear, el, on, plural, svg } from './dom';
import { css } from './layers';

interface Histogram {
  low: number;
  high: number;
  counts: number[];
  mean: number;
  least: number;
  most: number;
}

interface ClassStats {
  objects: number;
  pictures: number;
  box_side: Histogram | null;
  visible: Histogram | null;
  truncation: Histogram | null;
  distance_m: Histogram | null;
  places: number[][];
  views: number[][] | null;
}

interface Stats {
  captures: number;
  pictures: number;
  cameras: { [name: string]: number };
  splits: { [name: string]: number };
  sizes: { [name: string]: number };
  classes: { [name: string]: ClassStats };
  objects_per_picture: Histogram | null;
  brightness: Histogram | null;
  suspicious: { [what: string]: { count: number; first: string[] } };
  findings: number;
}

function bars(title: string, histogram: Histogram | null, scale: number, unit: string): HTMLElement | null {
  if (!histogram) return null;
  let counts = histogram.counts;
  const last = counts.findLastIndex((count) => count > 0) + 1;
  // Fifty bins for five objects would be a thin corner.
  if (counts.length > 30) counts = counts.slice(0, Math.max(last, 10));
  const step = (histogram.high - histogram.low) / histogram.counts.length;
  const [width, height] = [300, 110];
  const most = Math.max(1, ...counts);
  const says = (value: number) => String(Math.round(value * scale * 100) / 100);
  const drawing = svg('svg', { viewBox: `0 0 ${width} ${height + 18}`, role: 'img', class: 'chart',
    'aria-label': `${title}, mean ${says(histogram.mean)} ${unit}` });
  counts.forEach((count, i) => {
    const tall = count === 0 ? 0 : Math.max(1.5, (count / most) * (height - 6));
    drawing.append(svg('rect', { x: (i * width) / counts.length + 0.5, y: height - tall, height: tall,
      width: Math.max(0.5, width / counts.length - 1), class: 'bar' },
      svg('title', {}, `${says(histogram.low + i * step)} to ${says(histogram.low + (i + 1) * step)} ${unit}: ${count.toLocaleString('en')}`)));
  });
  drawing.append(svg('line', { x1: 0, x2: width, y1: height, y2: height, class: 'axis' }),
    svg('text', { x: 0, y: height + 14 }, says(histogram.low)),
    svg('text', { x: width, y: height + 14, 'text-anchor': 'end' }, `${says(histogram.low + counts.length * step)} ${unit}`));
  return el('figure', {}, el('figcaption', {}, title,
    el('small', {}, `mean ${[says(histogram.mean), unit].join(' ').trim()}, ${says(histogram.least)} to ${says(histogram.most)}`)), drawing);
}

function heatMap(title: string, rows: number[][], width: number): HTMLElement {
  const most = Math.max(1, ...rows.flat());
  const cell = width / rows[0].length;
  const tall = Math.min(cell, 0.75 * cell + 3);
  const drawing = svg('svg', { viewBox: `0 0 ${width} ${tall * rows.length}`, role: 'img', class: 'heat', 'aria-label': title });
  rows.forEach((row, y) => row.forEach((count, x) => {
    drawing.append(svg('rect', { x: x * cell, y: y * tall, width: cell - 0.7, height: tall - 0.7, class: 'cell',
      'fill-opacity': count === 0 ? 0.05 : 0.15 + (0.85 * count) / most }, svg('title', {}, count.toLocaleString('en'))));
  }));
  return el('figure', {}, el('figcaption', {}, title), drawing);
}

/** "capture 3, cam_0" as a way there. */
function jumpTo(app: App, name: string): HTMLElement {
  const found = /^capture (\d+), (.*)$/.exec(name);
  if (!found) return el('span', {}, name);
  return jump(app, name, app.state.dataset, Number(found[1]), found[2]);
}

/** To a capture of a dataset, to the picture of a camera and to an object by its path, where they are known. */
function jump(app: App, text: string, dataset: number, capture: number, camera = '', path = ''): HTMLElement {
  return button(text, 'Show it', () => {
    app.labels(capture, dataset).then((labels) => {
      const frame = Math.max(0, labels.frames.findIndex((one) => one.camera === camera));
      const object = labels.frames[frame]?.objects.find((one) => one.path === path)?.id ?? 0;
      app.go({ page: 'capture', dataset, capture, frame, object });
    }, () => app.go({ page: 'capture', dataset, capture, frame: 0, object: 0 }));
  }, { class: 'link' });
}

/** JSON that the program may have to make first; the page is asked again until it is there. */
export class Awaited {
  private path = '';
  private timer = 0;
  value: any = null;
  fault = '';

  want(path: string, key: string, changed: () => void): boolean {
    if (this.path === path + key) return this.value !== null || this.fault !== '';
    window.clearTimeout(this.timer);
    this.path = path + key;
    this.value = null;
    this.fault = '';
    const ask = async (): Promise<void> => {
      const asked = this.path;
      try {
        const value = await get(path);
        if (asked !== this.path) return;
        if (typeof value?.fault === 'string') this.fault = value.fault;
        else this.value = value;
      } catch (error) {
        if (asked !== this.path) return;
        this.fault = (error as Error).message;
      }
      if (this.value === null && this.fault === '') this.timer = window.setTimeout(() => void ask(), 700);
      else changed();
    };
    void ask();
    return false;
  }
}

export function waitingFor(what: string): HTMLElement {
  return el('p', { class: 'empty', role: 'status' }, el('span', { class: 'spin' }), what);
}

export class StatsPage {
  readonly element = el('main', { class: 'page', tabindex: '0' });
  private readonly stats = new Awaited();

  show(app: App): void {
    const path = `/api/${app.state.dataset}/stats`;
    if (!this.stats.want(path, String(app.site.generation), () => this.show(app))) {
      clear(this.element);
      this.element.append(waitingFor('Counting: every picture is read once …'));
      return;
    }
    clear(this.element);
    if (this.stats.fault !== '') {
      this.element.append(el('p', { class: 'bad' }, this.stats.fault));
      return;
    }
    const stats = this.stats.value as Stats;
    const facts = (title: string, counts: { [name: string]: number }) => {
      const words = Object.entries(counts).map(([name, count]) => `${name} ${count.toLocaleString('en')}`);
      return words.length === 0 ? null : el('div', {}, el('small', {}, title), el('span', {}, words.join(', ')));
    };
    this.element.append(el('h1', {}, 'Statistics'), el('div', { class: 'facts' },
      el('div', {}, el('small', {}, 'captures'), el('b', {}, stats.captures.toLocaleString('en'))),
      el('div', {}, el('small', {}, 'pictures'), el('b', {}, stats.pictures.toLocaleString('en'))),
      facts('cameras', stats.cameras), facts('splits', stats.splits), facts('sizes', stats.sizes)));
    const table = el('table', {}, el('thead', {}, el('tr', {}, ...['Class', 'Objects', 'Pictures', 'Box side', 'Visible',
      'Outside', 'Distance'].map((word) => el('th', { scope: 'col' }, word)))));
    const body = el('tbody');
    const mean = (histogram: Histogram | null, scale: number, unit: string) =>
      histogram ? `${(histogram.mean * scale).toFixed(1)} ${unit}` : '–';
    const classes = Object.entries(stats.classes).sort((a, b) => b[1].objects - a[1].objects);
    for (const [name, own] of classes) {
      const dot = el('em');
      dot.style.background = css(app.palette.ofClass(name));
      body.append(el('tr', {}, el('th', { scope: 'row' }, dot, button(name === '' ? '(no label)' : name, 'Show them',
        () => app.go({ page: 'grid', facets: new Map([['class', JSON.stringify([name])]]) }), { class: 'link' })),
        el('td', {}, own.objects.toLocaleString('en')), el('td', {}, own.pictures.toLocaleString('en')),
        el('td', {}, mean(own.box_side, 100, '%')), el('td', {}, mean(own.visible, 100, '%')),
        el('td', {}, mean(own.truncation, 100, '%')), el('td', {}, mean(own.distance_m, 1, 'm'))));
    }
    table.append(body);
    if (classes.length > 0) this.element.append(el('h2', {}, 'Classes'), table);
    const charts = [bars('Objects in a picture', stats.objects_per_picture, 1, ''), bars('Brightness of pictures', stats.brightness, 100, '%')];
    this.element.append(el('div', { class: 'figures' }, ...charts));
    const suspicious = Object.entries(stats.suspicious);
    if (suspicious.length > 0) this.element.append(el('h2', {}, 'Pictures to look at'));
    for (const [what, list] of suspicious) {
      const more = list.count - list.first.length;
      this.element.append(el('p', {}, el('b', {}, `${what}: ${list.count.toLocaleString('en')} `),
        ...list.first.flatMap((name) => [jumpTo(app, name), ' ']), more > 0 && `and ${more.toLocaleString('en')} more`));
    }
    if (classes.length > 0) this.element.append(el('h2', {}, 'By class'));
    for (const [name, own] of classes) {
      const details = el('details', {}, el('summary', {}, name === '' ? '(no label)' : name,
        el('small', {}, plural(own.objects, 'object'))));
      // Drawn when they are looked at: there may be hundreds of classes.
      details.addEventListener('toggle', () => {
        if (details.querySelector('.figures')) return;
        details.append(el('div', { class: 'figures' },
          heatMap('Where in the picture', own.places, 300),
          own.views && heatMap('Seen from: above to below, 30° each round the object', [...own.views].reverse(), 300),
          bars('Side of the box', own.box_side, 100, '%'), bars('Visible', own.visible, 100, '%'),
          bars('Outside of the picture', own.truncation, 100, '%'), bars('Distance', own.distance_m, 1, 'm')));
      });
      details.open = classes.length === 1;
      this.element.append(details);
    }
  }
}

export class FindingsPage {
  readonly element = el('main', { class: 'page', tabindex: '0' });

  show(app: App): void {
    clear(this.element);
    this.element.append(el('h1', {}, 'Findings'));
    if (!app.lint.isAsked) {
      this.element.append(el('p', {}, 'Every file of the dataset is read, and what must hold between labels, pixels, cameras and formats is checked, as by "diorama lint".'),
        button('Check the dataset', '', () => app.lint.ask(), { class: 'main' }));
      return;
    }
    if (app.lint.fault !== '') {
      this.element.append(el('p', { class: 'bad' }, app.lint.fault));
      return;
    }
    const { reports } = app.lint;
    if (!reports) {
      this.element.append(waitingFor('Every file is read and checked …'));
      return;
    }
    for (const report of reports) {
      this.element.append(el('h2', {}, report.dataset.slice(report.dataset.lastIndexOf('/') + 1), el('small', {}, report.format)),
        el('p', { class: report.findings.length === 0 ? 'good' : 'bad' },
          `${plural(report.files, 'file')}, ${plural(report.checks, 'check')}: ` +
          (report.findings.length === 0 ? 'nothing found' : plural(report.findings.length, 'finding'))));
      const checks = new Map<string, Finding[]>();
      for (const finding of report.findings) checks.set(finding.check, [...(checks.get(finding.check) ?? []), finding]);
      for (const [check, findings] of checks) {
        const list = el('ul');
        for (const finding of findings.slice(0, 200)) {
          const dataset = datasetOf(app.site, report);
          const place = `capture ${finding.capture}${finding.camera ? ', ' + finding.camera : ''}`;
          const message = finding.message ?? '';
          const isJump = finding.capture !== undefined && dataset >= 0;
          list.append(el('li', {}, isJump && jump(app, place, dataset, finding.capture!, finding.camera, finding.object), ' ',
            isJump && message.startsWith(place + ': ') ? message.slice(place.length + 2) : message, el('small', {}, finding.file ?? '')));
        }
        this.element.append(el('details', { open: checks.size <= 3 }, el('summary', {}, check, el('small', {}, String(findings.length))), list));
      }
    }
  }
}

/** Kinds of verdicts of settle/, worst first. */
const kVerdicts: [string, string][] = [['unsettled', 'shown all the same'], ['dropped', 'taken out'], ['respawned', 'placed anew'],
  ['born_inside', 'placed inside something'], ['blocked_cameras', 'camera blocked']];

function table(heads: string[], rows: string[][]): HTMLElement {
  const body = el('tbody');
  for (const [first, ...others] of rows) {
    body.append(el('tr', {}, el('th', { scope: 'row' }, first), ...others.map((word) => el('td', {}, word))));
  }
  return el('table', { class: 'texts' }, el('thead', {}, el('tr', {}, ...heads.map((word) => el('th', { scope: 'col' }, word)))), body);
}

/** For a shell. */
export function replayCommand(folder: string, capture: number): string {
  return `diorama replay '${folder.replaceAll("'", "'\\''")}' --capture ${capture}`;
}

export class RunPage {
  readonly element = el('main', { class: 'page', tabindex: '0' });
  private readonly run = new Awaited();
  private began: { time: number; done: number } | null = null;

  show(app: App): void {
    // A run that goes on is looked at again and again.
    const key = app.site.is_finished ? String(app.site.generation) : String(Math.floor(Date.now() / 3000));
    if (!this.run.want('/api/run', key, () => this.show(app)) && this.element.childElementCount > 0) return;
    const run = this.run.value as RunState | null;
    if (!run) return;
    clear(this.element);
    this.element.append(el('h1', {}, 'Run'));
    if (!run.folder) {
      this.element.append(el('p', {}, 'This dataset does not say how it was made.'));
      return;
    }
    const facts = el('div', { class: 'facts' });
    const add = (name: string, value: string) => facts.append(el('div', {}, el('small', {}, name), el('b', {}, value)));
    if (run.seed !== undefined) add('seed', String(run.seed));
    if (run.version) add('made by diorama', run.version);
    if (run.captures !== undefined) add('captures', `${(run.done ?? 0).toLocaleString('en')} of ${run.captures.toLocaleString('en')}`);
    this.element.append(facts);
    if (run.captures !== undefined && !run.is_finished) this.showProgress(run);
    this.showLast(app, run);
    this.showStages(run);
    this.showWorkers(run);
    this.showViews(run);
    this.showSettling(run);
    const capture = app.state.capture || app.info.captures[0] || 0;
    this.element.append(el('h2', {}, 'Make a capture again'),
      el('pre', {}, replayCommand(run.folder, capture)));
    if (run.job) this.element.append(el('h2', {}, 'Job'), el('pre', { class: 'job', tabindex: '0' }, run.job));
  }

  /** The first camera's pictures of the captures that came last. */
  private showLast(app: App, run: RunState): void {
    const there = new Set(app.info.captures);
    const last = (run.last ?? []).filter((capture) => there.has(capture));
    if (last.length === 0 || !app.holds.has('color')) return;
    const pictures = el('div', { class: 'last' });
    for (const capture of last) {
      pictures.append(on(el('a', { href: '#', title: `Capture ${capture}` },
        el('img', { src: pictureAddress(app.state.dataset, capture, 0, 'thumbnail'), alt: `Capture ${capture}` }), el('small', {}, `#${capture}`)), {
        click: (event: MouseEvent) => {
          event.preventDefault();
          app.go({ page: 'capture', capture, frame: 0, object: 0 });
        },
      }));
    }
    this.element.append(el('h2', {}, 'Last pictures'), pictures);
  }

  private showStages(run: RunState): void {
    const stages = Object.entries(run.stages ?? {}).sort((a, b) => b[1] - a[1]);
    const all = stages.reduce((sum, [, seconds]) => sum + seconds, 0);
    if (all <= 0) return;
    const rows = stages.filter(([, seconds]) => seconds >= 0.005 * all)
      .map(([name, seconds]) => [name, `${seconds.toFixed(1)} s`, `${((100 * seconds) / all).toFixed(0)} %`]);
    this.element.append(el('h2', {}, 'Where the time goes', el('small', {}, `slowest: ${stages[0][0]}`)), table(['Stage', 'Time of all workers', 'Share'], rows));
  }

  private showWorkers(run: RunState): void {
    const rows = (run.workers ?? []).map((worker) => [worker.name, worker.role, worker.role === '' ? 'ended' : worker.is_alive ? 'alive' : 'dead',
      worker.captures.toLocaleString('en'), worker.memory_bytes > 0 ? `${(worker.memory_bytes / 2 ** 20).toFixed(0)} MiB` : '', worker.description]);
    if (rows.length > 0) this.element.append(el('h2', {}, 'Workers'), table(['Name', 'Role', 'State', 'Captures', 'Memory', 'What it is'], rows));
  }

  /** Which conditions the views that were drawn did not hold. */
  private showViews(run: RunState): void {
    if (!run.views) return;
    const { views, draws, refused, unmet } = run.views;
    const rows = Object.entries(refused).sort((a, b) => b[1] - a[1])
      .map(([condition, count]) => [condition, count.toLocaleString('en'), `${((100 * count) / Math.max(1, draws)).toFixed(1)} %`]);
    this.element.append(el('h2', {}, 'Views'), el('p', { class: unmet > 0 ? 'bad' : '' },
      `${plural(views, 'view')} of ${plural(draws, 'draw')}` + (unmet > 0 ? `; ${unmet.toLocaleString('en')} hold not all that was asked for` : '')));
    if (rows.length > 0) this.element.append(table(['Refused for', 'Draws', 'Share'], rows));
  }

  private showSettling(run: RunState): void {
    if (!run.settle) return;
    const { visits, at_rest, falling_objects, longest_rest_s, verdicts } = run.settle;
    this.element.append(el('h2', {}, 'How objects came to rest'), el('p', {},
      `${plural(visits, 'visit')} with ${plural(falling_objects, 'falling object')}; at rest at the end of ${at_rest.toLocaleString('en')}` +
      (longest_rest_s === null ? '' : `, after ${longest_rest_s.toFixed(1)} s at most`)));
    const rows = kVerdicts.flatMap(([kind, title]) => verdicts.filter((verdict) => verdict.kind === kind)
      .sort((a, b) => b.count - a.count)
      .map((verdict) => [title, verdict.why, verdict.count.toLocaleString('en'), verdict.first]));
    if (rows.length > 0) this.element.append(table(['What became of them', 'Why', 'Times', 'First'], rows));
  }

  private showProgress(run: RunState): void {
    const now = Date.now() / 1000;
    this.began ??= { time: now, done: run.done ?? 0 };
    const made = (run.done ?? 0) - this.began.done;
    const rate = made > 0 ? made / Math.max(1, now - this.began.time) : 0;
    const left = rate > 0 ? ((run.captures ?? 0) - (run.done ?? 0)) / rate : 0;
    this.element.append(el('progress', { max: run.captures ?? 1, value: run.done ?? 0, 'aria-label': 'Captures made' }),
      el('p', {}, rate > 0 ? `${(rate * 60).toFixed(1)} captures a minute, ${left < 90 ? `${Math.ceil(left)} s` : `${Math.ceil(left / 60)} min`} left` : 'waiting for the next capture …'));
  }
}
