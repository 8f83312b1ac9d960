// SPDX-License-Identifier: Apache-2.0
// What is drawn over a picture: exact labels where they are few numbers, pictures of numbers where they
// are many.
import { Box, FrameLabels, Keypoint, ObjectLabels, ObjectMasks, Skeleton, get, loadPicture } from './data';
import { State } from './state';

export interface Layer {
  key: string;
  title: string;
  hotkey: string;
  held: string[];  ///< Of which a dataset must hold one.
}

export const kLayers: Layer[] = [
  { key: 'box', title: '2-D boxes', hotkey: 'b', held: ['tight_boxes', 'instance_id'] },
  { key: 'cube', title: '3-D boxes', hotkey: 'c', held: ['boxes_3d'] },
  { key: 'mask', title: 'Masks', hotkey: 'm', held: ['instance_id'] },
  { key: 'amodal', title: 'Amodal masks', hotkey: 'a', held: ['amodal_mask'] },
  { key: 'point', title: 'Keypoints', hotkey: 'k', held: ['keypoints'] },
  { key: 'name', title: 'Names', hotkey: 'l', held: ['labels'] },
  { key: 'depth', title: 'Depth', hotkey: 'd', held: ['distance_to_image_plane', 'distance_to_camera'] },
  { key: 'normals', title: 'Normals', hotkey: 'n', held: ['normals'] },
  { key: 'motion', title: 'Motion', hotkey: 'v', held: ['motion'] },
  { key: 'flow_forward', title: 'Flow forward', hotkey: 'f', held: ['flow_forward'] },
  { key: 'flow_backward', title: 'Flow backward', hotkey: 'r', held: ['flow_backward'] },
];
const kMotions = ['motion', 'flow_forward', 'flow_backward'];

export type Rgb = [number, number, number];

/** Hues far from each other for neighbouring numbers. */
export function colourOf(index: number): Rgb {
  const hue = ((index * 137.508 + 200) % 360) / 60;
  const light = 0.56 + 0.08 * (index % 3 - 1);
  const chroma = (1 - Math.abs(2 * light - 1)) * 0.85;
  const part = (shift: number): number => {
    const k = (shift + hue) % 6;
    const value = light - chroma / 2 + chroma * Math.max(0, Math.min(1, Math.abs(k - 3) - 1));
    return Math.round(255 * value);
  };
  return [part(0), part(4), part(2)];
}

export function css(colour: Rgb, alpha = 1): string {
  return `rgba(${colour[0]}, ${colour[1]}, ${colour[2]}, ${alpha})`;
}

export class Palette {
  private readonly numbers = new Map<string, number>();

  /** Classes of the whole dataset in its order. */
  constructor(classes: string[]) {
    for (const name of classes) this.numbers.set(name, this.numbers.size);
  }

  ofClass(name: string): Rgb {
    let number = this.numbers.get(name);
    if (number === undefined) this.numbers.set(name, (number = this.numbers.size));
    return colourOf(number);
  }

  of(object: ObjectLabels, state: State): Rgb {
    return state.colour === 'instance' ? colourOf(object.id) : this.ofClass(object.class);
  }
}

function canvasOf(width: number, height: number): [HTMLCanvasElement, CanvasRenderingContext2D] {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  return [canvas, canvas.getContext('2d', { willReadFrequently: true })!];
}

/** The three bytes of each pixel as one number. */
export class Numbers {
  constructor(readonly width: number, readonly height: number, readonly values: Uint32Array) {}

  static of(image: HTMLImageElement): Numbers {
    const [, context] = canvasOf(image.naturalWidth, image.naturalHeight);
    context.drawImage(image, 0, 0);
    const bytes = context.getImageData(0, 0, image.naturalWidth, image.naturalHeight).data;
    const values = new Uint32Array(bytes.length / 4);
    for (let i = 0; i < values.length; ++i) {
      values[i] = bytes[4 * i] | (bytes[4 * i + 1] << 8) | (bytes[4 * i + 2] << 16);
    }
    return new Numbers(image.naturalWidth, image.naturalHeight, values);
  }

  at(x: number, y: number): number | null {
    return x >= 0 && y >= 0 && x < this.width && y < this.height ? this.values[y * this.width + x] : null;
  }

