// SPDX-License-Identifier: Apache-2.0
// Facets. A capture stays when it fits, and one of its pictures, and in there one object. Counts of a
// facet are of what fits all the others, so that they say what a click would give.
import { CaptureTable, kUnknown } from './data';

/** Bars hold whole visits. */
const kVisitBins = 25;

export interface Facet {
  key: string;
  title: string;
  of: 'capture' | 'picture' | 'object';
  column: string;
  /** A range has bins, of whole numbers each where they are counted; the others have names. */
  range?: { low: number; high: number; bins: number; unit: string; scale: number; isWhole?: boolean };
  names?: (table: CaptureTable, cameras: string[]) => string[];
}

export const kFacets: Facet[] = [
  { key: 'class', title: 'Class', of: 'object', column: 'class', names: (t) => t.names.classes },
  { key: 'visible', title: 'Visible', of: 'object', column: 'visible', range: { low: 0, high: 100, bins: 20, unit: '%', scale: 1 } },
  { key: 'truncation', title: 'Outside of the picture', of: 'object', column: 'truncation', range: { low: 0, high: 100, bins: 20, unit: '%', scale: 1 } },
  { key: 'size', title: 'Size', of: 'object', column: 'box_side', range: { low: 0, high: 1000, bins: 25, unit: '% of the side', scale: 0.1 } },
  { key: 'distance', title: 'Distance', of: 'object', column: 'distance', range: { low: 0, high: 1000, bins: 25, unit: 'm', scale: 0.01 } },
  { key: 'elevation', title: 'Seen from above', of: 'object', column: 'elevation', range: { low: -90, high: 90, bins: 18, unit: '°', scale: 1 } },
  { key: 'azimuth', title: 'Seen from around', of: 'object', column: 'azimuth', range: { low: -180, high: 180, bins: 24, unit: '°', scale: 1 } },
  { key: 'brightness', title: 'Brightness', of: 'picture', column: 'brightness', range: { low: 0, high: 100, bins: 25, unit: '%', scale: 1 } },
  { key: 'camera', title: 'Camera', of: 'picture', column: 'camera', names: (_, cameras) => cameras },
  { key: 'visit', title: 'Visit', of: 'capture', column: 'visit', range: { low: 0, high: 0, bins: kVisitBins, unit: '', scale: 1, isWhole: true } },
  { key: 'phase', title: 'Phase', of: 'capture', column: 'phase', names: (t) => t.names.phases },
  { key: 'environment', title: 'Environment', of: 'capture', column: 'environment', names: (t) => t.names.environments },
  { key: 'split', title: 'Split', of: 'capture', column: 'split', names: (t) => t.names.splits },
  { key: 'clip', title: 'Clip', of: 'capture', column: 'clip', range: { low: 0, high: 0, bins: kVisitBins, unit: '', scale: 1, isWhole: true } },
  { key: 'lint', title: 'Findings of lint', of: 'capture', column: '', names: (t) => t.checks ?? [] },
  { key: 'findings', title: 'Reader', of: 'capture', column: 'findings', names: () => ['read without fault', 'files with faults'] },
];

/** What a facet lets pass: numbers of names, or a range in units of the column. */
export interface Chosen {
  names?: Set<string>;
  range?: [number, number];
}

export function readChosen(facet: Facet, text: string | undefined): Chosen | null {
  if (text === undefined || text === '') return null;
  if (!facet.range) return { names: new Set(JSON.parse(text) as string[]) };
  const numbers = text.split('~').map(Number);
  return numbers.length === 2 && numbers.every(Number.isFinite) ? { range: [numbers[0], numbers[1]] } : null;
}

export function writeChosen(chosen: Chosen): string {
  return chosen.range ? chosen.range.join('~') : JSON.stringify([...chosen.names!].sort());
}

export interface Filtered {
  places: Int32Array;  ///< Of captures that stay.
  objects: number;  ///< That fit.
  counts: Map<string, number[]>;
  highs: Map<string, number>;  ///< Upper ends of ranges.
}

/** Distances, visits and clips have no end of their own. */
function highOf(facet: Facet, table: CaptureTable): number {
  const isDistance = facet.key === 'distance';
  if (!isDistance && !facet.range!.isWhole) return facet.range!.high;
  const values = table.of(facet.column);
  const count = isDistance ? table.objects : table.captures;
  let most = 0;
  for (let i = 0; i < count; ++i) most = Math.max(most, values[i]);
  return isDistance ? Math.max(100, Math.ceil(most / 100) * 100) : Math.ceil((most + 1) / kVisitBins) * kVisitBins;
}

