// SPDX-License-Identifier: Apache-2.0
// The capture in space: boxes of objects and cameras with their pictures. The projection is
// orthographic, in which the picture of a pinhole camera stays a parallelogram: exact without WebGL.
import { CaptureLabels, FrameLabels, ObjectLabels } from './data';
import { el, on } from './dom';
import { Palette, css } from './layers';
import { Eye, State } from './state';

type Vec = [number, number, number];

const kEdges = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

function mapped(matrix: number[], p: Vec): Vec {
  return [0, 1, 2].map((row) =>
    matrix[4 * row] * p[0] + matrix[4 * row + 1] * p[1] + matrix[4 * row + 2] * p[2] + matrix[4 * row + 3]) as Vec;
}

function corners(object: ObjectLabels): Vec[] {
  const [low, high] = object.bounds!;
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
    mapped(object.world_from_node!, [i & 1 ? high[0] : low[0], i & 2 ? high[1] : low[1], i & 4 ? high[2] : low[2]]));
}

/** Centre and picture corners (top left, top right, bottom left, bottom right) of a camera. */
function frustum(frame: FrameLabels, length: number): Vec[] | null {
  if (!frame.world_from_camera || !frame.focal || !frame.centre) return null;
  const at = (x: number, y: number): Vec => mapped(frame.world_from_camera!, [
    ((x - frame.centre![0]) / frame.focal![0]) * length, (-(y - frame.centre![1]) / frame.focal![1]) * length, -length]);
  return [mapped(frame.world_from_camera, [0, 0, 0]), at(0, 0), at(frame.width, 0), at(0, frame.height), at(frame.width, frame.height)];
}

interface Name {
  text: string;
  x: number;  // of its left end
  y: number;  // of its base line
  isChosen: boolean;
}

/** Each in a place of its own, with a line to where it belongs when that was taken: the cameras of a rig are close to
 * each other. What finds none is left out. */
function drawNames(context: CanvasRenderingContext2D, names: Name[], width: number, height: number): void {
  const kLine = 15;
  const kGap = 6;
  const colours = getComputedStyle(context.canvas);
  const taken: { left: number; right: number; y: number }[] = [];
  context.lineJoin = 'round';
  for (const name of [...names].sort((a, b) => Number(b.isChosen) - Number(a.isChosen))) {
    if (name.text === '' || name.x < 0 || name.x > width || name.y < 0 || name.y > height) continue;
    context.font = `${name.isChosen ? 600 : 400} 12px system-ui, sans-serif`;
    const length = context.measureText(name.text).width;
    const left = Math.max(3, Math.min(name.x, width - length - 3));
    const isFree = (y: number): boolean => y >= kLine && y <= height - 4 &&
      taken.every((other) => Math.abs(other.y - y) >= kLine || other.right < left || other.left > left + length);
    let y = Math.max(kLine, Math.min(name.y, height - 4));
    const steps = 2 * Math.ceil(height / kLine);
    for (let i = 1; i <= steps && !isFree(y); ++i) y = name.y + kLine * Math.ceil(i / 2) * (i % 2 === 1 ? -1 : 1);
    if (!isFree(y)) continue;
    taken.push({ left: left - kGap, right: left + length + kGap, y });
    if (y !== name.y) {
      context.strokeStyle = colours.getPropertyValue('--quiet');
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(name.x - 4, name.y + 2);
      context.lineTo(left + 2, y < name.y ? y + 2 : y - 9);
      context.stroke();
    }
    context.strokeStyle = colours.getPropertyValue('--panel');
    context.lineWidth = 3;
    context.strokeText(name.text, left, y);
    context.fillStyle = colours.getPropertyValue('--text');
    context.fillText(name.text, left, y);
  }
}

export class SpaceView {
  readonly canvas = el('canvas', { class: 'space', tabindex: '0', role: 'img' });
  private eye!: Eye;
  private labels: CaptureLabels | null = null;
  private state!: State;
  private palette!: Palette;
  private readonly pictures = new Map<number, HTMLImageElement>();
  private spots: { x: number; y: number; frame: number; object: number | null }[] = [];

