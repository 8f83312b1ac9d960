// SPDX-License-Identifier: Apache-2.0
// One card per capture with its cameras. Only cards that are in sight exist.
import { App } from './app';
import { kUnknown, pictureAddress } from './data';
import { button, clear, el, on } from './dom';
import { FramePixels, drawKeypoints, drawLines, overlays } from './layers';

const kGap = 12;
const kHead = 26;
/** Browsers end elements at some 33 million pixels, silently; what is higher scrolls faster. */
const kMostHeight = 16e6;

interface Card {
  element: HTMLElement;
  capture: number;
  pictures: number;
  isDescribed: boolean;  ///< The labels of its capture were read when it was made.
}

export class Grid {
  readonly element = el('div', { class: 'grid', tabindex: '0', role: 'grid', 'aria-label': 'Captures' });
  private readonly field = el('div', { class: 'field' });
  private readonly empty = el('p', { class: 'empty' });
  private readonly cards = new Map<number, Card>();
  private app!: App;
  private key = '';
  private columns = 1;
  private cardWidth = 1;
  private cardHeight = 1;
  private pictureHeight = 1;
  private chosen = 0;
  private told = -1;  ///< The capture that is first in sight, as the address has it.
  private wanted: number | null = null;  ///< To be scrolled to as soon as it is there.
  private ownTop = -Infinity;  ///< Where it has scrolled to by itself.
  private height = 0;  ///< Of all cards.

  constructor() {
    this.element.append(this.empty, this.field);
    on(this.element, { scroll: () => this.scrolled(), keydown: (event: KeyboardEvent) => this.press(event) });
    new ResizeObserver(() => this.app && this.show(this.app)).observe(this.element);
  }

  show(app: App): void {
    this.app = app;
    const { state, table } = app;
    // Pictures of a capture stand side by side as long as the card fits into the window. All have the room that the first of the
    // dataset takes; those of other shapes are smaller in it.
    const pictures = Math.max(1, table.captures > 0 ? table.of('pictures')[0] : app.info.cameras.length);
    const aspect = table.pictures > 0 && table.of('width')[0] > 0 ? table.of('height')[0] / table.of('width')[0] : 0.75;
    const inside = Math.max(200, this.element.clientWidth - 2 * kGap);
    const beside = Math.max(1, Math.min(pictures, Math.floor((inside - 2) / (state.card + 2))));
    this.cardWidth = beside * (state.card + 2) - 2;
    const rows = Math.ceil(pictures / beside);
    this.pictureHeight = Math.round(state.card * aspect);
    this.cardHeight = kHead + rows * (this.pictureHeight + 2);
    this.columns = Math.max(1, Math.floor((inside + kGap) / (this.cardWidth + kGap)));
    const lines = Math.ceil(app.filtered.places.length / this.columns);
    this.height = lines * (this.cardHeight + kGap) + kGap;
    this.field.style.height = `${Math.min(this.height, kMostHeight)}px`;
    this.empty.hidden = app.filtered.places.length > 0;
    if (!this.empty.hidden) {
      clear(this.empty);
      const isReading = table.captures < app.info.captures.length;
      if (app.info.captures.length === 0) this.empty.append('No capture is there yet.');
      else this.empty.append(isReading ? 'Reading labels …' : 'No capture fits these filters. ');
      if (!isReading && app.info.captures.length > 0) this.empty.append(button('Clear all filters', '', () => app.go({ facets: new Map() })));
    }
    const key = JSON.stringify([app.info.folder, app.site.edition, table.captures > 0, [...state.layers].sort(), state.colour, state.opacity,
      state.card, this.columns, this.cardWidth, this.cardHeight]);
    if (key !== this.key) {
      this.key = key;
      for (const card of this.cards.values()) card.element.remove();
      this.cards.clear();
    }
    // While a dataset is made others come in between.
    for (const [place, card] of this.cards) {
      if (app.info.captures[place] === card.capture) continue;
      card.element.remove();
      this.cards.delete(place);
    }
    if (state.at !== this.told) this.told = this.wanted = state.at;
    this.scrollToWanted();
    this.fill();
  }

