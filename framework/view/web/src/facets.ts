// SPDX-License-Identifier: Apache-2.0
// The side bar: what there is to filter by, with counts of what a click would give.
import { App } from './app';
import { button, el, on, plural, remake, svg } from './dom';
import { Chosen, Facet, kFacets, readChosen, writeChosen } from './filter';
import { css } from './layers';

const kMostNames = 12;

export class FacetBar {
  readonly element = el('aside', { class: 'facets', 'aria-label': 'Filters' });
  private readonly opened = new Set<string>();
  private dragging = false;

  show(app: App): void {
    if (this.dragging) return;
    const refocus = remake(this.element, 'focus');
    const { table, filtered } = app;
    this.element.append(el('div', { class: 'total', 'aria-live': 'polite' },
      el('h1', {}, el('b', {}, filtered.places.length.toLocaleString('en')), ` of ${plural(app.info.captures.length, 'capture')}`),
      el('small', {}, plural(filtered.objects, 'object'))));
    if (app.state.facets.size > 0) {
      this.element.append(button('Clear all filters', 'Show everything', () => app.go({ facets: new Map() }), { class: 'wide' }));
    }
    for (const facet of kFacets) {
      const counts = filtered.counts.get(facet.key) ?? [];
      const chosen = this.chosenOf(app, facet);
      if (facet.range) {
        const filled = counts.filter((count) => count > 0).length;
        if (chosen || filled > (facet.range.isWhole ? 1 : 0)) this.element.append(this.rangeFacet(app, facet, counts, chosen));
        continue;
      }
      const names = facet.names!(table, app.info.cameras);
      const told = names.filter((name) => name !== '');
      if (facet.key === 'lint' && names.length === 0) {
        this.element.append(this.askForLint(app, facet));
        continue;
      }
      const saysNothing = facet.key === 'findings' ? !chosen && counts[1] === 0 : told.length === 0;
      if (!saysNothing) this.element.append(this.nameFacet(app, facet, names, counts, chosen));
    }
    refocus();
  }

  /** What lint finds takes as long as reading every file. */
  private askForLint(app: App, facet: Facet): HTMLElement {
    const section = this.section(app, facet, this.chosenOf(app, facet), '');
    if (app.lint.isAsked) section.append(el('p', { role: 'status' }, app.lint.fault === '' ? 'Every file is read and checked …' : app.lint.fault));
    else section.append(button('Check the dataset', 'As "diorama lint" does', () => app.lint.ask(), { 'data-focus': 'lint' }));
    return section;
  }

  private chosenOf(app: App, facet: Facet): Chosen | null {
    try {
      return readChosen(facet, app.state.facets.get(facet.key));
    } catch {
      return null;
    }
  }

  private choose(app: App, facet: Facet, chosen: Chosen | null): void {
    const facets = new Map(app.state.facets);
    if (!chosen || chosen.names?.size === 0) facets.delete(facet.key);
    else facets.set(facet.key, writeChosen(chosen));
    app.go({ facets }, true);
  }

  private section(app: App, facet: Facet, chosen: Chosen | null, detail: string): HTMLElement {
    return el('section', {}, el('h2', {}, facet.title, el('small', {}, detail),
      chosen && button('×', `Clear the filter "${facet.title}"`, () => this.choose(app, facet, null), { class: 'plain' })));
  }

  private nameFacet(app: App, facet: Facet, names: string[], counts: number[], chosen: Chosen | null): HTMLElement {
    const section = this.section(app, facet, chosen, names.length > 1 ? String(names.length) : '');
    const most = Math.max(1, ...counts);
    const order = names.map((_, i) => i).sort((a, b) => counts[b] - counts[a] || a - b);
    const isLong = order.length > kMostNames + 2 && !this.opened.has(facet.key);
    const shown = isLong ? order.filter((i, at) => at < kMostNames || chosen?.names?.has(names[i])) : order;
    for (const i of shown) {
      const name = names[i];
      const box = on(el('input', { type: 'checkbox', 'data-focus': `${facet.key} ${i}` }), {
        change: () => {
          const set = new Set(chosen?.names ?? []);
          if (!set.delete(name)) set.add(name);
          this.choose(app, facet, { names: set });
        },
      });
      box.checked = chosen?.names?.has(name) ?? false;
      const bar = el('i');
      bar.style.width = `${(100 * counts[i]) / most}%`;
      const dot = el('em');
      if (facet.key === 'class') {
        dot.style.background = css(app.palette.ofClass(name));
        bar.style.background = css(app.palette.ofClass(name));
      } else {
        dot.hidden = true;
      }
      section.append(el('label', { class: 'name', title: name }, bar, box, dot,
        el('span', {}, name === '' ? '(none)' : shortName(name)), el('small', {}, counts[i].toLocaleString('en'))));
    }
    if (isLong) {
      section.append(button(`${order.length - shown.length} more`, '', () => {
        this.opened.add(facet.key);
        this.show(app);
      }, { class: 'plain' }));
    }
    return section;
  }

