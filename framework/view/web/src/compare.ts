// SPDX-License-Identifier: Apache-2.0
// Two datasets: the same capture of both beside each other, under a divider, or as what differs.
import { App } from './app';
import { CaptureLabels, DatasetInfo, Difference, FrameLabels, get } from './data';
import { button, clear, el, on, plural, remake } from './dom';
import { FramePixels, Numbers, View, differenceDrawing, drawKeypoints, drawLines, drawPicture, overlays } from './layers';
import { Awaited, waitingFor } from './pages';
import { CompareMode } from './state';
import { Zoom } from './zoom';

const kModes: [CompareMode, string, string][] = [
  ['side', 'Side by side', '1'], ['divider', 'Divider', '2'], ['difference', 'Difference', '3'],
];
/** Of the divider a pointer takes hold within so many pixels. */
const kGrip = 12;
/** Keys that move it, by percent of the width. */
const kSlides: { [key: string]: number } = { ',': -4, '.': 4 };

/** One of the two. */
interface Side {
  dataset: number;
  info: DatasetInfo;
  holds: Set<string>;
  capture: CaptureLabels | null;
  frame: FrameLabels | null;
  place: number;
  pixels: FramePixels | null;
}

export class ComparePage {
  readonly element = el('main', { class: 'capture' });
  private readonly canvas = el('canvas', { class: 'big', tabindex: '0', role: 'img' });
  private readonly head = el('div', { class: 'bar' });
  private readonly probe = el('div', { class: 'probe', 'aria-live': 'off' });
  private readonly panel = el('aside', { class: 'objects', 'aria-label': 'Differences' });
  private readonly whole = new Awaited();
  private readonly ofCapture = new Awaited();
  private app!: App;
  private sides: [Side, Side] | null = null;
  private key = '';
  private infos = new Map<string, Promise<DatasetInfo>>();
  private difference: { canvas: HTMLCanvasElement; pixels: number; most: number } | null = null;
  private readonly zoom = new Zoom(this.canvas, {
    size: () => {
      const frame = this.sides?.[0].frame ?? this.sides?.[1].frame;
      return frame ? [frame.width, frame.height] : null;
    },
    draw: () => this.draw(),
    moved: (view) => this.app.note({ view }),
    pointed: (pixel) => this.showProbe(pixel),
    dragged: (x, _, isFirst) => {
      if (this.app.state.mode !== 'divider') return false;
      const share = (100 * x) / Math.max(1, this.canvas.clientWidth);
      if (isFirst && (Math.abs(share - this.app.state.divider) * this.canvas.clientWidth) / 100 > kGrip) return false;
      this.divide(share);
      return true;
    },
  });

  constructor() {
    const stage = el('div', { class: 'stage' }, this.canvas, this.probe);
    this.element.append(this.head, el('div', { class: 'parts' }, stage, this.panel));
    new ResizeObserver(() => this.draw()).observe(stage);
  }

  async show(app: App): Promise<void> {
    this.app = app;
    const { state } = app;
    const key = JSON.stringify([app.site.generation, state.dataset, state.other, state.capture, state.frame]);
    if (key !== this.key) {
      this.key = key;
      this.zoom.reset();
      this.difference = null;
      const sides = await Promise.all([this.side(state.dataset), this.side(state.other)]).catch((error: Error) => error);
      if (key !== this.key) return;
      this.sides = null;
      if (sides instanceof Error) {
        clear(this.panel);
        this.panel.append(el('p', { class: 'bad' }, sides.message));
        return;
      }
      this.sides = sides as [Side, Side];
      const [a, b] = this.sides;
      this.pick(a, state.frame, a.capture?.frames[state.frame]?.camera ?? null);
      this.pick(b, state.frame, a.frame?.camera ?? null);
      for (const side of this.sides) {
        if (side.frame && side.holds.has('color')) side.pixels!.picture('color').then(() => this.draw(), () => undefined);
      }
      void this.findDifference(key);
    }
    if (!this.sides) return;
    this.showHead();
    this.showPanel();
    if (this.probe.childElementCount === 0) this.showProbe(null);
    this.zoom.show(state.view);
    this.draw();
  }

