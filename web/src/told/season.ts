/** The season in memory: columns of N fruits, K sights and Q days of curves. */
import { fullDay, timeOf } from "../words";
import { unpacked, unpackedTexts } from "./columns";
import { cropsOf, type Crops } from "./crops";
import { FORMAT, type Block, type Calipers, type SizeClass, type Told } from "./document";

export const STATES = ["new", "seen", "missed", "gone"] as const;
export type State = (typeof STATES)[number];

export interface Visit {
  readonly name: string;
  readonly time: number;
  /** Its day; where several visits were on it, with the name. */
  readonly title: string;
}

export interface Tree {
  readonly name: string;
  readonly label: string;
  /** Name of its row, blank where the map has one row or none. */
  readonly row: string;
  readonly middle: readonly [number, number, number];
  /** How many fruits are expected to hang on it. */
  readonly hang: number;
}

/** Sights of fruit `i` are the rows from `starts[i]` to before `starts[i + 1]`, in order of visits. */
export interface Sights {
  readonly starts: Int32Array;
  readonly visit: Float64Array;
  readonly x: Float64Array;
  readonly y: Float64Array;
  readonly z: Float64Array;
  readonly diameterMm: Float64Array;
  readonly probability: Float64Array;
}

/** Curves are N x Q, row by row; the last day is the harvest where one was asked for. */
export interface Growth {
  readonly times: readonly number[];
  readonly nVisits: number;
  readonly harvest: number | null;
  readonly medianMm: Float64Array;
  readonly lowMm: Float64Array;
  readonly highMm: Float64Array;
  readonly rate: Float64Array;
  readonly rateSigma: Float64Array;
  /** How many hang that no visit measured. */
  readonly unmeasured: number;
  readonly stopped: Float64Array;
  readonly odd: Float64Array;
  readonly blocks: readonly Block[];
  readonly packKg: number;
  readonly curve: string;
  readonly noiseMm: number;
}

export interface Thinning {
  readonly target: number | null;
  /** Whether fruits are still of the size at which one thins, and for which the rule is. */
  readonly areFruitlets: boolean;
  /** Whether the two visits tell which fruits will drop. */
  readonly isTold: boolean;
  readonly fast: number;
  readonly from: number;
  readonly to: number;
  readonly cluster: Float64Array;
  readonly clusterSize: Float64Array;
  readonly rate: Float64Array;
  readonly dropProbability: Float64Array;
  readonly place: Float64Array;
}

export interface Season {
  readonly name: string;
  readonly program: string;
  readonly visits: readonly Visit[];
  readonly trees: readonly Tree[];
  /** Whether nothing but the shape of the row told which way is up. */
  readonly isVerticalGuessed: boolean;
  readonly mapFromPage: readonly (readonly number[])[];
  readonly n: number;
  readonly ids: readonly string[];
  readonly tree: Float64Array;
  readonly state: Float64Array;
  readonly stateProbability: Float64Array;
  readonly fruitProbability: Float64Array;
  readonly sights: Sights;
  readonly harvest: number | null;
  readonly growth: Growth | null;
  readonly noGrowth: string | null;
  /** On the last day that has diameters, and at the harvest. */
  readonly classes: readonly SizeClass[];
  readonly thinning: Thinning | null;
  readonly calipers: Calipers | null;
  readonly crops: Crops | null;
}

/** Names of the rows, in their order; none where the map has one row or none. */
export function rowsOf({ trees }: Season): string[] {
  return [...new Set(trees.map(({ row }) => row))].filter((row) => row !== "");
}

/** Takes the document out of the report, or asks the server for it. */
export async function readSeason(): Promise<Season> {
  const inside = document.getElementById("season");
  const told: Told | { error: string } = JSON.parse(
    inside?.textContent ?? (await (await fetch("season.json")).text()),
  );
  if ("error" in told) throw new Error(told.error);
  if (told.format !== FORMAT) throw new Error(`this page reads format ${FORMAT}, the map was told in ${told.format}`);
  return unpackedSeason(told);
}

async function unpackedSeason(told: Told): Promise<Season> {
  const ids = await unpackedTexts(told.fruits.ids);
  return {
    name: told.name,
    program: told.program,
    visits: visitsOf(told),
    trees: told.trees.map(({ name, row, middle, n_hang }) => ({ name, row, label: name ? `Tree ${name}` : "No tree", middle, hang: n_hang })),
    isVerticalGuessed: told.is_vertical_guessed,
    mapFromPage: told.map_from_page,
    n: ids.length,
    ids,
    tree: await unpacked(told.fruits.tree),
    state: await unpacked(told.fruits.state),
    stateProbability: await unpacked(told.fruits.state_probability),
    fruitProbability: await unpacked(told.fruits.fruit_probability),
    sights: await sightsOf(told, ids.length),
    harvest: told.harvest === null ? null : timeOf(told.harvest),
    growth: await growthOf(told),
    noGrowth: told.no_growth,
    classes: told.growth?.classes ?? told.sizes ?? [],
    thinning: await thinningOf(told),
    calipers: told.calipers,
    crops: await cropsOf(told.crops, ids),
  };
}

function visitsOf({ visits }: Told): Visit[] {
  const days = visits.map(({ date }) => fullDay(timeOf(date)));
  const isAlone = (i: number): boolean => days.indexOf(days[i]) === days.lastIndexOf(days[i]);
  return visits.map(({ name, date }, i) => ({ name, time: timeOf(date), title: isAlone(i) ? days[i] : `${days[i]}, ${name}` }));
}

async function sightsOf({ sights }: Told, n: number): Promise<Sights> {
  const fruit = await unpacked(sights.fruit);
  const starts = new Int32Array(n + 1);
  for (const row of fruit) starts[row + 1]++;
  for (let i = 0; i < n; i++) starts[i + 1] += starts[i];
  return {
    starts,
    visit: await unpacked(sights.visit),
    x: await unpacked(sights.x),
    y: await unpacked(sights.y),
    z: await unpacked(sights.z),
    diameterMm: await unpacked(sights.diameter_mm),
    probability: await unpacked(sights.probability),
  };
}

async function growthOf({ growth }: Told): Promise<Growth | null> {
  if (growth === null) return null;
  return {
    times: growth.days.map(timeOf),
    nVisits: growth.n_visits,
    harvest: growth.harvest === null ? null : timeOf(growth.harvest),
    medianMm: await unpacked(growth.median_mm),
    lowMm: await unpacked(growth.low_mm),
    highMm: await unpacked(growth.high_mm),
    rate: await unpacked(growth.rate_mm_per_day),
    rateSigma: await unpacked(growth.rate_sigma_mm_per_day),
    unmeasured: growth.n_unmeasured,
    stopped: await unpacked(growth.stopped),
    odd: await unpacked(growth.odd),
    blocks: growth.blocks,
    packKg: growth.pack_kg,
    curve: growth.curve,
    noiseMm: growth.noise_mm,
  };
}

async function thinningOf({ thinning }: Told): Promise<Thinning | null> {
  if (thinning === null) return null;
  return {
    target: thinning.target,
    areFruitlets: thinning.are_fruitlets,
    isTold: thinning.is_told,
    fast: thinning.fast_mm_per_day,
    from: timeOf(thinning.from),
    to: timeOf(thinning.to),
    cluster: await unpacked(thinning.cluster),
    clusterSize: await unpacked(thinning.cluster_size),
    rate: await unpacked(thinning.rate_mm_per_day),
    dropProbability: await unpacked(thinning.drop_probability),
    place: await unpacked(thinning.place),
  };
}
