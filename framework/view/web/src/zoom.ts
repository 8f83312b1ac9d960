// SPDX-License-Identifier: Apache-2.0
// A canvas with a picture that is zoomed by wheel and keys and dragged, and whose pixels are pointed at by
// mouse and keys, in one or several panes side by side that show the same part.
import { on } from './dom';
import { View } from './layers';
import { Place } from './state';

const kLeastScale = 0.05;
const kMostScale = 64;

const kSteps: { [key: string]: [number, number] } = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export interface ZoomUser {
  /** Size of the picture; null while there is none. */
  size(): [number, number] | null;
  draw(): void;
  /** Another part of the picture is seen, as Zoom::show() takes it. */
  moved(place: Place | null): void;
  /** The pointer is at a pixel, or (null) beside the picture. */
  pointed(pixel: [number, number] | null): void;
  clicked?(): void;
  /** Takes the drag for itself; coordinates of the canvas. */
  dragged?(x: number, y: number, isFirst: boolean): boolean;
}

export class Zoom {
  panes = 1;
  private view: View = { scale: 1, x: 0, y: 0 };
  private fits = true;
  private told: Place | null = null;  ///< What was shown, or said to be seen, last.
  private wanted: Place | null = null;  ///< Seen as soon as there is a picture.
  private pixel: [number, number] | null = null;  ///< Pointed at.
  private byKeys = false;

  constructor(readonly canvas: HTMLCanvasElement, private readonly user: ZoomUser) {
    this.listen();
  }

  /** Pixels of the page per pixel of the picture. */
  get scale(): number {
    return this.view.scale;
  }

  /** Whether keys have moved the pixel that is pointed at. */
  get isByKeys(): boolean {
    return this.byKeys;
  }

  get paneWidth(): number {
    return this.canvas.clientWidth / this.panes;
  }

  /** Clears the canvas; null while there is nothing to draw. Coordinates are of the page then. */
  begin(): [CanvasRenderingContext2D, View] | null {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = window.devicePixelRatio || 1;
    if (width === 0 || height === 0) return null;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const size = this.user.size();
    if (!size) return null;
    if (this.wanted) {
      const [cx, cy, across] = this.wanted;
      const scale = Math.max(kLeastScale, Math.min(kMostScale, this.paneWidth / Math.max(1e-3, across)));
      this.view = { scale, x: this.paneWidth / 2 - scale * cx, y: height / 2 - scale * cy };
      this.wanted = null;
      this.fits = false;
    }
    if (this.fits) {
      const scale = Math.min(this.paneWidth / size[0], height / size[1]) * 0.98;
      this.view = { scale, x: (this.paneWidth - scale * size[0]) / 2, y: (height - scale * size[1]) / 2 };
    }
    const context = this.canvas.getContext('2d')!;
    context.scale(ratio, ratio);
    context.imageSmoothingEnabled = this.view.scale * ratio < 1;
    context.imageSmoothingQuality = 'high';
    return [context, this.view];
  }

  /** No pixel is pointed at any more. */
  reset(): void {
    this.point(null, false);
  }

  /** The part that is seen from the next drawing on; null: all. What it has told itself changes nothing. */
  show(place: Place | null): void {
    if (String(place) === String(this.told)) return;
    this.told = place;
    this.wanted = place;
    this.fits = place === null;
  }

  fit(): void {
    this.fits = true;
    this.seen();
  }

  /** Draws what is seen now, and tells of it. */
  private seen(): void {
    this.user.draw();
    const { scale, x, y } = this.view;
    this.told = this.fits ? null : [(this.paneWidth / 2 - x) / scale, (this.canvas.clientHeight / 2 - y) / scale, this.paneWidth / scale];
    this.user.moved(this.told);
  }

  /** One pixel of the picture for one of the screen. */
  toPixels(): void {
    this.to(1 / (window.devicePixelRatio || 1));
  }

  by(factor: number, at?: [number, number]): void {
    this.to(this.view.scale * factor, at);
  }

  /** A part of the picture (left, top, right, bottom) with some room around. */
  toBox([left, top, right, bottom]: [number, number, number, number]): void {
    const [width, height] = [this.paneWidth, this.canvas.clientHeight];
    const scale = Math.min(kMostScale, 0.6 * Math.min(width / Math.max(1, right - left), height / Math.max(1, bottom - top)));
    this.view = { scale, x: width / 2 - (scale * (left + right)) / 2, y: height / 2 - (scale * (top + bottom)) / 2 };
    this.fits = false;
    this.seen();
  }

