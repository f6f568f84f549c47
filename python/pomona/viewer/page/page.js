function e(e, t = {}, ...n) {
	return r(document.createElement(e), t, n);
}
function t(e, t = {}, ...n) {
	return r(document.createElementNS("http://www.w3.org/2000/svg", e), t, n);
}
function n(e, ...t) {
	e.replaceChildren(...t.filter((e) => e !== null));
}
function r(e, t, r) {
	for (let [n, r] of Object.entries(t)) typeof r == "function" ? e.addEventListener(n, r) : r !== null && r !== !1 && e.setAttribute(n, r === !0 ? "" : String(r));
	return n(e, ...r), e;
}
function i(t, n, r) {
	let i = n.map(([t, n]) => e("button", {
		type: "button",
		click: () => r(t)
	}, n));
	return {
		root: e("div", {
			class: "choice",
			role: "group",
			"aria-label": t
		}, ...i),
		show: (e) => {
			i.forEach((t, r) => t.setAttribute("aria-pressed", String(n[r]?.[0] === e)));
		}
	};
}
// src/words.ts
var a = new Intl.DateTimeFormat("en-GB", {
	day: "numeric",
	month: "short",
	timeZone: "UTC"
}), o = new Intl.DateTimeFormat("en-GB", {
	day: "numeric",
	month: "short",
	year: "numeric",
	timeZone: "UTC"
}), s = new Intl.NumberFormat("en-GB", { maximumFractionDigits: 0 }), c = (e, t) => Number.isFinite(e) ? e.toFixed(t).replace(/^-(0(\.0+)?)$/, "$1") : "–", l = (e) => Number.isFinite(e) ? s.format(e) : "–", u = (e) => Number.isFinite(e) ? `${e.toFixed(1)} mm` : "–", d = (e) => Number.isFinite(e) ? `${Math.round(100 * e)} %` : "–", f = (e) => a.format(e), p = (e) => o.format(e), m = (e) => e === 1 ? "1 fruit" : `${l(e)} fruits`, h = (e) => Date.parse(e.includes("T") ? `${e}Z` : e);
// src/told/columns.ts
async function g(e) {
	let t = await v(e.bytes), { n, low: r, step: i } = e, a = new Float64Array(n), o = 0;
	for (let e = 0; e < n; e++) {
		let s = (t[e] | t[n + e] << 8 | t[2 * n + e] << 16 | t[3 * n + e] << 24) >>> 0;
		o += s % 2 ? -(s + 1) / 2 : s / 2, a[e] = o === 0 ? NaN : r + (o - 1) * i;
	}
	return a;
}
async function _(e) {
	return JSON.parse(new TextDecoder().decode(await v(e)));
}
async function v(e) {
	let t = Uint8Array.from(atob(e), (e) => e.charCodeAt(0)), n = new Blob([t]).stream().pipeThrough(new DecompressionStream("deflate"));
	return new Uint8Array(await new Response(n).arrayBuffer());
}
// src/told/season.ts
var y = [
	"new",
	"seen",
	"missed",
	"gone"
];
async function b() {
	let e = document.getElementById("season"), t = JSON.parse(e?.textContent ?? await (await fetch("season.json")).text());
	if ("error" in t) throw Error(t.error);
	if (t.format !== 1) throw Error(`this page reads format 1, the map was told in ${t.format}`);
	return x(t);
}
async function x(e) {
	let t = await _(e.fruits.ids);
	return {
		name: e.name,
		program: e.program,
		visits: e.visits.map(({ name: e, date: t }) => ({
			name: e,
			time: h(t)
		})),
		trees: e.trees.map(({ name: e, middle: t }) => ({
			name: e,
			label: e ? `Tree ${e}` : "No tree",
			middle: t
		})),
		mapFromPage: e.map_from_page,
		n: t.length,
		ids: t,
		tree: await g(e.fruits.tree),
		state: await g(e.fruits.state),
		stateProbability: await g(e.fruits.state_probability),
		fruitProbability: await g(e.fruits.fruit_probability),
		sights: await S(e, t.length),
		growth: await C(e),
		noGrowth: e.no_growth,
		thinning: await w(e),
		calipers: e.calipers
	};
}
async function S({ sights: e }, t) {
	let n = await g(e.fruit), r = new Int32Array(t + 1);
	for (let e of n) r[e + 1]++;
	for (let e = 0; e < t; e++) r[e + 1] += r[e];
	return {
		starts: r,
		visit: await g(e.visit),
		x: await g(e.x),
		y: await g(e.y),
		z: await g(e.z),
		diameterMm: await g(e.diameter_mm),
		probability: await g(e.probability)
	};
}
async function C({ growth: e }) {
	return e === null ? null : {
		times: e.days.map(h),
		nVisits: e.n_visits,
		harvest: e.harvest === null ? null : h(e.harvest),
		medianMm: await g(e.median_mm),
		lowMm: await g(e.low_mm),
		highMm: await g(e.high_mm),
		rate: await g(e.rate_mm_per_day),
		rateSigma: await g(e.rate_sigma_mm_per_day),
		odd: await g(e.odd),
		blocks: e.blocks,
		classes: e.classes,
		packKg: e.pack_kg,
		curve: e.curve,
		noiseMm: e.noise_mm
	};
}
async function w({ thinning: e }) {
	return e === null ? null : {
		target: e.target,
		fast: e.fast_mm_per_day,
		from: h(e.from),
		to: h(e.to),
		cluster: await g(e.cluster),
		clusterSize: await g(e.cluster_size),
		rate: await g(e.rate_mm_per_day),
		dropProbability: await g(e.drop_probability),
		place: await g(e.place)
	};
}
// src/facts.ts
function T({ season: e, target: t }, n) {
	let { growth: r, thinning: i, sights: a } = e, [o, s] = [r ? r.nVisits - 1 : 0, r ? r.times.length - 1 : 0], c = (e, t) => r && e ? e[n * r.times.length + t] : NaN, l = (e) => r?.harvest ? c(e, s) : NaN;
	return {
		id: e.ids[n],
		tree: e.trees[e.tree[n]].name,
		state: y[e.state[n]],
		stateProbability: e.stateProbability[n],
		sights: a.starts[n + 1] - a.starts[n],
		sizeMm: r ? c(r.medianMm, o) : D(e, n),
		lowMm: c(r?.lowMm, o),
		highMm: c(r?.highMm, o),
		rate: r ? r.rate[n] : NaN,
		forecastMm: l(r?.medianMm),
		forecastLowMm: l(r?.lowMm),
		forecastHighMm: l(r?.highMm),
		dropProbability: i ? i.dropProbability[n] : NaN,
		action: E(e, n, t.value)
	};
}
function E({ thinning: e, state: t }, n, r) {
	if (e === null || y[t[n]] === "gone") return "";
	let i = e.place[n];
	return Number.isNaN(i) ? Number.isNaN(e.clusterSize[n]) ? "" : "drops" : r !== null && i > r ? "thin" : "keep";
}
function D({ sights: e }, t) {
	for (let n = e.starts[t + 1] - 1; n >= e.starts[t]; n--) if (!Number.isNaN(e.diameterMm[n])) return e.diameterMm[n];
	return NaN;
}
// src/summary.ts
var O = y.indexOf("gone");
function k({ n: e, state: t }) {
	return Array.from({ length: e }, (e, t) => t).filter((e) => t[e] !== O);
}
function A({ growth: e, sights: t, ...n }) {
	let r = (n) => e ? e.medianMm[n * e.times.length + e.nVisits - 1] : t.diameterMm.subarray(t.starts[n], t.starts[n + 1]).findLast((e) => e > 0) ?? NaN;
	return k({
		growth: e,
		sights: t,
		...n
	}).map(r).filter((e) => !Number.isNaN(e));
}
function j({ season: e, target: t }) {
	let n = e.trees.map(() => ({
		fruits: 0,
		gone: 0,
		drops: 0,
		thin: 0,
		clusters: /* @__PURE__ */ new Set()
	}));
	for (let r = 0; r < e.n; r++) {
		let i = n[e.tree[r]];
		e.state[r] === O ? i.gone++ : i.fruits++;
		let a = E(e, r, t.value);
		a === "drops" && i.drops++, a === "thin" && (i.thin++, i.clusters.add(e.thinning?.cluster[r] ?? 0));
	}
	let r = e.growth?.blocks ?? [];
	return e.trees.map(({ name: e, label: t }, i) => {
		let { clusters: a, ...o } = n[i], s = r.find((t) => e ? t.kind === "tree" && t.name === e : t.kind === "all") ?? null;
		return {
			tree: i,
			label: t,
			...o,
			clustersToThin: a.size,
			block: s
		};
	});
}
// src/parts/advice.ts
var ee = 45, te = .9, ne = y.indexOf("missed");
function re(e) {
	let { season: t } = e, n = j(e);
	return [
		...ie(e, n),
		...ae(t),
		...se(t, n),
		...ce(t),
		...t.growth ? [] : ["Record the row again in a week or two: two dates show growth"],
		"Record the row again in a week or two"
	];
}
function ie({ season: e, target: t }, n) {
	if (!e.thinning) return [];
	let r = (e) => n.reduce((t, n) => t + e(n), 0), [i, a] = [r((e) => e.thin), r((e) => e.drops)], o = a > 0 ? [`${m(a)} will drop by themselves`] : [];
	if (t.value !== null) {
		let e = n.filter((e) => e.thin > 0).length, r = `to keep ${l(t.value)} on each tree`;
		return i > 0 ? [
			`Thin ${m(i)}`,
			`on ${e} of ${n.length} trees, ${r}`,
			...o
		] : [
			"Nothing to thin",
			r,
			...o
		];
	}
	return (e.growth?.blocks[0].mean_mm[e.growth.nVisits - 1] ?? 0) < ee ? [
		"Choose how many fruits a tree keeps",
		"the thinning page tells which to take",
		...o
	] : [];
}
function ae({ growth: e }) {
	if (!e?.harvest) return [];
	let t = e.classes.filter((t) => Date.parse(t.date) >= (e.harvest ?? 0)), n = (e) => t.reduce((t, n) => t + e(n), 0), r = t.reduce((e, t) => t.n_fruits > e.n_fruits ? t : e, t[0]), i = [`Plan ${l(Math.ceil(n((e) => e.packs)))} packs for ${p(e.harvest)}`], a = r ? r.n_fruits / n((e) => e.n_fruits) : 0;
	return r && i.push(`${d(a)} of fruits will measure ${oe(r)}`), i;
}
function oe({ from_mm: e, below_mm: t }) {
	return e === null ? `below ${t} mm` : t === null ? `${e} mm and more` : `${e} to ${t} mm`;
}
function se({ growth: e }, t) {
	let n = e?.blocks[0].rate_mm_per_day[1] ?? NaN, r = t.filter(({ block: e }) => e?.kind === "tree" && e.rate_mm_per_day[1] < te * n);
	return r.length === 0 ? [] : [`Look at ${r.slice(0, 3).map(({ label: e }) => e).join(", ")}${r.length > 3 ? " and others" : ""}: slower by a tenth or more`];
}
function ce(e) {
	let t = k(e).filter((t) => e.state[t] === ne).length;
	return t === 0 ? [] : [`${m(t)} hid from the last visit`];
}
// src/parts/answers.ts
function le(t) {
	let r = e("section", {
		class: "answers",
		"aria-label": "At a glance"
	});
	return t.target.watch(() => n(r, ue(t), de(t), fe(t), pe(t))), r;
}
function M(t, n, r, ...i) {
	let a = e("p", { class: "said" }, e("strong", {}, n), r ? ` ${r}` : null);
	return e("div", { class: "card answer" }, e("h2", { class: "label" }, t), a, ...i);
}
var N = (t) => e("p", { class: "soft" }, t);
function ue({ season: e }) {
	let t = k(e), n = e.trees.filter((e) => e.name).length, r = e.n - t.length, i = n > 0 ? `on ${n} trees, ${l(t.length / n)} a tree` : "no single trees known", a = r > 0 ? `${l(r)} more were seen and are gone` : "none is gone so far";
	return M("How many", l(t.length), "fruits hang", N(i), N(a));
}
function de({ season: e }) {
	let t = e.growth?.blocks[0], n = A(e);
	if (n.length === 0) return M("How big", "–", "", N("no diameters in this map"));
	let r = `the middle eight of ten: ${c(he(n, .1), 0)} to ${c(he(n, .9), 0)} mm`;
	if (!e.growth || !t) return M("How big", c(me(n), 1), "mm on average", N(r));
	let i = e.growth.nVisits - 1, a = `${c(t.low_mm[i], 1)} to ${c(t.high_mm[i], 1)} mm (90 %) on ${p(e.growth.times[i])}`;
	return M("How big", c(t.mean_mm[i], 1), "mm on average", N(a), N(r));
}
function fe({ season: e }) {
	let t = e.growth;
	if (!t) return M("How fast", "–", "", N(e.noGrowth ?? ""));
	let [n, r, i] = t.blocks[0].rate_mm_per_day, a = N(`${c(n, 2)} to ${c(i, 2)} mm (90 %)`), o = t.times.length - 1, s = t.harvest === null ? N("--harvest DATE foretells a day") : N(`${u(t.blocks[0].mean_mm[o])} on ${p(t.harvest)}: ${c(t.blocks[0].low_mm[o], 1)} to ${c(t.blocks[0].high_mm[o], 1)}`);
	return M("How fast", c(r, 2), "mm a day", a, s);
}
function pe(t) {
	let [n, ...r] = re(t), i = e("p", { class: "said" }, e("strong", {}, n)), a = r.slice(0, 3).map((e) => N(e));
	return e("div", { class: "card answer" }, e("h2", { class: "label" }, "What to do"), i, ...a);
}
var me = (e) => e.reduce((e, t) => e + t, 0) / e.length;
function he(e, t) {
	let n = [...e].sort((e, t) => e - t);
	return n[Math.round(t * (n.length - 1))];
}
// src/colours.ts
var P = [
	[
		72,
		30,
		112
	],
	[
		69,
		55,
		129
	],
	[
		57,
		86,
		140
	],
	[
		45,
		112,
		142
	],
	[
		33,
		144,
		141
	],
	[
		41,
		175,
		127
	],
	[
		92,
		200,
		99
	],
	[
		160,
		218,
		57
	],
	[
		253,
		231,
		37
	]
], ge = [
	150,
	150,
	150
], F = [
	0,
	158,
	115
], _e = [
	86,
	180,
	233
], I = [
	230,
	159,
	0
], L = [
	213,
	94,
	0
], ve = {
	new: _e,
	seen: F,
	missed: I,
	gone: L
}, ye = {
	keep: F,
	thin: L,
	drops: I,
	"": ge
}, be = [.02, .98];
function R(e) {
	if (Number.isNaN(e)) return ge;
	let t = Math.min(1, Math.max(0, e)) * (P.length - 1), [n, r] = [P[Math.floor(t)], t - Math.floor(t)], i = P[Math.min(P.length - 1, Math.floor(t) + 1)];
	return [
		0,
		1,
		2
	].map((e) => Math.round(n[e] + r * (i[e] - n[e])));
}
function xe(e) {
	return Se[e.colour.value](e);
}
var Se = {
	growth: ({ season: e }) => {
		let t = e.growth?.rate ?? /* @__PURE__ */ new Float64Array(), [n, r] = Ce(t);
		return {
			legend: {
				kind: "ramp",
				title: "growth, mm a day",
				low: c(n, 2),
				high: c(r, 2)
			},
			of: (e) => R((t[e] - n) / (r - n))
		};
	},
	size: ({ season: e, history: t }) => {
		let [n, r] = Ce(e.growth?.medianMm ?? e.sights.diameterMm);
		return {
			legend: {
				kind: "ramp",
				title: "diameter, mm",
				low: c(n, 0),
				high: c(r, 0)
			},
			of: (e, i) => R((t.sizeAt(e, i) - n) / (r - n))
		};
	},
	state: ({ history: e }) => ({
		legend: {
			kind: "swatches",
			title: "on this date",
			swatches: y.map((e) => ({
				name: e,
				rgb: ve[e],
				isRing: e === "missed" || e === "gone"
			}))
		},
		of: (t, n) => ve[e.stateAt(t, n)]
	}),
	date: ({ history: e }) => {
		let t = Math.max(1, e.times.length - 1);
		return {
			legend: {
				kind: "ramp",
				title: "first seen",
				low: f(e.times[0]),
				high: f(e.times[t] ?? e.times[0])
			},
			of: (n) => R(e.first[n] / t)
		};
	},
	plan: (e) => ({
		legend: {
			kind: "swatches",
			title: "what to do",
			swatches: [
				{
					name: "keep",
					rgb: F,
					isRing: !1
				},
				{
					name: "thin",
					rgb: L,
					isRing: !1
				},
				{
					name: "will drop",
					rgb: I,
					isRing: !1
				}
			]
		},
		of: (t) => ye[E(e.season, t, e.target.value)]
	})
};
function Ce(e) {
	let t = e.filter((e) => !Number.isNaN(e)).sort();
	if (t.length === 0) return [0, 1];
	let [n, r] = be.map((e) => t[Math.floor(e * (t.length - 1))]);
	return r > n ? [n, r] : [n - .5, n + .5];
}
// src/parts/row_tools.ts
var we = [
	["side", "Side"],
	["above", "Above"],
	["free", "3D"]
];
function Te(t, n) {
	let r = i("Colour", Ee(t), (e) => t.colour.set(e)), a = i("View", we, (e) => {
		n.see(e), a.show(e);
	});
	return a.show("free"), t.colour.watch(r.show), e("div", { class: "row-tools" }, e("span", { class: "label" }, "Colour"), r.root, a.root);
}
function Ee({ season: e }) {
	let t = [
		["size", "Size"],
		["state", "State"],
		["date", "Date"]
	], n = e.growth ? [["growth", "Growth"]] : [], r = e.thinning ? [["plan", "Thinning"]] : [];
	return [
		...n,
		...t,
		...r
	];
}
function De(t) {
	let r = e("div", { class: "legend" });
	return t.colour.watch(() => {
		let { legend: i } = xe(t);
		n(r, e("span", { class: "label" }, i.title), i.kind === "ramp" ? Oe(i) : ke(i));
	}), r;
}
function Oe({ low: t, high: n }) {
	let r = e("span", {
		class: "ramp",
		"aria-hidden": "true"
	});
	return r.style.background = `linear-gradient(to right, ${P.map((e) => `rgb(${e.join(",")})`).join(",")})`, e("span", { class: "ends" }, t, r, n);
}
function ke({ swatches: t }) {
	return e("span", { class: "swatches" }, ...t.map(({ name: t, rgb: n, isRing: r }) => {
		let i = e("span", {
			class: r ? "dot ring" : "dot",
			"aria-hidden": "true"
		});
		return i.style.color = `rgb(${n.join(",")})`, e("span", { class: "swatch" }, i, t);
	}));
}
// src/filter.ts
var Ae = {
	text: "",
	tree: null,
	state: "",
	action: "",
	fromMm: NaN,
	belowMm: NaN
};
function je(e) {
	let { season: t } = e, { text: n, tree: r, state: i, action: a, fromMm: o, belowMm: s } = e.filter.value, c = n.trim().toLowerCase(), l = !Number.isNaN(o) || !Number.isNaN(s);
	return (n) => {
		if (r !== null && t.tree[n] !== r) return !1;
		let u = y[t.state[n]];
		return (i === "hanging" ? u === "gone" : i !== "" && u !== i) || a !== "" && E(t, n, e.target.value) !== a || l && !Me(T(e, n).sizeMm, o, s) ? !1 : c === "" || t.ids[n] === c;
	};
}
function Me(e, t, n) {
	return !Number.isNaN(e) && !(e < t) && !(e >= n);
}
// src/signal.ts
var z = class {
	held;
	watchers = [];
	constructor(e) {
		this.held = e;
	}
	get value() {
		return this.held;
	}
	set(e) {
		if (e !== this.held) {
			this.held = e;
			for (let t of this.watchers) t(e);
		}
	}
	watch(e) {
		this.watchers.push(e), e(this.held);
	}
};
function Ne(e, t) {
	for (let n of e) n.watch(t);
}
function Pe(e) {
	let t = !1;
	return () => {
		t || (t = !0, requestAnimationFrame(() => {
			t = !1, e();
		}));
	};
}
// src/scene/gestures.ts
var Fe = .006, Ie = .08, Le = 5;
function Re(e, t, n) {
	let r = /* @__PURE__ */ new Map(), i = 0, a = (t) => {
		let n = e.getBoundingClientRect();
		return [t.clientX - n.left, t.clientY - n.top];
	};
	e.addEventListener("pointerdown", (t) => {
		e.setPointerCapture(t.pointerId), r.set(t.pointerId, {
			x: t.clientX,
			y: t.clientY
		}), r.size === 1 && (i = 0);
	}), e.addEventListener("pointermove", (o) => {
		let s = r.get(o.pointerId);
		if (!s) return n.hover(...a(o));
		let [c, l] = [o.clientX - s.x, o.clientY - s.y];
		if (i += Math.abs(c) + Math.abs(l), i < Le) return;
		let u = e.clientHeight;
		r.size === 2 ? ze(r, o, t, u) : o.shiftKey || o.buttons === 2 || o.buttons === 4 ? t.shift(-c / u, l / u) : t.turn(-c * Fe, l * Fe), r.set(o.pointerId, {
			x: o.clientX,
			y: o.clientY
		});
	});
	let o = (e) => {
		e.type === "pointerup" && r.size === 1 && i < Le && n.press(...a(e)), r.delete(e.pointerId);
	};
	e.addEventListener("pointerup", o), e.addEventListener("pointercancel", o), e.addEventListener("pointerleave", () => n.leave()), e.addEventListener("contextmenu", (e) => e.preventDefault()), e.addEventListener("wheel", (e) => {
		e.preventDefault(), t.zoom(Math.exp(Math.max(-60, Math.min(60, e.deltaY)) * .004));
	}, { passive: !1 }), e.addEventListener("keydown", (e) => {
		!e.ctrlKey && !e.metaKey && !e.altKey && Be(e, t) && e.preventDefault();
	});
}
function ze(e, t, n, r) {
	let i = e.get(t.pointerId), a = [...e].find(([e]) => e !== t.pointerId)?.[1];
	if (!i || !a) return;
	let o = (e) => Math.hypot(e.x - a.x, e.y - a.y);
	n.zoom(o(i) / Math.max(1, o({
		x: t.clientX,
		y: t.clientY
	}))), n.shift((i.x - t.clientX) / 2 / r, (t.clientY - i.y) / 2 / r);
}
function Be(e, t) {
	let n = {
		1: "side",
		2: "above",
		3: "free"
	}, r = e.shiftKey ? 3 * Ie : Ie, i = {
		ArrowLeft: () => t.shift(-r, 0),
		ArrowRight: () => t.shift(r, 0),
		ArrowUp: () => t.shift(0, r),
		ArrowDown: () => t.shift(0, -r),
		a: () => t.turn(-r, 0),
		d: () => t.turn(r, 0),
		w: () => t.turn(0, r),
		s: () => t.turn(0, -r),
		"+": () => t.zoom(.85),
		"=": () => t.zoom(.85),
		"-": () => t.zoom(1 / .85)
	}, a = n[e.key], o = a ? () => t.see(a) : i[e.key];
	return o?.(), o !== void 0;
}
// src/theme.ts
var B = new z(0);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => B.set(B.value + 1));
function Ve(e) {
	return getComputedStyle(document.documentElement).getPropertyValue(`--${e}`).trim();
}
function V(e) {
	let t = Number.parseInt(Ve(e).slice(1), 16);
	return [
		t >> 16,
		t >> 8 & 255,
		t & 255
	];
}
// src/scene/ground.ts
var He = .35, Ue = .5, We = 200;
function Ge({ trees: e }, { low: t, high: n }) {
	let r = t[2] - He, [i, a] = [t[1] - Ue, n[1] + Ue], o = [...V("ground"), 1], s = Math.max(1, Math.ceil((n[0] - t[0]) / We)), c = [{
		from: [
			t[0],
			i,
			r
		],
		to: [
			n[0],
			i,
			r
		],
		ink: o
	}, {
		from: [
			t[0],
			a,
			r
		],
		to: [
			n[0],
			a,
			r
		],
		ink: o
	}];
	for (let e = Math.ceil(t[0]); e <= n[0]; e += s) c.push({
		from: [
			e,
			i,
			r
		],
		to: [
			e,
			a,
			r
		],
		ink: o
	});
	let l = [...V("trunk"), 1];
	for (let { name: t, middle: i } of e) {
		let e = [
			i[0],
			i[1],
			r
		];
		t && c.push({
			from: e,
			to: [
				i[0],
				i[1],
				n[2]
			],
			ink: l
		});
	}
	return c;
}
var Ke = Math.PI / 2 - .001, qe = 1.12, Je = {
	side: [0, .1],
	above: [0, Ke],
	free: [-.4, .22]
}, Ye = class {
	extent;
	aspect;
	looking = new z({
		target: [
			0,
			0,
			0
		],
		azimuth: 0,
		elevation: 0,
		distance: 1
	});
	constructor(e, t = 2) {
		this.extent = e, this.aspect = t;
	}
	setAspect(e) {
		this.aspect = e;
	}
	see(e) {
		let [t, n] = Je[e], r = Qe(this.extent), [i, a, o, s] = [
			Math.sin(t),
			Math.cos(t),
			Math.sin(n),
			Math.cos(n)
		], c = Math.tan(28 * Math.PI / 360), l = Ze(this.extent).map(([e, t, n]) => {
			let [l, u, d] = [
				e - r[0],
				t - r[1],
				n - r[2]
			], [f, p] = [l * a + u * i, u * a - l * i], [m, h] = [p * o + d * s, d * o - p * s];
			return h + qe * Math.max(Math.abs(f) / this.aspect, Math.abs(m)) / c;
		});
		this.looking.set({
			target: r,
			azimuth: t,
			elevation: n,
			distance: Math.max(...l)
		});
	}
	turn(e, t) {
		let { azimuth: n, elevation: r, ...i } = this.looking.value, a = Math.min(Ke, Math.max(-.3, r + t));
		this.looking.set({
			...i,
			azimuth: n + e,
			elevation: a
		});
	}
	shift(e, t) {
		let { target: n, azimuth: r, elevation: i, distance: a } = this.looking.value, o = 2 * a * Math.tan(28 * Math.PI / 360), [s, c] = [e * o, t * o], l = c * Math.sin(i), u = [
			n[0] + s * Math.cos(r) - l * Math.sin(r),
			n[1] + s * Math.sin(r) + l * Math.cos(r),
			n[2] + c * Math.cos(i)
		];
		this.looking.set({
			...this.looking.value,
			target: u
		});
	}
	zoom(e) {
		let t = this.looking.value;
		this.looking.set({
			...t,
			distance: Math.min(1e4, Math.max(.2, t.distance * e))
		});
	}
	lookAt(e, t) {
		this.looking.set({
			...this.looking.value,
			target: e,
			distance: t
		});
	}
};
function Xe({ target: e, azimuth: t, elevation: n, distance: r }) {
	let i = r * Math.cos(n);
	return [
		e[0] + i * Math.sin(t),
		e[1] - i * Math.cos(t),
		e[2] + r * Math.sin(n)
	];
}
function Ze({ low: e, high: t }) {
	let n = [e, t];
	return n.flatMap(([e]) => n.flatMap(([, t]) => n.map(([, , n]) => [
		e,
		t,
		n
	])));
}
function Qe({ low: e, high: t }) {
	return [
		(e[0] + t[0]) / 2,
		(e[1] + t[1]) / 2,
		(e[2] + t[2]) / 2
	];
}
// src/scene/picking.ts
var $e = 6;
function et(e, t, n) {
	let { positions: r, diameters: i, colours: a } = e.fruits, o = null, s = Infinity;
	for (let c = 0; c < i.length; c++) {
		if (a[4 * c + 3] < 100) continue;
		let l = e.project(r[3 * c], r[3 * c + 1], r[3 * c + 2]);
		if (l === null) continue;
		let u = Math.max($e, i[c] / 2 * e.pixelsPerMetre(l.depth)), d = Math.hypot(l.x - t, l.y - n) / u, f = l.depth * (1 + .05 * d);
		d <= 1 && f < s && ([o, s] = [c, f]);
	}
	return o;
}
// src/scene/extent.ts
var tt = .002, nt = .15;
function rt({ sights: e }) {
	let t = [
		e.x,
		e.y,
		e.z
	].map((e) => {
		let t = e.slice().sort(), n = Math.floor(tt * (t.length - 1));
		return [t[n] - nt, t[t.length - 1 - n] + nt];
	});
	return {
		low: [
			t[0][0],
			t[1][0],
			t[2][0]
		],
		high: [
			t[0][1],
			t[1][1],
			t[2][1]
		]
	};
}
// node_modules/ogl/src/math/functions/Vec3Func.js
function H(e) {
	let t = e[0], n = e[1], r = e[2];
	return Math.sqrt(t * t + n * n + r * r);
}
function U(e, t) {
	return e[0] = t[0], e[1] = t[1], e[2] = t[2], e;
}
function it(e, t, n, r) {
	return e[0] = t, e[1] = n, e[2] = r, e;
}
function at(e, t, n) {
	return e[0] = t[0] + n[0], e[1] = t[1] + n[1], e[2] = t[2] + n[2], e;
}
function ot(e, t, n) {
	return e[0] = t[0] - n[0], e[1] = t[1] - n[1], e[2] = t[2] - n[2], e;
}
function st(e, t, n) {
	return e[0] = t[0] * n[0], e[1] = t[1] * n[1], e[2] = t[2] * n[2], e;
}
function ct(e, t, n) {
	return e[0] = t[0] / n[0], e[1] = t[1] / n[1], e[2] = t[2] / n[2], e;
}
function W(e, t, n) {
	return e[0] = t[0] * n, e[1] = t[1] * n, e[2] = t[2] * n, e;
}
function lt(e, t) {
	let n = t[0] - e[0], r = t[1] - e[1], i = t[2] - e[2];
	return Math.sqrt(n * n + r * r + i * i);
}
function ut(e, t) {
	let n = t[0] - e[0], r = t[1] - e[1], i = t[2] - e[2];
	return n * n + r * r + i * i;
}
function dt(e) {
	let t = e[0], n = e[1], r = e[2];
	return t * t + n * n + r * r;
}
function ft(e, t) {
	return e[0] = -t[0], e[1] = -t[1], e[2] = -t[2], e;
}
function pt(e, t) {
	return e[0] = 1 / t[0], e[1] = 1 / t[1], e[2] = 1 / t[2], e;
}
function G(e, t) {
	let n = t[0], r = t[1], i = t[2], a = n * n + r * r + i * i;
	return a > 0 && (a = 1 / Math.sqrt(a)), e[0] = t[0] * a, e[1] = t[1] * a, e[2] = t[2] * a, e;
}
function mt(e, t) {
	return e[0] * t[0] + e[1] * t[1] + e[2] * t[2];
}
function ht(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = n[0], s = n[1], c = n[2];
	return e[0] = i * c - a * s, e[1] = a * o - r * c, e[2] = r * s - i * o, e;
}
function gt(e, t, n, r) {
	let i = t[0], a = t[1], o = t[2];
	return e[0] = i + r * (n[0] - i), e[1] = a + r * (n[1] - a), e[2] = o + r * (n[2] - o), e;
}
function _t(e, t, n, r, i) {
	let a = Math.exp(-r * i), o = t[0], s = t[1], c = t[2];
	return e[0] = n[0] + (o - n[0]) * a, e[1] = n[1] + (s - n[1]) * a, e[2] = n[2] + (c - n[2]) * a, e;
}
function vt(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = n[3] * r + n[7] * i + n[11] * a + n[15];
	return o ||= 1, e[0] = (n[0] * r + n[4] * i + n[8] * a + n[12]) / o, e[1] = (n[1] * r + n[5] * i + n[9] * a + n[13]) / o, e[2] = (n[2] * r + n[6] * i + n[10] * a + n[14]) / o, e;
}
function yt(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = n[3] * r + n[7] * i + n[11] * a + n[15];
	return o ||= 1, e[0] = (n[0] * r + n[4] * i + n[8] * a) / o, e[1] = (n[1] * r + n[5] * i + n[9] * a) / o, e[2] = (n[2] * r + n[6] * i + n[10] * a) / o, e;
}
function bt(e, t, n) {
	let r = t[0], i = t[1], a = t[2];
	return e[0] = r * n[0] + i * n[3] + a * n[6], e[1] = r * n[1] + i * n[4] + a * n[7], e[2] = r * n[2] + i * n[5] + a * n[8], e;
}
function xt(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = n[0], s = n[1], c = n[2], l = n[3], u = s * a - c * i, d = c * r - o * a, f = o * i - s * r, p = s * f - c * d, m = c * u - o * f, h = o * d - s * u, g = l * 2;
	return u *= g, d *= g, f *= g, p *= 2, m *= 2, h *= 2, e[0] = r + u + p, e[1] = i + d + m, e[2] = a + f + h, e;
}
var St = (function() {
	let e = [
		0,
		0,
		0
	], t = [
		0,
		0,
		0
	];
	return function(n, r) {
		U(e, n), U(t, r), G(e, e), G(t, t);
		let i = mt(e, t);
		return i > 1 ? 0 : i < -1 ? Math.PI : Math.acos(i);
	};
})();
function Ct(e, t) {
	return e[0] === t[0] && e[1] === t[1] && e[2] === t[2];
}
// node_modules/ogl/src/math/Vec3.js
var K = class e extends Array {
	constructor(e = 0, t = e, n = e) {
		return super(e, t, n), this;
	}
	get x() {
		return this[0];
	}
	get y() {
		return this[1];
	}
	get z() {
		return this[2];
	}
	set x(e) {
		this[0] = e;
	}
	set y(e) {
		this[1] = e;
	}
	set z(e) {
		this[2] = e;
	}
	set(e, t = e, n = e) {
		return e.length ? this.copy(e) : (it(this, e, t, n), this);
	}
	copy(e) {
		return U(this, e), this;
	}
	add(e, t) {
		return t ? at(this, e, t) : at(this, this, e), this;
	}
	sub(e, t) {
		return t ? ot(this, e, t) : ot(this, this, e), this;
	}
	multiply(e) {
		return e.length ? st(this, this, e) : W(this, this, e), this;
	}
	divide(e) {
		return e.length ? ct(this, this, e) : W(this, this, 1 / e), this;
	}
	inverse(e = this) {
		return pt(this, e), this;
	}
	len() {
		return H(this);
	}
	distance(e) {
		return e ? lt(this, e) : H(this);
	}
	squaredLen() {
		return dt(this);
	}
	squaredDistance(e) {
		return e ? ut(this, e) : dt(this);
	}
	negate(e = this) {
		return ft(this, e), this;
	}
	cross(e, t) {
		return t ? ht(this, e, t) : ht(this, this, e), this;
	}
	scale(e) {
		return W(this, this, e), this;
	}
	normalize() {
		return G(this, this), this;
	}
	dot(e) {
		return mt(this, e);
	}
	equals(e) {
		return Ct(this, e);
	}
	applyMatrix3(e) {
		return bt(this, this, e), this;
	}
	applyMatrix4(e) {
		return vt(this, this, e), this;
	}
	scaleRotateMatrix4(e) {
		return yt(this, this, e), this;
	}
	applyQuaternion(e) {
		return xt(this, this, e), this;
	}
	angle(e) {
		return St(this, e);
	}
	lerp(e, t) {
		return gt(this, this, e, t), this;
	}
	smoothLerp(e, t, n) {
		return _t(this, this, e, t, n), this;
	}
	clone() {
		return new e(this[0], this[1], this[2]);
	}
	fromArray(e, t = 0) {
		return this[0] = e[t], this[1] = e[t + 1], this[2] = e[t + 2], this;
	}
	toArray(e = [], t = 0) {
		return e[t] = this[0], e[t + 1] = this[1], e[t + 2] = this[2], e;
	}
	transformDirection(e) {
		let t = this[0], n = this[1], r = this[2];
		return this[0] = e[0] * t + e[4] * n + e[8] * r, this[1] = e[1] * t + e[5] * n + e[9] * r, this[2] = e[2] * t + e[6] * n + e[10] * r, this.normalize();
	}
}, wt = /* @__PURE__ */ new K(), Tt = 1, Et = 1, Dt = !1, Ot = class {
	constructor(e, t = {}) {
		e.canvas || console.error("gl not passed as first argument to Geometry"), this.gl = e, this.attributes = t, this.id = Tt++, this.VAOs = {}, this.drawRange = {
			start: 0,
			count: 0
		}, this.instancedCount = 0, this.gl.renderer.bindVertexArray(null), this.gl.renderer.currentGeometry = null, this.glState = this.gl.renderer.state;
		for (let e in t) this.addAttribute(e, t[e]);
	}
	addAttribute(e, t) {
		if (this.attributes[e] = t, t.id = Et++, t.size = t.size || 1, t.type = t.type || (t.data.constructor === Float32Array ? this.gl.FLOAT : t.data.constructor === Uint16Array ? this.gl.UNSIGNED_SHORT : this.gl.UNSIGNED_INT), t.target = e === "index" ? this.gl.ELEMENT_ARRAY_BUFFER : this.gl.ARRAY_BUFFER, t.normalized = t.normalized || !1, t.stride = t.stride || 0, t.offset = t.offset || 0, t.count = t.count || (t.stride ? t.data.byteLength / t.stride : t.data.length / t.size), t.divisor = t.instanced || 0, t.needsUpdate = !1, t.usage = t.usage || this.gl.STATIC_DRAW, t.buffer || this.updateAttribute(t), t.divisor) {
			if (this.isInstanced = !0, this.instancedCount && this.instancedCount !== t.count * t.divisor) return console.warn("geometry has multiple instanced buffers of different length"), this.instancedCount = Math.min(this.instancedCount, t.count * t.divisor);
			this.instancedCount = t.count * t.divisor;
		} else e === "index" ? this.drawRange.count = t.count : this.attributes.index || (this.drawRange.count = Math.max(this.drawRange.count, t.count));
	}
	updateAttribute(e) {
		let t = !e.buffer;
		t && (e.buffer = this.gl.createBuffer()), this.glState.boundBuffer !== e.buffer && (this.gl.bindBuffer(e.target, e.buffer), this.glState.boundBuffer = e.buffer), t ? this.gl.bufferData(e.target, e.data, e.usage) : this.gl.bufferSubData(e.target, 0, e.data), e.needsUpdate = !1;
	}
	setIndex(e) {
		this.addAttribute("index", e);
	}
	setDrawRange(e, t) {
		this.drawRange.start = e, this.drawRange.count = t;
	}
	setInstancedCount(e) {
		this.instancedCount = e;
	}
	createVAO(e) {
		this.VAOs[e.attributeOrder] = this.gl.renderer.createVertexArray(), this.gl.renderer.bindVertexArray(this.VAOs[e.attributeOrder]), this.bindAttributes(e);
	}
	bindAttributes(e) {
		e.attributeLocations.forEach((e, { name: t, type: n }) => {
			if (!this.attributes[t]) {
				console.warn(`active attribute ${t} not being supplied`);
				return;
			}
			let r = this.attributes[t];
			this.gl.bindBuffer(r.target, r.buffer), this.glState.boundBuffer = r.buffer;
			let i = 1;
			n === 35674 && (i = 2), n === 35675 && (i = 3), n === 35676 && (i = 4);
			let a = r.size / i, o = i === 1 ? 0 : i * i * 4, s = i === 1 ? 0 : i * 4;
			for (let t = 0; t < i; t++) this.gl.vertexAttribPointer(e + t, a, r.type, r.normalized, r.stride + o, r.offset + t * s), this.gl.enableVertexAttribArray(e + t), this.gl.renderer.vertexAttribDivisor(e + t, r.divisor);
		}), this.attributes.index && this.gl.bindBuffer(this.gl.ELEMENT_ARRAY_BUFFER, this.attributes.index.buffer);
	}
	draw({ program: e, mode: t = this.gl.TRIANGLES }) {
		this.gl.renderer.currentGeometry !== `${this.id}_${e.attributeOrder}` && (this.VAOs[e.attributeOrder] || this.createVAO(e), this.gl.renderer.bindVertexArray(this.VAOs[e.attributeOrder]), this.gl.renderer.currentGeometry = `${this.id}_${e.attributeOrder}`), e.attributeLocations.forEach((e, { name: t }) => {
			let n = this.attributes[t];
			n.needsUpdate && this.updateAttribute(n);
		});
		let n = 2;
		this.attributes.index?.type === this.gl.UNSIGNED_INT && (n = 4), this.isInstanced ? this.attributes.index ? this.gl.renderer.drawElementsInstanced(t, this.drawRange.count, this.attributes.index.type, this.attributes.index.offset + this.drawRange.start * n, this.instancedCount) : this.gl.renderer.drawArraysInstanced(t, this.drawRange.start, this.drawRange.count, this.instancedCount) : this.attributes.index ? this.gl.drawElements(t, this.drawRange.count, this.attributes.index.type, this.attributes.index.offset + this.drawRange.start * n) : this.gl.drawArrays(t, this.drawRange.start, this.drawRange.count);
	}
	getPosition() {
		let e = this.attributes.position;
		if (e.data) return e;
		if (!Dt) return console.warn("No position buffer data found to compute bounds"), Dt = !0;
	}
	computeBoundingBox(e) {
		e ||= this.getPosition();
		let t = e.data, n = e.size;
		this.bounds ||= {
			min: new K(),
			max: new K(),
			center: new K(),
			scale: new K(),
			radius: Infinity
		};
		let r = this.bounds.min, i = this.bounds.max, a = this.bounds.center, o = this.bounds.scale;
		r.set(Infinity), i.set(-Infinity);
		for (let e = 0, a = t.length; e < a; e += n) {
			let n = t[e], a = t[e + 1], o = t[e + 2];
			r.x = Math.min(n, r.x), r.y = Math.min(a, r.y), r.z = Math.min(o, r.z), i.x = Math.max(n, i.x), i.y = Math.max(a, i.y), i.z = Math.max(o, i.z);
		}
		o.sub(i, r), a.add(r, i).divide(2);
	}
	computeBoundingSphere(e) {
		e ||= this.getPosition();
		let t = e.data, n = e.size;
		this.bounds || this.computeBoundingBox(e);
		let r = 0;
		for (let e = 0, i = t.length; e < i; e += n) wt.fromArray(t, e), r = Math.max(r, this.bounds.center.squaredDistance(wt));
		this.bounds.radius = Math.sqrt(r);
	}
	remove() {
		for (let e in this.VAOs) this.gl.renderer.deleteVertexArray(this.VAOs[e]), delete this.VAOs[e];
		for (let e in this.attributes) this.gl.deleteBuffer(this.attributes[e].buffer), delete this.attributes[e];
	}
}, kt = 1, At = {}, jt = class {
	constructor(e, { vertex: t, fragment: n, uniforms: r = {}, transparent: i = !1, cullFace: a = e.BACK, frontFace: o = e.CCW, depthTest: s = !0, depthWrite: c = !0, depthFunc: l = e.LEQUAL } = {}) {
		e.canvas || console.error("gl not passed as first argument to Program"), this.gl = e, this.uniforms = r, this.id = kt++, t || console.warn("vertex shader not supplied"), n || console.warn("fragment shader not supplied"), this.transparent = i, this.cullFace = a, this.frontFace = o, this.depthTest = s, this.depthWrite = c, this.depthFunc = l, this.blendFunc = {}, this.blendEquation = {}, this.stencilFunc = {}, this.stencilOp = {}, this.transparent && !this.blendFunc.src && (this.gl.renderer.premultipliedAlpha ? this.setBlendFunc(this.gl.ONE, this.gl.ONE_MINUS_SRC_ALPHA) : this.setBlendFunc(this.gl.SRC_ALPHA, this.gl.ONE_MINUS_SRC_ALPHA)), this.vertexShader = e.createShader(e.VERTEX_SHADER), this.fragmentShader = e.createShader(e.FRAGMENT_SHADER), this.program = e.createProgram(), e.attachShader(this.program, this.vertexShader), e.attachShader(this.program, this.fragmentShader), this.setShaders({
			vertex: t,
			fragment: n
		});
	}
	setShaders({ vertex: e, fragment: t }) {
		if (e && (this.gl.shaderSource(this.vertexShader, e), this.gl.compileShader(this.vertexShader), this.gl.getShaderInfoLog(this.vertexShader) !== "" && console.warn(`${this.gl.getShaderInfoLog(this.vertexShader)}\nVertex Shader\n${Mt(e)}`)), t && (this.gl.shaderSource(this.fragmentShader, t), this.gl.compileShader(this.fragmentShader), this.gl.getShaderInfoLog(this.fragmentShader) !== "" && console.warn(`${this.gl.getShaderInfoLog(this.fragmentShader)}\nFragment Shader\n${Mt(t)}`)), this.gl.linkProgram(this.program), !this.gl.getProgramParameter(this.program, this.gl.LINK_STATUS)) return console.warn(this.gl.getProgramInfoLog(this.program));
		this.uniformLocations = /* @__PURE__ */ new Map();
		let n = this.gl.getProgramParameter(this.program, this.gl.ACTIVE_UNIFORMS);
		for (let e = 0; e < n; e++) {
			let t = this.gl.getActiveUniform(this.program, e);
			this.uniformLocations.set(t, this.gl.getUniformLocation(this.program, t.name));
			let n = t.name.match(/(\w+)/g);
			t.uniformName = n[0], t.nameComponents = n.slice(1);
		}
		this.attributeLocations = /* @__PURE__ */ new Map();
		let r = [], i = this.gl.getProgramParameter(this.program, this.gl.ACTIVE_ATTRIBUTES);
		for (let e = 0; e < i; e++) {
			let t = this.gl.getActiveAttrib(this.program, e), n = this.gl.getAttribLocation(this.program, t.name);
			n !== -1 && (r[n] = t.name, this.attributeLocations.set(t, n));
		}
		this.attributeOrder = r.join("");
	}
	setBlendFunc(e, t, n, r) {
		this.blendFunc.src = e, this.blendFunc.dst = t, this.blendFunc.srcAlpha = n, this.blendFunc.dstAlpha = r, e && (this.transparent = !0);
	}
	setBlendEquation(e, t) {
		this.blendEquation.modeRGB = e, this.blendEquation.modeAlpha = t;
	}
	setStencilFunc(e, t, n) {
		this.stencilRef = t, this.stencilFunc.func = e, this.stencilFunc.ref = t, this.stencilFunc.mask = n;
	}
	setStencilOp(e, t, n) {
		this.stencilOp.stencilFail = e, this.stencilOp.depthFail = t, this.stencilOp.depthPass = n;
	}
	applyState() {
		this.depthTest ? this.gl.renderer.enable(this.gl.DEPTH_TEST) : this.gl.renderer.disable(this.gl.DEPTH_TEST), this.cullFace ? this.gl.renderer.enable(this.gl.CULL_FACE) : this.gl.renderer.disable(this.gl.CULL_FACE), this.blendFunc.src ? this.gl.renderer.enable(this.gl.BLEND) : this.gl.renderer.disable(this.gl.BLEND), this.cullFace && this.gl.renderer.setCullFace(this.cullFace), this.gl.renderer.setFrontFace(this.frontFace), this.gl.renderer.setDepthMask(this.depthWrite), this.gl.renderer.setDepthFunc(this.depthFunc), this.blendFunc.src && this.gl.renderer.setBlendFunc(this.blendFunc.src, this.blendFunc.dst, this.blendFunc.srcAlpha, this.blendFunc.dstAlpha), this.gl.renderer.setBlendEquation(this.blendEquation.modeRGB, this.blendEquation.modeAlpha), this.stencilFunc.func || this.stencilOp.stencilFail ? this.gl.renderer.enable(this.gl.STENCIL_TEST) : this.gl.renderer.disable(this.gl.STENCIL_TEST), this.gl.renderer.setStencilFunc(this.stencilFunc.func, this.stencilFunc.ref, this.stencilFunc.mask), this.gl.renderer.setStencilOp(this.stencilOp.stencilFail, this.stencilOp.depthFail, this.stencilOp.depthPass);
	}
	use({ flipFaces: e = !1 } = {}) {
		let t = -1;
		this.gl.renderer.state.currentProgram !== this.id && (this.gl.useProgram(this.program), this.gl.renderer.state.currentProgram = this.id), this.uniformLocations.forEach((e, n) => {
			let r = this.uniforms[n.uniformName];
			for (let e of n.nameComponents) {
				if (!r) break;
				if (e in r) r = r[e];
				else if (Array.isArray(r.value)) break;
				else {
					r = void 0;
					break;
				}
			}
			if (!r) return It(`Active uniform ${n.name} has not been supplied`);
			if (r && r.value === void 0) return It(`${n.name} uniform is missing a value parameter`);
			if (r.value.texture) return t += 1, r.value.update(t), q(this.gl, n.type, e, t);
			if (r.value.length && r.value[0].texture) {
				let i = [];
				return r.value.forEach((e) => {
					t += 1, e.update(t), i.push(t);
				}), q(this.gl, n.type, e, i);
			}
			q(this.gl, n.type, e, r.value);
		}), this.applyState(), e && this.gl.renderer.setFrontFace(this.frontFace === this.gl.CCW ? this.gl.CW : this.gl.CCW);
	}
	remove() {
		this.gl.deleteProgram(this.program);
	}
};
function q(e, t, n, r) {
	r = r.length ? Nt(r) : r;
	let i = e.renderer.state.uniformLocations.get(n);
	if (r.length) {
		if (i === void 0 || i.length !== r.length) e.renderer.state.uniformLocations.set(n, r.slice(0));
		else {
			if (Pt(i, r)) return;
			i.set ? i.set(r) : Ft(i, r), e.renderer.state.uniformLocations.set(n, i);
		}
	} else {
		if (i === r) return;
		e.renderer.state.uniformLocations.set(n, r);
	}
	switch (t) {
		case 5126: return r.length ? e.uniform1fv(n, r) : e.uniform1f(n, r);
		case 35664: return e.uniform2fv(n, r);
		case 35665: return e.uniform3fv(n, r);
		case 35666: return e.uniform4fv(n, r);
		case 35670:
		case 5124:
		case 35678:
		case 36306:
		case 35680:
		case 36289: return r.length ? e.uniform1iv(n, r) : e.uniform1i(n, r);
		case 35671:
		case 35667: return e.uniform2iv(n, r);
		case 35672:
		case 35668: return e.uniform3iv(n, r);
		case 35673:
		case 35669: return e.uniform4iv(n, r);
		case 35674: return e.uniformMatrix2fv(n, !1, r);
		case 35675: return e.uniformMatrix3fv(n, !1, r);
		case 35676: return e.uniformMatrix4fv(n, !1, r);
	}
}
function Mt(e) {
	let t = e.split("\n");
	for (let e = 0; e < t.length; e++) t[e] = e + 1 + ": " + t[e];
	return t.join("\n");
}
function Nt(e) {
	let t = e.length, n = e[0].length;
	if (n === void 0) return e;
	let r = t * n, i = At[r];
	i || (At[r] = i = new Float32Array(r));
	for (let r = 0; r < t; r++) i.set(e[r], r * n);
	return i;
}
function Pt(e, t) {
	if (e.length !== t.length) return !1;
	for (let n = 0, r = e.length; n < r; n++) if (e[n] !== t[n]) return !1;
	return !0;
}
function Ft(e, t) {
	for (let n = 0, r = e.length; n < r; n++) e[n] = t[n];
}
var J = 0;
function It(e) {
	J > 100 || (console.warn(e), J++, J > 100 && console.warn("More than 100 program warnings - stopping logs."));
}
// node_modules/ogl/src/core/Renderer.js
var Y = /* @__PURE__ */ new K(), Lt = 1, Rt = class {
	constructor({ canvas: e = document.createElement("canvas"), width: t = 300, height: n = 150, dpr: r = 1, alpha: i = !1, depth: a = !0, stencil: o = !1, antialias: s = !1, premultipliedAlpha: c = !1, preserveDrawingBuffer: l = !1, powerPreference: u = "default", autoClear: d = !0, webgl: f = 2 } = {}) {
		let p = {
			alpha: i,
			depth: a,
			stencil: o,
			antialias: s,
			premultipliedAlpha: c,
			preserveDrawingBuffer: l,
			powerPreference: u
		};
		this.dpr = r, this.alpha = i, this.color = !0, this.depth = a, this.stencil = o, this.premultipliedAlpha = c, this.autoClear = d, this.id = Lt++, f === 2 && (this.gl = e.getContext("webgl2", p)), this.isWebgl2 = !!this.gl, this.gl ||= e.getContext("webgl", p), this.gl || console.error("unable to create webgl context"), this.gl.renderer = this, this.setSize(t, n), this.state = {}, this.state.blendFunc = {
			src: this.gl.ONE,
			dst: this.gl.ZERO
		}, this.state.blendEquation = { modeRGB: this.gl.FUNC_ADD }, this.state.cullFace = !1, this.state.frontFace = this.gl.CCW, this.state.depthMask = !0, this.state.depthFunc = this.gl.LEQUAL, this.state.premultiplyAlpha = !1, this.state.flipY = !1, this.state.unpackAlignment = 4, this.state.framebuffer = null, this.state.viewport = {
			x: 0,
			y: 0,
			width: null,
			height: null
		}, this.state.textureUnits = [], this.state.activeTextureUnit = 0, this.state.boundBuffer = null, this.state.uniformLocations = /* @__PURE__ */ new Map(), this.state.currentProgram = null, this.extensions = {}, this.isWebgl2 ? (this.getExtension("EXT_color_buffer_float"), this.getExtension("OES_texture_float_linear")) : (this.getExtension("OES_texture_float"), this.getExtension("OES_texture_float_linear"), this.getExtension("OES_texture_half_float"), this.getExtension("OES_texture_half_float_linear"), this.getExtension("OES_element_index_uint"), this.getExtension("OES_standard_derivatives"), this.getExtension("EXT_sRGB"), this.getExtension("WEBGL_depth_texture"), this.getExtension("WEBGL_draw_buffers")), this.getExtension("WEBGL_compressed_texture_astc"), this.getExtension("EXT_texture_compression_bptc"), this.getExtension("WEBGL_compressed_texture_s3tc"), this.getExtension("WEBGL_compressed_texture_etc1"), this.getExtension("WEBGL_compressed_texture_pvrtc"), this.getExtension("WEBKIT_WEBGL_compressed_texture_pvrtc"), this.vertexAttribDivisor = this.getExtension("ANGLE_instanced_arrays", "vertexAttribDivisor", "vertexAttribDivisorANGLE"), this.drawArraysInstanced = this.getExtension("ANGLE_instanced_arrays", "drawArraysInstanced", "drawArraysInstancedANGLE"), this.drawElementsInstanced = this.getExtension("ANGLE_instanced_arrays", "drawElementsInstanced", "drawElementsInstancedANGLE"), this.createVertexArray = this.getExtension("OES_vertex_array_object", "createVertexArray", "createVertexArrayOES"), this.bindVertexArray = this.getExtension("OES_vertex_array_object", "bindVertexArray", "bindVertexArrayOES"), this.deleteVertexArray = this.getExtension("OES_vertex_array_object", "deleteVertexArray", "deleteVertexArrayOES"), this.drawBuffers = this.getExtension("WEBGL_draw_buffers", "drawBuffers", "drawBuffersWEBGL"), this.parameters = {}, this.parameters.maxTextureUnits = this.gl.getParameter(this.gl.MAX_COMBINED_TEXTURE_IMAGE_UNITS), this.parameters.maxAnisotropy = this.getExtension("EXT_texture_filter_anisotropic") ? this.gl.getParameter(this.getExtension("EXT_texture_filter_anisotropic").MAX_TEXTURE_MAX_ANISOTROPY_EXT) : 0;
	}
	setSize(e, t) {
		this.width = e, this.height = t, this.gl.canvas.width = e * this.dpr, this.gl.canvas.height = t * this.dpr, this.gl.canvas.style && Object.assign(this.gl.canvas.style, {
			width: e + "px",
			height: t + "px"
		});
	}
	setViewport(e, t, n = 0, r = 0) {
		(this.state.viewport.width !== e || this.state.viewport.height !== t) && (this.state.viewport.width = e, this.state.viewport.height = t, this.state.viewport.x = n, this.state.viewport.y = r, this.gl.viewport(n, r, e, t));
	}
	setScissor(e, t, n = 0, r = 0) {
		this.gl.scissor(n, r, e, t);
	}
	enable(e) {
		this.state[e] !== !0 && (this.gl.enable(e), this.state[e] = !0);
	}
	disable(e) {
		this.state[e] !== !1 && (this.gl.disable(e), this.state[e] = !1);
	}
	setBlendFunc(e, t, n, r) {
		(this.state.blendFunc.src !== e || this.state.blendFunc.dst !== t || this.state.blendFunc.srcAlpha !== n || this.state.blendFunc.dstAlpha !== r) && (this.state.blendFunc.src = e, this.state.blendFunc.dst = t, this.state.blendFunc.srcAlpha = n, this.state.blendFunc.dstAlpha = r, n === void 0 ? this.gl.blendFunc(e, t) : this.gl.blendFuncSeparate(e, t, n, r));
	}
	setBlendEquation(e, t) {
		e ||= this.gl.FUNC_ADD, (this.state.blendEquation.modeRGB !== e || this.state.blendEquation.modeAlpha !== t) && (this.state.blendEquation.modeRGB = e, this.state.blendEquation.modeAlpha = t, t === void 0 ? this.gl.blendEquation(e) : this.gl.blendEquationSeparate(e, t));
	}
	setCullFace(e) {
		this.state.cullFace !== e && (this.state.cullFace = e, this.gl.cullFace(e));
	}
	setFrontFace(e) {
		this.state.frontFace !== e && (this.state.frontFace = e, this.gl.frontFace(e));
	}
	setDepthMask(e) {
		this.state.depthMask !== e && (this.state.depthMask = e, this.gl.depthMask(e));
	}
	setDepthFunc(e) {
		this.state.depthFunc !== e && (this.state.depthFunc = e, this.gl.depthFunc(e));
	}
	setStencilMask(e) {
		this.state.stencilMask !== e && (this.state.stencilMask = e, this.gl.stencilMask(e));
	}
	setStencilFunc(e, t, n) {
		(this.state.stencilFunc !== e || this.state.stencilRef !== t || this.state.stencilFuncMask !== n) && (this.state.stencilFunc = e || this.gl.ALWAYS, this.state.stencilRef = t || 0, this.state.stencilFuncMask = n || 0, this.gl.stencilFunc(e || this.gl.ALWAYS, t || 0, n || 0));
	}
	setStencilOp(e, t, n) {
		(this.state.stencilFail !== e || this.state.stencilDepthFail !== t || this.state.stencilDepthPass !== n) && (this.state.stencilFail = e, this.state.stencilDepthFail = t, this.state.stencilDepthPass = n, this.gl.stencilOp(e, t, n));
	}
	activeTexture(e) {
		this.state.activeTextureUnit !== e && (this.state.activeTextureUnit = e, this.gl.activeTexture(this.gl.TEXTURE0 + e));
	}
	bindFramebuffer({ target: e = this.gl.FRAMEBUFFER, buffer: t = null } = {}) {
		this.state.framebuffer !== t && (this.state.framebuffer = t, this.gl.bindFramebuffer(e, t));
	}
	getExtension(e, t, n) {
		return t && this.gl[t] ? this.gl[t].bind(this.gl) : (this.extensions[e] || (this.extensions[e] = this.gl.getExtension(e)), t ? this.extensions[e] ? this.extensions[e][n].bind(this.extensions[e]) : null : this.extensions[e]);
	}
	sortOpaque(e, t) {
		return e.renderOrder === t.renderOrder ? e.program.id === t.program.id ? e.zDepth === t.zDepth ? t.id - e.id : e.zDepth - t.zDepth : e.program.id - t.program.id : e.renderOrder - t.renderOrder;
	}
	sortTransparent(e, t) {
		return e.renderOrder === t.renderOrder ? e.zDepth === t.zDepth ? t.id - e.id : t.zDepth - e.zDepth : e.renderOrder - t.renderOrder;
	}
	sortUI(e, t) {
		return e.renderOrder === t.renderOrder ? e.program.id === t.program.id ? t.id - e.id : e.program.id - t.program.id : e.renderOrder - t.renderOrder;
	}
	getRenderList({ scene: e, camera: t, frustumCull: n, sort: r }) {
		let i = [];
		if (t && n && t.updateFrustum(), e.traverse((e) => {
			if (!e.visible) return !0;
			e.draw && (n && e.frustumCulled && t && !t.frustumIntersectsMesh(e) || i.push(e));
		}), r) {
			let e = [], n = [], r = [];
			i.forEach((i) => {
				i.program.transparent ? i.program.depthTest ? n.push(i) : r.push(i) : e.push(i), i.zDepth = 0, i.renderOrder === 0 && i.program.depthTest && t && (i.worldMatrix.getTranslation(Y), Y.applyMatrix4(t.projectionViewMatrix), i.zDepth = Y.z);
			}), e.sort(this.sortOpaque), n.sort(this.sortTransparent), r.sort(this.sortUI), i = e.concat(n, r);
		}
		return i;
	}
	render({ scene: e, camera: t, target: n = null, update: r = !0, sort: i = !0, frustumCull: a = !0, clear: o }) {
		n === null ? (this.bindFramebuffer(), this.setViewport(this.width * this.dpr, this.height * this.dpr)) : (this.bindFramebuffer(n), this.setViewport(n.width, n.height)), (o || this.autoClear && o !== !1) && (this.depth && (!n || n.depth) && (this.enable(this.gl.DEPTH_TEST), this.setDepthMask(!0)), (this.stencil || !n || n.stencil) && (this.enable(this.gl.STENCIL_TEST), this.setStencilMask(255)), this.gl.clear((this.color ? this.gl.COLOR_BUFFER_BIT : 0) | (this.depth ? this.gl.DEPTH_BUFFER_BIT : 0) | (this.stencil ? this.gl.STENCIL_BUFFER_BIT : 0))), r && e.updateMatrixWorld(), t && t.updateMatrixWorld(), this.getRenderList({
			scene: e,
			camera: t,
			frustumCull: a,
			sort: i
		}).forEach((e) => {
			e.draw({ camera: t });
		});
	}
};
// node_modules/ogl/src/math/functions/Vec4Func.js
function zt(e, t) {
	return e[0] = t[0], e[1] = t[1], e[2] = t[2], e[3] = t[3], e;
}
function Bt(e, t, n, r, i) {
	return e[0] = t, e[1] = n, e[2] = r, e[3] = i, e;
}
function Vt(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = n * n + r * r + i * i + a * a;
	return o > 0 && (o = 1 / Math.sqrt(o)), e[0] = n * o, e[1] = r * o, e[2] = i * o, e[3] = a * o, e;
}
function Ht(e, t) {
	return e[0] * t[0] + e[1] * t[1] + e[2] * t[2] + e[3] * t[3];
}
// node_modules/ogl/src/math/functions/QuatFunc.js
function Ut(e) {
	return e[0] = 0, e[1] = 0, e[2] = 0, e[3] = 1, e;
}
function Wt(e, t, n) {
	n *= .5;
	let r = Math.sin(n);
	return e[0] = r * t[0], e[1] = r * t[1], e[2] = r * t[2], e[3] = Math.cos(n), e;
}
function Gt(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = t[3], s = n[0], c = n[1], l = n[2], u = n[3];
	return e[0] = r * u + o * s + i * l - a * c, e[1] = i * u + o * c + a * s - r * l, e[2] = a * u + o * l + r * c - i * s, e[3] = o * u - r * s - i * c - a * l, e;
}
function Kt(e, t, n) {
	n *= .5;
	let r = t[0], i = t[1], a = t[2], o = t[3], s = Math.sin(n), c = Math.cos(n);
	return e[0] = r * c + o * s, e[1] = i * c + a * s, e[2] = a * c - i * s, e[3] = o * c - r * s, e;
}
function qt(e, t, n) {
	n *= .5;
	let r = t[0], i = t[1], a = t[2], o = t[3], s = Math.sin(n), c = Math.cos(n);
	return e[0] = r * c - a * s, e[1] = i * c + o * s, e[2] = a * c + r * s, e[3] = o * c - i * s, e;
}
function Jt(e, t, n) {
	n *= .5;
	let r = t[0], i = t[1], a = t[2], o = t[3], s = Math.sin(n), c = Math.cos(n);
	return e[0] = r * c + i * s, e[1] = i * c - r * s, e[2] = a * c + o * s, e[3] = o * c - a * s, e;
}
function Yt(e, t, n, r) {
	let i = t[0], a = t[1], o = t[2], s = t[3], c = n[0], l = n[1], u = n[2], d = n[3], f, p, m, h, g;
	return p = i * c + a * l + o * u + s * d, p < 0 && (p = -p, c = -c, l = -l, u = -u, d = -d), 1 - p > 1e-6 ? (f = Math.acos(p), m = Math.sin(f), h = Math.sin((1 - r) * f) / m, g = Math.sin(r * f) / m) : (h = 1 - r, g = r), e[0] = h * i + g * c, e[1] = h * a + g * l, e[2] = h * o + g * u, e[3] = h * s + g * d, e;
}
function Xt(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = n * n + r * r + i * i + a * a, s = o ? 1 / o : 0;
	return e[0] = -n * s, e[1] = -r * s, e[2] = -i * s, e[3] = a * s, e;
}
function Zt(e, t) {
	return e[0] = -t[0], e[1] = -t[1], e[2] = -t[2], e[3] = t[3], e;
}
function Qt(e, t) {
	let n = t[0] + t[4] + t[8], r;
	if (n > 0) r = Math.sqrt(n + 1), e[3] = .5 * r, r = .5 / r, e[0] = (t[5] - t[7]) * r, e[1] = (t[6] - t[2]) * r, e[2] = (t[1] - t[3]) * r;
	else {
		let n = 0;
		t[4] > t[0] && (n = 1), t[8] > t[n * 3 + n] && (n = 2);
		let i = (n + 1) % 3, a = (n + 2) % 3;
		r = Math.sqrt(t[n * 3 + n] - t[i * 3 + i] - t[a * 3 + a] + 1), e[n] = .5 * r, r = .5 / r, e[3] = (t[i * 3 + a] - t[a * 3 + i]) * r, e[i] = (t[i * 3 + n] + t[n * 3 + i]) * r, e[a] = (t[a * 3 + n] + t[n * 3 + a]) * r;
	}
	return e;
}
function $t(e, t, n = "YXZ") {
	let r = Math.sin(t[0] * .5), i = Math.cos(t[0] * .5), a = Math.sin(t[1] * .5), o = Math.cos(t[1] * .5), s = Math.sin(t[2] * .5), c = Math.cos(t[2] * .5);
	return n === "XYZ" ? (e[0] = r * o * c + i * a * s, e[1] = i * a * c - r * o * s, e[2] = i * o * s + r * a * c, e[3] = i * o * c - r * a * s) : n === "YXZ" ? (e[0] = r * o * c + i * a * s, e[1] = i * a * c - r * o * s, e[2] = i * o * s - r * a * c, e[3] = i * o * c + r * a * s) : n === "ZXY" ? (e[0] = r * o * c - i * a * s, e[1] = i * a * c + r * o * s, e[2] = i * o * s + r * a * c, e[3] = i * o * c - r * a * s) : n === "ZYX" ? (e[0] = r * o * c - i * a * s, e[1] = i * a * c + r * o * s, e[2] = i * o * s - r * a * c, e[3] = i * o * c + r * a * s) : n === "YZX" ? (e[0] = r * o * c + i * a * s, e[1] = i * a * c + r * o * s, e[2] = i * o * s - r * a * c, e[3] = i * o * c - r * a * s) : n === "XZY" && (e[0] = r * o * c - i * a * s, e[1] = i * a * c - r * o * s, e[2] = i * o * s + r * a * c, e[3] = i * o * c + r * a * s), e;
}
var en = zt, tn = Bt, nn = Ht, rn = Vt, an = class extends Array {
	constructor(e = 0, t = 0, n = 0, r = 1) {
		super(e, t, n, r), this.onChange = () => {}, this._target = this;
		let i = [
			"0",
			"1",
			"2",
			"3"
		];
		return new Proxy(this, { set(e, t) {
			let n = Reflect.set(...arguments);
			return n && i.includes(t) && e.onChange(), n;
		} });
	}
	get x() {
		return this[0];
	}
	get y() {
		return this[1];
	}
	get z() {
		return this[2];
	}
	get w() {
		return this[3];
	}
	set x(e) {
		this._target[0] = e, this.onChange();
	}
	set y(e) {
		this._target[1] = e, this.onChange();
	}
	set z(e) {
		this._target[2] = e, this.onChange();
	}
	set w(e) {
		this._target[3] = e, this.onChange();
	}
	identity() {
		return Ut(this._target), this.onChange(), this;
	}
	set(e, t, n, r) {
		return e.length ? this.copy(e) : (tn(this._target, e, t, n, r), this.onChange(), this);
	}
	rotateX(e) {
		return Kt(this._target, this._target, e), this.onChange(), this;
	}
	rotateY(e) {
		return qt(this._target, this._target, e), this.onChange(), this;
	}
	rotateZ(e) {
		return Jt(this._target, this._target, e), this.onChange(), this;
	}
	inverse(e = this._target) {
		return Xt(this._target, e), this.onChange(), this;
	}
	conjugate(e = this._target) {
		return Zt(this._target, e), this.onChange(), this;
	}
	copy(e) {
		return en(this._target, e), this.onChange(), this;
	}
	normalize(e = this._target) {
		return rn(this._target, e), this.onChange(), this;
	}
	multiply(e, t) {
		return t ? Gt(this._target, e, t) : Gt(this._target, this._target, e), this.onChange(), this;
	}
	dot(e) {
		return nn(this._target, e);
	}
	fromMatrix3(e) {
		return Qt(this._target, e), this.onChange(), this;
	}
	fromEuler(e, t) {
		return $t(this._target, e, e.order), t || this.onChange(), this;
	}
	fromAxisAngle(e, t) {
		return Wt(this._target, e, t), this.onChange(), this;
	}
	slerp(e, t) {
		return Yt(this._target, this._target, e, t), this.onChange(), this;
	}
	fromArray(e, t = 0) {
		return this._target[0] = e[t], this._target[1] = e[t + 1], this._target[2] = e[t + 2], this._target[3] = e[t + 3], this.onChange(), this;
	}
	toArray(e = [], t = 0) {
		return e[t] = this[0], e[t + 1] = this[1], e[t + 2] = this[2], e[t + 3] = this[3], e;
	}
}, on = 1e-6;
function sn(e, t) {
	return e[0] = t[0], e[1] = t[1], e[2] = t[2], e[3] = t[3], e[4] = t[4], e[5] = t[5], e[6] = t[6], e[7] = t[7], e[8] = t[8], e[9] = t[9], e[10] = t[10], e[11] = t[11], e[12] = t[12], e[13] = t[13], e[14] = t[14], e[15] = t[15], e;
}
function cn(e, t, n, r, i, a, o, s, c, l, u, d, f, p, m, h, g) {
	return e[0] = t, e[1] = n, e[2] = r, e[3] = i, e[4] = a, e[5] = o, e[6] = s, e[7] = c, e[8] = l, e[9] = u, e[10] = d, e[11] = f, e[12] = p, e[13] = m, e[14] = h, e[15] = g, e;
}
function ln(e) {
	return e[0] = 1, e[1] = 0, e[2] = 0, e[3] = 0, e[4] = 0, e[5] = 1, e[6] = 0, e[7] = 0, e[8] = 0, e[9] = 0, e[10] = 1, e[11] = 0, e[12] = 0, e[13] = 0, e[14] = 0, e[15] = 1, e;
}
function un(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = t[4], s = t[5], c = t[6], l = t[7], u = t[8], d = t[9], f = t[10], p = t[11], m = t[12], h = t[13], g = t[14], _ = t[15], v = n * s - r * o, y = n * c - i * o, b = n * l - a * o, x = r * c - i * s, S = r * l - a * s, C = i * l - a * c, w = u * h - d * m, T = u * g - f * m, E = u * _ - p * m, D = d * g - f * h, O = d * _ - p * h, k = f * _ - p * g, A = v * k - y * O + b * D + x * E - S * T + C * w;
	return A ? (A = 1 / A, e[0] = (s * k - c * O + l * D) * A, e[1] = (i * O - r * k - a * D) * A, e[2] = (h * C - g * S + _ * x) * A, e[3] = (f * S - d * C - p * x) * A, e[4] = (c * E - o * k - l * T) * A, e[5] = (n * k - i * E + a * T) * A, e[6] = (g * b - m * C - _ * y) * A, e[7] = (u * C - f * b + p * y) * A, e[8] = (o * O - s * E + l * w) * A, e[9] = (r * E - n * O - a * w) * A, e[10] = (m * S - h * b + _ * v) * A, e[11] = (d * b - u * S - p * v) * A, e[12] = (s * T - o * D - c * w) * A, e[13] = (n * D - r * T + i * w) * A, e[14] = (h * y - m * x - g * v) * A, e[15] = (u * x - d * y + f * v) * A, e) : null;
}
function dn(e) {
	let t = e[0], n = e[1], r = e[2], i = e[3], a = e[4], o = e[5], s = e[6], c = e[7], l = e[8], u = e[9], d = e[10], f = e[11], p = e[12], m = e[13], h = e[14], g = e[15], _ = t * o - n * a, v = t * s - r * a, y = t * c - i * a, b = n * s - r * o, x = n * c - i * o, S = r * c - i * s, C = l * m - u * p, w = l * h - d * p, T = l * g - f * p, E = u * h - d * m, D = u * g - f * m;
	return _ * (d * g - f * h) - v * D + y * E + b * T - x * w + S * C;
}
function fn(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = t[3], s = t[4], c = t[5], l = t[6], u = t[7], d = t[8], f = t[9], p = t[10], m = t[11], h = t[12], g = t[13], _ = t[14], v = t[15], y = n[0], b = n[1], x = n[2], S = n[3];
	return e[0] = y * r + b * s + x * d + S * h, e[1] = y * i + b * c + x * f + S * g, e[2] = y * a + b * l + x * p + S * _, e[3] = y * o + b * u + x * m + S * v, y = n[4], b = n[5], x = n[6], S = n[7], e[4] = y * r + b * s + x * d + S * h, e[5] = y * i + b * c + x * f + S * g, e[6] = y * a + b * l + x * p + S * _, e[7] = y * o + b * u + x * m + S * v, y = n[8], b = n[9], x = n[10], S = n[11], e[8] = y * r + b * s + x * d + S * h, e[9] = y * i + b * c + x * f + S * g, e[10] = y * a + b * l + x * p + S * _, e[11] = y * o + b * u + x * m + S * v, y = n[12], b = n[13], x = n[14], S = n[15], e[12] = y * r + b * s + x * d + S * h, e[13] = y * i + b * c + x * f + S * g, e[14] = y * a + b * l + x * p + S * _, e[15] = y * o + b * u + x * m + S * v, e;
}
function pn(e, t, n) {
	let r = n[0], i = n[1], a = n[2], o, s, c, l, u, d, f, p, m, h, g, _;
	return t === e ? (e[12] = t[0] * r + t[4] * i + t[8] * a + t[12], e[13] = t[1] * r + t[5] * i + t[9] * a + t[13], e[14] = t[2] * r + t[6] * i + t[10] * a + t[14], e[15] = t[3] * r + t[7] * i + t[11] * a + t[15]) : (o = t[0], s = t[1], c = t[2], l = t[3], u = t[4], d = t[5], f = t[6], p = t[7], m = t[8], h = t[9], g = t[10], _ = t[11], e[0] = o, e[1] = s, e[2] = c, e[3] = l, e[4] = u, e[5] = d, e[6] = f, e[7] = p, e[8] = m, e[9] = h, e[10] = g, e[11] = _, e[12] = o * r + u * i + m * a + t[12], e[13] = s * r + d * i + h * a + t[13], e[14] = c * r + f * i + g * a + t[14], e[15] = l * r + p * i + _ * a + t[15]), e;
}
function mn(e, t, n) {
	let r = n[0], i = n[1], a = n[2];
	return e[0] = t[0] * r, e[1] = t[1] * r, e[2] = t[2] * r, e[3] = t[3] * r, e[4] = t[4] * i, e[5] = t[5] * i, e[6] = t[6] * i, e[7] = t[7] * i, e[8] = t[8] * a, e[9] = t[9] * a, e[10] = t[10] * a, e[11] = t[11] * a, e[12] = t[12], e[13] = t[13], e[14] = t[14], e[15] = t[15], e;
}
function hn(e, t, n, r) {
	let i = r[0], a = r[1], o = r[2], s = Math.hypot(i, a, o), c, l, u, d, f, p, m, h, g, _, v, y, b, x, S, C, w, T, E, D, O, k, A, j;
	return Math.abs(s) < on ? null : (s = 1 / s, i *= s, a *= s, o *= s, c = Math.sin(n), l = Math.cos(n), u = 1 - l, d = t[0], f = t[1], p = t[2], m = t[3], h = t[4], g = t[5], _ = t[6], v = t[7], y = t[8], b = t[9], x = t[10], S = t[11], C = i * i * u + l, w = a * i * u + o * c, T = o * i * u - a * c, E = i * a * u - o * c, D = a * a * u + l, O = o * a * u + i * c, k = i * o * u + a * c, A = a * o * u - i * c, j = o * o * u + l, e[0] = d * C + h * w + y * T, e[1] = f * C + g * w + b * T, e[2] = p * C + _ * w + x * T, e[3] = m * C + v * w + S * T, e[4] = d * E + h * D + y * O, e[5] = f * E + g * D + b * O, e[6] = p * E + _ * D + x * O, e[7] = m * E + v * D + S * O, e[8] = d * k + h * A + y * j, e[9] = f * k + g * A + b * j, e[10] = p * k + _ * A + x * j, e[11] = m * k + v * A + S * j, t !== e && (e[12] = t[12], e[13] = t[13], e[14] = t[14], e[15] = t[15]), e);
}
function gn(e, t) {
	return e[0] = t[12], e[1] = t[13], e[2] = t[14], e;
}
function _n(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[4], o = t[5], s = t[6], c = t[8], l = t[9], u = t[10];
	return e[0] = Math.hypot(n, r, i), e[1] = Math.hypot(a, o, s), e[2] = Math.hypot(c, l, u), e;
}
function vn(e) {
	let t = e[0], n = e[1], r = e[2], i = e[4], a = e[5], o = e[6], s = e[8], c = e[9], l = e[10], u = t * t + n * n + r * r, d = i * i + a * a + o * o, f = s * s + c * c + l * l;
	return Math.sqrt(Math.max(u, d, f));
}
var yn = (function() {
	let e = [
		1,
		1,
		1
	];
	return function(t, n) {
		let r = e;
		_n(r, n);
		let i = 1 / r[0], a = 1 / r[1], o = 1 / r[2], s = n[0] * i, c = n[1] * a, l = n[2] * o, u = n[4] * i, d = n[5] * a, f = n[6] * o, p = n[8] * i, m = n[9] * a, h = n[10] * o, g = s + d + h, _ = 0;
		return g > 0 ? (_ = Math.sqrt(g + 1) * 2, t[3] = .25 * _, t[0] = (f - m) / _, t[1] = (p - l) / _, t[2] = (c - u) / _) : s > d && s > h ? (_ = Math.sqrt(1 + s - d - h) * 2, t[3] = (f - m) / _, t[0] = .25 * _, t[1] = (c + u) / _, t[2] = (p + l) / _) : d > h ? (_ = Math.sqrt(1 + d - s - h) * 2, t[3] = (p - l) / _, t[0] = (c + u) / _, t[1] = .25 * _, t[2] = (f + m) / _) : (_ = Math.sqrt(1 + h - s - d) * 2, t[3] = (c - u) / _, t[0] = (p + l) / _, t[1] = (f + m) / _, t[2] = .25 * _), t;
	};
})();
function bn(e, t, n, r) {
	let i = H([
		e[0],
		e[1],
		e[2]
	]), a = H([
		e[4],
		e[5],
		e[6]
	]), o = H([
		e[8],
		e[9],
		e[10]
	]);
	dn(e) < 0 && (i = -i), n[0] = e[12], n[1] = e[13], n[2] = e[14];
	let s = e.slice(), c = 1 / i, l = 1 / a, u = 1 / o;
	s[0] *= c, s[1] *= c, s[2] *= c, s[4] *= l, s[5] *= l, s[6] *= l, s[8] *= u, s[9] *= u, s[10] *= u, yn(t, s), r[0] = i, r[1] = a, r[2] = o;
}
function xn(e, t, n, r) {
	let i = e, a = t[0], o = t[1], s = t[2], c = t[3], l = a + a, u = o + o, d = s + s, f = a * l, p = a * u, m = a * d, h = o * u, g = o * d, _ = s * d, v = c * l, y = c * u, b = c * d, x = r[0], S = r[1], C = r[2];
	return i[0] = (1 - (h + _)) * x, i[1] = (p + b) * x, i[2] = (m - y) * x, i[3] = 0, i[4] = (p - b) * S, i[5] = (1 - (f + _)) * S, i[6] = (g + v) * S, i[7] = 0, i[8] = (m + y) * C, i[9] = (g - v) * C, i[10] = (1 - (f + h)) * C, i[11] = 0, i[12] = n[0], i[13] = n[1], i[14] = n[2], i[15] = 1, i;
}
function Sn(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = n + n, s = r + r, c = i + i, l = n * o, u = r * o, d = r * s, f = i * o, p = i * s, m = i * c, h = a * o, g = a * s, _ = a * c;
	return e[0] = 1 - d - m, e[1] = u + _, e[2] = f - g, e[3] = 0, e[4] = u - _, e[5] = 1 - l - m, e[6] = p + h, e[7] = 0, e[8] = f + g, e[9] = p - h, e[10] = 1 - l - d, e[11] = 0, e[12] = 0, e[13] = 0, e[14] = 0, e[15] = 1, e;
}
function Cn(e, t, n, r, i) {
	let a = 1 / Math.tan(t / 2), o = 1 / (r - i);
	return e[0] = a / n, e[1] = 0, e[2] = 0, e[3] = 0, e[4] = 0, e[5] = a, e[6] = 0, e[7] = 0, e[8] = 0, e[9] = 0, e[10] = (i + r) * o, e[11] = -1, e[12] = 0, e[13] = 0, e[14] = 2 * i * r * o, e[15] = 0, e;
}
function wn(e, t, n, r, i, a, o) {
	let s = 1 / (t - n), c = 1 / (r - i), l = 1 / (a - o);
	return e[0] = -2 * s, e[1] = 0, e[2] = 0, e[3] = 0, e[4] = 0, e[5] = -2 * c, e[6] = 0, e[7] = 0, e[8] = 0, e[9] = 0, e[10] = 2 * l, e[11] = 0, e[12] = (t + n) * s, e[13] = (i + r) * c, e[14] = (o + a) * l, e[15] = 1, e;
}
function Tn(e, t, n, r) {
	let i = t[0], a = t[1], o = t[2], s = r[0], c = r[1], l = r[2], u = i - n[0], d = a - n[1], f = o - n[2], p = u * u + d * d + f * f;
	p === 0 ? f = 1 : (p = 1 / Math.sqrt(p), u *= p, d *= p, f *= p);
	let m = c * f - l * d, h = l * u - s * f, g = s * d - c * u;
	return p = m * m + h * h + g * g, p === 0 && (l ? s += 1e-6 : c ? l += 1e-6 : c += 1e-6, m = c * f - l * d, h = l * u - s * f, g = s * d - c * u, p = m * m + h * h + g * g), p = 1 / Math.sqrt(p), m *= p, h *= p, g *= p, e[0] = m, e[1] = h, e[2] = g, e[3] = 0, e[4] = d * g - f * h, e[5] = f * m - u * g, e[6] = u * h - d * m, e[7] = 0, e[8] = u, e[9] = d, e[10] = f, e[11] = 0, e[12] = i, e[13] = a, e[14] = o, e[15] = 1, e;
}
function En(e, t, n) {
	return e[0] = t[0] + n[0], e[1] = t[1] + n[1], e[2] = t[2] + n[2], e[3] = t[3] + n[3], e[4] = t[4] + n[4], e[5] = t[5] + n[5], e[6] = t[6] + n[6], e[7] = t[7] + n[7], e[8] = t[8] + n[8], e[9] = t[9] + n[9], e[10] = t[10] + n[10], e[11] = t[11] + n[11], e[12] = t[12] + n[12], e[13] = t[13] + n[13], e[14] = t[14] + n[14], e[15] = t[15] + n[15], e;
}
function Dn(e, t, n) {
	return e[0] = t[0] - n[0], e[1] = t[1] - n[1], e[2] = t[2] - n[2], e[3] = t[3] - n[3], e[4] = t[4] - n[4], e[5] = t[5] - n[5], e[6] = t[6] - n[6], e[7] = t[7] - n[7], e[8] = t[8] - n[8], e[9] = t[9] - n[9], e[10] = t[10] - n[10], e[11] = t[11] - n[11], e[12] = t[12] - n[12], e[13] = t[13] - n[13], e[14] = t[14] - n[14], e[15] = t[15] - n[15], e;
}
function On(e, t, n) {
	return e[0] = t[0] * n, e[1] = t[1] * n, e[2] = t[2] * n, e[3] = t[3] * n, e[4] = t[4] * n, e[5] = t[5] * n, e[6] = t[6] * n, e[7] = t[7] * n, e[8] = t[8] * n, e[9] = t[9] * n, e[10] = t[10] * n, e[11] = t[11] * n, e[12] = t[12] * n, e[13] = t[13] * n, e[14] = t[14] * n, e[15] = t[15] * n, e;
}
// node_modules/ogl/src/math/Mat4.js
var X = class extends Array {
	constructor(e = 1, t = 0, n = 0, r = 0, i = 0, a = 1, o = 0, s = 0, c = 0, l = 0, u = 1, d = 0, f = 0, p = 0, m = 0, h = 1) {
		return super(e, t, n, r, i, a, o, s, c, l, u, d, f, p, m, h), this;
	}
	get x() {
		return this[12];
	}
	get y() {
		return this[13];
	}
	get z() {
		return this[14];
	}
	get w() {
		return this[15];
	}
	set x(e) {
		this[12] = e;
	}
	set y(e) {
		this[13] = e;
	}
	set z(e) {
		this[14] = e;
	}
	set w(e) {
		this[15] = e;
	}
	set(e, t, n, r, i, a, o, s, c, l, u, d, f, p, m, h) {
		return e.length ? this.copy(e) : (cn(this, e, t, n, r, i, a, o, s, c, l, u, d, f, p, m, h), this);
	}
	translate(e, t = this) {
		return pn(this, t, e), this;
	}
	rotate(e, t, n = this) {
		return hn(this, n, e, t), this;
	}
	scale(e, t = this) {
		return mn(this, t, typeof e == "number" ? [
			e,
			e,
			e
		] : e), this;
	}
	add(e, t) {
		return t ? En(this, e, t) : En(this, this, e), this;
	}
	sub(e, t) {
		return t ? Dn(this, e, t) : Dn(this, this, e), this;
	}
	multiply(e, t) {
		return e.length ? t ? fn(this, e, t) : fn(this, this, e) : On(this, this, e), this;
	}
	identity() {
		return ln(this), this;
	}
	copy(e) {
		return sn(this, e), this;
	}
	fromPerspective({ fov: e, aspect: t, near: n, far: r } = {}) {
		return Cn(this, e, t, n, r), this;
	}
	fromOrthogonal({ left: e, right: t, bottom: n, top: r, near: i, far: a }) {
		return wn(this, e, t, n, r, i, a), this;
	}
	fromQuaternion(e) {
		return Sn(this, e), this;
	}
	setPosition(e) {
		return this.x = e[0], this.y = e[1], this.z = e[2], this;
	}
	inverse(e = this) {
		return un(this, e), this;
	}
	compose(e, t, n) {
		return xn(this, e, t, n), this;
	}
	decompose(e, t, n) {
		return bn(this, e, t, n), this;
	}
	getRotation(e) {
		return yn(e, this), this;
	}
	getTranslation(e) {
		return gn(e, this), this;
	}
	getScaling(e) {
		return _n(e, this), this;
	}
	getMaxScaleOnAxis() {
		return vn(this);
	}
	lookAt(e, t, n) {
		return Tn(this, e, t, n), this;
	}
	determinant() {
		return dn(this);
	}
	fromArray(e, t = 0) {
		return this[0] = e[t], this[1] = e[t + 1], this[2] = e[t + 2], this[3] = e[t + 3], this[4] = e[t + 4], this[5] = e[t + 5], this[6] = e[t + 6], this[7] = e[t + 7], this[8] = e[t + 8], this[9] = e[t + 9], this[10] = e[t + 10], this[11] = e[t + 11], this[12] = e[t + 12], this[13] = e[t + 13], this[14] = e[t + 14], this[15] = e[t + 15], this;
	}
	toArray(e = [], t = 0) {
		return e[t] = this[0], e[t + 1] = this[1], e[t + 2] = this[2], e[t + 3] = this[3], e[t + 4] = this[4], e[t + 5] = this[5], e[t + 6] = this[6], e[t + 7] = this[7], e[t + 8] = this[8], e[t + 9] = this[9], e[t + 10] = this[10], e[t + 11] = this[11], e[t + 12] = this[12], e[t + 13] = this[13], e[t + 14] = this[14], e[t + 15] = this[15], e;
	}
};
// node_modules/ogl/src/math/functions/EulerFunc.js
function kn(e, t, n = "YXZ") {
	return n === "XYZ" ? (e[1] = Math.asin(Math.min(Math.max(t[8], -1), 1)), Math.abs(t[8]) < .99999 ? (e[0] = Math.atan2(-t[9], t[10]), e[2] = Math.atan2(-t[4], t[0])) : (e[0] = Math.atan2(t[6], t[5]), e[2] = 0)) : n === "YXZ" ? (e[0] = Math.asin(-Math.min(Math.max(t[9], -1), 1)), Math.abs(t[9]) < .99999 ? (e[1] = Math.atan2(t[8], t[10]), e[2] = Math.atan2(t[1], t[5])) : (e[1] = Math.atan2(-t[2], t[0]), e[2] = 0)) : n === "ZXY" ? (e[0] = Math.asin(Math.min(Math.max(t[6], -1), 1)), Math.abs(t[6]) < .99999 ? (e[1] = Math.atan2(-t[2], t[10]), e[2] = Math.atan2(-t[4], t[5])) : (e[1] = 0, e[2] = Math.atan2(t[1], t[0]))) : n === "ZYX" ? (e[1] = Math.asin(-Math.min(Math.max(t[2], -1), 1)), Math.abs(t[2]) < .99999 ? (e[0] = Math.atan2(t[6], t[10]), e[2] = Math.atan2(t[1], t[0])) : (e[0] = 0, e[2] = Math.atan2(-t[4], t[5]))) : n === "YZX" ? (e[2] = Math.asin(Math.min(Math.max(t[1], -1), 1)), Math.abs(t[1]) < .99999 ? (e[0] = Math.atan2(-t[9], t[5]), e[1] = Math.atan2(-t[2], t[0])) : (e[0] = 0, e[1] = Math.atan2(t[8], t[10]))) : n === "XZY" && (e[2] = Math.asin(-Math.min(Math.max(t[4], -1), 1)), Math.abs(t[4]) < .99999 ? (e[0] = Math.atan2(t[6], t[5]), e[1] = Math.atan2(t[8], t[0])) : (e[0] = Math.atan2(-t[9], t[10]), e[1] = 0)), e;
}
// node_modules/ogl/src/math/Euler.js
var An = /* @__PURE__ */ new X(), jn = class extends Array {
	constructor(e = 0, t = e, n = e, r = "YXZ") {
		super(e, t, n), this.order = r, this.onChange = () => {}, this._target = this;
		let i = [
			"0",
			"1",
			"2"
		];
		return new Proxy(this, { set(e, t) {
			let n = Reflect.set(...arguments);
			return n && i.includes(t) && e.onChange(), n;
		} });
	}
	get x() {
		return this[0];
	}
	get y() {
		return this[1];
	}
	get z() {
		return this[2];
	}
	set x(e) {
		this._target[0] = e, this.onChange();
	}
	set y(e) {
		this._target[1] = e, this.onChange();
	}
	set z(e) {
		this._target[2] = e, this.onChange();
	}
	set(e, t = e, n = e) {
		return e.length ? this.copy(e) : (this._target[0] = e, this._target[1] = t, this._target[2] = n, this.onChange(), this);
	}
	copy(e) {
		return this._target[0] = e[0], this._target[1] = e[1], this._target[2] = e[2], this.onChange(), this;
	}
	reorder(e) {
		return this._target.order = e, this.onChange(), this;
	}
	fromRotationMatrix(e, t = this.order) {
		return kn(this._target, e, t), this.onChange(), this;
	}
	fromQuaternion(e, t = this.order, n) {
		return An.fromQuaternion(e), this._target.fromRotationMatrix(An, t), n || this.onChange(), this;
	}
	fromArray(e, t = 0) {
		return this._target[0] = e[t], this._target[1] = e[t + 1], this._target[2] = e[t + 2], this;
	}
	toArray(e = [], t = 0) {
		return e[t] = this[0], e[t + 1] = this[1], e[t + 2] = this[2], e;
	}
}, Z = class {
	constructor() {
		this.parent = null, this.children = [], this.visible = !0, this.matrix = new X(), this.worldMatrix = new X(), this.matrixAutoUpdate = !0, this.worldMatrixNeedsUpdate = !1, this.position = new K(), this.quaternion = new an(), this.scale = new K(1), this.rotation = new jn(), this.up = new K(0, 1, 0), this.rotation._target.onChange = () => this.quaternion.fromEuler(this.rotation, !0), this.quaternion._target.onChange = () => this.rotation.fromQuaternion(this.quaternion, void 0, !0);
	}
	setParent(e, t = !0) {
		this.parent && e !== this.parent && this.parent.removeChild(this, !1), this.parent = e, t && e && e.addChild(this, !1);
	}
	addChild(e, t = !0) {
		~this.children.indexOf(e) || this.children.push(e), t && e.setParent(this, !1);
	}
	removeChild(e, t = !0) {
		~this.children.indexOf(e) && this.children.splice(this.children.indexOf(e), 1), t && e.setParent(null, !1);
	}
	updateMatrixWorld(e) {
		this.matrixAutoUpdate && this.updateMatrix(), (this.worldMatrixNeedsUpdate || e) && (this.parent === null ? this.worldMatrix.copy(this.matrix) : this.worldMatrix.multiply(this.parent.worldMatrix, this.matrix), this.worldMatrixNeedsUpdate = !1, e = !0);
		for (let t = 0, n = this.children.length; t < n; t++) this.children[t].updateMatrixWorld(e);
	}
	updateMatrix() {
		this.matrix.compose(this.quaternion, this.position, this.scale), this.worldMatrixNeedsUpdate = !0;
	}
	traverse(e) {
		if (!e(this)) for (let t = 0, n = this.children.length; t < n; t++) this.children[t].traverse(e);
	}
	decompose() {
		this.matrix.decompose(this.quaternion._target, this.position, this.scale), this.rotation.fromQuaternion(this.quaternion);
	}
	lookAt(e, t = !1) {
		t ? this.matrix.lookAt(this.position, e, this.up) : this.matrix.lookAt(e, this.position, this.up), this.matrix.getRotation(this.quaternion._target), this.rotation.fromQuaternion(this.quaternion);
	}
}, Mn = /* @__PURE__ */ new X(), Nn = /* @__PURE__ */ new K(), Pn = /* @__PURE__ */ new K(), Fn = class extends Z {
	constructor(e, { near: t = .1, far: n = 100, fov: r = 45, aspect: i = 1, left: a, right: o, bottom: s, top: c, zoom: l = 1 } = {}) {
		super(), Object.assign(this, {
			near: t,
			far: n,
			fov: r,
			aspect: i,
			left: a,
			right: o,
			bottom: s,
			top: c,
			zoom: l
		}), this.projectionMatrix = new X(), this.viewMatrix = new X(), this.projectionViewMatrix = new X(), this.worldPosition = new K(), this.type = a || o ? "orthographic" : "perspective", this.type === "orthographic" ? this.orthographic() : this.perspective();
	}
	perspective({ near: e = this.near, far: t = this.far, fov: n = this.fov, aspect: r = this.aspect } = {}) {
		return Object.assign(this, {
			near: e,
			far: t,
			fov: n,
			aspect: r
		}), this.projectionMatrix.fromPerspective({
			fov: Math.PI / 180 * n,
			aspect: r,
			near: e,
			far: t
		}), this.type = "perspective", this;
	}
	orthographic({ near: e = this.near, far: t = this.far, left: n = this.left || -1, right: r = this.right || 1, bottom: i = this.bottom || -1, top: a = this.top || 1, zoom: o = this.zoom } = {}) {
		return Object.assign(this, {
			near: e,
			far: t,
			left: n,
			right: r,
			bottom: i,
			top: a,
			zoom: o
		}), n /= o, r /= o, i /= o, a /= o, this.projectionMatrix.fromOrthogonal({
			left: n,
			right: r,
			bottom: i,
			top: a,
			near: e,
			far: t
		}), this.type = "orthographic", this;
	}
	updateMatrixWorld() {
		return super.updateMatrixWorld(), this.viewMatrix.inverse(this.worldMatrix), this.worldMatrix.getTranslation(this.worldPosition), this.projectionViewMatrix.multiply(this.projectionMatrix, this.viewMatrix), this;
	}
	updateProjectionMatrix() {
		return this.type === "perspective" ? this.perspective() : this.orthographic();
	}
	lookAt(e) {
		return super.lookAt(e, !0), this;
	}
	project(e) {
		return e.applyMatrix4(this.viewMatrix), e.applyMatrix4(this.projectionMatrix), this;
	}
	unproject(e) {
		return e.applyMatrix4(Mn.inverse(this.projectionMatrix)), e.applyMatrix4(this.worldMatrix), this;
	}
	updateFrustum() {
		this.frustum ||= [
			new K(),
			new K(),
			new K(),
			new K(),
			new K(),
			new K()
		];
		let e = this.projectionViewMatrix;
		this.frustum[0].set(e[3] - e[0], e[7] - e[4], e[11] - e[8]).constant = e[15] - e[12], this.frustum[1].set(e[3] + e[0], e[7] + e[4], e[11] + e[8]).constant = e[15] + e[12], this.frustum[2].set(e[3] + e[1], e[7] + e[5], e[11] + e[9]).constant = e[15] + e[13], this.frustum[3].set(e[3] - e[1], e[7] - e[5], e[11] - e[9]).constant = e[15] - e[13], this.frustum[4].set(e[3] - e[2], e[7] - e[6], e[11] - e[10]).constant = e[15] - e[14], this.frustum[5].set(e[3] + e[2], e[7] + e[6], e[11] + e[10]).constant = e[15] + e[14];
		for (let e = 0; e < 6; e++) {
			let t = 1 / this.frustum[e].distance();
			this.frustum[e].multiply(t), this.frustum[e].constant *= t;
		}
	}
	frustumIntersectsMesh(e, t = e.worldMatrix) {
		if (!e.geometry.attributes.position || (e.geometry.bounds && e.geometry.bounds.radius !== Infinity || e.geometry.computeBoundingSphere(), !e.geometry.bounds)) return !0;
		let n = Nn;
		n.copy(e.geometry.bounds.center), n.applyMatrix4(t);
		let r = e.geometry.bounds.radius * t.getMaxScaleOnAxis();
		return this.frustumIntersectsSphere(n, r);
	}
	frustumIntersectsSphere(e, t) {
		let n = Pn;
		for (let r = 0; r < 6; r++) {
			let i = this.frustum[r];
			if (n.copy(i).dot(e) + i.constant < -t) return !1;
		}
		return !0;
	}
};
// node_modules/ogl/src/math/functions/Mat3Func.js
function In(e, t) {
	return e[0] = t[0], e[1] = t[1], e[2] = t[2], e[3] = t[4], e[4] = t[5], e[5] = t[6], e[6] = t[8], e[7] = t[9], e[8] = t[10], e;
}
function Ln(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = n + n, s = r + r, c = i + i, l = n * o, u = r * o, d = r * s, f = i * o, p = i * s, m = i * c, h = a * o, g = a * s, _ = a * c;
	return e[0] = 1 - d - m, e[3] = u - _, e[6] = f + g, e[1] = u + _, e[4] = 1 - l - m, e[7] = p - h, e[2] = f - g, e[5] = p + h, e[8] = 1 - l - d, e;
}
function Rn(e, t) {
	return e[0] = t[0], e[1] = t[1], e[2] = t[2], e[3] = t[3], e[4] = t[4], e[5] = t[5], e[6] = t[6], e[7] = t[7], e[8] = t[8], e;
}
function zn(e, t, n, r, i, a, o, s, c, l) {
	return e[0] = t, e[1] = n, e[2] = r, e[3] = i, e[4] = a, e[5] = o, e[6] = s, e[7] = c, e[8] = l, e;
}
function Bn(e) {
	return e[0] = 1, e[1] = 0, e[2] = 0, e[3] = 0, e[4] = 1, e[5] = 0, e[6] = 0, e[7] = 0, e[8] = 1, e;
}
function Vn(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = t[4], s = t[5], c = t[6], l = t[7], u = t[8], d = u * o - s * l, f = -u * a + s * c, p = l * a - o * c, m = n * d + r * f + i * p;
	return m ? (m = 1 / m, e[0] = d * m, e[1] = (-u * r + i * l) * m, e[2] = (s * r - i * o) * m, e[3] = f * m, e[4] = (u * n - i * c) * m, e[5] = (-s * n + i * a) * m, e[6] = p * m, e[7] = (-l * n + r * c) * m, e[8] = (o * n - r * a) * m, e) : null;
}
function Hn(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = t[3], s = t[4], c = t[5], l = t[6], u = t[7], d = t[8], f = n[0], p = n[1], m = n[2], h = n[3], g = n[4], _ = n[5], v = n[6], y = n[7], b = n[8];
	return e[0] = f * r + p * o + m * l, e[1] = f * i + p * s + m * u, e[2] = f * a + p * c + m * d, e[3] = h * r + g * o + _ * l, e[4] = h * i + g * s + _ * u, e[5] = h * a + g * c + _ * d, e[6] = v * r + y * o + b * l, e[7] = v * i + y * s + b * u, e[8] = v * a + y * c + b * d, e;
}
function Un(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = t[3], s = t[4], c = t[5], l = t[6], u = t[7], d = t[8], f = n[0], p = n[1];
	return e[0] = r, e[1] = i, e[2] = a, e[3] = o, e[4] = s, e[5] = c, e[6] = f * r + p * o + l, e[7] = f * i + p * s + u, e[8] = f * a + p * c + d, e;
}
function Wn(e, t, n) {
	let r = t[0], i = t[1], a = t[2], o = t[3], s = t[4], c = t[5], l = t[6], u = t[7], d = t[8], f = Math.sin(n), p = Math.cos(n);
	return e[0] = p * r + f * o, e[1] = p * i + f * s, e[2] = p * a + f * c, e[3] = p * o - f * r, e[4] = p * s - f * i, e[5] = p * c - f * a, e[6] = l, e[7] = u, e[8] = d, e;
}
function Gn(e, t, n) {
	let r = n[0], i = n[1];
	return e[0] = r * t[0], e[1] = r * t[1], e[2] = r * t[2], e[3] = i * t[3], e[4] = i * t[4], e[5] = i * t[5], e[6] = t[6], e[7] = t[7], e[8] = t[8], e;
}
function Kn(e, t) {
	let n = t[0], r = t[1], i = t[2], a = t[3], o = t[4], s = t[5], c = t[6], l = t[7], u = t[8], d = t[9], f = t[10], p = t[11], m = t[12], h = t[13], g = t[14], _ = t[15], v = n * s - r * o, y = n * c - i * o, b = n * l - a * o, x = r * c - i * s, S = r * l - a * s, C = i * l - a * c, w = u * h - d * m, T = u * g - f * m, E = u * _ - p * m, D = d * g - f * h, O = d * _ - p * h, k = f * _ - p * g, A = v * k - y * O + b * D + x * E - S * T + C * w;
	return A ? (A = 1 / A, e[0] = (s * k - c * O + l * D) * A, e[1] = (c * E - o * k - l * T) * A, e[2] = (o * O - s * E + l * w) * A, e[3] = (i * O - r * k - a * D) * A, e[4] = (n * k - i * E + a * T) * A, e[5] = (r * E - n * O - a * w) * A, e[6] = (h * C - g * S + _ * x) * A, e[7] = (g * b - m * C - _ * y) * A, e[8] = (m * S - h * b + _ * v) * A, e) : null;
}
// node_modules/ogl/src/math/Mat3.js
var qn = class extends Array {
	constructor(e = 1, t = 0, n = 0, r = 0, i = 1, a = 0, o = 0, s = 0, c = 1) {
		return super(e, t, n, r, i, a, o, s, c), this;
	}
	set(e, t, n, r, i, a, o, s, c) {
		return e.length ? this.copy(e) : (zn(this, e, t, n, r, i, a, o, s, c), this);
	}
	translate(e, t = this) {
		return Un(this, t, e), this;
	}
	rotate(e, t = this) {
		return Wn(this, t, e), this;
	}
	scale(e, t = this) {
		return Gn(this, t, e), this;
	}
	multiply(e, t) {
		return t ? Hn(this, e, t) : Hn(this, this, e), this;
	}
	identity() {
		return Bn(this), this;
	}
	copy(e) {
		return Rn(this, e), this;
	}
	fromMatrix4(e) {
		return In(this, e), this;
	}
	fromQuaternion(e) {
		return Ln(this, e), this;
	}
	fromBasis(e, t, n) {
		return this.set(e[0], e[1], e[2], t[0], t[1], t[2], n[0], n[1], n[2]), this;
	}
	inverse(e = this) {
		return Vn(this, e), this;
	}
	getNormalMatrix(e) {
		return Kn(this, e), this;
	}
}, Jn = 0, Yn = class extends Z {
	constructor(e, { geometry: t, program: n, mode: r = e.TRIANGLES, frustumCulled: i = !0, renderOrder: a = 0 } = {}) {
		super(), e.canvas || console.error("gl not passed as first argument to Mesh"), this.gl = e, this.id = Jn++, this.geometry = t, this.program = n, this.mode = r, this.frustumCulled = i, this.renderOrder = a, this.modelViewMatrix = new X(), this.normalMatrix = new qn(), this.beforeRenderCallbacks = [], this.afterRenderCallbacks = [];
	}
	onBeforeRender(e) {
		return this.beforeRenderCallbacks.push(e), this;
	}
	onAfterRender(e) {
		return this.afterRenderCallbacks.push(e), this;
	}
	draw({ camera: e } = {}) {
		e && (this.program.uniforms.modelMatrix || Object.assign(this.program.uniforms, {
			modelMatrix: { value: null },
			viewMatrix: { value: null },
			modelViewMatrix: { value: null },
			normalMatrix: { value: null },
			projectionMatrix: { value: null },
			cameraPosition: { value: null }
		}), this.program.uniforms.projectionMatrix.value = e.projectionMatrix, this.program.uniforms.cameraPosition.value = e.worldPosition, this.program.uniforms.viewMatrix.value = e.viewMatrix, this.modelViewMatrix.multiply(e.viewMatrix, this.worldMatrix), this.normalMatrix.getNormalMatrix(this.modelViewMatrix), this.program.uniforms.modelMatrix.value = this.worldMatrix, this.program.uniforms.modelViewMatrix.value = this.modelViewMatrix, this.program.uniforms.normalMatrix.value = this.normalMatrix), this.beforeRenderCallbacks.forEach((t) => t && t({
			mesh: this,
			camera: e
		}));
		let t = this.program.cullFace && this.worldMatrix.determinant() < 0;
		this.program.use({ flipFaces: t }), this.geometry.draw({
			mode: this.mode,
			program: this.program
		}), this.afterRenderCallbacks.forEach((t) => t && t({
			mesh: this,
			camera: e
		}));
	}
}, Q = {
	hidden: 0,
	faded: 85,
	ring: 170,
	solid: 255
}, Xn = "#version 300 es\nin vec3 position;\nin float diameter;\nin vec4 colour;\nuniform mat4 modelViewMatrix, projectionMatrix;\nuniform float pixels, least;\nout vec3 tint;\nflat out float look;\nvoid main() {\n  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);\n  gl_PointSize = max(pixels * diameter / gl_Position.w, least);\n  tint = colour.rgb;\n  look = colour.a;\n  if (look < 0.1) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);\n}", Zn = "#version 300 es\nprecision mediump float;\nin vec3 tint;\nflat in float look;\nuniform vec3 background;\nout vec4 shown;\nvoid main() {\n  vec2 at = 2.0 * gl_PointCoord - 1.0;\n  float r2 = dot(at, at);\n  if (r2 > 1.0 || (look > 0.5 && look < 0.8 && r2 < 0.45)) discard;\n  vec3 normal = vec3(at.x, -at.y, sqrt(1.0 - r2));\n  float light = 0.62 + 0.42 * dot(normal, vec3(-0.38, 0.56, 0.73));\n  float shine = 0.22 * pow(max(dot(normal, vec3(-0.25, 0.42, 0.87)), 0.0), 24.0);\n  vec3 lit = look > 0.8 ? tint * light + shine : tint;\n  shown = vec4(look < 0.5 ? mix(background, tint, 0.28) : lit, 1.0);\n}";
function Qn(e, t) {
	let n = new Float32Array(3 * t), r = new Float32Array(t), i = new Uint8Array(4 * t), a = new Ot(e, {
		position: {
			size: 3,
			data: n,
			usage: e.DYNAMIC_DRAW
		},
		diameter: {
			size: 1,
			data: r,
			usage: e.DYNAMIC_DRAW
		},
		colour: {
			size: 4,
			data: i,
			type: e.UNSIGNED_BYTE,
			normalized: !0,
			usage: e.DYNAMIC_DRAW
		}
	}), o = {
		pixels: { value: 1 },
		least: { value: 2 },
		background: { value: [
			1,
			1,
			1
		] }
	}, s = new jt(e, {
		vertex: Xn,
		fragment: Zn,
		uniforms: o
	});
	return {
		mesh: new Yn(e, {
			mode: e.POINTS,
			geometry: a,
			program: s,
			frustumCulled: !1
		}),
		positions: n,
		diameters: r,
		colours: i,
		changed: () => {
			for (let e of Object.values(a.attributes)) e.needsUpdate = !0;
		},
		setPixels: (e, t) => {
			o.pixels.value = e, o.least.value = t;
		},
		setBackground: (e) => {
			o.background.value = [...e];
		}
	};
}
// src/scene/strokes.ts
var $n = "#version 300 es\nin vec3 position;\nin vec4 colour;\nuniform mat4 modelViewMatrix, projectionMatrix;\nout vec4 tint;\nvoid main() {\n  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);\n  tint = colour;\n}", er = "#version 300 es\nprecision mediump float;\nin vec4 tint;\nout vec4 shown;\nvoid main() {\n  shown = vec4(tint.rgb * tint.a, tint.a);\n}";
function tr(e) {
	let t = new jt(e, {
		vertex: $n,
		fragment: er,
		transparent: !0,
		depthWrite: !1
	});
	t.setBlendFunc(e.ONE, e.ONE_MINUS_SRC_ALPHA);
	let n = new Yn(e, {
		mode: e.LINES,
		geometry: nr(e, []),
		program: t,
		frustumCulled: !1
	});
	return {
		mesh: n,
		set: (t) => {
			n.geometry.remove(), n.geometry = nr(e, t), n.visible = t.length > 0;
		}
	};
}
function nr(e, t) {
	let n = new Float32Array(6 * Math.max(1, t.length)), r = new Uint8Array(8 * Math.max(1, t.length));
	return t.forEach(({ from: e, to: t, ink: i }, a) => {
		n.set([...e, ...t], 6 * a);
		let o = [
			i[0],
			i[1],
			i[2],
			255 * i[3]
		];
		r.set([...o, ...o], 8 * a);
	}), new Ot(e, {
		position: {
			size: 3,
			data: n
		},
		colour: {
			size: 4,
			data: r,
			type: e.UNSIGNED_BYTE,
			normalized: !0
		}
	});
}
// src/scene/stage.ts
var rr = 2.5, ir = 2, ar = class {
	holder;
	orbit;
	canvas;
	fruits;
	marks;
	ground;
	lines;
	redraw;
	renderer;
	camera;
	scene = new Z();
	drawnWatchers = [];
	constructor(e, t, n) {
		this.holder = e, this.orbit = t, this.renderer = new Rt({
			dpr: Math.min(devicePixelRatio, ir),
			antialias: !0,
			alpha: !1
		});
		let r = this.renderer.gl;
		this.canvas = r.canvas, e.append(this.canvas), this.camera = new Fn(r, { fov: 28 }), this.camera.up = new K(0, 0, 1), this.fruits = Qn(r, n), this.marks = Qn(r, 1), this.marks.mesh.program.depthTest = !1, this.ground = tr(r), this.lines = tr(r);
		for (let { mesh: e } of [
			this.ground,
			this.fruits,
			this.lines,
			this.marks
		]) e.setParent(this.scene);
		this.redraw = Pe(() => this.draw()), new ResizeObserver(() => this.resize()).observe(e), t.looking.watch(() => this.redraw());
	}
	onDrawn(e) {
		this.drawnWatchers.push(e);
	}
	setBackground(e) {
		let [t, n, r] = e.map((e) => e / 255);
		this.renderer.gl.clearColor(t, n, r, 1);
		for (let e of [this.fruits, this.marks]) e.setBackground([
			t,
			n,
			r
		]);
		this.redraw();
	}
	project(e, t, n) {
		let r = this.camera.projectionViewMatrix, i = r[3] * e + r[7] * t + r[11] * n + r[15];
		if (i <= 0) return null;
		let a = (r[0] * e + r[4] * t + r[8] * n + r[12]) / i, o = (r[1] * e + r[5] * t + r[9] * n + r[13]) / i;
		return {
			x: (1 + a) / 2 * this.width,
			y: (1 - o) / 2 * this.height,
			depth: i
		};
	}
	pixelsPerMetre(e) {
		return this.height / (2 * Math.tan(28 * Math.PI / 360)) / e;
	}
	get width() {
		return this.holder.clientWidth;
	}
	get height() {
		return this.holder.clientHeight;
	}
	resize() {
		this.width !== 0 && this.height !== 0 && (this.renderer.setSize(this.width, this.height), this.orbit.setAspect(this.width / this.height), this.redraw());
	}
	draw() {
		if (this.width === 0 || this.height === 0) return;
		let { looking: e } = this.orbit, { distance: t, target: n } = e.value;
		this.camera.perspective({
			aspect: this.width / this.height,
			near: t / 100,
			far: t * 20 + 1e3
		}), this.camera.position.set(...Xe(e.value)), this.camera.lookAt(new K(...n)), this.camera.updateMatrixWorld();
		let r = this.renderer.dpr;
		this.fruits.setPixels(this.pixelsPerMetre(1) * r, rr * r), this.marks.setPixels(this.pixelsPerMetre(1) * r, 16 * r), this.renderer.render({
			scene: this.scene,
			camera: this.camera,
			frustumCull: !1,
			sort: !1
		});
		for (let e of this.drawnWatchers) e();
	}
}, or = 54, sr = .45;
function cr({ season: t, filter: n }, r) {
	let i = rt(t).low[2] - sr, a = t.trees.map((e, t) => ({
		tree: e,
		i: t
	})).filter(({ tree: e }) => e.name).map(({ tree: t, i: r }) => ({
		at: t.middle,
		i: r,
		button: e("button", {
			type: "button",
			click: () => n.set({
				...n.value,
				tree: n.value.tree === r ? null : r
			})
		}, t.label)
	}));
	return n.watch(({ tree: e }) => {
		for (let { button: t, i: n } of a) t.setAttribute("aria-pressed", String(e === n));
	}), r.onDrawn(() => {
		let e = -Infinity;
		for (let { at: t, button: n } of a) {
			let a = r.project(t[0], t[1], i), o = a !== null && a.x - e >= or && lr(a, r.holder);
			n.hidden = !o, o && (e = a.x, n.style.transform = `translate(-50%, 0) translate(${Math.round(a.x)}px, ${Math.round(a.y)}px)`);
		}
	}), e("div", {
		class: "tree-labels",
		role: "group",
		"aria-label": "Trees"
	}, ...a.map((e) => e.button));
}
function lr({ x: e, y: t }, n) {
	return e > 10 && e < n.clientWidth - 10 && t > 0 && t < n.clientHeight - 24;
}
// src/parts/row_view.ts
function ur(t) {
	let { season: n, selected: r } = t, i = rt(n), a = new Ye(i), o = e("div", {
		class: "tip",
		role: "status",
		hidden: !0
	}), s = e("div", { class: "row-view" }, o), c = new ar(s, a, n.n);
	c.canvas.tabIndex = 0, c.canvas.setAttribute("role", "application"), c.canvas.setAttribute("aria-label", "The row in 3D. The table of fruits has the same facts. Arrows move, A D W S turn, plus and minus zoom, 1 side, 2 above, 3 aslant."), s.append(cr(t, c));
	let l = Pe(() => dr(t, c));
	return Ne([
		t.time,
		t.colour,
		t.filter,
		t.target
	], l), Ne([r, t.time], () => fr(t, c)), B.watch(() => {
		c.setBackground(V("sky")), c.ground.set(Ge(n, i)), l();
	}), Re(c.canvas, a, {
		hover: (e, n) => pr(t, o, et(c, e, n), e, n),
		leave: () => o.hidden = !0,
		press: (e, t) => r.set(et(c, e, t))
	}), {
		root: s,
		orbit: a
	};
}
function dr(e, t) {
	let { history: n, season: r } = e, i = e.time.value, [a, o, s] = [
		xe(e),
		je(e),
		n.placeAt(i)
	], c = n.visitAt(i), l = e.colour.value === "state", { positions: u, diameters: d, colours: f } = t.fruits;
	for (let e = 0; e < r.n; e++) {
		let t = n.first[e] <= c, r = n.isThere(e, i) || t && l ? o(e) ? n.wasSeen(e, c) ? "solid" : "ring" : "faded" : "hidden";
		f.set(a.of(e, i), 4 * e), f[4 * e + 3] = Q[r], d[e] = n.sizeAt(e, i) / 1e3, s(e, u, 3 * e);
	}
	t.fruits.changed(), t.redraw();
}
function fr({ selected: e, time: t, history: n }, r) {
	let { marks: i } = r, a = e.value;
	i.colours.set([...V("accent"), a === null ? Q.hidden : Q.ring]), a !== null && (n.placeAt(t.value)(a, i.positions, 0), i.diameters[0] = 1.7 * n.sizeAt(a, t.value) / 1e3), i.changed(), r.redraw();
}
function pr(e, t, n, r, i) {
	if (t.hidden = n === null, n === null) return;
	let a = T(e, n), o = u(e.history.sizeAt(n, e.time.value)), s = Number.isNaN(a.rate) ? "" : ` · ${c(a.rate, 2)} mm a day`;
	t.textContent = `Fruit ${a.id} · ${o}${s}`, t.style.transform = `translate(${Math.round(r)}px, ${Math.round(i)}px)`;
}
// src/parts/time_slider.ts
var mr = 9, $ = 864e5;
function hr({ history: n, time: r }) {
	let [i, a] = [n.times[0], n.end], o = e("input", {
		type: "range",
		min: 0,
		max: Math.max(1, Math.round((a - i) / $)),
		step: 1,
		"aria-label": "Date",
		input: () => r.set(i + Number(o.value) * $)
	}), s = e("output", { class: "when" }), c = e("button", {
		type: "button",
		class: "play"
	}), l = n.times[n.times.length - 1], u = (e) => 100 * (e - i) / (a - i || 1), d = n.times.map((e) => t("line", {
		x1: u(e),
		x2: u(e),
		y1: 0,
		y2: 6
	})), f = t("svg", {
		viewBox: "0 0 100 6",
		preserveAspectRatio: "none",
		"aria-hidden": "true"
	}, t("rect", {
		x: u(l),
		width: 100 - u(l),
		y: 2,
		height: 2,
		class: "later"
	}), ...d);
	return r.watch((t) => {
		o.value = String(Math.round((t - i) / $));
		let r = n.visitAt(t), a = t > l + $ / 2 ? "foretold" : `visit ${r + 1} of ${n.times.length}`;
		s.replaceChildren(e("strong", {}, p(t)), ` ${a}`), o.setAttribute("aria-valuetext", `${p(t)}, ${a}`);
	}), a === i ? e("div", { class: "time-slider" }, s) : (gr(c, r, i, a), e("div", { class: "time-slider" }, c, e("div", { class: "track" }, o, f), s));
}
function gr(e, t, n, r) {
	let i = null, a = () => {
		e.textContent = i === null ? "▶" : "❚❚", e.setAttribute("aria-label", i === null ? "Play the season" : "Pause");
	}, o = (e) => {
		if (i === null) return;
		let s = n + (r - n) * (e - i) / (1e3 * mr);
		t.set(Math.min(r, s)), s >= r ? i = null : requestAnimationFrame(o), a();
	};
	e.addEventListener("click", () => {
		let e = t.value >= r ? n : t.value;
		i = i === null ? performance.now() - 1e3 * mr * (e - n) / (r - n) : null, a(), requestAnimationFrame(o);
	}), a();
}
// src/parts/tree_table.ts
function _r(t) {
	let { season: r, filter: i, target: a } = t, o = e("tbody"), s = r.growth, c = [
		"Tree",
		"Fruits",
		"mm now",
		"mm a day"
	];
	s?.harvest && c.push(`mm on ${f(s.harvest)}`);
	let l = () => r.thinning !== null && a.value !== null, u = e("tr"), d = () => {
		let r = l() ? [...c, "To thin"] : c;
		n(u, ...r.map((t) => e("th", { scope: "col" }, t)));
		let i = j(t), a = Math.max(...i.map((e) => e.fruits));
		n(o, ...i.map((e) => vr(t, e, a, l())));
	};
	i.watch(d), a.watch(d);
	let p = e("table", { class: "plain" }, e("thead", {}, u), o);
	return e("section", { class: "card trees" }, e("h2", {}, "Tree by tree"), e("div", {
		class: "scroll",
		tabindex: 0,
		role: "region",
		"aria-label": "Tree by tree"
	}, p));
}
function vr({ season: t, filter: n }, r, i, a) {
	let { growth: o } = t, s = o ? o.nVisits - 1 : 0, u = n.value.tree === r.tree, d = e("button", {
		type: "button",
		"aria-pressed": String(u),
		click: () => n.set({
			...n.value,
			tree: u ? null : r.tree
		})
	}, r.label), f = e("span", {
		class: "bar",
		"aria-hidden": "true"
	});
	f.style.width = `${64 * r.fruits / Math.max(1, i)}px`;
	let p = [
		e("td", {}, f, l(r.fruits)),
		e("td", {}, c(r.block?.mean_mm[s] ?? NaN, 1)),
		e("td", {}, c(r.block?.rate_mm_per_day[1] ?? NaN, 2))
	];
	return o?.harvest && p.push(e("td", {}, c(r.block?.mean_mm[o.times.length - 1] ?? NaN, 1))), a && p.push(e("td", {}, l(r.thin))), e("tr", { class: u ? "chosen" : "" }, e("th", { scope: "row" }, d), ...p);
}
// src/parts/layout.ts
function yr(t, r) {
	let i = ur(r);
	i.orbit.see("free");
	let a = e("div", { class: "row-foot" }, De(r), hr(r)), o = e("section", {
		class: "card row-card",
		"aria-label": "The row"
	}, Te(r, i.orbit), i.root, a);
	n(t, br(r), e("main", {}, le(r), o, _r(r)));
}
function br({ season: t, history: n }) {
	let { times: r } = n, i = `${r.length === 1 ? "1 visit" : `${r.length} visits`}, ${p(r[0])} to ${p(r[r.length - 1])}`;
	return e("header", {}, e("h1", {}, t.name), e("span", { class: "soft" }, i));
}
// src/told/history.ts
var xr = y.indexOf("gone"), Sr = 60;
function Cr(e) {
	let t = e.visits.map((e) => e.time), [n, r] = [e.n, t.length], { starts: i, visit: a, x: o, y: s, z: c, diameterMm: l } = e.sights, [u, d] = [new Int32Array(n), new Int32Array(n)], f = new Uint8Array(n * r), p = new Float32Array(3 * n * r), m = new Float32Array(n * r);
	for (let e = 0; e < n; e++) {
		u[e] = a[i[e]], d[e] = a[i[e + 1] - 1];
		let t = i[e], n = NaN;
		for (let u = 0; u < r; u++) t + 1 < i[e + 1] && a[t + 1] <= u && t++, a[t] === u && (f[e * r + u] = 1), p.set([
			o[t],
			s[t],
			c[t]
		], 3 * (e * r + u)), Number.isNaN(l[t]) || (n = l[t]), m[e * r + u] = n;
	}
	let h = (e) => Math.max(0, t.findLastIndex((t) => t <= e)), g = e.growth;
	return {
		times: t,
		end: g?.harvest ?? t[r - 1],
		first: u,
		last: d,
		wasSeen: (e, t) => f[e * r + t] === 1,
		visitAt: h,
		isThere: (t, n) => {
			let r = h(n);
			return u[t] <= r && !(e.state[t] === xr && r > d[t]);
		},
		stateAt: (t, n) => {
			let i = h(n);
			return e.state[t] === xr && i > d[t] ? "gone" : f[t * r + i] ? i > 0 && i === u[t] ? "new" : "seen" : "missed";
		},
		sizeAt: (e, t) => {
			let n = g ? wr(g.times, g.medianMm, e, t) : NaN;
			if (!Number.isNaN(n)) return n;
			let i = m[e * r + h(t)];
			return Number.isNaN(i) ? Sr : i;
		},
		placeAt: (e) => {
			let n = h(e), i = Math.min(n + 1, r - 1), a = i === n ? 0 : Math.max(0, (e - t[n]) / (t[i] - t[n] || 1));
			return (e, t, o) => {
				let [s, c] = [3 * (e * r + n), 3 * (e * r + i)];
				for (let e = 0; e < 3; e++) t[o + e] = p[s + e] + a * (p[c + e] - p[s + e]);
			};
		}
	};
}
function wr(e, t, n, r) {
	let i = e.length, a = Math.min(i - 1, Math.max(1, e.findIndex((e) => e >= r))), o = e[a] < r ? i - 1 : a, s = o - 1, c = Math.min(1, Math.max(0, (r - e[s]) / (e[o] - e[s] || 1))), [l, u] = [t[n * i + s], t[n * i + o]];
	return Number.isNaN(u) ? l : l + c * (u - l);
}
// src/page.ts
function Tr(e) {
	let t = Cr(e);
	return {
		season: e,
		history: t,
		selected: new z(null),
		time: new z(t.times[t.times.length - 1]),
		colour: new z(e.growth ? "growth" : "state"),
		filter: new z(Ae),
		target: new z(e.thinning?.target ?? null)
	};
}
// src/main.ts
var Er = document.getElementById("page");
try {
	let e = Tr(await b());
	document.title = `${e.season.name} · Pomona`, yr(Er, e);
} catch (t) {
	throw n(Er, e("p", {
		class: "notice",
		role: "alert"
	}, `The orchard cannot be shown: ${String(t)}`)), t;
}