  /** A picture with a colour per number; null: nothing there. */
  coloured(colour: (value: number) => Rgb | null, alpha = 255): HTMLCanvasElement {
    const [canvas, context] = canvasOf(this.width, this.height);
    const image = context.createImageData(this.width, this.height);
    const known = new Map<number, Rgb | null>();
    for (let i = 0; i < this.values.length; ++i) {
      let rgb = known.get(this.values[i]);
      if (rgb === undefined) {
        rgb = colour(this.values[i]);
        if (known.size < 65536) known.set(this.values[i], rgb);
      }
      if (rgb === null) continue;
      image.data.set(rgb, 4 * i);
      image.data[4 * i + 3] = alpha;
    }
    context.putImageData(image, 0, 0);
    return canvas;
  }
}

/** Near is bright and warm. Anchors of the colour map "inferno", reversed. */
const kHeat: Rgb[] = [[252, 255, 164], [250, 193, 39], [237, 105, 37], [188, 55, 84], [120, 28, 109], [58, 12, 96], [10, 7, 34]];

function heat(share: number): Rgb {
  const at = Math.max(0, Math.min(0.9999, share)) * (kHeat.length - 1);
  const low = kHeat[Math.floor(at)];
  const high = kHeat[Math.floor(at) + 1];
  const part = at - Math.floor(at);
  return [0, 1, 2].map((i) => Math.round(low[i] + (high[i] - low[i]) * part)) as Rgb;
}

/** Where a point goes. State: 0 it is seen there, 1 hidden, 2 out of the picture, 3 there is no such point. */
export interface Motion {
  x: number;
  y: number;
  state: number;
}

/** Two numbers per pixel: see PictureKind::Motion. */
export class Motions {
  constructor(private readonly numbers: Numbers) {}

  at(x: number, y: number): Motion | null {
    const height = this.numbers.height / 2;
    const upper = y < height ? this.numbers.at(x, y) : null;
    if (upper === null) return null;
    const pixels = (value: number) => (value & 0x3fffff) / 256 - 8192;
    return { x: pixels(upper), y: pixels(this.numbers.at(x, y + height)!), state: upper >> 22 };
  }

  drawing(): HTMLCanvasElement {
    const { width } = this.numbers;
    const height = this.numbers.height / 2;
    const [canvas, context] = canvasOf(width, height);
    const image = context.createImageData(width, height);
    for (let y = 0; y < height; ++y) {
      for (let x = 0; x < width; ++x) {
        const rgb = motionColour(this.at(x, y)!);
        if (rgb) image.data.set([...rgb, 255], 4 * (y * width + x));
      }
    }
    context.putImageData(image, 0, 0);
    return canvas;
  }
}

/** The hue says where to; darker is what the other frame does not show. */
function motionColour({ x, y, state }: Motion): Rgb | null {
  const length = Math.hypot(x, y);
  if (length < 0.05 || state === 3) return null;
  const hue = Math.atan2(y, x) / (2 * Math.PI) + 0.5;
  const strength = Math.min(1, Math.log1p(length) / 3);
  const light = state === 0 ? 255 : 140;
  const part = (shift: number): number => {
    const k = (shift + hue * 6) % 6;
    return Math.round(light * (1 - strength + strength * Math.max(0, Math.min(1, Math.abs(k - 3) - 1))));
  };
  return [part(0), part(4), part(2)];
}

/** Which objects a pixel shows where masks overlap, so that a picture of ids cannot say it. */
export class MaskStack {
  private readonly masks: { id: number; box: Box; pixels: Uint8Array }[];

  constructor(readonly told: ObjectMasks) {
    this.masks = told.objects.map(({ id, box, runs }) => {
      const pixels = new Uint8Array(Math.max(0, box[2] - box[0]) * Math.max(0, box[3] - box[1]));
      let at = 0;
      runs.forEach((length, i) => {
        if (i % 2 === 1) pixels.fill(1, at, at + length);
        at += length;
      });
      return { id, box, pixels };
    });
  }

  at(x: number, y: number): number[] {
    return this.masks.filter(({ box, pixels }) => x >= box[0] && y >= box[1] && x < box[2] && y < box[3] &&
      pixels[(y - box[1]) * (box[2] - box[0]) + x - box[0]] === 1).map(({ id }) => id);
  }
}