  /** Until somebody scrolls: heights are not known before labels are, nor which captures a filter leaves. */
  private scrollToWanted(): void {
    if (this.wanted === null || this.element.clientHeight === 0) return;
    const { filtered, info } = this.app;
    let first = filtered.places.findIndex((place) => info.captures[place] >= this.wanted!);
    if (first < 0) first = filtered.places.length - 1;
    this.element.scrollTop = Math.max(0, (Math.floor(Math.max(0, first) / this.columns) * (this.cardHeight + kGap)) / this.stretch);
    this.ownTop = this.element.scrollTop;
  }

  private scrolled(): void {
    if (!this.app || this.element.clientHeight === 0) return;
    this.fill();
    if (Math.abs(this.element.scrollTop - this.ownTop) < 2) return;
    this.ownTop = -Infinity;
    this.wanted = null;
    const line = Math.round((this.element.scrollTop * this.stretch) / (this.cardHeight + kGap));
    const place = this.app.filtered.places[line * this.columns];
    this.told = line === 0 || place === undefined ? -1 : this.app.info.captures[place];
    this.app.note({ at: this.told });
  }

  /** Pixels of all cards per pixel that is scrolled. */
  private get stretch(): number {
    const inside = this.element.clientHeight;
    return this.height > kMostHeight ? (this.height - inside) / (kMostHeight - inside) : 1;
  }

  private fill(): void {
    if (!this.app || this.element.clientHeight === 0) return;
    const pitch = this.cardHeight + kGap;
    const top = this.element.scrollTop * this.stretch;
    const shift = this.element.scrollTop - top;
    const first = Math.max(0, Math.floor(top / pitch) - 1) * this.columns;
    const lines = Math.ceil(this.element.clientHeight / pitch) + 3;
    const places = this.app.filtered.places;
    const last = Math.min(places.length, first + lines * this.columns);
    const wanted = new Set<number>();
    for (let i = first; i < last; ++i) {
      const place = places[i];
      wanted.add(place);
      let card = this.cards.get(place);
      if (card && !card.isDescribed && place < this.app.table.captures) {
        card = this.describe(place, card);
      }
      if (!card) {
        card = this.make(place);
        this.cards.set(place, card);
        this.field.append(card.element);
      }
      const column = i % this.columns;
      const line = Math.floor(i / this.columns);
      card.element.style.transform = `translate(${kGap + column * (this.cardWidth + kGap)}px, ${kGap + line * pitch + shift}px)`;
      card.element.dataset.at = String(i);
      card.element.classList.toggle('chosen', i === this.chosen);
      if (i === this.chosen) this.element.setAttribute('aria-activedescendant', card.element.id);
    }
    if (!wanted.has(places[this.chosen])) this.element.removeAttribute('aria-activedescendant');
    for (const [place, card] of this.cards) {
      if (wanted.has(place)) continue;
      card.element.remove();
      this.cards.delete(place);
    }
  }

  private picturesOf(place: number): number {
    const { table, info } = this.app;
    // What could not be read has none, and a card all the same.
    return Math.max(1, place < table.captures ? table.of('pictures')[place] : info.cameras.length);
  }

  /** What the index says of a card that was there before it; nothing when it shows other pictures. */
  private describe(place: number, card: Card): Card | undefined {
    if (card.pictures !== this.picturesOf(place)) {
      card.element.remove();
      return undefined;
    }
    card.element.querySelector('.head')!.replaceWith(this.head(place, card.element));
    card.isDescribed = true;
    return card;
  }

  private head(place: number, card: HTMLElement): HTMLElement {
    const { table, info } = this.app;
    const number = el('b', {}, `#${info.captures[place]}`);
    if (place >= table.captures) return el('div', { class: 'head' }, number);
    const phase = table.names.phases[table.of('phase')[place]] ?? '';
    const split = table.names.splits[table.of('split')[place]] ?? '';
    const clip = table.of('clip')[place];
    const words = [clip === kUnknown ? '' : `clip ${clip}`, phase, split].filter((word) => word !== '').join(' · ');
    card.title = table.names.environments[table.of('environment')[place]] ?? '';
    return el('div', { class: 'head' }, number, el('span', {}, words),
      table.of('findings')[place] > 0 && el('span', { class: 'bad', title: 'The reader found faults in its files' }, '⚠'));
  }

