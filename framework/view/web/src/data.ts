// SPDX-License-Identifier: Apache-2.0
// What the server says, or the files of a report: addresses are those of dataset_view.h.

export interface DatasetState {
  name: string;
  folder: string;
  is_other: boolean;  ///< Of the folder that is compared with.
  format: string;
  captures: number;
  all_captures: number;
  indexed: number;
}

export interface SiteState {
  folder: string;
  generation: number;
  edition: number;  ///< While it stays the same, so do captures that are there.
  is_finished: boolean;
  is_linted: boolean;  ///< The findings are known, and cost nothing.
  faults: string[];  ///< Of datasets that could not be opened beside these.
  datasets: DatasetState[];
}

export interface DatasetInfo {
  name: string;
  folder: string;
  format: string;
  holds: string[];
  cameras: string[];
  classes: string[];
  captures: number[];
  skeletons: { [name: string]: Skeleton };  ///< By class; '' is for those of all others.
  faults: string[];  ///< The first that its reader found when it opened it.
  fault_count: number;
}

export interface Skeleton {
  names: string[];
  lines: [number, number][];
}

export type Box = [number, number, number, number];

export interface ObjectLabels {
  id: number;
  path: string;
  class: string;
  labels: { [taxonomy: string]: string };
  box: Box | null;
  amodal_box?: Box | null;
  occlusion?: number | null;
  truncation?: number | null;
  visible_pixels?: number;
  distance_m?: number | null;
  world_from_node?: number[];
  bounds?: [number[], number[]];
  edges?: number[][];
  keypoints?: Keypoint[];
}

/** x, y, and 0: not told, 1: hidden, 2: seen. */
export type Keypoint = [number, number, 0 | 1 | 2];

export interface FrameLabels {
  camera: string;
  width: number;
  height: number;
  lens?: string;
  focal?: [number, number];
  centre?: [number, number];
  world_from_camera?: number[];
  objects: ObjectLabels[];
  files?: { [held: string]: string };
}

export interface Finding {
  check: string;
  file?: string;
  message?: string;
  capture?: number;
  camera?: string;
  object?: string;
  found?: string;
  expected?: string;
}

/** The place of a capture in a clip, whose captures follow each other. */
export interface Clip {
  clip: number;
  frame: number;
  frames: number;
  fps: number;
}

export interface CaptureLabels {
  capture: number;
  visit: number;
  phase: string;
  environment: string;
  split: string;
  clip?: Clip;
  frames: FrameLabels[];
  findings: Finding[];
}

export interface ObjectMasks {
  objects: { id: number; box: Box; runs: number[] }[];
}

export interface RunState {
  folder?: string;
  seed?: number;
  version?: string;
  job?: string;
  captures?: number;
  done?: number;
  is_finished?: boolean;
  workers?: { name: string; role: string; description: string; is_alive: boolean; memory_bytes: number; captures: number }[];
  stages?: { [name: string]: number };  ///< Seconds, of all workers.
  last?: number[];  ///< Captures, the last one first.
  views?: { views: number; draws: number; refused: { [condition: string]: number }; unmet: number };
  settle?: {
    visits: number;
    at_rest: number;
    falling_objects: number;
    longest_rest_s: number | null;
    verdicts: { kind: string; why: string; count: number; first: string }[];
  };
}

/** What "diorama lint" has found in one dataset. */
export interface LintReport {
  dataset: string;
  format: string;
  files: number;
  checks: number;
  findings: Finding[];
}

/** What all captures of two datasets differ in, as lines, and which ones do. */
export interface Difference {
  pages: string[];
  contents: string[];
  captures: number;
  differing: number[];
}

export interface BrightnessPart {
  from: number;
  captures: number;
  brightness: number[];
}

interface IndexPart {
  from: number;
  columns: { [name: string]: number[] };
  names: { classes: string[]; phases: string[]; environments: string[]; splits: string[] };
}

/** A report: files beside the page instead of a server. */
export const isReport = document.querySelector('meta[name=diorama]') !== null;

/** The program has ended, or the token is not known any more. */
export class Gone extends Error {}

interface Asked {
  promise: Promise<any>;
  resolve: (value: unknown) => void;
}

/** What scripts of a report are on their way with, for all who want it. */
const asked = new Map<string, Asked>();
/** `text`: JSON; null: nothing. */
(window as any).diorama_data = (path: string, text: string | null): void => {
  asked.get(path)?.resolve(text === null ? null : JSON.parse(text));
  asked.delete(path);
};

function fileOf(path: string): string {
  return 'data/' + path.slice('/api/'.length).replaceAll('/', '_');
}