/** Pixels of one frame, fetched when they are first wanted. */
export class FramePixels {
  private readonly made = new Map<string, Promise<unknown>>();
  private readonly ready = new Map<string, unknown>();
  private pending = 0;

  constructor(readonly dataset: number, readonly capture: number, readonly frame: number) {}

  /** What has come until now; null while it has not. */
  now<T>(key: string): T | null {
    return (this.ready.get(key) as T) ?? null;
  }

  /** All that was asked for has come, or will not. */
  get isIdle(): boolean {
    return this.pending === 0;
  }

  private keep<T>(key: string, make: () => Promise<T>): Promise<T> {
    let promise = this.made.get(key) as Promise<T> | undefined;
    if (!promise) {
      ++this.pending;
      promise = make().then((value) => {
        this.ready.set(key, value);
        return value;
      }).finally(() => --this.pending);
      this.made.set(key, promise);
    }
    return promise;
  }

  numbers(kind: string): Promise<Numbers> {
    return this.keep(kind, async () => Numbers.of(await loadPicture(this.dataset, this.capture, this.frame, kind)));
  }

  motions(kind: string): Promise<Motions> {
    return this.keep('motions ' + kind, async () => new Motions(await this.numbers(kind)));
  }

  picture(kind: string): Promise<HTMLImageElement> {
    return this.keep('picture ' + kind, () => loadPicture(this.dataset, this.capture, this.frame, kind));
  }

  amodal(): Promise<ObjectMasks> {
    return this.keep('amodal masks', () => get(`/api/${this.dataset}/capture/${this.capture}/${this.frame}/amodal`));
  }

  /** Of objects that are seen: a picture of their ids, or where masks overlap one of each. */
  masks(): Promise<Numbers | MaskStack> {
    return this.keep('masks', () => this.numbers('ids').catch(async () =>
      new MaskStack(await get(`/api/${this.dataset}/capture/${this.capture}/${this.frame}/masks`))));
  }

  drawing(key: string, make: () => Promise<HTMLCanvasElement>): Promise<HTMLCanvasElement> {
    return this.keep(key, make);
  }
}

function maskDrawing(pixels: FramePixels, labels: FrameLabels, state: State, palette: Palette) {
  return async (): Promise<HTMLCanvasElement> => {
    const masks = await pixels.masks();
    if (masks instanceof MaskStack) return stackDrawing(masks.told, labels, state, palette);
    const objects = new Map(labels.objects.map((object) => [object.id & 0xffffff, object]));
    return masks.coloured((id) => {
      const object = objects.get(id);
      return object ? palette.of(object, state) : null;
    });
  };
}

/** Masks that lie on top of each other. */
function stackDrawing(masks: ObjectMasks, labels: FrameLabels, state: State, palette: Palette): HTMLCanvasElement {
  const [canvas, context] = canvasOf(labels.width, labels.height);
  const objects = new Map(labels.objects.map((object) => [object.id, object]));
  for (const mask of masks.objects) {
    const object = objects.get(mask.id);
    if (!object) continue;
    const width = mask.box[2] - mask.box[0];
    const height = mask.box[3] - mask.box[1];
    if (width <= 0 || height <= 0) continue;
    const [part, partContext] = canvasOf(width, height);
    const image = partContext.createImageData(width, height);
    const [r, g, b] = palette.of(object, state);
    let at = 0;
    mask.runs.forEach((length, i) => {
      for (const end = at + length; at < end; ++at) if (i % 2 === 1) image.data.set([r, g, b, 150], 4 * at);
    });
    // A rim, so that they can be told apart.
    const covers = (x: number, y: number) =>
      x >= 0 && y >= 0 && x < width && y < height && image.data[4 * (y * width + x) + 3] > 0;
    for (let y = 0; y < height; ++y) {
      for (let x = 0; x < width; ++x) {
        if (!covers(x, y) || (covers(x - 1, y) && covers(x + 1, y) && covers(x, y - 1) && covers(x, y + 1))) continue;
        image.data[4 * (y * width + x) + 3] = 255;
      }
    }
    partContext.putImageData(image, 0, 0);
    context.drawImage(part, mask.box[0], mask.box[1]);
  }
  return canvas;
}

