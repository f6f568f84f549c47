/** Elements with their attributes and children. Texts become text nodes, never markup: names come from strangers. */
type Attribute = string | number | boolean | null | ((event: never) => void);
type Attributes = Record<string, Attribute>;
export type Child = Node | string | null;

const SVG = "http://www.w3.org/2000/svg";

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  return filled(document.createElement(tag), attributes, children);
}

export function drawing<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: Child[]
): SVGElementTagNameMap[K] {
  return filled(document.createElementNS(SVG, tag), attributes, children);
}

export function replaceAll(parent: Element, ...children: Child[]): void {
  parent.replaceChildren(...children.filter((child) => child !== null));
}

function filled<E extends Element>(made: E, attributes: Attributes, children: Child[]): E {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value as EventListener);
    else if (value !== null && value !== false) made.setAttribute(name, value === true ? "" : String(value));
  }
  replaceAll(made, ...children);
  return made;
}

/** A choice of one among a few: buttons of which one is pressed. */
export function choice<T extends string>(
  label: string,
  options: readonly (readonly [T, string])[],
  pick: (value: T) => void,
): { readonly root: HTMLElement; readonly show: (value: T) => void } {
  const buttons = options.map(([value, name]) => element("button", { type: "button", click: () => pick(value) }, name));
  const root = element("div", { class: "choice", role: "group", "aria-label": label }, ...buttons);
  const show = (value: T): void => {
    buttons.forEach((button, i) => button.setAttribute("aria-pressed", String(options[i]?.[0] === value)));
  };
  return { root, show };
}
