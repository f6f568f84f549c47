/** Pages of the page: tabs, of which each is laid out when it is first looked at. */
import { element } from "../elements";
import { Signal } from "../signal";

export interface Tab<T extends string> {
  readonly name: T;
  readonly title: string;
  readonly build: () => readonly HTMLElement[];
}

export interface Tabs<T extends string> {
  readonly list: HTMLElement;
  readonly panels: readonly HTMLElement[];
  readonly chosen: Signal<T>;
}

export function tabs<T extends string>(all: readonly Tab<T>[], chosen: Signal<T>): Tabs<T> {
  const buttons = all.map(({ name, title }) =>
    element("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, click: () => chosen.set(name) }, title),
  );
  const panels = all.map(({ name }) =>
    element("div", { role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}`, class: `panel ${name}` }),
  );
  const list = element("div", { role: "tablist", "aria-label": "Pages" }, ...buttons);
  chosen.watch((now) => {
    all.forEach(({ name, build }, i) => {
      const isChosen = name === now;
      buttons[i].setAttribute("aria-selected", String(isChosen));
      buttons[i].tabIndex = isChosen ? 0 : -1;
      panels[i].hidden = !isChosen;
      if (isChosen && panels[i].childElementCount === 0) panels[i].append(...build());
    });
  });
  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const to = (all.findIndex(({ name }) => name === chosen.value) + step + all.length) % all.length;
    chosen.set(all[to].name);
    buttons[to].focus();
  });
  return { list, panels, chosen };
}