function depthDrawing(pixels: FramePixels) {
  return async (): Promise<HTMLCanvasElement> => {
    const depth = await pixels.numbers('depth');
    let near = Infinity;
    const some: number[] = [];
    for (let i = 0; i < depth.values.length; ++i) {
      if (depth.values[i] === 0) continue;
      near = Math.min(near, depth.values[i]);
      if (i % 37 === 0) some.push(depth.values[i]);
    }
    some.sort((a, b) => a - b);
    // Windows let one see far; what is beyond all but the last pixels is as dark as it gets.
    const far = some.length > 0 ? some[Math.floor(some.length * 0.98)] : near + 1;
    return depth.coloured((value) => value === 0 ? null : heat((value - near) / Math.max(1, far - near)));
  };
}

/** Where and how much two pictures of one size differ; null for others. Small differences show, too. */
export function differenceDrawing(a: Numbers, b: Numbers): { canvas: HTMLCanvasElement; pixels: number; most: number } | null {
  if (a.width !== b.width || a.height !== b.height) return null;
  const distances = new Uint32Array(a.values.length);
  let [pixels, most] = [0, 0];
  for (let i = 0; i < distances.length; ++i) {
    for (const shift of [0, 8, 16]) {
      distances[i] = Math.max(distances[i], Math.abs(((a.values[i] >> shift) & 255) - ((b.values[i] >> shift) & 255)));
    }
    if (distances[i] > 0) ++pixels;
    most = Math.max(most, distances[i]);
  }
  const canvas = new Numbers(a.width, a.height, distances).coloured((distance) =>
    distance === 0 ? null : heat(0.75 * (1 - Math.log(distance) / Math.log(256))));
  return { canvas, pixels, most };
}

/** Pictures to lay over, from below; those that are not there yet come later and call `changed`. */
export function overlays(pixels: FramePixels, labels: FrameLabels, state: State, palette: Palette,
                         holds: Set<string>, changed: () => void): HTMLCanvasElement[] {
  const found: HTMLCanvasElement[] = [];
  const take = (key: string, make: () => Promise<HTMLCanvasElement>): void => {
    const ready = pixels.now<HTMLCanvasElement>(key);
    if (ready) found.push(ready);
    else pixels.drawing(key, make).then(changed, () => undefined);
  };
  for (const layer of kLayers) {
    if (!state.layers.has(layer.key) || !layer.held.some((name) => holds.has(name))) continue;
    if (layer.key === 'depth') take('depth drawing', depthDrawing(pixels));
    if (layer.key === 'normals') {
      take('normals drawing', async () => (await pixels.numbers('normals')).coloured((value) =>
        value === 0 ? null : [value & 255, (value >> 8) & 255, value >> 16]));
    }
    if (kMotions.includes(layer.key)) {
      take(layer.key + ' drawing', async () => (await pixels.motions(layer.key)).drawing());
    }
    if (layer.key === 'mask') take('mask ' + state.colour, maskDrawing(pixels, labels, state, palette));
    if (layer.key === 'amodal') {
      take('amodal ' + state.colour, async () => stackDrawing(await pixels.amodal(), labels, state, palette));
    }
  }
  return found;
}

/** Picture coordinates to the canvas. */
export interface View {
  scale: number;
  x: number;
  y: number;
}

/** The picture, as far as it has come, and what lies over it. */
export function drawPicture(context: CanvasRenderingContext2D, labels: FrameLabels, { scale, x, y }: View,
                            pixels: FramePixels, over: HTMLCanvasElement[], state: State): void {
  const [width, height] = [scale * labels.width, scale * labels.height];
  context.fillStyle = '#000';
  context.fillRect(x, y, width, height);
  const picture = pixels.now<HTMLImageElement>('picture color');
  if (picture) context.drawImage(picture, x, y, width, height);
  context.globalAlpha = state.opacity / 100;
  for (const layer of over) context.drawImage(layer, x, y, width, height);
  context.globalAlpha = 1;
}