  /** Shows in each pane where keys point, as no mouse does it. */
  drawPixel(context: CanvasRenderingContext2D): void {
    if (!this.byKeys || !this.pixel) return;
    const { scale, x, y } = this.view;
    const side = Math.max(scale, 9);
    const [left, top] = [x + (this.pixel[0] + 0.5) * scale - side / 2, y + (this.pixel[1] + 0.5) * scale - side / 2];
    for (let pane = 0; pane < this.panes; ++pane) {
      for (const [colour, off] of [['#000', 0], ['#fff', 2]] as [string, number][]) {
        context.strokeStyle = colour;
        context.lineWidth = 2;
        context.strokeRect(left + pane * this.paneWidth - off, top - off, side + 2 * off, side + 2 * off);
      }
    }
  }

  /** True when the key means something here. */
  press({ key, shiftKey }: KeyboardEvent): boolean {
    const step = kSteps[key];
    if (shiftKey && step) this.move(...step);
    else if (key === '+' || key === '=') this.by(1.4);
    else if (key === '-') this.by(1 / 1.4);
    else if (key === '0') this.fit();
    else return false;
    return true;
  }

  /** From the middle of what is seen; the pixel stays in sight. */
  private move(dx: number, dy: number): void {
    const size = this.user.size();
    if (!size) return;
    const { scale } = this.view;
    const sides = [this.paneWidth, this.canvas.clientHeight];
    const origin = [this.view.x, this.view.y];
    const next = [dx, dy].map((by, i) => {
      const from = this.pixel ? this.pixel[i] + by : Math.floor((sides[i] / 2 - origin[i]) / scale);
      return Math.max(0, Math.min(size[i] - 1, from));
    }) as [number, number];
    next.forEach((value, i) => {
      const over = Math.max(0, origin[i] + (value + 1) * scale - sides[i]);
      const under = Math.max(0, -(origin[i] + value * scale));
      if (over + under === 0) return;
      this.fits = false;
      origin[i] += under - over;
    });
    this.view = { scale, x: origin[0], y: origin[1] };
    this.point(next, true);
    this.seen();
  }

  private point(pixel: [number, number] | null, byKeys: boolean): void {
    const wasByKeys = this.byKeys;
    this.pixel = pixel;
    this.byKeys = byKeys;
    this.user.pointed(pixel);
    if (wasByKeys && !byKeys) this.user.draw();
  }

  private to(scale: number, at?: [number, number]): void {
    const [x, y] = at ?? [this.paneWidth / 2, this.canvas.clientHeight / 2];
    const next = Math.max(kLeastScale, Math.min(kMostScale, scale));
    const px = (x - this.view.x) / this.view.scale;
    const py = (y - this.view.y) / this.view.scale;
    this.view = { scale: next, x: x - px * next, y: y - py * next };
    this.fits = false;
    this.seen();
  }

  private listen(): void {
    let held: [number, number] | null = null;
    let moved = 0;
    let isTaken = false;
    const place = (event: MouseEvent): [number, number] => {
      const frame = this.canvas.getBoundingClientRect();
      return [event.clientX - frame.left, event.clientY - frame.top];
    };
    /** In the pane that it is in. */
    const inPane = ([x, y]: [number, number]): [number, number] => [x % Math.max(1, this.paneWidth), y];
    on(this.canvas, {
      wheel: (event: WheelEvent) => {
        event.preventDefault();
        this.by(Math.exp(-event.deltaY * 0.002), inPane(place(event)));
      },
      pointerdown: (event: PointerEvent) => {
        held = [event.clientX, event.clientY];
        moved = 0;
        isTaken = this.user.dragged?.(...place(event), true) ?? false;
        this.canvas.setPointerCapture(event.pointerId);
      },
      pointermove: (event: PointerEvent) => {
        const [x, y] = inPane(place(event));
        const size = this.user.size();
        const px: [number, number] = [Math.floor((x - this.view.x) / this.view.scale), Math.floor((y - this.view.y) / this.view.scale)];
        this.point(size && px[0] >= 0 && px[1] >= 0 && px[0] < size[0] && px[1] < size[1] ? px : null, false);
        if (!held) return;
        moved += Math.abs(event.clientX - held[0]) + Math.abs(event.clientY - held[1]);
        if (isTaken) {
          this.user.dragged!(...place(event), false);
        } else if (moved >= 4) {
          this.view = { ...this.view, x: this.view.x + event.clientX - held[0], y: this.view.y + event.clientY - held[1] };
          this.fits = false;
          this.seen();
        } else {
          return;
        }
        held = [event.clientX, event.clientY];
      },
      pointerup: () => {
        held = null;
        if (moved < 4 && !isTaken && this.user.size()) this.user.clicked?.();
      },
      pointerleave: () => this.point(null, false),
      dblclick: () => this.fit(),
    });
  }
}