  private make(place: number): Card {
    const { app } = this;
    const { table, state } = app;
    const capture = app.info.captures[place];
    const count = this.picturesOf(place);
    const element = el('div', { class: 'card', role: 'row', id: `card-${place}`, 'aria-label': `capture ${capture}` });
    element.append(this.head(place, element));
    element.style.width = `${this.cardWidth}px`;
    element.style.height = `${this.cardHeight}px`;
    const row = el('div', { class: 'pictures' });
    for (let frame = 0; frame < count; ++frame) {
      const link = on(el('a', { href: '#', class: 'picture', tabindex: '-1',
        'aria-label': `capture ${capture}, picture ${frame + 1}` }), {
        click: (event: MouseEvent) => {
          event.preventDefault();
          this.chosen = Number(element.dataset.at);
          app.go({ page: 'capture', capture, frame, object: 0 });
        },
      });
      link.style.width = `${state.card}px`;
      link.style.height = `${this.pictureHeight}px`;
      const canvas = el('canvas');
      if (app.holds.has('color')) {
        const image = on(el('img', { alt: '', decoding: 'async', src: pictureAddress(state.dataset, capture, frame, 'thumbnail') }), {
          error: () => image.replaceWith(el('span', { class: 'missing' })),
        });
        link.append(image);
      } else {
        link.append(el('span', { class: 'missing' }));
      }
      link.append(canvas);
      row.append(el('div', { role: 'gridcell' }, link));
      this.draw(capture, frame, canvas, element);
    }
    element.append(row);
    return { element, capture, pictures: count, isDescribed: place < table.captures };
  }

  /** Overlays of one picture of a card. */
  private draw(capture: number, frame: number, canvas: HTMLCanvasElement, card: HTMLElement): void {
    const { app } = this;
    const { state } = app;
    const pixels = new FramePixels(state.dataset, capture, frame);
    const draw = async (): Promise<void> => {
      // Classes get their colours in the order of the index, so that they are the same every time.
      if (state.layers.size === 0 || app.table.captures === 0) return;
      const labels = (await app.labels(capture).catch(() => null))?.frames[frame];
      if (!labels || !card.isConnected) return;
      const ratio = Math.min(2, window.devicePixelRatio || 1);
      canvas.width = Math.round(state.card * ratio);
      canvas.height = Math.round((state.card * ratio * labels.height) / Math.max(1, labels.width));
      const context = canvas.getContext('2d')!;
      context.globalAlpha = state.opacity / 100;
      for (const layer of overlays(pixels, labels, state, app.palette, app.holds, () => void draw())) {
        context.drawImage(layer, 0, 0, canvas.width, canvas.height);
      }
      context.globalAlpha = 1;
      const view = { scale: canvas.width / labels.width, x: 0, y: 0 };
      drawLines(context, labels, view, state, app.palette, 0.9 * ratio, 0);
      drawKeypoints(context, labels, view, state, app.palette, app.info.skeletons, 0.6 * ratio);
    };
    requestAnimationFrame(() => void draw());
  }

  private press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const places = this.app.filtered.places;
    const page = Math.max(1, Math.floor(this.element.clientHeight / (this.cardHeight + kGap))) * this.columns;
    const steps: { [key: string]: number } = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -this.columns, ArrowDown: this.columns,
      PageUp: -page, PageDown: page, Home: -places.length, End: places.length };
    if (event.key === 'Enter' && places.length > 0) {
      this.app.go({ page: 'capture', capture: this.app.info.captures[places[this.chosen]], frame: 0, object: 0 });
    } else if (event.key in steps) {
      this.chosen = Math.max(0, Math.min(places.length - 1, this.chosen + steps[event.key]));
      const top = Math.floor(this.chosen / this.columns) * (this.cardHeight + kGap);
      const bottom = top + this.cardHeight + 2 * kGap;
      const seen = this.element.scrollTop * this.stretch;
      if (top < seen) this.element.scrollTop = top / this.stretch;
      if (bottom > seen + this.element.clientHeight) {
        this.element.scrollTop = (bottom - this.element.clientHeight) / this.stretch;
      }
      this.fill();
    } else {
      return;
    }
    event.preventDefault();
  }
}
