// SPDX-License-Identifier: Apache-2.0
// One picture in full: zoom to its pixels, a probe, its objects.
import { App } from './app';
import { CaptureLabels, FrameLabels, ObjectLabels, RunState, get, pictureAddress } from './data';
import { button, clear, el, remake } from './dom';
import { FramePixels, MaskStack, Motions, Numbers, View, css, drawKeypoints, drawLines, drawPicture, kLayers, overlays, skeletonOf } from './layers';
import { replayCommand } from './pages';
import { Player, Shot } from './player';
import { SpaceView } from './scene';
import { Zoom } from './zoom';

function percent(value: number | null | undefined): string {
  return value === null || value === undefined ? '–' : `${(100 * value).toFixed(1)} %`;
}

function metres(value: number | null | undefined): string {
  return value === null || value === undefined ? '–' : `${value.toFixed(value < 10 ? 3 : 2)} m`;
}

/** What the other frame shows of a point: FlowState. */
const kFlowStates = ['', ' (hidden there)', ' (out of the picture there)', ''];
const kSights = ['not told', 'hidden', 'seen'];

export class CapturePage {
  readonly element = el('main', { class: 'capture' });
  private readonly canvas = el('canvas', { class: 'big', tabindex: '0', role: 'img' });
  private readonly probe = el('div', { class: 'probe', 'aria-live': 'off' });
  private readonly head = el('div', { class: 'bar' });
  private readonly title = el('h1');
  private readonly panel = el('aside', { class: 'objects', 'aria-label': 'Objects' });
  private readonly space = new SpaceView((frame, object) => {
    this.app.go({ frame, object: object ?? 0 });
  }, (eye) => this.app.note({ eye }));
  private readonly player = new Player({
    shot: (capture) => this.shot(capture),
    shows: (capture, shot) => this.showShot(capture, shot),
    // Within a clip the place that is looked at stays.
    go: (change) => this.app.go(change.capture === this.app.state.capture ? { ...change } : { ...change, object: 0, view: this.app.state.view }, true),
  });
  private readonly stage = el('div', { class: 'stage' }, this.canvas, this.probe);
  private app!: App;
  private key = '';
  private shown = -1;  ///< Number of the capture.
  private run: RunState | null = null;  ///< That made it.
  private capture: CaptureLabels | null = null;
  private frame: FrameLabels | null = null;
  private pixels: FramePixels | null = null;
  private pointer: [number, number] | null = null;  ///< Pixels of the picture.
  private readonly zoom = new Zoom(this.canvas, {
    size: () => this.frame && [this.frame.width, this.frame.height],
    draw: () => this.draw(),
    moved: (view) => this.app.note({ view }),
    pointed: (pixel) => {
      this.pointer = pixel;
      this.showProbe();
    },
    clicked: () => this.choose(),
  });

  constructor() {
    this.element.append(this.head, el('div', { class: 'parts' },
      el('div', { class: 'screen' }, this.stage, this.player.element), this.space.canvas, this.panel));
    new ResizeObserver(() => this.draw()).observe(this.stage);
  }

  async show(app: App): Promise<void> {
    this.app = app;
    const { state } = app;
    const key = JSON.stringify([app.info.folder, app.site.edition, state.frame]);
    if (key !== this.key) {
      this.key = key;
      this.shown = -1;
      this.player.forget();
      get('/api/run').then((run) => {
        this.run = run as RunState;
        if (this.capture && !this.player.isPlaying) this.showPanel();
      }, () => undefined);
    }
    if (state.capture !== this.shown) {
      // Within a clip what is there stays until the next is.
      const isOfClip = this.player.has(state.capture);
      this.shown = state.capture;
      const shot = this.player.shot(state.capture);
      if (!isOfClip) {
        this.zoom.reset();
        this.frame = null;
        this.pointer = null;
      }
      const labels = await app.labels(state.capture).catch((error: Error) => error);
      if (key !== this.key || this.shown !== state.capture) return;
      if (labels instanceof Error) {
        this.capture = this.frame = null;
        this.player.show(null, [], false, 1, 1);
        this.showHead();
        clear(this.panel);
        this.panel.append(el('p', { class: 'bad' }, `Capture ${state.capture}: ${labels.message}`));
        this.draw();
        return;
      }
      this.pixels = shot.pixels;
      this.capture = labels;
      this.frame = labels.frames[state.frame] ?? null;
    }
    if (!this.capture) return;
    this.player.show(this.capture, app.info.captures, app.state.plays, app.state.speed,
      (this.frame?.width ?? 1) * (this.frame?.height ?? 1));
    if (app.state.plays && !this.player.isPlaying) {
      // Addresses may ask to play what is no clip, or one frame.
      app.go({ plays: false }, true);
      return;
    }
    if (!this.player.isPlaying) this.wantNumbers();
    this.zoom.show(app.state.view);
    this.showHead();
    this.showPanel();
    this.showSpace();
    this.draw();
    this.showProbe();
  }