function getFromFile(path: string): Promise<any> {
  const known = asked.get(path);
  if (known) return known.promise;
  const promise = new Promise((resolve, reject) => {
    asked.set(path, { promise: undefined!, resolve });
    const script = document.createElement('script');
    script.src = fileOf(path) + '.js';
    script.onload = () => script.remove();
    script.onerror = () => {
      script.remove();
      asked.delete(path);
      reject(new Error('not in this report'));
    };
    document.head.append(script);
  });
  asked.get(path)!.promise = promise;
  return promise;
}

/** JSON at an address; null while the program is still at work on it. */
export async function get(path: string): Promise<any> {
  if (isReport) return getFromFile(path);
  let response: Response;
  try {
    response = await fetch(path, { credentials: 'same-origin' });
  } catch {
    throw new Gone('the program has ended');
  }
  if (response.status === 403) throw new Gone('the program was started anew');
  if (response.status === 202) return null;
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.json();
}

export function pictureAddress(dataset: number, capture: number, frame: number, kind: string): string {
  const path = `/api/${dataset}/capture/${capture}/${frame}/${kind}`;
  return isReport ? fileOf(path) : path;
}

/** An element with the picture, decoded. Those with numbers are inside of scripts in a report. */
export async function loadPicture(dataset: number, capture: number, frame: number,
                                  kind: string): Promise<HTMLImageElement> {
  const image = new Image();
  const hasNumbers = kind !== 'color' && kind !== 'thumbnail';
  const source = isReport && hasNumbers
    ? await getFromFile(`/api/${dataset}/capture/${capture}/${frame}/${kind}`)
    : pictureAddress(dataset, capture, frame, kind);
  if (source === null) throw new Error('no such picture');
  image.src = source;
  await image.decode();
  return image;
}

/** Whole numbers in one growing array. */
class Column {
  values = new Int32Array(1024);
  length = 0;

  add(numbers: number[]): void {
    const needed = this.length + numbers.length;
    if (needed > this.values.length) {
      const larger = new Int32Array(Math.max(needed, 2 * this.values.length));
      larger.set(this.values.subarray(0, this.length));
      this.values = larger;
    }
    this.values.set(numbers, this.length);
    this.length = needed;
  }
}

export const kUnknown = -1000;
const kNothingFound = [0];

/** All captures as columns: see capture_index.h. */
export class CaptureTable {
  readonly columns: { [name: string]: Column } = {};
  names: IndexPart['names'] = { classes: [], phases: [], environments: [], splits: [] };
  captures = 0;
  pictures = 0;
  objects = 0;
  brightCaptures = 0;  ///< The first so many have their brightness.
  private brightPictures = 0;
  /** Rules that lint has found broken, behind 'nothing found'; null before it has looked. */
  checks: string[] | null = null;
  private readonly checksOfPlace = new Map<number, number[]>();

  constructor() {
    for (const name of ['visit', 'phase', 'environment', 'split', 'findings', 'clip', 'pictures', 'camera', 'width',
      'height', 'objects', 'class', 'visible', 'truncation', 'box_side', 'distance', 'elevation', 'azimuth',
      'brightness']) {
      this.columns[name] = new Column();
    }
  }

  of(name: string): Int32Array {
    return this.columns[name].values;
  }

  add(part: IndexPart): void {
    if (part.from !== this.captures) return;
    for (const [name, numbers] of Object.entries(part.columns)) this.columns[name]?.add(numbers);
    this.columns.brightness.add(new Array<number>(part.columns.camera.length).fill(kUnknown));
    this.names = part.names;
    this.captures += part.columns.visit.length;
    this.pictures += part.columns.camera.length;
    this.objects += part.columns.class.length;
  }

  /** Places in `checks`, of a capture's findings. */
  checksOf(place: number): number[] {
    return this.checksOfPlace.get(place) ?? kNothingFound;
  }

  /** `captures`: their numbers. */
  setFindings(findings: Finding[], captures: number[]): void {
    this.checks = ['nothing found'];
    this.checksOfPlace.clear();
    const places = new Map(captures.map((capture, place) => [capture, place]));
    const names = [...new Set(findings.map((finding) => finding.check))].sort();
    this.checks.push(...names);
    for (const { capture, check } of findings) {
      const place = capture === undefined ? undefined : places.get(capture);
      if (place === undefined) continue;
      const number = names.indexOf(check) + 1;
      const known = this.checksOfPlace.get(place);
      if (!known) this.checksOfPlace.set(place, [number]);
      else if (!known.includes(number)) known.push(number);
    }
  }

  addBrightness(part: BrightnessPart): void {
    if (part.from !== this.brightCaptures || part.captures === 0) return;
    this.of('brightness').set(part.brightness, this.brightPictures);
    this.brightCaptures += part.captures;
    this.brightPictures += part.brightness.length;
  }
}
