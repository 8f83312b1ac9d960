// SPDX-License-Identifier: Apache-2.0
import { App, LabelStore, Lint } from './app';
import { CapturePage, kKeys } from './capture';
import { ComparePage } from './compare';
import { CaptureLabels, CaptureTable, DatasetInfo, DatasetState, Gone, SiteState, get, isReport } from './data';
import { button, clear, el, on, plural, remake } from './dom';
import { FacetBar } from './facets';
import { filter } from './filter';
import { Grid } from './grid';
import { Palette, kLayers } from './layers';
import { FindingsPage, RunPage, StatsPage } from './pages';
import { Page, State, addressOf, readState } from './state';

const kAddressMs = 250;
/** Who changes one of them shows another picture. */
const kOther: (keyof State)[] = ['page', 'dataset', 'other', 'capture', 'frame'];

/** Of a run that has made nothing that could be read yet. */
function noDataset(site: SiteState): DatasetInfo {
  return { name: site.folder.slice(site.folder.lastIndexOf('/') + 1), folder: site.folder, format: '', holds: [], cameras: [], classes: [], captures: [], skeletons: {}, faults: [], fault_count: 0 };
}

/** What a dataset is compared with unless asked: the one of its name on the other side; -1: nothing. */
function partnerOf(datasets: DatasetState[], dataset: number): number {
  const rank = (i: number): number => i === dataset ? -1
    : 2 * Number(datasets[i].is_other !== datasets[dataset].is_other) + Number(datasets[i].name === datasets[dataset].name);
  let best = -1;
  datasets.forEach((_, i) => {
    if (rank(i) >= 0 && (best < 0 || rank(i) > rank(best))) best = i;
  });
  return best;
}

/** Addresses may name datasets that are not there. */
function complete(state: State, datasets: DatasetState[]): void {
  if (state.dataset >= datasets.length) state.dataset = 0;
  const isOther = state.other >= 0 && state.other < datasets.length && state.other !== state.dataset;
  if (!isOther) state.other = partnerOf(datasets, state.dataset);
  if (state.other < 0 && state.page === 'compare') state.page = 'grid';
}

class Site {
  private readonly top = el('header');
  private readonly faults = el('div', { class: 'faults', role: 'status' });
  private readonly tools = el('section', { class: 'tools', 'aria-label': 'Overlays' });
  private readonly status = el('div', { class: 'status', role: 'status' });
  private readonly facets = new FacetBar();
  private readonly grid = new Grid();
  private readonly gridPage = el('main', { class: 'browse' }, this.facets.element, this.grid.element);
  private readonly capture = new CapturePage();
  private readonly compare = new ComparePage();
  private readonly stats = new StatsPage();
  private readonly findings = new FindingsPage();
  private readonly run = new RunPage();
  private readonly help = el('dialog', { 'aria-label': 'Keys' });
  private app!: App;
  private stores = new Map<number, LabelStore>();
  private loading = 0;
  private addressed = 0;  ///< When the address was changed.
  private noting = 0;  ///< Timer of a change that it does not have yet.
  private tabs = false;  ///< From button to button by keyboard.
  private isGone = false;  ///< Nobody answers any more, which stays said.
  private isHeld = false;  ///< A pointer is down: what is below it must not be made anew, or the click is lost.

  async start(): Promise<void> {
    // The token of the first address is a cookie by now.
    if (!isReport && location.search !== '') history.replaceState(null, '', location.pathname + location.hash);
    document.body.append(this.top, this.faults, this.tools, this.gridPage, this.capture.element, this.compare.element,
      this.stats.element, this.findings.element, this.run.element, this.status, this.help);
    this.makeHelp();
    this.setTheme(this.keptTheme());
    window.addEventListener('hashchange', () => void (this.app && this.follow(readState(location.hash))));
    document.addEventListener('keydown', (event) => this.press(event));
    document.addEventListener('keydown', (event) => (this.tabs ||= event.key === 'Tab'), true);
    document.addEventListener('pointerdown', () => {
      this.tabs = false;
      this.isHeld = true;
    }, true);
    for (const end of ['pointerup', 'pointercancel']) {
      // The click comes after it.
      document.addEventListener(end, () => window.setTimeout(() => (this.isHeld = false)), true);
    }
    await this.load(readState(location.hash));
    if (!isReport) this.watch();
  }

