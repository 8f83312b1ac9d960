// SPDX-License-Identifier: Apache-2.0
// A canvas with a picture that is zoomed by wheel and keys and dragged, in one or several panes side by
// side that show the same part.
import { on } from './dom';
import { View } from './layers';

const kMostScale = 64;

export interface ZoomUser {
  /** Size of the picture; null while there is none. */
  size(): [number, number] | null;
  draw(): void;
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

  constructor(readonly canvas: HTMLCanvasElement, private readonly user: ZoomUser) {
    this.listen();
  }

  /** Pixels of the page per pixel of the picture. */
  get scale(): number {
    return this.view.scale;
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

  /** The next picture is shown whole, without drawing it now. */
  reset(): void {
    this.fits = true;
  }

  fit(): void {
    this.fits = true;
    this.user.draw();
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
    this.user.draw();
  }

  /** True when the key means something here. */
  press(key: string): boolean {
    if (key === '+' || key === '=') this.by(1.4);
    else if (key === '-') this.by(1 / 1.4);
    else if (key === '0') this.fit();
    else return false;
    return true;
  }

  private to(scale: number, at?: [number, number]): void {
    const [x, y] = at ?? [this.paneWidth / 2, this.canvas.clientHeight / 2];
    const next = Math.max(0.05, Math.min(kMostScale, scale));
    const px = (x - this.view.x) / this.view.scale;
    const py = (y - this.view.y) / this.view.scale;
    this.view = { scale: next, x: x - px * next, y: y - py * next };
    this.fits = false;
    this.user.draw();
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
        this.user.pointed(size && px[0] >= 0 && px[1] >= 0 && px[0] < size[0] && px[1] < size[1] ? px : null);
        if (!held) return;
        moved += Math.abs(event.clientX - held[0]) + Math.abs(event.clientY - held[1]);
        if (isTaken) {
          this.user.dragged!(...place(event), false);
        } else if (moved >= 4) {
          this.view = { ...this.view, x: this.view.x + event.clientX - held[0], y: this.view.y + event.clientY - held[1] };
          this.fits = false;
          this.user.draw();
        } else {
          return;
        }
        held = [event.clientX, event.clientY];
      },
      pointerup: () => {
        held = null;
        if (moved < 4 && !isTaken && this.user.size()) this.user.clicked?.();
      },
      pointerleave: () => this.user.pointed(null),
      dblclick: () => this.fit(),
    });
  }
}
