/** Numbers and days as people read them. */
const UNKNOWN = "–";
const DAY = new Intl.DateTimeFormat("en-GB", { day: "numeric", month: "short", timeZone: "UTC" });
const FULL_DAY = new Intl.DateTimeFormat("en-GB", { day: "numeric", month: "short", year: "numeric", timeZone: "UTC" });
const WHOLE = new Intl.NumberFormat("en-GB", { maximumFractionDigits: 0 });

export const number = (value: number, digits: number): string =>
  Number.isFinite(value) ? value.toFixed(digits).replace(/^-(0(\.0+)?)$/, "$1") : UNKNOWN;
/** Expected fruits as whole ones, halves up, as the tables of `pomona growth` have them: sums in another order differ by less than a millionth. */
export const wholeFruits = (expected: number): number => Math.floor(expected + 0.5 + 1e-6);
export const whole = (value: number): string => (Number.isFinite(value) ? WHOLE.format(value) : UNKNOWN);
export const mm = (value: number): string => (Number.isFinite(value) ? `${value.toFixed(1)} mm` : UNKNOWN);
export const percent = (share: number): string => (Number.isFinite(share) ? `${Math.round(100 * share)}\u00a0%` : UNKNOWN);
export const day = (time: number): string => DAY.format(time);
export const fullDay = (time: number): string => FULL_DAY.format(time);
export const fruits = (n: number): string => (n === 1 ? "1 fruit" : `${whole(n)} fruits`);

/** Milliseconds of a day. */
export const DAY_MS = 86_400_000;

/** Milliseconds of a local day or moment of the orchard, as if it lay in Greenwich: days are counted, zones are not. */
export const timeOf = (iso: string): number => Date.parse(iso.includes("T") ? `${iso}Z` : iso);
