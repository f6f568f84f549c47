/** The document as it comes: `pomona/viewer/season_page.py` writes it. */
import type { Packed } from "./columns";

export const FORMAT = 2;

export interface Told {
  readonly format: number;
  readonly program: string;
  readonly name: string;
  readonly visits: readonly { name: string; date: string; n_fruits: number; n_matched: number }[];
  readonly is_vertical_guessed: boolean;
  readonly map_from_page: readonly (readonly number[])[];
  /** `n_hang` fruits are expected to hang on a tree. */
  readonly trees: readonly { name: string; row: string; middle: readonly [number, number, number]; n_hang: number }[];
  readonly fruits: {
    readonly ids: string;
    readonly tree: Packed;
    readonly state: Packed;
    readonly state_probability: Packed;
    readonly fruit_probability: Packed;
  };
  readonly sights: Readonly<Record<"fruit" | "visit" | "x" | "y" | "z" | "diameter_mm" | "probability", Packed>>;
  /** As it was asked for, whether or not there is growth to foretell it. */
  readonly harvest: string | null;
  readonly growth: ToldGrowth | null;
  readonly thinning: ToldThinning | null;
  readonly no_growth: string | null;
  /** Size classes as they were measured, where there is no growth but there are diameters. */
  readonly sizes: readonly SizeClass[] | null;
  readonly calipers: Calipers | null;
  readonly crops: ToldCrops | null;
}

export interface ToldCrops {
  /** Rows of the fruits that have a picture. */
  readonly best: Packed;
  /** Of these, in base64, in a report. */
  readonly pictures: readonly string[] | null;
  /** What the server has. */
  readonly sights: { readonly fruit: Packed; readonly visit: Packed } | null;
}

export interface Block {
  readonly kind: "all" | "row" | "tree";
  readonly name: string;
  readonly n_fruits: number;
  readonly n_fruits_low: number;
  readonly n_fruits_high: number;
  readonly mean_mm: readonly number[];
  readonly low_mm: readonly number[];
  readonly high_mm: readonly number[];
  /** Low end, mean and high end. */
  readonly rate_mm_per_day: readonly [number, number, number];
}

/** A line of `classes.csv`; without growth no intervals are known. */
export interface SizeClass {
  readonly date: string;
  readonly from_mm: number | null;
  readonly below_mm: number | null;
  readonly n_fruits: number;
  readonly n_fruits_low: number | null;
  readonly n_fruits_high: number | null;
  readonly kg: number;
  readonly packs: number;
  readonly packs_low: number | null;
  readonly packs_high: number | null;
}

export interface ToldGrowth {
  readonly days: readonly string[];
  readonly n_visits: number;
  readonly harvest: string | null;
  readonly curve: string;
  readonly clock: string;
  readonly noise_mm: number;
  readonly scales: Readonly<Record<string, number>>;
  readonly median_mm: Packed;
  readonly low_mm: Packed;
  readonly high_mm: Packed;
  readonly rate_mm_per_day: Packed;
  readonly rate_sigma_mm_per_day: Packed;
  /** Of what hangs and no visit measured: of none of these is growth told. */
  readonly n_unmeasured: number;
  /** Probability of each fruit that it has stopped growing. */
  readonly stopped: Packed;
  readonly odd: Packed;
  readonly blocks: readonly Block[];
  readonly pack_kg: number;
  readonly classes: readonly SizeClass[];
}

export interface ToldThinning {
  readonly target: number | null;
  readonly are_fruitlets: boolean;
  readonly is_told: boolean;
  readonly fast_mm_per_day: number;
  readonly from: string;
  readonly to: string;
  readonly cluster: Packed;
  readonly cluster_size: Packed;
  readonly rate_mm_per_day: Packed;
  readonly drop_probability: Packed;
  readonly place: Packed;
}

export interface Agreement {
  readonly n: number;
  readonly bias_mm: number;
  readonly rmse_mm: number;
  readonly low_mm: number | null;
  readonly high_mm: number | null;
}

export interface Calipers {
  readonly file: string;
  readonly unseen: readonly string[];
  readonly all: Agreement;
  readonly visits: readonly ({ name: string } & Agreement)[];
  readonly pairs: readonly { fruit: number; name: string; date: string; measured_mm: number; caliper_mm: number }[];
}
