/** The growth curve of a fruit: sizes as measured, the curve with its 90 % interval, and the forecast. */
import uPlot from "uplot";
import { element } from "../elements";
import type { Page } from "../page";
import { ink, repaint } from "../theme";
import { day, fullDay, mm } from "../words";

const HEIGHT_PX = 190;
type Column = (number | null)[];

export function curveChart(page: Page, fruit: number): HTMLElement | null {
  const { growth } = page.season;
  if (growth === null || Number.isNaN(growth.medianMm[fruit * growth.times.length])) return null;
  const points = columnsOf(page, fruit);
  const holder = element("div", { class: "curve", role: "img", "aria-label": spoken(page, fruit) });
  let chart: uPlot | null = null;
  const draw = (): void => {
    chart?.destroy();
    chart = new uPlot(optionsOf(holder.clientWidth || 300), points, holder);
  };
  new ResizeObserver(() => {
    if (!chart) draw();
    else if (holder.clientWidth > 0) chart.setSize({ width: holder.clientWidth, height: HEIGHT_PX });
  }).observe(holder);
  repaint.watch(() => chart && draw());
  return holder;
}

/** Seconds; measured; the curve, then what is foretold; low and high ends. */
function columnsOf({ season }: Page, fruit: number): uPlot.AlignedData {
  const growth = season.growth!;
  const q = growth.times.length;
  const measured = new Map<number, number>();
  for (let row = season.sights.starts[fruit]; row < season.sights.starts[fruit + 1]; row++) {
    measured.set(season.visits[season.sights.visit[row]].time, season.sights.diameterMm[row]);
  }
  const days = [...new Set([...growth.times, ...measured.keys()])].sort((a, b) => a - b);
  const last = growth.times[growth.nVisits - 1];
  const of = (rows: Float64Array, from: number, to: number): Column =>
    days.map((time) => {
      const value = rows[fruit * q + growth.times.lastIndexOf(time)];
      return time < from || time > to || !(value > 0) ? null : value;
    });
  const dots = days.map((time) => (measured.get(time) ?? 0) || null);
  return [
    days.map((time) => time / 1000),
    dots,
    of(growth.medianMm, 0, last),
    of(growth.medianMm, last, Infinity),
    of(growth.lowMm, 0, Infinity),
    of(growth.highMm, 0, Infinity),
  ];
}

function optionsOf(width: number): uPlot.Options {
  const [text, grid, leaf, later] = [ink("soft"), ink("line"), ink("leaf"), ink("bar-later")];
  const axis = { stroke: text, grid: { stroke: grid, width: 1 }, ticks: { show: false }, font: "12px system-ui" };
  const none = { show: false };
  return {
    width,
    height: HEIGHT_PX,
    legend: none,
    cursor: none,
    padding: [8, 20, 0, 0],
    scales: { x: { time: false } },
    axes: [
      { ...axis, space: 64, size: 28, values: (_chart, seconds) => seconds.map((second) => day(1000 * second)) },
      { ...axis, size: 34, label: "mm", labelSize: 16, labelFont: "12px system-ui" },
    ],
    series: [
      {},
      { stroke: leaf, width: 0, paths: () => null, points: { show: true, size: 7, fill: leaf } },
      { stroke: leaf, width: 2, points: none },
      { stroke: later, width: 2, dash: [5, 4], points: none },
      { stroke: "transparent", width: 0, points: none },
      { stroke: "transparent", width: 0, points: none },
    ],
    bands: [{ series: [5, 4], fill: `${leaf}2e` }],
  };
}

function spoken({ season }: Page, fruit: number): string {
  const growth = season.growth!;
  const q = growth.times.length;
  const at = (i: number): string => `${mm(growth.medianMm[fruit * q + i])} on ${fullDay(growth.times[i])}`;
  const last = growth.medianMm.subarray(fruit * q, fruit * q + growth.nVisits).findLastIndex((size) => !Number.isNaN(size));
  return `Growth curve with its 90 % interval, from ${at(0)} to ${at(last)}`;
}