  /** Opens the dataset that the address names, and begins to read its labels. `old`: what is shown of it, which has grown; that
   *  stays until as much is known of what is there now. */
  private async load(state: State, old: App | null = null): Promise<void> {
    const site = (await get('/api/state')) as SiteState;
    complete(state, site.datasets);
    const info = site.datasets.length > 0 ? (await get(`/api/${state.dataset}/info`)) as DatasetInfo : noDataset(site);
    if (site.datasets.length === 0) state.page = 'run';
    const table = new CaptureTable();
    const app: App = {
      state, site, info, table, holds: new Set(info.holds), palette: new Palette(info.classes),
      filtered: filter(table, info.cameras, state.facets, info.captures.length),
      lint: new Lint(() => this.takeFindings()),
      go: (change, replaces) => this.go(change, replaces),
      note: (change) => this.note(change),
      labels: (capture, dataset = state.dataset) => this.labels(capture, dataset),
    };
    const ticket = ++this.loading;
    if (old && old.info.folder === info.folder) {
      await this.readIndex(app, ticket, Math.min(old.table.captures, info.captures.length));
      if (table.captures === info.captures.length) await this.readBrightness(app, ticket, Math.min(old.table.brightCaptures, info.captures.length));
      if (ticket !== this.loading || table.captures < Math.min(old.table.captures, info.captures.length)) return;
      // Somebody may have gone on meanwhile.
      app.state = this.app.state;
      app.filtered = filter(table, info.cameras, app.state.facets, info.captures.length);
    }
    this.stores.clear();
    this.app = app;
    document.title = `${info.name} – diorama view`;
    this.show();
    // An address that filters by them needs them.
    if (site.is_linted || app.state.facets.has('lint')) app.lint.ask();
    const read = async (): Promise<void> => {
      await this.readIndex(app, ticket, info.captures.length);
      if (app.holds.has('color')) await this.readBrightness(app, ticket, info.captures.length);
    };
    read().catch((error: Error) => this.fail(error));
  }

  private takeFindings(): void {
    const { app } = this;
    const findings = app.lint.findingsOf(app.site, app.state.dataset);
    if (findings) app.table.setFindings(findings, app.info.captures);
    this.refilter();
    this.show();
  }

  private labels(capture: number, dataset: number): Promise<CaptureLabels> {
    let store = this.stores.get(dataset);
    if (!store) this.stores.set(dataset, (store = new LabelStore(dataset)));
    return store.of(capture);
  }

  /** Columns come while they are made. */
  private readIndex(app: App, ticket: number, captures: number): Promise<void> {
    return this.readParts(app, ticket, 'index', [400, 120], captures, () => app.table.captures, (part) => {
      app.table.add(part);
      return () => {
        for (const name of app.table.names.classes) app.palette.ofClass(name);
        this.show();
      };
    });
  }

  /** Comes last: the pictures have to be looked at for it. */
  private readBrightness(app: App, ticket: number, captures: number): Promise<void> {
    return this.readParts(app, ticket, 'brightness', [1500, 500], captures, () => app.table.brightCaptures, (part) => {
      app.table.addBrightness(part);
      return () => {
        if (app.state.page === 'grid') this.show();
      };
    });
  }

  /** Asks for parts until `count` has so many captures. `take` gives what shows them: called once in a
   *  while (first of the milliseconds), and when all are there. Asks anew after the second ones. Ends before when there is more
   *  in the dataset than when it was opened: places of captures are others then. */
  private async readParts(app: App, ticket: number, what: string, [showMs, askMs]: number[], captures: number, count: () => number,
    take: (part: any) => () => void): Promise<void> {
    let shown = -Infinity;
    while (count() < captures) {
      const before = count();
      const part = await get(`/api/${app.state.dataset}/${what}/${before}`);
      if (ticket !== this.loading || part.generation !== app.site.generation) return;
      const show = take(part);
      if (this.app === app && (count() >= captures || performance.now() - shown > showMs)) {
        while (this.isHeld) await new Promise((resolve) => setTimeout(resolve, 30));
        if (ticket !== this.loading) return;
        this.refilter();
        show();
        shown = performance.now();
      }
      if (count() === before) {
        if (isReport) return;
        await new Promise((resolve) => setTimeout(resolve, askMs));
      }
    }
  }

  private refilter(): void {
    const { table, info, state } = this.app;
    this.app.filtered = filter(table, info.cameras, state.facets, info.captures.length);
  }

  private go(change: Partial<State>, replaces = false): void {
    const state = { ...this.app.state, ...change };
    if (state.page !== 'capture') state.plays = false;
    // What is another picture is shown whole, what is filtered from its beginning.
    if (!('view' in change) && kOther.some((key) => key in change && change[key] !== this.app.state[key])) state.view = null;
    if ('facets' in change) state.at = -1;
    this.addressed = performance.now();
    const address = addressOf(state);
    if (replaces) history.replaceState(null, '', address);
    else if (address !== location.hash) history.pushState(null, '', address);
    void this.follow(state);
  }