  /** Where the page is not looked at. */
  rest(): void {
    this.player.stop();
  }

  /** Fetches a picture of this dataset and camera, with what is to lie over it. */
  private shot(capture: number): Shot {
    const { app } = this;
    const shot: Shot = { labels: null, pixels: new FramePixels(app.state.dataset, capture, app.state.frame), hasLabels: false };
    const changed = () => {
      if (this.pixels === shot.pixels) this.draw();
    };
    if (app.holds.has('color')) shot.pixels.picture('color').then(changed, changed);
    app.labels(capture).then((labels) => {
      shot.labels = labels;
      const frame = labels.frames[app.state.frame];
      if (frame) overlays(shot.pixels, frame, this.app.state, this.app.palette, this.app.holds, changed);
    }, () => undefined).finally(() => (shot.hasLabels = true));
    return shot;
  }

  /** A frame of the clip that plays: what is a drawing follows at once, texts when it stops. */
  private showShot(capture: number, shot: Shot): void {
    this.shown = capture;
    this.pixels = shot.pixels;
    this.capture = shot.labels ?? this.capture;
    this.frame = shot.labels?.frames[this.app.state.frame] ?? this.frame;
    this.app.note({ capture });
    this.title.textContent = `Capture ${capture}`;
    this.draw();
    this.showSpace();
    this.showProbe();
  }

  /** What the probe reads. */
  private wantNumbers(): void {
    const { holds } = this.app;
    const changed = () => this.showProbe();
    if (holds.has('instance_id')) this.pixels?.masks().then(changed, changed);
    if (holds.has('distance_to_image_plane') || holds.has('distance_to_camera')) this.pixels?.numbers('depth').then(changed, changed);
  }

  private showSpace(): void {
    const { app } = this;
    this.space.canvas.hidden = !app.state.space || !this.capture!.frames.some((frame) => frame.world_from_camera);
    if (this.space.canvas.hidden) return;
    this.space.show(this.capture!, app.state, app.palette, (frame) =>
      app.holds.has('color') ? pictureAddress(app.state.dataset, app.state.capture, frame, 'thumbnail') : null);
  }

  private showHead(): void {
    const { app } = this;
    const { state } = app;
    const refocus = remake(this.head, 'head');
    this.title.textContent = `Capture ${state.capture}`;
    this.head.append(
      button('← Grid', 'Back to all captures (Escape)', () => app.go({ page: 'grid' })),
      button('‹', 'Capture before (arrow left)', () => this.step(-1), { 'data-head': 'back' }),
      this.title,
      button('›', 'Next capture (arrow right)', () => this.step(1), { 'data-head': 'next' }));
    const cameras = el('span', { class: 'tabs', role: 'tablist', 'aria-label': 'Cameras' });
    this.capture?.frames.forEach((frame, i) => {
      cameras.append(button(frame.camera, `Camera ${frame.camera} (${i + 1})`, () => app.go({ frame: i, object: 0 }),
        { role: 'tab', 'aria-selected': i === state.frame ? 'true' : 'false', 'data-head': `camera ${i}` }));
    });
    this.head.append(cameras, el('span', { class: 'words' },
      [this.capture?.phase, this.capture?.environment, this.capture?.split].filter((word) => word).join(' · ')));
    this.head.append(el('span', { class: 'right' },
      button('Fit', 'Whole picture (0)', () => this.zoom.fit(), { 'data-head': 'fit' }),
      button('1:1', 'One pixel for one (1:1)', () => this.zoom.toPixels(), { 'data-head': 'pixels' }),
      app.holds.has('camera_pose') && button('3-D', 'Cameras and boxes in space (s)', () => app.go({ space: !state.space }),
        { 'aria-pressed': state.space ? 'true' : 'false', 'data-head': 'space' })));
    refocus();
  }

  /** To another capture of those that the filters leave. */
  private step(by: number): void {
    const { info, filtered, state } = this.app;
    const numbers = [...filtered.places].map((place) => info.captures[place]);
    const list = numbers.length > 0 ? numbers : info.captures;
    let at = list.indexOf(state.capture);
    if (at < 0) at = list.findIndex((number) => number > state.capture) - (by > 0 ? 1 : 0);
    const next = list[at + by];
    if (next !== undefined) this.app.go({ capture: next, object: 0, plays: false, view: this.player.has(next) ? state.view : null });
  }

