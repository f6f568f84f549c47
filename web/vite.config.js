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

export default {
  plugins: [noted()],
  build: {
    outDir: built,
    emptyOutDir: true,
    target: "es2022",
    modulePreload: false,
    cssCodeSplit: false,
    lib: { entry: join(here, "src/main.ts"), name: "pomona", formats: ["iife"], fileName: () => "page.js", cssFileName: "page" },
  },
};