  private note(change: Partial<State>): void {
    this.app.state = { ...this.app.state, ...change };
    // Browsers ignore addresses that change too often.
    const wait = Math.max(0, kAddressMs - (performance.now() - this.addressed));
    this.noting ||= window.setTimeout(() => {
      this.noting = 0;
      this.addressed = performance.now();
      history.replaceState(null, '', addressOf(this.app.state));
    }, wait);
  }

  private async follow(state: State): Promise<void> {
    window.clearTimeout(this.noting);
    this.noting = 0;
    if (state.dataset !== this.app.state.dataset) {
      await this.load(state).catch((error: Error) => this.fail(error));
      return;
    }
    complete(state, this.app.site.datasets);
    const filters = JSON.stringify([...state.facets]) !== JSON.stringify([...this.app.state.facets]);
    this.app.state = state;
    if (state.facets.has('lint')) this.app.lint.ask();
    if (filters) this.refilter();
    this.show();
  }

  private show(): void {
    const { app } = this;
    const { page } = app.state;
    this.showTop();
    this.showTools();
    const pages: [Page, HTMLElement][] = [['grid', this.gridPage], ['capture', this.capture.element],
      ['compare', this.compare.element], ['stats', this.stats.element], ['findings', this.findings.element], ['run', this.run.element]];
    for (const [name, element] of pages) element.hidden = name !== page;
    this.tools.hidden = page !== 'grid' && page !== 'capture' && page !== 'compare';
    if (page === 'grid') {
      this.facets.show(app);
      this.grid.show(app);
    }
    if (page === 'capture') void this.capture.show(app);
    else this.capture.rest();
    if (page === 'compare') void this.compare.show(app);
    if (page === 'stats') this.stats.show(app);
    if (page === 'findings') this.findings.show(app);
    if (page === 'run') this.run.show(app);
    if (this.isGone) return;
    const left = app.info.captures.length - app.table.captures;
    this.status.classList.remove('bad');
    this.status.hidden = left === 0 || app.info.captures.length === 0;
    this.status.textContent = `Reading labels: ${app.table.captures.toLocaleString('en')} of ${plural(app.info.captures.length, 'capture')}`;
  }