  private showPanel(): void {
    const { app, frame } = this;
    const scroll = this.panel.scrollTop;
    const refocus = remake(this.panel, 'object');
    // Numbers of a frame that has passed are nobody's to choose from.
    this.panel.inert = this.player.isPlaying;
    if (!frame) {
      this.panel.append(el('h2', {}, 'No picture'));
      this.showFaults();
      return;
    }
    const seen = frame.objects.filter((object) => object.box);
    this.panel.append(el('h2', {}, 'Objects', el('small', {}, `${seen.length} in the picture, ${frame.objects.length} in all`)));
    for (const object of [...seen].sort((a, b) => this.area(b) - this.area(a))) {
      const isChosen = object.id === app.state.object;
      const dot = el('em');
      dot.style.background = css(app.palette.of(object, app.state));
      const row = button('', object.path, () => app.go({ object: isChosen ? 0 : object.id }, true),
        { class: 'object', 'aria-pressed': isChosen ? 'true' : 'false', 'data-object': object.id });
      row.append(dot, el('span', {}, object.class === '' ? object.path : object.class),
        el('small', {}, object.occlusion === undefined ? '' : percent(1 - (object.occlusion ?? 1))));
      this.panel.append(row);
      if (isChosen) this.panel.append(this.detail(object));
    }
    const about = el('dl', {});
    const add = (name: string, value: string) => about.append(el('dt', {}, name), el('dd', {}, value));
    add('Size', `${frame.width} × ${frame.height}`);
    if (frame.lens) add('Lens', `${frame.lens}, f ${frame.focal!.map((f) => f.toFixed(1)).join(' × ')} px`);
    const eye = frame.world_from_camera;
    if (eye) add('Stands at', `${eye[3].toFixed(2)}, ${eye[7].toFixed(2)}, ${eye[11].toFixed(2)} m`);
    add('Visit', String(this.capture!.visit));
    if (this.run?.seed !== undefined) add('Seed', String(this.run.seed));
    this.panel.append(el('h2', {}, 'Picture'), about);
    if (this.run?.folder) this.panel.append(el('small', {}, 'Make it again:'), el('pre', { class: 'replay' }, replayCommand(this.run.folder, app.state.capture)));
    const files = Object.entries(frame.files ?? {});
    if (files.length > 0) {
      const list = el('dl', { class: 'files' });
      for (const [held, file] of files) list.append(el('dt', {}, held), el('dd', {}, file));
      this.panel.append(el('details', {}, el('summary', {}, 'Files'), list));
    }
    this.showFaults();
    refocus();
    this.panel.scrollTop = scroll;
  }

  private showFaults(): void {
    const { app } = this;
    const linted = (app.lint.findingsOf(app.site, app.state.dataset) ?? []).filter((finding) => finding.capture === app.state.capture);
    if (linted.length + this.capture!.findings.length > 0) {
      this.panel.append(el('h2', { class: 'bad' }, 'Faults'));
      // What lint has found holds what the reader has.
      for (const finding of linted.length > 0 ? linted : this.capture!.findings) {
        this.panel.append(el('p', { class: 'bad' }, `${finding.check}: ${finding.message ?? finding.found ?? ''}`));
      }
    }
  }

  private detail(object: ObjectLabels): HTMLElement {
    const list = el('dl', { class: 'detail' });
    const add = (name: string, value: string) => list.append(el('dt', {}, name), el('dd', {}, value));
    for (const [taxonomy, label] of Object.entries(object.labels)) add(taxonomy, label);
    add('Path', object.path);
    if (object.occlusion !== undefined) add('Visible', percent(object.occlusion === null ? null : 1 - object.occlusion));
    if (object.truncation !== undefined) add('Outside', percent(object.truncation));
    if (object.visible_pixels !== undefined) add('Pixels', object.visible_pixels.toLocaleString('en'));
    if (object.distance_m !== undefined) add('Distance', metres(object.distance_m));
    add('Box', object.box!.join(', '));
    const points = (object.keypoints ?? []).filter((point) => point[2] > 0);
    if (object.keypoints) add('Keypoints', `${points.length} of ${object.keypoints.length}, ${points.filter((point) => point[2] === 2).length} seen`);
    if (object.bounds) {
      const [low, high] = object.bounds;
      const grows = (axis: number) => (object.world_from_node ? Math.hypot(...[0, 4, 8].map((row) => object.world_from_node![row + axis])) : 1);
      add('Size', high.map((value, i) => ((value - low[i]) * grows(i)).toFixed(3)).join(' × ') + ' m');
    }
    return list;
  }

