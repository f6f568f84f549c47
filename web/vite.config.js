import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const built = join(here, "../python/pomona/viewer/page");
const BESIDE_SOURCES = ["package.json", "package-lock.json", "public/index.html", "tsconfig.json", "vite.config.js"];

function digest(folder, names) {
  const all = createHash("sha256");
  for (const name of names.sort()) {
    all.update(`${name}\n${createHash("sha256").update(readFileSync(join(folder, name))).digest("hex")}\n`);
  }
  return all.digest("hex");
}

/** Notes which sources the page was built from, and what came out: `tests/test_page_build.py` compares. */
function noted() {
  return {
    name: "noted",
    closeBundle() {
      const files = readdirSync(join(here, "src"), { recursive: true, withFileTypes: true });
      const sources = files.filter((file) => file.isFile()).map((file) => join(file.parentPath, file.name));
      const names = [...sources.map((path) => path.slice(here.length)), ...BESIDE_SOURCES];
      const note = { sources: digest(here, names), page: digest(built, ["index.html", "page.css", "page.js"]) };
      writeFileSync(join(built, "built_from.json"), `${JSON.stringify(note, null, 2)}\n`);
    },
  };
}

/** What is inside the page, and what its licences ask to be carried along; ogl is public domain (Unlicense). */
function notices() {
  const licence = readFileSync(join(here, "node_modules/uplot/LICENSE"), "utf8").trim();
  return `/*! ogl 1.0.11: Unlicense, public domain.\nuPlot 1.6.32: ${licence} */`;
}

export default {
  plugins: [noted()],
  build: {
    outDir: built,
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    rolldownOptions: { output: { postBanner: notices() } },
    lib: { entry: join(here, "src/main.ts"), name: "pomona", formats: ["iife"], fileName: () => "page.js", cssFileName: "page" },
  },
};