  private async side(dataset: number): Promise<Side> {
    const { app } = this;
    const key = `${app.site.generation} ${dataset}`;
    let info = this.infos.get(key);
    if (!info) this.infos.set(key, (info = get(`/api/${dataset}/info`) as Promise<DatasetInfo>));
    const known = await info;
    const capture = await app.labels(app.state.capture, dataset).catch(() => null);
    return { dataset, info: known, holds: new Set(known.holds), capture, frame: null, place: 0, pixels: null };
  }

  /** The frame of that camera; where there is one on either side, that one. */
  private pick(side: Side, place: number, camera: string | null): void {
    const frames = side.capture?.frames ?? [];
    const found = frames.findIndex((frame) => frame.camera === camera);
    side.place = found >= 0 ? found : frames.length === 1 ? 0 : camera === null ? place : -1;
    side.frame = frames[side.place] ?? null;
    side.pixels = side.frame ? new FramePixels(side.dataset, this.app.state.capture, side.place) : null;
  }

  private async findDifference(key: string): Promise<void> {
    const [a, b] = this.sides!;
    if (!a.pixels || !b.pixels || !a.holds.has('color') || !b.holds.has('color')) return;
    const numbers = await Promise.all([a.pixels.numbers('color'), b.pixels.numbers('color')]).catch(() => null);
    if (!numbers || key !== this.key) return;
    this.difference = differenceDrawing(numbers[0], numbers[1]);
    this.showPanel();
    this.draw();
  }

  private divide(percent: number): void {
    this.app.note({ divider: Math.round(Math.max(0, Math.min(100, percent))) });
    this.draw();
  }

  private nameOf(dataset: number): string {
    const site = this.app.site.datasets[dataset];
    const isAlone = this.app.site.datasets.every((other, i) => i === dataset || other.name !== site.name);
    return isAlone ? `${site.name} (${site.format})` : site.folder;
  }

  private showHead(): void {
    const { app } = this;
    const { state } = app;
    const refocus = remake(this.head, 'head');
    const other = on(el('select', { 'aria-label': 'Compare with', 'data-head': 'other' }), {
      change: () => app.go({ other: Number(other.value) }),
    });
    app.site.datasets.forEach((_, i) => {
      if (i !== state.dataset) other.append(el('option', { value: i }, this.nameOf(i)));
    });
    other.value = String(state.other);
    this.head.append(el('span', { class: 'words' }, this.nameOf(state.dataset)), 'and', other,
      button('‹', 'Capture before (arrow left)', () => this.step(-1), { 'data-head': 'back' }),
      el('h1', {}, `Capture ${state.capture}`),
      button('›', 'Next capture (arrow right)', () => this.step(1), { 'data-head': 'next' }));
    const cameras = el('span', { class: 'tabs', role: 'tablist', 'aria-label': 'Cameras' });
    const frames = (this.sides![0].capture ?? this.sides![1].capture)?.frames ?? [];
    frames.forEach((frame, i) => cameras.append(button(frame.camera, '', () => app.go({ frame: i }),
      { role: 'tab', 'aria-selected': i === state.frame ? 'true' : 'false', 'data-head': `camera ${i}` })));
    const modes = el('span', { class: 'right', role: 'group', 'aria-label': 'How to compare' });
    for (const [mode, title, key] of kModes) {
      modes.append(button(title, `${title} (${key})`, () => app.go({ mode }, true),
        { 'aria-pressed': mode === state.mode ? 'true' : 'false', 'data-head': mode }));
    }
    this.head.append(cameras, modes);
    refocus();
  }