/** Boxes and names; `chosen` stands out. */
export function drawLines(context: CanvasRenderingContext2D, labels: FrameLabels, view: View, state: State,
                          palette: Palette, line: number, chosen: number, chosenOnly = false): void {
  const x = (value: number) => view.x + value * view.scale;
  const y = (value: number) => view.y + value * view.scale;
  const objects = [...labels.objects].sort((a, b) => Number(a.id === chosen) - Number(b.id === chosen));
  for (const object of objects) {
    const isChosen = object.id === chosen;
    if (chosenOnly && !isChosen) continue;
    const colour = palette.of(object, state);
    const widths = [line * (isChosen ? 4.5 : 2.6), line * (isChosen ? 2.2 : 1.3)];
    const strokes = ['rgba(0, 0, 0, 0.55)', isChosen ? '#fff' : css(colour)];
    for (let pass = 0; pass < 2; ++pass) {
      context.lineWidth = widths[pass];
      context.strokeStyle = strokes[pass];
      context.lineJoin = 'round';
      if (object.box && (state.layers.has('box') || isChosen)) {
        const [left, top, right, bottom] = object.box;
        context.strokeRect(x(left), y(top), (right - left) * view.scale, (bottom - top) * view.scale);
      }
      if (object.edges && object.box && state.layers.has('cube')) {
        context.beginPath();
        for (const edge of object.edges) {
          context.moveTo(x(edge[0]), y(edge[1]));
          for (let i = 2; i < edge.length; i += 2) context.lineTo(x(edge[i]), y(edge[i + 1]));
        }
        context.stroke();
      }
    }
  }
  if (!state.layers.has('name')) return;
  const size = 12 * line;
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.textBaseline = 'middle';
  for (const object of objects) {
    if (!object.box) continue;
    if (y(object.box[3]) < 0) continue;
    const name = object.class === '' ? object.path : object.class;
    const text = name.length > 28 ? name.slice(0, 27) + '…' : name;
    const width = context.measureText(text).width + 8 * line;
    const top = Math.max(0, y(object.box[1]) - size - 5 * line);
    const colour = palette.of(object, state);
    context.fillStyle = css(colour);
    context.fillRect(x(object.box[0]) - line, top, width, size + 5 * line);
    context.fillStyle = 0.3 * colour[0] + 0.59 * colour[1] + 0.11 * colour[2] > 115 ? '#101418' : '#fff';
    context.fillText(text, x(object.box[0]) + 3 * line, top + (size + 5 * line) / 2);
  }
}

export function skeletonOf(skeletons: { [name: string]: Skeleton }, object: ObjectLabels): Skeleton {
  const isOwn = (name: string) => Object.prototype.hasOwnProperty.call(skeletons, name);
  if (isOwn(object.class)) return skeletons[object.class];
  return isOwn('') ? skeletons[''] : { names: [], lines: [] };
}

/** Discs where points are seen, rings where something hides them, and the lines between. */
export function drawKeypoints(context: CanvasRenderingContext2D, labels: FrameLabels, view: View, state: State, palette: Palette,
                              skeletons: { [name: string]: Skeleton }, line: number): void {
  if (!state.layers.has('point')) return;
  const at = ([x, y]: Keypoint): [number, number] => [view.x + x * view.scale, view.y + y * view.scale];
  for (const object of labels.objects) {
    const points = object.keypoints ?? [];
    const colour = css(palette.of(object, state));
    for (const [from, to] of skeletonOf(skeletons, object).lines) {
      const ends = [points[from], points[to]];
      if (ends.some((end) => !end || end[2] === 0)) continue;
      context.setLineDash(ends.some((end) => end[2] === 1) ? [4 * line, 3 * line] : []);
      for (const [width, stroke] of [[3, 'rgba(0, 0, 0, 0.55)'], [1.6, colour]] as [number, string][]) {
        context.lineWidth = width * line;
        context.strokeStyle = stroke;
        context.beginPath();
        context.moveTo(...at(ends[0]));
        context.lineTo(...at(ends[1]));
        context.stroke();
      }
    }
    context.setLineDash([]);
    for (const point of points) {
      if (point[2] === 0) continue;
      context.beginPath();
      context.arc(...at(point), 3.6 * line, 0, 2 * Math.PI);
      context.lineWidth = 3.4 * line;
      context.strokeStyle = 'rgba(0, 0, 0, 0.65)';
      context.stroke();
      context.lineWidth = 1.8 * line;
      context.strokeStyle = point[2] === 2 ? '#fff' : colour;
      context.stroke();
      if (point[2] !== 2) continue;
      context.fillStyle = colour;
      context.fill();
    }
  }
}
