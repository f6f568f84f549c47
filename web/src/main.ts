/** The page: reads what it is told and lays out its parts. */
import "uplot/dist/uPlot.min.css";
import "./style/page.css";
import { element, replaceAll } from "./elements";
import { pageOf } from "./page";
import { layOut } from "./parts/layout";
import { readSeason } from "./told/season";

async function open(root: HTMLElement): Promise<void> {
  try {
    const page = pageOf(await readSeason());
    document.title = `${page.season.name} · Pomona`;
    layOut(root, page);
  } catch (error) {
    const why = error instanceof Error ? error.message : String(error);
    replaceAll(root, element("p", { class: "notice", role: "alert" }, `The orchard cannot be shown: ${why}`));
    throw error;
  }
}

void open(document.getElementById("page") as HTMLElement);