  /** Captures of either side; only those that differ once that is known. */
  private captures(): number[] {
    const found = this.whole.value as Difference | null;
    if (found && found.differing.length > 0) return found.differing;
    const [a, b] = this.sides!;
    return [...new Set([...a.info.captures, ...b.info.captures])].sort((one, two) => one - two);
  }

  private step(by: number): void {
    const list = this.captures();
    const { capture } = this.app.state;
    const next = by > 0 ? list.find((number) => number > capture) : list.findLast((number) => number < capture);
    if (next !== undefined) this.app.go({ capture: next });
  }

  private showPanel(): void {
    const { app } = this;
    const { state } = app;
    const again = () => this.sides && this.showPanel();
    const path = `/api/${state.dataset}/compare/${state.other}`;
    const generation = String(app.site.generation);
    const hasCapture = this.ofCapture.want(`${path}/${state.capture}`, generation, again);
    const hasWhole = this.whole.want(path, generation, again);
    const scroll = this.panel.scrollTop;
    clear(this.panel);
    this.panel.append(el('h2', {}, `Capture ${state.capture}`));
    const [a, b] = this.sides!;
    if (this.difference) {
      const { pixels, most } = this.difference;
      this.panel.append(el('p', { class: pixels === 0 ? 'good' : '' }, pixels === 0 ? 'Every pixel is the same.'
        : `${plural(pixels, 'pixel')} of another colour, by ${most} of 255 at most.`));
    } else if (a.frame && b.frame && (a.frame.width !== b.frame.width || a.frame.height !== b.frame.height)) {
      this.panel.append(el('p', {}, `${a.frame.width} × ${a.frame.height} and ${b.frame.width} × ${b.frame.height} pixels`));
    }
    const lines = (list: string[], what: string) => {
      if (list.length === 0) return el('p', { class: 'good' }, what);
      const items = el('ul');
      for (const line of list) items.append(el('li', {}, line));
      return items;
    };
    if (this.ofCapture.fault !== '') this.panel.append(el('p', { class: 'bad' }, this.ofCapture.fault));
    else if (!hasCapture) this.panel.append(waitingFor('Comparing …'));
    else this.panel.append(lines(this.ofCapture.value as string[], 'Nothing that both hold differs.'));
    this.panel.append(el('h2', {}, 'All captures'));
    if (this.whole.fault !== '') this.panel.append(el('p', { class: 'bad' }, this.whole.fault));
    else if (!hasWhole) this.panel.append(waitingFor('Every file of both is read …'));
    else this.showWhole(this.whole.value as Difference, lines);
    this.panel.scrollTop = scroll;
  }

  private showWhole(found: Difference, lines: (list: string[], what: string) => HTMLElement): void {
    const { app } = this;
    const differing = found.differing.length;
    this.panel.append(el('p', { class: differing === 0 ? 'good' : '' },
      differing === 0 ? `${plural(found.captures, 'capture')} of the first: the same in the second.`
        : `${differing.toLocaleString('en')} of ${plural(found.captures, 'capture')} differ. The arrow keys go through them.`));
    const list = el('div', { class: 'numbers' });
    for (const capture of found.differing.slice(0, 500)) {
      list.append(button(String(capture), 'Show it', () => app.go({ capture }),
        { class: 'link', 'aria-current': capture === app.state.capture ? 'true' : false }), ' ');
    }
    if (differing > 500) list.append(`and ${(differing - 500).toLocaleString('en')} more`);
    this.panel.append(list);
    if (found.pages.length > 0) {
      this.panel.append(el('details', { open: found.pages.length < 12 },
        el('summary', {}, 'How they were made', el('small', {}, String(found.pages.length))), lines(found.pages, '')));
    }
    const others = found.contents.filter((line) => !line.startsWith('capture '));
    if (others.length > 0) this.panel.append(el('h2', {}, 'Contents'), lines(others, ''));
  }

