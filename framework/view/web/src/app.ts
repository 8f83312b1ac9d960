// SPDX-License-Identifier: Apache-2.0
import { CaptureLabels, CaptureTable, DatasetInfo, SiteState, get } from './data';
import { Filtered } from './filter';
import { Palette } from './layers';
import { State } from './state';

/** What all parts of the page share. */
export interface App {
  state: State;
  site: SiteState;
  info: DatasetInfo;
  holds: Set<string>;
  table: CaptureTable;
  filtered: Filtered;
  palette: Palette;
  /** Changes what is shown, and the address. `replaces`: without a step for the way back. */
  go(change: Partial<State>, replaces?: boolean): void;
  /** Of the dataset that is shown, unless another one is named. */
  labels(capture: number, dataset?: number): Promise<CaptureLabels>;
}

/** Labels of captures that were asked for, the last ones kept. */
export class LabelStore {
  private readonly kept = new Map<number, Promise<CaptureLabels>>();

  constructor(private readonly dataset: number) {}

  of(capture: number): Promise<CaptureLabels> {
    let labels = this.kept.get(capture);
    if (labels) {
      this.kept.delete(capture);
    } else {
      labels = get(`/api/${this.dataset}/capture/${capture}`) as Promise<CaptureLabels>;
      labels.catch(() => this.kept.delete(capture));
    }
    this.kept.set(capture, labels);
    if (this.kept.size > 200) this.kept.delete(this.kept.keys().next().value!);
    return labels;
  }
}
