/** The page: reads what it is told and lays out its parts. */
import "uplot/dist/uPlot.min.css";
import "./style/page.css";
import { element, replaceAll } from "./elements";
import { layOut } from "./parts/layout";
import { pageOf } from "./page";
import { readSeason } from "./told/season";

const root = document.getElementById("page") as HTMLElement;
try {
  const page = pageOf(await readSeason());
  document.title = `${page.season.name} · Pomona`;
  layOut(root, page);
} catch (error) {
  replaceAll(root, element("p", { class: "notice", role: "alert" }, `The orchard cannot be shown: ${String(error)}`));
  throw error;
}
