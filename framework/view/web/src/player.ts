// SPDX-License-Identifier: Apache-2.0
// Plays the clip that a capture belongs to: its buttons, its clock, and the pictures that come next.
import { CaptureLabels, Clip } from './data';
import { button, el, on } from './dom';
import { FramePixels } from './layers';
import { kSpeeds } from './state';

/** One picture of a clip on its way here. */
export interface Shot {
  labels: CaptureLabels | null;
  pixels: FramePixels;
  hasLabels: boolean;  ///< Or will never have them.
}

export interface PlayerHooks {
  /** Begins to fetch a capture's picture with what lies over it. */
  shot(capture: number): Shot;
  /** Shows a shot that has come. */
  shows(capture: number, shot: Shot): void;
  go(change: { capture?: number; plays?: boolean; speed?: number }): void;
}

/** Pixels of pictures that are kept, so that a short clip is fetched once. */
const kMostPixels = 40e6;
const kAhead = 10;
/** Frames in a second, whatever rate a dataset states. */
const kMostRate = 1000;

export class Player {
  private readonly play = button('', '', () => this.toggle(), { class: 'play' });
  private readonly scrub = on(el('input', { type: 'range', min: 0, step: 1, 'aria-label': 'Frame of the clip' }), {
    input: () => this.hooks.go({ capture: this.captures[Number(this.scrub.value)], plays: false }),
  });
  private readonly words = el('span', { class: 'time' });
  private readonly speedChoice = on(el('select', { 'aria-label': 'Speed', title: 'Speed (< slower, > faster)' }), {
    change: () => this.hooks.go({ speed: Number(this.speedChoice.value) }),
  });
  readonly element = el('div', { class: 'player', role: 'group', 'aria-label': 'Clip' },
    button('«', 'First frame (Home)', () => this.seek(0)), button('‹', 'Frame before (,)', () => this.step(-1)), this.play,
    button('›', 'Next frame (.)', () => this.step(1)), button('»', 'Last frame (End)', () => this.seek(this.captures.length - 1)),
    this.scrub, this.words, this.speedChoice);
  private readonly shots = new Map<number, Shot>();
  private clip: Clip | null = null;
  private captures: number[] = [];  ///< Of the clip, as far as the dataset has them.
  private first = 0;  ///< The capture that is, or would be, frame 0.
  private speed = 1;
  private position = 0;  ///< Place in `captures`, with the part of a frame that has passed.
  private plays = false;
  private pixels = 1;
  private last = 0;
  private request = 0;

  constructor(private readonly hooks: PlayerHooks) {
    for (const speed of kSpeeds) this.speedChoice.append(el('option', { value: speed }, `${speed} ×`));
    this.element.hidden = true;
  }

  /** Of the capture that is shown; `all`: numbers of the dataset's captures. */
  show(capture: CaptureLabels | null, all: number[], plays: boolean, speed: number, pixels: number): void {
    this.clip = capture?.clip ?? null;
    this.element.hidden = this.clip === null;
    this.pixels = Math.max(1, pixels);
    this.speed = speed;
    if (!this.clip || !capture) {
      this.plays = false;
      return;
    }
    this.first = capture.capture - this.clip.frame;
    if (!this.captures.includes(capture.capture)) {
      this.captures = all.filter((number) => number >= this.first && number < this.first + this.clip!.frames);
    }
    const place = this.captures.indexOf(capture.capture);
    if (Math.floor(this.position) !== place) this.position = place;
    const wasPlaying = this.plays;
    this.plays = plays && this.captures.length > 1;
    this.tell();
    if (this.plays && !wasPlaying) {
      this.last = performance.now();
      cancelAnimationFrame(this.request);
      this.request = requestAnimationFrame((now) => this.tick(now));
    }
  }

  /** Whether it does what it was asked for: there may be nothing to play. */
  get isPlaying(): boolean {
    return this.plays;
  }

