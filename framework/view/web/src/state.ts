// SPDX-License-Identifier: Apache-2.0
// What is shown, as an address behind '#': whoever opens it sees the same.

export type Page = 'grid' | 'capture' | 'compare' | 'stats' | 'findings' | 'run';
export type CompareMode = 'side' | 'divider' | 'difference';

export interface State {
  page: Page;
  dataset: number;
  other: number;  ///< Dataset that it is compared with.
  mode: CompareMode;
  capture: number;
  frame: number;
  object: number;  ///< Id of the one that is chosen; 0: none.
  layers: Set<string>;
  colour: 'class' | 'instance';
  opacity: number;  ///< Percent.
  card: number;  ///< Width of pictures in the grid.
  facets: Map<string, string>;
  space: boolean;  ///< The 3-D view is open.
  eye: Eye;  ///< From where it looks.
  view: Place | null;  ///< The part of the picture that is seen; null: all of it.
  divider: number;  ///< Of a comparison: percent of the width.
  at: number;  ///< Capture that the grid shows first; -1: the first of all.
  plays: boolean;  ///< The clip of the capture.
  speed: number;  ///< One of kSpeeds.
}

/** Of a picture: its pixels in the middle (x, y), and how many there are from left to right. */
export type Place = [number, number, number];

/** Degrees around and above, and percent of the size at which all is seen. */
export type Eye = [number, number, number];

export const kEye: Eye = [40, 29, 100];
const kDivider = 50;

export const kSpeeds = [0.25, 0.5, 1, 2, 4];

const kPages: Page[] = ['grid', 'capture', 'compare', 'stats', 'findings', 'run'];
const kModes: CompareMode[] = ['side', 'divider', 'difference'];

function whole(text: string | null, otherwise: number): number {
  return text !== null && /^\d{1,10}$/.test(text) ? Number(text) : otherwise;
}

/** Three numbers; what somebody has changed is `otherwise`. */
function three<T>(text: string | null, otherwise: T): T | [number, number, number] {
  const numbers = text === null || !/^[-\d.~]{5,60}$/.test(text) ? [] : text.split('~').map((word) => word === '' ? NaN : Number(word));
  return numbers.length === 3 && numbers.every((number) => Math.abs(number) <= 1e6) ? numbers as [number, number, number] : otherwise;
}

function rounded(numbers: number[], step: number): string {
  return numbers.map((number) => String(Number((Math.round(number / step) * step).toFixed(3)))).join('~');
}

export function readState(hash: string): State {
  const cut = hash.indexOf('?');
  const words = hash.slice(0, cut < 0 ? undefined : cut).replace(/^#?\/?/, '').split('/');
  const query = new URLSearchParams(cut < 0 ? '' : hash.slice(cut + 1));
  const facets = new Map<string, string>();
  for (const [key, value] of query) if (key.startsWith('f.')) facets.set(key.slice(2), value);
  const layers = query.get('layers');
  return {
    page: kPages.includes(words[0] as Page) ? (words[0] as Page) : 'grid',
    dataset: whole(query.get('dataset'), 0),
    other: whole(query.get('other'), -1),
    mode: kModes.find((mode) => mode === query.get('mode')) ?? 'side',
    capture: whole(words[1] ?? null, 0),
    frame: whole(words[2] ?? null, 0),
    object: whole(query.get('object'), 0),
    layers: new Set(layers === null ? ['box'] : layers.split('.').filter((name) => name !== '')),
    colour: query.get('colour') === 'instance' ? 'instance' : 'class',
    opacity: Math.min(100, whole(query.get('opacity'), 60)),
    card: Math.min(640, Math.max(120, whole(query.get('card'), 240))),
    facets,
    space: query.get('space') === '1',
    eye: three(query.get('eye'), kEye),
    view: three(query.get('view'), null),
    divider: Math.min(100, whole(query.get('divider'), kDivider)),
    at: whole(query.get('at'), -1),
    plays: query.get('play') === '1' && words[0] === 'capture',
    speed: kSpeeds.find((speed) => String(speed) === query.get('speed')) ?? 1,
  };
}

export function addressOf(state: State): string {
  const query = new URLSearchParams();
  if (state.dataset !== 0) query.set('dataset', String(state.dataset));
  if (state.page === 'compare') {
    query.set('other', String(state.other));
    if (state.mode !== 'side') query.set('mode', state.mode);
    if (state.mode === 'divider' && state.divider !== kDivider) query.set('divider', String(state.divider));
  }
  if (state.object !== 0 && state.page === 'capture') query.set('object', String(state.object));
  const layers = [...state.layers].sort().join('.');
  if (layers !== 'box') query.set('layers', layers);
  if (state.colour !== 'class') query.set('colour', state.colour);
  if (state.opacity !== 60) query.set('opacity', String(state.opacity));
  if (state.card !== 240) query.set('card', String(state.card));
  if (state.space && state.page === 'capture') {
    query.set('space', '1');
    if (rounded(state.eye, 1) !== rounded(kEye, 1)) query.set('eye', rounded(state.eye, 1));
  }
  if (state.view && (state.page === 'capture' || state.page === 'compare')) query.set('view', rounded(state.view, 0.01));
  if (state.at >= 0 && state.page === 'grid') query.set('at', String(state.at));
  if (state.plays && state.page === 'capture') query.set('play', '1');
  if (state.speed !== 1 && state.page === 'capture') query.set('speed', String(state.speed));
  for (const [key, value] of state.facets) query.set('f.' + key, value);
  const place = state.page === 'capture' || state.page === 'compare' ? `/${state.capture}/${state.frame}` : '';
  const text = query.toString();
  return `#/${state.page}${place}${text === '' ? '' : '?' + text}`;
}