  private showProbe(pixel: [number, number] | null): void {
    clear(this.probe);
    if (!this.sides || !pixel) {
      this.probe.append(el('span', {}, 'Wheel zooms, drag moves both; 1, 2, 3 choose how to compare.'));
      return;
    }
    const word = (name: string, value: string) => this.probe.append(el('span', {}, el('small', {}, name), ' ', value));
    word('pixel', pixel.join(', '));
    this.sides.forEach((side, i) => {
      const value = side.pixels?.now<Numbers>('color')?.at(...pixel);
      if (value !== null && value !== undefined) {
        word(i === 0 ? 'first' : 'second', [value & 255, (value >> 8) & 255, value >> 16].join(', '));
      }
    });
  }

  private draw(): void {
    if (!this.app || this.element.hidden) return;
    const { state } = this.app;
    this.zoom.panes = state.mode === 'side' ? 2 : 1;
    const began = this.zoom.begin();
    if (!began || !this.sides) return;
    const [context, view] = began;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const [a, b] = this.sides;
    const middle = state.mode === 'side' ? this.zoom.paneWidth : (state.divider / 100) * width;
    if (state.mode === 'difference' && this.difference) {
      const { canvas } = this.difference;
      context.fillStyle = '#000';
      context.fillRect(view.x, view.y, canvas.width * view.scale, canvas.height * view.scale);
      context.drawImage(canvas, view.x, view.y, canvas.width * view.scale, canvas.height * view.scale);
      this.drawBoxes(context, a, view);
      context.setLineDash([6, 4]);
      this.drawBoxes(context, b, view);
      return;
    }
    const inside = (side: Side, left: number, right: number, shift: number) => {
      context.save();
      context.beginPath();
      context.rect(left, 0, right - left, height);
      context.clip();
      this.drawSide(context, side, { ...view, x: view.x + shift });
      context.restore();
    };
    inside(a, 0, middle, 0);
    inside(b, middle, width, state.mode === 'side' ? middle : 0);
    context.fillStyle = getComputedStyle(this.canvas).getPropertyValue('--accent');
    context.fillRect(middle - 1, 0, 2, height);
    if (state.mode === 'divider') context.fillRect(middle - 4, height / 2 - 16, 8, 32);
    this.canvas.setAttribute('aria-label', `Capture ${state.capture} of both datasets`);
  }

  private drawSide(context: CanvasRenderingContext2D, side: Side, view: View): void {
    if (!side.frame || !side.pixels) {
      context.fillStyle = getComputedStyle(this.canvas).color;
      context.font = '14px system-ui, sans-serif';
      context.fillText('not there', view.x + 20, 40);
      return;
    }
    const { state, palette } = this.app;
    const over = overlays(side.pixels, side.frame, state, palette, side.holds, () => this.draw());
    drawPicture(context, side.frame, view, side.pixels, over, state);
    this.drawBoxes(context, side, view);
  }

  private drawBoxes(context: CanvasRenderingContext2D, side: Side, view: View): void {
    if (!side.frame) return;
    drawLines(context, side.frame, view, this.app.state, this.app.palette, 1, 0);
    drawKeypoints(context, side.frame, view, this.app.state, this.app.palette, side.info.skeletons, 1);
  }

  /** True when the key means something here. */
  press(event: KeyboardEvent): boolean {
    const mode = kModes.find(([, , key]) => key === event.key);
    if (mode) this.app.go({ mode: mode[0] }, true);
    else if (event.shiftKey && this.zoom.press(event)) return true;
    else if (this.app.state.mode === 'divider' && event.key in kSlides) this.divide(this.app.state.divider + kSlides[event.key]);
    else if (event.key === 'ArrowLeft') this.step(-1);
    else if (event.key === 'ArrowRight') this.step(1);
    else if (event.key === 'Escape') this.app.go({ page: 'grid' });
    else return this.zoom.press(event);
    return true;
  }
}
