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
  const tests = kFacets.map((facet, place) => {
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
    return { facet, bit: 1 << place, values, high, count, allowed, range: chosen?.range ?? null, isActive: chosen !== null };
  });
  type Test = (typeof tests)[number];
  const numberOf = (test: Test, value: number): number => test.facet.key === 'findings' ? Math.min(1, value) : value;
  /** Which facets each of `size` things fails, as bits. One column after the other: there may be a million objects. */
  const failed = (of: Facet['of'], size: number): Int32Array => {
    const bits = new Int32Array(size);
    for (const test of tests) {
      if (test.facet.of !== of || !test.isActive) continue;
      const { bit, values, allowed, range } = test;
      for (let i = 0; i < size; ++i) {
        const fits = range ? values[i] !== kUnknown && values[i] >= range[0] && values[i] <= range[1]
          : test.facet.key === 'lint' ? table.checksOf(i).some((check) => allowed![check])
          : allowed ? allowed[numberOf(test, values[i])] === true : true;
        if (!fits) bits[i] |= bit;
      }
    }
    return bits;
  };
  /** What fails nothing counts everywhere, what fails one facet counts there. */
  const tally = (of: Facet['of'], bits: Int32Array): void => {
    for (const test of tests) {
      if (test.facet.of !== of) continue;
      const { facet: { range, key }, bit, values, high, count } = test;
      if (range) {
        const { low, bins } = range;
        const perUnit = bins / (high - low);
        for (let i = 0; i < bits.length; ++i) {
          if ((bits[i] !== 0 && bits[i] !== bit) || values[i] === kUnknown) continue;
          const bin = ((values[i] - low) * perUnit) | 0;
          ++count[bin < 0 ? 0 : bin < bins ? bin : bins - 1];
        }
        continue;
      }
      for (let i = 0; i < bits.length; ++i) {
        if (bits[i] !== 0 && bits[i] !== bit) continue;
        if (key !== 'lint') ++count[numberOf(test, values[i])];
        else for (const check of table.checks ? table.checksOf(i) : []) ++count[check];
      }
    }
  };

  const kOut = -1;  // fails more than one
  const filtersObjects = tests.some((test) => test.facet.of === 'object' && test.isActive);
  const captureBits = failed('capture', table.captures);
  const pictureBits = failed('picture', table.pictures);
  const objectBits = failed('object', table.objects);
  const places: number[] = [];
  const pictures = table.of('pictures');
  const objects = table.of('objects');
  let picture = 0;
  let object = 0;
  let fitting = 0;
  for (let capture = 0; capture < table.captures; ++capture) {
    const own = captureBits[capture];
    let stays = pictures[capture] === 0 && !filtersObjects;
    for (const end = picture + pictures[capture]; picture < end; ++picture) {
      const above = pictureBits[picture] | own;
      let shows = !filtersObjects;
      for (const last = object + objects[picture]; object < last; ++object) {
        if (objectBits[object] === 0) shows = true;
        objectBits[object] |= above;
        if (objectBits[object] === 0) ++fitting;
      }
      if (shows && pictureBits[picture] === 0) stays = true;
      pictureBits[picture] = shows ? above : kOut;
    }
    if (stays && own === 0) places.push(capture);
    if (!stays) captureBits[capture] = kOut;
  }
  tally('object', objectBits);
  tally('picture', pictureBits);
  tally('capture', captureBits);
  if (!tests.some((test) => test.isActive)) {
    for (let capture = table.captures; capture < captures; ++capture) places.push(capture);
  }
  return { places: Int32Array.from(places), objects: fitting, counts, highs };
}