/** `captures`: of the dataset. Those that the table has not yet fit as long as nothing is filtered by. */
export function filter(table: CaptureTable, cameras: string[], facets: Map<string, string>, captures: number): Filtered {
  const counts = new Map<string, number[]>();
  const highs = new Map<string, number>();
  const tests = kFacets.map((facet, bit) => {
    let chosen: Chosen | null = null;
    try {
      // Nothing is filtered by what is not known yet.
      if (facet.key !== 'lint' || table.checks) chosen = readChosen(facet, facets.get(facet.key));
    } catch {
      // An address that somebody has changed.
    }
    const names = facet.names?.(table, cameras) ?? [];
    const high = facet.range ? highOf(facet, table) : 0;
    if (facet.range) highs.set(facet.key, high);
    const count = new Array<number>(facet.range ? facet.range.bins : names.length).fill(0);
    counts.set(facet.key, count);
    const values = facet.column === '' ? new Int32Array() : table.of(facet.column);
    const allowed = chosen?.names ? names.map((name) => chosen!.names!.has(name)) : null;
    const range = chosen?.range ?? null;
    const valueOf = (i: number) => facet.key === 'findings' ? Math.min(1, values[i]) : values[i];
    const fits = (i: number): boolean => {
      if (allowed && facet.key === 'lint') return table.checksOf(i).some((check) => allowed[check]);
      if (allowed) return allowed[valueOf(i)] === true;
      return !range || (values[i] !== kUnknown && values[i] >= range[0] && values[i] <= range[1]);
    };
    const low = facet.range?.low ?? 0;
    const bins = facet.range?.bins ?? 0;
    const add = (i: number): void => {
      if (facet.key === 'lint') {
        for (const check of table.checks ? table.checksOf(i) : []) ++count[check];
        return;
      }
      const value = valueOf(i);
      if (!facet.range) {
        ++count[value];
      } else if (value !== kUnknown) {
        ++count[Math.min(bins - 1, Math.max(0, Math.floor(((value - low) / (high - low)) * bins)))];
      }
    };
    return { facet, bit: 1 << bit, fits, add, isActive: chosen !== null };
  });
  const of = (what: Facet['of']) => tests.filter((test) => test.facet.of === what);
  const objectTests = of('object');
  const pictureTests = of('picture');
  const captureTests = of('capture');
  const filtersObjects = objectTests.some((test) => test.isActive);
  const failing = (list: typeof tests, i: number): number => {
    let bits = 0;
    for (const test of list) if (test.isActive && !test.fits(i)) bits |= test.bit;
    return bits;
  };
  /** What fails nothing counts everywhere, what fails one facet counts there. */
  const tally = (list: typeof tests, i: number, bits: number): void => {
    if ((bits & (bits - 1)) !== 0) return;
    for (const test of list) if (bits === 0 || bits === test.bit) test.add(i);
  };

  const places: number[] = [];
  const pictures = table.of('pictures');
  const objects = table.of('objects');
  let picture = 0;
  let object = 0;
  let fitting = 0;
  for (let capture = 0; capture < table.captures; ++capture) {
    const captureBits = failing(captureTests, capture);
    let stays = false;
    for (const end = picture + pictures[capture]; picture < end; ++picture) {
      const pictureBits = failing(pictureTests, picture);
      let shows = !filtersObjects;
      for (const last = object + objects[picture]; object < last; ++object) {
        const bits = failing(objectTests, object);
        if (bits === 0) shows = true;
        const all = bits | pictureBits | captureBits;
        if (all === 0) ++fitting;
        tally(objectTests, object, all);
      }
      if (!shows) continue;
      tally(pictureTests, picture, pictureBits | captureBits);
      if (pictureBits === 0) stays = true;
    }
    if (pictures[capture] === 0) stays = !filtersObjects;
    if (!stays) continue;
    tally(captureTests, capture, captureBits);
    if (captureBits === 0) places.push(capture);
  }
  if (!tests.some((test) => test.isActive)) {
    for (let capture = table.captures; capture < captures; ++capture) places.push(capture);
  }
  return { places: Int32Array.from(places), objects: fitting, counts, highs };
}