  private rangeFacet(app: App, facet: Facet, counts: number[], chosen: Chosen | null): HTMLElement {
    const { low, scale, unit } = facet.range!;
    const last = facet.range!.isWhole ? 1 : 0;  // a bar's end is the next one's begin
    const high = app.filtered.highs.get(facet.key) ?? facet.range!.high;
    const [from, to] = chosen?.range ?? [low, high];
    const says = (value: number) => String(Math.round(value * scale * 100) / 100);
    const section = this.section(app, facet, chosen, unit);
    const most = Math.max(1, ...counts);
    const width = 220;
    const height = 44;
    const step = width / counts.length;
    const drawing = svg('svg', { viewBox: `0 0 ${width} ${height}`, class: 'bars', role: 'img',
      'aria-label': `${facet.title}: ${counts.length} bars from ${says(low)} to ${says(high)} ${unit}` });
    counts.forEach((count, i) => {
      const begin = low + ((high - low) * i) / counts.length;
      const end = low + ((high - low) * (i + 1)) / counts.length;
      const isIn = end > from && begin < to + last;
      const tall = count === 0 ? 0 : Math.max(1.5, (count / most) * (height - 4));
      drawing.append(svg('rect', { x: i * step, y: 0, width: step, height, class: 'hit' },
        svg('title', {}, `${says(begin)} to ${says(end - last)} ${unit}: ${count.toLocaleString('en')}`)));
      drawing.append(svg('rect', { x: i * step + 0.5, y: height - tall, width: Math.max(0.5, step - 1), height: tall, class: isIn ? 'bar' : 'bar out' }));
    });
    drawing.append(svg('line', { x1: 0, x2: width, y1: height - 0.25, y2: height - 0.25, class: 'axis' }));
    const pick = svg('rect', { y: 0, height, class: 'pick', width: 0 });
    drawing.append(pick);
    const valueAt = (event: PointerEvent): number => {
      const frame = drawing.getBoundingClientRect();
      return Math.max(0, Math.min(1, (event.clientX - frame.left) / frame.width));
    };
    let start = 0;
    on(drawing, {
      pointerdown: (event: PointerEvent) => {
        this.dragging = true;
        start = valueAt(event);
        drawing.setPointerCapture(event.pointerId);
        event.preventDefault();
      },
      pointermove: (event: PointerEvent) => {
        if (!this.dragging) return;
        const at = valueAt(event);
        pick.setAttribute('x', String(Math.min(start, at) * width));
        pick.setAttribute('width', String(Math.abs(at - start) * width));
      },
      pointerup: (event: PointerEvent) => {
        if (!this.dragging) return;
        this.dragging = false;
        // Whole bars, so that what is coloured is what counts.
        const bins = [start, valueAt(event)].map((at) => Math.min(counts.length - 1, Math.floor(at * counts.length)));
        const begin = Math.min(...bins);
        const end = Math.max(...bins) + 1;
        this.choose(app, facet, { range: [Math.round(low + ((high - low) * begin) / counts.length),
          Math.round(low + ((high - low) * end) / counts.length) - last] });
      },
      pointercancel: () => (this.dragging = false),
    });
    const field = (value: number, which: 0 | 1) => {
      const input = on(el('input', { type: 'number', step: 'any', 'aria-label': `${facet.title}: ${which === 0 ? 'from' : 'to'}`, 'data-focus': `${facet.key} ${which}` }), {
        change: () => {
          const next: [number, number] = [from, to];
          const given = Number(input.value) / scale;
          next[which] = input.value === '' || !Number.isFinite(given) ? (which === 0 ? low : high) : Math.round(given);
          this.choose(app, facet, next[0] <= low && next[1] >= high ? null : { range: next });
        },
      });
      input.value = says(value);
      return input;
    };
    section.append(drawing, el('div', { class: 'ends' }, field(from, 0), el('span', {}, 'to'), field(to, 1)));
    return section;
  }
}

/** The end of a path says most. */
function shortName(name: string): string {
  const tail = name.slice(name.lastIndexOf('/') + 1);
  return tail === '' ? name : tail;
}