  private area(object: ObjectLabels): number {
    return object.box ? (object.box[2] - object.box[0]) * (object.box[3] - object.box[1]) : 0;
  }

  /** The chosen object, or all of them, with some room around. */
  private zoomToObject(): void {
    const object = this.frame?.objects.find((one) => one.id === this.app.state.object && one.box);
    if (object) this.zoom.toBox(object.box!);
    else this.zoom.fit();
  }

  private draw(): void {
    const began = this.zoom.begin();
    const { frame, pixels } = this;
    if (!began || !frame || !pixels) return;
    const [context, view] = began;
    const { state, palette, holds } = this.app;
    drawPicture(context, frame, view, pixels, overlays(pixels, frame, state, palette, holds, () => this.draw()), state);
    if (view.scale >= 16) this.drawGrid(context, view);
    drawLines(context, frame, view, state, palette, 1, state.object);
    drawKeypoints(context, frame, view, state, palette, this.app.info.skeletons, 1);
    this.zoom.drawPixel(context);
    this.canvas.setAttribute('aria-label', `Capture ${state.capture}, ${frame.camera}: ` +
      frame.objects.filter((object) => object.box).map((object) => object.class).join(', '));
  }

  /** Edges of single pixels. */
  private drawGrid(context: CanvasRenderingContext2D, { scale, x, y }: View): void {
    context.strokeStyle = 'rgba(128, 128, 128, 0.35)';
    context.lineWidth = 1;
    context.beginPath();
    const first = (offset: number) => Math.max(0, Math.floor(-offset / scale));
    for (let i = first(x); i <= this.frame!.width && x + i * scale < this.canvas.clientWidth; ++i) {
      context.moveTo(x + i * scale, Math.max(0, y));
      context.lineTo(x + i * scale, Math.min(this.canvas.clientHeight, y + this.frame!.height * scale));
    }
    for (let i = first(y); i <= this.frame!.height && y + i * scale < this.canvas.clientHeight; ++i) {
      context.moveTo(Math.max(0, x), y + i * scale);
      context.lineTo(Math.min(this.canvas.clientWidth, x + this.frame!.width * scale), y + i * scale);
    }
    context.stroke();
  }

  /** Objects at a pixel: by the mask where there is one, then by boxes, small ones first. */
  private objectsAt(x: number, y: number): ObjectLabels[] {
    const frame = this.frame!;
    const masks = this.pixels?.now<Numbers | MaskStack>('masks') ?? null;
    const ids = masks instanceof MaskStack ? masks.at(x, y) : [masks?.at(x, y) ?? 0];
    const inside = frame.objects.filter((object) => object.box && x >= object.box[0] && y >= object.box[1] &&
      x < object.box[2] && y < object.box[3]);
    inside.sort((a, b) => this.area(a) - this.area(b));
    // Pictures of numbers hold 24 bits of an id.
    const bits = masks instanceof MaskStack ? -1 : 0xffffff;
    const shown = frame.objects.filter((object) => ids.some((id) => id !== 0 && ((object.id ^ id) & bits) === 0));
    shown.sort((a, b) => this.area(a) - this.area(b));
    return [...shown, ...inside.filter((object) => !shown.includes(object))];
  }

  private showProbe(): void {
    clear(this.probe);
    this.probe.setAttribute('aria-live', this.zoom.isByKeys ? 'polite' : 'off');
    if (!this.frame || !this.pixels || !this.pointer) {
      this.probe.append(el('span', {}, 'Point at a pixel. Wheel zooms, drag moves, click chooses, ? lists all keys.'));
      return;
    }
    const [x, y] = this.pointer;
    const word = (name: string, value: string) => this.probe.append(el('span', {}, el('small', {}, name), ' ', value));
    word('pixel', `${x}, ${y}`);
    const depth = this.pixels.now<Numbers>('depth')?.at(x, y);
    if (depth !== null && depth !== undefined) word('depth', depth === 0 ? 'nothing' : metres(depth / 1e4));
    for (const [kind, name] of [['motion', 'motion'], ['flow_forward', 'flow forward'], ['flow_backward', 'flow backward']]) {
      const motion = this.pixels.now<Motions>('motions ' + kind)?.at(x, y);
      if (motion) word(name, motion.state === 3 ? 'none' : `${motion.x.toFixed(2)}, ${motion.y.toFixed(2)} px${kFlowStates[motion.state]}`);
    }
    const normal = this.pixels.now<Numbers>('normals')?.at(x, y);
    if (normal) word('normal', [normal & 255, (normal >> 8) & 255, normal >> 16].map((value) => (value / 127.5 - 1).toFixed(2)).join(', '));
    const point = this.keypointAt(x, y);
    if (point) word('keypoint', point);
    const [object, ...others] = this.objectsAt(x, y);
    if (!object) return word('object', 'none');
    word('object', object.class === '' ? object.path : object.class);
    if (object.class !== '' && object.path !== object.class) word('path', object.path);
    if (object.occlusion !== undefined && object.occlusion !== null) word('visible', percent(1 - object.occlusion));
    if (object.truncation) word('outside', percent(object.truncation));
    if (object.distance_m) word('distance', metres(object.distance_m));
    if (others.length > 0) word('below', others.map((other) => other.class).join(', '));
  }

