// SPDX-License-Identifier: Apache-2.0
// Elements. Texts of datasets are hostile: they become text nodes and nothing else.

type Child = Node | string | number | null | false;
type Handlers = { [event: string]: (event: any) => void };
type Attributes = { [name: string]: string | number | boolean | null };

const kSvg = 'http://www.w3.org/2000/svg';

function fill(element: Element, attributes: Attributes, children: Child[]): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === false) continue;
    element.setAttribute(name, value === true ? '' : String(value));
  }
  for (const child of children) {
    if (child === null || child === false) continue;
    element.append(child instanceof Node ? child : String(child));
  }
}

export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  fill(element, attributes, children);
  return element;
}

export function svg(tag: string, attributes: Attributes = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS(kSvg, tag) as SVGElement;
  fill(element, attributes, children);
  return element;
}

export function on<T extends EventTarget>(target: T, handlers: Handlers): T {
  for (const [event, handler] of Object.entries(handlers)) target.addEventListener(event, handler);
  return target;
}

export function button(text: string, title: string, act: () => void, attributes: Attributes = {}) {
  return on(el('button', { type: 'button', title, ...attributes }, text), { click: act });
}

export function clear(element: Element): void {
  element.replaceChildren();
}

/** Empties an element that is about to be made anew. The function that it returns gives the focus back to what
 *  has the same data-`mark` as what had it. */
export function remake(element: HTMLElement, mark: string): () => void {
  const active = document.activeElement;
  const focus = active instanceof HTMLElement && element.contains(active) ? active.dataset[mark] : undefined;
  clear(element);
  return () => {
    if (focus !== undefined) element.querySelector<HTMLElement>(`[data-${mark}="${CSS.escape(focus)}"]`)?.focus();
  };
}

export function plural(count: number, one: string, many = one + 's'): string {
  return `${count.toLocaleString('en')} ${count === 1 ? one : many}`;
}