  /** Nothing of what was fetched holds any more. */
  forget(): void {
    this.shots.clear();
    this.captures = [];
  }

  /** Whether it is of the clip that is shown. */
  has(capture: number): boolean {
    return this.clip !== null && this.captures.includes(capture);
  }

  stop(): void {
    this.plays = false;
  }

  /** The picture of a capture, kept from before or fetched now. */
  shot(capture: number): Shot {
    let shot = this.shots.get(capture);
    if (shot) this.shots.delete(capture);
    else shot = this.hooks.shot(capture);
    this.shots.set(capture, shot);
    const most = Math.max(2 * kAhead, Math.min(240, Math.floor(kMostPixels / this.pixels)));
    if (this.shots.size > most) this.shots.delete(this.shots.keys().next().value!);
    return shot;
  }

  /** True when the key means something here. */
  press(key: string): boolean {
    if (!this.clip) return false;
    const at = kSpeeds.indexOf(this.speed);
    if (key === ' ') this.toggle();
    else if (key === ',') this.step(-1);
    else if (key === '.') this.step(1);
    else if (key === '<') this.hooks.go({ speed: kSpeeds[Math.max(0, at - 1)] });
    else if (key === '>') this.hooks.go({ speed: kSpeeds[Math.min(kSpeeds.length - 1, at + 1)] });
    else if (key === 'Home') this.seek(0);
    else if (key === 'End') this.seek(this.captures.length - 1);
    else return false;
    return true;
  }

  private toggle(): void {
    // The page may be some frames behind its address.
    this.hooks.go({ plays: !this.plays, capture: this.captures[Math.floor(this.position)] });
  }

  private step(by: number): void {
    this.seek(Math.max(0, Math.min(this.captures.length - 1, Math.floor(this.position) + by)));
  }

  private seek(place: number): void {
    this.hooks.go({ capture: this.captures[place], plays: false });
  }

  private isReady(shot: Shot): boolean {
    return shot.hasLabels && shot.pixels.isIdle;
  }

  private tick(now: number): void {
    if (!this.plays || !this.clip) return;
    this.request = requestAnimationFrame((later) => this.tick(later));
    const count = this.captures.length;
    // Reports may have every tenth frame alone.
    const rate = Math.max(0, Math.min(kMostRate, this.clip.fps * this.speed * (count / this.clip.frames)));
    // A page in the background goes on where it was.
    const passed = Math.min(0.25, (now - this.last) / 1000) * rate;
    this.last = now;
    const here = Math.floor(this.position);
    const due = Math.floor(this.position + passed);
    for (let i = 1; i <= Math.min(count, kAhead + due - here); ++i) this.shot(this.captures[(here + i) % count]);
    // Of what has come, the frame whose time it is; the clock waits for the others.
    for (let place = due; place > Math.max(here, due - count); --place) {
      const capture = this.captures[place % count];
      const shot = this.shot(capture);
      if (!this.isReady(shot)) continue;
      this.position = (place === due ? this.position + passed : place) % count;
      this.hooks.shows(capture, shot);
      this.tell();
      return;
    }
    this.position = due === here ? this.position + passed : here + 0.999;
  }

  private tell(): void {
    const { clip, fps, frames } = this.clip!;
    const place = Math.floor(this.position);
    const frame = this.captures[place] - this.first;
    this.scrub.max = String(this.captures.length - 1);
    this.scrub.value = String(place);
    const text = `clip ${clip}, frame ${frame + 1} of ${frames}, ${(frame / fps).toFixed(2)} s`;
    this.words.textContent = text;
    this.scrub.setAttribute('aria-valuetext', text);
    this.speedChoice.value = String(this.speed);
    this.play.textContent = this.plays ? '‖' : '▶';
    this.play.title = this.plays ? 'Pause (space)' : 'Play (space)';
    this.play.setAttribute('aria-label', this.plays ? 'Pause' : 'Play');
  }
}
