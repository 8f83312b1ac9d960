// SPDX-License-Identifier: Apache-2.0
import { CaptureLabels, CaptureTable, DatasetInfo, Finding, LintReport, SiteState, get } from './data';
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
  lint: Lint;
  /** Changes what is shown, and the address. `replaces`: without a step for the way back. */
  go(change: Partial<State>, replaces?: boolean): void;
  /** The same, of what the page shows already: a frame of a clip that plays, the part of a picture that was dragged to. It is
   *  not made anew, and the address follows as often as browsers let it. */
  note(change: Partial<State>): void;
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

/** What lint finds in all that is shown, from when it was asked for. */
export class Lint {
  isAsked = false;
  reports: LintReport[] | null = null;
  fault = '';

  /** `changed` is told once there is something, or a fault. */
  constructor(private readonly changed: () => void) {}

  ask(): void {
    if (this.isAsked) return;
    this.isAsked = true;
    this.changed();
    const look = async (): Promise<void> => {
      try {
        const found = (await get('/api/lint')) as LintReport[] | { fault: string } | null;
        if (found && 'fault' in found) this.fault = found.fault;
        else this.reports = found;
      } catch (error) {
        this.fault = (error as Error).message;
      }
      if (this.reports === null && this.fault === '') window.setTimeout(() => void look(), 700);
      else this.changed();
    };
    void look();
  }

  /** Of one dataset; null when it is not known yet. */
  findingsOf(site: SiteState, dataset: number): Finding[] | null {
    return this.reports && this.reports.filter((report) => datasetOf(site, report) === dataset).flatMap((report) => report.findings);
  }
}

/** The place of the dataset that a report is of; -1: it is not shown. */
export function datasetOf(site: SiteState, report: LintReport): number {
  const own = site.datasets.filter((dataset) => !dataset.is_other);
  if (own.length === 1) return site.datasets.indexOf(own[0]);
  return site.datasets.findIndex((one) => !one.is_other && (report.dataset.endsWith('/' + one.name) || report.dataset === one.name));
}