  constructor(private readonly pick: (frame: number, object: number | null) => void,
              private readonly turned: (eye: Eye) => void) {
    let held: [number, number] | null = null;
    let moved = 0;
    on(this.canvas, {
      pointerdown: (event: PointerEvent) => {
        held = [event.clientX, event.clientY];
        moved = 0;
        this.canvas.setPointerCapture(event.pointerId);
      },
      pointermove: (event: PointerEvent) => {
        if (!held) return;
        const [dx, dy] = [event.clientX - held[0], event.clientY - held[1]];
        moved += Math.abs(dx) + Math.abs(dy);
        held = [event.clientX, event.clientY];
        this.move(-0.46 * dx, 0.46 * dy, 1);
      },
      pointerup: (event: PointerEvent) => {
        held = null;
        if (moved < 4) this.click(event);
      },
      wheel: (event: WheelEvent) => {
        event.preventDefault();
        this.move(0, 0, Math.exp(-event.deltaY * 0.0015));
      },
      keydown: (event: KeyboardEvent) => {
        const acts: { [key: string]: () => void } = {
          ArrowLeft: () => this.move(6, 0, 1), ArrowRight: () => this.move(-6, 0, 1),
          ArrowUp: () => this.move(0, 6, 1), ArrowDown: () => this.move(0, -6, 1),
          '+': () => this.move(0, 0, 1.2), '-': () => this.move(0, 0, 1 / 1.2), t: () => this.move(0, 180, 1),
        };
        if (!(event.key in acts)) return;
        acts[event.key]();
        event.preventDefault();
        event.stopPropagation();
      },
    });
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  show(labels: CaptureLabels, state: State, palette: Palette, address: (frame: number) => string | null): void {
    if (labels !== this.labels) {
      this.pictures.clear();
      labels.frames.forEach((_, i) => {
        const source = address(i);
        if (source === null) return;
        const image = new Image();
        image.src = source;
        image.onload = () => this.draw();
        this.pictures.set(i, image);
      });
    }
    this.labels = labels;
    this.state = state;
    this.eye = state.eye;
    this.palette = palette;
    this.draw();
  }

  /** Degrees around and up, and a factor. */
  private move(turn: number, rise: number, factor: number): void {
    const [around, above, size] = this.eye;
    this.eye = [(around + turn + 360) % 360, Math.max(-90, Math.min(90, above + rise)), Math.max(20, Math.min(2000, size * factor))];
    this.draw();
    this.turned(this.eye);
  }

  private click(event: PointerEvent): void {
    const frame = this.canvas.getBoundingClientRect();
    const x = event.clientX - frame.left;
    const y = event.clientY - frame.top;
    const distance = (spot: { x: number; y: number }) => Math.hypot(spot.x - x, spot.y - y);
    const near = [...this.spots].sort((a, b) => distance(a) - distance(b))[0];
    if (near && distance(near) < 24) this.pick(near.frame, near.object);
  }

  private draw(): void {
    if (!this.labels || this.canvas.clientWidth === 0) return;
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext('2d')!;
    const colours = getComputedStyle(this.canvas);

    // An object is the same in all pictures, but its id need not be: that of the picture that is looked at counts.
    const objects = new Map<string, { object: ObjectLabels; frame: number }>();
    const places = this.labels.frames.map((_, i) => i).filter((i) => i !== this.state.frame);
    for (const frame of [...places, this.state.frame]) {
      for (const object of this.labels.frames[frame]?.objects ?? []) {
        if (object.bounds && object.world_from_node) objects.set(object.path, { object, frame });
      }
    }
    const boxes = [...objects.values()].map((each) => ({ ...each, points: corners(each.object) }));
    const isChosen = (box: { object: ObjectLabels; frame: number }) => box.frame === this.state.frame && box.object.id === this.state.object;
    const chosen = boxes.find(isChosen)?.object;
    this.canvas.setAttribute('aria-label', `3-D view of ${boxes.length} objects${chosen ? `, chosen: ${chosen.class || chosen.path}` : ''}; ` +
      'arrow keys turn it, plus and minus zoom, t looks from above');
    const eyes = this.labels.frames.map((frame) => frustum(frame, 1)?.[0]).filter((eye) => eye !== undefined);
    const all: Vec[] = [...boxes.flatMap((box) => box.points), ...eyes].filter((p) => p.every(Number.isFinite));
    if (all.length === 0) return;
    const low = [0, 1, 2].map((i) => all.reduce((least, p) => Math.min(least, p[i]), Infinity));
    const high = [0, 1, 2].map((i) => all.reduce((most, p) => Math.max(most, p[i]), -Infinity));
    const middle = low.map((value, i) => (value + high[i]) / 2);
    const extent = Math.max(1e-6, Math.hypot(...high.map((value, i) => value - low[i])));
    const [around, above, size] = this.eye;
    const scale = (Math.min(width, height) / extent) * 0.85 * (size / 100);
    const [turn, rise] = [(around * Math.PI) / 180, (above * Math.PI) / 180];
    const [ct, st, cr, sr] = [Math.cos(turn), Math.sin(turn), Math.cos(rise), Math.sin(rise)];
    const project = (p: Vec): [number, number] => {
      const [x, y, z] = p.map((value, i) => value - middle[i]);
      return [width / 2 + scale * (-st * x + ct * y), height / 2 - scale * (cr * z - sr * (ct * x + st * y))];
    };
    const line = (a: Vec, b: Vec): void => {
      context.moveTo(...project(a));
      context.lineTo(...project(b));
    };

    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    this.spots = [];
    // A grid of metres below everything; of more where that would be too many lines.
    context.strokeStyle = colours.getPropertyValue('--line');
    context.lineWidth = 1;
    context.beginPath();
    const step = extent <= 2 ? 0.1 : extent <= 40 ? 1 : 10 ** Math.ceil(Math.log10(extent / 40));
    const from = low.map((value) => Math.floor(value / step));
    const lines = high.map((value, i) => Math.ceil(value / step) - from[i]);
    for (let x = 0; x <= lines[0]; ++x) {
      line([(from[0] + x) * step, from[1] * step, low[2]], [(from[0] + x) * step, (from[1] + lines[1]) * step, low[2]]);
    }
    for (let y = 0; y <= lines[1]; ++y) {
      line([from[0] * step, (from[1] + y) * step, low[2]], [(from[0] + lines[0]) * step, (from[1] + y) * step, low[2]]);
    }
    context.stroke();

    const names: Name[] = [];
    this.labels.frames.forEach((frame, i) => {
      const points = frustum(frame, 0.16 * extent);
      if (!points) return;
      const [eye, a, b, c, d] = points;
      const image = this.pictures.get(i);
      if (image?.complete && image.naturalWidth > 0 && frame.lens === 'pinhole') {
        const [pa, pb, pc] = [project(a), project(b), project(c)];
        context.save();
        context.globalAlpha = i === this.state.frame ? 0.95 : 0.55;
        context.transform((pb[0] - pa[0]) / image.naturalWidth, (pb[1] - pa[1]) / image.naturalWidth,
          (pc[0] - pa[0]) / image.naturalHeight, (pc[1] - pa[1]) / image.naturalHeight, pa[0], pa[1]);
        context.drawImage(image, 0, 0);
        context.restore();
      }
      context.strokeStyle = colours.getPropertyValue(i === this.state.frame ? '--accent' : '--quiet');
      context.lineWidth = i === this.state.frame ? 2 : 1;
      context.beginPath();
      for (const corner of [a, b, c, d]) line(eye, corner);
      for (const [from, to] of [[a, b], [b, d], [d, c], [c, a]]) line(from, to);
      context.stroke();
      const [x, y] = project(eye);
      names.push({ text: frame.camera, x: x + 6, y: y - 6, isChosen: i === this.state.frame });
      for (const spot of [eye, a, b, c, d]) {
        const [sx, sy] = project(spot);
        this.spots.push({ x: sx, y: sy, frame: i, object: null });
      }
    });
    for (const box of boxes) {
      const { object, points } = box;
      context.strokeStyle = css(this.palette.of(object, this.state));
      context.lineWidth = isChosen(box) ? 3 : 1.4;
      context.beginPath();
      for (const [from, to] of kEdges) line(points[from], points[to]);
      context.stroke();
      const centre = [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / 8) as Vec;
      const [x, y] = project(centre);
      this.spots.push({ x, y, frame: box.frame, object: object.id });
      if (isChosen(box) || boxes.length <= 12) {
        names.push({ text: object.class, x: x + 4, y, isChosen: isChosen(box) });
      }
    }
    drawNames(context, names, width, height);
  }
}