  /** The nearest one under the pointer, while they are shown. */
  private keypointAt(x: number, y: number): string | null {
    if (!this.app.state.layers.has('point')) return null;
    let nearest = Math.max(1.5, 7 / this.zoom.scale);
    let found: string | null = null;
    for (const object of this.frame!.objects) {
      (object.keypoints ?? []).forEach((point, i) => {
        const off = Math.hypot(point[0] - x - 0.5, point[1] - y - 0.5);
        if (point[2] === 0 || off > nearest) return;
        nearest = off;
        found = `${skeletonOf(this.app.info.skeletons, object).names[i] ?? i + 1} (${kSights[point[2]]})`;
      });
    }
    return found;
  }

  /** Clicks at one place go through what lies there. */
  private choose(): void {
    const found = this.pointer ? this.objectsAt(...this.pointer) : [];
    const at = found.findIndex((object) => object.id === this.app.state.object);
    this.app.go({ object: found[at + 1]?.id ?? 0 }, true);
  }

  /** Goes through the labels under the pointer, else through all. */
  private cycle(by: number): void {
    if (!this.frame) return;
    const under = this.pointer ? this.objectsAt(...this.pointer) : [];
    const list = under.length > 1 ? under : this.frame.objects.filter((object) => object.box);
    if (list.length === 0) return;
    const at = list.findIndex((object) => object.id === this.app.state.object);
    const next = at < 0 ? (by > 0 ? 0 : list.length - 1) : (at + by + list.length) % list.length;
    this.app.go({ object: list[next].id }, true);
  }

  /** True when the key means something here. */
  press(event: KeyboardEvent): boolean {
    const { app } = this;
    const frames = this.capture?.frames.length ?? 0;
    const digit = /^[1-9]$/.test(event.key) ? Number(event.key) - 1 : -1;
    if (event.shiftKey && this.zoom.press(event)) return true;
    if (digit >= 0 && digit < frames) app.go({ frame: digit, object: 0 });
    else if (event.key === 'ArrowLeft') this.step(-1);
    else if (event.key === 'ArrowRight') this.step(1);
    else if (event.key === 'ArrowUp') this.cycle(-1);
    else if (event.key === 'ArrowDown') this.cycle(1);
    else if (event.key === 'Enter' && event.target === this.canvas) this.choose();
    else if (event.key === 'z') this.zoomToObject();
    else if (event.key === 's') app.go({ space: !app.state.space });
    else if (this.player.press(event.key)) return true;
    else if (event.key === 'Escape') app.go(app.state.object !== 0 ? { object: 0 } : { page: 'grid' });
    else return this.zoom.press(event);
    return true;
  }
}

export const kKeys: [string, string][] = [
  ...kLayers.map((layer): [string, string] => [layer.hotkey, `${layer.title} on or off`]),
  ['i', 'Colours by class or by instance'],
  ['[  ]', 'Overlays fainter, stronger'],
  ['← →', 'Capture before, next one (of those that the filters leave)'],
  ['↑ ↓', 'Through the labels under the pointer, or all'],
  ['Shift ← → ↑ ↓', 'Points at a pixel; Enter in the picture chooses what is there'],
  ['1 … 9', 'Camera'],
  ['+ −  wheel', 'Zoom'],
  ['0', 'Whole picture'],
  ['space', 'Plays a clip, or stops it'],
  [',  .', 'Frame of a clip before, next one; divider of a comparison to the left, right'],
  ['<  >', 'Plays slower, faster'],
  ['Home End', 'First and last frame of a clip'],
  ['z', 'Zoom to the chosen object'],
  ['s', '3-D view'],
  ['g', 'Grid'],
  ['Esc', 'Back'],
  ['?', 'This list'],
];