  private showTop(): void {
    const { app } = this;
    const refocus = remake(this.top, 'page');
    const choice = on(el('select', { 'aria-label': 'Dataset' }), {
      change: () => this.go({ dataset: Number(choice.value), page: 'grid', facets: new Map(), object: 0 }),
    });
    app.site.datasets.forEach((dataset, i) => choice.append(el('option', { value: i, title: dataset.folder },
      `${dataset.name} (${dataset.format})${dataset.is_other ? ', the other one' : ''}`)));
    choice.value = String(app.state.dataset);
    this.top.append(el('span', { class: 'mark' }, 'diorama'),
      app.site.datasets.length > 1 ? choice : el('span', { class: 'dataset' }, app.info.name, el('small', {}, app.info.format)));
    const tabs = el('nav', { 'aria-label': 'Pages' });
    for (const [page, title] of [['grid', 'Captures'], ['compare', 'Compare'], ['stats', 'Statistics'], ['findings', 'Findings'], ['run', 'Run']] as [Page, string][]) {
      if (page === 'compare' && (isReport || app.state.other < 0)) continue;
      const isHere = page === app.state.page || (page === 'grid' && app.state.page === 'capture');
      tabs.append(button(title, '', () => this.go(page === 'compare' ? { page, capture: this.captureHere() } : { page }), { 'aria-current': isHere ? 'page' : false, 'data-page': page }));
    }
    this.top.append(tabs, el('span', { class: 'folder', title: app.site.folder }, el('bdi', {}, app.site.folder)),
      button('◐', 'Light or dark', () => this.setTheme(document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark'), { 'data-page': 'theme' }),
      button('?', 'Keys (?)', () => this.help.showModal()));
    clear(this.faults);
    for (const fault of app.site.faults) this.faults.append(el('p', { class: 'bad' }, `Left out: ${fault}`));
    // Tables of a run that goes on are not there yet.
    if (app.site.is_finished) {
      for (const fault of app.info.faults) this.faults.append(el('p', { class: 'bad' }, fault));
      const more = app.info.fault_count - app.info.faults.length;
      if (more > 0) this.faults.append(el('p', { class: 'bad' }, `and ${more.toLocaleString('en')} more: see Findings`));
    }
    refocus();
  }

  /** The capture that is looked at, else the first of the dataset. */
  private captureHere(): number {
    const { state, info } = this.app;
    return info.captures.includes(state.capture) ? state.capture : info.captures[0] ?? 0;
  }

  private showTools(): void {
    const { state, holds } = this.app;
    const refocus = remake(this.tools, 'tool');
    for (const layer of kLayers) {
      if (!layer.held.some((name) => holds.has(name))) continue;
      const tool = button('', `${layer.title} (${layer.hotkey})`, () => this.toggle(layer.key),
        { 'aria-pressed': state.layers.has(layer.key) ? 'true' : 'false', 'data-tool': layer.key });
      tool.append(layer.title, el('kbd', {}, layer.hotkey));
      this.tools.append(tool);
    }
    const slider = (title: string, key: 'opacity' | 'card', least: number, most: number) => {
      const input = on(el('input', { type: 'range', min: least, max: most, step: key === 'card' ? 20 : 5, 'data-tool': key, 'aria-label': title }), {
        input: () => this.go({ [key]: Number(input.value) }, true),
      });
      input.value = String(state[key]);
      return el('label', {}, el('small', {}, title), input);
    };
    const colour = button('', 'Colours by class or by instance (i)',
      () => this.go({ colour: state.colour === 'class' ? 'instance' : 'class' }, true), { 'data-tool': 'colour' });
    colour.append(`by ${state.colour}`, el('kbd', {}, 'i'));
    this.tools.append(colour, slider('Opacity', 'opacity', 0, 100));
    if (state.page === 'grid') this.tools.append(slider('Size', 'card', 120, 640));
    refocus();
  }

  private toggle(layer: string): void {
    const layers = new Set(this.app.state.layers);
    if (!layers.delete(layer)) layers.add(layer);
    this.go({ layers }, true);
  }

  private press(event: KeyboardEvent): void {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || this.help.open || !this.app) return;
    const target = event.target as HTMLElement;
    if (target.matches('input, select, textarea') && event.key !== 'Escape') return;
    if (event.key === ' ' && target.matches('button, summary, a')) {
      // Who has clicked it did not mean to stay there.
      if (this.tabs) return;
      target.blur();
    }
    const { state } = this.app;
    const layer = kLayers.find((one) => one.hotkey === event.key);
    const pictures = !this.tools.hidden;
    if (event.key === '?') this.help.showModal();
    else if (state.page === 'capture' && this.capture.press(event)) event.preventDefault();
    else if (state.page === 'compare' && this.compare.press(event)) event.preventDefault();
    else if (event.key === 'g') this.go({ page: 'grid' });
    else if (pictures && layer && layer.held.some((name) => this.app.holds.has(name))) this.toggle(layer.key);
    else if (pictures && event.key === 'i') this.go({ colour: state.colour === 'class' ? 'instance' : 'class' }, true);
    else if (pictures && event.key === '[') this.go({ opacity: Math.max(0, state.opacity - 10) }, true);
    else if (pictures && event.key === ']') this.go({ opacity: Math.min(100, state.opacity + 10) }, true);
    else if (state.page === 'grid' && event.key.startsWith('Arrow') && target === document.body) this.grid.element.focus();
    else return;
    event.preventDefault();
  }

  private makeHelp(): void {
    const list = el('dl');
    for (const [key, what] of kKeys) list.append(el('dt', {}, key), el('dd', {}, what));
    this.help.append(el('h2', {}, 'Keys'), list, button('Close', '', () => this.help.close(), { class: 'main' }));
  }

  private keptTheme(): string {
    try {
      const kept = localStorage.getItem('diorama-theme');
      if (kept === 'light' || kept === 'dark') return kept;
    } catch {
      // Files may have no storage.
    }
    return matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
  }

  private setTheme(theme: string): void {
    document.documentElement.dataset.theme = theme;
    try {
      localStorage.setItem('diorama-theme', theme);
    } catch {
      // Then it is not kept.
    }
    if (this.app) this.show();
  }

  /** Sees that a run has gone on. A page that nobody looks at lets the program end. */
  private watch(): void {
    const look = async (): Promise<void> => {
      if (document.visibilityState === 'visible') {
        try {
          const site = (await get('/api/state')) as SiteState;
          if (site.generation !== this.app.site.generation) await this.load(this.app.state, this.app);
          else if (!site.is_finished && this.app.state.page === 'run') this.run.show(this.app);
        } catch (error) {
          this.fail(error as Error);
          if (error instanceof Gone) return;
        }
      }
      window.setTimeout(() => void look(), 4000);
    };
    window.setTimeout(() => void look(), 4000);
  }

  fail(error: Error): void {
    this.isGone ||= error instanceof Gone;
    this.status.hidden = false;
    this.status.classList.add('bad');
    this.status.textContent = error instanceof Gone
      ? `No answer: ${error.message}. Start "diorama view" again and open the address that it prints.` : error.message;
  }
}

const site = new Site();
site.start().catch((error: Error) => site.fail(error));
